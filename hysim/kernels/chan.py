"""Chan's law along an input, exactly: branches of one curve, translated to where the input has turned.

With f(x) = x / (|x| + knee), in units of the saturation,

    lower(h) = f(h - coercivity)          upper(h) = f(h + coercivity)          width = upper - lower
    rising     m = min(lower + r, upper)  falling    m = max(upper - r, lower)

where r is the distance from the branch at which the stroke has begun. The width falls on either side of h = 0, so that
after a stroke from h1 to h2 the distance is min(r, width(h2)), whatever lies between. Before the first turn a field
that moves away from zero keeps its place z between the branches, which for z = 0 is the initial curve. Behind an air
gap the field in the core is less than the input by what the flux drops in the gap,

    h + gap y = u,    y = feedthrough h + saturation m

which is quadratic in h on either branch. Where a branch is steep and the gap wide, the field's distance from the
branch's centre is known far better than the field, whose rounding the slope multiplies: it is kept beside the field.

`parameters` is (offset, saturation, feedthrough, gap, coercivity, knee), `state` (u, z, excess, turn, h): z is the
place between the branches from -1 to 1; the excess is |h| less the coercivity; the turn is 1 + r with the sign of the
stroke, 1/2 of this sign on the initial curve, and zero before the first stroke.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import inlined, inner, signed_kernel
from hysim.kernels.stepping import STEP

_INITIAL = 0.5
_HALVINGS = 200


@inlined
def curve(x: float, knee: float) -> float:
    """The curve from -1 to 1 that both branches follow."""
    return float(x / (abs(x) + knee))


@inlined
def width(excess: float, coercivity: float, knee: float) -> float:
    """Distance of the branches at the field with this excess, without cancellation."""
    far, near = excess + 2.0 * coercivity, excess
    if near < 0.0:
        return far / (far + knee) - near / (knee - near)
    return (far - near) / (far + knee) * (knee / (near + knee))


@inlined
def lower(side: float, excess: float, coercivity: float, knee: float) -> float:
    """The lower branch at a field on this side of zero, with this excess."""
    return float(curve(excess if side > 0.0 else -(excess + 2.0 * coercivity), knee))


@inlined
def abscissa(v: float, knee: float, stiffness: float, drop: float) -> float:
    """Solution x of ``stiffness x + drop curve(x) = v``; `stiffness` is positive, `drop` not negative."""
    if drop == 0.0:
        return v / stiffness
    size = abs(v)
    b = stiffness * knee + drop - size
    root = math.hypot(b, 2.0 * math.sqrt(stiffness * knee * size))
    x = 2.0 * size * knee / (b + root) if b > 0.0 else (root - b) / (2.0 * stiffness)
    return math.copysign(x, v)


@inlined
def inside(side: float, excess: float, z: float, coercivity: float, knee: float) -> float:
    """Magnetisation at the place z between the branches."""
    return float(lower(side, excess, coercivity, knee) + (0.5 + 0.5 * z) * width(excess, coercivity, knee))


@inlined
def magnetisation(state: FloatArray, coercivity: float, knee: float) -> float:
    """Magnetisation in units of the saturation in a state."""
    side = math.copysign(1.0, state[4])
    if abs(state[3]) < 1.0:
        return float(inside(side, state[2], state[1], coercivity, knee))
    direction = math.copysign(1.0, state[3])
    return float(direction * (lower(direction * side, state[2], coercivity, knee) + (abs(state[3]) - 1.0)))


@inner
def excess_inside(parameters: FloatArray, side: float, z: float, u: float) -> float:
    """Excess of the field in the core at the place z between the branches, on this side of zero, by bisection."""
    gap, coercivity, knee = parameters[3], parameters[4], parameters[5]
    stiffness, drop = 1.0 + gap * parameters[2], gap * parameters[1]
    low, high = -coercivity, (side * u + drop) / stiffness - coercivity
    for _ in range(_HALVINGS):
        excess = 0.5 * (low + high)
        if excess in (low, high):
            break
        if stiffness * (coercivity + excess) + side * drop * inside(side, excess, z, coercivity, knee) < side * u:
            low = excess
        else:
            high = excess
    return float(high)


@inlined
def stay(parameters: FloatArray, state: FloatArray, u: float) -> None:
    """Move to the input `u` at the same place between the branches."""
    gap, z, coercivity, knee = parameters[3], state[1], parameters[4], parameters[5]
    drop = gap * parameters[1]
    if drop == 0.0:
        state[4] = u / (1.0 + gap * parameters[2])
        state[2] = abs(state[4]) - coercivity
        return
    side = 1.0 if u >= drop * inside(1.0, -coercivity, z, coercivity, knee) else -1.0
    state[2] = excess_inside(parameters, side, z, u)
    state[4] = side * (coercivity + state[2])


@inlined
def distance_to(state: FloatArray, direction: float, coercivity: float, knee: float) -> float:
    """Distance from the branch along which a stroke in this direction goes."""
    between = width(state[2], coercivity, knee)
    if abs(state[3]) < 1.0:
        return float((0.5 + 0.5 * direction * state[1]) * between)
    distance = abs(state[3]) - 1.0
    if direction != math.copysign(1.0, state[3]):
        distance = max(between - distance, 0.0)
    return float(distance)


@inlined
def excess_of(h: float, far: float, near: float) -> float:
    """Excess at a field `h` that is known to be `far` above -coercivity, and `near` above the coercivity."""
    return near if h >= 0.0 else -far


@inlined
def follow(parameters: FloatArray, state: FloatArray, direction: float, ahead: float) -> None:
    """Move along a translated branch, or along the other one where that is nearer, to the input `ahead`.

    `ahead` and the field are counted in the direction of the stroke.
    """
    gap, coercivity, knee = parameters[3], parameters[4], parameters[5]
    stiffness, drop = 1.0 + gap * parameters[2], gap * parameters[1]
    distance = distance_to(state, direction, coercivity, knee)
    x = abscissa(ahead - stiffness * coercivity - drop * distance, knee, stiffness, drop)
    h = x + coercivity
    excess = excess_of(h, x + 2.0 * coercivity, x)
    between = width(excess, coercivity, knee)
    if distance > between:
        x = abscissa(ahead + stiffness * coercivity, knee, stiffness, drop)
        h = x - coercivity
        excess = excess_of(h, x, x - 2.0 * coercivity)
        between = width(excess, coercivity, knee)
        distance = between
    if drop == 0.0:
        h = ahead / stiffness
        excess = abs(h) - coercivity
    state[1] = direction * (2.0 * (distance / between) - 1.0) if between > 0.0 else direction
    state[2] = excess
    state[3] = direction * (1.0 + distance)
    state[4] = direction * h


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    coercivity, knee = parameters[4], parameters[5]
    if state[3] == 0.0:
        stay(parameters, state, state[0])
    if u != state[0]:
        direction = 1.0 if u > state[0] else -1.0
        if state[3] == 0.0 and direction * state[4] >= 0.0:
            state[3] = direction * _INITIAL
        if abs(state[3]) < 1.0 and direction * state[3] > 0.0:
            stay(parameters, state, u)
        else:
            follow(parameters, state, direction, direction * u)
        state[0] = u
    m = magnetisation(state, coercivity, knee)
    return float(parameters[0] + parameters[2] * state[4] + parameters[1] * m)
