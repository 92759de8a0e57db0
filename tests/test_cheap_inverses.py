"""A searched inverse copies the memory alone, and looks for no turn of laws that have none: to the same bits."""

import numpy as np
import pytest

import hysim as hs
from hysim._basics.frozen import checked
from hysim.kernels.stepping import drive
from hysim.models.inverse_search import searched_inverse

rng = np.random.default_rng(3)
U = np.concatenate([np.sin(np.linspace(0.0, 9.0, 90)), np.cumsum(0.1 * rng.normal(size=60)), [0.0, 2.0, -2.0]])
SLIPS = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.5, 0.3))
GENERAL = hs.GeneralizedBoucWen(n=1.5, b2=0.05, b4=0.1, b6=-0.1, gain=-0.3, input_coefficients=(1.0,))
SURE = {
    "generalised": GENERAL,
    "generalised, n = 1": hs.GeneralizedBoucWen(b3=0.1, gain=0.3, input_coefficients=(1.0,)),
    "plain Baber and Noori": hs.BoucWenBaberNoori(n=1.5, input_coefficients=(1.0,)),
    "sum": hs.BoucWen(n=1.5, gain=-0.4) + SLIPS + hs.Line(slope=0.5),
    "falling sum": hs.Dahl(coulomb=0.5) + hs.Line(slope=-3.0),
    "cascade": hs.BoucWen(n=1.6, feedthrough=1.0, gain=0.4) >> SLIPS >> GENERAL,
    "nested": (hs.BoucWen(n=2.5) + hs.Line(slope=1.0)) >> (SLIPS + hs.ColemanHodgdon(alpha=0.8, c=1.0, B=0.7)),
}
UNSURE = {
    "Zhu and Wang": hs.ZhuWangBoucWen(n=1.5, delta=0.1, input_coefficients=(2.0, 0.1)),
    "worn": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1, input_coefficients=(1.0,)),
    "stops": hs.BoucWen(n=1.5, feedthrough=0.2) + hs.Stop(threshold=0.2, gain=-0.3),
    "growing": hs.GeneralizedBoucWen(beta=0.2, gamma=-0.4, input_coefficients=(3.0,)),
    "cubic": hs.PolynomialBoucWen(input_coefficients=(1.0, 0.0, 0.1)) + hs.Line(slope=0.1),
}


def is_sure(inverse):
    return bool(inverse.parameters[2])


@pytest.mark.parametrize("name", [*SURE, *UNSURE])
def test_it_has_the_bits_of_a_search_that_copies_everything_and_trusts_nothing(name):
    law = {**SURE, **UNSURE}[name]
    y = law.response(U)
    cheap, dear = searched_inverse(law, law.compiled(U[0])), searched_inverse(None, law.compiled(U[0]))
    assert (is_sure(cheap), is_sure(dear)) == (name in SURE, False)
    assert cheap.state.size <= dear.state.size
    ours, theirs = np.empty(U.size), np.empty(U.size)
    assert drive(cheap.step, cheap.parameters, cheap.state, y, ours) == -1
    assert drive(dear.step, dear.parameters, dear.state, y, theirs) == -1
    np.testing.assert_array_equal(ours, theirs)
    assert ours == pytest.approx(U, abs=1e-10)


@pytest.mark.parametrize("name", SURE)
def test_no_input_has_another_slope_than_the_known_ones(name):
    law = SURE[name]
    low, high = law.known_slopes
    for scale in (0.01, 1.0, 30.0):
        u = scale * np.cumsum(np.random.default_rng(8).normal(size=2000))
        slopes = np.diff(law.response(u)) / np.diff(u)
        assert low - 1e-9 <= slopes.min()
        assert slopes.max() <= high + 1e-9


@pytest.mark.parametrize("seed", range(40))
def test_known_slopes_of_generalised_laws_bound_those_of_random_inputs(seed):
    draw = np.random.default_rng(seed)
    sectors = dict(zip(("b2", "b3", "b4", "b5", "b6"), draw.uniform(-0.4, 0.4, 5).tolist(), strict=True))
    shape = {"A": draw.uniform(0.2, 2.0), "beta": draw.uniform(-0.2, 1.0), "gamma": draw.uniform(-0.5, 1.0)}
    law = hs.GeneralizedBoucWen(**sectors, **shape, n=draw.uniform(0.6, 3.0), z0=draw.uniform(-2.0, 2.0))
    low, high = law.known_slopes
    u = np.cumsum(draw.normal(size=3000) * draw.choice([0.05, 1.0], 3000))
    if np.isfinite([low, high]).all():
        slopes = np.diff(law.response(u)) / np.diff(u)
        assert low - 1e-9 <= slopes.min()
        assert slopes.max() <= high + 1e-9


def test_most_generalised_laws_near_a_bouc_wen_law_know_their_slopes():
    known = [hs.GeneralizedBoucWen(beta=0.6, gamma=0.3, b2=b, b6=-b).known_slopes for b in np.linspace(-0.2, 0.2, 9)]
    assert np.isfinite(known).all()


@checked
class Counting(hs.Law):
    """A line that counts its evaluations in its workspace."""

    slope: float = 1.0
    known: float = 0.0

    initial = ()
    workspace = 1

    @staticmethod
    def step(parameters, state, u):
        state[0] = u
        state[1] += 1.0
        return parameters[0] * u + 0.01 * u**3

    @property
    def known_slopes(self):
        return (self.slope, 2.0 * self.slope) if self.known else super().known_slopes


def test_a_law_that_knows_its_slopes_is_evaluated_half_as_often():
    counts = []
    for law in (Counting(), Counting(known=1.0)):
        inverse = law.compiled_inverse(0.0)
        before, y = inverse.state[5], law.response(U)
        u = np.array([inverse.step(inverse.parameters, inverse.state, each) for each in y])
        assert u == pytest.approx(U, abs=1e-12)
        counts.append((inverse.state[5] - before) / U.size)
    assert counts[1] < 13.0 < 2.0 * counts[1] < counts[0]
