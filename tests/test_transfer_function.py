"""A transfer function's response is exact under its hold, at either end of it, with any delay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

import hysim as hs

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


def test_initial_state_is_the_free_response_and_its_derivatives():
    plant = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0, 4.0), initial_state=(0.5, -0.6))
    t = 0.1 * np.arange(60)
    assert plant.response(np.zeros(60), 0.1) == pytest.approx(0.5 * np.cos(2 * t) - 0.3 * np.sin(2 * t), abs=EXACT)


def test_equation_1_of_the_paper_on_table_1():
    """What the paper's printed coefficients reach: 89.1 % at the end of a dwell of 0.7 s, 89.9 % at the start of 2 s."""
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


def test_simulate_needs_an_even_time():
    plant = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    u = np.ones(4)
    assert hs.simulate(plant, [0.0, 0.5, 1.0, 1.5], u).y == pytest.approx(plant.response(u, 0.5))
    with pytest.raises(ValueError, match="no time"):
        hs.simulate(plant, None, u)
    with pytest.raises(ValueError, match="evenly spaced"):
        hs.simulate(plant, [0.0, 0.5, 1.1, 1.5], u)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num": (1, 2, 3), "den": (1, 2)}, "above the denominator's"),
        ({"num": (1,), "den": (0, 1)}, "not zero"),
        ({"num": (1,), "den": (1, 1), "delay": -1}, "delay"),
        ({"num": (1,), "den": (1, 1), "hold": "spline"}, "hold"),
        ({"num": (1,), "den": (1, 1), "sample": "middle"}, "sample"),
        ({"num": (1,), "den": (1, 1), "hold": "foh", "sample": "end"}, "held"),
        ({"num": (1,), "den": (1, 1), "initial_state": (1, 2)}, "initial_state"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        hs.TransferFunction(**arguments)


@pytest.mark.parametrize(
    "arguments", [{"poles": 0, "zeros": 0}, {"poles": 2, "zeros": 3}, {"poles": 2, "zeros": 1, "initial": "warm"}]
)
def test_wrong_structures_are_refused(arguments):
    with pytest.raises(ValueError, match=r"pole|initial"):
        hs.TransferFunction.structure(**arguments)


def test_a_denominator_cannot_be_fixed():
    with pytest.raises(ValueError, match="sections"):
        hs.identify(hs.TransferFunction.structure(poles=2, zeros=0), hs.datasets.table1(), fixed={"den[1]": 1.0})
