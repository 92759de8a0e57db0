"""The elimination of terms is that of plain regressions, also where a draw of the samples makes terms dependent."""

import numpy as np

from hysim.discovery._hidden_memory import TermRegression
from hysim.laws.differential.terms import power_term

TERMS = tuple(power_term(False, power, even=False) for power in range(4))


def regression(features, target):
    return TermRegression(TERMS, (), features, target, 1.0, 1e-9, 0, [np.arange(len(target))])


def losses(features, target, kept):
    """Sum of squares without each of the columns."""
    found = []
    for k in range(len(kept)):
        rest = features[:, kept[:k] + kept[k + 1 :]]
        found.append(np.sum((target - rest @ np.linalg.lstsq(rest, target, rcond=None)[0]) ** 2))
    return found


def test_each_step_leaves_out_the_term_that_costs_least():
    rng = np.random.default_rng(0)
    features = rng.standard_normal((60, 4)) * [1.0, 1e-6, 1e6, 1.0]
    target = features @ [1.0, 3e6, 1e-7, 0.0] + 0.1 * rng.standard_normal(60)
    kept, path = list(range(4)), []
    while kept:
        path.append(tuple(TERMS[k] for k in kept))
        kept.pop(int(np.argmin(losses(features, target, kept))))
    assert regression(features, target).eliminated() == path


def test_terms_that_depend_on_each_other_or_vanish_go_first():
    rng = np.random.default_rng(1)
    features = rng.standard_normal((60, 4))
    features[:, 1], features[:, 3] = 2.0 * features[:, 0], 0.0
    path = regression(features, features[:, 0] + features[:, 2]).eliminated()
    assert [len(each) for each in path] == [4, 3, 2, 1]
    assert TERMS[3] not in path[2]
    assert not {TERMS[0], TERMS[1]} <= set(path[2])
    assert TERMS[2] in path[2]
