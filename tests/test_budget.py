"""A search may be bounded, and says so where it was."""

import numpy as np
from strategies import assert_refused

import hysim as hs

U = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
LAW = hs.BoucWen(beta=1.5, gamma=0.5, n=1.4, gain=2.0, feedthrough=0.3)
RECORD = hs.Record(u=U, y=LAW.response(U) + 1e-3 * np.random.default_rng(0).standard_normal(U.size))


def simulated(monkeypatch, **options):
    """Parameter sets that an identification simulates, and its result."""
    counts, original = [], hs.BoucWen.regressors

    def counted(self, parameters, record):
        counts.append(max(map(np.size, parameters.values())) * len(record) / len(RECORD))
        return original(self, parameters, record)

    monkeypatch.setattr(hs.BoucWen, "regressors", counted)
    fit = hs.identify(hs.BoucWen, RECORD, **options)
    monkeypatch.undo()
    return sum(counts), fit


def test_a_bounded_search_is_partial_and_short(monkeypatch):
    most = 300
    all_of_it, whole = simulated(monkeypatch)
    part, fit = simulated(monkeypatch, max_evaluations=most)
    assert all_of_it > 5000.0
    assert part < 1.2 * most + 150.0  # the optima that it has are described
    assert whole.success
    assert not fit.success
    assert fit.message.startswith(f"partial: the search stopped at max_evaluations={most}")
    assert any("did not converge" in each or "partial" in each for each in (*fit.warnings, fit.message))
    assert np.isfinite(fit.rmse)


def test_a_generous_bound_changes_nothing():
    whole, bounded = (hs.identify(hs.Dahl, RECORD, max_evaluations=most) for most in (None, 10**7))
    assert bounded.success
    assert bounded.estimates == whole.estimates


def test_errors_of_samples_left_out_need_no_budget():
    whole, bounded = (hs.identify(hs.Dahl, RECORD, max_evaluations=most, cross_validate=5) for most in (None, 100))
    assert not bounded.success
    assert abs(bounded.cv_rmse / whole.cv_rmse - 1.0) < 1e-3


def test_a_comparison_marks_partial_results_and_says_which_runs():
    names = []
    table = hs.compare(
        {"bouc-wen": hs.BoucWen, "line": hs.Line}, RECORD, cross_validate=None, max_evaluations=200, workers=1,
        announce=names.append,
    )  # fmt: skip
    assert names == ["bouc-wen", "line"]
    assert not table["bouc-wen"].success
    assert "partial" in table["bouc-wen"].message
    assert table["line"].success
    assert "bouc-wen (partial)" in table.to_text()
    names.clear()
    chosen = hs.select([hs.BoucWen, hs.Line], RECORD, max_evaluations=200, announce=names.append)
    assert names == ["BoucWen", "Line"]
    assert "BoucWen (partial)" in chosen.to_text()
    assert_refused("max_evaluations must be", hs.identify, hs.Line, RECORD, max_evaluations=0)
