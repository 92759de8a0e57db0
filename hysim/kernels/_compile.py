"""How a kernel is compiled: one decorator, so that every kernel is compiled alike.

The compiled code is cached beside the source file, or in the user's cache folder. What neither holds is taken from the
wheel, if it brings code for this version of numba, or compiled anew; also where no folder is writable, the disk is full
or a file is damaged. The code releases the interpreter lock, and it follows IEEE 754 (a division by zero is an
infinity): kernels raise nothing, they return codes.
"""

import contextlib
import functools
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum, EnumMeta
from pathlib import Path
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator, NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.sigutils import normalize_signature
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])

sources: dict[Any, str] = {}
"""Text of the functions that stand in no file."""
signed: list[Callable[[], Any]] = []
"""Functions that compile the kernels of one type, one for each kernel."""

_NO_ENTRY = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

PACKAGE = Path(__file__).parent.parent
SHIPPED, SHIPPED_CPU = PACKAGE / "kernels" / "compiled", "x86-64-v3"
_V3 = {"+avx2", "+bmi", "+bmi2", "+cx16", "+f16c", "+fma", "+lzcnt", "+movbe", "+popcnt", "+sahf", "+sse4.2", "+xsave"}


def kernel(function: F) -> F:
    """Compile `function` at its first call with each combination of argument types."""
    return _compiled(function)


def inner(function: F) -> F:
    """As `kernel`, for a function that only kernels call: it has no entry from Python, which takes long to compile."""
    return _compiled(function, (), **_NO_ENTRY)


def uncounted(function: F) -> F:
    """As `inner`, for a function that allocates nothing: its caller holds all arrays, whose owners are not counted."""
    # Each array that is taken out of a tuple or cut would otherwise be counted, which takes longer than short loops.
    return _compiled(function, (), _nrt=False, **_NO_ENTRY)


def uncounted_kernel(function: F) -> F:
    """As `kernel` and as `uncounted`: Python calls it, too, or a kernel by its address."""
    return _compiled(function, (), _nrt=False)


def unfolded(function: F) -> F:
    """As `uncounted` and `inlined`: a call with tuples of arrays would copy a hundred numbers."""
    return _compiled(function, (), _nrt=False, forceinline=True, **_NO_ENTRY)


def inlined(function: F) -> F:
    """As `inner`, compiled into each of its callers, which saves the time of a call and costs that of a copy."""
    return _compiled(function, (), forceinline=True, **_NO_ENTRY)


def inlined_kernel(function: F) -> F:
    """As `inlined`, for a function that Python calls, too: a slope is also evaluated as it is written."""
    return _compiled(function, (), forceinline=True)


def pasted(function: F) -> F:
    """As `inlined`, copied into its callers before these are compiled: it has no code of its own to make and link."""
    return _compiled(function, (), inline="always", **_NO_ENTRY)


def signed_kernel(*signatures: Any, **others: Any) -> Callable[[F], F]:
    """Compile a function for these signatures only: what a typed function pointer needs."""
    return lambda function: _compiled(function, list(signatures), **others)


def signed_closure(*signatures: Any) -> Callable[[F], F]:
    """As `signed_kernel` and `uncounted`, for what closes over kernels: no later process would find it in the cache."""
    compiler: Any = numba.njit
    return lambda function: compiler(list(signatures), nogil=True, error_model="numpy", _nrt=False)(function)


def unstored(function: F) -> F:
    """As `uncounted`, for a function that is written out when its family is defined: the cache holds its callers."""
    compiler: Any = numba.njit
    return compiler(nogil=True, error_model="numpy", _nrt=False, **_NO_ENTRY)(function)  # type: ignore[no-any-return]


class Addressed(types.WrapperAddressProtocol):
    """A kernel, `function`, that numba knows by its signature and its address alone."""

    def __init__(self, function: Any, signature: Any) -> None:
        self.function, self._signature = function, signature

    @functools.cached_property
    def _address(self) -> int:
        return int(_get_wrapper_address(self.function, self._signature))

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        return self._signature


def by_address(function: F, signature: Any) -> F:
    """A kernel that a closure calls by its address: its code is not compiled into the closure once more."""
    address: Any = Addressed(function, signature) if isinstance(function, Dispatcher) else function
    return address  # type: ignore[no-any-return]


def signed_inlined(*signatures: Any) -> Callable[[F], F]:
    """As `inlined`, for these signatures only."""
    return lambda function: _compiled(function, list(signatures), forceinline=True, **_NO_ENTRY)


def _compiled(function: F, signatures: Sequence[Any] = (), **others: Any) -> F:
    compiler: Any = numba.njit
    compiled: Any = compiler(nogil=True, error_model="numpy", **others)(function)
    is_compiled = isinstance(compiled, Dispatcher)  # and not the function, where numba is told to compile nothing
    if is_compiled:
        compiled.get_call_template = _without_constants(compiled.get_call_template)
        compiled._cache = _cache(function)
        if signatures:
            _when_needed(compiled, signatures)
    result: F = compiled
    return result


def _when_needed(compiled: Any, signatures: Sequence[Any]) -> None:
    """Compile for these signatures, and no others, at the first call from Python or from a kernel."""

    def ready(*_: Any, **__: Any) -> Any:
        with global_compiler_lock:
            if compiled._can_compile:  # no other thread has been here
                for signature in signatures:
                    compiled.compile(signature)
                compiled.disable_compile()
                compiled.get_call_template = template_of
                del compiled._compile_for_args
        return compiled  # numba calls it

    template_of = compiled.get_call_template
    compiled.get_call_template = lambda *types_: ready().get_call_template(*types_)
    compiled._compile_for_args = ready
    signed.append(ready)


def _without_constants(template_of: Callable[..., Any]) -> Callable[..., Any]:
    """Types for a call from a kernel, where numba would compile the callee once more for each constant it is given."""

    def template(arguments: Sequence[Any], keywords: Mapping[str, Any]) -> Any:
        named = {name: types.unliteral(kind) for name, kind in keywords.items()}
        return template_of(tuple(types.unliteral(kind) for kind in arguments), named)

    return template


class Shipped(InTreeCacheLocator):
    """The folder of a wheel's compiled code: numba's own files, written by the build (NUMBA_CACHE_LOCATOR_CLASSES)."""

    def get_cache_path(self) -> str:
        return str(SHIPPED / Path(self._py_file).relative_to(PACKAGE).parent)

    def get_source_stamp(self) -> str:  # of all files: the code of a function contains that of others
        return hash_of_sources(PACKAGE)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file) if SHIPPED.exists() and Path(py_file).is_relative_to(PACKAGE) else None


@functools.cache
def hash_of_sources(folder: Path) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(folder.rglob("*.py")))).hexdigest()


class _Cache(FunctionCache):
    """numba's own cache; it stamps code with one file, but the code contains functions and constants of others."""

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        is_ours = Path(self._py_func.__code__.co_filename).is_relative_to(PACKAGE)
        others = "" if is_ours else hashlib.sha256("\n".join(_texts(self._py_func, {})).encode()).hexdigest()
        kernels = [hash_of_sources(PACKAGE / room) for room in ("kernels", "laws")]
        return (*FunctionCache._index_key(self, sig, codegen), *kernels, others)


def _texts(value: Any, known: dict[int, Any]) -> Iterator[str]:
    """Numbers, arrays and functions that stand in the compiled code of a user's function, as texts."""
    plain: Any = value.py_func if isinstance(value, Dispatcher) else value
    if isinstance(plain, FunctionType):
        if id(plain) not in known:
            known[id(plain)] = plain
            yield from _texts_of_function(plain, known)
    elif isinstance(plain, np.ndarray):
        yield f"{plain.dtype} {plain.shape} {plain.tobytes()!r}"
    elif isinstance(plain, (tuple, frozenset, EnumMeta)):
        texts = ["\n".join(_texts(each, known)) for each in plain]
        yield from sorted(texts) if isinstance(plain, frozenset) else texts
    elif isinstance(plain, (int, float, complex, str, bytes, np.generic)):
        yield repr(plain)
    elif isinstance(plain, Enum):
        yield from _texts(plain.value, known)


def _texts_of_function(function: FunctionType, known: dict[int, Any]) -> Iterator[str]:
    codes = [function.__code__]
    for code in codes:
        codes += [each for each in code.co_consts if isinstance(each, CodeType)]
        yield code.co_code.hex()
        yield from _texts(code.co_consts, known)
    for cell in function.__closure__ or ():
        yield from _texts(cell.cell_contents, known)
    if not _is_library(function.__module__):
        names = sorted({name for code in codes for name in code.co_names})
        yield from _texts_of_names(function.__globals__, names, known)


def _texts_of_names(around: Mapping[str, Any], names: Sequence[str], known: dict[int, Any]) -> Iterator[str]:
    for value in (around[name] for name in names if name in around):
        if not isinstance(value, ModuleType):
            yield from _texts(value, known)
        elif id(value) not in known and not _is_library(value.__name__):
            known[id(value)] = value
            yield from _texts_of_names(vars(value), names, known)


def _is_library(name: str) -> bool:
    """Whether a module has a version that changes with its code."""
    return name.partition(".")[0] in ("hysim", "math", "numba", "numpy", "scipy")


class _ShippedFiles(CompileResultCacheImpl):
    _locator_classes = [Shipped]  # noqa: RUF012


class _ShippedCache(_Cache):
    _impl_class = _ShippedFiles  # type: ignore[assignment]

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        triple, _, features = codegen.magic_tuple()
        theirs = SimpleNamespace(magic_tuple=lambda: (triple, SHIPPED_CPU, ""))
        # The bits are those of code for this processor: LLVM contracts and reorders nothing.
        return _Cache._index_key(self, sig, theirs) if _V3.issubset(features.split(",")) else None


def _load_shipped(function: Any, *key: Any) -> Any:
    cache: Any = _ShippedCache
    return cache(function).load_overload(*key)


def _cache(function: Any) -> Any:
    """numba's cache of a function, then the wheel's: as if empty where it cannot be read, and left where it is full."""
    # In place of numba's own ``cache=True``, which ends in an error there. What is compiled is found by the types of
    # its arguments, as in one process: numba's key has the type of the result where a pointer asks for it, so that
    # another process would compile the function once more for a call.
    try:
        maker: Any = _Cache
        cache = maker(function)
    except (OSError, RuntimeError):  # numba found no writable folder
        cache = NullCache()
    save, loads = cache.save_overload, (cache.load_overload, functools.partial(_load_shipped, function))

    def loaded(signature: Any, context: Any) -> Any:
        arguments, result = normalize_signature(signature)
        for load in loads:
            with contextlib.suppress(Exception):  # what unpickling raises depends on where the file was cut
                data = load(arguments, context)
                if data is not None and result in (None, data.signature.return_type):
                    return data
        return None

    def saved(signature: Any, data: Any) -> None:
        arguments, _ = normalize_signature(signature)
        with contextlib.suppress(Exception):
            data = data._replace(type_annotation="")  # a listing of the source, a quarter of the file
            try:
                save(arguments, data)
            except Exception:
                cache.flush()  # a damaged index, to which nothing can be added
                save(arguments, data)

    cache.load_overload, cache.save_overload = loaded, saved
    return cache


def borrowed(array: Any) -> Any:
    """Inside a kernel: `array` without its owner.

    A function that is called with an array counts the array's owners, in two atomic operations: on the way
    to a scalar function that is more time than in it. The caller of the kernel must hold the array.
    """
    return array


def _borrowed(_: Any, array: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.return_type)(context, builder, value=arguments[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), code


if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
    borrowed = intrinsic(_borrowed)  # type: ignore[assignment]
