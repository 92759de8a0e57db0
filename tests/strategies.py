"""What several tests share: conditions, random laws and inputs for the invariants, and tests of what is refused."""

import importlib.util
import json
import re
import shutil
import subprocess
import tracemalloc

import numba
import numpy as np
import pytest
from hypothesis import strategies as st

import hysim as hs

COMPILED = not numba.config.DISABLE_JIT
COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
needs_compiled = pytest.mark.skipif(not COMPILED, reason="takes minutes without compiled code")
STRICT = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic"]
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")
EXPONENTS = st.sampled_from([0.5, 0.8, 1.0, 1.3, 1.5, 2.0, 2.7, 5.0, 12.0])


@st.composite
def bounded_laws(draw) -> hs.BoucWen:
    """Laws whose memory is bounded for every input: classes I and II (beta >= 0), started inside."""
    loading = draw(st.floats(0.05, 5.0))
    unloading = draw(st.floats(-loading, 5.0))
    n = draw(EXPONENTS)
    return hs.BoucWen(
        A=draw(st.floats(0.2, 3.0)),
        beta=(loading + unloading) / 2,
        gamma=(loading - unloading) / 2,
        n=n,
        feedthrough=draw(st.floats(-2.0, 2.0)),
        gain=draw(st.floats(-2.0, 2.0)),
        offset=draw(st.floats(-1.0, 1.0)),
        z0=0.0,
    )


def assert_cut_or_stepped_it_has_the_same_bits(law, u, cut, **time) -> None:
    """A cut input has the outputs and the last state of the uncut one; so have the outputs of the compiled step."""
    u = np.asarray(u)
    head, state = law.advance(u[:cut], **time) if cut else (np.empty(0), None)
    tail, end = law.advance(u[cut:], state, **time)
    whole, whole_end = law.advance(u, **time)
    assert np.array_equal(np.concatenate([head, tail]), whole)
    assert np.array_equal(law.response(u, **time), whole)
    assert end == whole_end
    assert np.array_equal(outputs_of_compiled_steps(law, u, **time)[0], whole)


def assert_batch_has_the_bits_of_its_laws(family, sets, u, own_inputs) -> None:
    """A row for each set, all under the same input or each under its own share of it."""
    laws = [family(**dict(zip(sets, values, strict=True))) for values in zip(*sets.values(), strict=True)]
    inputs = u * np.linspace(1.0, -0.3, len(laws))[:, np.newaxis]
    rows = family.responses(sets, inputs if own_inputs else u, workers=2)
    for law, row, own in zip(laws, rows, inputs, strict=True):
        assert np.array_equal(row, law.response(own if own_inputs else u))


def outputs_of_compiled_steps(law, u, **time):
    """Outputs of the compiled step, one sample at a time, and the state at the end."""
    from hysim.kernels.stepping import drive

    compiled, y = law.compiled(u0=u[0], **time), np.empty(u.size)
    assert drive(compiled.step, compiled.parameters, compiled.state, u, y) == -1
    return y, compiled.state


def commanded(controller, sample_time, references, measurements, u0=0.0, y0=0.0):
    """The commands of a controller, one sample at a time, and its state at the end."""
    state, commands = controller.initial(sample_time, u0, y0), []
    with np.errstate(all="ignore"):
        for reference, measurement in zip(references, measurements, strict=True):
            u, state = controller.step(state, float(reference), float(measurement))
            commands.append(u)
    return np.array(commands), state


def printed(program, inputs):
    """The numbers that a program prints for these, which it reads line by line."""
    lines = "\n".join(map(repr, inputs.tolist()))
    out = subprocess.run([program], input=lines, capture_output=True, text=True, check=True).stdout
    return np.array(out.split(), dtype=float)


def printed_by_main(source, folder, inputs, flags=STRICT):
    """The numbers that the worked main function of a model in C prints for these."""
    source.write(folder)
    command = [COMPILER, *flags, f"{source.name}_main.c", f"{source.name}.c", "-o", "main", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return printed(folder / "main", inputs)


def rao_garnier(snr, seed):
    """The stiff plant of Rao and Garnier under a binary input held for 0.2 s, with noise; and its clean output."""
    true = hs.TransferFunction(num=(-6400.0, 1600.0), den=(1.0, 5.0, 408.0, 416.0, 1600.0))
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 60), 20)
    clean = true.response(u, 0.01)
    noise = rng.standard_normal(u.size) * np.sqrt(np.var(clean) / snr)
    return hs.Record(u=u, y=clean + noise, t=0.01 * np.arange(u.size)), clean, true


def loaded(path):
    """The module in a file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Passes:
    """A controller that passes its reference on."""

    def compiled(self, sample_time, u0, y0):
        from hysim.kernels.controllers import through

        return through, np.zeros(0), np.zeros(1)


def with_peak_memory(call):
    """What a call returns, and the most bytes that it held at once."""
    tracemalloc.start()
    try:
        return call(), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def document_of(run, *words, **options):
    """The JSON that a command prints, with nothing on the standard error; `run` is a fixture."""
    code, out, err = run(*words, "--json", **options)
    assert (code, err) == (0, "")
    return json.loads(out)


def assert_refused(message, call, *arguments, error=ValueError, **options):
    """A call ends with an error of one line, in which the message, a regular expression, is found."""
    with pytest.raises(error, match=message) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)


def refused(*cases, call=lambda make: make(), error=ValueError):
    """Make a test of calls that are refused, each with its message.

    A case holds the arguments of `call`, an error where it is another one than `error`, and a message.
    """

    @pytest.mark.parametrize("case", cases, ids=[case[-1] for case in cases])
    def test(case):
        *arguments, message = case
        other = isinstance(arguments[-1], type) and issubclass(arguments[-1], Exception)
        expected = arguments.pop() if other else error
        assert_refused(message, call, *arguments, error=expected)

    return test


def refused_in_one_line(*cases, call=lambda run, words: run(*words)):
    """Make a test of command lines that end with one line, which holds their message; `run` is a fixture."""

    @pytest.mark.parametrize(("words", "message"), cases)
    def test(run, words, message):
        code, out, err = call(run, words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert re.match(r"hysim( \w+)?: error: ", err)
        assert message in err

    return test


@st.composite
def short_inputs(draw, amplitude: float = 0.4) -> np.ndarray:
    """Random walks with plateaus that stay where no law above escapes."""
    values = draw(st.lists(st.floats(-amplitude, amplitude), min_size=2, max_size=30))
    repeats = draw(st.lists(st.integers(1, 3), min_size=len(values), max_size=len(values)))
    return np.repeat(values, repeats)
