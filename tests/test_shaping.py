"""Shapers leave no vibration, a mode's inverse has no phase, notches and damping loops are what they say."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from strategies import assert_refused, refused

import hysim as hs

H = 5e-5
frequencies, ratios = st.floats(100.0, 3e4), st.floats(0.0, 0.5)


def residual(shaper, frequency, ratio, h=H):
    """|sum A_i exp(-p t_i)| of a mode, less its decay: what vibrates after the last impulse."""
    impulses = shaper.impulses(h)
    pole = complex(-ratio * frequency, frequency * math.sqrt(1.0 - ratio**2))
    return abs(np.exp(pole * h * np.arange(impulses.size)[::-1]) @ impulses)


@given(frequencies, ratios)
def test_a_shaper_leaves_no_vibration_on_any_grid(frequency, ratio):
    for make in (hs.Shaper.zv, hs.Shaper.zvd):
        shaper = make(frequency, ratio)
        assert residual(shaper, frequency, ratio) < 1e-12
        assert shaper.impulses(H).sum() == pytest.approx(1.0, abs=1e-12)
        assert (shaper.impulses(H) > -1e-12).all()


@given(st.floats(1e3, 1e4), st.floats(0.0, 0.1))
def test_repeats_take_the_residual_to_a_higher_order(frequency, ratio):
    once, twice = (residual(make(frequency, ratio), 1.01 * frequency, ratio) for make in (hs.Shaper.zv, hs.Shaper.zvd))
    assert once < 0.02  # pi / 2 times the error of the frequency
    assert twice == pytest.approx(once**2, rel=1e-6)


def test_the_extra_insensitive_shaper_bounds_the_residual_over_its_band():
    """By (pi / 2 tolerance)^zeros / 2^(zeros - 1), for the residual is pi / 2 times a polynomial of least size."""
    frequency, band = 3e3, np.linspace(0.9, 1.1, 41)
    for zeros in (1, 2, 3):
        shaper = hs.Shaper.ei(frequency, 0.0, tolerance=0.1, zeros=zeros)
        largest = max(residual(shaper, factor * frequency, 0.0) for factor in band)
        bound = (0.05 * math.pi) ** zeros / 2.0 ** (zeros - 1)
        assert largest == pytest.approx(bound, rel=0.2)  # zeros at 0.9 of the frequency have longer half periods


def test_a_zero_of_third_order_is_three_times_the_shaper():
    once, three = (residual(make(3e3, 0.0), 3.1e3, 0.0) for make in (hs.Shaper.zv, hs.Shaper.zvdd))
    assert three == pytest.approx(once**3, rel=1e-6)


@pytest.mark.parametrize("wrong", [{"tolerance": 1.0}, {"tolerance": -0.1}, {"zeros": 0}, {"zeros": 1.0}])
def test_a_band_that_is_none_is_refused(wrong):
    assert_refused(next(iter(wrong)), hs.Shaper.ei, 3e3, 0.01, **wrong)


def test_several_modes_are_shaped_together():
    modes = ((3e3, 8e3, 2e4), (0.01, 0.02, 0.1))
    shaper = hs.Shaper.zv(*modes)
    assert max(residual(shaper, *mode) for mode in zip(*modes, strict=True)) < 1e-12


def test_a_shaped_step_leaves_the_plant_at_rest():
    plant = hs.mode(2.0 * math.pi * 477.3, 0.013)  # half a period is 20.95 samples
    shaper = hs.Shaper.zv(2.0 * math.pi * 477.3, 0.013)
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(), shaper=shaper)
    run = hs.close_loop(plant, controller, H * np.arange(300), np.ones(300))
    assert np.abs(run.y - 1.0)[24:].max() < 1e-12
    assert run.y.max() < 1.0 + 1e-12


@given(st.floats(0.0, 0.01))
def test_a_smooth_shaper_is_two_moving_averages(duration):
    impulses, n = hs.Shaper(smoothing=duration).impulses(H), max(1, round(duration / 2 / H))
    assert impulses == pytest.approx(np.convolve(np.ones(n), np.ones(n)) / n**2)


@given(st.floats(1e3, 2e4), st.floats(0.0, 0.3))
def test_the_inverse_of_a_mode_has_three_weights_left(frequency, ratio):
    weights = hs.ModeInverse(natural_frequency=frequency, damping_ratio=ratio).weights(H)
    discrete = signal.cont2discrete(([frequency**2], [1.0, 2.0 * ratio * frequency, frequency**2]), H, "zoh")
    b1, b2 = np.ravel(discrete[0])[-2:]
    u = np.pad(weights, (3, 33))
    passed_on = hs.TrackingController(feedforward=hs.InverseFeedforward())
    stepped = hs.close_loop(hs.mode(frequency, ratio), passed_on, H * np.arange(40), u).y
    three = np.array([b1 * b2, b1**2 + b2**2, b1 * b2]) / (b1 + b2) ** 2
    assert np.abs(stepped[4:7] - three).max() < 1e-9  # the determinant of a matrix close to one, over (frequency H)^2
    assert np.abs(stepped[7:]).max() < 1e-9


@given(st.floats(100.0, 3e4), st.floats(0.0, 0.5), st.floats(0.1, 2.0))
def test_a_notch_is_bilinear_and_right_at_its_frequency(frequency, ratio, new):
    notch = hs.Notch(natural_frequency=frequency, damping_ratio=ratio, new_damping_ratio=new)
    numerator, denominator = ([1.0, 2.0 * zeta * frequency, frequency**2] for zeta in (ratio, new))
    rate = frequency / math.tan(frequency * H / 2.0) / 2.0
    b, a = signal.bilinear(numerator, denominator, rate)
    assert notch.coefficients(H) == pytest.approx(np.concatenate([b, a[1:]]), abs=1e-9)
    at, beside = notch.frequency_response([frequency, 1e-3 * frequency], H)
    assert abs(at) == pytest.approx(ratio / new, abs=1e-9)
    assert abs(beside - 1.0) < 0.01


def test_a_notch_has_poles_of_critical_damping_by_default():
    """At its frequency it then passes the damping ratio of the resonance, and its two poles are one."""
    notch = hs.Notch(natural_frequency=1e3, damping_ratio=0.01)
    assert abs(notch.frequency_response(1e3, H)) == pytest.approx(0.01, rel=1e-9)
    _, _, _, a1, a2 = notch.coefficients(H)
    assert a1**2 - 4.0 * a2 == pytest.approx(0.0, abs=1e-9)


@given(st.floats(100.0, 3e4), st.none() | st.floats(0.1, 2.0), st.sampled_from([-3.0, 0.2, 5.0]))
def test_a_damping_loop_is_bilinear_and_has_its_gain_at_rest(frequency, ratio, gain):
    loop = hs.DampingLoop(gain=gain, frequency=frequency, damping_ratio=ratio)
    rate = frequency / math.tan(frequency * H / 2.0) / 2.0
    order = [1.0, frequency] if ratio is None else [1.0, 2.0 * ratio * frequency, frequency**2]
    b, a = signal.bilinear([gain * order[-1]], order, rate)
    b0, b1, b2, a1, a2 = loop.coefficients(H)
    assert [b0, b1, *([b2] if ratio else [])] == pytest.approx(b, abs=1e-9)
    assert [a1, *([a2] if ratio else [])] == pytest.approx(a[1:], abs=1e-9)
    assert loop.frequency_response(0.0, H) == pytest.approx(gain)


@pytest.mark.parametrize(
    "loop", [hs.DampingLoop(gain=0.5, frequency=1000.0), hs.DampingLoop(gain=0.3, frequency=3500.0, damping_ratio=0.4)]
)
def test_a_damping_loop_damps(loop):
    plant = hs.Actuator(vibration=hs.mode(2.0 * math.pi * 500.0, 0.01), sensor=hs.Sensor(delay=H))
    t = H * np.arange(2000)
    forward = {"feedforward": hs.InverseFeedforward()}
    free, damped = (
        hs.close_loop(plant, hs.TrackingController(**forward, **parts), t, np.ones(t.size)).y
        for parts in ({}, {"damping": loop, "model": plant})
    )
    assert np.ptp(free[1500:]) > 0.08
    silent = np.abs(free - damped).max()
    assert silent < 1e-9  # its model says the same
    wrong = hs.Actuator(vibration=hs.mode(2.0 * math.pi * 450.0, 0.01), sensor=hs.Sensor(delay=H))
    run = hs.close_loop(wrong, hs.TrackingController(**forward, damping=loop), t, np.ones(t.size))
    assert np.ptp(run.y[1500:]) < 0.01 * np.ptp(free[1500:])


test_numbers_outside_their_range_are_refused = refused(
    (lambda: hs.Shaper.zv((1.0, 2.0), 0.1), "equally long"),
    (lambda: hs.Shaper.zv(-1.0, 0.1), "must be positive"),
    (lambda: hs.Shaper.zv(1.0, 1.0), "below 1"),
    (lambda: hs.Shaper(repeats=0), "at least 1"),
    (lambda: hs.Shaper(smoothing=-1.0), "negative"),
    (lambda: hs.Shaper.zv(100.0, 0.0).impulses(1.0), "shorter than a sample"),
    (lambda: hs.ModeInverse(natural_frequency=0.0, damping_ratio=0.1), "natural_frequency must be positive"),
    (lambda: hs.Notch(natural_frequency=0.0, damping_ratio=0.1), "natural_frequency must be positive"),
    (lambda: hs.Notch(natural_frequency=1.0, damping_ratio=-0.1), "damping_ratio must not be negative"),
    (lambda: hs.Notch(natural_frequency=1.0, damping_ratio=0.1, new_damping_ratio=0.0), "new_damping_ratio"),
    (lambda: hs.Notch(natural_frequency=4.0, damping_ratio=0.1).coefficients(1.0), "below pi / sample_time"),
    (lambda: hs.DampingLoop(gain=1.0, frequency=0.0), "frequency must be positive"),
    (lambda: hs.DampingLoop(gain=1.0, frequency=1.0, damping_ratio=0.0), "damping_ratio must be positive"),
)
