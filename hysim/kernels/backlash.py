"""A gap in series with a flexible shaft, or with a spring and a damper, along an even stroke.

    T = k x + c x',    x = u - b,    |b| <= a

u is the twist between the two sides, b the part of it that the gap takes, x the twist of the shaft. In the gap the
shaft carries no torque and its twist decays, x' = -(k / c) x. At a side of the gap b rests as long as the torque
pushes it there. Along an even stroke both are closed forms; where the gap has been crossed follows from Newton's method
on u - x exp(-k t / c), which is monotone on either side of its one turn, from the end where it converges from one side.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner, signed_kernel
from hysim.kernels.friction_rates import moved_on
from hysim.kernels.stepping import STEP

_MOST_PHASES = 8  # of a stroke: contact, gap, contact, gap, contact is the longest course
_MOST_STEPS = 60  # of Newton's method, which converges quadratically
_ROUNDING = 4.0e-16


@inner
def arrival(u: float, rate: float, x: float, time: float, side: float, begin: float, end: float) -> float:
    """Moment between `begin` and `end` at which u + rate t - x exp(-t / time) is at `side`; it is monotone there.

    Newton's method starts at the end of the interval from which the bend of the curve cannot throw it past the root.
    """
    beyond = u + rate * end - x * math.exp(-end / time) - side
    t = end if beyond * x < 0.0 else begin
    for _ in range(_MOST_STEPS):
        carried = x * math.exp(-t / time)
        slope = rate + carried / time
        target = t - (u + rate * t - carried - side) / slope if slope != 0.0 else t
        target = min(max(target, begin), end)
        if abs(target - t) <= _ROUNDING * end:
            break
        t = target
    return t


@inner
def crossing(u: float, rate: float, x: float, time: float, gap: float, duration: float) -> float:
    """Moment at which a side of the gap is reached, or the duration of the stroke."""
    begin = 0.0
    if x * rate < 0.0 and abs(x) > time * abs(rate):
        turn = min(duration, time * math.log(abs(x) / (time * abs(rate))))
        side = math.copysign(gap, x)
        if (u + rate * turn - x * math.exp(-turn / time)) * x >= side * x:
            return arrival(u, rate, x, time, side, begin, turn)
        begin = turn
    towards = rate if rate != 0.0 else x
    side = math.copysign(gap, towards)
    if begin < duration and (u + rate * duration - x * math.exp(-duration / time)) * towards > side * towards:
        return arrival(u, rate, x, time, side, begin, duration)
    return duration


@inner
def gap_part(u: float, rise: float, b: float, duration: float, time: float, gap: float) -> float:
    """The part of the input that the gap takes, `b` before, after an even stroke from `u`; `time` is c / k."""
    if gap == 0.0 or duration == 0.0:
        return b
    if time <= _ROUNDING * duration or math.isinf(duration):
        return min(max(u + rise, -gap), gap)
    rate, remaining = rise / duration, duration
    for _ in range(_MOST_PHASES):
        x = u - b
        load = x + time * rate
        side = 1.0 if b >= gap else -1.0
        if abs(b) >= gap and side * load >= 0.0:
            contact = -load / rate if side * rate < 0.0 else remaining
            if contact >= remaining:
                return b
            u, remaining, x = u + rate * contact, remaining - contact, -time * rate
        moment = crossing(u, rate, x, time, gap, remaining)
        u, x = u + rate * moment, x * math.exp(-moment / time)
        b = min(max(u - x, -gap), gap)
        if moment >= remaining:
            return b
        b, remaining = math.copysign(gap, b), remaining - moment
    return b


@inlined
def torque(x: float, rate: float, b: float, stiffness: float, damping: float, gap: float) -> float:
    """Torque of the shaft: zero in the gap, and neither side pulls the other."""
    load = stiffness * x + damping * rate
    if (b >= gap and load > 0.0) or (b <= -gap and load < 0.0):
        return load
    return 0.0


@inlined
def begun(parameters: FloatArray, state: FloatArray, first: int) -> float:
    """The part of the gap before a stroke: at rest at the last input before the first one."""
    if state[first + 1] == 0.0:
        state[first + 1] = 1.0
        return float(min(max(state[0] - parameters[4], -parameters[3]), parameters[3]))
    return float(state[first])


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Torque after an even stroke; `state` is (last u, part of the gap, 1 after the first step).

    `parameters` are sample_time, stiffness, damping, half_gap, center and offset.
    """
    duration, stiffness, damping, gap = parameters[0], parameters[1], parameters[2], parameters[3]
    before, rise = begun(parameters, state, 1), u - state[0]
    after = gap_part(state[0] - parameters[4], rise, before, duration, damping / stiffness, gap)
    state[0] = u
    state[1] = after
    return float(parameters[5] + torque(u - parameters[4] - after, rise / duration, after, stiffness, damping, gap))


@signed_kernel(STEP.signature)
def rated_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Torque after a stroke of an element, along which the gap's part moves as along an even one; see `rates`."""
    stiffness, damping, gap = parameters[1], parameters[2], parameters[3]
    before, rise = begun(parameters, state, 4), u - state[0]
    after = gap_part(state[0] - parameters[4], rise, before, state[1], damping / stiffness, gap)
    moved_on(state, u)
    state[4] = after
    return float(parameters[5] + torque(u - parameters[4] - after, state[2], after, stiffness, damping, gap))
