"""The inverses that search on the law's step find every output that is reached, and refuse what is not.

Where an output is small beside its terms, or the law is flat, many inputs give it to rounding. So what is judged is the
output at the input that is found: it may be off by what rounds its terms, and by the promise of an integrated law.
"""

import numpy as np
import pytest
from more_samples_inverse import through_peaks

import hysim as hs

UNIT = 2.0**-52
STEPS = 16.0  # roundings of the terms that a search may leave
INTEGRATED = 1e-10  # of the memory's stroke, which is what an integrated law promises

CANCELLING = {
    "a line": hs.GeneralizedBoucWen(
        A=0.39, beta=0.0, gamma=0.0, gain=0.0391, offset=2.46328, z0=-62.78, input_coefficients=(-0.0367,)
    ),
    "Zhu and Wang": hs.ZhuWangBoucWen(
        A=-450.0, beta=74.0, gamma=23.0, n=1.5, delta=0.1, offset=2.75, z0=-2.75, input_coefficients=(4400.0,)
    ),
    "Baber and Noori": hs.BoucWenBaberNoori(
        A=0.27, beta=3e-4, gamma=3e-4, n=1.1, delta_nu=1e-5, gain=-2.0, offset=-500.0, z0=-250.0,
        input_coefficients=(-2.3,),
    ),
    "Duhem": hs.Duhem.from_terms({"u'": 0.3, "|u'| z": -3e-4}, feedthrough=11.5, offset=450.0, y0=-9.0),
}  # fmt: skip
"""Laws whose offset and memory cancel, but for an output a hundred times as small or smaller."""


@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("law", CANCELLING.values(), ids=CANCELLING)
def test_an_output_that_is_small_beside_its_terms_is_found(law, length):
    _, state = law.advance([0.0])
    end = law.advance([length], state)[0][0]
    wanted = np.linspace(law.advance([0.0], state)[0][0], end, 12)[1:]
    u = law.inverse_response(wanted, state=state)
    y, (_, z, *_) = law.advance(u, state)
    gain = 1.0 if isinstance(law, hs.Duhem) else abs(law.gain)
    terms = abs(law.offset) + gain * max(abs(z), abs(state[1])) + np.abs(y) + 5000.0 * length  # at most c1 u
    assert np.abs(y - wanted).max() <= STEPS * UNIT * terms.max() + INTEGRATED * gain * abs(z - state[1])
    assert (np.diff(u) > 0.0).all()


def test_the_search_comes_back_from_where_the_memory_has_grown_without_bound():
    """Newton's steps from there are 1/40 each, and the way back is 8.5 long."""
    law = hs.Duhem.from_terms({"u' z": -40.0}, feedthrough=-1.0, y0=1e-60)
    u = law.inverse_response([12.0], u0=0.0)
    assert -u[0] + 1e-60 * np.exp(-40.0 * u[0]) == pytest.approx(12.0, rel=1e-10)


@pytest.mark.parametrize(
    "law",
    [
        hs.ZhuWangBoucWen(beta=-1.0, gamma=-1.0, n=3.9, delta=-0.3, input_coefficients=(2.0,)),
        hs.BoucWenBaberNoori(n=2.0, zeta_s=0.3, delta_nu=-1e-3, p=0.1, psi=1.0, input_coefficients=(1.0,)),
        hs.GeneralizedBoucWen(n=1.5, gain=-0.3, input_coefficients=(1.0,)),
        hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -0.5}, feedthrough=2.0),
        hs.Tellinen(saturation=1.8, coercivity=120.0, squareness=0.5),
        hs.Chan(saturation=0.44, coercivity=16.0, squareness=0.25),
    ],
)
@pytest.mark.parametrize("tiny", [5e-324, -5e-324, 1e-309])
def test_an_output_below_the_smallest_number_of_full_precision_stays_where_it_is(law, tiny):
    assert law.inverse_response([0.0, tiny], u0=0.0).tolist() == [0.0, 0.0]
    assert np.abs(law.inverse_response([tiny])).max() < 1e-13


CURVE = hs.ZhuWangBoucWen(A=0.0, beta=0.0, gamma=0.0, input_coefficients=(0.05, 3.0, -3.0, 0.7))
"""It rises to 0.752 at u = 0.95, falls to -0.93 and rises again; its slope at zero takes Newton's first step to 10."""


def test_an_output_that_is_reached_before_the_law_turns_is_found_there():
    wanted = CURVE.response([0.0, 0.3, 0.7, 0.9])[1:]
    for value, u in zip(wanted, (0.3, 0.7, 0.9), strict=True):
        assert CURVE.inverse_response([value], u0=0.0)[0] == pytest.approx(u, abs=1e-14)
    with pytest.raises(hs.SimulationError, match="turns on the way"):
        CURVE.inverse_response([0.8], u0=0.0)


SOFT = hs.BoucWen(beta=-0.05, gamma=-0.05, n=2.0, gain=-0.1, feedthrough=1.0)
TURN = np.sqrt(10.0) * np.arctan(3.0)
"""Its memory is sqrt(10) tan(u / sqrt(10)), so that the slope 1 - 0.1 (1 + z^2 / 10) vanishes here, at u = 3.9498."""


@pytest.mark.parametrize("u", [0.5, 3.9, 3.94, 3.945])
@pytest.mark.parametrize("weights", [(0.02, 1.0), (1.0, 1.0)])
def test_a_cascade_reaches_an_output_just_before_it_turns(u, weights):
    """A little further on the first law escapes, so that an end beyond the turn tells nothing."""
    law = SOFT >> hs.PrandtlIshlinskii(thresholds=(0.0, 0.1), weights=weights)
    wanted = law.response([0.0, u])[1:]
    found = law.inverse_response(wanted, u0=0.0)
    assert law.response([0.0, found[0]])[1] == pytest.approx(wanted[0], rel=4.0 * UNIT)  # the slope is below one there
    with pytest.raises(hs.SimulationError, match="turns on the way"):
        law.inverse_response(law.response([0.0, TURN])[1:] * (1.0 + 1e-9), u0=0.0)


def test_a_cascade_whose_memory_escapes_at_once_on_the_way_back():
    stiff = hs.BoucWen(A=0.0, beta=-6e14, gamma=6.02e14, n=7.0, feedthrough=3e9, z0=-0.1)
    law = stiff >> hs.PrandtlIshlinskii(thresholds=(0.0,), weights=(2.0,))
    u = np.array([600.0, 300.0, 0.0])
    assert law.inverse_response(law.response(u)[1:], u0=600.0) == pytest.approx(u[1:], abs=1e-12)  # 600 roundings


def test_a_guess_too_short_to_move_the_output_is_no_turn():
    """All plays push at first, and only the smallest of them goes back: the slope falls from 58000 to 5."""
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.3, 0.6), weights=(0.02, 58.0, 89.0, 93.0))
    law = hs.BoucWen(gain=-1.0, feedthrough=240.0) >> plays
    u = 35000.0 - np.array([0.0, 1e-4, 3e-4])
    y = law.response(u)
    found = law.inverse_response(y[1:], u0=u[0])
    assert law.response(np.append(u[0], found))[1:] == pytest.approx(y[1:], rel=4.0 * UNIT)


def test_laws_that_are_drawn_with_an_inverse_are_looked_at_between_their_samples():
    """A memory rises a thousandfold and falls back within a hundredth of the stride: only the energy shows it."""
    law = hs.BoucWenBaberNoori(A=4.9, beta=-762.0, gamma=-355.0, n=1.3, delta_nu=-0.03, z0=1e-14)
    even = np.linspace(0.0, 3.0, 65)
    _, path = through_peaks(law, even)
    assert np.abs(path[:, 0]).max() > 100.0 * np.abs(law.memory(even)).max()


def test_an_input_at_which_the_memory_diverges_is_not_taken():
    """Newton's first step ends there. The slope is infinite, but it must not allow an error of any size."""
    law = hs.ZhuWangBoucWen(
        A=14621.1, beta=-1.7164e-07, gamma=-4.39699e-07, n=3.83036, delta=211450.0, gain=-55.1712,
        input_coefficients=(-1.04263e8,),
    )  # fmt: skip
    state = (1.365079359, -430.412453)
    u = law.inverse_response([6691.42], state=state)
    assert law.advance(u, state)[0] == pytest.approx([6691.42], abs=1e-11 * 1.5e8)  # an integrated law's promise


def test_a_slope_that_rounding_hides_is_sought_further_away():
    """The output is 2e-7 and rises by 1e-16 on the length 1e-6, which is one rounding or two."""
    first = hs.BoucWen(
        A=0.0, beta=-3.239791, gamma=-8.375956, n=2.0, feedthrough=1.1876678e-08, gain=5.443193, offset=-12.995702,
        z0=4.288676e-06,
    )  # fmt: skip
    law = first >> hs.PrandtlIshlinskii(thresholds=(0.0, 0.0125), weights=(6e-9, 6e-9))
    y = law.response([2.6824e-4, 100.0])
    u = law.inverse_response(y[1:], u0=2.6824e-4)
    assert law.response([2.6824e-4, u[0]])[1] == pytest.approx(y[1], rel=4.0 * UNIT)


# ----------------------------------------------------------------------------- where the output stands still, saturated


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
    # 64 roundings of the terms, of which the input is one; the highest slope is 15; two laws are integrated
    rounding, n_draws = (1e-10, 8) if name in ("BoucWenBaberNoori", "ZhuWangBoucWen") else (64.0 * UNIT, 20)
    for seed in range(n_draws):
        rng = np.random.default_rng(seed)
        law = saturating(rng)[name]
        strokes = rng.choice([-1.0, 1.0], 6) * rng.choice([1e-3, 0.3, 2.0, 20.0, 60.0], 6) * rng.uniform(0.5, 1.0, 6)
        u = np.append(0.0, np.cumsum(strokes))
        y = law.response(u)
        again = law.response(np.append(0.0, law.inverse_response(y[1:], u0=0.0)))
        assert np.abs(again - y).max() <= rounding * (np.abs(y).max() + np.abs(u).max() + 3.0)


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
