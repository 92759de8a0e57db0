"""`select` finds the order behind the noise, and ranks by what it is asked."""

import numpy as np
from strategies import rao_garnier, refused

import hysim as hs
from hysim.identification import _search


def test_the_order_of_a_stiff_plant_is_found_in_noise():
    record, *_ = rao_garnier(10.0, 1)
    done = []
    choice = hs.select(
        hs.TransferFunction.structures(poles=range(2, 6), zeros=(1,)), record, progress=lambda *at: done.append(at)
    )
    assert choice.name == "4 poles, 1 zero"
    assert choice.best is choice.fits["4 poles, 1 zero"]
    assert done == [(k, 4) for k in range(1, 5)]
    scores = [fit.bic for fit in choice.fits.values()]
    assert scores == sorted(scores)
    lines = choice.to_text().splitlines()
    assert len(lines) == 2 + 4
    assert lines[0].split()[-1] == "bic"
    assert lines[2].startswith("4 poles, 1 zero ")


def test_candidates_of_unlike_families_are_ranked_by_any_criterion():
    record = hs.datasets.table1(dwell=1.0)
    for criterion in ("bic", "aic", "fpe", "cv_rmse"):
        choice = hs.select([hs.Line, hs.SingleValued], record, criterion=criterion, cross_validate=4)
        assert set(choice.fits) == {"Line", "SingleValued"}
        assert getattr(choice.best, criterion) == min(getattr(fit, criterion) for fit in choice.fits.values())


def test_structures_are_all_those_below_the_number_of_poles():
    found = hs.TransferFunction.structures(poles=(1, 2, 3), delays=(0.0, 0.5, "free"), sample="end")
    assert len(found) == (1 + 2 + 3) * 3
    assert found["3 poles, 1 zero, delay 0.5 s"].delay == 0.5
    assert found["1 pole, 0 zeros, free delay"].delay is None
    assert all(structure.sample == "end" and structure.zeros < structure.poles for structure in found.values())


test_what_cannot_be_ranked_is_refused = refused(
    ([], {}, "nothing to select"),
    ([hs.Line, hs.Line], {}, "one name"),
    ([hs.Line], {"criterion": "r2"}, "criterion must be"),
    ([hs.Line], {"criterion": "cv_rmse"}, "needs a cross-validation"),
    (hs.Line, {}, TypeError, "use identify"),
    call=lambda candidates, options: hs.select(candidates, hs.datasets.table1(), **options),
)


def test_what_candidates_have_in_common_is_searched_once_and_is_what_each_finds_alone(monkeypatch):
    searched = []
    found = _search._found

    def counted(problem, *arguments):
        searched.append((type(problem.family), problem.y.size))
        return found(problem, *arguments)

    monkeypatch.setattr(_search, "_found", counted)
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=16)
    noise = 0.01 * np.random.default_rng(0).standard_normal(u.size)
    record = hs.Record(u=u, y=u - 0.5 * hs.BoucWen(beta=2.0, gamma=0.5, n=1.5).memory(u) + noise)
    families = {"plain": hs.BoucWen, "polynomial": hs.PolynomialBoucWen, "generalised": hs.GeneralizedBoucWen}
    together = hs.select(families, record).fits
    assert searched.count((hs.BoucWen, u.size)) == 1
    for name, family in families.items():
        assert hs.identify(family, record).estimates == together[name].estimates
    assert searched.count((hs.BoucWen, u.size)) == 4
    tables = [hs.compare(families, record, workers=workers, cross_validate=None) for workers in (1, 2)]
    assert searched.count((hs.BoucWen, u.size)) == 6
    assert tables[0].rows == tables[1].rows
