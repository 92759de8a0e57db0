"""Chan's law along an input, exactly: branches of one curve, translated to where the input has turned.

With f(x) = x / (|x| + knee), in units of the saturation,

    lower(h) = f(h - coercivity)          upper(h) = f(h + coercivity)          width = upper - lower
    rising     m = min(lower + r, upper)  falling    m = max(upper - r, lower)

where r is the distance from the branch at which the stroke has begun. The width falls on either side of h = 0, so that
after a stroke from h1 to h2 the distance is min(r, width(h2)), whatever lies between. Before the first turn a field
that moves away from zero keeps its place z between the branches, which for z = 0 is the initial curve. Behind an air
gap the field in the core is less than the input by what the flux drops in the gap,

    h + gap y = u,    y = feedthrough h + saturation m

which is a quadratic equation for h on either branch.

`parameters` is (offset, saturation, feedthrough, gap, coercivity, knee), `state` (u, z, h, turn): z is the place
between the branches from -1 to 1; the turn is 1 + r with the sign of the stroke, 1/2 of this sign on the initial
curve, and zero before the first stroke.
"""

import math

from hysim._frozen import FloatArray
from hysim.kernels._compile import inlined, inner, signed_kernel
from hysim.kernels.stepping import STEP

_INITIAL = 0.5
_HALVINGS = 200


@inlined
def curve(x: float, knee: float) -> float:
    """The curve from -1 to 1 of which both branches are."""
    return float(x / (abs(x) + knee))


@inlined
def width(h: float, coercivity: float, knee: float) -> float:
    """Distance of the branches at the field `h`, without cancellation."""
    far, near = abs(h) + coercivity, abs(h) - coercivity
    if near < 0.0:
        return far / (far + knee) - near / (knee - near)
    return (far - near) / (far + knee) * (knee / (near + knee))


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
def inside(h: float, z: float, coercivity: float, knee: float) -> float:
    """Magnetisation at the place z between the branches."""
    return float(curve(h - coercivity, knee) + (0.5 + 0.5 * z) * width(h, coercivity, knee))


@inlined
def magnetisation(state: FloatArray, coercivity: float, knee: float) -> float:
    """Magnetisation in units of the saturation in a state."""
    if abs(state[3]) < 1.0:
        return float(inside(state[2], state[1], coercivity, knee))
    direction = math.copysign(1.0, state[3])
    return float(direction * (curve(direction * state[2] - coercivity, knee) + (abs(state[3]) - 1.0)))


@inner
def field_inside(parameters: FloatArray, z: float, u: float) -> float:
    """Field in the core at the place z between the branches, by bisection."""
    gap, coercivity, knee = parameters[3], parameters[4], parameters[5]
    stiffness, drop = 1.0 + gap * parameters[2], gap * parameters[1]
    low, high = (u - drop) / stiffness, (u + drop) / stiffness
    for _ in range(_HALVINGS):
        h = 0.5 * (low + high)
        if h in (low, high):
            break
        if stiffness * h + drop * inside(h, z, coercivity, knee) < u:
            low = h
        else:
            high = h
    return float(high)


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
def follow(parameters: FloatArray, state: FloatArray, direction: float, ahead: float) -> None:
    """Move along a translated branch, or along the other one where that is nearer, to the input `ahead`.

    `ahead` and the field are counted in the direction of the stroke.
    """
    gap, coercivity, knee = parameters[3], parameters[4], parameters[5]
    stiffness, drop = 1.0 + gap * parameters[2], gap * parameters[1]
    distance = distance_to(state, direction, coercivity, knee)
    h = abscissa(ahead - stiffness * coercivity - drop * distance, knee, stiffness, drop) + coercivity
    between = width(h, coercivity, knee)
    if distance > between:
        h = abscissa(ahead + stiffness * coercivity, knee, stiffness, drop) - coercivity
        between = width(h, coercivity, knee)
        distance = between
    if drop == 0.0:
        h = ahead / stiffness
    state[1] = direction * (2.0 * (distance / between) - 1.0) if between > 0.0 else direction
    state[2] = direction * h
    state[3] = direction * (1.0 + distance)


@signed_kernel(STEP.signature)
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state` moves along."""
    coercivity, knee = parameters[4], parameters[5]
    if state[3] == 0.0:
        state[2] = field_inside(parameters, state[1], state[0])
    if u != state[0]:
        direction = 1.0 if u > state[0] else -1.0
        if state[3] == 0.0 and direction * state[2] >= 0.0:
            state[3] = direction * _INITIAL
        if abs(state[3]) < 1.0 and direction * state[3] > 0.0:
            state[2] = field_inside(parameters, state[1], u)
        else:
            follow(parameters, state, direction, direction * u)
        state[0] = u
    m = magnetisation(state, coercivity, knee)
    return float(parameters[0] + parameters[2] * state[2] + parameters[1] * m)
