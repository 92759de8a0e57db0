"""Every verb says the same number of one fit, that of the returned model on the record as it was measured."""

import numpy as np
import pytest
from every_verb import PRINTED, largest_difference, numbers_of_every_verb

import hysim as hs

T = 0.01 * np.arange(241)
U = np.append(
    hs.signals.triangle(0.0, 2.0, cycles=2, samples_per_cycle=60),
    hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=40)[1:],
)
TRUTH = hs.BoucWen(beta=1.2, gamma=0.4, n=1.3, feedthrough=1.5, gain=0.8)
NOISE = 0.01 * np.random.default_rng(4).standard_normal(U.size)
REC = hs.Record(u=U, y=TRUTH.response(U) + NOISE, t=T, units={"u": "V", "y": "um", "t": "s"})
ROUNDING = 1e-9  # of the fit [%]: each verb sums the squares in its own order

SUBJECTS = {
    "Bouc-Wen": hs.BoucWen,
    "polynomial": hs.PolynomialBoucWen(input_coefficients=(1.0, 0.1)),
    "Dahl": hs.Dahl,
    "plays": hs.PrandtlIshlinskii.structure(plays=4),
    "line": hs.Line,
    "single-valued": hs.SingleValued,
    "sum": hs.Sum.structure(hs.Dahl, hs.Line),
    "lag": hs.TransferFunction.structure(poles=1, zeros=0),
    "whole": hs.Actuator.structure(hs.Dahl(), creep=False, modes=0, delay=False),
    "late sensor": hs.Actuator.structure(hs.Line, creep=False, modes=0, delay=False, sensor=hs.Sensor(delay=0.01)),
}
OPTIONS = {
    "quantised": {"noise": "quantised"},
    "robust": {"noise": "robust"},
    "weighted": {"weights": np.linspace(0.1, 1.0, U.size)},
    "at rest": {"initial": "rest"},
    "left out": {"cross_validate": 4},
}


def check(fit, rec, own_shell=None):
    numbers = numbers_of_every_verb(fit, rec, own_shell)
    assert largest_difference(numbers) <= ROUNDING, numbers
    return numbers


@pytest.mark.parametrize("name", SUBJECTS)
def test_all_verbs_agree_on_a_fit(name):
    check(hs.identify(SUBJECTS[name], REC, max_evaluations=200), REC)


@pytest.mark.parametrize("option", OPTIONS)
def test_all_verbs_agree_whatever_the_options(option):
    rec = hs.Record(u=U, y=np.round(REC.y / 0.05) * 0.05, t=T, resolution=0.05)
    fit = hs.identify(hs.BoucWen, rec, fixed={"n": 1.0}, max_evaluations=200, **OPTIONS[option])
    numbers = check(fit, rec)
    assert numbers["identify, fit_percent"] < 99.9  # rounding of the output leaves a residual


def test_the_command_line_agrees(shell):
    numbers = check(hs.identify(hs.BoucWen, REC, fixed={"n": 1.0}), REC, lambda *words: shell(*words)[:2])
    assert {"hysim simulate", "hysim compare", "hysim control --record"} <= numbers.keys()


def test_all_verbs_but_identify_agree_where_the_input_is_noisy():
    """They run the returned model over the input as it was measured, whatever identify did to it."""
    u = U + 0.002 * np.random.default_rng(5).standard_normal(U.size)
    rec = hs.Record(u=u, y=TRUTH.response(U) + NOISE, t=T)
    numbers = numbers_of_every_verb(hs.identify(hs.BoucWen, rec, fixed={"n": 1.0}), rec, None)
    others = {name: each for name, each in numbers.items() if not name.startswith("identify")}
    assert len(others) > 8
    assert largest_difference(others) <= ROUNDING, numbers


def test_each_of_several_records_is_run_from_its_own_state():
    halves = [REC[:121], REC[121:]]
    fit = hs.identify(hs.BoucWen, halves, fixed={"n": 1.0})
    y, model = REC.y, np.concatenate([m.response(each.u) for m, each in zip(fit.models, halves, strict=True)])
    assert fit.fit_percent == pytest.approx(hs.metrics.fit_percent(y, model), abs=ROUNDING)
    table = hs.compare({"fit": fit}, halves)
    assert table["fit"].fit_percent == pytest.approx(fit.fit_percent, abs=ROUNDING)
    assert f"on 2 records, {len(REC)} samples" in str(table)
    loops = hs.plot.identification(fit, halves, hs.plot.figure().subplots(1, 2))[0]
    drawn = [line.get_ydata() for line in loops.lines if len(line.get_ydata()) in (121, 120)]
    assert np.allclose(np.concatenate(drawn[-2:]), model, rtol=0.0, atol=1e-12)


def test_a_fit_that_left_samples_out_is_drawn_on_all_of_them():
    """Its own number is of the samples that it was fitted to."""
    y, weights = REC.y.copy(), np.ones(U.size)
    y[7], weights[7] = 50.0, 0.0
    rec = hs.Record(u=U, y=y)
    fit = hs.identify(hs.BoucWen, rec, fixed={"n": 1.0}, weights=weights)
    kept = weights > 0.0
    model = hs.simulate(fit, None, U).y
    assert fit.fit_percent == pytest.approx(hs.metrics.fit_percent(y[kept], model[kept]), abs=ROUNDING)
    panels = hs.plot.identification(fit, rec, hs.plot.figure().subplots(1, 2))
    assert np.array_equal(panels[0].lines[-1].get_ydata(), model)
    with pytest.raises(ValueError, match="the result is of another record"):
        hs.plot.identification(fit, hs.Record(u=U, y=REC.y + 0.3 * U))


def test_the_helper_sees_a_verb_that_disagrees():
    fit = hs.identify(hs.Line, REC)
    numbers = numbers_of_every_verb(fit, REC, None)
    assert largest_difference(numbers | {"simulate": fit.fit_percent - 1.0}) == pytest.approx(1.0)
    assert largest_difference(numbers | {"identify, str, printed": fit.fit_percent - 1.0}) > 1.0 - 2.0 * PRINTED
