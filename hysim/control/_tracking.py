"""Feed-forward and feedback composed, in one compiled step; `hysim.kernels.tracking` has its equations.

    reference -> shaper -> mode's inverse -> inverse of creep and law -> limits -> u
                   |                                  |                    |
                   +--> target, or measurement  --- model                  |
                        of the model    -> PID -> notch -> + --------------+
                                       \\-> damping --------/

Every part may be left out. With `preview` the reference is known as many samples ahead as its filters and the hold
take, so that the displacement follows it without delay.

An adaptive inverse is a feed-forward by a law whose numbers drift; `hysim.kernels.adaptive_inverse` has its equations.
Predictive control is linear around the inverse of a law; `hysim.kernels.predictive` has its equations.
"""

import functools
import itertools
import math
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag, solve_discrete_are, toeplitz

from hysim._basics.frozen import Count, FloatArray, Interval, NotNegative, Positive, check_positive, read_only
from hysim._basics.results import model_of
from hysim.control._controller import PID, Feedback, SampledController, SteppedController, WithoutFeedback, compiled_of
from hysim.control._filters import DampingLoop, ModeInverse, Notch, Shaper
from hysim.control._to_control import to_control
from hysim.kernels import boucwen_inverse, predictive, stepping
from hysim.kernels import tracking as kernels
from hysim.kernels.adaptive_inverse import adaptive
from hysim.kernels.inverses import line
from hysim.laws.static import Line
from hysim.models.compiled_step import compiled_step
from hysim.models.inverse_search import inverse_step, searched_inverse
from hysim.models.jacobian import checked_names
from hysim.models.law import Law
from hysim.models.model import family
from hysim.models.protocols import CompiledController, CompiledLaw, law_at, needs_time, positive_time
from hysim.plants.actuator import Actuator, as_actuator, is_law
from hysim.plants.stages import Amplifier, Creep, Sensor
from hysim.signals import triangle

_with_inverse = functools.lru_cache(maxsize=256)(kernels.bound)


@family
class InverseFeedforward(WithoutFeedback):
    """Command that takes a model of an actuator to a wanted displacement, one sample later.

    It closes a loop by itself, or as a part of a `TrackingController`.

    Parameters
    ----------
    law : law, optional
        Any law with an inverse, sums and cascades among them; by default a line of slope one.
    creep : Creep, optional
        Creep to invert: creep and law together meet the wanted displacement at the end of each sample.
    amplifier : Amplifier, optional
        Its gain and offset are inverted, its limits are kept.

    Raises
    ------
    TypeError, ValueError
        If the law cannot be stepped, the amplifier takes time or has no gain, or the law has no inverse at u = 0.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.Dahl() + hs.Line(slope=1.0)
    >>> t = 0.01 * np.arange(200)
    >>> run = hs.close_loop(law, hs.InverseFeedforward(law=law), t, np.sin(t))
    >>> bool(np.abs(run.y[1:] - np.sin(t[:-1])).max() < 1e-12)
    True
    """

    law: Any = None
    creep: Creep | None = None
    amplifier: Amplifier | None = None

    def __post_init__(self) -> None:
        if self.amplifier is not None and (self.amplifier.dynamic or not self.amplifier.gain):
            raise ValueError(
                "the amplifier must answer at once and have a gain: its slewing and its lag have no inverse"
            )
        if self.law is None:
            return
        if not is_law(model_of(self.law)):
            raise TypeError(f"law must be a law that a loop can step, such as BoucWen, got {type(self.law).__name__}")
        if not needs_time(self.law):
            inverse_step(self.law, 0.0)

    @property
    def u0(self) -> float | None:
        """Command at which the memory of its law holds; None for the first one."""
        return self.plant.u0

    @property
    def plant(self) -> Actuator:
        """The actuator that it inverts."""
        return Actuator(amplifier=self.amplifier, hysteresis=self.law, creep=self.creep)

    @property
    def dynamic(self) -> bool:
        """Whether it depends on time: by its creep, or by its law."""
        return self.creep is not None or needs_time(self.law)

    @classmethod
    def of(cls, plant: Any) -> Self:
        """Inverse of the amplifier, law and creep of an actuator, a law or a fit; it raises as the constructor does."""
        actuator = as_actuator(plant)
        return cls(law=actuator.hysteresis, creep=actuator.creep, amplifier=actuator.amplifier)

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        inverse, parameters, state = self.block(sample_time, u0)
        step = _with_inverse(kernels.invert, inverse)
        return CompiledController(step, read_only(parameters, finite=False), np.append([u0, 0.0], state))

    def block(self, sample_time: float, u0: float, commands: Interval = (-math.inf, math.inf)) -> CompiledLaw:
        """Compiled inverse at rest at the command `u0`, for commands within these limits."""
        amplifier, law = self.amplifier or Amplifier(), Line(slope=1.0) if self.law is None else self.law
        lowest, highest = sorted(amplifier.voltage(commands).tolist())
        inverse = inverse_step(law, float(amplifier.voltage(u0)), (lowest, highest), sample_time)
        creep = self.creep or Creep(time_constants=(), weights=())
        declines, weights = np.expm1(-sample_time / np.array(creep.time_constants)), np.array(creep.weights)
        scale = 1.0 / (creep.instant_gain - float(weights @ declines))
        head = [amplifier.gain, amplifier.offset, weights.size, scale]
        parameters = np.concatenate([head, weights, declines, inverse.parameters])
        state = np.concatenate([np.full(weights.size, inverse.state[1]), inverse.state])
        return CompiledLaw(inverse.step, parameters, state)

    def scratch(self, sample_time: float) -> int:
        """Room for the charts of a Bouc-Wen law."""
        block = self.block(sample_time, 0.0)
        if block.step is not boucwen_inverse.step:
            return 0
        creeping = 0 if self.creep is None else len(self.creep.weights)
        return block.state.size - creeping - boucwen_inverse.N_OWN - 2  # behind the law's input and memory


_THROUGH = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
_NOTHING = CompiledLaw(line, np.empty(0), np.empty(0))


@family
class TrackingController(SampledController):
    """Sampled controller of feed-forward and feedback parts.

    Parameters
    ----------
    shaper : Shaper, optional
        Filter of the reference.
    mode_inverse : ModeInverse, optional
        Inverse of the vibration, behind the shaper.
    feedforward : InverseFeedforward, optional
        Inverse of creep, law and amplifier, behind it; without one the reference reaches the feedback only.
    feedback : PID, optional
        On the shaped reference, or on the model's measurement; without limits of its own.
    notch, damping : Notch and DampingLoop, optional
        Filter of the feedback's command, and a loop beside it.
    model : Actuator, optional
        The feed-forward's plant, vibration and sensor delay included: feedback corrects only the difference from it. A
        derivative gain needs ``derivative_weight=1`` in the feedback for that.
    preview : bool
        Whether the reference is known ahead.
    limits : (float, float), optional
        Lowest and highest command; None for none [unit of u].

    Raises
    ------
    TypeError, ValueError
        If a part is not of its kind, the limits are no interval or the feedback has its own, a mode's inverse or a
        model comes without a feed-forward, or the model is another plant.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(feedthrough=1.0, gain=0.5)
    >>> inverse = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), preview=True)
    >>> t = 0.01 * np.arange(200)
    >>> run = hs.close_loop(law, inverse, t, np.sin(t))
    >>> bool(np.abs(run.y - np.sin(t))[1:].max() < 1e-12)
    True
    """

    shaper: Shaper | None = None
    mode_inverse: ModeInverse | None = None
    feedforward: InverseFeedforward | None = None
    feedback: PID | None = None
    notch: Notch | None = None
    damping: DampingLoop | None = None
    model: Actuator | None = None
    preview: bool = False
    limits: Interval | None = None

    def __post_init__(self) -> None:
        if self.feedback is not None and self.feedback.limits is not None:
            raise ValueError(
                "the feedback is limited together with the feed-forward: give the limits to the controller"
            )
        if self.feedforward is None and (self.mode_inverse is not None or self.model is not None):
            raise ValueError("a mode's inverse and a model need a feedforward; InverseFeedforward() passes on")
        if self.model is not None and self.feedforward is not None:
            inverted = self.feedforward.law, self.feedforward.amplifier
            if (self.model.hysteresis, self.model.amplifier) != inverted:
                raise ValueError("the model's law and amplifier must be those of the feedforward")

    def ahead(self, sample_time: float) -> int:
        if not self.preview:
            return 0
        shaped = self._shaped(sample_time)
        return self._hold + round(float(shaped @ np.arange(shaped.size)))

    def scratch(self, sample_time: float) -> int:
        return 0 if self.feedforward is None else self.feedforward.scratch(sample_time)

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        total = (self.feedback or PID()).frequency_response(frequency, sample_time)
        if self.notch is not None:
            total = total * self.notch.frequency_response(frequency, sample_time)
        if self.damping is not None:
            total = total - self.damping.frequency_response(frequency, sample_time)
        return np.asarray(total)

    def linear(self, sample_time: float) -> Feedback:
        total = (self.feedback or PID()).linear(sample_time)
        if self.notch is not None:
            total = total.then(self.notch.linear(sample_time))
        if self.damping is not None:
            total = total.beside(self.damping.linear(sample_time))
        return total

    @property
    def u0(self) -> float | None:
        """Command at which the memory of its law holds; None for the first one."""
        return None if self.feedforward is None else self.feedforward.u0

    @property
    def plant(self) -> Actuator | None:
        """The actuator that its feed-forward inverts."""
        return None if self.feedforward is None else self.feedforward.plant

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        positive_time(sample_time)
        lowest, highest = self.limits or (-math.inf, math.inf)
        taps = self.taps(sample_time)
        counts, plant, plant_state = self._model_blocks(sample_time, u0)
        feedback = (self.feedback or PID()).compiled(sample_time, u0 if self.feedforward is None else 0.0, y0)
        forward = _NOTHING if self.feedforward is None else self.feedforward.block(sample_time, u0, (lowest, highest))
        head = [lowest, highest, taps.shape[1], float(self.feedforward is not None), *counts]
        filters = [
            _THROUGH if self.notch is None else self.notch.coefficients(sample_time),
            0.0 * _THROUGH if self.damping is None else self.damping.coefficients(sample_time),
        ]
        parameters = [np.array(head), taps.ravel(), plant, feedback.parameters, *filters, forward.parameters]
        state = [[u0, 0.0], np.full(taps.shape[1], y0), plant_state, feedback.state, np.zeros(4), forward.state]
        return compiled_of(_with_inverse(kernels.track, forward.step), parameters, state)

    @property
    def _hold(self) -> int:
        return 0 if self.feedforward is None else 1 if self.mode_inverse is None else 2

    def _shaped(self, sample_time: float) -> FloatArray:
        return np.ones(1) if self.shaper is None else self.shaper.impulses(sample_time)

    def taps(self, sample_time: float) -> FloatArray:
        """Weights of the reference, the newest first, for the feed-forward and for the feedback."""
        shaped = self._shaped(sample_time)
        inverted = np.ones(1) if self.mode_inverse is None else self.mode_inverse.weights(sample_time)
        drive, target = np.convolve(shaped, inverted), np.concatenate([np.zeros(self._hold), shaped])
        size = max(drive.size, target.size)
        return np.stack([np.pad(weights, (0, size - weights.size)) for weights in (drive, target)])

    def _model_blocks(self, sample_time: float, u0: float) -> tuple[list[float], FloatArray, FloatArray]:
        """Numbers of the head, matrices, and state at rest of the model, as the kernel takes them."""
        chain = (self.model or Actuator()).chain(sample_time)
        rest = chain.rest(u0)
        stage, seen_in = chain.stage, chain.seen_in
        counts = [
            float(self.model is not None), stage.decline.size, stage.rest.size, stage.lag, chain.samples_late,
            float(seen_in >= 0),
        ]  # fmt: skip
        readings = np.full(chain.samples_late + 2, chain.displacement(rest))
        return counts, chain.linear_block, np.concatenate([rest.x, rest.past, readings])


def is_fed_back(controller: object) -> bool:
    """Whether a controller uses the measurement: an inverse alone does not, and closes no loop."""
    if isinstance(controller, TrackingController):
        return controller.feedback is not None or controller.damping is not None
    return not isinstance(controller, InverseFeedforward)


_DIFFERENCE = 1e-4  # of a number: how far its copy of the law is from the law
_AFFINE = 1e-9  # of the parameters of a step: what of them may not be affine in the numbers
_PROBE = 0.1  # of a number, where that is looked at

_bound = functools.lru_cache(maxsize=64)(adaptive)


@family
class AdaptiveInverse(WithoutFeedback):
    """Command by the inverse of a law whose numbers are estimated again at every sample.

    The measurement is compared with the output of the law at the last command, and the numbers that are free move
    towards those that predict it (a Kalman filter of a random walk). A sensor that is late, or a stage that takes time
    between the law and the sensor, is not modelled, and is taken for a drift.

    Parameters
    ----------
    law : law
        A law with an inverse, and with the numbers at the beginning.
    free : sequence of str
        Numbers that drift, as in ``law.scalars``; the parameters of the law's step must be affine in them.
    drift : sequence of float
        For each the change that is expected within one second, and its standard error at the start [unit of each].
    noise : float
        Standard deviation of the measurement [unit of y].
    limits : (float, float), optional
        Lowest and highest command [unit of u].

    Raises
    ------
    TypeError, ValueError
        If the law is none that a step describes; if a name is unknown, lengths differ, a drift or the noise is not
        positive, or the law has no inverse.

    Examples
    --------
    The gain of the plant is 20 % lower than that of the law; the fixed inverse does not see it.

    >>> import numpy as np, hysim as hs
    >>> law, plant = (hs.BoucWen(feedthrough=1.0, gain=gain) for gain in (-0.5, -0.4))
    >>> t = 0.01 * np.arange(2000)
    >>> r = 0.5 * np.sin(2.0 * t)
    >>> adaptive = hs.AdaptiveInverse(law=law, free=("gain",), drift=(0.1,), noise=1e-3)
    >>> run, fixed = (hs.close_loop(plant, each, t, r) for each in (adaptive, hs.InverseFeedforward(law=law)))
    >>> errors = [np.abs(each.y[1001:] - r[1000:-1]).max() for each in (run, fixed)]
    >>> bool(errors[0] < 0.02 * errors[1])
    True
    """

    law: Any
    free: tuple[str, ...]
    drift: tuple[float, ...]
    noise: float
    limits: Interval | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise TypeError(f"law must be a law that a step describes, such as BoucWen, got {type(self.law).__name__}")
        if not self.free or len(self.free) != len(self.drift):
            raise ValueError(f"free and drift must name as many numbers, got {len(self.free)} and {len(self.drift)}")
        checked_names(self.law, self.free)
        check_positive(drift=min(self.drift), noise=self.noise)
        if self.law.workspace and self.law.resume is None:
            raise ValueError(f"the workspace of a {type(self.law).__name__} cannot follow numbers that change")
        self._rates()

    @property
    def substitute(self) -> float:
        """Stand-in for a missing measurement: nan, since one of an earlier command would be taken for a drift."""
        return math.nan

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        positive_time(sample_time)
        law, count = self.law, len(self.free)
        parameters, rates = self._rates()
        sizes = self._sizes()
        law0 = law.compiled(u0)._replace(step=compiled_step(law.step))
        own = self._begun(law0.parameters, u0)[1]
        lowest, highest = self.limits or (-math.inf, math.inf)
        inverse = searched_inverse(law, law0._replace(state=own), limits=(lowest, highest))
        search = inverse.parameters.copy()
        search[2] = 0.0  # what is known of the slopes holds for the numbers at the beginning
        places = search.size - parameters.size
        copies = [self._begun(parameters + size * rate, u0) for size, rate in zip(sizes, rates, strict=True)]
        drift = np.square(self.drift) * sample_time
        head = [count, parameters.size, own.size, places, self.noise**2]
        constants: list[Any] = [head, drift, sizes, parameters, rates.ravel()]
        outputs = [output for output, _ in copies]
        covariance = np.diag(np.square(self.drift))
        state: list[Any] = [
            [u0], np.zeros(count), covariance.ravel(), outputs, parameters, parameters, parameters,
            *(each for _, each in copies), search, inverse.state, np.zeros(2 * count),
        ]  # fmt: skip
        step = _bound(compiled_step(law.step), stepping.unchanged if law.resume is None else law.resume)
        return compiled_of(step, constants, state)

    def _sizes(self) -> FloatArray:
        """Differences of the numbers by which the derivatives of the output are computed."""
        values = np.array([self.law.scalars[name] for name in self.free])
        return _DIFFERENCE * np.where(values == 0.0, 1.0, np.abs(values))

    def _rates(self) -> tuple[FloatArray, FloatArray]:
        """Parameters of the law's step, and their derivatives by the free numbers; ValueError if these are not all."""
        law, (here, memory), rates = self.law, self.law.packed, []
        for name in self.free:
            refusal = f"the step of a {type(law).__name__} does not take {name} as it is: it cannot be free"
            if name in law.structural:
                raise ValueError(refusal)
            change = _PROBE * (abs(law.scalars[name]) or 1.0)
            values = law.scalars[name] + np.array([change, -change])
            (ahead, there), (behind, _) = (self._packed(name, value) for value in values)
            if not np.array_equal(memory, there):
                raise ValueError("the memory at the first sample does not drift: leave it out of free")
            bend = np.where(ahead == behind, 0.0, 0.5 * (ahead + behind) - here)
            if not np.abs(bend).max() <= _AFFINE * np.nanmax(np.abs(here)):
                raise ValueError(refusal)
            rates.append(np.where(ahead == behind, 0.0, (ahead - behind) / (values[0] - values[1])))
        return here, np.array(rates)

    def _packed(self, name: str, value: float) -> tuple[FloatArray, FloatArray]:
        law = self.law
        parameters, memory = law.pack(law.completed(law.exchanged({name: np.array([[value]])})))
        return parameters[0], memory[0]

    def _begun(self, parameters: FloatArray, u0: float) -> tuple[float, FloatArray]:
        state = np.concatenate([self.law.packed[1], np.zeros(self.law.workspace)])
        constants = read_only(parameters, finite=False)
        self.law.start(constants, state, u0 if self.law.u0 is None else self.law.u0)
        if self.law.u0 is not None:
            self.law.step(constants, state, self.law.u0)
        return float(self.law.step(constants, state, u0)), state


_LONGEST = 200  # samples of a horizon: K^-1 then has 40 000 numbers
_STEP = 0.1  # rho, of the geometric mean of these: 30 iterations then miss the optimum by 1e-5 of a step's error
_REGULAR = 1e-6  # sigma, of the largest eigenvalue of P
_CYCLE = 400  # samples of a cycle between the limits, along which slopes are taken
_FLAT = 0.3  # of the mean slope: a law that is flatter at its reversals would hold the command for long
_FORGETTING = 1e-12  # noise of each state, of that of the law's output: else a stage at rest, a delay, has no filter


@family
class PredictiveControl(SteppedController):
    """Controller that minimises the predicted error over a horizon, within limits of the command and of its rate.

    The limits hold exactly, but the rate comes first where the command begins outside its limits.

    Parameters
    ----------
    model : Actuator, law or fit
        What it drives; an amplifier must act at once.
    horizon, effort : float
        Time over which it predicts [s], at most 200 samples, and weight of the law output's changes against errors.
    limits : (float, float), optional
        Lowest and highest command [unit of u].
    rate : float, optional
        Largest rate of the command [unit of u / s].
    output_limits, softness : (float, float), optional, and float
        Lowest and highest displacement, which are exceeded where nothing else is possible [unit of y], and weight of
        what is beyond them against errors.
    model_error, drift : float
        What is expected of the law's output and of the disturbance: error, and change, in a sample, in units of the
        sensor's noise. Small numbers trust the model, and damp less of what it does not know.
    preview : bool
        Whether the reference is known a horizon ahead.
    iterations : int
        Of the solver at each sample, from the solution before.

    Raises
    ------
    ValueError
        If a number is outside its range, the amplifier takes time, or the law has no inverse.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
    >>> stage = hs.Actuator(hysteresis=law, vibration=hs.mode(natural_frequency=500.0, damping_ratio=0.02))
    >>> mpc = hs.PredictiveControl(model=stage, horizon=0.02, limits=(0.0, 60.0), rate=1e5)
    >>> run = hs.close_loop(stage, mpc, 5e-4 * np.arange(200), np.where(np.arange(200) < 60, 0.0, 1.0))
    >>> bool(run.y.max() < 1.04 and abs(run.y[-1] - 1.0) < 1e-3)
    True
    """

    keeps_limits: ClassVar[bool] = True

    model: Any
    horizon: Positive
    effort: NotNegative = 1e-2
    limits: Interval | None = None
    rate: Positive | None = None
    output_limits: Interval | None = None
    softness: Positive = 100.0
    model_error: Positive = 10.0
    drift: Positive = 0.1
    preview: bool = True
    iterations: Count = 30

    def __post_init__(self) -> None:
        amplifier = as_actuator(self.model).amplifier
        if amplifier is not None and (amplifier.dynamic or not amplifier.gain):
            raise ValueError("the amplifier must act at once and have a gain")

    @property
    def u0(self) -> float | None:
        """Command at which the memory of the model's law holds; None for the first one."""
        return as_actuator(self.model).u0

    def ahead(self, sample_time: float) -> int:
        return self._samples(sample_time) if self.preview else 0

    def _samples(self, sample_time: float) -> int:
        samples = max(1, round(self.horizon / sample_time))
        if samples > _LONGEST:
            raise ValueError(
                f"horizon must have at most {_LONGEST} samples, got {samples}: the loop is too fast for it"
            )
        return samples

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        p, plant = self._samples(positive_time(sample_time)), as_actuator(self.model)
        law = Line(slope=1.0) if plant.hysteresis is None else plant.hysteresis
        amplifier = plant.amplifier or Amplifier()
        low, high = sorted(amplifier.voltage(self.limits or (-math.inf, math.inf)).tolist())
        inverse = inverse_step(law, float(amplifier.voltage(u0)), (low, high), sample_time)
        A, B, C, M = _linear(plant, sample_time)
        level = inverse.state[1]
        if not np.abs(np.linalg.eigvals(A)).max(initial=0.0) < 1.0:
            raise ValueError("the vibration must come to rest: it integrates, or is unstable")
        rest = np.linalg.solve(np.eye(B.size) - A, B)
        size = abs(float(C @ rest)) or 1.0
        C, M = C / size, M / size
        powers = list(itertools.accumulate(range(p), lambda row, _: row @ A, initial=C))
        free, pulse = np.stack(powers[1:]), np.stack(powers[:-1]) @ B
        if not pulse.any():
            raise ValueError(f"horizon must be longer than the plant's dead time, got {self.horizon:g} s")
        K, rho, sigma = self._problem(pulse)
        gains = _observer(A, B, M, self.model_error, self.drift)
        change = math.inf if self.rate is None else abs(amplifier.gain) * self.rate * sample_time
        head: list[Any] = [
            B.size, p, self.iterations, float(self.preview), gains[-1], low, high, change, _flattest(law, low, high),
            self.effort, float(self.output_limits is not None), *np.array(self.output_limits or (0.0, 0.0)) / size,
            2.0 * self.softness / (2.0 * self.softness + rho), rho, sigma, amplifier.gain, amplifier.offset, size,
        ]  # fmt: skip
        parameters: list[Any] = [head, A.ravel(), B, M, gains[:-1], free.ravel(), pulse, K.ravel(), inverse.parameters]
        state: list[Any] = [
            [u0, y0 / size - level * M @ rest], level * rest, np.zeros(B.size), np.full(p, y0 / size),
            np.full(p, level), np.zeros(p), np.full(p, level), level * np.eye(1, p)[0], level * np.cumsum(pulse),
            np.zeros(4 * p), inverse.parameters, inverse.state,
        ]  # fmt: skip
        return compiled_of(_with_inverse(predictive.predict, inverse.step), parameters, state)

    def _problem(self, pulse: FloatArray) -> tuple[FloatArray, float, float]:
        """K^-1, rho and sigma, for a linear stage with this response."""
        n = pulse.size
        respond, differ = np.tril(toeplitz(pulse)), np.eye(n) - np.eye(n, k=-1)
        P = 2.0 * (respond.T @ respond + self.effort * differ.T @ differ)
        least, largest = np.linalg.eigvalsh(P)[[0, -1]]
        sigma = _REGULAR * largest
        rho = _STEP * math.sqrt(max(least, sigma) * largest)
        limited = respond if self.output_limits is not None else np.zeros((n, n))
        bounds = np.eye(n) + differ.T @ differ + limited.T @ limited
        return np.linalg.inv(P + sigma * np.eye(n) + rho * bounds), rho, sigma


def _linear(plant: Actuator, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A, B, and the rows of the displacement and of the measurement, from the output of the law held over a sample."""
    delay = 0.0 if plant.sensor is None else plant.sensor.delay
    stages = Actuator(creep=plant.creep, vibration=plant.vibration)
    true, read = (to_control(replace(stages, sensor=sensor), sample_time) for sensor in (None, Sensor(delay=delay)))
    displacement, measurement = block_diag(true.C, read.C)
    return block_diag(true.A, read.A), np.append(true.B, read.B), displacement, measurement


def _observer(A: FloatArray, B: FloatArray, M: FloatArray, model_error: float, drift: float) -> FloatArray:
    """Gains of the stationary Kalman filter for the states, and for the disturbance of the measurement."""
    measured = np.append(M, 1.0)
    noise = block_diag(model_error**2 * (np.outer(B, B) + _FORGETTING * (B @ B) * np.eye(B.size)), drift**2)
    P = solve_discrete_are(block_diag(A, 1.0).T, measured[:, np.newaxis], noise, np.eye(1))
    return np.asarray(P @ measured / (measured @ P @ measured + 1.0))


def _flattest(law: Any, low: float, high: float) -> float:
    """Least slope of a law along a cycle between two inputs, but for what is flatter than a part of its mean slope."""
    ends = np.array([low, high] if math.isfinite(high - low) else [-1.0, 1.0])
    cycle = np.tile(triangle(*ends.tolist(), cycles=1, samples_per_cycle=_CYCLE)[:-1], 2)
    level = np.asarray(law_at(law, math.inf).response(cycle))
    mean = float((level[_CYCLE // 2] - level[0]) / np.ptp(ends))
    steps = np.diff(level)[-_CYCLE + 1 :] / np.diff(cycle)[-_CYCLE + 1 :]
    return math.copysign(max(_FLAT * abs(mean), float(np.abs(steps).min())), mean)
