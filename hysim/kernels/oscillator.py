"""A mass on a Bouc-Wen spring, step by step.

    m y'' + c y' + p(y) + g z = F(t),    dz/dy = A - |z|^n (gamma + beta sign(z y')),    F linear within a step

p is a polynomial (offset, stiffness, the law's own input coefficients), positive forces pull towards y = 0.

Between a reversal (y' = 0) or a crossing (z = 0) and the next the equation is smooth, with a constant
C = gamma + beta sign(z y') in front of |z|^n; at them z'' jumps. Four methods:

    SPLIT         steps end where y' or z changes sign; between, J. C. Butcher's explicit Runge-Kutta method of
                  order 6 with 7 stages (J. Austral. Math. Soc. 4, 1964); the memory at the end of a step is
                  the exact one of the law for the displacement of the step
    RUNGE_KUTTA   the classical method of order 4, signs taken at each stage, steps never cut
    NEWMARK       constant average acceleration, the trapezoidal rule for z, solved to rounding
    STRANG        half a kick by what is not linear, the exact flow of what is, half a kick; the memory exact
                  along the displacement, cut at the turning point

SPLIT looks for the events on the cubic through values and slopes at both ends of a trial step, and tries again
with a step that ends there. A reversal may be missed by a share e = 1e-6 of the change of velocity: the turning
point is then wrong by e^2. A crossing costs the order only inside the piece that is missed. Where
the memory by the method is off the exact one, a law much sharper than the step, the step is halved.

Each step also carries three integrals over time: of F y', of c y'^2 and of g z y'. The motion is the tuple
(y, y', z, integral of F y', of c y'^2, of g z y'); the plant is (m, c, k, offset, g, A, beta, gamma, n, 1 / m).

A sample's step has the last input, the motion, whether a sample has been seen, and the law's `boucwen.prepare` as its
state. Its parameters are the number of steps, whether the input is held, the times of a sample and of a step, the force
of an input of one, the plant, and the coefficients of y^2, y^3, ... in p. The first sample leaves the state as it is.
"""

import math
from collections.abc import Callable

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner, kernel, pasted, uncounted_kernel, unfolded
from hysim.kernels.boucwen import advance, polynomial
from hysim.kernels.elementary import linear_flow, power

Motion = tuple[float, float, float, float, float, float]
Plant = tuple[float, float, float, float, float, float, float, float, float, float]
Rates = tuple[float, float]  # y'' and z'
Branch = tuple[float, float, float]  # signs of y' and z, and C
Move = Callable[[Motion, float, float, float, Plant, FloatArray, FloatArray], Motion]
"""Motion after a step; from that before, the force and its slope, the length, the plant, the curve and the work."""

N_HEAD, N_FRONT = 15, 8  # parameters before the coefficients or the flow, and places of the state before the work

_REVERSAL = 1.0e-6  # share of the change of y' in a step by which its end may lie beyond a reversal
_CROSSING = 1.0e-3  # likewise of z and a crossing
_MOST_TRIALS, _MOST_PIECES = 60, 1000  # of one piece between events, of pieces in a step
_DISAGREEMENT = 1.0e-3  # share of z by which the method and the law may differ on it at the end of a piece
_CONVERGED = 1.0e-9  # share by which Newton's method moves when the next move would be below rounding
_TINY = 1.0e-290
_THIRD, _TWO_THIRDS = 1.0 / 3.0, 2.0 / 3.0


# ---------------------------------------------------------------------------------- scalar functions


@inner
def spring(y: float, stiffness: float, offset: float, curve: FloatArray) -> float:
    """Force of the part without memory; `curve` holds the coefficients of y^2, y^3, ..."""
    force = offset + stiffness * y
    return force + y * polynomial(y, curve, 0) if curve.size > 0 else force


@inner
def tangent(y: float, stiffness: float, curve: FloatArray) -> float:
    """Derivative of `spring`."""
    total = 0.0
    for k in range(curve.size - 1, -1, -1):
        total = (total + (k + 2.0) * curve[k]) * y
    return stiffness + total


@inner
def rates(force: float, y: float, v: float, z: float, side: float, C: float, plant: Plant, curve: FloatArray) -> Rates:
    """Acceleration and z' on the branch where sign(z) is `side`, and on its continuation."""
    _, damping, stiffness, offset, gain, A, _, _, n, mobility = plant
    acceleration = (force - damping * v - spring(y, stiffness, offset, curve) - gain * z) * mobility
    return acceleration, v * (A - C * power(side * z, n))


@inner
def memory_slope(z: float, v: float, plant: Plant) -> float:
    """dz/dy at z on the way of v."""
    _, _, _, _, _, A, beta, gamma, n, _ = plant
    return float(A - power(abs(z), n) * (gamma + beta * math.copysign(1.0, z * v)))


@inner
def relaxed(z: float, dy: float, A: float, beta: float, gamma: float) -> float:
    """`advance` for n = 1 where z keeps its sign: one flow, and no search for the crossing."""
    direction = math.copysign(1.0, dy)
    c = beta + gamma if direction * z >= 0.0 else beta - gamma
    return direction * linear_flow(direction * z, A, c, abs(dy))


@kernel
def sign_change(f0: float, d0: float, f1: float, d1: float, length: float) -> float:
    """Place in (0, `length`) where the cubic through values f and slopes d at both ends takes the sign of f1."""
    b, c, d = length * d0, 3.0 * (f1 - f0) - length * (2.0 * d0 + d1), 2.0 * (f0 - f1) + length * (d0 + d1)
    side = math.copysign(1.0, f1)
    low, high = 0.0, 1.0
    s = f0 / (f0 - f1) if f0 * side < 0.0 else 0.5
    for _ in range(30):
        value, slope = f0 + s * (b + s * (c + s * d)), b + s * (2.0 * c + 3.0 * s * d)
        low, high = (s, high) if value * side < 0.0 else (low, s)
        target = s - value / slope if slope != 0.0 else -1.0
        if not low < target < high:
            target = 0.5 * (low + high)
        moved, s = abs(target - s), target
        if moved < 1.0e-8:
            break
    return s * length


@kernel
def dip(v0: float, a0: float, v1: float, a1: float, length: float) -> float:
    """Place at which the cubic through the velocities dips below zero between ends of one sign, or `length`."""
    if not (a0 * v0 < 0.0 and a1 * v1 > 0.0 and v0 * v1 > 0.0):
        return length
    b, c, d = length * a0, 3.0 * (v1 - v0) - length * (2.0 * a0 + a1), 2.0 * (v0 - v1) + length * (a0 + a1)
    root = c * c - 3.0 * b * d
    if root <= 0.0:
        return length
    s = -b / (c + math.copysign(math.sqrt(root), -b))  # of the two extremes the one after a descent of |v|
    if not 0.0 < s < 1.0 or v0 * (v0 + s * (b + s * (c + s * d))) >= 0.0:
        return length
    return s * length


@inner
def branch(motion: Motion, acceleration: float, slope: float, h: float, A: float, beta: float, gamma: float) -> Branch:
    """Signs of y' and z on the branch that begins here, a moment ahead, and C."""
    ahead = motion[1] + _REVERSAL * h * acceleration
    forward = math.copysign(1.0, ahead if ahead != 0.0 else slope)
    ahead = motion[2] + _CROSSING * h * A * motion[1]
    side = math.copysign(1.0, ahead if ahead != 0.0 else A * forward)
    return forward, side, gamma + beta * forward * side


@inlined
def smooth_step(
    motion: Motion, F: float, dF: float, h: float, a1: float, r1: float, side: float, C: float, plant: Plant,
    curve: FloatArray,
) -> Motion:  # fmt: skip
    """Order 6 on one branch; F rises by dF over the step, a1 and r1 are y'' and z' at its begin."""
    y, v, z, _, _, _ = motion
    q = h * _THIRD
    v1 = v
    y2, v2, z2 = y + q * v1, v + q * a1, z + q * r1
    a2, r2 = rates(F + dF * _THIRD, y2, v2, z2, side, C, plant, curve)
    q = h * _TWO_THIRDS
    y3, v3, z3 = y + q * v2, v + q * a2, z + q * r2
    a3, r3 = rates(F + dF * _TWO_THIRDS, y3, v3, z3, side, C, plant, curve)
    q = h * (1.0 / 12.0)
    y4, v4, z4 = y + q * (v1 + 4.0 * v2 - v3), v + q * (a1 + 4.0 * a2 - a3), z + q * (r1 + 4.0 * r2 - r3)
    a4, r4 = rates(F + dF * _THIRD, y4, v4, z4, side, C, plant, curve)
    q = h * (1.0 / 16.0)
    y5 = y + q * (18.0 * v2 - v1 - 3.0 * v3 - 6.0 * v4)
    v5 = v + q * (18.0 * a2 - a1 - 3.0 * a3 - 6.0 * a4)
    z5 = z + q * (18.0 * r2 - r1 - 3.0 * r3 - 6.0 * r4)
    a5, r5 = rates(F + dF * 0.5, y5, v5, z5, side, C, plant, curve)
    q = h * (1.0 / 8.0)
    y6 = y + q * (9.0 * v2 - 3.0 * v3 - 6.0 * v4 + 4.0 * v5)
    v6 = v + q * (9.0 * a2 - 3.0 * a3 - 6.0 * a4 + 4.0 * a5)
    z6 = z + q * (9.0 * r2 - 3.0 * r3 - 6.0 * r4 + 4.0 * r5)
    a6, r6 = rates(F + dF * 0.5, y6, v6, z6, side, C, plant, curve)
    q = h * (1.0 / 44.0)
    y7 = y + q * (9.0 * v1 - 36.0 * v2 + 63.0 * v3 + 72.0 * v4 - 64.0 * v6)
    v7 = v + q * (9.0 * a1 - 36.0 * a2 + 63.0 * a3 + 72.0 * a4 - 64.0 * a6)
    z7 = z + q * (9.0 * r1 - 36.0 * r2 + 63.0 * r3 + 72.0 * r4 - 64.0 * r6)
    a7, r7 = rates(F + dF, y7, v7, z7, side, C, plant, curve)
    q = h * (1.0 / 120.0)
    halfway = F + 0.5 * dF
    work = 11.0 * (F * v1 + (F + dF) * v7) - 32.0 * halfway * (v5 + v6)
    work += 81.0 * ((F + dF * _TWO_THIRDS) * v3 + (F + dF * _THIRD) * v4)
    damped = 11.0 * (v1 * v1 + v7 * v7) + 81.0 * (v3 * v3 + v4 * v4) - 32.0 * (v5 * v5 + v6 * v6)
    taken = 11.0 * (z * v1 + z7 * v7) + 81.0 * (z3 * v3 + z4 * v4) - 32.0 * (z5 * v5 + z6 * v6)
    return (
        y + q * (11.0 * (v1 + v7) + 81.0 * (v3 + v4) - 32.0 * (v5 + v6)),
        v + q * (11.0 * (a1 + a7) + 81.0 * (a3 + a4) - 32.0 * (a5 + a6)),
        z + q * (11.0 * (r1 + r7) + 81.0 * (r3 + r4) - 32.0 * (r5 + r6)),
        motion[3] + q * work,
        motion[4] + q * plant[1] * damped,
        motion[5] + q * plant[4] * taken,
    )


@inlined
def attempt(
    motion: Motion, F: float, slope: float, length: float, most_trials: int, plant: Plant, curve: FloatArray
) -> tuple[float, float, float, float, float, float, float, bool]:
    """The longest smooth step up to `length`: motion, length, and whether z kept its sign; z by the method itself."""
    _, _, _, _, _, A, beta, gamma, n, _ = plant
    y, v, z, _, _, _ = motion
    h = shorter = length
    a, _ = rates(F, y, v, z, 1.0, 0.0, plant, curve)
    forward, side, C = branch(motion, a, slope, h, A, beta, gamma)
    r = v * (A - C * power(side * z, n))
    for _k in range(most_trials):
        h = shorter
        trial = smooth_step(motion, F, slope * h, h, a, r, side, C, plant, curve)
        y1, v1, z1, _, _, _ = trial
        a1, r1 = rates(F + slope * h, y1, v1, z1, side, C, plant, curve)
        shorter = dip(v, a, v1, a1, h)
        if forward * v1 < -_REVERSAL * abs(v1 - v):
            shorter = sign_change(v, a, v1, a1, h)
        elif side * z1 < -_CROSSING * abs(z1 - z):
            shorter = sign_change(z, r, z1, r1, h)
        if not shorter < h:
            break
    same_side = side * z >= 0.0 and side * z1 >= 0.0
    return trial[0], trial[1], trial[2], trial[3], trial[4], trial[5], h, same_side


@unfolded
def split(
    motion: Motion, F: float, slope: float, length: float, plant: Plant, curve: FloatArray, work: FloatArray
) -> Motion:
    """A step in pieces that end at reversals and crossings, each with the exact memory."""
    _, _, _, _, _, A, beta, gamma, n, _ = plant
    left = reach = length
    for piece in range(_MOST_PIECES):
        y, z = motion[0], motion[2]
        trials = _MOST_TRIALS if piece < _MOST_PIECES - 1 else 1
        trial = attempt(motion, F, slope, min(reach, left), trials, plant, curve)
        h = trial[6]
        if n == 1.0 and trial[7]:
            z = relaxed(z, trial[0] - y, A, beta, gamma)
        else:
            z = advance(z, trial[0] - y, A, beta, gamma, n, work)
        if abs(z - trial[2]) > _DISAGREEMENT * (abs(z) + abs(motion[2])) and trials > 1:
            reach = 0.5 * h
            continue
        motion = (trial[0], trial[1], z, trial[3], trial[4], trial[5])
        if not h < left:
            break
        reach *= 2.0
        F += slope * h
        left -= h
    return motion


@unfolded
def runge_kutta(
    motion: Motion, F: float, slope: float, h: float, plant: Plant, curve: FloatArray, work: FloatArray
) -> Motion:
    """The classical method of order 4 over one step, whatever happens inside it."""
    y, v, z, _, _, _ = motion
    dy, dv, dz, worked, damped, taken = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    yi, vi, zi, force = y, v, z, F
    for stage in range(4):
        a, _ = rates(force, yi, vi, zi, 1.0, 0.0, plant, curve)
        r = vi * memory_slope(zi, vi, plant)
        weight = h / 6.0 if stage in (0, 3) else h / 3.0
        dy, dv, dz = dy + weight * vi, dv + weight * a, dz + weight * r
        worked, damped, taken = worked + weight * force * vi, damped + weight * vi * vi, taken + weight * zi * vi
        reach = h if stage == 2 else 0.5 * h
        yi, vi, zi, force = y + reach * vi, v + reach * a, z + reach * r, F + slope * reach
    return y + dy, v + dv, z + dz, motion[3] + worked, motion[4] + plant[1] * damped, motion[5] + plant[4] * taken


@unfolded
def newmark(
    motion: Motion, F: float, slope: float, h: float, plant: Plant, curve: FloatArray, work: FloatArray
) -> Motion:
    """Constant average acceleration and the trapezoidal rule for z: Newton's method on (y', z) at the end."""
    mass, damping, stiffness, offset, gain, A, beta, gamma, n, mobility = plant
    y, v, z, _, _, _ = motion
    a = (F - damping * v - spring(y, stiffness, offset, curve) - gain * z) * mobility
    r = v * memory_slope(z, v, plant)
    end = F + slope * h
    half, inertia = 0.5 * h, 2.0 * mass / h
    v1, z1 = v + h * a, z + h * r
    last = math.inf
    for _ in range(50):
        y1 = y + half * (v + v1)
        sharp = 1.0 if n == 1.0 else abs(z1) ** (n - 1.0) if z1 != 0.0 else 0.0
        turn = gamma * math.copysign(1.0, z1) + beta * math.copysign(1.0, v1)  # C sign(z)
        S = A - sharp * z1 * turn
        imbalance = inertia * (v1 - v) - mass * a + damping * v1 + spring(y1, stiffness, offset, curve) + gain * z1
        excess = z1 - z - half * (r + v1 * S)
        J11 = inertia + damping + half * tangent(y1, stiffness, curve)
        J21, J22 = -half * S, 1.0 + half * v1 * n * sharp * turn
        dv = (gain * excess - (imbalance - end) * J22) / (J11 * J22 - gain * J21)
        dz = -(excess + J21 * dv) / J22
        v1, z1 = v1 + dv, z1 + dz
        moved = max(abs(dv) / (abs(v) + abs(v1) + _TINY), abs(dz) / (abs(z) + abs(z1) + _TINY))
        if moved < _CONVERGED or not moved < last:
            break
        last = moved if moved < 1.0e-6 else math.inf
    dy = 0.5 * h * (v + v1)
    worked, damped, taken = 0.5 * (F + end) * dy, damping * 0.5 * (v + v1) * dy, gain * 0.5 * (z + z1) * dy
    return y + dy, v1, z1, motion[3] + worked, motion[4] + damped, motion[5] + taken


@unfolded
def strang(
    motion: Motion, F: float, slope: float, h: float, plant: Plant, curve: FloatArray, work: FloatArray
) -> Motion:
    """Kick, flow, kick. The flow takes (y, y', F, its rise) over the step with the tangent at z = 0; curve follows."""
    flow, curve = curve[:8].reshape((2, 4)), curve[8:]
    mass, damping, stiffness, offset, gain, A, beta, gamma, n, _ = plant
    y, v, z, _, _, _ = motion
    kick = 0.5 * h / mass
    v0 = v - kick * (spring(y, 0.0, offset, curve) + gain * (z - A * y))
    y1 = flow[0, 0] * y + flow[0, 1] * v0 + flow[0, 2] * F + flow[0, 3] * slope * h
    v1 = flow[1, 0] * y + flow[1, 1] * v0 + flow[1, 2] * F + flow[1, 3] * slope * h
    turn = y
    if v0 * v1 < 0.0:
        a0 = (F - damping * v0 - (stiffness + gain * A) * y) / mass
        a1 = (F + slope * h - damping * v1 - (stiffness + gain * A) * y1) / mass
        s = sign_change(v0, a0, v1, a1, h) / h
        b, c, d = h * v0, 3.0 * (y1 - y) - h * (2.0 * v0 + v1), 2.0 * (y - y1) + h * (v0 + v1)
        turn = y + s * (b + s * (c + s * d))
    middle = advance(z, turn - y, A, beta, gamma, n, work)
    z1 = advance(middle, y1 - turn, A, beta, gamma, n, work)
    v1 -= kick * (spring(y1, 0.0, offset, curve) + gain * (z1 - A * y1))
    end = F + slope * h
    taken = 0.5 * (z + middle) * (turn - y) + 0.5 * (middle + z1) * (y1 - turn)
    done, damped = 0.5 * h * (F * v + end * v1), 0.5 * h * damping * (v * v + v1 * v1)
    return y1, v1, z1, motion[3] + done, motion[4] + damped, motion[5] + gain * taken


# ---------------------------------------------------------------------------------- samples


@pasted
def sampled(move: Move, parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Displacement at the next sample, nan where the motion leaves the finite numbers."""
    if state[7] == 0.0:
        state[0], state[7] = u, 1.0
        return float(state[1])
    substeps, last = int(parameters[0]), parameters[4] * state[0]
    rise = 0.0 if parameters[1] > 0.0 else parameters[4] * u - last
    slope, h = rise / parameters[2], parameters[3]
    p, curve, work = parameters, parameters[N_HEAD:], state[N_FRONT:]
    plant = (p[5], p[6], p[7], p[8], p[9], p[10], p[11], p[12], p[13], p[14])
    motion = (state[1], state[2], state[3], state[4], state[5], state[6])
    for j in range(substeps):
        motion = move(motion, last + rise * j / substeps, slope, h, plant, curve, work)
    y, v, z, worked, damped, taken = motion
    state[0], state[1], state[2], state[3], state[4], state[5], state[6] = u, y, v, z, worked, damped, taken
    return y if math.isfinite(y + v + z + worked + damped + taken) else math.nan


@uncounted_kernel
def split_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    return sampled(split, parameters, state, u)


@uncounted_kernel
def runge_kutta_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    return sampled(runge_kutta, parameters, state, u)


@uncounted_kernel
def newmark_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    return sampled(newmark, parameters, state, u)


@uncounted_kernel
def strang_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    return sampled(strang, parameters, state, u)
