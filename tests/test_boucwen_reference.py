"""The law against 30 digits, its batch against its path, and the reductions of a batch against its rows."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import bounded_laws, refused

import hysim as hs

REFERENCE = np.load(Path(__file__).parent / "data" / "boucwen_reference.npz")
SWEEP = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=26)


def test_a_thousand_random_laws_agree_with_thirty_digits():
    worst = []
    for (A, beta, gamma, n), u, z in zip(REFERENCE["laws"], REFERENCE["u"], REFERENCE["z"], strict=True):
        error = np.abs(hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n).memory(u) - z).max()
        worst.append(error / np.ptp(z))
    assert len(worst) == 1000
    assert max(worst) < 1e-12


@given(st.lists(bounded_laws(), min_size=1, max_size=6), st.permutations(range(6)))
def test_every_reduction_is_the_measure_of_the_row(laws, order):
    laws = [laws[k] for k in order if k < len(laws)]
    sets = {name: [getattr(law, name) for law in laws] for name in laws[0].scalars}
    u, target = 0.4 * SWEEP, np.cos(SWEEP)
    rows = [law.response(u) for law in laws]
    loops = [hs.loop_metrics(u, row) for row in rows]
    expected = {
        "sse": [np.sum((row - target) ** 2) for row in rows],
        "max_width": [loop.max_width for loop in loops],
        "area": [loop.area for loop in loops],
        "final": [row[-1] for row in rows],
    }
    for reduce, values in expected.items():
        goal = target if reduce == "sse" else None
        # 1e-12: sums in another order; the absolute part is the rounding of a loop without a width
        assert hs.BoucWen.responses(sets, u, reduce=reduce, target=goal) == pytest.approx(values, rel=1e-12, abs=1e-15)
        own = hs.BoucWen.responses(sets, np.tile(u, (len(laws), 1)), reduce=reduce, target=goal, workers=1)
        assert own == pytest.approx(values, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("reduce", ["sse", "max_width", "area", "final"])
def test_a_law_that_escapes_is_reduced_to_inf(reduce):
    target = np.zeros(SWEEP.size) if reduce == "sse" else None
    sets = {"beta": [0.5, -9.0], "gamma": 0.0, "n": 2.0}
    kept, escaped = hs.BoucWen.responses(sets, SWEEP, reduce=reduce, target=target)
    assert np.isfinite(kept)
    assert escaped == np.inf


def test_the_order_of_the_sets_does_not_matter():
    rng = np.random.default_rng(1)
    sets = {"beta": rng.uniform(0.1, 2, 300), "n": rng.choice([0.5, 1.0, 1.3, 2.0, 7.0, 20.0], 300)}
    rows = hs.PolynomialBoucWen.responses(sets | {"input_coefficients": [[1.0, 0.2, 0.1]]}, SWEEP)
    for k in range(0, 300, 17):
        law = hs.PolynomialBoucWen(beta=sets["beta"][k], n=sets["n"][k], input_coefficients=(1.0, 0.2, 0.1))
        assert np.array_equal(rows[k], law.response(SWEEP))


test_wrong_reductions_are_named = refused(
    ({"reduce": "mean"}, "reduce must be one of"),
    ({"reduce": "sse"}, "takes a target"),
    ({"reduce": "area", "target": SWEEP}, "takes a target"),
    ({"reduce": "sse", "target": SWEEP[1:]}, "samples as u has"),
    call=lambda arguments: hs.BoucWen.responses({"beta": [0.1, 0.2]}, SWEEP, **arguments),
)
