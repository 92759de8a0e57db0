"""A transfer function's response is exact under its hold, at either end of it, with any delay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from strategies import assert_refused, rao_garnier, refused

import hysim as hs
from hysim.models.search_space import Freedom

EXACT = 1e-12  # matrix exponentials and a few hundred multiplications


def test_first_order_lag_has_its_closed_form():
    gain, time_constant, h = 3.0, 0.7, 0.25
    lag = hs.TransferFunction(num=(gain,), den=(time_constant, 1.0))
    k = np.arange(12)
    start = lag.response(np.ones(12), h)
    end = hs.TransferFunction(num=lag.num, den=lag.den, sample="end").response(np.ones(12), h)
    assert start == pytest.approx(gain * (1 - np.exp(-k * h / time_constant)), abs=EXACT)
    assert end == pytest.approx(gain * (1 - np.exp(-(k + 1) * h / time_constant)), abs=EXACT)


@given(st.integers(1, 5), st.integers(0, 5), st.floats(0.05, 2.0), st.integers(0, 10_000))
def test_held_input_agrees_with_scipy(order, zeros, h, seed):
    rng = np.random.default_rng(seed)
    poles = -rng.uniform(0.2, 3.0, order)
    num, den = rng.uniform(-2, 2, min(zeros, order) + 1), np.real(np.poly(poles))
    u = rng.standard_normal(40)
    discrete = signal.cont2discrete(signal.tf2ss(num, den), h, method="zoh")
    reference = signal.dlsim(discrete, u)[1][:, 0]
    y = hs.TransferFunction(num=num, den=den).response(u, h)
    assert y == pytest.approx(reference, abs=1e-9 * (1 + np.abs(reference).max()))  # SciPy's companion form at order 5


def test_linear_input_agrees_with_scipy():
    num, den, h = (0.3, 0.08, 0.15), (2.0, 2.2, 7.8), 0.4
    t = h * np.arange(50)
    u = np.cos(t)
    reference = signal.lsim((num, den), u, t)[1]
    assert hs.TransferFunction(num=num, den=den, hold="foh").response(u, h) == pytest.approx(reference, abs=EXACT)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("delay", [0.0, 0.15, 0.5, 1.185, 30.0])
def test_a_delay_is_exact_whatever_its_size(hold, delay):
    """Against the same plant on a grid a hundred times finer, on which each delay is a whole number of steps."""
    num, den, h, fine = (0.3, 0.08, 0.15), (2.0, 2.2, 7.8), 0.5, 100
    u = np.cos(np.arange(30.0)) + 0.3
    times = h / fine * np.arange(30 * fine)
    late = times - delay
    if hold == "zoh":
        inputs = np.where(late > -1e-9, u[np.clip((late / h + 1e-9).astype(int), 0, 29)], 0.0)
    else:
        inputs = np.where(late > -1e-9, np.interp(late, h * np.arange(30), u), 0.0)
    if delay > times[-1]:
        inputs = np.zeros_like(times)
    # on the fine grid the delayed input is piecewise constant (zoh), or linear but for its first jump (foh)
    reference = hs.TransferFunction(num=num, den=den, hold="zoh").response(inputs, h / fine)[::fine]
    y = hs.TransferFunction(num=num, den=den, hold=hold, delay=delay).response(u, h)
    # zoh: exact; foh: the fine staircase is half a fine step late, 0.0025 s times slopes of order one
    assert y == pytest.approx(reference, abs=EXACT if hold == "zoh" else 3e-3)


def test_a_delay_of_a_linear_input_is_exact():
    """As above: from zero the input has no jump, and the fine grid meets every corner of the delayed one."""
    num, den, h, fine, delay = (0.3, 0.08, 0.15), (2.0, 2.2, 7.8), 0.5, 100, 1.185
    u = np.sin(np.arange(30.0))
    times = h / fine * np.arange(30 * fine)
    inputs = np.interp(times - delay, h * np.arange(30), u, left=0.0)
    reference = hs.TransferFunction(num=num, den=den, hold="foh").response(inputs, h / fine)[::fine]
    y = hs.TransferFunction(num=num, den=den, hold="foh", delay=delay).response(u, h)
    assert y == pytest.approx(reference, abs=EXACT)


def test_a_delay_beyond_the_record_leaves_nothing():
    for delay in (3.0, 1e300):
        assert not hs.TransferFunction(num=(1.0,), den=(1.0, 1.0), delay=delay).response(np.ones(3), 0.5).any()


def test_the_start_of_a_hold_is_the_end_of_the_one_before():
    u = np.cos(np.arange(20.0))
    for delay in (0.0, 0.3):
        start, end = (
            hs.TransferFunction(num=(1.0, 2.0), den=(1.0, 0.4, 3.0), delay=delay, sample=sample).response(u, 0.5)
            for sample in ("start", "end")
        )
        assert start[1:].tolist() == end[:-1].tolist()


def test_slow_modes_keep_their_digits_beside_fast_ones():
    slow, fast, h = 1e-3, 1e6, 1.0
    plant = hs.TransferFunction(num=(slow * fast,), den=(1.0, slow + fast, slow * fast), sample="end")
    t = h * np.arange(1, 101)
    closed_form = 1 - (fast * np.exp(-slow * t) - slow * np.exp(-fast * t)) / (fast - slow)
    # the closed form cancels three digits at the first sample; squaring an exponential that holds its one loses six
    assert plant.response(np.ones(100), h) == pytest.approx(closed_form, rel=1e-12)


def test_a_plant_of_order_zero_is_a_gain():
    gain = hs.TransferFunction(num=(3.0,), den=(2.0,))
    assert gain.response([1.0, -2.0], 1.0).tolist() == [1.5, -3.0]
    assert gain.poles.size == 0


def test_an_unstable_plant_runs_until_it_leaves_the_finite_numbers():
    plant = hs.TransferFunction(num=(1.0,), den=(1.0, -1.0))
    assert plant.response(np.ones(20), 1.0) == pytest.approx(np.expm1(np.arange(20)), rel=1e-12)  # rounding, 20 times
    with pytest.raises(hs.SimulationError, match="at sample 710"):  # exp(709.78) is the largest float
        plant.response(np.ones(1000), 1.0)


def test_initial_state_is_the_free_response_and_its_derivatives():
    plant = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0, 4.0), initial_state=(0.5, -0.6))
    t = 0.1 * np.arange(60)
    assert plant.response(np.zeros(60), 0.1) == pytest.approx(0.5 * np.cos(2 * t) - 0.3 * np.sin(2 * t), abs=EXACT)


def test_equation_1_of_the_paper_on_table_1():
    """Printed coefficients reach 89.1 % at the end of a dwell of 0.7 s, and 89.9 % at the start of one of 2 s."""
    rec = hs.datasets.table1()
    for sample, dwell, fit in (("end", 0.7, 89.1), ("start", 2.0, 89.9)):
        plant = hs.TransferFunction(num=(0.07962, 0.1521), den=(1, 2.201, 7.816, 8.423, 6.93), sample=sample)
        assert hs.metrics.fit_percent(rec.y, plant.response(rec.u, dwell)) == pytest.approx(fit, abs=0.05)


def test_poles_zeros_and_gain():
    plant = hs.TransferFunction(num=(2.0, 6.0), den=(1.0, 3.0, 2.0))
    assert sorted(plant.poles.real) == pytest.approx([-2.0, -1.0])
    assert plant.zeros.real == pytest.approx([-3.0])
    assert plant.dc_gain == pytest.approx(3.0)
    assert hs.TransferFunction(num=(1.0,), den=(1.0, 0.0)).dc_gain == np.inf


def test_simulate_needs_an_even_time_and_advance_that_of_its_state():
    plant, u = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), np.ones(4)
    assert hs.simulate(plant, [0.0, 0.5, 1.0, 1.5], u).y == pytest.approx(plant.response(u, 0.5))
    assert_refused("needs times: pass t", hs.simulate, plant, None, u)
    assert_refused("evenly spaced", hs.simulate, plant, [0.0, 0.5, 1.1, 1.5], u)
    for each in (plant, hs.Actuator(vibration=plant)):
        state = each.advance(u, each.advance(u, sample_time=0.5)[1], sample_time=0.5 + 1e-13)[1]  # a rounding apart
        assert_refused("of steps of 0.5 s, .* got 0.1 s", each.advance, u, state, sample_time=0.1)


test_wrong_arguments_are_named = refused(
    ({"num": (1, 2, 3), "den": (1, 2)}, "above the denominator's"),
    ({"num": (1,), "den": (0, 1)}, "not zero"),
    ({"num": (1,), "den": ()}, "not zero"),
    ({"num": (), "den": (1,)}, "at least one"),
    ({"num": (1,), "den": (1, 1), "delay": -1}, "delay"),
    ({"num": (1,), "den": (1, 1), "hold": "spline"}, "hold"),
    ({"num": (1,), "den": (1, 1), "sample": "middle"}, "sample"),
    ({"num": (1,), "den": (1, 1), "hold": "foh", "sample": "end"}, "held"),
    ({"num": (1,), "den": (1, 1), "initial_state": (1, 2)}, "initial_state"),
    call=lambda arguments: hs.TransferFunction(**arguments),
)


test_wrong_structures_are_refused = refused(
    ({"poles": 0, "zeros": 0}, "pole|initial"),
    ({"poles": 2, "zeros": 3}, "pole|initial"),
    ({"poles": 2, "zeros": 1, "initial": "warm"}, "pole|initial"),
    ({"poles": 2, "zeros": 1, "delay": "late"}, "delay"),
    ({"poles": 2, "zeros": 1, "delay": -1.0}, "negative"),
    ({"poles": 2.5, "zeros": 1}, TypeError, "int"),
    call=lambda arguments: hs.TransferFunction.structure(**arguments),
)


@pytest.mark.parametrize("poles", [1, 2, 5])
def test_every_point_of_the_box_is_a_stable_plant_that_can_be_simulated(poles):
    record = hs.datasets.table1(dwell=0.3)
    structure = hs.TransferFunction.structure(poles=poles, zeros=poles)
    space = structure.search_space(record)
    corners = np.array(np.meshgrid(*zip(space.lower, space.upper, strict=True))).reshape(poles, -1).T
    inside = space.lower + np.random.default_rng(0).random((50, poles)) * (space.upper - space.lower)
    points = np.concatenate([corners, inside])
    parameters = space.parameters(points)
    assert all((values > 0.0).all() for values in parameters.values())  # products of stable sections
    for k in range(len(corners), len(points)):
        assert (np.roots([1.0, *(values[k] for values in parameters.values())]).real < 0.0).all()
    assert np.isfinite(structure.regressors(parameters, record)).all()


@pytest.mark.parametrize(("hold", "sample"), [("zoh", "start"), ("zoh", "end"), ("foh", "start")])
def test_the_regressors_are_the_response(hold, sample):
    record = hs.datasets.table1(dwell=0.3)
    structure = hs.TransferFunction.structure(poles=3, zeros=2, hold=hold, sample=sample, initial="free")
    dens = {"den[1]": np.array([3.0, 40.0]), "den[2]": np.array([7.0, 9.0]), "den[3]": np.array([5.0, 0.1])}
    columns = structure.regressors(dens, record)
    linear = np.array([0.3, -0.2, 1.0, 0.5, -0.4, 2.0])
    for k in range(2):
        estimates = {name: float(values[k]) for name, values in dens.items()}
        plant = structure.assemble(estimates | dict(zip(structure.columns, linear, strict=True)))
        y = columns[k] @ [*linear, 1.0]
        assert y == pytest.approx(plant.response(record.u, 0.3), rel=1e-12)  # sums in another order


def test_sets_that_overflow_are_not_finite_and_warn_of_nothing():
    record = hs.datasets.table1()
    dens = {"den[1]": np.array([1.0, -1e3, np.inf]), "den[2]": np.array([1.0, 1.0, 1.0])}
    columns = hs.TransferFunction.structure(poles=2, zeros=0).regressors(dens, record)
    assert np.isfinite(columns).all(axis=(1, 2)).tolist() == [True, False, False]


def test_what_is_free_follows_the_structure_and_the_arguments():
    record = hs.datasets.table1()
    structure = hs.TransferFunction.structure(poles=2, zeros=1)
    rest = structure.search_space(record)
    assert rest.names == ("den[1]", "den[2]", "num[0]", "num[1]")
    assert dict(rest.held) == {"x0[0]": 0.0, "x0[1]": 0.0}
    assert structure.search_space(record, Freedom(initial="free")).names[-2:] == ("x0[0]", "x0[1]")
    one = structure.search_space(record, Freedom(free=("x0[1]",), fixed={"num[1]": 2.0}, bounds={"num[0]": (0.0, 1.0)}))
    assert one.linear == ("num[0]", "x0[1]")
    assert dict(one.bounds) == {"num[0]": (0.0, 1.0)}
    assert_refused('"free", "rest", "still" or "periodic"', structure.search_space, record, Freedom(initial="warm"))


def test_the_unit_of_time_does_not_matter():
    structure = hs.TransferFunction.structure(poles=1, zeros=0)
    second, minute = (hs.identify(structure, hs.datasets.table1(dwell=dwell)) for dwell in (1.0, 1 / 60))
    assert minute.fit_percent == pytest.approx(second.fit_percent, abs=1e-6)  # the cost within 1e-6
    assert minute.model.dc_gain == pytest.approx(second.model.dc_gain, rel=1e-3)  # its error is the cost's root


@pytest.mark.parametrize("options", [{"fixed": {"den[1]": 1.0}}, {"bounds": {"den[2]": (0.0, 1.0)}}])
def test_a_denominator_cannot_be_fixed(options):
    with pytest.raises(ValueError, match="sections"):
        hs.identify(hs.TransferFunction.structure(poles=2, zeros=0), hs.datasets.table1(), **options)


def test_regressions_start_a_long_search_where_it_ends():
    record, _, true = rao_garnier(np.inf, 0)
    space = hs.TransferFunction.structure(poles=4, zeros=1).search_space(record)
    assert space.screened == 0
    for k in range(len(space.starts)):
        den = [values[0] for values in space.parameters(space.starts[k : k + 1]).values()]
        # the output is filtered as if it were linear between samples, 0.2 rad of the fast mode apart
        assert den == pytest.approx(true.den[1:], rel=0.02)


def test_a_stiff_plant_is_found_in_noise():
    """Beside the bound: six parameters leave sqrt(6/N) = 7.1 % of the noise's rms in the output."""
    structure = hs.TransferFunction.structure(poles=4, zeros=1)
    for snr, seed in ((10.0, 1), (1.0, 2)):
        record, clean, _ = rao_garnier(snr, seed)
        fit = hs.identify(structure, record)
        error = np.linalg.norm(clean - fit.model.response(record.u, 0.01)) / np.linalg.norm(clean - clean.mean())
        assert error < 2.0 * np.sqrt(6 / len(record) / snr)  # chi of 6 degrees is above twice its rms in 5 of 1e4


def late_record(delay, n, seed=0):
    """A resonant plant, late, under white noise held for 0.1 s, without noise."""
    true = hs.TransferFunction(num=(1.0, 6.0), den=(1.0, 2.0, 9.0), delay=delay)
    u = np.random.default_rng(seed).standard_normal(n)
    return hs.Record(u=u, y=true.response(u, 0.1), t=0.1 * np.arange(n)), true


@pytest.mark.parametrize(("n", "delay"), [(80, 0.437), (1000, 3.762)])
def test_a_delay_between_two_samples_is_found(n, delay):
    """On a short record by the search alone, on a long one from the peak of the impulse response."""
    record, true = late_record(delay, n)
    fit = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1, delay="free"), record)
    assert fit.estimates["delay"] == pytest.approx(delay, abs=1e-9)  # rounding, through a descent to 1e-7
    assert fit.model.den == pytest.approx(true.den, rel=1e-7)
    assert fit.model.num == pytest.approx(true.num, rel=1e-7)
    assert fit.model.delay == fit.estimates["delay"]
    assert "delay" in fit.stderr


def test_the_delay_is_free_bounded_or_fixed_as_any_parameter():
    record, _ = late_record(0.437, 80)
    free = hs.TransferFunction.structure(poles=2, zeros=1, delay="free")
    space = free.search_space(record)
    assert (space.lower[-1], space.upper[-1]) == pytest.approx((0.0, 80 / 4))  # samples: a quarter of the record
    assert space.names[2] == space.coordinates[-1] == "delay"
    bounded = free.search_space(record, Freedom(bounds={"delay": (0.2, 0.5)}))
    assert (bounded.lower[-1], bounded.upper[-1]) == pytest.approx((2.0, 5.0))
    assert not bounded.bounds
    fixed = hs.identify(free, record, fixed={"delay": 0.437})
    known = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1, delay=0.437), record)
    assert fixed.model == known.model
    assert fixed.estimates["delay"] == 0.437
    assert known.free_names == fixed.free_names == ("den[1]", "den[2]", "num[0]", "num[1]")
    for wrong in ({"fixed": {"delay": -1.0}}, {"bounds": {"delay": (-1.0, 1.0)}}, {"bounds": {"delay": (0.0, np.inf)}}):
        assert_refused("delay must not be negative", hs.identify, free, record, **wrong)


def test_regressors_with_unlike_delays_are_those_of_each():
    record, _ = late_record(0.437, 80)
    structure = hs.TransferFunction.structure(poles=2, zeros=2, delay="free", initial="free")
    sets = {"den[1]": [1.0, 2.0, 0.3], "den[2]": [9.0, 4.0, 1.0], "delay": [0.0, 0.25, 1e9]}
    columns = structure.regressors({name: np.array(values) for name, values in sets.items()}, record)
    linear = [0.3, -0.2, 1.0, 0.5, -0.4]
    for k in range(3):
        one = {name: values[k] for name, values in sets.items()}
        assert (structure.regressors(one, record)[0] == columns[k]).all()
        plant = structure.assemble(one | dict(zip(structure.columns, linear, strict=True)))
        assert columns[k] @ [*linear, 1.0] == pytest.approx(plant.response(record.u, 0.1), rel=1e-12)  # sums in order


def test_standard_errors_are_those_of_many_draws():
    true = hs.TransferFunction(num=(9.0,), den=(1.0, 2.0, 9.0))
    u = np.repeat(np.random.default_rng(5).choice([-1.0, 1.0], 250), 4)
    clean, t = true.response(u, 0.1), 0.1 * np.arange(u.size)
    structure = hs.TransferFunction.structure(poles=2, zeros=0)
    found, stderr = [], []
    for seed in range(30):
        y = clean + 0.3 * np.random.default_rng(seed).standard_normal(u.size)
        fit = hs.identify(structure, hs.Record(u=u, y=y, t=t))
        found.append([fit.estimates[name] for name in fit.free_names])
        stderr.append([fit.stderr[name] for name in fit.free_names])
    ratio = np.std(found, axis=0, ddof=1) / np.sqrt(np.mean(np.square(stderr), axis=0))
    assert ratio == pytest.approx(1.0, abs=4 / np.sqrt(2 * 30))  # four sampling errors of a standard deviation


def test_a_fit_to_table_1_says_what_the_record_cannot_show():
    message = hs.identify(hs.TransferFunction.structure(poles=4, zeros=1), hs.datasets.table1(dwell=1.0)).message
    assert "a single-valued curve of u fits 89.9 %: as well as this model within the noise" in message
    assert "the record holds one rate only: lag and hysteresis cannot be told apart" in message


def test_a_record_that_shows_the_dynamics_has_no_note():
    record, _, _ = rao_garnier(1.0, 0)
    assert hs.identify(hs.TransferFunction.structure(poles=2, zeros=1), record).message == (
        "converged; assumed rest at zero before the first sample (no other assumption has a clearly lower BIC)"
    )


def test_two_rates_or_steps_that_settle_show_a_lag():
    slow, fast = (hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=n) for n in (100, 20))
    settling = hs.signals.staircase(0.0, 1.0, 0.1, cycles=2, samples_per_step=6)
    lag, structure = hs.TransferFunction(num=(1.0,), den=(0.3, 1.0)), hs.TransferFunction.structure(poles=1, zeros=0)
    for u, count in ((np.tile(slow[:-1], 2), 1), (np.append(slow, fast), 0), (settling, 0)):
        record = hs.Record(u=u, y=lag.response(u, 0.02), t=0.02 * np.arange(u.size))
        assert sum("one rate" in note for note in structure.notes(record, lag)) == count


def test_a_step_has_no_note():
    lag, t = hs.TransferFunction(num=(1.0,), den=(0.3, 1.0)), 0.05 * np.arange(80)
    record = hs.Record(u=np.ones(80), y=lag.response(np.ones(80), 0.05), t=t)
    assert hs.TransferFunction.structure(poles=1, zeros=0).notes(record, lag) == ()


def test_a_static_record_needs_no_plant():
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=40)
    record = hs.Record(u=u, y=2.0 * u + 0.01 * np.random.default_rng(0).standard_normal(u.size), t=0.1 * np.arange(81))
    assert "a single-valued curve of u" in hs.identify(hs.TransferFunction.structure(poles=1, zeros=1), record).message
