"""Degradation and pinching against the equations written out, the Bouc-Wen law, and their own promises."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import (
    COMPILED,
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    bounded_laws,
    needs_compiled,
    refused,
    short_inputs,
)

import hysim as hs
from hysim.errors import SimulationError

# Reversals, a rest, moves along one side of zero, zeros of z.
PATH = np.array([0.0, 0.3, 0.9, 0.9, 0.2, -0.5, -1.0, 0.4, 0.1, 2.0, -2.0])
COMMON = {"A": 1.1, "beta": 0.7, "gamma": 0.25, "gain": -0.5, "offset": 0.2, "z0": 0.1, "input_coefficients": (1.5,)}
WEAR = {"delta_a": 0.05, "delta_nu": 0.3, "delta_eta": 0.2}
PINCHING = {"zeta_s": 0.9, "q": 0.1, "p": 1.2, "psi": 0.15, "delta_psi": 0.05, "lambda_": 0.4}
OWN = {"wear": WEAR, "pinching": PINCHING, "both": WEAR | PINCHING}
FEW = settings(max_examples=20 if COMPILED else 2)


def law(own, n=1.0, **others):
    return hs.BoucWenBaberNoori(**COMMON | own | {"n": n} | others)


def rates(model, z: float, e: float, direction: float, side: float) -> tuple[float, float]:
    """dz/du and de/du as the sources print them, on one side of z = 0."""
    A, nu, eta = model.A - model.delta_a * e, 1.0 + model.delta_nu * e, 1.0 + model.delta_eta * e
    bend = nu * abs(z) ** model.n * (model.gamma + model.beta * side * direction)
    zeta1 = model.zeta_s * (1.0 - np.exp(-model.p * e))
    zeta2 = (model.psi + model.delta_psi * e) * (model.lambda_ + zeta1)
    z_u = (1.0 / (nu * (model.beta + model.gamma))) ** (1.0 / model.n)
    h = 1.0 - zeta1 * np.exp(-((z * direction - model.q * z_u) ** 2) / zeta2**2)
    return h * (A - bend) / eta, z


def literal(model, u: np.ndarray) -> np.ndarray:
    """(z, e), shape (n, 2), by an adaptive Runge-Kutta method that is stopped at every zero of z."""
    states = [np.array([model.z0, 0.0])]
    for start, end in itertools.pairwise(u):
        direction, at, x = np.sign(end - start), start, states[-1]
        while at != end:
            side = np.sign(x[0]) or direction
            slopes = lambda v, w, s=direction, side=side: rates(model, w[0], w[1], s, side)  # noqa: E731
            if x[0] == 0.0:  # one short explicit step away from the kink
                ahead = at + np.clip(end - at, -1e-9, 1e-9)
                x, at = x + (ahead - at) * np.array(slopes(at, x)), ahead
                continue
            crossing = lambda v, w: w[0]  # noqa: E731
            crossing.terminal = True
            run = solve_ivp(slopes, (at, end), x, "DOP853", rtol=1e-13, atol=1e-15, events=crossing)
            at, x = run.t[-1], run.y[:, -1]
            if run.status == 1:
                x = np.array([0.0, x[1]])
        states.append(x)
    return np.array(states)


@pytest.mark.parametrize("n", [0.5, 1.0, 1.3, 2.0, 3.0])
@pytest.mark.parametrize("own", OWN)
def test_memory_and_energy_are_those_of_the_equations(own, n):
    model = law(OWN[own], n)
    expected = literal(model, PATH)
    # 1e-10 of the range is the law's promise; the solver finds a zero of z to 1e-11, its explicit steps away from
    # there leave (1e-9)^(1 + n) each.
    tolerance = 1e-10 * np.ptp(expected[:, 0]) + 10.0 * 1e-9 ** (1.0 + n)
    assert np.abs(model.memory(PATH) - expected[:, 0]).max() < tolerance
    assert np.abs(model.energy(PATH) - expected[:, 1]).max() < 5.0 * tolerance  # its range is 5 times that of z


@FEW
@given(bounded_laws(), short_inputs())
def test_without_wear_and_pinching_it_is_the_bouc_wen_law(plain, u):
    scalars = plain.scalars
    coefficients = (scalars.pop("feedthrough"),)
    new = hs.BoucWenBaberNoori(**scalars, input_coefficients=coefficients)
    expected = plain.response(u)
    room = 1e-10 * (np.abs(expected).max() + abs(plain.gain * plain.saturation))
    assert np.abs(new.response(u) - expected).max() <= room
    sets = {**scalars, "input_coefficients": [coefficients], "delta_nu": [0.1, 0.0]}
    assert np.array_equal(hs.BoucWenBaberNoori.responses(sets, u)[1], new.response(u))


@pytest.mark.parametrize("own", OWN)
@FEW
@given(
    u=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    n=st.sampled_from([0.5, 1.0, 1.3, 2.0]),
    cut=st.integers(0, 12),
)
def test_cut_stepped_or_in_batch_it_is_the_same_bits(own, u, n, cut):
    model = law(OWN[own], n)
    assert_cut_or_stepped_it_has_the_same_bits(model, u, cut)
    assert len(model.advance(u)[1]) == 3
    sets = {**COMMON, **OWN[own], "n": [1.7, n, n, 1.0], "beta": [0.5, 0.7, 0.9, 0.7]}
    assert np.array_equal(hs.BoucWenBaberNoori.responses(sets, u)[1], model.response(u))


@FEW
@given(u=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12), n=st.sampled_from([0.5, 1.0, 1.3, 2.0, 5.0]))
def test_the_law_is_odd(u, n):
    model = law(OWN["both"], n, z0=0.0)
    assert np.array_equal(model.memory(np.negative(u)), -model.memory(u))


def test_a_loop_wears_off_and_pinches():
    u = hs.signals.triangle(-2.0, 2.0, cycles=8, samples_per_cycle=200)
    narrow = PINCHING | {"delta_psi": 0.0}
    new, worn, pinched = (hs.BoucWenBaberNoori(**own).memory(u) for own in ({}, {"delta_nu": 0.2}, narrow))
    first, last = slice(200, 401), slice(-201, None)
    areas = [[hs.loop_metrics(u[cycle], z[cycle]).area for cycle in (first, last)] for z in (new, worn, pinched)]
    assert areas[0][1] == pytest.approx(areas[0][0], rel=1e-3)  # what one cycle leaves of the way in
    assert areas[1][1] < 0.7 * areas[1][0]
    assert areas[2][1] < 0.8 * areas[0][1]
    assert worn[last].max() < 0.7 * pinched[last].max() < pinched[last].max() < new[last].max()  # strength is left


@pytest.mark.parametrize("own", OWN)
def test_the_inverse_undoes_the_response(own):
    model = law(OWN[own], 1.3)
    y = model.response(PATH)
    back = model.inverse_response(y)
    assert np.abs(model.response(back) - y).max() < 1e-14 * np.ptp(y)  # where the search ends
    assert np.abs(back - PATH).max() < 1e-10  # that over the lowest slope, summed over the path
    _, state = model.advance(PATH[:5])
    assert model.inverse_response(y[5:], state=state) == pytest.approx(PATH[5:], abs=1e-10)
    with pytest.raises(SimulationError, match="has no inverse at sample"):
        law(OWN[own], gain=-2.0).inverse_response(law(OWN[own], gain=-2.0).response(PATH))


@pytest.mark.parametrize("own", OWN)
def test_the_slope_is_what_the_response_does(own):
    model = law(OWN[own], 1.3)
    for direction, u, z, e in itertools.product([-1.0, 1.0], [-0.5, 0.5], [-0.4, 0.4], [0.0, 0.7]):
        ends, _ = model.advance([u, u + 1e-6 * direction], (u, z, e))
        # One-sided difference: 1e-6 of the second derivative, which is below 10.
        assert model.tangent(direction, z, u, e) == pytest.approx((ends[1] - ends[0]) / (1e-6 * direction), abs=1e-5)


def test_what_does_not_stay_finite_is_named():
    with pytest.raises(SimulationError, match=r"diverges at sample 2 \(u = 9\)"):
        hs.BoucWenBaberNoori(beta=-1.0, gamma=-1.0, n=3.0, delta_nu=0.1).memory([0.0, 0.1, 9.0])
    with pytest.raises(SimulationError, match="at sample 1"):  # eta reaches zero
        hs.BoucWenBaberNoori(delta_eta=-1.0).memory([0.0, 9.0, -9.0])
    rows = hs.BoucWenBaberNoori.responses({"delta_eta": [-1.0, 0.1]}, [0.0, 9.0, -9.0])
    assert np.isposinf(rows[0]).all()
    assert np.isfinite(rows[1]).all()


@needs_compiled
def test_identify_finds_wear_and_holds_what_the_record_cannot_tell():
    u = hs.signals.triangle(-2.0, 2.0, cycles=4, samples_per_cycle=24)
    truth = hs.BoucWenBaberNoori(beta=0.7, gamma=0.2, delta_nu=0.15, delta_eta=0.08, gain=3.0)
    record = hs.Record(u=u, y=truth.response(u))
    fit = hs.identify(hs.BoucWenBaberNoori, record, fixed={"n": 1.0}, initial="rest")
    assert {"delta_a", "zeta_s", "psi", "A"}.isdisjoint(fit.free_names)
    for name in fit.free_names:
        # The descent ends where the residual has lost nine digits; the two rates are told apart by a tenth of it.
        assert fit.estimates[name] == pytest.approx(truth.scalars[name], abs=1e-5), name
    names = hs.BoucWenBaberNoori(zeta_s=0.5).search_space(record).names
    assert {"zeta_s", "q", "p", "psi", "delta_psi", "lambda_"} <= set(names)
    assert_refused("no steady cycle", hs.identify, hs.BoucWenBaberNoori, record, fixed={"n": 1.0}, initial="periodic")


THEIRS = {
    "opensees": {
        **{"alpha": 0.1, "ko": 3.0, "n": 1.2, "gamma": 0.3, "beta": 0.6, "Ao": 0.9},
        **{"deltaA": 0.01, "deltaNu": 0.05, "deltaEta": 0.08},
    },
    "opensees_bwbn": {
        **{"alpha": 0.1, "ko": 3.0, "n": 1.2, "gamma": 0.3, "beta": 0.6, "Ao": 0.9},
        **{"q": 0.1, "zetas": 0.8, "p": 0.5, "Shi": 0.2, "deltaShi": 0.02, "lamda": 0.4},
    },
}


@pytest.mark.parametrize("name", THEIRS)
def test_the_materials_of_opensees_are_their_equations_in_small_steps(name):
    """Their backward Euler step, written out for steps so short that an explicit one is as good."""
    p = THEIRS[name]
    model = getattr(hs.BoucWenBaberNoori, f"from_{name}")(**p)
    n_steps = 20_000 if COMPILED else 100
    u = np.concatenate([np.linspace(a, b, n_steps)[1:] for a, b in itertools.pairwise([0.0, 2.0, -1.0, 0.5])])
    stress, z, e, last = [], 0.0, 0.0, 0.0
    for strain in u.tolist():
        du = strain - last
        sign, onwards = np.sign(du * z), np.sign(du)
        A, nu, eta = (p["Ao"] - p.get("deltaA", 0.0) * e, 1 + p.get("deltaNu", 0.0) * e, 1 + p.get("deltaEta", 0.0) * e)
        h = 1.0
        if "zetas" in p:
            zeta1 = p["zetas"] * (1 - np.exp(-p["p"] * e))
            zeta2 = (p["Shi"] + p["deltaShi"] * e) * (p["lamda"] + zeta1)
            z_u = (1 / (p["beta"] + p["gamma"])) ** (1 / p["n"])
            h = 1 - zeta1 * np.exp(-((z * onwards - p["q"] * z_u) ** 2) / zeta2**2)
        slope = h * (A - abs(z) ** p["n"] * (p["gamma"] + p["beta"] * sign) * nu) / eta
        e += (1 - p["alpha"]) * p["ko"] * du * (z + 0.5 * slope * du)
        z, last = z + slope * du, strain
        stress.append(p["alpha"] * p["ko"] * strain + (1 - p["alpha"]) * p["ko"] * z)
    # First order in steps of 3 / n at most, with second derivatives and a force of order one.
    assert np.abs(model.response(np.append(0.0, u))[1:] - stress).max() < 10.0 / n_steps
    assert getattr(model, f"to_{name}")() == pytest.approx(p, rel=1e-14)  # a few roundings


test_wrong_arguments_are_named = refused(
    (lambda: hs.BoucWenBaberNoori(zeta_s=0.5, psi=0.0), "psi must be positive in a law that pinches"),
    (lambda: hs.BoucWenBaberNoori(zeta_s=0.5, gamma=-0.5), r"beta \+ gamma must be positive in a law that"),
    (lambda: hs.BoucWenBaberNoori(n=0.0), "n must be positive"),
    (lambda: hs.BoucWenBaberNoori(zeta_s=0.5).to_opensees(), "does not pinch"),
    (lambda: hs.BoucWenBaberNoori(delta_nu=0.5).to_opensees_bwbn(), "does not degrade, got delta_nu"),
    (lambda: hs.BoucWenBaberNoori(z0=0.5).to_opensees(), "begins with z = 0"),
    (lambda: hs.BoucWenBaberNoori(offset=0.5).to_opensees(), "no offset"),
    (lambda: hs.BoucWenBaberNoori(gain=0.0).to_opensees(), "needs a stiffness and a gain"),
    (lambda: hs.BoucWenBaberNoori(input_coefficients=(1.0, 1.0)).to_opensees(), "linear spring only"),
)
