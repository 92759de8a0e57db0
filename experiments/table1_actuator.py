"""The actuator of the control experiments, its controllers, and what may be wrong about it.

The plant is the law of Table 1 (degree 2, n = 1: bounded, unlike the best fit of the plain law, whose memory wanders),
a creep of 1.5 % a decade, a mode of 500 Hz with a damping ratio of 0.01, 0 to 150 V, 20 kHz, one sample of delay, 1 nm
rms of noise. In V, um and s.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.optimize import brentq

import hysim as hs

H = 1.0 / 20e3  # s
FREQUENCY, DAMPING = 2.0 * math.pi * 500.0, 0.01
MODE = {"natural_frequency": FREQUENCY, "damping_ratio": DAMPING}
LOW, HIGH = 0.1, 2.5  # um
REST = 0.5  # um, from which steps start
CREEP = 1.5  # % a decade
LIMITS = (0.0, 150.0)  # V
LAW = ("beta", "gamma", "gain", "offset", "z0")
"""Parameters of the law that the identification is free to choose, but for those of its input."""


def triangle(period: float, cycles: int) -> tuple[np.ndarray, int]:
    """The triangle that is followed [um], and its samples in a cycle."""
    samples = round(period / H)
    return hs.signals.triangle(LOW, HIGH, cycles=cycles, samples_per_cycle=samples), samples


@cache
@cache
def reference_plant() -> hs.Actuator:
    """The actuator as the controllers know it."""
    structure = hs.PolynomialBoucWen(input_coefficients=(1.0, 0.1))
    return hs.Actuator(
        # without the range of the record: the experiments drive the stack up to 150 V, beyond the 125 V of the table
        hysteresis=hs.identify(structure, hs.datasets.table1(), fixed={"n": 1.0}).model.placed(None),
        creep=hs.Creep.per_decade(CREEP),
        vibration=hs.mode(**MODE),
        sensor=hs.Sensor(noise=1e-3, delay=H),
    )


def controllers(plant: hs.Actuator) -> dict[str, hs.TrackingController]:
    """One for each row of the compensation matrix, each a line more than one above it."""
    slow, faster = hs.PID(ki=1000.0), hs.PID(ki=4000.0)
    alone = hs.PID(kp=1.68, ki=1.74e5, kd=0.0214)  # the largest ki within a sensitivity of 2 on all three plants
    base = hs.TrackingController(feedforward=hs.InverseFeedforward.of(plant), limits=LIMITS)
    feedback = replace(base, feedback=slow)
    damped = replace(base, feedback=faster, damping=hs.DampingLoop(gain=20.0, frequency=FREQUENCY / 3.0))
    inverted = replace(feedback, shaper=hs.Shaper(smoothing=0.6e-3), mode_inverse=hs.ModeInverse(**MODE), preview=True)
    return {
        "PID": hs.TrackingController(feedback=alone, limits=LIMITS),
        "inverse": replace(base, feedforward=hs.InverseFeedforward(law=plant.hysteresis)),
        "inverse + creep inverse": base,
        "... + PID": feedback,
        "... + PID + notch": replace(base, feedback=faster, notch=hs.Notch(**MODE)),
        "... + PID + damping": damped,
        "... + PID + ZV shaping + preview": replace(
            feedback, shaper=hs.Shaper.zv(FREQUENCY, DAMPING), preview=True
        ),
        "... + PID + ZVD shaping + preview": replace(
            feedback, shaper=hs.Shaper.zvd(FREQUENCY, DAMPING), preview=True
        ),
        "... + PID + mode-inverse + preview": inverted,
        "model-following": replace(inverted, model=plant),
        "model-following, damped": replace(damped, shaper=inverted.shaper, mode_inverse=inverted.mode_inverse,
                                           preview=True, model=plant),
    }  # fmt: skip


def robust_controllers(plant: hs.Actuator) -> dict[str, hs.TrackingController]:
    """Model-following with a fast PID behind a broad notch, a damping loop, and different motions of the reference."""
    inverted = replace(
        controllers(plant)["model-following"],
        feedback=hs.PID(kp=16.0, ki=5.5e4),
        notch=hs.Notch(natural_frequency=FREQUENCY, damping_ratio=0.2),
        damping=hs.DampingLoop(gain=20.0, frequency=FREQUENCY / 3.0),
    )
    shaped = {
        "ZV": hs.Shaper.zv(FREQUENCY, DAMPING),
        "ZVD": hs.Shaper.zvd(FREQUENCY, DAMPING),
        "EI": hs.Shaper.ei(FREQUENCY, DAMPING, tolerance=0.1),
        "ZVDD": hs.Shaper.zvdd(FREQUENCY, DAMPING),
    }
    return {"robust, mode-inverse": inverted} | {
        f"robust, {name}": replace(inverted, shaper=shaper, mode_inverse=None) for name, shaper in shaped.items()
    }


def resting_voltage(plant: hs.Actuator, displacement: float) -> float:
    """At which the plant, its creep included, rests at a displacement."""
    return float(brentq(lambda u: plant.creep.dc_gain * plant.hysteresis.response([u])[0] - displacement, *LIMITS))


def extreme_slopes(plant: hs.Actuator) -> tuple[float, float]:
    """The least and the largest slope of the law along two cycles of the limits' lower four fifths."""
    u = np.tile(hs.signals.triangle(0.0, 0.8 * LIMITS[1], cycles=1, samples_per_cycle=2400)[:-1], 2)
    slopes = np.diff(plant.hysteresis.response(u)) / np.diff(u)
    return float(slopes.min()), float(slopes.max())


def drawn(plant: hs.Actuator, factors: np.ndarray) -> hs.Actuator:
    """The plant with its parameters times as many factors: the law's, then the creep's, the mode's last."""
    return replace(
        plant,
        hysteresis=drawn_law(plant.hysteresis, factors[:-3]),
        creep=hs.Creep.per_decade(CREEP * factors[-3]),
        vibration=hs.mode(FREQUENCY * factors[-2], DAMPING * factors[-1]),
    )


def drawn_normalised(law: hs.PolynomialBoucWen, factors: np.ndarray) -> hs.PolynomialBoucWen:
    """As `drawn_law` with n, of the law's normalised form, after Ikhouane and Rodellar (2007).

    y = offset + k (u + q u^2 + eta w), w' = rho (u' - sigma |u'| |w|^(n-1) w + (sigma - 1) u' |w|^n), so that k scales
    the whole and w saturates at one. The factors are those of rho, sigma, eta, offset, w0, n, k and q.
    """
    of_rho, of_sigma, of_eta, of_offset, of_w0, of_n, of_k, of_q = factors
    loading, (first, second) = law.beta + law.gamma, law.input_coefficients
    unit = (law.A / loading) ** (1.0 / law.n)
    rho, sigma = of_rho * law.A / unit, of_sigma * law.beta / loading
    return replace(
        law,
        A=rho,
        beta=rho * sigma,
        gamma=rho * (1.0 - sigma),
        n=law.n * of_n,
        gain=law.gain * unit * of_k * of_eta,
        offset=law.offset * of_offset,
        z0=law.z0 / unit * of_w0,
        input_coefficients=(first * of_k, second * of_k * of_q),
    )


def drawn_law(law: hs.PolynomialBoucWen, factors: np.ndarray) -> hs.PolynomialBoucWen:
    """The law with its parameters times as many factors: those of its input last, before them n where there are 8."""
    names, (first, second) = (*LAW, "n"), law.input_coefficients
    return replace(
        law,
        **{name: factor * getattr(law, name) for name, factor in zip(names, factors[:-2], strict=False)},
        input_coefficients=(first * factors[-2], second * factors[-1]),
    )
