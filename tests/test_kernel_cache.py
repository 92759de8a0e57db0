"""A cache of compiled code that is damaged, full or forbidden costs time, and neither the run nor a digit."""

import errno
import importlib.util
import os
import resource
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import pytest
from numba.core.caching import CacheImpl, IndexDataCacheFile
from numba.core.codegen import JITCPUCodegen

from hysim.kernels import _compile
from hysim.kernels.stepping import by_address
from hysim.models.compiled_step import compiled_step
from hysim.models.model import FAMILIES

compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

SOURCE = """from numba import float64
from hysim.kernels._compile import inner, kernel, signed_kernel
@inner
def times(x, k, doubled):
    return 2.0 * k * x if doubled else k * x
@kernel
def twice(x):
    return 2.0 * x
@kernel
def halved(x):
    return 0.5 * times(x, 1, False) + 0.0 * times(x, 2, True)
@signed_kernel(float64(float64))
def thrice(x):
    return twice(x) + x
def six_times(x):
    return 2.0 * thrice(x)
"""


LAW = """import hysim as hs
import numba
import parts
import parts.inner
from parts import K, f, first, second
other = numba.njit(f)
nested = numba.njit(parts.with_inner)
@hs.family
class Own(hs.Law):
    gain: float = 1.0
    z0: float = 0.0
    @staticmethod
    def slope(p, z, u, s):
        return parts.K + K + other(K) + nested(K) + first(K) + second(K) + parts.inner.C + parts.A - parts.B
"""
PARTS = """import numba
from parts.inner import C
K, A, B = {0}, 5.0, 5.0
def f(x):
    return {1} * x
def with_inner(x):
    def g(y):
        return {2} * y
    return g(x)
def made(c):
    @numba.njit
    def h(x):
        return c * x
    return h
first, second = made(1.0), made({3})
"""


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Load the kernels anew, as a process of its own would."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "own_kernels.py").write_text(SOURCE)

    def load(called=True):
        spec = importlib.util.spec_from_file_location("own_kernels", tmp_path / "own_kernels.py")
        module = importlib.util.module_from_spec(spec)
        sys.modules["own_kernels"] = module
        spec.loader.exec_module(module)
        assert not called or (module.twice(1.5), module.thrice(1.5)) == (3.0, 4.5)
        return module

    yield load
    sys.modules.pop("own_kernels", None)


def hits(module):
    return [sum(each.stats.cache_hits.values()) for each in (module.twice, module.thrice)]


@compiled
def test_constants_among_the_arguments_make_no_code_of_their_own(kernels):
    module = kernels()
    assert module.halved(3.0) == 1.5
    assert len(module.times.signatures) == 1


FIRST_USES = {
    "call": lambda module: module.thrice(1.5),
    "calls of threads": lambda module: list(ThreadPoolExecutor(4).map(module.thrice, [1.5] * 8)),
    "call by a kernel": lambda module: _compile.inner(module.six_times).compile((numba.float64,)),
    "address": lambda module: by_address(module.thrice, numba.float64(numba.float64)).__wrapper_address__(),
}


@compiled
@pytest.mark.parametrize("use", FIRST_USES.values(), ids=FIRST_USES)
def test_a_kernel_of_one_type_is_compiled_where_it_is_used_first(kernels, use):
    module = kernels(called=False)
    assert not module.thrice.overloads
    use(module)
    assert (module.thrice(1), len(module.thrice.overloads)) == (3.0, 1)


@compiled
@pytest.mark.parametrize("pointer_first", [True, False])
def test_a_pointer_and_a_call_find_the_same_code(kernels, pointer_first):
    pointer = numba.float64(numba.float64)
    ways = [lambda halved: halved.get_compile_result(pointer), lambda halved: halved(3.0)]
    first, second = ways if pointer_first else reversed(ways)
    first(kernels().halved)
    other = kernels().halved
    second(other)
    assert sum(other.stats.cache_hits.values()) == 1


@compiled
def test_a_pointer_gets_no_code_with_another_result(kernels):
    kernels().halved.compile(numba.float32(numba.float64))
    found = kernels().halved.get_compile_result(numba.float64(numba.float64))
    assert found.signature.return_type == numba.float64


CUTS = [(end, lambda old, kept=kept: old[: int(kept * len(old))]) for end in ("nbi", "nbc") for kept in (0, 0.5, 0.99)]
NEW = [("nb?", lambda _, b=b: b) for b in (b"no pickle", b"cos\\nnothing\\n.", b"\x80\x04\x8c\xff", b"\x80\x05N.")]


@compiled
@pytest.mark.parametrize(("ending", "content"), CUTS + NEW)
def test_a_file_that_is_cut_or_holds_something_else_is_written_anew(kernels, tmp_path, ending, content):
    assert hits(kernels()) == [0, 0]
    files = sorted(tmp_path.rglob(f"*.{ending}"))
    assert len(files) == (4 if ending == "nb?" else 2)
    for file in files:
        file.write_bytes(content(file.read_bytes()))
    assert hits(kernels()) == [0, 0]
    assert hits(kernels()) == [1, 1]


@compiled
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT])
def test_a_disk_that_takes_nothing_is_done_without(kernels, tmp_path, monkeypatch, number):
    def refused(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", refused)
    assert hits(kernels()) == [0, 0]
    assert not list(tmp_path.rglob("*.nb?"))


@compiled
def test_a_cache_that_may_not_be_read_is_done_without(kernels, tmp_path):
    kernels()
    for file in tmp_path.rglob("*.nb?"):
        file.unlink()
        file.mkdir()  # which fails whoever asks, the superuser too
    assert hits(kernels()) == [0, 0]


@compiled
def test_a_file_where_the_folder_should_be_is_done_without(kernels, tmp_path, monkeypatch):
    (tmp_path / "cache").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert hits(kernels()) == [0, 0]
    assert (tmp_path / "cache").read_text() == "in the way"


TRIPLE = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()[0]
NOTHING = lambda *_: None  # noqa: E731
V3 = (TRIPLE, "a processor", ",".join([*sorted(_compile._V3), "-avx512f"]))
CASES = [
    (V3, NOTHING, 1),
    (V3, lambda patch, _: patch.setattr(CacheImpl, "_locator_classes", []), 1),  # no folder may be written
    (V3, lambda patch, _: patch.setattr(numba, "__version__", "0.61.0"), 0),
    (V3, lambda _, folder: (folder / "callee.py").write_text("factor = 2.0"), 0),
    (V3, lambda _, folder: [file.write_bytes(b"no pickle") for file in folder.rglob("*.nb?")], 0),
    (V3, lambda _, folder: [file.rename(f"{file}".replace(".py3", ".py2")) for file in folder.rglob("*.nb?")], 0),
    ((TRIPLE, "a processor", V3[2].replace("+fma", "-fma")), NOTHING, 0),
    ((TRIPLE, "generic", ""), NOTHING, 0),
    (("aarch64-apple-darwin22.6.0", *V3[1:]), NOTHING, 0),
]


@compiled
@pytest.mark.parametrize(("machine", "change", "wanted"), CASES)
def test_code_of_a_wheel_is_used_where_all_agrees(kernels, tmp_path, monkeypatch, machine, change, wanted):
    monkeypatch.setattr(_compile, "PACKAGE", tmp_path)
    monkeypatch.setattr(_compile, "SHIPPED", tmp_path / "compiled")
    _compile.SHIPPED.mkdir()
    with monkeypatch.context() as build:
        build.setattr(numba.config, "CACHE_LOCATOR_CLASSES", "hysim.kernels._compile.Shipped", raising=False)
        build.setattr(JITCPUCodegen, "magic_tuple", lambda _: (TRIPLE, _compile.SHIPPED_CPU, ""))
        assert hits(kernels()) == [0, 0]
    _compile.hash_of_sources.cache_clear()
    monkeypatch.setattr(JITCPUCodegen, "magic_tuple", lambda _: machine)
    change(monkeypatch, tmp_path)
    assert hits(kernels()) == [wanted, wanted]
    assert any((tmp_path / "cache").rglob("*.nbc")) != wanted


@compiled
def test_a_process_that_may_write_no_byte_computes(tmp_path):
    (tmp_path / "own_kernels.py").write_text(SOURCE)
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parent.parent), *sys.path])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "import own_kernels; print(own_kernels.thrice(1.5))"],
        cwd=tmp_path, env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": path},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)), capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "4.5\n", "")
    assert not [file for file in tmp_path.rglob("*.nb?") if file.stat().st_size]


@pytest.fixture
def loaded(tmp_path, monkeypatch):
    """Load the law anew, as a process of its own would, with these numbers in the files that it takes from."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "law_of_parts.py").write_text(LAW)
    (tmp_path / "parts").mkdir()

    def load(*numbers):
        (tmp_path / "parts" / "inner.py").write_text(f"C = {numbers[4]}\n")
        (tmp_path / "parts" / "__init__.py").write_text(PARTS.format(*numbers))
        for module in ("parts", "parts.inner", "law_of_parts"):
            sys.modules.pop(module, None)
        importlib.invalidate_caches()
        return importlib.import_module("law_of_parts").Own()

    yield load
    FAMILIES.pop("Own", None)


ONES = (1.0,) * 5


@compiled
def test_code_of_a_law_is_compiled_anew_where_it_takes_another_number_from_another_file(loaded):
    values, found = [], []
    for numbers in (ONES, ONES, (*ONES[:3], 3.0, 1.0)):
        law = loaded(*numbers)
        values.append(law.response([0.0, 1.0])[1])
        found.append(sum(compiled_step(law.step).stats.cache_hits.values()))
    assert values == pytest.approx([7.0, 7.0, 9.0])
    assert found == [0, 1, 0]


@compiled
def test_what_a_law_takes_from_other_files_is_all_that_its_code_is_made_of(loaded):
    def texts(*numbers):
        return "".join(_compile._texts(loaded(*numbers).slope, {}))

    assert texts(*ONES) == texts(*ONES)
    assert len({texts(*ONES), *(texts(*ONES[:k], 3.0, *ONES[k + 1 :]) for k in range(5))}) == 6
