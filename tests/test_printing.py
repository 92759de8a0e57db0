"""What is printed says what matters in at most ten lines of at most a hundred letters, and no array."""

import copy
import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hysim as hs
from hysim._basics import libraries as _versions
from hysim._basics.printing import LETTERS, LINES, summary_text, wrapped

UNITS = {"t": "s", "u": "V", "y": "um"}
U = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=40)
LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=0.01, feedthrough=0.015)
LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
PLANT = hs.Actuator(hysteresis=LAW, vibration=LAG, sensor=hs.Sensor(noise=1e-3))
T = 0.05 * np.arange(200)
RECORD = hs.Record(t=0.1 * np.arange(U.size), u=U, y=LAW.response(U), units=UNITS, resolution=0.01, name="stack")

NAMES = {name: getattr(hs, name) for name in hs.__all__} | {"array": np.array}


def product(beta, n):
    return {"width": beta * n}


def results():
    """What is made quickly, and what its words must hold."""
    run = hs.close_loop(PLANT, hs.PID(ki=20.0), T, np.ones(T.size), units=UNITS)
    loop = hs.loop_metrics(RECORD.u, RECORD.y)
    fit = hs.identify(hs.Line, RECORD)
    table = hs.compare({"law": LAW, "line": hs.Line}, RECORD, cross_validate=4)
    tuning = hs.tune(LAG, T, np.ones(T.size))
    triangle = {"low": 0.0, "high": 1.0, "period": 4.0, "sample_time": 0.05, "cycles": 2}
    hysteresis = hs.control.assess_hysteresis(LAW, hs.PID(ki=20.0), **triangle)
    step = hs.control.assess_step(LAG, hs.PID(ki=0.2), step=1.0, duration=20.0, sample_time=0.05)
    return [
        (RECORD, ["stack", "81 samples", "every 0.1 s", "0 to 100 V", "3 reversals", "resolution 0.01 um"]),
        (hs.Record(u=U, y=U), ["no time"]),
        (replace(RECORD, t=np.cumsum(1.0 + U)), ["steps of 1"]),
        (hs.simulate(LAW, None, U, units=UNITS), ["0 to 100 V", " um", "z "]),
        (run, ["200 samples", "9.95 s", "um", "limited at 0", "BoucWen (beta = 0.03", "PID (ki = 20)", "noise 0.001"]),
        (loop, [f"{loop.max_width:.4g}", f"{loop.area:.4g}", loop.orientation]),
        (fit, ["Line", f"{fit.fit_percent:.2f} %", f"slope {fit.estimates['slope']:.4g} +-", "81 samples"]),
        (replace(fit, success=False), ["NOT converged"]),
        (table, ["2 models on stack", "rmse [um]", "law", "predicts samples left out best"]),
        (table.rows[0], ["law", "100.00 %", "BoucWen (beta"]),
        (tuning, ["PID", "within its bounds", f"gain {tuning.gain_margin:.4g}", "degrees", "loops simulated"]),
        (hs.select({"one": hs.Line, "two": hs.SingleValued}, RECORD), ["is the best of 2 by bic"]),
        (hs.sweep(product, {"beta": [0.1, 0.2], "n": [1.0, 2.0]}), ["beta, n", "4 of 4 tasks", "median 0.2"]),
        (hysteresis, [f"{hysteresis.hysteresis_reduction_percent:.2f} %", "without the memory"]),
        (step, ["from 0 to 1", "settling time"]),
        (step.reduction, ["overshoot", "residual rms", "settling time", "closed loop"]),
        (hs.to_c(hs.PID(kp=1.0), 1e-3, name="axis"), ["axis.h", "lines"]),
        (LAW, ["BoucWen: A = 1, beta = 0.03"]),
        (PLANT, ["hysteresis", "BoucWen (beta = 0.03", "noise = 0.001"]),
        (hs.TrackingController(feedback=hs.PID(ki=2.0), limits=(0.0, 1.0)), ["limits = (0, 1)", "PID (ki = 2)"]),
        (hs.SingleValued(u=np.arange(200.0), y=np.arange(200.0)), ["200 values, 0 to 199"]),
        (hs.Preisach(levels=np.linspace(0.0, 1.0, 60), weights=np.ones(1770)), ["1770 values, 1"]),
    ]  # fmt: skip


def test_every_result_says_what_matters_in_ten_lines():
    for result, wanted in results():
        text = str(result)
        assert len(text.splitlines()) <= LINES
        assert max(map(len, text.splitlines())) <= LETTERS
        assert not any(word in text for word in ("array(", "voltage", "displacement"))  # a field drives a core
        for word in wanted:
            assert word in text, (word, text)
        assert result._repr_mimebundle_() == {"text/plain": text}
        if type(result).__module__.startswith(("hysim.laws", "hysim.plants")) or isinstance(
            result, hs.TrackingController
        ):
            assert (
                eval(repr(result), {**vars(hs), **{name: getattr(hs, name) for name in hs.__all__}, "array": np.array})
                == result
            )
        else:
            assert repr(result) == f"<{text.splitlines()[0]}>"


def test_a_notebook_has_the_comparison_as_a_table():
    page = hs.compare({"a < b": hs.Line}, RECORD, cross_validate=4)._repr_html_()
    assert "<td>a &lt; b</td>" in page
    assert page.count("<tr>") == 2


def test_what_is_too_much_is_counted():
    assert summary_text([f"line {k}" for k in range(12)]).splitlines()[-1] == "  ... and 3 lines more"
    assert len(summary_text(["x" * 200])) == LETTERS
    many = wrapped([f"parameter {k} = 1" for k in range(100)], most=2).splitlines()
    assert len(many) == 2
    assert many[-1].endswith("more")


def test_show_versions_prints_every_dependency(capsys):
    assert hs.show_versions() is None
    printed = capsys.readouterr().out
    assert printed.startswith(f"hysim  {hs.__version__}".replace("  ", " " * 10))
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
    extras = (name for extra in ("dask", "tables", "io", "vision") for name in project["optional-dependencies"][extra])
    for requirement in (*project["dependencies"], *extras):
        name = requirement.partition(">")[0].partition("[")[0]
        assert f"\n{name} " in printed, name


def test_a_library_that_is_not_there_is_said(monkeypatch, capsys):
    monkeypatch.setattr(_versions, "EXTRAS", ("no-such-library",))
    hs.show_versions()
    assert "no-such-library  not installed\n" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["identification", "record"])
def test_what_is_long_is_cut_within_its_lines(name):
    text = summary_text(["Head"], {name: "word " * 100, "empty": ""})
    assert text.count("\n") == 2
    assert text.endswith("...")


def test_a_result_that_cannot_draw_itself_says_what_draws_it():
    import re

    from hysim._basics import printing as _printing

    for name, calls in _printing._PICTURES.items():
        for function in re.findall(r"hs\.plot\.(\w+)\(", calls):
            assert callable(getattr(hs.plot, function)), (name, function)
    with pytest.raises(AttributeError, match=r"'Record' .*'plot': .* hs.plot.loop\(record\) or hs.plot.history"):
        RECORD.plot()
    with pytest.raises(AttributeError, match=r"'Record' object has no attribute 'something'$"):
        _ = RECORD.something
    assert not hasattr(RECORD, "plot")
    assert pickle.loads(pickle.dumps(RECORD)) == copy.deepcopy(RECORD) == RECORD
