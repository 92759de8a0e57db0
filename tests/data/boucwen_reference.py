"""Generate `boucwen_reference.npz`: 1 000 random Bouc-Wen laws on random walks, evaluated with 30 digits.

On each side of z = 0, dw/dL = a - c w^n has the travelled length T(w) = (w/a) 2F1(1, 1/n; 1 + 1/n; c w^n / a)
(its real part beyond saturation). T(w) = length is solved by Newton's method with 30 digits; the first guess is
hysim's own answer, which only says where to begin. Laws that come nearer than 0.999 to their escape are left out.
"""

from pathlib import Path

import mpmath
import numpy as np

import hysim as hs

N_LAWS, N_SAMPLES = 1000, 8
mpmath.mp.dps = 30


def travelled(w, a, c, n):
    """Length from 0 to w."""
    return mpmath.re(w / a * mpmath.hyp2f1(1, 1 / n, 1 + 1 / n, c * w**n / a))


def solve(start, length, a, c, n, guess):
    """Value after `length` from `start`; None if Newton's method does not settle."""
    w = mpmath.mpf(guess)
    for _ in range(12):
        change = (travelled(w, a, c, n) - travelled(start, a, c, n) - length) * (a - c * w**n)
        w -= change
        if w < 0:
            return None
        if abs(change) < mpmath.mpf(10) ** -26 * (1 + w):
            return w
    return None


def step(z, du, A, beta, gamma, n, guess):
    """Memory after a monotone stretch."""
    direction, left = mpmath.sign(du), abs(du)
    sign = 1 if direction * z > 0 or (z == 0 and A > 0) else -1
    w = abs(z)
    a, c = sign * A, beta + sign * gamma
    if a < 0 and a - c * w**n < 0:
        to_zero = -travelled(w, a, c, n)
        if left >= to_zero:
            left, w, sign = left - to_zero, mpmath.mpf(0), -sign
            a, c = sign * A, beta + sign * gamma
    if a > 0 and c < 0 and n > 1:
        whole = mpmath.pi / n / mpmath.sin(mpmath.pi / n) * (a / -c) ** (1 / n) / a
        if travelled(w, a, c, n) + left > mpmath.mpf("0.999") * whole:
            return None
    w = solve(w, left, a, c, n, abs(guess))
    return None if w is None else direction * sign * w


def reference(law, u):
    """Memories (n_samples,), or None for a law that is left out."""
    A, beta, gamma, n = (mpmath.mpf(value) for value in (law.A, law.beta, law.gamma, law.n))
    z = [mpmath.mpf(law.z0)]
    try:
        guesses = law.memory(u)
    except hs.SimulationError:
        return None
    for du, guess in zip(np.diff([mpmath.mpf(value) for value in u]), guesses[1:], strict=True):
        z.append(step(z[-1], du, A, beta, gamma, n, guess))
        if z[-1] is None:
            return None
    return np.array([float(value) for value in z])


def main():
    """Write the file beside this one."""
    rng = np.random.default_rng(2024)
    laws, inputs, memories = [], [], []
    while len(laws) < N_LAWS:
        n = float(rng.choice([1.0, 2.0, rng.uniform(0.5, 3.0), rng.uniform(3.0, 20.0)]))
        law = hs.BoucWen(
            A=rng.choice([1, 1, 1, -1]) * rng.uniform(0.2, 3.0), beta=rng.uniform(-2, 3), gamma=rng.uniform(-2, 2), n=n
        )
        u = np.cumsum(rng.normal(0.0, 10 ** rng.uniform(-2, 0.3), N_SAMPLES))
        z = reference(law, u)
        if z is not None and np.abs(z).max() < 1e3:
            laws.append([law.A, law.beta, law.gamma, law.n])
            inputs.append(u)
            memories.append(z)
    np.savez_compressed(
        Path(__file__).with_suffix(".npz"), laws=np.array(laws), u=np.array(inputs), z=np.array(memories)
    )


if __name__ == "__main__":
    main()
