"""The laws that a search takes in place of integrated ones: with the same outputs, at looser tolerances."""

import numpy as np
import pytest

import hysim as hs
from hysim.identification._problem import problem
from hysim.identification._search import optima
from hysim.models.search_space import Freedom

N_LAWS, N_SAMPLES = 24, 60


def hostile(seed, **ranges):
    """Parameters of many laws, those of positive ranges drawn by the logarithm."""
    rng = np.random.default_rng(seed)
    own = {
        name: np.exp(rng.uniform(*np.log(pair), N_LAWS)) if pair[0] > 0.0 else rng.uniform(*pair, N_LAWS)
        for name, pair in ranges.items()
    }
    return {"n": np.exp(rng.uniform(np.log(0.5), np.log(10.0), N_LAWS)), "z0": rng.uniform(-0.5, 0.5, N_LAWS), **own}


WEAR = {"beta": (0.0, 4.0), "gamma": (-3.0, 3.0), "delta_nu": (-0.05, 0.3), "delta_eta": (-0.02, 0.3)}
PINCHING = {"zeta_s": (0.1, 0.99), "q": (-0.5, 0.5), "p": (0.1, 50.0), "psi": (0.05, 2.0), "lambda_": (0.05, 2.0)}
LAWS = {
    "ramp": (hs.ZhuWangBoucWen(), hostile(0, beta=(0.0, 4.0), gamma=(-3.0, 3.0), delta=(-1.0, 1.0))),
    "wear": (hs.BoucWenBaberNoori(), hostile(1, **WEAR)),
    "pinching": (hs.BoucWenBaberNoori(), hostile(2, **WEAR | PINCHING | {"gamma": (0.1, 3.0)})),
}


def strokes():
    """An input that crosses zeros of the memory in one sample, and stays near one for many."""
    rng = np.random.default_rng(3)
    return np.concatenate([rng.uniform(-1.5, 1.5, N_SAMPLES), 1e-3 * np.cumsum(rng.standard_normal(N_SAMPLES))])


@pytest.mark.parametrize("of", LAWS)
def test_the_close_law_has_the_output_of_the_law(of):
    law, sets = LAWS[of]
    y, close = (type(each).responses(sets, strokes(), workers=1) for each in (law, law.known_to(1e-8)))
    is_finite = np.isfinite(y).all(axis=1)
    assert np.array_equal(np.isfinite(close).all(axis=1), is_finite)
    assert is_finite.sum() > N_LAWS // 2
    error = np.abs(close[is_finite] - y[is_finite]).max(axis=1) / np.ptp(y[is_finite], axis=1)
    # Each step leaves out 1e-8, of which a law that pinches and grows keeps some hundreds.
    assert 0.0 < error.max() < 1e-5
    assert np.median(error) < 1e-7


def test_a_record_that_turns_at_most_samples_is_searched_on_its_beginning():
    rng = np.random.default_rng(4)
    u = rng.uniform(-0.5, 0.5, 2500)
    u[[1040, 700]] = -1.0, 1.0
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=u)], Freedom(), None)
    assert whole.thinned(250) is None
    short = whole.beginning(1000)
    assert short is not None
    assert np.array_equal(short.parts[0].record.u, u[:1041])
    grown = u * np.linspace(0.1, 1.0, u.size) ** 4  # has most of its span near its end only
    assert problem(hs.BoucWen(), [hs.Record(u=grown, y=u)], Freedom(), None).beginning(1000) is None


def test_the_beginning_leads_to_the_optimum_of_the_whole_record():
    rng = np.random.default_rng(5)
    u = np.concatenate([[-1.0, 1.0], rng.uniform(-1.0, 1.0, 2200)])
    truth = hs.BoucWen(beta=1.2, gamma=-0.4, n=1.0, gain=0.5, feedthrough=0.3)
    y = truth.response(u) + 0.01 * rng.standard_normal(u.size)
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=y)], Freedom(fixed={"n": 1.0}), None)
    assert whole.beginning(1000) is not None
    true_cost = float(np.sum((truth.response(u) - y) ** 2))
    assert optima(whole, seed=0)[0].cost <= true_cost
