"""Derivatives of responses: every family against 40 digits, closed forms, and special cases of parameters."""

import functools
import math
import types

import mpmath
import numpy as np
import pytest
from strategies import assert_refused
from test_packing import LAWS

import hysim as hs
from hysim.export._c import plain
from hysim.kernels._compile import borrowed

FRICTION = {
    "LuGre": hs.LuGre(stribeck_velocity=0.7, damping_velocity=0.5),
    "StribeckFriction": hs.StribeckFriction(),
    "GeneralizedMaxwellSlip": hs.GeneralizedMaxwellSlip(),
    "ElasticBacklash": hs.ElasticBacklash(half_gap=0.2, damping=0.3),
}
AT_REST = {name: law.at_sample_time(0.3) for name, law in FRICTION.items()}
GENERAL = LAWS | {
    "BoucWen": hs.BoucWen(n=1.4, beta=0.8, gamma=-0.3, z0=0.1, feedthrough=0.5),
    "linear BoucWen": hs.BoucWen(n=1.0, beta=0.8, gamma=-0.3, z0=0.1),
    "quadratic BoucWen": hs.BoucWen(n=2.0, beta=0.8, gamma=-0.3, z0=-0.1),
    "ZhuWangBoucWen": hs.ZhuWangBoucWen(n=1.4, beta=0.8, gamma=-0.3, delta=0.2, z0=0.1),
    "GeneralizedBoucWen": hs.GeneralizedBoucWen(n=1.4, beta=0.8, gamma=-0.3, b2=0.1, b6=-0.1, z0=0.1),
    "ModifiedPrandtlIshlinskii": hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, 0.2, 0.5),
        weights=(1.0, 0.5, 0.3),
        dead_zones=(-0.4, 0.1, 0.3),
        dead_zone_weights=(0.2, 1.0, 0.4),
    ),
    "EnergyPlays": hs.EnergyPlays(thresholds=(0.03, 0.21, 0.52), weights=(1.0, 0.5, 0.3), field=0.3),
}
SLOW = {
    "ZhuWangBoucWen": ("beta",),
    "BoucWen": ("beta", "n"),
    "GeneralizedBoucWen": ("b2",),
    "JilesAtherton": ("alpha", "c"),
    "linear BoucWen": ("A", "beta", "gamma", "z0"),
    "quadratic BoucWen": ("A", "beta", "gamma", "z0"),
    "Duhem": ("y0", "u' |z|"),
    "Preisach": ("levels[1]", "weights[2]"),
    "Chan": ("coercivity", "squareness", "gap"),
}
"""Numbers by which laws are differentiated that take long with 40 digits, and on four samples only."""
NOT_IN_40_DIGITS = ("BoucWenBaberNoori", "PolynomialBoucWen", "PreisachRelays")  # too slow, and steps of others
INPUT = np.array([0.13, 0.711, 0.37, -0.913, 0.214, 1.317, 0.93])


DIFFERENCES = (-137, 300, -300, 200, -75, 12)
"""Weights of values at 0, h, ..., 5 h in 60 h times the derivative at 0, to the order h^5."""


def parting(law, name, inputs):
    """The rate of the response by a number that grows, from the step in numbers of 40 digits.

    Steps of 1e-4 leave 1e-20 of the terms that are not eliminated, and 1e-11 of the rounding of the parameters.
    """
    step, start, workspace = (law.step, law.start, law.workspace) if name in law.structural else law.stepping
    h = 2.0**-13 * (abs(law.scalars[name]) or 1.0)
    slope = 0
    for k, weight in enumerate(DIFFERENCES):
        column = {name: np.array([[law.scalars[name] + k * h]])}
        parameters, memory = (in_digits(row[0]) for row in law.pack(law.completed(law.exchanged(column))))
        state = np.concatenate([memory, in_digits(np.zeros(workspace))])
        in_digits(start)(parameters, state, in_digits(inputs)[0])
        slope += weight * np.array([in_digits(step)(parameters, state, u) for u in in_digits(inputs)])
    return (slope / (60 * h)).astype(float)


@functools.singledispatch
def in_digits(value):
    """The value, with whose functions and arrays mpmath computes."""
    function = plain(value)
    return COPIES.get(value, value) if function is value else in_digits(function)


@in_digits.register
def _(array: np.ndarray):
    return np.array([mpmath.mpf(each) for each in array.tolist()], dtype=object)


@in_digits.register
def _(module: types.ModuleType):
    return MATHEMATICS if module is math else Kernels(module)


@in_digits.register
def _(function: types.FunctionType):
    if function not in COPIES:
        code, own = function.__code__, {"float": lambda x: x}
        cells = tuple(types.CellType(in_digits(cell.cell_contents)) for cell in function.__closure__ or ())
        COPIES[function] = types.FunctionType(code, own, None, function.__defaults__, cells)
        names = {name: function.__globals__[name] for name in code.co_names if name in function.__globals__}
        own.update({name: in_digits(value) for name, value in names.items() if not isinstance(value, np.ndarray)})
        own.update({name: value for name, value in names.items() if isinstance(value, np.ndarray)})
    return COPIES[function]


COPIES = {borrowed: lambda array: array}


class Kernels:
    """The functions of a module, in digits."""

    def __init__(self, module):
        self.module = module

    def __getattr__(self, name):
        value = getattr(self.module, name)
        return value if isinstance(value, np.ndarray) else in_digits(value)


def _signed(x, sign):
    return abs(x) if sign >= 0 else -abs(x)


MATHEMATICS = types.SimpleNamespace(
    **{name: getattr(mpmath, name) for name in ("exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "tanh")},
    **{name: getattr(mpmath, name) for name in ("atan", "atanh", "hypot")},
    **{"copysign": _signed, "isfinite": mpmath.isfinite, "isnan": mpmath.isnan, "isinf": mpmath.isinf},
    pi=mpmath.pi,
    inf=mpmath.inf,
    nan=mpmath.nan,
)


@pytest.mark.parametrize("name", [*(name for name in GENERAL if name not in NOT_IN_40_DIGITS), *AT_REST])
def test_every_family_has_the_derivatives_of_its_step_in_40_digits(name):
    law, inputs = {**GENERAL, **AT_REST}[name], INPUT[: 4 if name in SLOW else None]
    computed = law.response_jacobian(inputs, SLOW.get(name))
    np.testing.assert_array_equal(computed.response, law.response(inputs))
    with mpmath.workdps(40):
        for each in computed.names:
            expected = parting(law, each, inputs)
            size = np.abs(expected).max()
            # what 1e-14 of the output says of a number that hardly moves it
            rounding = 1e-14 * np.abs(computed.response).max() / (abs(law.scalars[each]) or 1.0)
            np.testing.assert_allclose(computed[each], expected, rtol=0, atol=1e-8 * size + rounding, err_msg=each)


def differences(law, name, inputs):
    """Central differences of the response, extrapolated once: good to 1e-9 where nothing bends sharply."""
    own, h = law.scalars[name], 1e-3

    def slope(step):
        ends = [law.with_scalars({name: own + side * step}).response(inputs) for side in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * step)

    return (4.0 * slope(0.5 * h) - slope(h)) / 3.0


SPECIAL = {
    "no decay on unloading": (hs.BoucWen(n=1.4), ("beta", "gamma", "z0")),
    "the same at n = 1": (hs.BoucWen(), ("beta", "n", "z0")),
    "the same at n = 2": (hs.BoucWen(n=2.0), ("gamma", "n", "z0")),
    "the same with a ramp": (hs.ZhuWangBoucWen(n=1.4, delta=0.2), ("gamma", "z0")),
    "a ramp at n = 1": (hs.ZhuWangBoucWen(delta=0.2), ("beta", "n")),
    "no anisotropy": (hs.JilesAtherton(), ("anisotropy",)),
    "a density": (LAWS["ParametricPrandtlIshlinskii"], ("exponent", "decay", "reach")),
    "nothing wears off yet": (hs.BoucWenBaberNoori(beta=0.8, gamma=-0.3), ("zeta_s",)),
    "no wear at n = 1.4": (hs.BoucWenBaberNoori(n=1.4, beta=0.8, gamma=0.3, delta_nu=0.1), ("n",)),
}


@pytest.mark.parametrize("case", SPECIAL)
def test_special_values_of_parameters_have_the_derivatives_of_their_neighbours(case):
    """A branch for beta = gamma, n = 1 or no wear knows nothing of laws beside it; nor does |z| of z0 = 0."""
    law, names = SPECIAL[case]
    inputs = INPUT[:4]
    computed = law.response_jacobian(inputs, names)
    np.testing.assert_allclose(computed.response, law.response(inputs), rtol=1e-12, atol=1e-12)
    for name in names:
        expected = differences(law, name, inputs)
        # |z|^1.4 bends without bound at z = 0, where the differences of z0 lose digits
        near = 2e-4 if name == "z0" else 2e-8
        np.testing.assert_allclose(computed[name], expected, rtol=0, atol=near * np.abs(expected).max(), err_msg=name)


def test_a_stroke_has_the_derivatives_of_its_closed_form():
    """From z = 0: L = z 2F1(1, 1/n; 1 + 1/n; c z^n / A) / A."""

    def memory(A, c, n):
        length = lambda z: z * mpmath.hyp2f1(1, 1 / n, 1 + 1 / n, c * z**n / A) / A - mpmath.mpf(0.75)  # noqa: E731
        return mpmath.findroot(length, 0.5)

    law = hs.BoucWen(A=1.2, beta=0.5, gamma=0.375, n=2.75)
    computed = law.response_jacobian([0.0, 0.75], ("A", "beta", "n")).matrix[1]
    with mpmath.workdps(30):
        point = mpmath.mpf(1.2), mpmath.mpf(0.875), mpmath.mpf(2.75)
        expected = [float(mpmath.diff(memory, point, order)) for order in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    np.testing.assert_allclose(computed, expected, rtol=1e-8)


def test_a_threshold_of_zero_has_its_one_sided_derivative_in_any_unit():
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 2e-10), weights=(1.0, 0.5))
    np.testing.assert_allclose(law.response_jacobian([0.0, 1e-9], ["thresholds[0]"]).matrix[:, 0], [0.0, -1.0])


def test_affine_numbers_have_their_columns():
    law, u = hs.BoucWen(n=1.4, feedthrough=0.4), INPUT
    columns = law.regressors(law.scalars, hs.Record(u=u, y=u))[0]
    computed = law.response_jacobian(u, law.columns)
    np.testing.assert_allclose(computed.matrix, columns[:, :-1], atol=1e-15)


def test_a_law_of_ones_own_needs_nothing_more():
    def step(parameters, state, u):
        rate, power = parameters
        if u != state[0]:
            state[1] += (u - state[0]) * math.exp(-rate * abs(state[1]) ** power)
        state[0] = u
        return state[1]

    law = hs.CustomLaw(step=step, parameters={"rate": 0.7, "power": 1.5}, state={"z0": 0.2})
    computed = law.response_jacobian(INPUT)
    assert computed.names == ("rate", "power", "z0")
    for name in computed.names:
        np.testing.assert_allclose(computed[name], differences(law, name, INPUT), atol=1e-8)


def test_names_are_checked():
    law = LAWS["ParametricPrandtlIshlinskii"]
    assert "plays" not in law.response_jacobian(INPUT).names
    assert_refused("has no derivative by plays", law.response_jacobian, INPUT, ("plays",))
    with pytest.raises(ValueError, match=r"names has 'slope': a Dahl has stiffness, coulomb, offset, z0"):
        hs.Dahl().response_jacobian(INPUT, ("slope",))
    assert_refused("sequence of names", hs.Dahl().response_jacobian, INPUT, "z0", error=TypeError)
    with pytest.raises(hs.SimulationError, match="diverges at sample 1"):
        hs.BoucWen(beta=-1.0, gamma=-1.0, n=2.0).response_jacobian([0.0, 50.0])


def test_friction_takes_a_sample_time():
    computed = FRICTION["LuGre"].response_jacobian(INPUT, 0.3)
    assert computed.names == tuple(FRICTION["LuGre"].scalars)
    np.testing.assert_array_equal(computed.matrix, AT_REST["LuGre"].response_jacobian(INPUT, computed.names).matrix)
    assert computed.information(0.1).shape == (len(computed.names),) * 2
