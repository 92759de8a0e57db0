"""The laws that are integrated along a branch: more samples on it change nothing, on hostile laws too."""

import numba
import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs

N_LAWS = 20 if numba.config.DISABLE_JIT else 100
FINE = 4 if numba.config.DISABLE_JIT else 16
PERTURBATION = 2.0**-48
SAMPLES = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
EXPONENTS = np.array([0.3, 0.5, 0.8, 1.0, 1.3, 2.0, 2.7, 4.0, 6.0, 8.0, 12.0])


def spread(rng, low, high, size=N_LAWS):
    """Numbers between the two, uniform in the logarithm."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def states(rng, scale):
    """At zero, close to it, in between and beyond saturation."""
    sizes = [np.zeros(N_LAWS), spread(rng, 1e-15, 1.0), rng.random(N_LAWS), spread(rng, 0.9, 3.0)]
    return np.choose(rng.integers(0, 4, N_LAWS), sizes) * scale * rng.choice([-1.0, 1.0], N_LAWS)


def zhu_wang(rng):
    A, beta, n = spread(rng, 0.1, 10.0), spread(rng, 0.05, 5.0), rng.choice(EXPONENTS, N_LAWS)
    gamma = beta * rng.uniform(-1.2, 1.3, N_LAWS)
    scale = (A / np.maximum(np.abs(beta + gamma), 0.01)) ** (1.0 / n)
    delta = A / scale * spread(rng, 1e-3, 1.0) * rng.choice([-1.0, 0.0, 1.0], N_LAWS)
    sets = {"A": A, "beta": beta, "gamma": gamma, "n": n, "delta": delta, "z0": states(rng, scale)}
    return hs.ZhuWangBoucWen, sets, rng.uniform(-2.0, 2.0, N_LAWS) * scale, scale / A


def baber_noori(rng):
    A, beta = spread(rng, 0.3, 3.0), spread(rng, 0.1, 3.0)
    n = np.where(rng.random(N_LAWS) < 0.5, rng.choice([1.0, 2.0], N_LAWS), rng.choice(EXPONENTS, N_LAWS))
    gamma = beta * rng.uniform(-0.9, 1.3, N_LAWS)
    scale = (A / (beta + gamma)) ** (1.0 / n)
    e = scale * scale / A
    some = lambda values: values * (rng.random(N_LAWS) < 0.6)  # noqa: E731
    sets = {
        **{"A": A, "beta": beta, "gamma": gamma, "n": n, "z0": states(rng, scale)},
        **{"delta_a": some(spread(rng, 1e-4, 0.05) * A / e), "delta_nu": some(spread(rng, 1e-4, 0.3) / e)},
        **{"delta_eta": some(spread(rng, 1e-4, 0.3) / e), "zeta_s": some(rng.uniform(0.1, 0.99, N_LAWS))},
        **{"q": some(rng.uniform(0.0, 0.6, N_LAWS)), "p": spread(rng, 0.01, 10.0) / e},
        **{"psi": spread(rng, 0.02, 1.0) * scale, "delta_psi": some(spread(rng, 1e-3, 0.1) * A / scale)},
        "lambda_": spread(rng, 0.05, 1.0),
    }
    return hs.BoucWenBaberNoori, sets, np.zeros(N_LAWS), scale / A


def duhem(rng, parts=("p", "q")):
    shape = (N_LAWS, 3, 3)
    sets = {}
    for part in parts:
        sizes = spread(rng, 1e-3, 10.0, shape) * rng.choice([-1.0, 1.0], shape)
        sets[part] = np.where(rng.random(shape) < 0.6, 0.0, sizes)
    sets["q"][:, 0, 1] = -spread(rng, 0.1, 10.0)
    sets["y0"] = states(rng, 1.0)
    return hs.Duhem, sets, rng.uniform(-1.0, 1.0, N_LAWS), np.full(N_LAWS, 0.1)


def duhem_with_sizes(rng):
    return duhem(rng, ("p", "q", "p_abs", "q_abs"))


@pytest.mark.parametrize("draw", [zhu_wang, baber_noori, duhem, duhem_with_sizes])
def test_more_samples_on_a_branch_change_nothing(draw):
    rng = np.random.default_rng(7)
    family, sets, u0, unit = draw(rng)
    stroke = unit * spread(rng, 1e-3, 60.0) * rng.choice([-1.0, 1.0], N_LAWS)
    initial, strength = ("y0", "q") if family is hs.Duhem else ("z0", "A")

    def responses(pieces, **changed):
        u = u0[:, None] + stroke[:, None] * np.linspace(0.0, 1.0, pieces + 1)
        return family.responses({**sets, **changed}, u, workers=1)

    coarse, fine = responses(1)[:, -1], responses(FINE)
    # What a rounding of the state or the law does to the end: a divergence, or a growth from rounding, tells the
    # samplings apart too.
    neighbours = [responses(FINE, **{name: sets[name] * (1.0 + PERTURBATION)})[:, -1] for name in (initial, strength)]
    same = np.all(np.isfinite([coarse, fine.sum(axis=1), *neighbours]), axis=0)
    assert same.sum() > 0.7 * N_LAWS
    assert np.array_equal(same, np.all(np.isfinite([fine.sum(axis=1), *neighbours]), axis=0))
    coarse, fine, neighbours = coarse[same], fine[same], np.array(neighbours)[:, same]
    sensitivity = np.abs(neighbours - fine[:, -1]).max(axis=0)
    room = 1e-9 * np.ptp(fine, axis=1) + 4.0 * sensitivity + 1e-15 * np.abs(sets[initial][same])
    error = np.abs(coarse - fine[:, -1])
    worst = int(np.argmax(error - room))
    law = np.flatnonzero(same)[worst]
    assert error[worst] <= room[worst], {name: values[law] for name, values in sets.items()} | {"u": u0[law]}


@pytest.mark.parametrize("n", [1.0, 2.0, 1.5])
def test_a_long_branch_does_not_step_over_the_pinching(n):
    model = hs.BoucWenBaberNoori(A=2.0, beta=0.3, gamma=0.2, n=n, zeta_s=0.9)
    u = np.array([0.0, 3.0, -3.0, 3.0, -3.0, 0.0])
    fine = np.interp(np.arange(0.0, 5.0 + 1e-9, 1.0 / 64.0), np.arange(6), u)
    y = model.response(u)
    assert np.abs(model.response(fine)[::64] - y).max() < 1e-9 * np.ptp(y)
    if n == 1.0:
        assert y[-1] == pytest.approx(0.833, abs=5e-4)  # as an adaptive solver has it, to its last printed digit


def test_a_large_power_that_grows_from_nothing_on_one_step_is_not_missed():
    """The memory nearly doubles, its power 40 grows from 1e-20 of the slope by 1e11, and the first terms show none."""
    c, z0 = 1e-8, 0.51
    law = {"A": 1.0, "beta": 0.5 * (1.0 + c), "gamma": -0.5 * (1.0 - c), "n": 40.0, "z0": z0}
    for beyond in (1e-2, 1e-6, 1e-8, 3e-9, 1e-9):  # the disc that keeps away from zero reaches as far beyond the step
        length = 0.9 * z0 / (1.0 + beyond)
        worn = hs.BoucWenBaberNoori(**law, delta_nu=1e-30)  # so little that the law stays
        assert worn.memory([0.0, length])[-1] == pytest.approx(hs.BoucWen(**law).memory([0.0, length])[-1], rel=1e-10)


# ---------------------------------------------------------------------------------- memories that wear off


def in_pieces(model, length, state, counts=(1, 2, 64)):
    """States after an input that rises by `length`, in so many pieces."""
    return [model.advance(np.linspace(0.0, length, pieces + 1)[1:], state)[1] for pieces in counts]


def test_no_step_goes_over_two_zeros():
    """Where the strength has worn off the memory swings about zero, by less and less.

    In many pieces each is held to its own small range, below the rounding of the strength, and is refused as too stiff.
    """
    own = {"delta_a": 89.97, "delta_nu": 0.602859, "delta_eta": 0.74735}
    model = hs.BoucWenBaberNoori(A=195.407, beta=6.35573, gamma=3.53169, n=1.0, **own)
    ends = np.array(in_pieces(model, 7.65, (0.0, 2e-5, 0.0), (1, 2)))
    assert np.ptp(ends, axis=0).max() < 1e-10 * 9.3  # of the range of z on the way


def test_a_first_step_that_is_far_too_long_is_cut():
    """The energy of a plain law, whose memory falls 1000 times as fast at first as it rises then."""
    A, fall, rise, z0, length = 0.004, 7e7, 128.0, 0.0013, 5.7
    model = hs.BoucWenBaberNoori(A=A, beta=0.5 * (rise + fall), gamma=0.5 * (rise - fall), n=2.0, z0=-z0)
    to_zero = np.arctan(np.sqrt(fall / A) * z0) / np.sqrt(A * fall)
    energy = np.log(np.cosh(np.sqrt(A * rise) * (length - to_zero))) / rise
    energy -= np.log1p(fall / A * z0 * z0) / (2.0 * fall)
    found = [end[2] for end in in_pieces(model, length, (0.0, -z0, 0.0))]
    assert found == pytest.approx([energy] * 3, rel=1e-10, abs=0.0)


@pytest.mark.parametrize(("n", "z0"), [(10.0, -885.0), (0.4, -0.02), (2.0, -1e5)])
def test_a_memory_that_falls_fast_has_not_escaped(n, z0):
    """Steps much shorter than a rounding of the input were taken for an escape."""
    model = hs.BoucWenBaberNoori(beta=501.0, gamma=-499.0, n=n, z0=z0, delta_nu=1e-3, delta_eta=1e-3)
    ends = np.array(in_pieces(model, 5e3 if n < 1.0 else 5.0, (0.0, z0, 0.0)))
    assert np.isfinite(ends).all()
    assert np.ptp(ends[:, 1:], axis=0) == pytest.approx(0.0, abs=1e-9 * np.abs(ends[0, 1:]).max())


def test_a_memory_that_grows_fast_and_does_escape_is_said_to():
    worn = {"delta_nu": 1e-3, "delta_eta": 1e-3}
    for n in (1.5, 2.0, 2.001, 6.0):
        model = hs.BoucWenBaberNoori(beta=-10.0, gamma=-1.0, n=n, **worn)
        for pieces in (1, 64):
            assert_refused("diverges", model.response, np.linspace(0.0, 5.0, pieces + 1), error=hs.SimulationError)


def test_a_memory_that_leaves_zero_and_comes_back_within_a_step_is_cut_there():
    model = hs.ZhuWangBoucWen(A=38.6, beta=2.3e-3, gamma=2.3e-3, n=2.0, delta=-1311.0)
    ends = np.array(in_pieces(model, 0.675, (0.0, 0.0)))
    assert np.ptp(ends[:, 1]) < 1e-10 * abs(ends[0, 1])


@pytest.mark.parametrize("end", np.linspace(2.5, -0.2, 10))
def test_no_step_goes_over_a_pole(end):
    """The memory drifts off an unstable balance at first, and grows without end at u = 2.6."""
    model = hs.ZhuWangBoucWen(A=-0.153528, beta=-519.368, gamma=-584.55, n=2.0, delta=-9.03205e-6, z0=-0.01197)
    assert_refused("diverges", model.response, [2.77672, end], error=hs.SimulationError)


def test_a_search_gives_up_a_law_that_bends_between_two_samples_alone():
    gentle, stiff = (hs.ZhuWangBoucWen(beta=beta, gamma=0.0, n=1.5) for beta in (1e2, 1e7))
    assert np.isfinite([law.response(SAMPLES) for law in (gentle, gentle.known_to(1e-4), stiff)]).all()
    with pytest.raises(hs.SimulationError):
        stiff.known_to(1e-4).response(SAMPLES)
