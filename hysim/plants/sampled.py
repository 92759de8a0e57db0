"""Linear stages after a law, stepped from sub-step to sub-step.

    x' = F x + g v,    y = C x + D v

v, which is delayed, is held over a sub-step or linear along it. A dead time of d sub-steps and a part of one
cuts each sub-step in two, at which the older values give way to newer ones; both pieces are exact
(`hysim.kernels.linear`). The equations that are stepped are those of `hysim.kernels.loop`.

Stages one behind the other are one stage: the output C1 x1 + D1 v of the first is the input of the second.
The states of the creep, which comes first, do not look at each other or at those behind them.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import matrix_balance

from hysim._basics.frozen import FloatArray, read_only
from hysim.plants._linear_response import Transition, scaled_companion, transitions
from hysim.plants.stages import Creep
from hysim.plants.transfer_function import Modes, StateSpace, TransferFunction, resting_states

_WHOLE = 1e-6  # of a sub-step: a delay this close to a whole number of them is one


Vibration = TransferFunction | StateSpace | Modes
"""Linear dynamics behind the law."""


class Stage(NamedTuple):
    """x' = rate (F x + g v), y = C x + D v; `rest` is x under a constant input of one."""

    F: FloatArray
    g: FloatArray
    C: FloatArray
    D: float
    rest: FloatArray
    rate: float = 1.0

    @property
    def dc_gain(self) -> float:
        return float(self.C @ self.rest) + self.D

    def then(self, other: Self) -> "Stage":
        """This stage and another after it, in the time unit of the other."""
        n, m = self.g.size, other.g.size
        slower = self.rate / other.rate
        F = np.zeros((n + m, n + m))
        F[:n, :n], F[n:, :n], F[n:, n:] = slower * self.F, np.outer(other.g, self.C), other.F
        with np.errstate(invalid="ignore"):
            rest = np.concatenate([self.rest, other.rest * self.dc_gain])
        return Stage(
            F,
            np.concatenate([slower * self.g, other.g * self.D]),
            np.concatenate([other.D * self.C, other.C]),
            other.D * self.D,
            rest,
            other.rate,
        )


class SampledStage(NamedTuple):
    """The matrices of `hysim.kernels.loop` for one sub-step; `rest` is the state under a constant input of one."""

    decline: FloatArray
    A: FloatArray
    B: FloatArray
    output: FloatArray
    lag: int
    rest: FloatArray


def gain(value: float) -> Stage:
    """A stage without states."""
    nothing = np.zeros(0)
    return Stage(np.zeros((0, 0)), nothing, nothing, value, nothing)


def low_pass(time_constant: float) -> Stage:
    """1 / (time_constant s + 1)."""
    one = np.ones(1)
    return Stage(np.array([[-1.0 / time_constant]]), one / time_constant, one, 0.0, one)


def creep_stage(creep: Creep) -> Stage:
    """The elements side by side, each the response of its spring and damper to a force of one."""
    rates = 1.0 / np.array(creep.time_constants)
    return Stage(-np.diag(rates), rates, np.array(creep.weights), creep.instant_gain, np.ones(rates.size))


def vibration_stage(plant: Vibration, sample_time: float) -> Stage:
    """The states of a plant, in a time unit or in units of the states in which no entry is large."""
    if isinstance(plant, TransferFunction):
        return _companion(plant, sample_time)
    system = plant.state_space if isinstance(plant, Modes) else plant
    if not system.B.size:
        return gain(system.D)
    F, (units, _) = matrix_balance(system.A, permute=False, separate=True)
    g, C = system.B / units, system.C * units
    return Stage(F, g, C, system.D, resting_states(F, g))


def _companion(plant: TransferFunction, sample_time: float) -> Stage:
    """The controllability form x_j = s^j / den(s) v, in a time unit that makes den's coefficients at most one."""
    n = plant.order
    numerator = np.concatenate([np.zeros(n + 1 - len(plant.num)), plant.num]) / plant.den[0]
    monic = np.array(plant.den[1:]) / plant.den[0]
    F, rate, scaled = scaled_companion(monic[np.newaxis], sample_time)
    if not np.isfinite(F).all():
        raise ValueError(
            f"the rates of a plant sampled at {sample_time:g} s cannot be computed: check the time and den"
        )
    back = rate[0] ** -np.arange(1.0, n + 1)
    with np.errstate(divide="ignore"):
        rest = np.concatenate([1.0 / scaled[0, -1:], np.zeros(max(n - 1, 0))])[:n]
    C = ((numerator[1:] - numerator[0] * monic) * back)[::-1]
    return Stage(F[0], np.eye(n, 1, 1 - n)[:, 0], C, float(numerator[0]), rest, float(rate[0, 0]))


def sampled(stage: Stage, step: float, delay: float = 0.0, *, creeping: int = 0, linear: bool = False) -> SampledStage:
    """The exact discrete form of a stage for sub-steps of the length `step` [s]; its rest may be infinite or nan.

    The input has a dead time `delay` [s], and is held over a sub-step or `linear` along it. The first `creeping` states
    do not depend on others.
    """
    lag, part = whole_and_part(delay / step)
    with np.errstate(all="ignore"):
        carried, B, through = _transition(stage, step, part, 1.0, linear)
    if not (np.isfinite(carried).all() and np.isfinite(B).all()):
        raise ValueError(
            f"the motion of the plant within {step:g} s is beyond the largest number: check the sample time"
        )
    return SampledStage(
        decline=read_only(np.expm1(np.diag(stage.F)[:creeping] * (stage.rate * step))),
        A=read_only(carried[creeping:]),
        B=read_only(B),
        output=read_only([0.0, stage.D * through[0], stage.D * through[1], *stage.C]),
        lag=lag,
        rest=stage.rest,
    )


def seen_within(stage: Stage, step: float, delay: float, at: float, *, linear: bool = False) -> FloatArray:
    """As `SampledStage.output`, of the displacement at the part `at` of a sub-step, from the states at its begin."""
    _, part = whole_and_part(delay / step)
    carried, B, through = _transition(stage, step, part, at, linear)
    return read_only([*(stage.C @ B.T + stage.D * through), *(stage.C @ carried)])


def whole_and_part(ratio: float) -> tuple[int, float]:
    """A number as a whole one and a part of one, the part zero where only rounding keeps it from zero."""
    nearest = round(ratio)
    if abs(ratio - nearest) <= _WHOLE:
        return nearest, 0.0
    return math.floor(ratio), ratio % 1.0


def _transition(stage: Stage, step: float, part: float, at: float, linear: bool) -> Transition:
    """The states at the part `at` of a sub-step, as matrices of those at its begin and of the three inputs."""
    early, late = min(at, part), max(at - part, 0.0)
    (first, second), begins, ends = (
        stack[0] for stack in transitions(stage.F[np.newaxis], stage.rate * step * np.array([[early, late]]), stage.g)
    )
    pieces = _linear_pieces(part, early, late) if linear else _HELD
    B = np.zeros((3, stage.g.size))
    for row, (begin, middle, turn, end) in enumerate(zip(*pieces, strict=True)):
        if begin or middle:
            B[row] = second @ (begin * begins[0] + middle * ends[0])
        B[row] += turn * begins[1] + end * ends[1]
    return second @ first, B, np.array(pieces[3 if late else 1])


_HELD = ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def _linear_pieces(part: float, early: float, late: float) -> tuple[tuple[float, float, float], ...]:
    """Input at the begin and the end of both pieces, as weights of the newer, the older and the oldest value."""
    return (
        (0.0, 1.0 - part, part),
        (0.0, 1.0 - part + early, part - early),
        (0.0, 1.0, 0.0),
        (late, 1.0 - late, 0.0),
    )
