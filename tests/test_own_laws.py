"""A scalar function of the user's is a law like the others: for response, simulate, identify and loops."""

import math
import pickle

import numba
import numpy as np
import pytest
from strategies import COMPILED, assert_cut_or_stepped_it_has_the_same_bits, assert_refused, refused

import hysim as hs


def dahl(parameters, state, u):
    """Dahl's friction, dz/du = rate (1 - sign(du) z / limit): Bouc-Wen with n = 1, gamma = 0."""
    rate, limit = parameters[0], parameters[1]
    du = u - state[0]
    end = math.copysign(limit, du)
    state[1] = end + (state[1] - end) * math.exp(-rate * abs(du) / limit)
    state[0] = u
    return state[1]


def play(parameters, state, u):
    """Backlash of half width r, beside a line."""
    gain, r, slope = parameters
    state[1] = max(u - r, min(u + r, state[1]))
    state[0] = u
    return gain * state[1] + slope * u


def logarithm(parameters, state, u):
    """Lost for u < 0."""
    state[0] = u
    return math.log(u) * parameters[0]


DAHL = hs.CustomLaw(
    step=dahl,
    parameters={"rate": 1.5, "limit": 0.8},
    state={"z0": 0.1},
    bounds={"rate": (0.1, 10.0), "limit": (0.1, 10.0)},
)
PLAY = hs.CustomLaw(
    step=play,
    parameters={"gain": 2.0, "r": 0.25, "slope": 0.5},
    state={"w0": 0.0},
    bounds={"r": (0.0, 1.0)},
    linear=("gain", "slope"),
)
TWIN = hs.BoucWen(A=1.5, beta=1.5 / 0.8, gamma=0.0, z0=0.1)
U = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60) * np.linspace(1.0, 0.4, 121)


def test_dahls_law_is_the_built_in_one():
    assert DAHL.response(U) == pytest.approx(TWIN.response(U), abs=1e-14)  # rounding of numbers of order one
    sim = hs.simulate(DAHL, None, U)
    assert np.array_equal(sim.y, DAHL.response(U))


def test_a_compiled_function_and_a_plain_one_are_the_same_law():
    jitted = hs.CustomLaw(step=numba.njit(dahl), parameters=DAHL.parameters, state=DAHL.state)
    assert np.array_equal(jitted.response(U), DAHL.response(U))


@pytest.mark.parametrize("law", [DAHL, PLAY], ids=["dahl", "play"])
def test_cut_or_stepped_it_has_the_same_bits(law):
    assert_cut_or_stepped_it_has_the_same_bits(law, U, 50)
    assert DAHL.advance(U)[1] == (U[-1], DAHL.response(U)[-1])


def test_a_closed_loop_around_it_is_that_around_the_built_in_one():
    mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.4, 1.0))
    t = np.arange(200) / 20.0
    own, built_in = (
        hs.close_loop(hs.Actuator(hysteresis=law, vibration=mode), hs.PID(ki=0.4), t, 0.5 * np.sin(t))
        for law in (DAHL, TWIN)
    )
    assert np.ptp(own.u) > 0.1
    assert own.y == pytest.approx(built_in.y, rel=1e-12, abs=1e-14)
    assert own.u == pytest.approx(built_in.u, rel=1e-12, abs=1e-14)


def test_identify_recovers_dahls_parameters():
    rec = hs.Record(u=U, y=TWIN.response(U))
    start = hs.CustomLaw(step=dahl, parameters={"rate": 5.0, "limit": 3.0}, state={"z0": 0.1}, bounds=DAHL.bounds)
    fit = hs.identify(start, rec)
    assert fit.free_names == ("rate", "limit")
    assert fit.estimates == pytest.approx({"rate": 1.5, "limit": 0.8, "z0": 0.1}, rel=1e-7)
    assert fit.model.response(U) == pytest.approx(rec.y, abs=1e-7)


def test_linear_parameters_are_solved_for_and_initial_values_can_be_free():
    rec = hs.Record(u=U, y=PLAY.response(U))
    fit = hs.identify(PLAY, rec, bounds={"w0": (-1.0, 1.0)})
    assert fit.free_names == ("gain", "r", "slope", "w0")
    assert {name: fit.estimates[name] for name in ("gain", "r", "slope")} == pytest.approx(
        {"gain": 2.0, "r": 0.25, "slope": 0.5}, rel=1e-6
    )
    assert fit.fit_percent > 99.999
    rest = hs.identify(PLAY, rec, fixed={"r": 0.25}, initial="rest")
    assert rest.free_names == ("gain", "slope")
    assert rest.estimates["gain"] == pytest.approx(2.0, rel=1e-12)


def test_it_is_compared_with_the_others():
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=60)
    rec = hs.Record(u=u, y=TWIN.response(u))
    table = hs.compare({"own": DAHL, "line": hs.Line}, rec)
    assert "own" in table.to_text()


def test_it_is_a_value():
    assert pickle.loads(pickle.dumps(DAHL)) == DAHL
    assert hash(DAHL) == hash(pickle.loads(pickle.dumps(DAHL)))
    assert PLAY.assemble({"r": 0.25}) == PLAY
    assert PLAY.assemble({"r": 0.5}) != PLAY


def test_a_lost_law_names_the_sample():
    law = hs.CustomLaw(step=logarithm, parameters={"gain": 1.0})
    if not COMPILED:  # Python's own logarithm raises instead of nan
        return
    assert_refused(r"sample 1 \(u = -1\)", law.response, [1.0, -1.0], error=hs.SimulationError)


test_wrong_arguments_are_named = refused(
    (lambda: hs.CustomLaw(step=lambda u: u, parameters={"a": 1.0}), TypeError, r"takes \(u\)"),
    (lambda: hs.CustomLaw(step="dahl", parameters={"a": 1.0}), TypeError, "must be a function"),
    (lambda: hs.CustomLaw(step=dahl), "at least one parameter"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": np.nan}), "a'] must be finite"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": "b"}), TypeError, "a'] must be numbers"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, state={"a": 1.0}), "'a' names a parameter and"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, linear=("b",)), "linear names 'b'"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, bounds={"b": (0, 1)}), "bounds names 'b'"),
    (lambda: DAHL.advance([0.0], (0.0,)), "must hold 2 numbers, got 1"),
    (lambda: hs.identify(DAHL, hs.Record(u=U, y=U), free=("z0",)), "'z0' is free, but has no bounds"),
    (lambda: hs.identify(DAHL, hs.Record(u=U, y=U), bounds={"rate": (1.0, np.inf)}), "must be positive and finite"),
)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize(
    "step", [lambda parameters, state, u: "text", lambda parameters, state, u: sorted(u), lambda p, s, u: s.missing]
)
def test_what_does_not_compile_is_refused_with_the_reason(step):
    assert_refused("does not compile as step", hs.CustomLaw, error=TypeError, step=step, parameters={"a": 1.0})
