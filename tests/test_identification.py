"""`identify` finds the global optimum, says what the data tell, and refuses what it cannot do, whatever the units."""

import functools

import numpy as np
import pytest
from square_dahl import SquareDahl
from strategies import assert_refused, refused, with_peak_memory

import hysim as hs
from hysim.identification import Candidate, _descent, marquardt
from hysim.identification._problem import Problem, problem
from hysim.identification._searched import _phrases
from hysim.identification._uncertainty import _named, left_out, uncertainty
from hysim.models.model import candidates
from hysim.models.search_space import Freedom, SearchSpace


def loop_record(law) -> hs.Record:
    u = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60), [-0.4, 0.3, -0.2, 0.9]])
    return hs.Record(u=u, y=law.response(u))


def test_clean_data_give_the_law_back():
    law = hs.BoucWen(beta=1.4, gamma=-0.6, n=1.6, feedthrough=0.7, gain=-0.5, offset=0.2, z0=0.1)
    fit = hs.identify(hs.BoucWen, loop_record(law))
    assert fit.success
    assert fit.fit_percent > 99.9999
    for name, value in fit.estimates.items():
        assert value == pytest.approx(getattr(law, name), abs=1e-5)  # the residual is quadratic in this error


def test_a_perfect_line_is_fitted_without_a_warning():
    """Nothing left to explain: sums of squares of zero, and curvature that the data cannot tell."""
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
    fit = hs.identify(hs.BoucWen, hs.Record(u=u, y=3.0 * u))
    assert fit.rmse < 1e-12
    assert fit.model.response(u) == pytest.approx(3.0 * u, abs=1e-10)


def test_a_long_record_takes_little_memory():
    """8 001 samples: what is held at once is a few hundred evaluations, never a square of the samples."""
    t = np.linspace(0.0, 20.0, 8_001)
    law = hs.BoucWen(beta=0.8, gamma=-0.3, feedthrough=0.7, gain=-0.5)
    u = np.sin(2.1 * t) + 0.6 * np.sin(7.3 * t)
    record = hs.Record(u=u, y=law.response(u))
    fit, peak = with_peak_memory(lambda: hs.identify(hs.BoucWen, record, fixed={"n": 1.0}))
    assert fit.model.beta == pytest.approx(0.8, abs=1e-5)
    assert peak < 80e6


def test_polynomial_input_is_given_back():
    law = hs.PolynomialBoucWen(beta=1.5, gamma=0.4, gain=-0.6, input_coefficients=(1.3, 0.2, -0.1))
    start = hs.PolynomialBoucWen(input_coefficients=(0.0, 0.0, 0.0))
    fit = hs.identify(start, loop_record(law), fixed={"n": 1.0})
    assert fit.model.input_coefficients == pytest.approx(law.input_coefficients, abs=1e-5)
    assert fit.model.beta == pytest.approx(law.beta, abs=1e-4)


def test_table1_bouc_wen_reaches_its_global_optimum_and_lists_the_rival(table1):
    fit = hs.identify(hs.BoucWen, table1, admissible=False)
    # 95.7146 is what an exhaustive search reaches for n from 0.5 on; the best law, at n = 0.37, is beyond this bound
    assert fit.fit_percent == pytest.approx(95.7156, abs=2e-4)
    assert fit.success
    assert any(rival.fit_percent == pytest.approx(95.714, abs=1e-3) for rival in fit.rivals)
    assert fit.n_parameters == 7
    assert fit.estimates["A"] == 1.0
    assert not fit.model.admissible
    assert fit.regions["admissible"].fit_percent == pytest.approx(93.708, abs=1e-3)
    assert fit.regions["admissible"].model.beta >= abs(fit.regions["admissible"].model.gamma) * (1 - 1e-12)


@functools.cache
def of_table1(family, seed=0, **fixed):
    return hs.identify(family, hs.datasets.table1(), fixed={"n": 1.0, **fixed}, seed=seed)


def test_table1_with_a_quadratic_input(table1):
    fit = of_table1(hs.PolynomialBoucWen)
    assert fit.fit_percent == pytest.approx(96.3107, abs=1e-3)
    assert fit.n_parameters == 7
    assert np.abs(fit.residual).max() < table1.resolution


def test_the_optimum_does_not_depend_on_the_seed():
    fits = [of_table1(hs.PolynomialBoucWen), *(of_table1(hs.PolynomialBoucWen, seed) for seed in (1, 2))]
    assert [fit.rmse for fit in fits[1:]] == pytest.approx([fits[0].rmse] * 2, rel=5e-7)  # the cost within 1e-6


def test_fixed_free_and_the_redundant_pair():
    held = of_table1(hs.BoucWen, gain=-0.005)
    assert "A" in held.free_names
    assert "gain" not in held.free_names
    assert held.estimates["gain"] == -0.005
    plain = of_table1(hs.BoucWen, A=2.0)
    assert "gain" in plain.free_names
    assert plain.estimates["A"] == 2.0


def test_the_optimum_does_not_depend_on_the_held_slope():
    one, two = of_table1(hs.BoucWen), of_table1(hs.BoucWen, A=2.0)
    assert two.rmse == pytest.approx(one.rmse, rel=1e-6)
    assert two.model.A * two.model.gain == pytest.approx(one.model.A * one.model.gain, rel=1e-3)


def test_bounds_are_kept_and_said(table1):
    bounds = {"gain": (-0.004, 0.0), "beta": (0.0, 0.02), "z0": (-5.0, 5.0)}
    fit = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0}, bounds=bounds)
    for name, (lower, upper) in bounds.items():
        assert lower <= fit.estimates[name] <= upper
    assert "gain is at its given bound -0.004" in fit.message
    assert fit.success


def test_a_sign_is_a_bound_too(table1):
    bounds = {"beta": (0.0, np.inf), "gamma": (-np.inf, 0.0), "gain": (-np.inf, 0.0), "n": (0.0, np.inf)}
    fit = hs.identify(hs.BoucWen, table1, bounds=bounds)
    assert fit.estimates["beta"] >= 0.0
    assert fit.estimates["gamma"] <= 0.0
    assert fit.estimates["gain"] <= 0.0
    assert 0.5 <= fit.estimates["n"] <= 10.0
    assert fit.fit_percent > 90.0
    assert_refused("from zero to infinity", hs.identify, hs.BoucWen, table1, bounds={"beta": (1.0, np.inf)})
    for pair in ((0.0, 2.0), (-np.inf, 0.0), (-1.0, 3.0)):
        assert_refused("bounds of 'n' must be positive", hs.identify, hs.BoucWen, table1, bounds={"n": pair})


def test_rest_holds_the_memory_at_zero(table1):
    fit = hs.identify(hs.BoucWen, table1, initial="rest", fixed={"n": 1.0})
    assert fit.model.z0 == 0.0
    assert "z0" not in fit.free_names


@pytest.mark.parametrize("factor", [1e-6, 1e-20])
def test_units_do_not_matter(table1, factor):
    """The same loop in millivolts and metres, or a still longer unit, has the same optimum."""
    scaled = hs.Record(u=table1.u * 1e3, y=table1.y * factor)
    fit = hs.identify(hs.PolynomialBoucWen, scaled, fixed={"n": 1.0})
    assert fit.fit_percent == pytest.approx(96.3107, abs=1e-3)


def test_cross_validation_is_leave_one_out(table1):
    line = hs.identify(hs.Line, table1, cross_validate="loo")
    design = np.column_stack([np.ones(52), table1.u])
    leverage = np.einsum("nk,kn->n", design, np.linalg.pinv(design))
    closed_form = np.sqrt(np.mean((line.residual / (1 - leverage)) ** 2))
    assert line.cv_rmse == pytest.approx(closed_form, rel=1e-12)
    assert np.isnan(hs.identify(hs.Line, table1).cv_rmse)


def test_transfer_function_reaches_the_best_below_nyquist(table1):
    structure = hs.TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
    fit = hs.identify(structure, table1)
    # what an exhaustive search of the box reaches; resonances beyond Nyquist would reach more by aliasing
    assert fit.fit_percent == pytest.approx(91.5414, abs=1e-3)
    assert fit.n_parameters == 6
    assert fit.fpe == pytest.approx(0.006004, abs=2e-6)
    assert (fit.model.poles.real < 0.0).all()


def test_transfer_function_is_given_back():
    true = hs.TransferFunction(num=(1.0, 3.0), den=(1.0, 0.8, 4.0), initial_state=(0.2, -0.1))
    u = np.repeat(np.random.default_rng(0).standard_normal(40), 5)
    record = hs.Record(u=u, y=true.response(u, 0.1), t=0.1 * np.arange(u.size))
    fit = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1, initial="free"), record)
    assert fit.model.den == pytest.approx(true.den, rel=1e-6)
    assert fit.model.num == pytest.approx(true.num, rel=1e-6)
    assert fit.model.initial_state == pytest.approx(true.initial_state, abs=1e-6)


def test_a_constant_output_parameter_that_cannot_be_told_is_nan():
    """Without curvature the memory is the input: feedthrough and gain cannot be told apart."""
    u = np.linspace(0.0, 1.0, 30)
    fit = hs.identify(hs.BoucWen, hs.Record(u=u, y=2 * u), fixed={"beta": 0.0, "gamma": 0.0, "n": 1.0, "z0": 0.0})
    assert np.isnan(fit.stderr["gain"])
    assert np.isnan(fit.stderr["feedthrough"])
    assert "do not determine" in fit.message


test_wrong_arguments_are_named = refused(
    ({"fixed": {"bta": 1.0}}, "fixed names 'bta'; the parameters are A, beta"),
    ({"free": ("alpha",)}, "free names 'alpha'"),
    ({"bounds": {"beta": (1.0, 0.0)}}, "lower < upper"),
    ({"bounds": {"A": (0.0, 1.0)}}, "not free"),
    ({"initial": "warm"}, '"free", "rest", "still" or "periodic"'),
    ({"cross_validate": "lots"}, "loo"),
    ({"cross_validate": 1}, "from 2 to 52"),
    ({"fixed": {"n": 1.0}, "free": ("n",)}, "both fixed and free"),
    call=lambda arguments: hs.identify(hs.BoucWen, hs.datasets.table1(), **arguments),
)


test_records_that_say_nothing_are_refused = refused(
    (1.0, hs.datasets.table1(), "takes a model"),
    (hs.BoucWen, hs.datasets.table1().y, "takes a Record"),
    (hs.Sum, hs.datasets.table1(), "no defaults for parts"),
    call=hs.identify,
    error=TypeError,
)


def test_a_search_space_is_data(table1):
    space = hs.BoucWen(beta=0.01, gamma=-0.004).search_space(table1)
    assert isinstance(space, SearchSpace)
    assert space.redundant == (("A", "gain"),)
    assert space.linear == ("feedthrough", "gain", "offset")
    back = space.parameters(space.starts)
    assert back["beta"][0] == pytest.approx(0.01)
    assert back["gamma"][0] == pytest.approx(-0.004)
    assert back["n"][0] == pytest.approx(1.0)


# ----------------------------------------------------- samples that are left out together, and the words of the message


TRIANGLE = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=20)
RECORDS = [hs.Record(u=scale * TRIANGLE, y=TRIANGLE) for scale in (1.0, 2.0)]


def test_two_records_are_two_folds_and_one_is_refused():
    found = left_out("records", RECORDS)
    assert [fold.tolist() for fold in found] == [[*range(61)], [*range(61, 122)]]
    assert_refused("at least 2 records", left_out, "records", RECORDS[:1])


def test_cycles_of_every_record_are_folds_but_its_first():
    """From -1: the turns are at samples 10, 20, ..., and every second of them, from 20 on, begins a cycle."""
    found = left_out("cycles", RECORDS)
    assert [(fold[0], fold[-1]) for fold in found] == [(20, 39), (40, 60), (81, 100), (101, 121)]
    assert all((np.diff(fold) == 1).all() for fold in found)
    assert_refused("at least 2 cycles", left_out, "cycles", [record[:15] for record in RECORDS])


def test_only_an_input_that_never_turns_is_said_not_to():
    """Whatever the size of its steps."""
    for u, turns in ((TRIANGLE, True), (np.linspace(0.0, 1.0, 61), False), (np.linspace(5.0, -9.0, 61), False)):
        fit = hs.identify(hs.Line, hs.Record(u=u, y=2.0 * u + 0.1 * np.cos(7.0 * np.arange(61))))
        assert ("never turns back" not in fit.message) == turns


@pytest.mark.parametrize(
    ("direction", "named"), [([0.4, 0.04], "ab"), ([0.4, 0.01], "a"), ([0.0, 4.0], "b"), ([1.0, 1.0], "ab")]
)
def test_a_parameter_takes_part_in_a_direction_from_a_twentieth_of_the_largest_share_on(direction, named):
    assert _named(("a", "b"), np.array(direction), np.ones(2)) == tuple(named)


@pytest.mark.parametrize(
    ("n_rivals", "words"), [(1, "1 other optimum within the noise"), (2, "2 other optima within the noise")]
)
def test_other_optima_are_counted(n_rivals, words):
    whole = problem(hs.Dahl(), RECORDS[:1], Freedom({}, (), {}), None)
    theta = np.zeros(len(whole.space.coordinates) + len(whole.space.linear))
    known = uncertainty(whole, theta, np.ones(whole.y.size))
    rival = Candidate(model=hs.Dahl(), estimates={}, fit_percent=90.0, rmse=0.1)
    assert words in _phrases(True, whole, known, [rival] * n_rivals, {})


def long_record():
    """20 cycles of growing amplitude that begin between two reversals, with 0.5 % of noise."""
    phase = np.linspace(0.9, 40.0 * np.pi, 3001)
    u = np.linspace(0.5, 1.0, phase.size) * np.sin(phase)
    y = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5).response(u)
    return hs.Record(u=u, y=y + 0.005 * np.random.default_rng(3).standard_normal(u.size), t=0.01 * np.arange(u.size))


def test_a_search_on_a_thinned_record_ends_in_the_optimum_of_the_search_on_all_samples(monkeypatch):
    thinned = hs.identify(hs.BoucWen, long_record(), fixed={"n": 1.0})
    monkeypatch.setattr(Problem, "thinned", lambda *_: None)
    monkeypatch.setattr(_descent, "_MOST_AT_ONCE", 1)  # sets descend one by one, and rows are taken in pieces, as on
    monkeypatch.setattr(marquardt, "_LONG", 100)  # records of more than 100 000 samples
    whole = hs.identify(hs.BoucWen, long_record(), fixed={"n": 1.0})
    assert thinned.rmse == pytest.approx(whole.rmse, rel=1e-9)
    assert thinned.residual.size == 3001
    for name in whole.free_names:  # each descent ends where a step gains 2e-8 of the sum of squares
        assert thinned.estimates[name] == pytest.approx(whole.estimates[name], abs=0.01 * whole.stderr[name])


def test_a_thinned_record_keeps_ends_and_reversals_and_the_outputs_of_a_law():
    record = long_record()
    whole = problem(hs.BoucWen(), [record], Freedom(), None)
    short = whole.thinned(250)
    u = short.parts[0].record.u
    assert 250 <= u.size <= 250 + record.reversals(tolerance=0.01).size
    assert set(record.u[[0, -1, *record.reversals(tolerance=0.01)]]) <= set(u)
    x = 0.5 * (whole.space.lower + whole.space.upper)[np.newaxis]
    places = np.searchsorted(record.t, record.t[np.isin(record.u, u)])
    np.testing.assert_allclose(short.split(x)[0][0], whole.split(x)[0][0, places], atol=1e-12)  # rounding


def test_a_record_is_not_thinned_for_a_model_that_depends_on_time_or_where_it_would_stay_long():
    record = long_record()
    assert problem(hs.TransferFunction.structure(poles=1, zeros=0), [record], Freedom(), None).thinned(250) is None
    assert problem(hs.BoucWen(), [record[:400]], Freedom(), None).thinned(250) is None


# ---------------------------------------------------------------------------------- the units of input and output


RNG = np.random.default_rng(0)
SHARE = np.linspace(0.0, 1.0, 60)
U = np.sin(6.0 * np.pi * SHARE) * (1.0 - 0.5 * SHARE)
TRUTH = hs.BoucWen(beta=1.2, gamma=0.5, gain=2.0, feedthrough=0.5, offset=0.3)
Y = TRUTH.response(U) + 0.01 * RNG.standard_normal(U.size)
FACTORS = ((2.0**-100, 1.0), (1.0, 2.0**100), (1e30, 1e-25))
FREE_OF_ROUNDING = 1e-6  # of the rmse: where a search that is rounded otherwise comes to rest on the same optimum
SUBJECTS = {
    **{name: each for name, each in candidates().items() if name.partition(" ")[0] in hs.__all__},
    "SquareDahl": SquareDahl,
    "BoucWenBaberNoori": hs.BoucWenBaberNoori,
    "LuGre": hs.LuGre,
    "GeneralizedMaxwellSlip": hs.GeneralizedMaxwellSlip,
    "StribeckFriction": hs.StribeckFriction,
    "ElasticBacklash": hs.ElasticBacklash,
    "Dashpot": hs.Dashpot,
    "ExcessLoss": hs.ExcessLoss,
    "a sum": hs.Sum.structure(hs.Dahl, hs.Line),
    "a cascade": hs.Cascade.structure(hs.Play, hs.TransferFunction.structure(poles=1, zeros=0)),
}


def fitted(name: str, u_factor: float, y_factor: float) -> hs.Identification:
    record = hs.Record(u=u_factor * U, y=y_factor * Y, t=0.01 * np.arange(U.size))
    return hs.identify(SUBJECTS[name], record, max_evaluations=40)


@pytest.mark.parametrize("name", SUBJECTS)
def test_a_record_in_other_units_has_the_same_fit(name):
    """In both units at once; one search scales all families, so that three of them stand for single units."""
    plain = fitted(name, 1.0, 1.0)
    for factors in FACTORS if name in ("BoucWen", "SquareDahl", "a cascade") else FACTORS[-1:]:
        scaled = fitted(name, *factors)
        apart = np.abs(scaled.residual / factors[1] - plain.residual).max()
        assert apart <= FREE_OF_ROUNDING * plain.rmse
        assert scaled.free_names == plain.free_names


@pytest.mark.parametrize(("u_factor", "y_factor"), [(1e-30, 1e30), (1e30, 1e-30), (1.0, 1e12)])
def test_estimates_and_errors_are_those_of_the_other_units(u_factor, y_factor):
    plain = hs.identify(hs.Dahl, hs.Record(u=U, y=Y))
    fit = hs.identify(hs.Dahl, hs.Record(u=u_factor * U, y=y_factor * Y))
    units = {"stiffness": y_factor / u_factor, "coulomb": y_factor, "offset": y_factor, "z0": y_factor}
    for name, unit in units.items():
        assert fit.estimates[name] / unit == pytest.approx(plain.estimates[name], rel=1e-6)
        assert fit.stderr[name] / unit == pytest.approx(plain.stderr[name], rel=1e-4)  # of differences
    assert fit.success


def test_a_core_in_unknown_units_has_a_feedthrough_of_its_own():
    steel = hs.JilesAtherton(Ms=1.2e6, a=60.0, alpha=1e-4, k=50.0, c=0.2)
    u = 200.0 * np.sin(np.linspace(0.0, 4.0 * np.pi, 81))
    freed = [
        "feedthrough" in hs.identify(hs.JilesAtherton, record, max_evaluations=50).free_names
        for record in (
            hs.Record(u=u, y=steel.response(u), units={"u": "A/m", "y": "T"}),
            hs.Record(u=u, y=1e4 * steel.response(u), units={"u": "A/m", "y": "G"}),
            hs.Record(u=u, y=1e-8 * steel.response(u)),
        )
    ]
    assert freed == [False, True, True]


@pytest.mark.parametrize(
    "verb", [functools.partial(hs.identify, hs.BoucWen), hs.discover, functools.partial(hs.compare, ["dahl"])]
)
@pytest.mark.parametrize(("u_factor", "y_factor", "name"), [(1e-300, 1.0, "input u"), (1.0, 1e300, "output y")])
def test_numbers_whose_squares_are_none_are_refused_in_one_sentence(verb, u_factor, y_factor, name):
    with pytest.raises(ValueError, match=f"takes records between 1e-40 and 1e\\+40 in size, got an {name}"):
        verb(hs.Record(u=u_factor * U, y=y_factor * Y))


@pytest.mark.parametrize(("u_factor", "y_factor"), [(2.0**-100, 1.0), (1e30, 1.0), (1.0, 1e-30)])
def test_an_oscillator_of_any_mass_is_found(u_factor, y_factor):
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0, n=1.0)
    plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law, substeps=4)
    lines = np.zeros(65, dtype=complex)
    lines[1:14] = np.exp(2j * np.pi * RNG.random(13))
    force = 2000.0 * np.fft.irfft(lines)
    force -= force[0]
    y = plant.response(force, 1.0 / 750.0)
    record = hs.Record(u=u_factor * force, y=y_factor * y, t=np.arange(128) / 750.0)
    fit = hs.identify(hs.BoucWenOscillator.structure(), record, fixed={"n": 1.0}, max_evaluations=100)
    assert fit.estimates["mass"] * y_factor / u_factor == pytest.approx(2.0, rel=1e-2)  # the integration's error
