"""The inverse of a response is accepted where the output stands still, saturated, and its response is that output."""

import numpy as np
import pytest

import hysim as hs

UNIT = 2.0**-52


def saturating(rng: np.random.Generator) -> dict[str, hs.Law]:
    """One random law of each invertible family that saturates, with or without a slope beside its memory."""
    beta, n = rng.uniform(0.2, 2.0), rng.choice([1.0, 1.5, 2.0, 3.3])
    shape = {"A": rng.uniform(0.3, 3.0), "beta": beta, "gamma": 0.9 * beta * rng.uniform(-1.0, 1.0), "n": n}
    gain = rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 2.0)
    line = rng.choice([0.0, rng.uniform(0.0, 1.0)])
    beside = {"gain": gain, "offset": rng.normal(), "input_coefficients": (np.sign(gain) * line,)}
    dahl = hs.Dahl(stiffness=shape["A"], coulomb=beta)
    return {
        "BoucWen": hs.BoucWen(**shape, gain=gain, feedthrough=np.sign(gain) * line),
        "PolynomialBoucWen": hs.PolynomialBoucWen(**shape, **beside),
        "GeneralizedBoucWen": hs.GeneralizedBoucWen(n=n, **beside),
        "BoucWenBaberNoori": hs.BoucWenBaberNoori(**shape, **beside),
        "ZhuWangBoucWen": hs.ZhuWangBoucWen(**shape, delta=0.0, **beside),
        "Dahl": dahl,
        "Sum": dahl + hs.Line(slope=line),
        "Cascade": hs.BoucWen(**shape) >> hs.PrandtlIshlinskii(thresholds=(0.0, 0.1), weights=(1.0, 0.5)),
        "Stop": hs.Stop(threshold=shape["A"]) + hs.Line(slope=line),
        "MaxwellSlip": hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(shape["A"], 0.4)) + hs.Line(slope=line),
        "Tellinen": hs.Tellinen(saturation=2.0, coercivity=0.4, squareness=0.6) + hs.Line(slope=line),
    }


@pytest.mark.parametrize("name", saturating(np.random.default_rng(0)))
def test_the_inverse_of_a_response_that_saturates_is_accepted(name):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        law = saturating(rng)[name]
        strokes = rng.choice([-1.0, 1.0], 6) * rng.choice([1e-3, 0.3, 2.0, 20.0, 60.0], 6) * rng.uniform(0.5, 1.0, 6)
        u = np.append(0.0, np.cumsum(strokes))
        y = law.response(u)
        again = law.response(np.append(0.0, law.inverse_response(y[1:], u0=0.0)))
        # 64 roundings of the terms, of which the input is one; the highest slope is 15
        room = 1e-10 if name in ("BoucWenBaberNoori", "ZhuWangBoucWen") else 64.0 * UNIT  # which are integrated
        assert np.abs(again - y).max() <= room * (np.abs(y).max() + np.abs(u).max() + 3.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    "law", [hs.BoucWenBaberNoori(n=2.0), hs.GeneralizedBoucWen(), hs.BoucWen(), hs.Dahl()], ids=lambda law: type(law)
)
def test_it_goes_on_from_a_state_that_is_saturated(law, side):
    _, state = law.advance([0.0, 30.0 * side])
    found = law.inverse_response([0.7 * side], state=state)
    assert law.advance(found, state)[0] == pytest.approx([0.7 * side], abs=1e-10)


def test_the_input_is_the_first_one_to_a_fourth():
    """Its output is -1 from u = -19 on, where the memory has come to its limit within rounding."""
    law = hs.GeneralizedBoucWen(n=2.0)
    u = law.inverse_response(law.response([0.0, -1000.0])[1:], u0=0.0)
    assert -19.0 * 1.25 < u[0] < -18.0
