"""`judge`: hysteresis, a lag that looks like it, or nothing that these records could tell."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from strategies import COMPILED, needs_compiled

import hysim as hs
from hysim.discovery._competitors import steady_width
from hysim.discovery._judgement import BETTER, RATES, _loops, at_one_rate, competitors, doubts, judge, rate_spread

TAU = 0.05  # s
LAW = hs.BoucWen(beta=1.5, gamma=0.4, feedthrough=1.0, gain=-0.5)
DUHEM = hs.Duhem.from_terms({"u'": 0.3, "|u'| u": 1.0, "|u'| y": -1.0})
COMPLIANT = hs.TransferFunction(num=(400.0,), den=(1.0, 4.0, 400.0), hold="foh")
TRIANGLE = hs.signals.triangle(-1.0, 1.0, cycles=4, samples_per_cycle=100)


def lag(tau: float = TAU) -> hs.TransferFunction:
    return hs.TransferFunction(num=(1.0 / tau,), den=(1.0, 1.0 / tau), hold="foh")


def times(samples_per_cycle: int, frequency: float, cycles: float = 3.0) -> np.ndarray:
    return np.arange(round(cycles * samples_per_cycle) + 1) / (samples_per_cycle * frequency)


def measured(u, y, t=None, *, noise: float = 0.01, seed: int = 0) -> hs.Record:
    """A record with noise of a share of the output's standard deviation."""
    return hs.Record(u=u, t=t, y=y + noise * y.std() * np.random.default_rng(seed).standard_normal(y.size))


def sines(plant, frequencies=(1.0, 5.0), *, noise: float = 0.01) -> list[hs.Record]:
    """What `plant(u, sample_time)` makes of sines, one record each."""
    found = []
    for seed, frequency in enumerate(frequencies):
        t = times(100, frequency)
        u = np.sin(2.0 * np.pi * frequency * t)
        found.append(measured(u, plant(u, t[1]), t, noise=noise, seed=seed))
    return found


def refit_of(law, names):
    """Fit parameters of a law again, and the output or memory of each record at its first sample."""

    def refit(records, weights):
        start = "y0" if isinstance(law, hs.Duhem) else "z0"

        def laws(x):
            shared = dict(zip(names, x.tolist(), strict=False))
            if isinstance(law, hs.Duhem):
                return [hs.Duhem.from_terms(shared, y0=first) for first in x[len(names) :]]
            return [replace(law, **shared, **{start: first}) for first in x[len(names) :]]

        def residual(x):
            try:
                y = [model.response(record.u) for model, record in zip(laws(x), records, strict=True)]
            except hs.SimulationError:
                return np.full(sum(map(len, records)), 1e3)
            return np.concatenate([w * (r.y - each) for w, r, each in zip(weights, records, y, strict=True)])

        known = law.terms if isinstance(law, hs.Duhem) else {name: getattr(law, name) for name in names}
        x0 = [*(known[name] for name in names), *(getattr(law, start) for _ in records)]
        return laws(least_squares(residual, x0, xtol=1e-5, ftol=1e-5, max_nfev=30).x)

    return refit


as_duhem = refit_of(DUHEM, tuple(DUHEM.terms))
as_bouc_wen = refit_of(LAW, ("beta", "gamma", "feedthrough", "gain"))


def as_line(records, weights):
    u, y = (np.concatenate([getattr(r, name) for r in records]) for name in ("u", "y"))
    slope, level = np.polyfit(u, y, 1, w=np.concatenate(weights))
    return [hs.Duhem.from_terms({"u'": slope}, y0=level + slope * r.u[0]) for r in records]


tried = cache(lambda *records: competitors(records))  # the models that need no law, once for all tests of a record


def judged(records, refit):
    if not COMPILED and sum(map(len, records)) > 200:
        pytest.skip("identifies on hundreds of samples, which takes minutes uncompiled")
    laws = refit(records, [np.ones(len(record)) for record in records])
    return judge(tried(*records), laws, refit)


def test_a_lag_under_sines_of_two_rates_is_a_linear_lag_whose_widths_are_those_of_its_closed_form():
    found = judged(sines(lag().response), as_duhem)
    assert found.verdict == "linear lag"
    assert found.held_out_by == "record"
    assert found.held_out["rival"] < 0.1 * found.held_out["law"]
    # the two records are equally long, the first counts: sin(atan(omega tau)) at 1 Hz, tau known to about 0.3 %
    phase = np.arctan(2.0 * np.pi * TAU * np.array(RATES))
    assert found.widths["rival"] == pytest.approx(np.sin(phase), rel=0.01)
    assert found.rival.poles == pytest.approx([-1.0 / TAU], rel=0.01)
    assert np.ptp(found.widths["law"]) == 0.0


def test_a_lag_in_one_record_that_changes_its_rate_is_a_linear_lag():
    t = np.arange(600) / 100.0
    u = np.sin(2.0 * np.pi * np.where(t < 3.0, t, 3.0 + 5.0 * (t - 3.0)))
    found = judged([measured(u, lag().response(u, 0.01), t)], as_duhem)
    assert found.verdict == "linear lag"
    assert found.held_out_by == "rate"
    assert found.rate_spread == pytest.approx(5.0, rel=0.1)  # 20 samples a cycle are straight lines in between


def test_a_lag_around_an_offset_is_recovered():
    records = [
        replace(record, u=50.0 + 50.0 * record.u, y=7.0 + 3.0 * record.y) for record in sines(lag().response, noise=0.0)
    ]
    found = judged(records, as_line)
    assert found.verdict == "linear lag"
    assert found.rival.poles == pytest.approx([-1.0 / TAU], rel=1e-4)
    assert found.rival_offset == pytest.approx(7.0 - 3.0, abs=1e-3)  # the gain 3 / 50 takes 3 at mid input


def test_a_lag_under_a_triangle_of_one_rate_cannot_be_told():
    t = times(100, 2.0, cycles=4)
    found = judged([measured(TRIANGLE, lag().response(TRIANGLE, t[1]), t)], as_duhem)
    assert found.verdict == "cannot be told from one rate"
    assert found.rate_spread == pytest.approx(1.0, rel=1e-9)
    # the law of the triangle is there the lag itself, and predicts as well as it
    assert found.held_out["law"] == pytest.approx(found.held_out["rival"], rel=0.1)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_a_bouc_wen_law_at_two_rates_is_hysteresis(noise):
    found = judged(sines(lambda u, _: LAW.response(u), noise=noise), as_bouc_wen)
    assert found.verdict == "rate-independent hysteresis"
    assert np.ptp(found.widths["law"]) == 0.0
    assert np.ptp(found.widths["rival"]) > 0.1
    assert found.one_sign
    assert found.dissipation > 0.0


def test_the_steady_loops_lie_about_the_middle_of_the_range_of_the_input():
    loops = _loops(LAW, hs.signals.triangle(1.0, 3.0, cycles=2, samples_per_cycle=40))
    reached = [(float(loop.u.min()), float(loop.u.max())) for loop in loops]
    assert reached == [(1.75, 2.25), (1.5, 2.5), (1.25, 2.75), (1.0, 3.0)]


def test_the_sign_of_the_loop_is_that_of_the_memory():
    force = hs.BoucWen(beta=1.5, gamma=0.4)
    found = judged(sines(lambda u, _: force.response(u)), refit_of(force, ("beta", "gamma")))
    assert found.dissipation < 0.0
    assert found.one_sign


def test_a_vibration_is_linear_dynamics_of_second_order():
    found = judged(sines(COMPLIANT.response, (1.0, 2.5)), as_duhem)
    assert found.verdict == "linear lag"
    assert found.rival.order == 2
    assert found.rival.den == pytest.approx(COMPLIANT.den, rel=0.02)  # five standard errors under 1 % noise


@pytest.mark.parametrize(("tau", "verdict"), [(1e-3, "rate-independent hysteresis"), (5e-3, "no structure found")])
def test_hysteresis_before_a_lag_is_hysteresis_only_if_the_lag_hardly_widens_the_loop(tau, verdict):
    records = sines(lambda u, step: lag(tau).response(LAW.response(u), step))
    assert judged(records, as_bouc_wen).verdict == verdict
    wide, wider = (hs.loop_metrics(record.u, record.y).relative_width for record in records)
    assert (wider > 1.3 * wide) is (tau > 1e-3)


@pytest.mark.parametrize("frequencies", [(1.0,), (1.0, 5.0)])
def test_a_line_has_no_structure(frequencies):
    found = judged(sines(lambda u, _: 3.0 + 2.0 * u, frequencies), as_line)
    assert found.verdict == "no structure found"
    assert found.rival.order == 0
    assert found.rival_offset == pytest.approx(3.0, abs=0.02)


def test_a_lag_at_one_rate_is_not_no_structure_where_the_law_is_a_line():
    found = judged(sines(lag().response, (2.0,)), as_line)
    assert found.verdict == "cannot be told from one rate"


@pytest.mark.parametrize(
    ("plant", "refit", "verdict"),
    [
        (lag().response, as_duhem, "linear lag"),
        (lambda u, _: LAW.response(u), as_bouc_wen, "rate-independent hysteresis"),
        (lambda u, step: lag(0.04).response(LAW.response(u), step), as_bouc_wen, "no structure found"),
    ],
    ids=["lag", "law", "law before a lag"],
)
def test_a_decaying_sine_of_one_frequency_shows_several_rates(plant, refit, verdict):
    t = np.arange(400) / 100.0
    u = np.exp(-t / 2.0) * np.sin(2.0 * np.pi * 2.0 * t)
    found = judged([measured(u, plant(u, 0.01), t)], refit)
    assert found.rate_spread > 2.0
    assert found.verdict == verdict
    assert found.held_out_by == "block"
    assert all(np.isnan(found.widths[name]).all() for name in ("law", "rival"))  # there is no complete cycle


def test_of_a_motion_that_fades_blocks_are_left_out():
    u = np.ravel([size * np.array([-1.0, -0.5, 0.0, 0.5, 1.0, 0.5, 0.0, -0.5]) for size in np.linspace(1.0, 0.2, 40)])
    found = judged([measured(u, LAW.response(u), np.arange(320.0))], as_bouc_wen)
    assert found.held_out_by == "block"  # some of its cycles are as wide as the first
    assert np.isfinite([*found.held_out.values()]).all()
    assert found.verdict == "rate-independent hysteresis"


def test_a_short_record_has_a_rival_of_few_parameters():
    u = np.append(np.linspace(0.0, 1.0, 6), np.linspace(0.8, 0.0, 5))
    found = judged([measured(u, LAW.response(u), np.arange(11.0))], as_bouc_wen)
    assert found.rival.order == 0
    assert found.verdict == "cannot be told from one rate"


def test_the_table_of_the_paper_cannot_be_told():
    record = hs.datasets.table1(dwell=1.0)
    law = hs.BoucWen(beta=0.03, gamma=-0.02, feedthrough=0.03, gain=-0.012)
    found = judged([record], refit_of(law, ("beta", "gamma", "feedthrough", "gain")))
    assert found.verdict == "cannot be told from one rate"
    assert found.rate_spread == pytest.approx(1.0, rel=1e-9)
    assert found.held_out_by == "block"


def test_without_time_there_is_no_rival():
    record = hs.Record(u=TRIANGLE, y=LAW.response(TRIANGLE))
    found = judged([record], as_bouc_wen)
    assert found.verdict == "cannot be told from one rate"
    assert found.rival is None
    assert np.isnan([found.held_out["rival"], found.rate_spread, *found.widths["rival"]]).all()
    assert judged([record], as_line).verdict == "cannot be told from one rate"  # the record has a loop all the same
    straight = hs.Record(u=TRIANGLE, y=2.0 * TRIANGLE)
    assert judged([straight], as_line).verdict == "no structure found"


def test_uneven_times_are_made_even():
    records = [
        replace(record, t=record.t + 0.1 * (record.t[1] - record.t[0]) * np.arange(len(record)) % 2)
        for record in sines(lambda u, _: LAW.response(u))
    ]
    assert judged(records, as_bouc_wen).verdict == "rate-independent hysteresis"


MAPS = {
    "relu": lambda u: np.maximum(u, 0.0),
    "dead zone": lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.3, 0.0),
    "staircase": lambda u: np.round(4.0 * u) / 4.0,
    "tanh": lambda u: np.tanh(3.0 * u),
}


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("name", MAPS)
def test_a_curve_is_no_structure_whatever_law_was_fitted(name, noise):
    found = judged(sines(lambda u, _: MAPS[name](u + 0.1), noise=noise), as_line)
    assert found.verdict == "no structure found"
    assert "single-valued curve" in doubts(found)[-1]


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize(
    "law",
    [
        hs.Play(threshold=0.2),
        hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(0.5, 0.3, 0.3)),
        hs.Preisach(levels=(-1.0, -0.5, 0.0, 0.5, 1.0), weights=(1, 0.5, 1, 0.2, 0.5, 1, 0.3, 0.2, 0.5, 1)),
    ],
    ids=["backlash", "Prandtl-Ishlinskii", "Preisach"],
)
def test_hysteresis_is_found_though_no_law_was(law, noise):
    found = judged(sines(lambda u, _: law.response(u), noise=noise), as_line)
    assert found.verdict == "rate-independent hysteresis"
    assert found.held_out["plays"] < 0.9 * found.held_out["law"]
    assert any("only in part" in warning for warning in doubts(found))


def test_a_loop_that_is_narrower_than_the_noise_is_none():
    narrow = hs.Play(threshold=0.02)
    assert judged(sines(lambda u, _: narrow.response(u), noise=0.001), as_line).verdict == "rate-independent hysteresis"
    assert judged(sines(lambda u, _: narrow.response(u), noise=0.1), as_line).verdict == "no structure found"


def test_a_drift_is_not_hysteresis():
    found = judged(sines(lambda u, _: u + np.linspace(0.0, 0.5, u.size) ** 2), as_line)
    assert found.verdict == "no structure found"


def test_linear_creep_is_a_lag():
    parts = [hs.TransferFunction(num=(0.1,), den=(tau, 1.0), hold="foh") for tau in np.geomspace(0.01, 10.0, 7)]
    found = judged(sines(lambda u, step: u + sum(part.response(u - u[0], step) for part in parts)), as_line)
    assert found.verdict == "linear lag"


@needs_compiled
def test_only_a_law_that_could_change_the_verdict_is_worth_a_search():
    curve = competitors(sines(lambda u, _: MAPS["tanh"](u)))
    assert curve.enough == pytest.approx(BETTER * curve.errors["curve"], rel=1e-3)  # and the floor of the errors
    slow = tried(*sines(lag().response))
    assert slow.enough == pytest.approx(slow.errors["rival"] / BETTER, rel=1e-3)
    assert tried(*sines(lambda u, _: LAW.response(u))).enough == np.inf
    assert competitors([hs.Record(u=TRIANGLE, y=LAW.response(TRIANGLE))]).enough == np.inf


@needs_compiled
def test_the_search_is_short_where_a_curve_suffices():
    found = hs.discover(sines(lambda u, _: MAPS["relu"](u), (1.0,)))
    assert found.verdict == "no structure found"
    assert "only the optimizer's path was searched" in found.message
    # the path, the line, and each of eight terms that pruning tries, at most twice; subsets would be dozens more
    assert found.scores["n_structures"] <= len(found.thresholds) + 1 + 2 * 8


def test_a_better_linear_model_is_told():
    found = judged(sines(lag().response), as_line)
    assert "A linear dynamic model predicts held-out samples better than the law" in doubts(found)[0]
    assert not any(
        "linear dynamic" in each for each in doubts(judged(sines(lambda u, _: LAW.response(u)), as_bouc_wen))
    )


def test_a_law_that_diverges_on_steady_cycles_is_no_structure():
    u = TRIANGLE[:150]
    growing = hs.Duhem.from_terms({"u'": 1.0, "|u'| y^2": 0.1}, y0=0.1)
    record = hs.Record(u=u, y=growing.response(u), t=times(100, 1.0, cycles=1.49))
    found = judge(competitors([record]), [growing], refit_of(growing, tuple(growing.terms)))
    assert found.verdict == "no structure found"
    assert not found.stable
    assert "diverges in free run" in doubts(found)[0]


@needs_compiled
def test_a_fold_that_cannot_be_fitted_counts_as_a_miss():
    records = sines(lag().response)
    laws = as_duhem(records, [np.ones(len(record)) for record in records])

    def refit(records, weights):
        raise ValueError("the law diverges on this record")

    found = judge(tried(*records), laws, refit)
    assert found.held_out["law"] == np.inf
    assert found.verdict == "linear lag"


@needs_compiled
def test_a_long_record_is_judged_on_fewer_samples():
    lengths = []

    def refit(records, weights):
        lengths.append(len(records[0]))
        return [LAW]

    t = times(5000, 1.0, cycles=4)
    u = np.sin(2.0 * np.pi * t)
    judge(competitors([measured(u, LAW.response(u), t)]), [LAW], refit)
    assert set(lengths) == {1001}  # every 20th of 20 001


@given(log_tau=st.floats(-3.0, 3.0), rate=st.sampled_from(RATES), zero=st.floats(0.0, 2.0))
@settings(max_examples=40)
def test_the_steady_width_is_the_sine_of_the_phase(log_tau, rate, zero):
    t = times(400, 1.0 / (2.0 * np.pi), cycles=1)
    cycle = hs.Record(t=t, u=np.cos(t), y=np.zeros(t.size))
    tau = 10.0**log_tau
    plant = hs.TransferFunction(num=(zero, 1.0), den=(tau, 1.0), hold="foh")
    phase = np.arctan(rate * tau) - np.arctan(rate * zero)
    # straight lines between 400 samples a cycle; a pole of 1e4 cycles costs four digits of its periods' differences
    assert steady_width(plant, cycle, rate) == pytest.approx(abs(np.sin(phase)), abs=1e-3)


@given(
    amplitudes=st.lists(st.floats(0.3, 1.0), min_size=1, max_size=4),
    scale=st.floats(1e-3, 1e3),
    pace=st.floats(1e-3, 1e3),
    level=st.floats(-5.0, 5.0),
)
def test_triangles_of_any_amplitude_at_one_rate_have_one_rate(amplitudes, scale, pace, level):
    corners = np.concatenate([[0.0], *[(a, -a) for a in (1.0, *amplitudes)]])
    t = np.append(0.0, np.cumsum(np.abs(np.diff(corners))))
    even = np.linspace(0.0, t[-1], 1000)
    u = scale * (level + np.interp(even, t, corners))
    # a corner between two samples is cut, but the bands that count are crossed from edge to edge
    assert rate_spread([hs.Record(t=pace * even, u=u, y=u)]) == pytest.approx(1.0, abs=1e-6)


@given(ratio=st.floats(1.0, 100.0), cycles=st.integers(2, 40))
def test_two_records_have_the_ratio_of_their_rates_however_many_cycles_each_has(ratio, cycles):
    u = np.cos(2.0 * np.pi * np.arange(200 * cycles + 1) / 200)
    long = hs.Record(t=np.arange(u.size), u=u, y=u)
    short = hs.Record(t=ratio * np.arange(401), u=u[:401], y=u[:401])
    assert rate_spread([long]) == pytest.approx(1.0, rel=1e-9)
    assert rate_spread([long, short]) == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("amplitude", [0.3, 0.5, 1.0])
def test_a_smaller_record_at_another_rate_shows_its_rate(amplitude):
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=400)
    t = np.arange(u.size) / 400.0
    records = [hs.Record(t=t, u=u, y=u), hs.Record(t=t / 5.0, u=amplitude * u, y=u)]
    assert rate_spread(records) == pytest.approx(5.0 * amplitude, rel=1e-6)


@pytest.mark.parametrize("dwell", [1, 2, 5])
def test_a_staircase_has_one_rate_however_long_it_stops(dwell):
    u = hs.signals.staircase(0.0, 125.0, 5.0, cycles=2, samples_per_step=dwell)
    assert rate_spread([hs.Record(t=np.arange(u.size), u=u, y=u)]) == pytest.approx(1.0, rel=0.1)


def test_an_input_that_never_turns_has_no_spread():
    u = np.linspace(0.0, 1.0, 50)
    assert np.isnan(rate_spread([hs.Record(t=u, u=u, y=u)]))


def test_a_record_is_cut_where_its_rate_changes():
    t = np.arange(1000) / 100.0
    u = np.cos(2.0 * np.pi * np.where(t < 5.0, t, 5.0 + 2.0 * (t - 5.0)))
    slow, fast = at_one_rate(hs.Record(t=t, u=u, y=u))
    assert (slow[0], slow[-1], fast[0], fast[-1]) == (0, 499, 500, 999)
