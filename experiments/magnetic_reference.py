"""The Jiles-Atherton law as its differential equation in H, to 30 digits and by the explicit schemes of circuit codes.

    dM/dH = chi / (1 - alpha chi),    chi = c dM_an/dHe + (M_an(He) - M)+ / (delta k),    He = H + alpha M

and in the spellings of circuit simulators and of JAmodel, each with its own constants. Nothing here uses hysim, its
effective field or its closed forms: M is integrated over H. The reference extrapolates the
modified midpoint rule (Gragg, Bulirsch, Stoer) in mpmath, with steps that are halved until two columns agree. Where
the irreversible part is clipped, M follows from H by a root, and the branch begins anew where M_an = M.
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numba import njit

Array = np.ndarray[Any, np.dtype[Any]]
DIGITS, WORKING = 30, 40
_COLUMNS = 18


class Core(NamedTuple):
    """Constants of a law whose effective field is H + alpha M, in A/m; `k` is the pinning of M_irr."""

    Ms: float
    a: float
    alpha: float
    k: float
    c: float


# ---------------------------------------------------------------------------------- 30 digits


class Exact:
    """Magnetisation at the ends of monotone strokes, to 30 digits."""

    def __init__(self, core: Core) -> None:
        self.Ms, self.a, self.alpha, self.k, self.c = (mpmath.mpf(value) for value in core)

    def magnetisation(self, fields: Array) -> list[Any]:
        """M at the turning points `fields` of a core that is demagnetised at the first, which is H = 0."""
        with mpmath.workdps(WORKING):
            H, M, found = mpmath.mpf(0), mpmath.mpf(0), [mpmath.mpf(0)]
            for field in fields[1:]:
                M = self._stroke(H, M, mpmath.mpf(float(field)))
                H = mpmath.mpf(float(field))
                found.append(M)
            return found

    def _curve(self, He: Any) -> tuple[Any, Any]:
        """M_an and its slope."""
        x = He / self.a
        if abs(x) < mpmath.mpf(10) ** -12:
            return self.Ms * (x / 3 - x**3 / 45), self.Ms / self.a * (1 / mpmath.mpf(3) - x * x / 15)
        coth = 1 / mpmath.tanh(x)
        return self.Ms * (coth - 1 / x), self.Ms / self.a * (1 / x**2 - coth * coth + 1)

    def _slope(self, H: Any, M: Any, delta: int) -> Any:
        M_an, steep = self._curve(H + self.alpha * M)
        chi = self.c * steep + max(delta * (M_an - M), mpmath.mpf(0)) / self.k
        return chi / (1 - self.alpha * chi)

    def _stroke(self, H: Any, M: Any, end: Any) -> Any:
        delta = 1 if end > H else -1
        M_an, _ = self._curve(H + self.alpha * M)
        if delta * (M_an - M) < 0:
            still = M - self.c * M_an  # (1 - c) M_irr
            M_irr = still / (1 - self.c)
            free = self.a * mpmath.findroot(lambda x: self._curve(self.a * x)[0] - M_irr, 3 * M_irr / self.Ms)
            H_free = free - self.alpha * M_irr
            if delta * (H_free - end) >= 0:
                return mpmath.findroot(lambda m: m - self.c * self._curve(end + self.alpha * m)[0] - still, M)
            H, M = H_free, M_irr
        return self._integrated(H, M, end, delta)

    def _integrated(self, H: Any, M: Any, end: Any, delta: int) -> Any:
        step = (end - H) / 8
        while delta * (end - H) > 0:
            step = delta * min(abs(step), abs(end - H))
            after = self._extrapolated(H, M, step, delta)
            if after is None:
                step /= 2
                continue
            H, M = (end if abs(end - H - step) < abs(step) * mpmath.mpf(10) ** -25 else H + step), after
            step *= mpmath.mpf("1.4")
        return M

    def _extrapolated(self, H: Any, M: Any, step: Any, delta: int) -> Any:
        """M after a step, or None where the columns do not agree."""
        rows: list[list[Any]] = []
        for j in range(_COLUMNS):
            n = 2 * (j + 1)
            h = step / n
            before, here = M, M + h * self._slope(H, M, delta)
            for i in range(1, n):
                before, here = here, before + 2 * h * self._slope(H + i * h, here, delta)
            row = [(here + before + h * self._slope(H + step, here, delta)) / 2]
            for m in range(j):
                ratio = mpmath.mpf(j + 1) / (j - m)
                row.append(row[m] + (row[m] - rows[-1][m]) / (ratio * ratio - 1))
            rows.append(row)
            if j > 3 and abs(row[-1] - rows[-2][-1]) <= self.Ms * mpmath.mpf(10) ** -(DIGITS + 2):
                return row[-1]
        return None


# ---------------------------------------------------------------------------------- explicit schemes in H


@njit
def langevin(x: float) -> tuple[float, float]:
    """coth x - 1 / x and its slope as the codes have them."""
    if abs(x) < 1e-3:
        return x / 3.0 - x**3 / 45.0, 1.0 / 3.0 - x * x / 15.0
    steep = 1.0 / (x * x) - 1.0 / math.sinh(x) ** 2 if abs(x) < 300.0 else 1.0 / x**2
    return 1.0 / math.tanh(x) - 1.0 / x, steep


@njit
def susceptibility(core: Core, H: float, M: float, delta: float) -> float:
    """dM/dH as the codes have it."""
    Ms, a, alpha, k, c = core
    m, steep = langevin((H + alpha * M) / a)
    chi = c * Ms / a * steep + max(delta * (Ms * m - M), 0.0) / k
    return chi / (1.0 - alpha * chi)


@njit
def euler(core: Core, fields: Array, M: float) -> Array:
    """M at the fields by Euler's rule, one step from each to the next."""
    found = np.empty(fields.size)
    found[0] = M
    for k in range(1, fields.size):
        h = fields[k] - fields[k - 1]
        if h != 0.0:
            M += h * susceptibility(core, fields[k - 1], M, 1.0 if h > 0.0 else -1.0)
        found[k] = M
    return found


@njit
def runge_kutta_step(slope: Any, core: Any, H: float, M: float, h: float) -> float:
    """M after a step of the classical rule of order 4."""
    delta = 1.0 if h > 0.0 else -1.0
    first = slope(core, H, M, delta)
    second = slope(core, H + 0.5 * h, M + 0.5 * h * first, delta)
    third = slope(core, H + 0.5 * h, M + 0.5 * h * second, delta)
    fourth = slope(core, H + h, M + h * third, delta)
    return M + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


@njit
def runge_kutta(core: Core, fields: Array, M: float) -> Array:
    """M at the fields by the classical rule of order 4, one step from each to the next."""
    found = np.empty(fields.size)
    found[0] = M
    for k in range(1, fields.size):
        h = fields[k] - fields[k - 1]
        if h != 0.0:
            M = runge_kutta_step(susceptibility, core, fields[k - 1], M, h)
        found[k] = M
    return found


# ---------------------------------------------------------------------------------- other spellings


class Circuit(NamedTuple):
    """Constants of the circuit simulators' law, which has no alpha."""

    MS: float
    A: float
    K: float
    C: float


class JAmodel(NamedTuple):
    """Constants of JAmodel's bulk law, with an easy axis of the energy Kan at the angle psi."""

    a: float
    k: float
    c: float
    Ms: float
    alpha: float
    Kan: float
    psi: float


@njit
def of_circuit(core: Circuit, H: float, M: float, delta: float) -> float:
    """dM/dH = (M_an - M)+ / ((1 + C) delta K) + C / (1 + C) dM_an/dH."""
    MS, A, K, C = core
    m, steep = langevin(H / A)
    return max(delta * (MS * m - M), 0.0) / ((1.0 + C) * K) + C / (1.0 + C) * MS / A * steep


@njit
def of_jamodel(core: JAmodel, H: float, M: float, delta: float) -> float:
    """The bulk form, with M_an as a mean over the angle theta of a moment to the field."""
    a, k, c, Ms, alpha, Kan, psi = core
    x, q = (H + alpha * M) / a, Kan / (4e-7 * math.pi * Ms * a)
    even, odd, square = 0.0, 0.0, 0.0
    for j in range(_ANGLES.size):
        theta = 0.5 * math.pi * (1.0 + _ANGLES[j])
        sides = 0.5 * (math.sin(psi - theta) ** 2 + math.sin(psi + theta) ** 2)
        share = _SHARES[j] * math.exp(x * math.cos(theta) - q * sides) * math.sin(theta)
        even += share
        odd += share * math.cos(theta)
        square += share * math.cos(theta) ** 2
    m = odd / even
    chi = c * Ms / a * (square / even - m * m) + max(delta * (Ms * m - M), 0.0) / k
    return chi / (1.0 - alpha * chi)


_ANGLES, _SHARES = np.polynomial.legendre.leggauss(40)


@njit
def spelled(slope: Any, core: Any, fields: Array) -> Array:
    """M of a demagnetised core at the fields, by the classical rule of order 4, one step from each to the next."""
    found, M = np.zeros(fields.size), 0.0
    for k in range(1, fields.size):
        M = runge_kutta_step(slope, core, fields[k - 1], M, fields[k] - fields[k - 1])
        found[k] = M
    return found


def strokes(turns: Array, steps: int) -> Array:
    """Fields that go evenly from turning point to turning point, `steps` on each stroke."""
    pieces = [np.linspace(low, high, steps + 1)[1:] for low, high in pairwise(turns.tolist())]
    return np.concatenate([turns[:1], *pieces])
