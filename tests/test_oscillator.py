"""The oscillator against closed forms, converged references and its own energy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from strategies import COMPILED, assert_refused, refused

import hysim as hs
from hysim.kernels import oscillator as kernels
from hysim.plants import oscillator as module

LAWS = {
    "benchmark": hs.BoucWen(A=5e4, beta=800.0, gamma=-1100.0),
    "n = 0.6": hs.BoucWen(A=5e4, beta=60.0, gamma=40.0, n=0.6),
    "n = 1.5": hs.BoucWen(A=5e4, beta=100.0, gamma=-130.0, n=1.5),
    "n = 2": hs.BoucWen(A=5e4, beta=10.0, gamma=5.0, n=2.0, z0=3.0, offset=1.0),
    "n = 3": hs.BoucWen(A=5e4, beta=1.0, gamma=0.5, n=3.0, feedthrough=1e4, gain=0.8),
    "polynomial": hs.PolynomialBoucWen(A=5e4, beta=800.0, gamma=100.0, input_coefficients=(1e3, 2e6, 3e9)),
}
LINEAR = hs.BoucWen(A=5e4, beta=0.0, gamma=0.0)
RATE = 750.0


def plant(law=LAWS["benchmark"], **options) -> hs.BoucWenOscillator:
    return hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law, **options)


def noise(n_samples: int, seed: int = 0) -> np.ndarray:
    """Low-passed noise, so that reversals of every size occur."""
    white = np.random.default_rng(seed).standard_normal(n_samples + 8)
    return 80.0 * np.convolve(white, np.ones(9) / 9.0, mode="valid")


def converged(law, u: np.ndarray, sample_time: float) -> np.ndarray:
    """A literal transcription, begun anew at every sample of the input, by an adaptive method near its tightest."""
    coefficients = law.input_polynomial.tolist()

    def rates(t, x, begin, slope):
        y, v, z = x
        pull = begin + slope * t - 5e4 * y - law.offset - sum(c * y ** (k + 1) for k, c in enumerate(coefficients))
        dz = v * (law.A - abs(z) ** law.n * (law.gamma + law.beta * np.sign(z * v)))
        return [v, (pull - 10.0 * v - law.gain * z) / 2.0, dz]

    x, y = np.array([0.0, 0.0, law.z0]), [0.0]
    for begin, slope in zip(u, np.diff(u) / sample_time, strict=False):
        options = {"rtol": 1e-10, "atol": [1e-15, 1e-12, 1e-10], "args": (begin, slope)}
        x = solve_ivp(rates, (0.0, sample_time), x, "DOP853", **options).y[:, -1]
        y.append(x[0])
    return np.array(y)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_reversals_and_crossings_cost_no_accuracy(law):
    """The reference is good to about 1e-9 of the range, the default steps to 1e-6 where n < 1, 1e-7 elsewhere."""
    u = noise(60 if COMPILED else 12)
    reference = converged(law, u, 1.0 / RATE)
    error = np.abs(plant(law).response(u, 1.0 / RATE) - reference).max() / np.ptp(reference)
    fine = np.abs(plant(law, substeps=16).response(u, 1.0 / RATE) - reference).max() / np.ptp(reference)
    assert error < 2e-6
    assert fine < 2e-8


def test_the_default_is_good_to_1e_6_of_the_rms_on_the_benchmark():
    u = noise(600 if COMPILED else 20, seed=3)
    fine = plant(substeps=40 if COMPILED else 12).response(u, 1.0 / RATE)
    assert np.abs(plant().response(u, 1.0 / RATE) - fine).max() < 1e-6 * fine.std()


def test_at_equal_steps_split_is_far_ahead_of_the_other_methods():
    u = noise(400 if COMPILED else 20)
    fine = plant(substeps=40 if COMPILED else 12).response(u, 1.0 / RATE)
    errors = {
        name: np.abs(plant(method=name, substeps=4).response(u, 1.0 / RATE) - fine).max() for name in module.METHODS
    }
    assert 1000.0 * errors.pop("split") < min(errors.values())


@pytest.mark.parametrize(("method", "order"), [("split", 6), ("runge-kutta", 4), ("newmark", 2), ("strang", 2)])
def test_order_on_a_smooth_branch(method, order):
    """A rising force, and a memory that starts above zero: neither y' nor z changes sign."""
    law = replace(LAWS["benchmark"], z0=10.0, offset=-10.0)
    rising = hs.BoucWenOscillator(mass=2.0, damping=700.0, stiffness=5e4, law=law, method=method)
    u = np.array([0.0, 60.0, 160.0])
    y = {count: replace(rising, substeps=count).response(u, 0.01)[-1] for count in (4, 8, 128)}
    measured = np.log2(abs(y[4] - y[128]) / abs(y[8] - y[128]))
    assert order - 0.4 < measured < order + 0.8


@pytest.mark.parametrize("hold", ["foh", "zoh"])
@pytest.mark.parametrize(("method", "substeps", "tolerance"), [("split", 4, 1e-8), ("strang", 1, 1e-11)])
def test_without_hysteresis_it_is_the_linear_plant(hold, method, substeps, tolerance):
    """Splitting is exact then, and the order-6 steps are as good as at 0.08 rad each."""
    u = noise(100)
    exact = hs.TransferFunction(num=(1.0,), den=(2.0, 10.0, 1e5), hold=hold).response(u - u[0], 1.0 / RATE)
    y = plant(LINEAR, hold=hold, method=method, substeps=substeps).response(u - u[0], 1.0 / RATE)
    assert np.abs(y - exact).max() < tolerance * np.ptp(exact)


def test_free_vibration_from_an_initial_state():
    free = hs.BoucWenOscillator(mass=2.0, damping=0.0, stiffness=5e4, law=LINEAR, initial_state=(1e-3, 0.1))
    t = np.arange(200) / RATE
    omega = free.natural_frequency
    y = free.response(np.zeros(t.size), 1.0 / RATE)
    # the memory starts at z0 = 0 while y does not: a constant pull of A y(0) is missing
    shift = 0.5 * 1e-3
    exact = shift + (1e-3 - shift) * np.cos(omega * t) + 0.1 / omega * np.sin(omega * t)
    assert np.abs(y - exact).max() < 1e-7 * np.ptp(exact)


def test_a_base_pushes_with_minus_the_mass():
    u = noise(50)
    shaken, pushed = plant(excitation="base"), plant()
    assert np.array_equal(shaken.response(u, 1.0 / RATE), pushed.response(-2.0 * u, 1.0 / RATE))


def test_rest_stays_rest_and_signs_mirror():
    u = noise(80)
    assert not plant().response(np.zeros(20), 1.0 / RATE).any()
    assert np.array_equal(plant().response(-u, 1.0 / RATE), -plant().response(u, 1.0 / RATE))


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_memory_is_the_laws_own_along_the_displacement(law):
    """Exact along a monotone stretch, whatever the steps were."""
    law = replace(law, z0=0.0, offset=0.0)
    signals = plant(law).signals(np.linspace(0.0, 40.0, 4), 0.002)
    assert (np.diff(signals["y"]) > 0.0).all()
    z = law.memory(signals["y"])
    assert np.abs(signals["z"] - z).max() < 1e-12 * np.abs(z).max()


def imbalance(signals: dict) -> float:
    lost = signals["damping_loss"] + signals["hysteresis_loss"]
    return float(np.abs(signals["input_work"] - signals["stored"] - lost).max() / np.ptp(signals["input_work"]))


@pytest.mark.parametrize("excitation", ["force", "base"])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_energy_balance_closes_with_the_order_of_the_steps(law, excitation):
    u = noise(200 if COMPILED else 15)
    shaken = plant(law, excitation=excitation, initial_state=(1e-4, 0.02))
    assert imbalance(shaken.signals(u, 1.0 / RATE)) < 1e-5
    assert imbalance(replace(shaken, substeps=24).signals(u, 1.0 / RATE)) < 3e-8


def test_newmarks_balance_closes_to_rounding():
    """Averages over a step times its displacement are exact differences, but for a curved potential."""
    for name in ("benchmark", "n = 1.5", "n = 2"):
        assert imbalance(plant(LAWS[name], method="newmark", substeps=2).signals(noise(100), 1.0 / RATE)) < 1e-12


def test_an_admissible_law_loses_energy_all_the_time():
    signals = plant(LAWS["n = 2"]).signals(noise(100), 1.0 / RATE)
    assert (np.diff(signals["hysteresis_loss"]) > -1e-12).all()
    assert (np.diff(signals["damping_loss"]) >= 0.0).all()


def test_restoring_force_obeys_the_equation_of_motion():
    """On a fine grid the second difference of y is the acceleration, to the square of the step."""
    u = np.repeat(30.0, 400)
    signals = plant(LAWS["polynomial"]).signals(u, 1e-5)
    acceleration = np.diff(signals["y"], 2) / 1e-10
    expected = (u - 10.0 * signals["velocity"] - signals["restoring_force"])[1:-1] / 2.0
    assert np.abs(acceleration - expected).max() < 1e-3


@pytest.mark.parametrize("method", module.METHODS)
@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_cut_and_continued_it_has_the_same_bits(method, hold, monkeypatch):
    u = noise(60)
    whole_plant = plant(method=method, hold=hold, substeps=2)
    whole, end = whole_plant.advance(u, sample_time=1.0 / RATE)
    first, state = whole_plant.advance(u[:23], sample_time=1.0 / RATE)
    second, again = whole_plant.advance(u[23:], state, sample_time=1.0 / RATE)
    assert again == end
    for name, values in whole.items():
        assert np.array_equal(np.concatenate([first[name], second[name]]), values), name
    monkeypatch.setattr("hysim._basics.parallel._STRETCH", 7)
    calls = []
    chunked = whole_plant.advance(u, sample_time=1.0 / RATE, progress=lambda done, total: calls.append((done, total)))
    assert np.array_equal(chunked[0]["y"], whole["y"])
    assert calls[-1] == (60, 60)
    assert len(calls) == 9


def test_nothing_in_is_nothing_out():
    signals, state = plant().advance([], sample_time=1.0)
    assert signals["y"].shape == (0,)
    assert state.z == 0.0


def test_simulate_shows_every_signal():
    t = np.arange(30) / RATE
    sim = hs.simulate(plant(), t, noise(30))
    names = "t u y velocity z restoring_force input_work damping_loss hysteresis_loss stored"
    assert set(sim.signals) == set(names.split())
    assert np.array_equal(sim.z, sim.signals["z"])
    assert np.array_equal(sim.y, plant().response(noise(30), float(np.diff(t).mean())))


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")  # NumPy's scalars warn where nothing is compiled
@pytest.mark.parametrize("method", module.METHODS)
def test_a_motion_without_bounds_names_the_time(method):
    falling = hs.BoucWenOscillator(mass=1.0, damping=0.0, stiffness=-1e4, law=hs.BoucWen(), method=method)
    with pytest.raises(hs.SimulationError, match=r"within [\d.]+ s from the start, at sample \d+"):
        falling.response(np.full(600, 1.0), 0.1)


def test_a_law_much_sharper_than_the_step_is_followed():
    """Displacements of 1000 yield lengths: without the check against the exact memory the result is lost."""
    law = hs.BoucWen(A=1.0, beta=0.5 / 0.01**2, gamma=0.5 / 0.01**2, n=2.0)
    sharp = hs.BoucWenOscillator(mass=1 / (2 * np.pi) ** 2, damping=0.002, stiffness=0.05, law=law)
    u = 0.05 * noise(200 if COMPILED else 20)
    fine = replace(sharp, substeps=32).response(u, 0.01)
    assert np.abs(sharp.response(u, 0.01) - fine).max() < 1e-5 * fine.std()


def test_a_dip_of_the_velocity_below_zero_is_seen():
    """v = 1 - 4.4 s + 4.4 s^2 is negative between two zeros."""
    assert kernels.dip(1.0, -4.4, 1.0, 4.4, 1.0) == pytest.approx(0.5, abs=1e-12)
    assert kernels.dip(1.0, -3.0, 1.0, 3.0, 1.0) == 1.0
    assert kernels.dip(-1.0, 4.4, -1.0, -4.4, 2.0) == pytest.approx(1.0, abs=1e-12)
    assert kernels.dip(1.0, 4.4, 1.0, -4.4, 1.0) == 1.0


def test_the_cubic_finds_its_last_sign_change():
    def value(s):
        return (s - 0.3) * (s + 2.0) * (s - 3.0)

    slopes = np.polyval(np.polyder(np.poly([0.3, -2.0, 3.0])), [0.0, 1.0])
    place = kernels.sign_change(value(0.0), slopes[0], value(1.0), slopes[1], 1.0)
    assert place == pytest.approx(0.3, abs=1e-12)


test_wrong_arguments_are_named = refused(
    ({"mass": 0.0}, "mass must be positive"),
    ({"damping": np.nan}, "damping must be finite"),
    ({"law": hs.Line()}, TypeError, "law must be a BoucWen or a PolynomialBoucWen, got Line"),
    ({"excitation": "ground"}, "excitation must be one of force, base, got 'ground'"),
    ({"hold": "cubic"}, "hold must be one of"),
    ({"method": "euler"}, "method must be one of split"),
    ({"substeps": 0}, "substeps must be at least 1"),
    ({"substeps": 2.0}, TypeError, "substeps must be a whole number"),
    ({"initial_state": (1.0,)}, "initial_state must be empty or hold 2"),
    call=lambda changes: replace(plant(), **changes),
)


@pytest.mark.parametrize("sample_time", [0.0, -1.0, np.inf, np.nan])
def test_a_sample_time_that_is_none_is_refused(sample_time):
    assert_refused("sample_time must be positive", plant().response, [0.0, 1.0], sample_time)


@pytest.mark.parametrize(
    ("method", "closed"), [("split", 1e-9), ("runge-kutta", 1e-7), ("newmark", 1e-12), ("strang", 2e-4)]
)
@pytest.mark.parametrize("gain", [0.7, 2.5, -0.4])
def test_the_energy_that_the_law_takes_is_that_of_its_gain(method, closed, gain):
    """By every method; the tolerances are 50 times what is measured at the coarser of the two steps."""
    law = replace(LAWS["benchmark"], gain=gain, A=2e4)
    shaken = plant(law, method=method, substeps=64 if COMPILED else 16)
    assert imbalance(shaken.signals(noise(120 if COMPILED else 15), 1.0 / RATE)) < closed
