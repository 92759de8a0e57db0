"""A memory law given by its terms, along a displacement and inside an oscillator.

    dz/dL = P(s, z) + e(s, z) |z|^n,  dL = |dy|, s = sgn(dy),    z' = |y'| dz/dL + r z

P is one polynomial in z for each direction s and each side of z = 0, so that products of powers of z and |z| are
covered; e, of the same four cases, multiplies one more power, which need not be whole; r is a relaxation in time,
which a law that is independent of rate has not. Arrays of four cases are indexed [s > 0, z > 0].

`along` uses the midpoint rule on every increment of y, for z and sensitivities, `motion` the classical Runge-Kutta
method on m y'' + c y' + k y + z = F. Neither ends steps at reversals: they serve regressions, refined elsewhere.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inner, kernel

LARGEST = 1e150


@inner
def slope(z: float, case: FloatArray) -> float:
    """P(z) of one case."""
    total = 0.0
    for k in range(case.size - 1, -1, -1):
        total = total * z + case[k]
    return total


@inner
def curvature(z: float, case: FloatArray) -> float:
    """dP/dz of one case."""
    total = 0.0
    for k in range(case.size - 1, 0, -1):
        total = total * z + k * case[k]
    return total


@kernel
def along(
    steps: FloatArray, h: float, law: FloatArray, r: float, terms: FloatArray, z: FloatArray, sensitivities: FloatArray
) -> bool:
    """Memory (n + 1,) after each of `steps` (n,) of y, from `z[0]`, and dz/d(coefficient) (n_terms + 1, n + 1).

    `law` is P, shape (2, 2, degree + 1), `terms` are those of its terms for the coefficient 1; the last sensitivity
    is that to r. `h` is the time of a step. False if z diverges.
    """
    last = len(terms)
    for i in range(steps.size):
        length, s = abs(steps[i]), int(steps[i] > 0.0)
        f = slope(z[i], law[s, int(z[i] > 0.0)]) * length + r * z[i] * h
        middle = z[i] + 0.5 * f
        side = int(middle > 0.0)
        case = law[s, side]
        change = 0.5 * (curvature(middle, case) * length + r * h)
        for j in range(last):
            g = slope(middle, terms[j, s, side]) * length
            sensitivities[j, i + 1] = (sensitivities[j, i] * (1.0 + change) + g) / (1.0 - change)
        sensitivities[last, i + 1] = (sensitivities[last, i] * (1.0 + change) + middle * h) / (1.0 - change)
        z[i + 1] = z[i] + slope(middle, case) * length + r * middle * h
        if not abs(z[i + 1]) < LARGEST:
            return False
    return True


@kernel
def motion(
    plant: FloatArray, law: FloatArray, extra: FloatArray, force: FloatArray, h: float, state: FloatArray, y: FloatArray
) -> bool:
    """Displacement (n - 1,) after each step of h under the force (n,), linear in each; `state` (y, y', z) moves along.

    `plant` is (m, c, k, r, n). False if the motion diverges.
    """
    m, c, k, r, power = plant[0], plant[1], plant[2], plant[3], plant[4]
    Y, V, Z = state[0], state[1], state[2]
    for i in range(y.size):
        at_y, at_v, at_z = Y, V, Z
        sum_y, sum_v, sum_z = 0.0, 0.0, 0.0
        for stage in range(4):
            share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            F = force[i] + share * (force[i + 1] - force[i])
            s, side = int(at_v > 0.0), int(at_z > 0.0)
            along_y = slope(at_z, law[s, side])
            if extra[s, side] != 0.0:
                along_y += extra[s, side] * math.pow(abs(at_z), power)
            dy, dv, dz = at_v, (F - c * at_v - k * at_y - at_z) / m, along_y * abs(at_v) + r * at_z
            weight = h / 6.0 if stage in (0, 3) else h / 3.0
            sum_y, sum_v, sum_z = sum_y + weight * dy, sum_v + weight * dv, sum_z + weight * dz
            ahead = h if stage == 2 else 0.5 * h
            at_y, at_v, at_z = Y + ahead * dy, V + ahead * dv, Z + ahead * dz
        Y, V, Z = Y + sum_y, V + sum_v, Z + sum_z
        y[i] = Y
        if not (abs(Y) < LARGEST and abs(Z) < LARGEST):
            return False
    state[0], state[1], state[2] = Y, V, Z
    return True
