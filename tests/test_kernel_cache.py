"""A cache of compiled code that is damaged, full or forbidden costs time, and neither the run nor a digit."""

import errno
import importlib.util
import os
import resource
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.caching import CacheImpl, IndexDataCacheFile
from numba.core.codegen import JITCPUCodegen

from hysim.kernels import _compile
from hysim.models.compiled_step import compiled_step

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
"""


LAW = """import hysim as hs
import numba
import parts
from parts import K
other = numba.njit(parts.f)
@hs.family
class Own(hs.Law):
    gain: float = 1.0
    z0: float = 0.0
    @staticmethod
    def slope(p, z, u, s):
        return parts.K + K + other(K)
"""


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Load the kernels anew, as a process of its own would."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "own_kernels.py").write_text(SOURCE)

    def load():
        spec = importlib.util.spec_from_file_location("own_kernels", tmp_path / "own_kernels.py")
        module = importlib.util.module_from_spec(spec)
        sys.modules["own_kernels"] = module
        spec.loader.exec_module(module)
        assert (module.twice(1.5), module.thrice(1.5)) == (3.0, 4.5)
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


@compiled
def test_code_of_a_law_follows_what_it_takes_from_other_files(tmp_path, monkeypatch):
    """Constants, by their name or in their module, and functions; what stays is compiled once."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "law_of_parts.py").write_text(LAW)
    values, found = [], []
    for constant, factor in ((1.0, 1.0), (1.0, 1.0), (2.0, 1.0), (2.0, 3.0)):
        (tmp_path / "parts.py").write_text(f"K = {constant}\ndef f(x):\n    return {factor} * x\n")
        for module in ("parts", "law_of_parts"):
            sys.modules.pop(module, None)
        importlib.invalidate_caches()
        law = importlib.import_module("law_of_parts").Own()
        values.append(law.response([0.0, 1.0])[1])
        found.append(sum(compiled_step(law.step).stats.cache_hits.values()))
    assert values == [3.0, 3.0, 6.0, 10.0]
    assert found == [0, 1, 0, 0]
