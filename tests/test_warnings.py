"""Results say in a sentence each what a user should not overlook, and say nothing where nothing is wrong."""

import dataclasses
import json

import numpy as np
import pytest
from scipy import stats

import hysim as hs
from hysim.cli import main
from hysim.identification._admissible import danger, excursion, implausible
from hysim.identification._noise import Quantised
from hysim.identification._uncertainty import whiteness
from hysim.identification.doubts import sentences

SWAPPED = "the input and the output may be swapped"
LOOP = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)


def noisy(law, size=0.01, seed=0, u=LOOP):
    y = law.response(u)
    return hs.Record(u=u, y=y + size * np.ptp(y) * np.random.default_rng(seed).standard_normal(u.size))


def reverse(record):
    return hs.Record(u=record.y, y=record.u)


@pytest.mark.parametrize("family", [hs.PrandtlIshlinskii, hs.Dahl, hs.ColemanHodgdon, hs.Preisach, hs.SingleValued])
def test_an_output_that_only_a_generator_makes_is_suspected(table1, family):
    """The table's voltage runs to and fro by steps of 5 V; its displacement does not."""
    (doubt,) = (each for each in hs.identify(family, reverse(table1)).warnings if each.startswith(SWAPPED))
    assert "regular waveform" in doubt
    assert "check the columns" in doubt
    assert not any(each.startswith(SWAPPED) for each in hs.identify(family, table1).warnings)


def test_comparison_and_discovery_suspect_them_too(table1):
    table = hs.compare({"line": hs.Line, "play": hs.Play, "curve": hs.SingleValued}, reverse(table1))
    assert sum(SWAPPED in each for each in table.warnings) == 1
    assert SWAPPED in table.to_text()
    assert any(each.startswith(SWAPPED) for each in hs.discover(reverse(table1), library=["u'", "|u'| y"]).warnings)


def test_a_sine_as_the_output_is_suspected_and_as_the_input_not():
    u = 3.0 + np.sin(np.linspace(0.0, 12.0, 300) + 0.4)
    record = noisy(hs.BoucWen(feedthrough=0.5), 0.001, u=u)
    assert any("regular waveform" in each for each in hs.identify(hs.PrandtlIshlinskii, reverse(record)).warnings)
    assert not any(each.startswith(SWAPPED) for each in hs.identify(hs.PrandtlIshlinskii, record).warnings)


def test_a_regular_output_of_a_step_or_of_a_line_is_not_suspected():
    step = np.where(np.arange(200) > 3, 1.0, 0.0)
    swinging = np.where(step > 0.0, 1.0 - np.cos(0.1 * (np.arange(200) - 4)), 0.0)
    for u, y in ((step, swinging), (step, np.cumsum(step)), (LOOP, 2.0 * LOOP), (np.sin(LOOP), 1.0 + np.sin(LOOP))):
        assert not any(each.startswith(SWAPPED) for each in hs.identify(hs.Line, hs.Record(u=u, y=y)).warnings)


def test_a_fit_that_is_worse_than_a_constant_says_so():
    for slope, fit in ((3.0, True), (-5.0, False)):
        record = hs.Record(u=LOOP, y=3.0 * LOOP + 0.1 * np.cos(LOOP))
        assert any("mean of y" in each for each in hs.identify(hs.Line, record, fixed={"slope": slope}).warnings) != fit


@pytest.mark.parametrize("law", [hs.FlagShape(), hs.Slack(), hs.Chan(saturation=1.3, squareness=0.6)])
def test_an_offset_that_a_law_lacks_is_said(law):
    u = 4.0 * np.sin(np.linspace(0.0, 31.4, 300)) * np.linspace(0.5, 1.0, 300)
    y = law.response(u)
    y = y + 0.01 * np.ptp(y) * np.random.default_rng(0).standard_normal(u.size)
    assert not [each for each in hs.identify(type(law), hs.Record(u=u, y=y)).warnings if "an offset" in each]
    shifted = hs.Record(u=u, y=y + 0.2 * np.ptp(y))
    fit = hs.identify(type(law), shifted)
    assert fit.fit_percent < 95.0
    assert "the output may have an offset, which this law does not have" in " ".join(fit.warnings)
    assert hs.identify(law + hs.Line(), shifted).fit_percent > 95.0
    noisy = hs.Record(u=u, y=y + 0.3 * np.ptp(y) * np.random.default_rng(1).standard_normal(u.size))
    assert not [each for each in hs.identify(type(law), [hs.Record(u=u, y=y), noisy]).warnings if "may have an" in each]


def test_columns_that_one_family_fits_better_in_reverse_are_suspected(table1):
    """Noise on the voltage hides the generator; a play cannot make the voltage from the displacement."""
    shaken = table1.u + 0.05 * np.random.default_rng(0).standard_normal(len(table1))
    fit = hs.identify(hs.Play, hs.Record(u=table1.y, y=shaken))
    assert any(each.startswith(SWAPPED) and "check the columns" in each for each in fit.warnings)
    assert not any(each.startswith(SWAPPED) for each in hs.identify(hs.Play, hs.Record(u=shaken, y=table1.y)).warnings)


def test_a_clockwise_loop_is_not_suspected_where_its_family_fits_it_as_well_in_reverse():
    """A thin loop: both fits are good, and neither is clearly better."""
    record = noisy(hs.BoucWen(beta=0.3, gamma=0.1, feedthrough=1.0))
    assert hs.loop_metrics(record.u, record.y).orientation == "clockwise"
    fits = [hs.identify(hs.BoucWen, each, fixed={"n": 1.0}) for each in (record, reverse(record))]
    assert min(fit.fit_percent for fit in fits) > 95.0
    assert not any(each.startswith(SWAPPED) for each in fits[0].warnings)


@pytest.mark.parametrize(
    "law",
    [
        hs.Stop(threshold=0.3),  # clockwise, as a force on a displacement is
        hs.Dahl(stiffness=4.0),
        hs.Play(threshold=0.3),
        hs.ColemanHodgdon(),
    ],
)
@pytest.mark.parametrize("size", [0.0, 0.01, 0.05])
def test_a_familys_own_record_is_not_suspected(law, size):
    fit = hs.identify(type(law), noisy(law, size))
    assert not any(each.startswith(SWAPPED) for each in fit.warnings)


def test_a_constant_output_is_said_once_and_no_fit_in_percent_is_printed(tmp_path, capsys):
    record = hs.Record(u=LOOP, y=np.full(LOOP.size, 2.0))
    fit = hs.identify(hs.Line, record)
    assert len(fit.warnings) == 1  # the residuals are rounding, whose correlation means nothing
    assert "the output is constant" in fit.warnings[0]
    table = hs.compare({"line": hs.Line, "curve": hs.SingleValued}, record)
    assert len(table.warnings) == 1
    assert "the output is constant" in table.warnings[0]
    for text in (str(fit), fit.summary(), table.to_text(), str(table), table._repr_html_(), str(table.rows[0])):
        assert "nan" not in text
        assert "-inf" not in text
        assert " ".join(text.split()).count("output is constant") <= 1
        assert "output is constant" in " ".join(text.split()) or "fit not defined" in text
    assert "nan" not in hs.select([hs.Line, hs.SingleValued], record).to_text()
    np.savetxt(tmp_path / "flat.csv", np.column_stack([record.u, record.y]), delimiter=",", header="u,y", comments="")
    assert main(["identify", str(tmp_path / "flat.csv"), "--u", "u", "--y", "y", "--model", "line", "--json"]) == 0
    assert any("the output is constant" in each for each in json.loads(capsys.readouterr().out)["warnings"])


def test_correlated_residuals_are_said_where_intervals_are_quoted():
    poor = hs.identify(hs.Line, noisy(hs.Play(threshold=0.3)))
    assert poor.warnings == ("residuals are correlated (p < 0.001): the intervals are too narrow",)
    assert poor.warnings[-1] in poor.summary().splitlines()[-1]
    good = hs.identify(hs.Play, noisy(hs.Play(threshold=0.3)))
    assert good.warnings == ()
    assert "Warnings" not in good.summary()
    exact = hs.identify(hs.Line, hs.Record(u=LOOP, y=3.0 * LOOP + 0.1))  # rounding is correlated too
    assert exact.warnings == ()


def test_a_search_that_did_not_converge_is_said():
    usual = {"spread": 1.0, "exact": False, "whiteness": 0.5, "stderr": {"a": 0.1}, "reasons": (), "success": True}
    assert sentences(**usual) == ()
    assert sentences(**(usual | {"success": False})) == ("the search did not converge: better parameters may exist",)
    assert sentences(**(usual | {"stderr": {"a": np.nan}})) == ("no standard error for a",)


def test_warnings_survive_json_and_older_files_have_none():
    fit = hs.identify(hs.Line, noisy(hs.Play(threshold=0.3)))
    assert hs.Identification.from_json(fit.to_json()).warnings == fit.warnings != ()
    document = json.loads(fit.to_json())
    del document["identification"]["fields"]["warnings"]
    older = hs.Identification.from_json(json.dumps(document))
    assert older == dataclasses.replace(fit, warnings=())


# -- what the sentences and the intervals rest on ---------------------------------------------------------------


@pytest.mark.parametrize(("n", "is_known"), [(9, False), (10, True)])
def test_whiteness_needs_ten_samples(n, is_known):
    assert np.isfinite(whiteness(np.random.default_rng(0).standard_normal(n), 1)) == is_known


def test_a_record_without_a_cycle_has_no_loop_width():
    u = np.linspace(0.0, 1.0, 40)
    record = hs.Record(u=u, y=hs.Dahl(stiffness=3.0).response(u) + 0.01 * np.sin(40.0 * u))
    fit = hs.identify(hs.Dahl, record, fixed={"coulomb": 1.0, "offset": 0.0, "z0": 0.0})
    assert fit.free_names == ("stiffness",)
    assert fit.loop_width is None


@pytest.mark.parametrize("n", [30, 200])
def test_whiteness_is_the_test_of_ljung_and_box_on_as_many_degrees_of_freedom_as_lags(n):
    residual = np.random.default_rng(8).standard_normal(n)
    lags, r = min(20, n // 5), residual - residual.mean()
    q = (
        n
        * (n + 2)
        * sum((sum(r[t] * r[t - k] for t in range(k, n)) / (r @ r)) ** 2 / (n - k) for k in range(1, lags + 1))
    )
    assert whiteness(residual, 3) == pytest.approx(stats.chi2.sf(q, lags), rel=1e-10)


def test_white_residuals_are_called_correlated_as_often_as_the_probability_says():
    rng = np.random.default_rng(9)
    found = np.array([whiteness(rng.standard_normal(200), 3) for _ in range(1000)])
    # 1000 draws: the shares scatter by 0.016 and 0.010; another degree of freedom moves the first by 0.06
    assert np.mean(found < 0.5) == pytest.approx(0.5, abs=0.05)
    assert np.mean(found < 0.1) == pytest.approx(0.1, abs=0.03)


def test_the_noise_of_rounded_data_is_what_sheppards_correction_leaves():
    quantum, sigma, n = 0.2, 0.1, 40_000
    rng = np.random.default_rng(10)
    y = rng.uniform(0.0, 1.0, n)
    rounded = quantum * np.round((y + sigma * rng.standard_normal(n)) / quantum)
    floor = Quantised(quantum).at_least(float(np.sum((rounded - y) ** 2)), n).floor
    # a variance from 40 000 samples is right to 1 %; without q^2 / 12 the floor would be 0.115
    assert floor == pytest.approx(sigma, rel=0.02)
    assert Quantised(quantum).at_least(0.0, n).floor == 0.0


@pytest.mark.parametrize(("noise", "n", "tries"), [("gaussian", 6, 12), ("quantised", 6, 12), ("gaussian", 80, 20)])
def test_a_bootstrap_is_as_wide_as_the_standard_errors_on_each_side(noise, n, tries):
    """Residuals of 6 samples and 2 parameters are too small by sqrt(6 / 4); drawn anew they must not be."""
    u, sides = np.linspace(-1.0, 1.0, n), []
    for seed in range(tries):
        y = 2.0 * u + 0.1 * np.random.default_rng(seed).standard_normal(n)
        fit = hs.identify(hs.Line, hs.Record(u=u, y=y, resolution=1e-3), noise=noise, intervals="bootstrap")
        sides.append(np.abs(np.subtract(fit.intervals["slope"], fit.estimates["slope"])) / fit.stderr["slope"])
    assert np.median(np.sum(sides, axis=1)) == pytest.approx(2.0 * 1.96, rel=0.1)
    if n == 80:  # quantiles of 200 draws scatter by 0.19, the means of 20 by 0.05; 3.75 % would lie at 1.78
        assert np.mean(sides, axis=0) == pytest.approx([1.96, 1.96], abs=0.1)


# ---------------------------------------------------------------------------------- off the record

OUTER = np.concatenate([LOOP, 0.5 * LOOP, [-1.0]])
PLAUSIBLE = [
    hs.BoucWen(beta=0.7, gamma=0.3, feedthrough=1.0),
    hs.BoucWen(beta=0.7, gamma=0.3, n=1.6, gain=-2.0),
    hs.PolynomialBoucWen(gain=-1.0, input_coefficients=(2.0, 0.5, 0.1)),
    hs.Dahl(coulomb=0.2),
    hs.ColemanHodgdon(alpha=3.0, c=1.0),
    hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.5, 0.3)),
    hs.ParametricPrandtlIshlinskii(exponent=-0.5, decay=0.3, weight=0.5, reach=2.0),
    hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.1, 0.5)),
    hs.Tellinen(coercivity=0.3, feedthrough=0.2),
    hs.Chan(coercivity=0.3, feedthrough=0.2, gap=0.1),
    hs.EnergyPlays(thresholds=(0.0, 0.2), weights=(1.0, 0.5), field=0.3),
    hs.Preisach.from_density(np.linspace(-1.0, 1.0, 8), lambda a, b: np.exp(-4.0 * (a + b) ** 2)),
    hs.PreisachRelays(levels=(-1.0, -0.2, 0.3, 1.0), weights=(0.5, 1.0, 0.1, 0.4, 0.2, 0.3)),
    hs.Line(slope=2.0),
]
OFF = "inside the span of the input"


@pytest.mark.parametrize("law", PLAUSIBLE, ids=lambda law: type(law).__name__)
def test_a_law_with_a_memory_that_fades_is_plausible_off_its_own_record(law):
    for u in (LOOP, OUTER, 0.5 * LOOP):
        off = excursion([law], [hs.Record(u=u, y=law.response(u))])
        assert off is None or off.is_safe  # None: a line has no band
        assert implausible(off) == ""


def test_a_memory_that_grows_on_minor_loops_is_unsafe():
    """Bouc-Wen with beta < 0 follows one loop, and leaves it on any other path."""
    law = hs.BoucWen(beta=-0.6, gamma=1.2, gain=0.3)
    records = [hs.Record(u=LOOP, y=law.response(LOOP), units={"u": "V"})]
    words = danger(excursion([law], records), records, None)
    assert words == "UNSAFE on smaller cycles: within +-1 V this law runs away. Take hs.PrandtlIshlinskii."
    faster = hs.BoucWen(beta=-0.3, gamma=1.3, n=2.0)
    inner = hs.Record(u=0.5 * LOOP, y=faster.response(0.5 * LOOP))
    assert excursion([faster], [inner]).beyond == np.inf
    assert "runs away" in danger(excursion([faster], [inner]), [inner], None)


def test_the_summary_says_that_a_model_is_not_plausible_off_the_record():
    smooth = hs.Record(u=LOOP, y=LOOP + 0.01 * hs.Dahl(stiffness=5.0).response(LOOP))
    jumping = hs.identify(hs.PreisachRelays, smooth)
    assert sum(OFF in each for each in jumping.warnings) == 1
    assert OFF in jumping.summary()
    assert not any(OFF in each for each in hs.identify(hs.PrandtlIshlinskii, smooth).warnings)


def test_nothing_is_said_where_nothing_can_be_tried():
    law = hs.BoucWen(beta=-0.6, gamma=1.2, gain=0.3)
    rising = np.linspace(-1.0, 1.0, 30)
    assert excursion([law], [hs.Record(u=rising, y=law.response(rising))]) is None
    timed = hs.Actuator(hysteresis=law, creep=hs.Creep.per_decade(1.0))
    assert excursion([timed], [hs.Record(u=LOOP, y=law.response(LOOP), t=np.arange(LOOP.size))]) is None
    assert danger(None, [], None) == implausible(None) == ""


def test_of_several_records_the_one_of_the_widest_input_is_tried_with_its_own_model():
    law = hs.BoucWen(beta=-0.6, gamma=1.2, gain=0.3)
    wide, narrow = (hs.Record(u=u, y=law.response(u)) for u in (LOOP, 0.1 * LOOP))
    assert not excursion([hs.Line(), law], [narrow, wide]).is_safe
    assert excursion([law, hs.Line()], [narrow, wide]).is_safe
