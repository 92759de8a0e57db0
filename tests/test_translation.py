"""The translator: C computes what Python does, for each construct of the subset, and the rest is refused."""

import ctypes
import math
import subprocess

import numpy as np
import pytest
from square_dahl import SquareDahl
from strategies import COMPILER, needs_compiler

import hysim as hs
from hysim.export._c import HELPERS, Scalar, UntranslatableError, Vector
from hysim.export._program import Translation, entries
from hysim.kernels.stepping import complete
from hysim.models.compiled_step import startable
from hysim.models.model import every_family

of_another = "no function"
STRICT = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
TABLE = np.array([1.0, -2.5, 1e-300, 0.1])
FEW = (0.5, 2.0)
COUNT = 3


def halved(x: float) -> float:
    return 0.5 * x


def both(x: float, k: int) -> tuple[float, int]:
    return x + k, 2 * k


def filled(of, n: int) -> None:
    for i in range(n):
        of[i] = float(i * i)


def chosen(x: float, extra) -> float:
    if extra is not None:
        return x
    return -x


# Each takes (parameters, state, u), with eight parameters and eight places of state, and returns a number.


def operators(parameters, state, u):
    k = int(parameters[0]) - 9
    return u - (parameters[1] - u) / 3 + k // 2 + k % 3 + 7 / 2 - -u * 2.0**-3 + u**2 + (u + 1.0) ** 3 + u**1.5


def comparisons(parameters, state, u):
    inside = 0.0 <= u < parameters[2] and not (u == 0.25 or u in (0.5, 0.75))
    rising = (u > 0.5) == inside
    return float(inside) + 2.0 * float(rising) + (4.0 if u not in (0.1, 0.2) else 0.0)


def extremes(parameters, state, u):
    never = math.nan * u
    low = min(u, never, parameters[1]) + max(0.25, u, 1) + min(max(int(10.0 * u), 2), 5)
    return low + abs(-u) + abs(int(-3.0 * u)) + (1.0 if math.isnan(min(never, u)) else 0.0)


def loops(parameters, state, u):
    total, k = 0.0, 0
    for i in range(2, parameters.size):
        for j in range(i, 0, -2):
            total += parameters[i] * j
    for _ in range(3):
        if total > 1e9:
            break
        total = 1.5 * total + u
    while True:
        k += 1
        if k % 2 == 0:
            continue
        if k > 6:
            break
    for m in range(len(state) - 1, -1, -1):
        total += m * state[m]
    return total + k


def slices(parameters, state, u):
    n = int(parameters[0]) // 2
    own, others = parameters[1 : 1 + n], parameters[1 + n :]
    memory = state[2:]
    memory[0] = memory[0] + own[n - 1] + others[-1]
    state[1] = state[0] = u
    return memory[0] + own.size + len(others) + memory[-1] + others.size


def swaps(parameters, state, u):
    a, b = u, parameters[1]
    a, b = b, a
    state[0], state[1] = state[1] + a, state[0] + b
    low, high = (a, b) if a < b else (b, a)
    c = d = u + 1.0
    first, second, third = parameters[2:5]
    return low - 2.0 * high + c * d + first - second * third + state[0] * state[1]


def calls(parameters, state, u):
    filled(state[3:], 4)
    x, k = both(u, COUNT)
    _, m = both(x, k)
    return halved(x) + k + m + both(u, 1)[0] + chosen(u, None) + 3.0 * chosen(u, 1.0) + state[6] + TABLE[1] * FEW[1]


def matrices(parameters, state, u):
    matrix = parameters[2:].reshape((2, 3))
    rows, columns = matrix.shape
    total = 0.0
    for i in range(rows):
        for j in range(columns):
            total = 2.0 * total + matrix[i, j]
    below = matrix[1:]
    return total + below[0, 2] + matrix.shape[1] * u


def work(parameters, state, u):
    room = np.empty(4)
    filled(room, 4)
    constants = TABLE[1:]
    return room[3] + constants[2] + math.inf * 0.0 if u > 2.0 else room[2] + constants[0] + constants.size


def kept_from_pass_to_pass(parameters, state, u):
    """A name that a loop assigns in one pass and reads in the next."""
    total = 0.0
    last = 0.0
    for i in range(4):
        if i > 1:
            total += last * u
        last = parameters[i]
    return total


def names_that_mean_something_in_c(parameters, state, u):
    """Local names like those of C, of its functions, and of helpers and tables of the translator."""
    double, exp, smaller, table, few = u, 2.0 * u, 3.0 * u, TABLE[3], 4.0
    return min(double, 0.5) + math.exp(-exp) + smaller + table + few + FEW[1]


def mathematics(parameters, state, u):
    first = math.exp(u) + math.log1p(u) * math.tanh(u) + math.copysign(math.sqrt(u + 1.0), -u) - math.expm1(-u)
    return first + math.floor(3.7 * u) + math.atan2(u, 2.0) + math.fabs(-u) + (0.0 if math.isfinite(u) else 1.0)


CONSTRUCTS = (
    operators, comparisons, extremes, loops, slices, swaps, calls, matrices, work, kept_from_pass_to_pass, mathematics,
    names_that_mean_something_in_c,
)  # fmt: skip


def library(functions, folder, *options):
    """The functions in C, as one shared library, by the names of the functions in Python."""
    translation = Translation()
    wrapped = []
    for function in functions:
        c = translation.function(function, (Vector(), Vector(), Scalar.DOUBLE))
        given = []
        for parameter, name, size in zip(c.parameters, ("p", "x", "u"), ("8", "8", ""), strict=True):
            given += [name] * parameter.is_used + [size] * len(parameter.axes)
        unused = "".join(f" (void){name};" for name in ("p", "x", "u") if name not in given)
        head = f"double {function.__name__}(double *p, double *x, double u)"
        wrapped.append(f"{head};\n{head} {{{unused} return {c.name}({', '.join(given)}); }}\n")
    (folder / "all.c").write_text("#include <math.h>\n" + translation.text() + "\n".join(wrapped))
    command = [COMPILER, *STRICT, *options, "-shared", "-fPIC", "all.c", "-o", "all.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "all.so"))


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    return library(CONSTRUCTS, tmp_path_factory.mktemp("constructs"), "-O1")


@needs_compiler
@pytest.mark.parametrize("function", CONSTRUCTS, ids=lambda function: function.__name__)
def test_a_construct_computes_in_c_what_it_computes_in_python(function, in_c):
    pointer = ctypes.POINTER(ctypes.c_double)
    own = in_c[function.__name__]
    own.argtypes, own.restype = [pointer, pointer, ctypes.c_double], ctypes.c_double
    rng = np.random.default_rng(1)
    for u in (0.25, 0.5, 0.3, 0.9, 0.1, *rng.uniform(0.0, 3.0, 20)):
        parameters = np.append(rng.integers(4, 8), rng.uniform(0.0, 1.0, 7))
        before = rng.uniform(-1.0, 1.0, 8)
        state, state_in_c = before.copy(), before.copy()
        expected = function(parameters, state, float(u))
        found = own(parameters.ctypes.data_as(pointer), state_in_c.ctypes.data_as(pointer), float(u))
        assert found == pytest.approx(expected, rel=4e-16, abs=0.0, nan_ok=True)  # the libraries' functions may differ
        assert np.array_equal(state, state_in_c)


def with_else(parameters, state, u):
    for _ in range(3):
        u += 1.0
    else:
        u = 0.0
    return u


def with_a_counter_read_later(parameters, state, u):
    for k in range(3):
        u += k
    return u + k


def with_a_list(parameters, state, u):
    return sum([u, u])


def with_a_keyword(parameters, state, u):
    return halved(x=u)


def with_an_exception(parameters, state, u):
    if u < 0.0:
        raise ValueError
    return u


def with_a_choice_of_arrays(parameters, state, u):
    of = parameters if u > 0.0 else state
    return of[0]


def with_a_float_index(parameters, state, u):
    return parameters[u]


def with_numbers_joined(parameters, state, u):
    return u and 1.0


def with_an_unknown_function(parameters, state, u):
    return of_another(u)


def with_a_stride(parameters, state, u):
    return parameters[::2][0]


def with_room_of_any_size(parameters, state, u):
    room = np.empty(int(u))
    return room[0]


def with_a_copy(parameters, state, u):
    state[:] = parameters
    return u


REFUSED = {
    with_else: "a loop has no else",
    with_a_counter_read_later: "counts a loop and has another use",
    with_a_list: "List is no expression",
    with_a_keyword: "no keyword",
    with_an_exception: "Raise is no statement",
    with_a_choice_of_arrays: "a number is expected",
    with_a_float_index: "an index is an integer",
    with_numbers_joined: "join truth values",
    with_an_unknown_function: "of_another is neither of the module math nor a function",
    with_a_stride: "no stride",
    with_room_of_any_size: "constant size",
    with_a_copy: "a vector is copied by a loop",
}


@pytest.mark.parametrize("function", REFUSED, ids=lambda function: function.__name__)
def test_a_construct_outside_the_subset_is_refused_with_its_place(function):
    with pytest.raises(UntranslatableError, match=REFUSED[function]) as refused:
        Translation().function(function, (Vector(), Vector(), Scalar.DOUBLE))
    first = function.__code__.co_firstlineno
    place = str(refused.value).split(":")
    assert place[0].endswith("test_translation.py")
    assert first <= int(place[1]) <= first + 6


def test_a_lambda_is_refused():
    with pytest.raises(UntranslatableError, match="lambda"):
        Translation().function(lambda parameters, state, u: u, (Vector(), Vector(), Scalar.DOUBLE))


@pytest.mark.parametrize(("a", "b"), [(7, 2), (-7, 2), (7, -2), (-7, -2), (6, 3), (-6, 3), (0, 5)])
def test_division_of_integers_rounds_down(a, b):
    """The helper's formula, with C's division, which rounds towards zero."""
    quotient = int(a / b)
    below = a - b * quotient != 0 and (a < 0) != (b < 0)
    assert quotient - below == a // b
    assert "a / b - below(a, b)" in HELPERS["floor_quotient"]


@needs_compiler
def test_the_steps_of_all_families_compile_without_a_warning(tmp_path):
    """Each with sizes that are known where it runs."""
    for number, family in enumerate(every_family().values()):
        if not issubclass(family, hs.Law) or not family.__module__.startswith("hysim."):
            continue
        text, has_start = entries(family.step, family.start)
        users = ["double (*a)(const double *, int, double *, int, double) = step;"]
        users += ["void (*b)(const double *, int, double *, int, double) = start;"] * has_start
        use = f"int main(void) {{ {' '.join(users)} return a == 0{' || b == 0' * has_start}; }}"
        (tmp_path / f"f{number}.c").write_text(f"#include <math.h>\n{text}\n{use}\n")
    sources = sorted(path.name for path in tmp_path.glob("f*.c"))
    assert len(sources) >= 15
    subprocess.run([COMPILER, *STRICT, "-fsyntax-only", *sources], cwd=tmp_path, check=True)


def test_a_law_of_ones_own_is_translated():
    assert "square_dahl_step" in hs.to_c(SquareDahl()).source


def test_a_state_that_does_not_depend_on_the_first_input_has_no_start():
    text, has_start = entries(startable(hs.Play()).step, complete)
    assert not has_start
    assert "start(" not in text
