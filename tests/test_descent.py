"""A step of the descent is the bounded regression that it says, and a constraint holds to rounding."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import hysim as hs
from hysim.identification._descent import Constraint, Descent
from hysim.identification._noise import Gaussian
from hysim.identification._problem import problem
from hysim.identification._search import polish
from hysim.identification.marquardt import bounded_steps
from hysim.models.search_space import Freedom

LOOP = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)
SETS = 6


@pytest.fixture(scope="module")
def descent():
    """Of a Dahl law: the logarithms of its stiffness and its Coulomb level are searched."""
    y = hs.Dahl(stiffness=5.0, coulomb=2.0).response(LOOP)
    record = hs.Record(u=LOOP, y=y + 0.01 * np.random.default_rng(0).standard_normal(LOOP.size))
    whole = problem(hs.Dahl(), [record], Freedom({}, (), {}), None)
    assert whole.space.coordinates == ("stiffness", "coulomb")
    return Descent(whole, Gaussian(1e-9), whole.y[np.newaxis], np.ones((1, whole.y.size)))


def drawn(descent, seed):
    """Some sets of parameters."""
    rng, space = np.random.default_rng(seed), descent.problem.space
    x = np.log([5.0, 2.0]) + rng.uniform(-1.0, 1.0, (SETS, 2))
    return np.concatenate([x, rng.uniform(0.5, 1.0, (SETS, len(space.linear)))], axis=1)


def named(descent, theta, places):
    """The parameter at each set's place."""
    return descent.problem.named(theta)[np.arange(SETS), places]


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("place", [0, 1])
def test_a_step_is_the_regression_inside_the_box(descent, side, place):
    """A coordinate a little from its side is driven beyond it; the others make the best of the step to the side."""
    theta, rng = drawn(descent, 1), np.random.default_rng(2)
    lower, upper = descent.box()
    near = lower[place] + 1e-3 if side < 0.0 else upper[place] - 2e-3
    theta[:, place] = near
    slopes = rng.standard_normal((SETS, LOOP.size, theta.shape[1]))
    wanted = rng.uniform(-0.1, 0.1, theta.shape)
    wanted[:, place] = side * 0.1
    residual = np.einsum("snk,sk->sn", slopes, wanted) + 1e-3 * rng.standard_normal((SETS, LOOP.size))
    steps = bounded_steps(slopes, residual, np.full(SETS, 1e-18), lower - theta, upper - theta, n_damped=2)
    stepped = np.clip(theta + steps, lower, upper)
    for k in range(SETS):
        best = lsq_linear(slopes[k], residual[k], (lower - theta[k], upper - theta[k]), tol=1e-14).x
        assert stepped[k] - theta[k] == pytest.approx(best, abs=1e-6)
        assert stepped[k, place] == (lower if side < 0.0 else upper)[place]
    assert np.abs(stepped - theta).max() > 0.05


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("factor", [0.5, 0.99, 3.0])
def test_a_constraint_on_a_curved_parameter_is_met_to_rounding(descent, place, factor):
    theta = drawn(descent, 3)
    places = np.full(SETS, place)
    constraint = Constraint(places, factor * named(descent, theta, places))
    assert not descent.keeps(theta, constraint).any()
    restored = descent.restored(theta, constraint, places)
    assert named(descent, restored, places) == pytest.approx(constraint.value, rel=1e-11)
    assert descent.keeps(restored, constraint).all()
    others = [k for k in range(theta.shape[1]) if k != place]
    assert np.array_equal(restored[:, others], theta[:, others])


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_whether_a_constraint_is_kept_does_not_depend_on_the_unit(descent, size):
    theta = drawn(descent, 4)
    theta[:, 0] = np.log(size)
    places = np.zeros(SETS, dtype=int)
    value = named(descent, theta, places)
    assert descent.keeps(theta, Constraint(places, value * (1.0 + 1e-9))).all()
    assert not descent.keeps(theta, Constraint(places, value * (1.0 + 1e-7))).any()


def test_sets_descend_together_as_each_does_alone(descent):
    theta = drawn(descent, 5)
    together = descent.run(theta)
    for k in range(SETS):
        alone = descent.run(theta[k : k + 1])
        assert together.theta[k] == pytest.approx(alone.theta[0], rel=1e-9)  # sums of a batch are rounded otherwise
        assert bool(together.at_rest[k]) == bool(alone.at_rest[0])


def test_a_narrow_bent_valley_is_followed_to_its_end():
    """A saturating loop is fitted by memories that nearly diverge: the curvatures of the cost differ by 1e9.

    The start is where straight steps, with slopes over a millionth of the box, lower the cost by 2 % in 200 steps.
    """
    u = np.concatenate([np.linspace(1.0, -1.0, 64), np.linspace(-1.0, 1.0, 64)[1:]])
    direction = np.sign(np.diff(u, prepend=2.0))
    record = hs.Record(u=u, y=np.tanh((u - 0.2 * direction) / 0.3))
    whole = problem(hs.BoucWen(), [record], Freedom({}, (), {}), None)
    start = np.array([[2.348185, -2.371288, 0.636117, 0.17317]])
    (end,) = polish(whole, start)
    assert end.converged
    assert end.cost < 0.02 * whole.costs(start)[0]
