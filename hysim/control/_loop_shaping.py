"""Feedback by norms: python-control's H-infinity synthesis for the line that stands for a law, checked on a family.

In the plane of w = 2 (z - 1) / (h (z + 1)), which keeps norms, the controller minimises that from the reference r and
a disturbance d of the command to W e and effort u, with e = r - G (u + d) and W = (w / M + b) / (w + b / 1000). Without
d it would cancel the resonance. Source: K. Zhou and J. C. Doyle, Essentials of Robust Control (1998), chapter 9.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import schur
from scipy.signal import cont2discrete

from hysim._basics.frozen import FloatArray, Interval, check_positive, read_only
from hysim.control._controller import Feedback, SampledController
from hysim.control._loop import as_actuator, inverted, secant_gain, slopes
from hysim.control._stability import LinearLoop
from hysim.kernels import controllers as kernels
from hysim.models.model import family
from hysim.models.protocols import CompiledController, positive_time
from hysim.plants.transfer_function import StateSpace
from hysim.signals import triangle

_FAST = 50.0  # of 1 / sample_time: poles of the controller beyond have settled
_SLOW = 1e-3  # error at rest, in units of the reference
_CYCLE = 2000  # samples of the stroke along which slopes are taken


@family
class LinearController(SampledController):
    """Linear controller of the error, sampled by the bilinear transform; a limit does not stop its states.

    Parameters
    ----------
    system : StateSpace
        From the error to the command, continuous; ValueError if it has a dead time.
    limits : (float, float), optional
        Lowest and highest command; None for none [unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> integral = hs.control.LinearController(system=hs.StateSpace(A=[[0.0]], B=[1.0], C=[4.0]))
    >>> u, state = integral.step(integral.initial(sample_time=0.5), reference=1.0, measurement=0.0)
    >>> u, integral.step(state, 1.0, 0.0)[0]
    (1.0, 3.0)
    """

    system: StateSpace
    limits: Interval | None = None

    def __post_init__(self) -> None:
        if self.system.delay:
            raise ValueError("system must have no dead time: model it in the sensor of the plant")

    def _discrete(self, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        system = self.system
        parts = system.A, system.B[:, np.newaxis], system.C[np.newaxis], [[system.D]]
        A, B, C, D, _ = cont2discrete(parts, positive_time(sample_time), method="bilinear")
        return A, B[:, 0], C[0], float(D[0, 0])

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        A, B, C, D = self._discrete(sample_time)
        head = [u0, *(self.limits or (-math.inf, math.inf)), D]
        parameters = read_only(np.concatenate([head, C, B, A.ravel()]), finite=False)
        return CompiledController(kernels.linear, parameters, np.append(u0, np.zeros(2 * B.size)))

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        w = np.asarray(2j / sample_time * np.tan(0.5 * np.asarray(frequency, dtype=float) * sample_time))
        system = self.system
        states = np.linalg.solve(w[..., None, None] * np.eye(system.B.size) - system.A, system.B[:, np.newaxis])
        return np.asarray((system.C @ states)[..., 0] + system.D)

    def linear(self, sample_time: float) -> Feedback:
        A, B, C, D = self._discrete(sample_time)
        return Feedback(A, -B, C, -D)


class LoopShaping(NamedTuple):
    """A controller, the norm that it reaches, and its largest sensitivity over slopes and plants."""

    controller: LinearController
    norm: float
    max_sensitivity: float


def loop_shaping(
    plant: Any,
    sample_time: float,
    stroke: tuple[float, float],
    *,
    bandwidth: float,
    max_sensitivity: float = 2.0,
    effort: float = 0.05,
    disturbance: float = 1.0,
    variations: Sequence[Any] = (),
    limits: tuple[float, float] | None = None,
) -> LoopShaping:
    """Design a feedback by python-control's `hinfsyn`, for a law's mean slope; ImportError without slycot.

    Parameters
    ----------
    plant, sample_time : Actuator, law, linear plant or fit, and float
        What it controls, and its sample time [s].
    stroke : (float, float)
        Lowest and highest reference, along which slopes are taken [unit of y].
    bandwidth, max_sensitivity : float
        Up to which errors are to be small [rad/s], and M, the sensitivity that is accepted beyond.
    effort, disturbance : float
        Weight of the command, times the plant's gain, against that of errors, and part of the plant's output range that
        a disturbance of the command causes.
    variations : sequence of plants
        On which the controller is checked too.
    limits : (float, float), optional
        Lowest and highest command [unit of u].

    Returns
    -------
    LoopShaping
        Its largest sensitivity is infinite where a slope or a plant is unstable: ask for less bandwidth.
    """
    import control

    check_positive(bandwidth=bandwidth, max_sensitivity=max_sensitivity, effort=effort, disturbance=disturbance)
    if not control.slycot_check():
        raise ImportError("loop_shaping needs slycot: pip install 'hysim[synthesis]'")
    cycle, actuator = triangle(*stroke, cycles=1, samples_per_cycle=_CYCLE), as_actuator(plant)
    gain = secant_gain(actuator, cycle)
    along = slopes(actuator, inverted(actuator, cycle, gain))
    loops = [LinearLoop(each, positive_time(sample_time)) for each in (plant, *variations)]
    A, B, C, D = _in_w(loops[0].system, 1.0 / actuator.dc_gain, sample_time)
    n, b = B.size, bandwidth
    # inputs are the reference, the disturbance and the command; outputs the weighted error, the effort and the error
    through = np.array([1.0, -disturbance * D, -D])
    inputs = np.vstack([np.outer(B, [0.0, disturbance, 1.0]), through])
    error, lag = np.append(-C, 0.0), b * _SLOW * np.eye(1, n + 1, n)
    states = np.vstack([np.pad(A, ((0, 0), (0, 1))), error - lag])
    weighted = error / max_sensitivity + (b - b * _SLOW / max_sensitivity) * np.eye(1, n + 1, n)[0]
    outputs = np.stack([weighted, np.zeros(n + 1), error])
    direct = np.stack([through / max_sensitivity, [0.0, 0.0, effort], through])
    K, _, norm, _ = control.hinfsyn(control.ss(states, inputs, outputs, direct), 1, 1)
    controller = LinearController(system=_without_fast_states(K, 1.0 / gain, _FAST / sample_time), limits=limits)
    worst = max(loop.max_sensitivity(controller, each) for loop, each in itertools.product(loops, along))
    return LoopShaping(controller, float(norm), worst)


def _without_fast_states(system: Any, scale: float, fastest: float) -> StateSpace:
    """A scaled system whose poles beyond a rate have settled: the synthesis has such near its best norm."""
    A, basis, n = schur(system.A, sort=lambda re, im: math.hypot(re, im) < fastest)
    B, C = scale * basis.T @ system.B[:, 0], system.C[0] @ basis
    settled = -np.linalg.solve(A[n:, n:], B[n:])
    D = float(scale * system.D[0, 0] + C[n:] @ settled)
    return StateSpace(A=A[:n, :n], B=B[:n] + A[:n, n:] @ settled, C=C[:n], D=D)


def _in_w(system: Any, gain: float, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """A sampled plant times a gain in the plane of w."""
    n, root = len(system.A), 2.0 / math.sqrt(sample_time)
    back = np.linalg.inv(system.A + np.eye(n))
    B, C = root * back @ system.B[:, 0], root * system.C[0] @ back
    D = -float(system.C[0] @ back @ system.B[:, 0])
    return 2.0 / sample_time * back @ (system.A - np.eye(n)), B, gain * C, gain * D
