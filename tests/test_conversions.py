"""Other people's Bouc-Wen parameters: to ours and back the response is the same, and the set the canonical one."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import assert_refused, refused

import hysim as hs

U = np.array([0.0, 0.4, -0.3, 0.7, 0.7, -0.6, 0.1, 0.0])
_MATERIALS = ("opensees", "opensees_original", "suanpan")
POSITIVE = st.floats(0.1, 3.0)

THEIRS = {
    "low_guo": {"alpha": 0.35, "beta": 0.6, "gamma": 0.2, "d": 1.3, "h0": 0.1},
    "wen": {"alpha": 0.1, "k": 20.0, "A": 1.4, "beta": 0.6, "gamma": 0.3, "n": 1.5, "D": 0.5, "z0": 0.2},
    "normalized": {"k_x": 0.4, "k_w": -2.0, "rho": 1.3, "sigma": 0.8, "n": 2.0, "w0": -0.3},
    "noel_schoukens": {"alpha": 2.0, "beta": 3.0, "gamma": 0.8, "delta": -0.3, "nu": 1.5, "z0": 0.1},
    "opensees": {"alpha": 0.05, "ko": 3.0, "n": 1.2, "gamma": 0.3, "beta": 0.6, "Ao": 0.7},
    "opensees_original": {"E": 3.0, "fy": 0.6, "alphaL": 0.1, "eta": 1.3, "beta": 0.7, "gamma": 0.3},
    "suanpan": {"elastic_modulus": 3.0, "yield_stress": 0.6, "hardening": 0.1, "beta": 0.7, "n": 1.3},
}


def literal(name: str, p: dict, u: float, z: float, v: float) -> tuple[float, float]:
    """Output and z' as the sources print them, at the input u and the velocity v."""
    if name == "low_guo":
        slope = p["alpha"] * p["d"] * v - p["beta"] * abs(v) * z - p["gamma"] * v * abs(z)
        return p["d"] * u - z, slope
    if name == "wen":
        bend = p["beta"] * abs(v) * abs(z) ** (p["n"] - 1) * z + p["gamma"] * v * abs(z) ** p["n"]
        force = p["alpha"] * p["k"] * u + (1 - p["alpha"]) * p["k"] * p["D"] * z
        return force, (p["A"] * v - bend) / p["D"]
    if name == "normalized":
        bend = -p["sigma"] * abs(v) * abs(z) ** (p["n"] - 1) * z + (p["sigma"] - 1) * v * abs(z) ** p["n"]
        return p["k_x"] * u + p["k_w"] * z, p["rho"] * (v + bend)
    if name == "noel_schoukens":
        bend = p["gamma"] * abs(v) * abs(z) ** (p["nu"] - 1) * z + p["delta"] * v * abs(z) ** p["nu"]
        return z, p["alpha"] * v - p["beta"] * bend
    if name == "opensees_original":
        k2, yielding = p["alphaL"] * p["E"], p["fy"] / p["E"]
        shape = p["gamma"] + p["beta"] * np.sign(z * v)
        return (p["fy"] - k2 * yielding) * z + k2 * u, v / yielding * (1 - abs(z) ** p["eta"] * shape)
    if name == "suanpan":
        stiffness, ratio = p["elastic_modulus"], p["hardening"]
        shape = 1 - p["beta"] + p["beta"] * np.sign(z * v)
        force = ratio * stiffness * u + (1 - ratio) * p["yield_stress"] * z
        return force, v * stiffness / p["yield_stress"] * (1 - abs(z) ** p["n"] * shape)
    force = p["alpha"] * p["ko"] * u + (1 - p["alpha"]) * p["ko"] * z
    return force, v * (p["Ao"] - abs(z) ** p["n"] * (p["gamma"] + p["beta"] * np.sign(v * z)))


def come_in(name: str, theirs: dict) -> hs.BoucWen:
    return getattr(hs.BoucWen, f"from_{name}")(**theirs)


def go_out(name: str, law: hs.BoucWen) -> dict[str, float]:
    return getattr(law, f"to_{name}")()


@pytest.mark.parametrize("name", THEIRS)
def test_the_response_is_that_of_the_equations_as_printed(name):
    theirs = THEIRS[name]
    z = next((theirs[key] for key in ("z0", "h0", "w0") if key in theirs), 0.0)
    outputs = [literal(name, theirs, U[0], z, 0.0)[0]]
    for u0, u1 in itertools.pairwise(U):
        slope = lambda _, state, v=u1 - u0: [literal(name, theirs, 0.0, state[0], v)[1]]  # noqa: E731
        z = solve_ivp(slope, (0.0, 1.0), [z], rtol=1e-10, atol=1e-12, max_step=0.01).y[0, -1]
        outputs.append(literal(name, theirs, u1, z, 0.0)[0])
    # the integrator meets a kink at z = 0: 1e-5 with steps of 0.01
    assert come_in(name, theirs).response(U) == pytest.approx(outputs, abs=1e-4)


@pytest.mark.parametrize("name", THEIRS)
def test_theirs_to_ours_to_theirs_is_canonical_and_stays(name):
    theirs = THEIRS[name]
    law = come_in(name, theirs)
    canonical = go_out(name, law)
    again = come_in(name, canonical)
    assert again.response(U) == pytest.approx(law.response(U), rel=1e-13, abs=1e-14)
    assert go_out(name, again) == pytest.approx(canonical, rel=1e-13)
    if name in ("low_guo", "normalized", "opensees_original", "suanpan"):  # one set only for each response
        assert canonical == pytest.approx(theirs, rel=1e-13)
    for key, value in {"wen": {"A": 1, "D": 1}, "noel_schoukens": {"beta": 1}, "opensees": {"Ao": 1}}.get(
        name, {}
    ).items():
        assert canonical[key] == value


@given(
    st.sampled_from(sorted(THEIRS)), POSITIVE, POSITIVE, st.floats(-0.9, 0.9), st.floats(0.5, 4.0), POSITIVE,
    st.sampled_from([-1.0, 1.0]), st.sampled_from([-1.0, 1.0]), st.floats(-0.3, 0.3),
)  # fmt: skip
def test_ours_to_theirs_to_ours_is_the_same_law(name, A, beta, ratio, n, gain, sign, turn, z0):
    law = hs.BoucWen(
        A=A * (1.0 if name == "normalized" else turn),
        beta=beta,
        gamma=ratio * beta,
        n=1.0 if name == "low_guo" else n,
        feedthrough=0.0 if name == "noel_schoukens" else 0.7,
        gain=sign * gain,
        z0=0.0 if name in _MATERIALS else z0,
    )
    assume(abs(law.feedthrough + law.gain * law.A) > 0.05 or name not in ("wen", *_MATERIALS))
    if name in ("opensees_original", "suanpan"):  # they yield, at a positive force
        assume(law.feedthrough + law.gain * law.A > 0.05 and law.beta + np.sign(law.A) * law.gamma > 0.0)
    back = come_in(name, go_out(name, law))
    y = law.response(U)
    # alpha = feedthrough / stiffness loses digits where the stiffness nearly cancels
    assert back.response(U) == pytest.approx(y, abs=1e-12 * max(1.0, np.abs(y).max()))


@pytest.mark.parametrize(
    ("amplitude", "expected"),
    [
        (1e-3, (77.75698098915592, 0.2763572362171734e-3, 2 * 14.40682508225496, 0.04916446876758035)),
        (2e-3, (221.6492359036899, 0.8194112682842666e-3, 2 * 46.44561914429927, 0.3666790804724017)),
    ],
)
def test_the_benchmark_of_noel_and_schoukens(amplitude, expected):
    law = hs.BoucWen.from_noel_schoukens(alpha=5e4, beta=1e3, gamma=0.8, delta=-1.1, nu=1)
    assert (law.A, law.beta, law.gamma, law.n) == (5e4, 800.0, -1100.0, 1.0)
    assert law.stability_class == "none"
    assert not law.admissible
    loop = law.limit_cycle(amplitude)
    assert (loop.peak, loop.coercive, loop.mid_width, loop.energy) == pytest.approx(expected, rel=1e-12)


def test_normalised_form_saturates_at_one():
    law = hs.BoucWen(A=2.0, beta=0.3, gamma=0.2, n=1.5, gain=3.0)
    w = come_in("normalized", go_out("normalized", law))
    assert w.saturation == pytest.approx(1.0, rel=1e-14)
    assert w.gain == pytest.approx(law.gain * law.saturation, rel=1e-14)


test_what_cannot_be_expressed_is_refused = refused(
    (lambda: hs.BoucWen(beta=0.8, gamma=-1.1).to_normalized(), r"beta \+ gamma > 0"),
    (lambda: hs.BoucWen(beta=0.8, gamma=-0.8).to_normalized(), r"beta \+ gamma > 0"),
    (lambda: hs.BoucWen(A=-1.0).to_normalized(), "A > 0"),
    (lambda: hs.BoucWen(n=2.0, feedthrough=1.0).to_low_guo(), "n = 1, got n = 2"),
    (lambda: hs.BoucWen(gain=1.0).to_low_guo(), "feedthrough = 0"),
    (lambda: hs.BoucWen(feedthrough=1.0).to_noel_schoukens(), "no feedthrough"),
    (lambda: hs.BoucWen(gain=0.0).to_noel_schoukens(), "gain that is not zero"),
    (lambda: hs.BoucWen(A=0.0).to_wen(), "A = 0"),
    (lambda: hs.BoucWen(feedthrough=-1.0).to_wen(), "needs a stiffness"),
    (lambda: hs.BoucWen(z0=0.1).to_opensees(), "begins with z = 0"),
    (lambda: hs.BoucWen(z0=0.1).to_suanpan(), "begins with z = 0"),
    (lambda: hs.BoucWen(gamma=-0.6).to_opensees_original(), "the material yields"),
    (lambda: hs.BoucWen.from_opensees_original(E=1.0, fy=0.0, alphaL=0.1), "fy must be positive"),
    (lambda: hs.BoucWen.from_opensees_original(E=1.0, fy=1.0, alphaL=0.1, alphaNL=0.1), "alphaNL must be zero"),
    (lambda: hs.BoucWen.from_opensees(**THEIRS["opensees"], deltaEta=0.1), "deltaEta must be zero"),
    (lambda: hs.BoucWen.from_wen(**THEIRS["wen"] | {"D": 0.0}), "D must not be zero"),
    *[(lambda name=name: go_out(name, hs.BoucWen(offset=1.0)), "no offset") for name in THEIRS],
)


@pytest.mark.parametrize("name", THEIRS)
def test_parameters_go_by_name(name):
    assert_refused("positional", getattr(hs.BoucWen, f"from_{name}"), *THEIRS[name].values(), error=TypeError)


@pytest.mark.parametrize(
    ("converted", "needed", "left_out"),
    [
        (hs.BoucWen.from_low_guo, {"alpha": 0.35, "beta": 0.02, "gamma": 0.005}, {"d": 1.0, "h0": 0.0}),
        (
            hs.BoucWen.from_wen,
            {"alpha": 0.1, "k": 20.0, "beta": 0.6, "gamma": 0.4, "n": 1.5},
            {"A": 1.0, "D": 1.0, "z0": 0.0},
        ),
        (hs.BoucWen.from_normalized, {"k_x": 2.0, "k_w": 3.0, "rho": 1.5, "sigma": 0.8, "n": 1.5}, {"w0": 0.0}),
        (
            hs.BoucWen.from_noel_schoukens,
            {"alpha": 5e4, "beta": 1e3, "gamma": 0.8, "delta": -1.1, "nu": 1.0},
            {"z0": 0.0},
        ),
        (
            hs.BoucWen.from_opensees,
            {"alpha": 0.1, "ko": 20.0, "n": 1.5, "gamma": 0.4, "beta": 0.6},
            {"Ao": 1.0, "deltaA": 0.0, "deltaNu": 0.0, "deltaEta": 0.0},
        ),
        (
            hs.BoucWen.from_opensees_original,
            {"E": 200.0, "fy": 4.0, "alphaL": 0.1},
            {"alphaNL": 0.0, "eta": 1.0, "beta": 0.5, "gamma": 0.5},
        ),
    ],
)
def test_what_other_programs_leave_out_has_their_default(converted, needed, left_out):
    """z = 1 where a law yields, and Bouc's own shape beta = gamma; nothing else is at work."""
    assert converted(**needed) == converted(**needed, **left_out)
