"""Friction laws for tests: random and hostile numbers, and obvious transcriptions of their equations."""

import numpy as np
from scipy.integrate import solve_ivp

import hysim as hs

FAMILIES = (hs.LuGre, hs.StribeckFriction, hs.GeneralizedMaxwellSlip, hs.ElasticBacklash)


def decades(rng, low, high, n=None):
    return 10.0 ** rng.uniform(low, high, n)


def drawn(family, rng):
    """A law of a family, a length, and a sample time: its numbers lie decades apart."""
    force, length, time = decades(rng, -6, 6), decades(rng, -8, 2), decades(rng, -5, 2)
    level = {"coulomb": force, "breakaway": force * decades(rng, -0.3, 1)}
    curve = level | {"stribeck_velocity": length / time * decades(rng, -3, 3), "stribeck_exponent": rng.uniform(0.3, 4)}
    viscous = force * time / length * decades(rng, -3, 0)
    if family is hs.LuGre:
        sigma1 = force * time / length * decades(rng, -3, 1)
        falling = length / time * decades(rng, -2, 1) if rng.random() < 0.5 else 0.0
        law = hs.LuGre(
            sigma0=force / length, sigma1=sigma1, sigma2=viscous, damping_velocity=falling, offset=force * rng.normal(),
            z0=length * rng.normal(), **curve,
        )  # fmt: skip
    elif family is hs.StribeckFriction:
        law = family(breakaway_velocity=length / time * decades(rng, -3, 2), viscous=viscous, **level)
    elif family is hs.GeneralizedMaxwellSlip:
        n = int(rng.integers(1, 5))
        stiffness = force / length * decades(rng, -1, 1, n)
        attraction, z0 = force / time * decades(rng, -3, 5), force * rng.normal(size=n)
        weights = rng.uniform(0.1, 1.0, n)
        law = family(stiffness=stiffness, weights=weights, attraction=attraction, viscous=viscous, z0=z0, **curve)
    else:
        gap = length * decades(rng, -1, 1) if rng.random() < 0.9 else 0.0
        damping = force / length * time * decades(rng, -3, 2) if rng.random() < 0.9 else 0.0
        law = family(stiffness=force / length, damping=damping, half_gap=gap, center=length * rng.normal())
    return law, length, time


def walk(rng, length, n):
    """Strokes of sizes decades apart, and rests."""
    strokes = length * rng.normal(size=n) * decades(rng, -3, 1, n) * (rng.random(n) < 0.9)
    return np.concatenate([[0.0], np.cumsum(strokes)])


def lugre(law, u, h):
    """LuGre by DOP853 from stroke to stroke."""
    z, force = law.z0, [law.offset + law.sigma0 * law.z0]
    for rise in np.diff(u):
        v = rise / h
        g = law.coulomb + (law.breakaway - law.coulomb) * np.exp(
            -(abs(v / law.stribeck_velocity) ** law.stribeck_exponent)
        )

        def slope(_, z, v=v, g=g):
            return v - law.sigma0 * abs(v) * z / g

        z = solve_ivp(slope, (0.0, h), [z], method="DOP853", rtol=1e-12, atol=1e-14 * g / law.sigma0).y[0, -1]
        damping = law.sigma1 * (np.exp(-((v / law.damping_velocity) ** 2)) if law.damping_velocity else 1.0)
        force.append(law.offset + law.sigma0 * z + damping * slope(0.0, z) + law.sigma2 * v)
    return np.array(force)


def maxwell(law, u, h, n=4000):
    """Generalized Maxwell slip by Euler's method, from part to part of each stroke."""
    forces, slips = np.array(law.z0), np.zeros(len(law.z0))
    stiffness, weights = np.array(law.stiffness), np.array(law.weights)
    total = [law.offset + forces.sum()]
    for rise in np.diff(u):
        v = rise / h
        g, sign = float(law.friction(v)), np.sign(v)
        for _ in range(n):
            slips = np.where(slips == sign, slips, 0.0)
            slips = np.where((sign != 0.0) & (sign * forces >= weights * g), sign, slips)
            rates = np.where(slips != 0.0, sign * law.attraction * (weights - sign * forces / g), stiffness * v)
            forces = forces + h / n * rates
        total.append(law.offset + forces.sum() + law.viscous * v)
    return np.array(total)


def backlash(law, u, h, n=2000):
    """Torque and part of the gap by Euler's method on the equation of Nordin, Galic and Gutman."""
    a, k, c = law.half_gap, law.stiffness, law.damping
    b = min(max(u[0] - law.center, -a), a)
    torques, parts = [k * (u[0] - law.center - b)], [b]
    for first, rise in zip(u, np.diff(u), strict=False):
        v, x = rise / h, first - law.center
        for i in range(n):
            slope = v + k / c * (x + rise * i / n - b)
            slope = max(0.0, slope) if b <= -a else min(0.0, slope) if b >= a else slope
            b = min(max(b + h / n * slope, -a), a)
        torque = k * (x + rise - b) + c * v
        torques.append(torque if (b >= a and torque > 0.0) or (b <= -a and torque < 0.0) else 0.0)
        parts.append(b)
    return np.array(torques), np.array(parts)
