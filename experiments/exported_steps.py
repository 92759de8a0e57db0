"""Steps to be exported, with inputs on which they may go wrong, and what Python's compiled step makes of these.

A random case has 2 000 samples of three sines of random frequencies around a random walk, in the law's own scale. A
hostile case has one of the twelve inputs below, each for five more laws: 60 for each family. Where a law diverges, its
outputs are whatever the compiled step returns from there on.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from hostile_laws import DRAWS, Rng, decades, signed

import hysim as hs
from hysim.export import program_of
from hysim.export._program import entries
from hysim.kernels.controllers import replay
from hysim.kernels.stepping import drive
from hysim.models.compiled_step import startable
from hysim.models.protocols import Stepwise

Array = np.ndarray[Any, np.dtype[Any]]

SAMPLE_TIME = 1.0  # of whatever depends on time; the plants and controllers below are drawn for it
N_SAMPLES, N_HOSTILE_SAMPLES = 2000, 200
N_LAWS, N_HOSTILE_LAWS = 20, 5
SLOW, REACH = ("ZhuWangBoucWen", "GeneralizedBoucWen", "BoucWenBaberNoori", "Duhem"), 10.0
"""Families whose inverse takes seconds for one reference far away, and how far theirs are at most."""
MOST_SHAPES = 4  # kinds of parts that a sum or a cascade is made of: each is a program of its own


class Case(NamedTuple):
    """A step in C and its numbers, what it gets, and what Python's step returns.

    `source` is C99 text with a function `step`, and `start` where `has_start`; with sizes as arguments where
    `has_sizes`. `inputs` is one input, or reference and measurement, (n_inputs, n_samples).
    """

    family: str
    kind: str
    thing: Any
    source: str
    has_start: bool
    has_sizes: bool
    parameters: Array
    state: Array
    inputs: Array
    y: Array


# ---------------------------------------------------------------------------------- inputs


def wandering(rng: Rng, length: float, n: int) -> Array:
    """Three sines around a random walk."""
    k = np.arange(n)
    waves = [np.sin(2.0 * np.pi * k / rng.uniform(20.0, 500.0) + rng.uniform(0.0, 6.0)) for _ in range(3)]
    return length * decades(rng, -0.5, 0.5) * (np.sum(waves, axis=0) + np.cumsum(rng.normal(size=n)) / np.sqrt(n))


def _ulps(rng: Rng, length: float, n: int) -> Array:
    """Steps of one unit in the last place, up and down."""
    return length * (1.0 + np.spacing(1.0) * np.cumsum(rng.choice([-1.0, 1.0, 1.0], n)))


def _divergent(rng: Rng, length: float, n: int) -> Array:
    """Growing strokes, up to the largest doubles."""
    tenths = np.minimum(np.log10(length) + np.linspace(0.0, 320.0, n), 308.2)
    return 10.0**tenths * (-1.0) ** np.arange(n)


HOSTILE: dict[str, Callable[[Rng, float, int], Array]] = {
    "constant": lambda rng, length, n: np.full(n, length * rng.normal()),
    "zeros of both signs": lambda rng, length, n: np.copysign(np.zeros(n), rng.normal(size=n)),
    "huge": lambda rng, length, n: length * 10.0 ** rng.uniform(3.0, 12.0) * rng.normal(size=n),
    "largest": lambda rng, length, n: rng.choice([-1.7e308, 1.7e308, 0.0, length], n),
    "tiny": lambda rng, length, n: length * 1e-15 * np.cumsum(rng.normal(size=n)),
    "denormal": lambda rng, length, n: 5e-324 * rng.integers(-9, 10, n),
    "repeated": lambda rng, length, n: np.repeat(length * rng.normal(size=n // 4 + 1), 4)[:n],
    "alternating": lambda rng, length, n: length * decades(rng, -3.0, 1.5) * (-1.0) ** np.arange(n),
    "one last place": _ulps,
    "all magnitudes": lambda rng, length, n: length * 10.0 ** rng.uniform(-18.0, 3.0, n) * rng.choice([-1.0, 1.0], n),
    "jumps": lambda rng, length, n: length * np.where(rng.random(n) < 0.1, 1e6, 1.0) * rng.normal(size=n),
    "divergent": _divergent,
}


# ---------------------------------------------------------------------------------- what is exported


class Drawn(NamedTuple):
    """A thing, the scale of its input, the input around which it moves, and how far at most."""

    thing: Any
    length: float
    centre: float = 0.0
    reach: float = np.inf


Draw = Callable[[Rng], Drawn]


def _law(family: str) -> Draw:
    def drawn(rng: Rng) -> Drawn:
        return Drawn(*DRAWS[family](rng))

    return drawn


def _shape(rng: Rng, n: float | None = None) -> dict[str, float]:
    """A, beta, gamma and n of a Bouc-Wen law whose memory stays below 2 and moves at most as fast as the input."""
    exponent = float(rng.choice([1.0, 2.0, rng.uniform(1.1, 4.0)])) if n is None else n
    return {"beta": rng.uniform(0.3, 0.9), "gamma": rng.uniform(-0.2, 0.2), "n": exponent}


def _linear(rng: Rng) -> dict[str, Any]:
    """Gain and slope with which an output with such a memory rises everywhere."""
    return {"gain": 0.4 * signed(rng, rng.uniform(0.1, 1.0)), "input_coefficients": (rng.uniform(1.0, 3.0),)}


def _weights(rng: Rng) -> tuple[float, ...]:
    return (1.0, *rng.uniform(0.05, 0.5, 3).tolist())


def _duhem(rng: Rng) -> Any:
    terms = {"u'": 1.0, "u' |z|": -0.3 * rng.random(), "|u'| z": -rng.uniform(0.4, 0.9)}
    return hs.Duhem.from_terms(terms, feedthrough=rng.uniform(2.0, 3.0))


def _plays(rng: Rng) -> hs.PrandtlIshlinskii:
    return hs.PrandtlIshlinskii(thresholds=(0.0, *_thresholds(rng)), weights=_weights(rng), offset=rng.normal())


def _thresholds(rng: Rng) -> tuple[float, ...]:
    return tuple(np.cumsum(rng.uniform(0.05, 0.5, 3)).tolist())


def _plain(rng: Rng) -> hs.BoucWen:
    rest = _linear(rng)
    return hs.BoucWen(**_shape(rng), gain=rest["gain"], feedthrough=rest["input_coefficients"][0])


def _general(rng: Rng) -> hs.BoucWen:
    """An exponent of which the step has no closed form."""
    return replace(_plain(rng), n=rng.uniform(1.1, 1.9))


RISING: dict[str, Callable[[Rng], Any]] = {
    "BoucWen": _plain,
    "BoucWen, general exponent": _general,
    "PolynomialBoucWen": lambda rng: hs.PolynomialBoucWen(
        **_shape(rng), gain=0.3, input_coefficients=(rng.uniform(0.6, 2.0), 0.0, 0.02 * rng.random())
    ),
    "ZhuWangBoucWen": lambda rng: hs.ZhuWangBoucWen(
        **_shape(rng, n=rng.uniform(1.1, 2.0)), delta=0.02 * rng.random(), **_linear(rng)
    ),
    "GeneralizedBoucWen": lambda rng: hs.GeneralizedBoucWen(**_shape(rng), b3=0.1 * rng.random(), **_linear(rng)),
    "BoucWenBaberNoori": lambda rng: hs.BoucWenBaberNoori(
        **_shape(rng, n=1.0), delta_nu=0.02 * rng.random(), **_linear(rng)
    ),
    "Duhem": _duhem,
    "Dahl": lambda rng: hs.Dahl(stiffness=rng.uniform(0.5, 2.0), coulomb=rng.uniform(20.0, 40.0)),
    "ColemanHodgdon": lambda rng: hs.ColemanHodgdon(alpha=rng.uniform(0.3, 1.0), c=1.0, B=rng.uniform(0.6, 0.9)),
    "Line": lambda rng: hs.Line(offset=rng.normal(), slope=signed(rng, rng.uniform(0.5, 2.0))),
    "PrandtlIshlinskii": _plays,
    "ModifiedPrandtlIshlinskii": lambda rng: hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, *_thresholds(rng)), weights=_weights(rng), dead_zones=(-0.4, 0.0, 0.3),
        dead_zone_weights=(0.2 * rng.random(), 1.0, 0.4 * rng.random()),
    ),
    "GeneralizedPrandtlIshlinskii": lambda rng: hs.GeneralizedPrandtlIshlinskii(
        thresholds=(0.0, *_thresholds(rng)), weights=_weights(rng), left=(rng.random(), 1.0, 0.0, 0.0, 0.5)
    ),
    "RateDependentPrandtlIshlinskii": lambda rng: hs.RateDependentPrandtlIshlinskii(
        thresholds=(0.0, *_thresholds(rng)), weights=_weights(rng), beta=0.1 * rng.random()
    ),
    "ParametricPrandtlIshlinskii": lambda rng: hs.ParametricPrandtlIshlinskii(
        exponent=-0.5, decay=0.3, weight=0.4 * rng.random(), weight_slope=0.1, input_coefficients=(1.0, 0.0, 0.05),
        reach=2.0,
    ),
    "Tellinen": lambda rng: hs.Tellinen(
        saturation=rng.uniform(1.0, 3.0), coercivity=rng.uniform(0.2, 1.0), squareness=rng.uniform(0.2, 0.8),
        feedthrough=rng.uniform(0.3, 1.0),
    ),
    "Chan": lambda rng: hs.Chan(
        saturation=rng.uniform(1.0, 3.0), coercivity=rng.uniform(0.2, 1.0), squareness=rng.uniform(0.2, 0.8),
        feedthrough=rng.uniform(0.3, 1.0), gap=rng.uniform(0.0, 0.5),
    ),
    "EnergyPlays": lambda rng: hs.EnergyPlays(
        thresholds=(0.0, *_thresholds(rng)), weights=_weights(rng), field=1.0, feedthrough=rng.uniform(0.3, 1.0)
    ),
    "MaxwellSlip": lambda rng: hs.MaxwellSlip(stiffness=(1.0, rng.random()), slips=(50.0, 0.4)),
    "Preisach": lambda rng: hs.Preisach.from_density(
        np.linspace(-9.0, 9.0, 12), lambda a, b: 1.0 + 0.1 * (a - b)
    ),
    "Sum": lambda rng: hs.Sum(parts=(_plain(rng), _plays(rng))),
    "Cascade": lambda rng: hs.Cascade(stages=(_plain(rng), _plays(rng))),
}  # fmt: skip
"""Random laws whose output rises or falls with the input."""


def _inverse(family: str) -> Draw:
    """The feed-forward by the inverse of a law; its references begin where the law rests at the input zero."""

    def drawn(rng: Rng) -> Drawn:
        law = RISING[family](rng)
        reach = REACH if family in SLOW else np.inf
        return Drawn(hs.InverseFeedforward(law=law), 1.0, at_rest(law), reach)

    return drawn


def _transfer(rng: Rng) -> Drawn:
    """Two lags and a zero, of any hold, with a delay of some samples or none."""
    slow, fast = 10.0 ** rng.uniform(-1.0, 2.0, 2)
    num = (rng.normal() * slow, rng.normal())
    delay = float(rng.choice([0.0, rng.uniform(0.0, 5.0)]))
    return Drawn(
        hs.TransferFunction(num=num, den=(slow * fast, slow + fast, 1.0), delay=delay), decades(rng, -3.0, 3.0)
    )


def _dashpot(rng: Rng) -> Drawn:
    return Drawn(hs.Dashpot(c=decades(rng, -3.0, 3.0)), decades(rng, -3.0, 3.0))


_MODE = {"natural_frequency": 0.3, "damping_ratio": 0.05}


def _actuator(rng: Rng) -> Drawn:
    """A law behind an amplifier, with creep, a resonance and a sensor."""
    law = hs.BoucWen(beta=rng.uniform(0.1, 0.9), gamma=rng.uniform(-0.1, 0.1), feedthrough=2.0, gain=-rng.random())
    amplifier = hs.Amplifier(gain=rng.uniform(0.5, 2.0), offset=rng.normal(), limits=(-4.0, 4.0))
    creep, mode = hs.Creep.per_decade(5.0 * rng.random()), hs.mode(**_MODE)
    sensor = hs.Sensor(delay=float(rng.choice([0.0, 1.0])))
    return Drawn(hs.Actuator(amplifier=amplifier, hysteresis=law, creep=creep, vibration=mode, sensor=sensor), 1.0)


def _pid(rng: Rng) -> Drawn:
    gains = {"kp": decades(rng, -2.0, 1.0), "ki": decades(rng, -3.0, 0.0), "kd": decades(rng, -2.0, 1.0)}
    return Drawn(hs.PID(**gains, derivative_filter=3.0, limits=(-2.0, 3.0), setpoint_weight=0.7), 1.0)


def _tracking(rng: Rng) -> Drawn:
    """A feed-forward by an inverse, a PID on the model's error, and filters."""
    law = hs.BoucWen(beta=rng.uniform(0.1, 0.9), feedthrough=2.0, gain=-rng.random())
    plant = hs.Actuator(hysteresis=law, vibration=hs.mode(**_MODE), sensor=hs.Sensor(delay=1.0))
    controller = hs.TrackingController(
        shaper=hs.Shaper.zvd(*_MODE.values()),
        feedforward=hs.InverseFeedforward(law=law),
        feedback=hs.PID(kp=0.1 * rng.random(), ki=0.1 * rng.random()),
        notch=hs.Notch(**_MODE),
        model=plant,
        limits=(-2.0, 3.0),
    )
    return Drawn(controller, 1.0)


def at_rest(law: Any) -> float:
    """The output at the input zero."""
    time = {"sample_time": SAMPLE_TIME} if isinstance(law, hs.RateDependentPrandtlIshlinskii) else {}
    step, parameters, state = law.compiled(0.0, **time)
    return float(step(parameters, state, 0.0))


THINGS: dict[str, Draw] = {
    **{family: _law(family) for family in DRAWS if family != "SingleValued"},  # a curve, which is not stepped
    **{f"inverse of {family}": _inverse(family) for family in RISING},
    "TransferFunction": _transfer,
    "Dashpot": _dashpot,
    "Actuator": _actuator,
    "PID": _pid,
    "TrackingController": _tracking,
}
"""What draws a thing of each family, and the scale of its input."""


# ---------------------------------------------------------------------------------- cases


def shape(thing: Any) -> tuple[Any, ...]:
    """What decides which program a sum or a cascade is."""
    if isinstance(thing, hs.InverseFeedforward):
        return shape(thing.law)
    if isinstance(thing, hs.Sum | hs.Cascade):
        return tuple(each for part in thing.members for each in shape(part))
    n = thing.n if isinstance(thing, hs.BoucWen | hs.PolynomialBoucWen | hs.GeneralizedBoucWen) else 1.0
    return (type(thing).__name__, n if n in (1.0, 2.0) else "n")


def drawn(family: str, rng: Rng, n_laws: int) -> Iterator[Drawn]:
    """Random things of a family, of at most `MOST_SHAPES` shapes."""
    shapes: set[tuple[Any, ...]] = set()
    while n_laws:
        each = THINGS[family](rng)
        own = shape(each.thing)
        if own in shapes or len(shapes) < MOST_SHAPES:
            shapes.add(own)
            n_laws -= 1
            yield each


def cases(family: str, seed: int, n_laws: int = N_LAWS, n_hostile_laws: int = N_HOSTILE_LAWS) -> Iterator[Case]:
    """Random and hostile cases of a family."""
    rng = np.random.default_rng(seed)
    for k, each in enumerate(drawn(family, rng, n_laws + n_hostile_laws)):
        if k < n_laws:
            yield case(family, "random", each.thing, paths(each, rng, wandering, N_SAMPLES))
        else:
            for name, path in HOSTILE.items():
                yield case(family, name, each.thing, paths(each, rng, path, N_HOSTILE_SAMPLES))


def paths(of: Drawn, rng: Rng, path: Callable[[Rng, float, int], Array], n: int) -> Array:
    """The input, or a reference and a measurement."""
    count = 2 - isinstance(of.thing, Stepwise)
    return np.stack([of.centre + np.clip(path(rng, of.length, n), -of.reach, of.reach) for _ in range(count)])


_entries = cache(entries)


def case(family: str, kind: str, thing: Any, inputs: Array) -> Case:
    """The thing as a program, and its outputs in Python."""
    if len(inputs) == 2:
        program = program_of(thing, SAMPLE_TIME)
        step, parameters, state = thing.initial(SAMPLE_TIME)
        command, u = np.empty((1, inputs.shape[1])), np.empty(inputs.shape[1])
        replay(step, parameters, state, inputs[0], inputs[1], command, u)
        return Case(family, kind, thing, program.source, False, False, program.parameters, program.state, inputs, u)
    model = startable(thing, SAMPLE_TIME)
    source, has_start = _entries(model.step, model.start)
    law = model.started(float(inputs[0, 0]))
    y = everything(law.step, law.parameters, law.state, inputs[0])
    return Case(family, kind, thing, source, has_start, True, model.parameters, model.state, inputs, y)


def everything(step: Any, parameters: Array, state: Array, u: Array) -> Array:
    """Outputs at all samples, also behind those that are not finite."""
    y, first = np.empty(u.size), 0
    with np.errstate(all="ignore"):
        while (lost := drive(step, parameters, state, u[first:], y[first:])) >= 0:
            first += lost + 1
            if first == u.size:
                break
    return y
