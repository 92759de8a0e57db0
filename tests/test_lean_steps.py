"""The leanest step of a law: the bits of its family's step, in fewer places of state."""

import numpy as np
import pytest

import hysim as hs
from hysim.kernels.stepping import drive
from hysim.models.compiled_step import compiled_start, compiled_step

U = np.concatenate([2.0 * np.sin(np.linspace(0.0, 12.0, 120)), np.random.default_rng(5).normal(size=80), [0.0, 3.0]])
PLACES = {
    hs.BoucWen(beta=0.5, gamma=0.2): 2,
    hs.BoucWen(n=2.0): 2,
    hs.BoucWen(n=1.5): 4998,
    hs.PolynomialBoucWen(n=1.0, z0=0.1): 2,
    hs.GeneralizedBoucWen(n=1.0, b2=0.1, b4=-0.1, b6=0.2): 2,
    hs.GeneralizedBoucWen(n=2.0, b3=0.1, b5=-0.1): 2,
    hs.GeneralizedBoucWen(n=1.5, b3=0.1): 5024,
    hs.ZhuWangBoucWen(n=1.0, delta=0.1): 21,
    hs.ZhuWangBoucWen(n=1.5, delta=0.1): 21,
    hs.BoucWenBaberNoori(n=1.0): 38,
    hs.BoucWenBaberNoori(n=1.5, delta_nu=0.1): 38,
    hs.BoucWenBaberNoori(n=1.5): 38,
    hs.Dahl(): 2,
    hs.JilesAtherton(): 4,
    hs.ColemanHodgdon(): 2,
    hs.Play(): 2,
    hs.Line(): 1,
}


@pytest.mark.parametrize("law", PLACES, ids=lambda law: f"{type(law).__name__} {law.scalars.get('n', '')}".strip())
def test_the_leanest_step_has_the_bits_of_the_family(law):
    lean = law.compiled(0.0)
    assert lean.state.size == PLACES[law]
    family = compiled_step(type(law).step)
    state = np.zeros(law.packed[1].size + type(law).workspace)
    state[: law.packed[1].size] = law.packed[1]
    compiled_start(type(law).start)(law.packed[0], state, 0.0)
    family(law.packed[0], state, 0.0)
    ours, theirs = np.empty(U.size), np.empty(U.size)
    assert drive(lean.step, lean.parameters, lean.state, U, ours) == -1
    assert drive(family, law.packed[0], state, U, theirs) == -1
    np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(lean.state[: law.packed[1].size], state[: law.packed[1].size])


@pytest.mark.parametrize(
    ("model", "places"),
    [
        (hs.BoucWen(n=1.5) + hs.Line(slope=1.0), ((0, 2), (4998, 1))),
        (hs.BoucWen() + hs.Dahl() + hs.Line(), ((0, 5),)),
        (hs.Line(slope=1.0) >> hs.GeneralizedBoucWen(n=1.5) >> hs.Play(), ((0, 3), (5025, 2))),
        ((hs.Line() + hs.BoucWen(n=1.5)) >> hs.BoucWenBaberNoori(), ((0, 3), (4999, 3))),
    ],
)
def test_the_memory_is_where_a_model_says(model, places):
    assert model.memory_places == places
    law = model.compiled(0.1)
    filled = law.state.copy()
    ends = [first + count for first, count in places]
    for end, begin in zip(ends, [*(first for first, _ in places[1:]), filled.size], strict=True):
        assert end <= begin
    other = model.compiled(0.1)
    for u in U:  # another workspace, the same memory
        y = law.step(law.parameters, law.state, u)
        for first, count in places:
            other.state[first : first + count] = filled[first : first + count]
        assert other.step(other.parameters, other.state, u) == y
        filled = law.state.copy()
