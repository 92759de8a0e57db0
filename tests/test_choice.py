"""`identify` without a family, and `select`: what predicts parts that are left out, and the order behind noise."""

import multiprocessing
import os
import sys
from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_refused, rao_garnier, refused

import hysim as hs
from hysim._basics import parallel as _parallel
from hysim._columns.turning import TOLERANCE
from hysim.cli import main
from hysim.identification import _choice, _identify, _search

CYCLE = np.sin(np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False))
GROWING = np.concatenate([size * CYCLE for size in (0.3, 0.5, 0.7, 0.6, 1.0, 0.8)])
LAW = hs.BoucWen(beta=2.0, gamma=0.5, n=1.4, feedthrough=0.5)


def record_of(law, u=GROWING, noise=2e-3, seed=0):
    y = law.response(u)
    return hs.Record(u=u, y=y + noise * float(np.ptp(y)) * np.random.default_rng(seed).normal(size=u.size))


@pytest.fixture
def few(monkeypatch):
    """Only some families are candidates."""

    def only(**subjects):
        monkeypatch.setattr(_choice, "candidates", lambda: subjects)

    return only


def test_the_family_of_the_record_is_chosen_and_completely_searched(few):
    few(Line=hs.Line, BoucWen=hs.BoucWen, Play=hs.Play)
    record = record_of(LAW)
    fit = hs.identify(record)
    assert fit.choice.family == "BoucWen"
    assert fit.model == hs.identify(hs.BoucWen, record).model
    assert next(iter(fit.choice.score)) == "BoucWen"
    assert fit.choice.amplitude == pytest.approx(1.0 / 0.7, rel=0.01)
    assert fit.choice.span == (float(record.u.min()), float(record.u.max()))
    assert fit.choice.untried == ()
    assert "BoucWen is the best of 3 families" in str(fit)
    assert fit.summary().split().count("continued") == 2  # in the sentence and above a column
    assert hs.Identification.from_json(fit.to_json()).choice == fit.choice


def test_errors_are_those_of_fits_to_the_other_parts(few):
    few(Dahl=hs.Dahl, BoucWen=hs.BoucWen)
    record = record_of(LAW)
    choice = hs.identify(record).choice
    cycles = np.split(np.arange(len(record)), record.reversals(TOLERANCE)[1::2])[1:]
    errors = []
    for k in range(3):
        fold = np.concatenate(cycles[k::3])
        weights = np.ones(len(record))
        weights[fold] = 0.0
        model = hs.identify(hs.BoucWen, record, weights=weights, max_evaluations=3000).model
        errors.append((record.y - model.response(record.u))[fold])
    assert choice.left_out["BoucWen"] == pytest.approx(np.sqrt(np.mean(np.concatenate(errors) ** 2)), rel=1e-9)
    within, beyond = [], []
    for cut in (120, 180):
        model = hs.identify(hs.BoucWen, record[:cut], max_evaluations=3000).model
        rest, low, high = (record.y - model.response(record.u))[cut:], record.u[:cut].min(), record.u[:cut].max()
        leaves = np.abs(record.u[cut:] - 0.5 * (low + high)) > 0.52 * (high - low)  # by a fiftieth of the range
        end = int(np.argmax(leaves)) if leaves.any() else rest.size
        within, beyond = [*within, *rest[:end]], [*beyond, *rest[end:]]
    assert choice.continued["BoucWen"] == pytest.approx(np.sqrt(np.mean(np.square(within))), rel=1e-9)
    assert choice.beyond["BoucWen"] == pytest.approx(np.sqrt(np.mean(np.square(beyond))), rel=1e-9)
    kinds = choice.left_out, choice.continued, choice.beyond
    more = [each["Dahl"] / each["BoucWen"] for each in kinds]
    assert choice.score["Dahl"] == pytest.approx((more[0] ** 2 * more[1] ** 2 * more[2]) ** 0.2)


def test_a_continuation_tells_what_fades(few):
    few(BoucWen=hs.BoucWen, BoucWenBaberNoori=hs.BoucWenBaberNoori(n=1.0))
    worn = hs.BoucWenBaberNoori(beta=2.0, gamma=0.5, n=1.0, delta_nu=0.2, delta_eta=0.2)
    choice = hs.identify(record_of(worn)).choice
    assert choice.family == "BoucWenBaberNoori"
    assert choice.continued["BoucWen"] > 3.0 * choice.continued["BoucWenBaberNoori"]


def test_a_family_that_fails_or_diverges_is_last(few, monkeypatch):
    few(Line=hs.Line, BoucWen=hs.BoucWen)

    plain = _choice._Trials._fit

    def failing(trials, subject, *arguments):
        if subject is hs.BoucWen:
            raise hs.SimulationError("it diverged")
        return plain(trials, subject, *arguments)

    monkeypatch.setattr(_choice._Trials, "_fit", failing)
    choice = hs.identify(record_of(LAW)).choice
    assert choice.family == "Line"
    assert choice.score["BoucWen"] == np.inf


def test_a_family_that_is_best_on_one_fold_alone_is_compared_with_the_others(few, monkeypatch):
    few(Line=hs.Line, Dahl=hs.Dahl, Play=hs.Play)
    errors = {hs.Line: (1.0, 8.0), hs.Dahl: (3.0, 2.0), hs.Play: (30.0, 20.0)}  # on the first fold, and on all
    monkeypatch.setattr(_choice._Trials, "_left_out", lambda *given: errors[given[1]][given[3] == slice(None)])
    assert hs.identify(record_of(LAW, CYCLE)).choice.score == pytest.approx({"Dahl": 1.0, "Line": 4.0, "Play": 15.0})


@pytest.mark.parametrize(("worse", "family"), [(1.9, "Play"), (2.1, "Line")])
def test_a_safe_family_that_is_not_clearly_worse_is_taken_behind_unsafe_ones(few, monkeypatch, worse, family):
    few(Line=hs.Line, Stop=hs.Stop, Dahl=hs.Dahl, ColemanHodgdon=hs.ColemanHodgdon, Play=hs.Play)
    errors = {hs.Line: 1.0, hs.Stop: 1.2, hs.Dahl: 1.3, hs.ColemanHodgdon: 1.4, hs.Play: worse}
    monkeypatch.setattr(_choice._Trials, "_left_out", lambda *given: errors[given[1]])
    unsafe = "UNSAFE on smaller cycles: within +-1 this law runs away."
    monkeypatch.setattr(_identify, "danger", lambda off, records, other: unsafe * (type(fitted[-1]) is not hs.Play))
    fitted = []
    monkeypatch.setattr(_identify, "excursion", lambda models, records: fitted.append(models[0]))
    fit = hs.identify(record_of(LAW, CYCLE))
    assert (fit.choice.family, fit.success) == (family, family == "Play")
    words = "passed over (UNSAFE on smaller cycles): Line, Stop, Dahl, ColemanHodgdon;"
    assert (words in fit.choice.in_words()) == fit.success


def test_no_further_family_is_begun_after_the_time(few):
    few(Line=hs.Line, Dahl=hs.Dahl, BoucWen=hs.BoucWen, Lag=hs.TransferFunction.structure(poles=1, zeros=0))
    choice = hs.identify(record_of(LAW), seconds=0.0).choice
    assert choice.family == "Line"
    assert choice.untried == ("Dahl", "BoucWen")
    assert "no time for Dahl, BoucWen" in choice.in_words()


def test_processes_choose_what_one_alone_does(few, monkeypatch):
    few(Line=hs.Line, Dahl=hs.Dahl)
    own = []
    for cores in (1, 2):
        for module in (_choice, _parallel):
            monkeypatch.setattr(module, "cores", lambda cores=cores: cores)
        own.append(replace(hs.identify(record_of(LAW)), choice=None))
        own.append(replace(hs.identify(record_of(LAW)).choice, seconds=0.0))
    assert str(own[:2]) == str(own[2:])


class Dies(hs.Play):
    def search_space(self, record, freedom=None):
        assert multiprocessing.parent_process() is not None  # never that of the tests
        os._exit(3)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="no process is forked elsewhere")
def test_a_family_that_ends_its_process_is_named_and_a_record_of_an_own_class_is_taken(few, monkeypatch):
    class Own(hs.Record):
        pass

    record, dies = record_of(LAW), Dies()
    few(Line=hs.Line, Play=hs.Play)
    for module in (_choice, _parallel):
        monkeypatch.setattr(module, "cores", lambda: 2)
    assert hs.identify(Own(u=record.u, y=record.y)).choice.family
    monkeypatch.setattr(_choice._Trials, "unknowns", lambda self, name: 0)
    few(Line=hs.Line, Dies=dies)
    assert_refused("process was ended that searched one of .*Dies", hs.identify, record, error=RuntimeError)
    assert_refused("workers must be an integer of at least 1", hs.identify, record, workers=0)


def test_a_loop_alone_and_several_records_are_judged_by_samples(few):
    few(Line=hs.Line, PrandtlIshlinskii=hs.PrandtlIshlinskii, Lag=hs.TransferFunction.structure(poles=1, zeros=0))
    loop = record_of(LAW, CYCLE)
    assert np.isnan(hs.identify(loop).choice.continued["Line"])
    assert hs.identify(hs.Record(u=CYCLE, y=np.ones(40))).choice.score["Line"] == pytest.approx(1.0)
    fit = hs.identify([loop, record_of(LAW, 0.5 * CYCLE)])
    assert fit.choice.family == "PrandtlIshlinskii"
    assert len(fit.models) == 2
    assert "PrandtlIshlinskii is the best of 2 families" in (words := fit.choice.in_words())
    assert "passed over (the record has no time): Lag; no part was long enough to be continued" in words


def test_long_records_are_thinned_for_the_comparison_alone(few):
    few(Line=hs.Line, Play=hs.Play)
    u = np.interp(np.linspace(0, GROWING.size - 1, 9_000), np.arange(GROWING.size), GROWING)
    fit = hs.identify(record_of(LAW, u))
    assert fit.residual.size == u.size
    short = hs.identify(record_of(LAW, u[::10], seed=1))
    assert fit.choice.left_out["Play"] == pytest.approx(short.choice.left_out["Play"], rel=0.1)


test_what_needs_a_family_is_refused = refused(
    ((hs.BoucWen,), {}, "a model and a record, or a record alone"),
    (("bouc-wen",), {}, "a model and a record, or a record alone"),
    ((3,), {}, "takes a Record"),
    ((hs.Record(u=np.ones(30), y=np.arange(30.0)),), {"seconds": 0.0}, "input is constant"),
    ((record_of(LAW),), {"fixed": {"n": 1.0}}, "fixed= is for one family"),
    ((record_of(LAW),), {"weights": np.ones(GROWING.size), "free": "n"}, "free=, weights= is for one family"),
    call=lambda arguments, options: hs.identify(*arguments, **options),
    error=(TypeError, ValueError),
)


def test_the_command_line_chooses_without_a_model(few, tmp_path, capsys):
    few(Line=hs.Line, Play=hs.Play)
    file, law = tmp_path / "loop.csv", tmp_path / "law.json"
    assert main(["example", str(file)]) == 0
    assert main(["identify", str(file), "--out", str(law)]) == 0
    assert "Play is the best of 2 families" in capsys.readouterr().out
    assert isinstance(hs.load_model(law), hs.Play)
    assert main(["identify", str(file), "--plays", "5"]) == 2
    assert "--plays is an option of one model: give --model, too" in capsys.readouterr().err


# ---------------------------------------------------------------------------------- select


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
    ("Dahl", {}, TypeError, "takes several candidates, got str"),
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
    del families["generalised"]
    tables = [hs.compare(families, record, workers=workers, cross_validate=None) for workers in (1, 2)]
    assert searched.count((hs.BoucWen, u.size)) == 6
    assert tables[0].rows == tables[1].rows
    searched.clear()
    fit = hs.identify(hs.BoucWen, hs.datasets.table1(), fixed={"n": 1.0}, admissible=True)
    assert "unrestricted" in fit.regions
    assert len(searched) == 2  # among all laws, and among the admissible ones
