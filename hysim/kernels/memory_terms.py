"""A memory law given by its terms, inside an oscillator.

    dz/dL = P(s, z) + e(s, z) |z|^n,  dL = |dy|, s = sgn(dy),    z' = |y'| dz/dL + r z

P is one polynomial in z for each direction s and each side of z = 0, so that products of powers of z and |z| are
covered; e, of the same four cases, multiplies one more power, which need not be whole; r is a relaxation in time,
which a law that is independent of rate has not. Arrays of four cases are indexed [s > 0, z > 0].

`motion` is the classical Runge-Kutta method on m y'' + c y' + k y + z = F. Its steps do not end at reversals: it serves
regressions, refined elsewhere.
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
