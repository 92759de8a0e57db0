"""A mass on a linear and a hysteretic spring.

A memory inside the equation of motion has no closed form: it is integrated (`hysim.kernels.oscillator`), by default in
steps that end where y' or z changes sign. Energy, for the force p(y) + gain z (A not 0; Erlicher and Point 2004):

    work of the input = stored + lost in damping + lost in hysteresis
    stored            = m y'^2 / 2 + k y^2 / 2 + integral of p dy + gain z^2 / (2 A),  counted from the start
    loss by damping   = integral of c y'^2 dt
    loss by hysteresis= integral of gain z (dy - dz / A)

The last never falls if -beta <= gamma <= beta. With A = 0 the memory stores nothing.

Under an input that repeats itself the motion may settle slowly. With P the map of the state (y, y', z) over one period,
a steady motion is a fixed point of P. It attracts if the multipliers, the eigenvalues of J = dP/dx, lie within the unit
circle. Going through the period again and again shrinks a deviation only by the largest of them in a period; Newton's
method needs a few steps of four periods:

    x <- x + (I - J)^-1 (P(x) - x),        J by forward differences, three periods

A multiplier of 1 belongs to a quantity that the motion conserves, such as the offset of a memory without hysteresis:
Newton's method leaves it as it is. A fixed point is used only if

    1. every other multiplier is below 1 - 1e-5 in size, so that the motion attracts, and
    2. the linear map there predicts the change over the last period that was gone through, so that it is the motion in
       which the plant settles, where there are several.

Source: R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, chapter 7.
"""

import math
from collections.abc import Callable, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from hysim._basics.frozen import Count, FloatArray, Positive, check_positive, read_only, whole_substeps
from hysim._basics.parallel import in_pieces
from hysim._basics.progress import along
from hysim.errors import SimulationError
from hysim.kernels import oscillator as kernels
from hysim.kernels import stepping
from hysim.kernels.batches import drive_memory
from hysim.kernels.boucwen import prepare
from hysim.kernels.charts import N_WORK
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.models.compiled_step import pointer
from hysim.models.model import family
from hysim.models.protocols import Startable, needed_time, positive_time
from hysim.plants.oscillator_structure import METHODS as METHODS
from hysim.plants.oscillator_structure import Excitation, Method, OscillatorStructure
from hysim.plants.structures.parts import Element
from hysim.plants.structures.structure import Structure

ATTEMPTS = (16, 32, 64, 128, 256)  # periods gone through before each search for a fixed point, and before giving up
MARGIN = 1e-5  # below 1, of a multiplier that attracts: differences find it to about 1e-6
_DIFFERENCE = 1e-6  # of the largest value of each state
_MOST_STEPS = 8
_SHARES = (1.0, 0.5, 0.25, 0.125)  # of a Newton step, the first that lowers the mismatch
_PREDICTED = 0.3  # largest part of the last change that the linear map may miss

Period = Callable[[FloatArray], FloatArray]
"""State (3,) after a period, from that before; SimulationError if it diverges."""

_ANGLE = 0.1  # largest phase of the mode in a default step: errors of 1e-7 of the output on the Noel-Schoukens system
_LARGEST_ANGLE = 1.0  # in any step of "split", which is unstable beyond 3
_SETTLING_CHUNK = 1 << 13


def attracting_state(period: Period, state: FloatArray, scale: FloatArray, tolerance: float) -> FloatArray | None:
    """State (3,) of the steady motion near `state`, or None if Newton's method finds no usable one.

    `scale` holds the largest value of each state, and `tolerance` is the largest change in a period in units of it.

    Raises SimulationError if the plant goes round the steady motion without coming nearer.
    """
    units = np.where(scale > 0.0, scale, 1.0)

    def change(x: FloatArray) -> FloatArray:
        return period(x * units) / units - x

    try:
        start = state / units
        before = change(start)
        x, slopes, multipliers = _newton(change, start, before, tolerance)
    except (SimulationError, np.linalg.LinAlgError):
        return None
    is_near = np.linalg.norm(before - slopes @ (start - x)) <= _PREDICTED * np.linalg.norm(before)
    sizes = np.abs(multipliers[_moves(multipliers)])
    if is_near and np.all(sizes < 1.0 - MARGIN):
        return x * units
    if is_near and np.all(sizes < 1.0 + MARGIN):
        raise SimulationError(
            f"the motion has not settled and does not come nearer to a steady one: a deviation keeps "
            f"{100.0 * sizes.max():.4f} % of its size in a period; the plant needs damping"
        )
    return None


def _newton(change: Period, x: FloatArray, mismatch: FloatArray, tolerance: float) -> tuple[FloatArray, ...]:
    """Fixed point, J - I and the multipliers there; SimulationError if the mismatch does not fall."""
    for _ in range(_MOST_STEPS):
        slopes = np.column_stack([(change(x + _DIFFERENCE * axis) - mismatch) / _DIFFERENCE for axis in np.eye(3)])
        multipliers, modes = np.linalg.eig(slopes + np.eye(3))
        moves = _moves(multipliers)
        step = (modes[:, moves] @ (np.linalg.solve(modes, mismatch)[moves] / (1.0 - multipliers[moves]))).real
        if np.all(np.abs(mismatch) <= tolerance):
            return x + step, slopes, multipliers
        for share in _SHARES:
            trial = change(x + share * step)
            if np.linalg.norm(trial) < np.linalg.norm(mismatch):
                break
        else:
            break
        x, mismatch = x + share * step, trial
    raise SimulationError("Newton's method finds no steady motion")


def _moves(multipliers: FloatArray) -> np.ndarray:
    return np.abs(multipliers - 1.0) > MARGIN


class OscillatorState(NamedTuple):
    """State of a simulation: last input, motion, memory, and the energies so far."""

    u: float
    y: float
    velocity: float
    z: float
    input_work: float = 0.0
    damping_loss: float = 0.0
    memory_work: float = 0.0


@family
class BoucWenOscillator:
    """Mass on a linear and a Bouc-Wen spring, ``m y'' + c y' + k y + law(y) = u``.

    Under a base's acceleration u the right side is ``-m u``, and y is relative to the base. y is the input of the law,
    whose positive force pulls towards y = 0.

    Parameters
    ----------
    mass, damping, stiffness : float
        Positive m [kg], viscous c [N s/m], and k of the linear spring [N/m].
    law : BoucWen or PolynomialBoucWen
        Force of the hysteretic spring [N] for the displacement y [m]; its z0 is the memory at the start.
    excitation : {"force", "base"}
        Whether u is a force [N], or the acceleration of the base [m/s^2]; y is then relative to the base.
    hold : {"foh", "zoh"}
        Whether the input is linear between samples, or held.
    method : {"split", "runge-kutta", "newmark", "strang"}
        Steps of order 6 that end at reversals, with the exact memory; the classical Runge-Kutta method;
        Newmark's constant average acceleration with the trapezoidal rule for z; Strang's splitting.
    substeps : int, optional
        Steps between two samples, the one control of accuracy. By default as few as turn the phase of the mode (all
        springs at the start) by at most 0.1 rad each. Twice as many show the remaining error. ``"split"`` takes more
        where a step would turn the mode by more than 1 rad, or damping would change the velocity as fast.
    initial_state : (float, float)
        Displacement [m] and velocity [m/s] at the first sample; empty for rest.

    Raises
    ------
    ValueError, TypeError
        If a number is not finite, the mass is not positive, an option is unknown, `substeps` is not whole and positive,
        or the law is not one of the two.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-1100.0)
    >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    >>> t = np.arange(751) / 750
    >>> sim = hs.simulate(plant, t, 40 * np.sin(2 * np.pi * 30 * t))
    >>> f"{sim.y.max():.4e} m, {sim.signals['hysteresis_loss'][-1]:.4f} J"
    '1.0838e-03 m, 0.8678 J'
    """

    mass: Positive
    damping: float
    stiffness: float
    law: BoucWen | PolynomialBoucWen
    excitation: Excitation = "force"
    hold: Literal["foh", "zoh"] = "foh"
    method: Method = "split"
    substeps: Count | None = None
    initial_state: tuple[float, ...] = ()

    dynamic: ClassVar[bool] = True
    short = "oscillator"

    def __post_init__(self) -> None:
        if len(self.initial_state) not in (0, 2):
            raise ValueError(f"initial_state must be empty or hold 2 numbers, got {len(self.initial_state)}")

    @property
    def natural_frequency(self) -> float:
        """Undamped, of small motions about y = z = 0 [rad/s]; for the size of the stiffness where that is negative."""
        return math.sqrt(abs(self.stiffness + self._coefficients[0] + self.law.gain * self.law.A) / self.mass)

    @property
    def elastic_force(self) -> np.polynomial.Polynomial:
        """Force of both springs without the memory, a polynomial of y [N]."""
        slope, *curve = self._coefficients
        return np.polynomial.Polynomial([self.law.offset, self.stiffness + slope, *curve])

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Displacement (n,) [m] at the samples of `u` (n,) [N, or m/s^2], from the initial state at the first of them.

        The samples are `sample_time` apart [s]. Raises SimulationError if the motion diverges, with the time;
        ValueError if `u` is not finite or has not one axis, or the sample time is not positive.
        """
        return self._states(u, sample_time)[1][:, 0].copy()

    def periodic_response(self, u: npt.ArrayLike, sample_time: float, *, tolerance: float = 1e-10) -> FloatArray:
        """Displacement (n,) [m] in the steady state under an input that repeats itself.

        The period is repeated from the initial state until a state comes back to its value one period before, to
        `tolerance` as a share of the largest value. A motion that settles slowly is computed by Newton's method, and
        used only if it attracts: a deviation must lose more than 1e-5 of its size in a period.

        `u` (n,) [N, or m/s^2] is one period, whose last sample is followed by its first, every `sample_time` [s].
        Raises SimulationError if the motion diverges, or has not settled within 256 periods; ValueError as `response`,
        or if u is empty or the tolerance is not positive.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> plant = hs.benchmarks.noel_schoukens_plant()
        >>> u = 40 * np.sin(2 * np.pi * np.arange(500) / 500)
        >>> y = plant.periodic_response(u, 1 / 15000)
        >>> bool(abs(plant.response(np.tile(u, 100), 1 / 15000)[-500:] - y).max() < 1e-9 * y.max())
        True
        """
        check_positive(tolerance=tolerance)
        return self.steady_motion(u, sample_time, tolerance)[:, 0].copy()

    def steady_motion(self, u: npt.ArrayLike, sample_time: float, tolerance: float = 1e-10) -> FloatArray:
        """Displacement, velocity and memory (n, 3) of the steady state; see `periodic_response`."""
        inputs = read_only(u, "u", ndim=1)
        if not inputs.size:
            raise ValueError("u must hold one period, got no samples")
        state = self._start(float(inputs[-1]))
        motion, largest = np.full((inputs.size, 3), np.nan), np.zeros(3)

        def after(x: FloatArray) -> FloatArray:
            start = OscillatorState(float(inputs[-1]), *x.tolist())
            return np.asarray(self._states(inputs, sample_time, start)[1][-1, :3])

        for n_periods in range(ATTEMPTS[-1] + 2):
            if n_periods in ATTEMPTS:
                steady = attracting_state(after, motion[-1], largest, tolerance)
                if steady is not None:
                    state = OscillatorState(float(inputs[-1]), *steady.tolist())
                    motion[-1] = steady
            for begin in range(0, inputs.size, _SETTLING_CHUNK):
                piece = slice(begin, begin + _SETTLING_CHUNK)
                try:
                    states = self._states(inputs[piece], sample_time, state)[1]
                except SimulationError:
                    raise SimulationError("the motion leaves the finite numbers before it is steady") from None
                state = OscillatorState(float(inputs[piece][-1]), *states[-1].tolist())
                change = np.abs(states[-1, :3] - motion[piece][-1])
                motion[piece] = states[:, :3]
                largest = np.maximum(largest, np.abs(states[-1, :3]))
                if np.all(change <= tolerance * largest):
                    return motion
        raise SimulationError(f"the motion has not settled within {ATTEMPTS[-1]} periods")

    def signals(self, u: npt.ArrayLike, sample_time: float) -> dict[str, FloatArray]:
        """Every signal (n,) at the samples of `u`, by name; arguments and errors as of `response`.

        ``"y"`` [m], ``"velocity"`` [m/s], ``"z"``, ``"restoring_force"`` k y + law(y) [N], and the energies since the
        start [J] ``"input_work"``, ``"damping_loss"``, ``"hysteresis_loss"``, ``"stored"``: the first is the sum of the
        others, up to the error of the method.
        """
        return self.advance(u, sample_time=sample_time)[0]

    def advance(
        self,
        u: npt.ArrayLike,
        state: OscillatorState | None = None,
        *,
        sample_time: float | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> tuple[dict[str, FloatArray], OscillatorState]:
        """As `signals`, continued from `state` with the bits of one input, and the state after the last sample."""
        with along(progress):
            inputs, states = self._states(u, needed_time(self, sample_time), state)
        y, velocity, z, input_work, damping_loss, memory_work = states.T.copy()
        law, start = self.law, self._start(0.0)
        recoverable = law.gain / law.A if law.A else 0.0
        in_memory = 0.5 * recoverable * (z - start.z) * (z + start.z)
        elastic_force = self.elastic_force
        potential = elastic_force.integ()
        stored = 0.5 * self.mass * (velocity**2 - start.velocity**2) + in_memory + potential(y) - potential(start.y)
        signals = {
            "y": y,
            "velocity": velocity,
            "z": z,
            "restoring_force": elastic_force(y) + law.gain * z,
            "input_work": input_work,
            "damping_loss": damping_loss,
            "hysteresis_loss": memory_work - in_memory,
            "stored": stored,
        }
        return signals, OscillatorState(inputs[-1], *states[-1]) if inputs.size else state or start

    @classmethod
    def structure(
        cls,
        *,
        method: Method = "split",
        oversampling: int = 4,
        decimation: Sequence[int] = (),
        initial: Literal["rest", "periodic"] = "rest",
        period: int | None = None,
        hold: Literal["foh", "zoh", "band-limited"] = "foh",
        excitation: Excitation = "force",
    ) -> OscillatorStructure:
        """Description for `hysim.identify` of how the record of an oscillator with a Bouc-Wen law was made.

        Its parameters are ``mass, damping, stiffness, A, beta, gamma, n``, all free by default. Under a base's
        acceleration only the ratios of the first four can be determined, and ``mass = 1`` is held.

        Parameters
        ----------
        method : str
            As in the constructor; ``"newmark"`` is that of the Noel-Schoukens benchmark.
        oversampling : int
            Steps of the method between two samples of the record.
        decimation : sequence of int
            Factors of the filters, one after the other, from the rate of the steps to that of the record: each a 31-tap
            Hamming low-pass with the cutoff at half of the new rate, without delay. Their product is `oversampling`;
            empty where the output was sampled without filter.
        initial : {"rest", "periodic"}
            Whether the record begins at rest, or is steady under an input that repeats itself.
        period : int, optional
            Samples of a period, with ``initial="periodic"``. One period is simulated, with the mean of the periods as
            input, and compared with every sample of the record.
        hold : {"foh", "zoh", "band-limited"}
            Whether the input between samples is linear, held, or the sum of the lines below half the record's rate, for
            which more steps pay: ``oversampling=20``.
        excitation : str
            As in the constructor.

        Returns
        -------
        OscillatorStructure

        Raises
        ------
        ValueError, TypeError
            If an option is unknown, a number is not whole and positive, or the options do not fit each other.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
        >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
        >>> t = np.arange(300) / 750
        >>> u = 60 * np.sin(2 * np.pi * (20 + 40 * t) * t)
        >>> rec = hs.Record(u=u, y=hs.simulate(plant, t, u).y, t=t)
        >>> fit = hs.identify(hs.BoucWenOscillator.structure(), rec, fixed={"n": 1.0})
        >>> round(fit.estimates["mass"], 4), round(fit.estimates["gamma"], 1)
        (2.0, -300.0)
        """
        return OscillatorStructure(
            family=cls,
            method=method,
            oversampling=oversampling,
            decimation=tuple(decimation),
            initial=initial,
            period=period,
            hold=hold,
            excitation=excitation,
        )

    @property
    def _coefficients(self) -> tuple[float, ...]:
        """Coefficients of y, y^2, ... in the law's output."""
        law = self.law
        return law.input_coefficients if isinstance(law, PolynomialBoucWen) else (law.feedthrough,)

    def _start(self, u: float) -> OscillatorState:
        y, velocity = self.initial_state or (0.0, 0.0)
        return OscillatorState(u, y, velocity, self.law.z0)

    def steps_of(self, sample_time: float) -> int:
        """Steps in a sample time [s]."""
        angle = max(self.natural_frequency, abs(self.damping) / self.mass) * sample_time
        if self.substeps is None:
            return whole_substeps(angle / _ANGLE)
        more = whole_substeps(angle / self.substeps / _LARGEST_ANGLE) if self.method == "split" else 1
        return self.substeps * more

    def to_structure(self) -> Structure:
        """The plant as a structure of one mass, which takes any law.

        It has numerics of its own, and an input that is linear between samples. As here the memory is that of the
        initial state, whatever the law's `u0`.
        """
        return Structure(
            mass=np.array(self.mass),
            damping=self.damping,
            stiffness=np.array(self.stiffness),
            elements=(Element(self.law.placed(None, self.law.u_range), between=(0, 1)),),
            excitation=self.excitation,
            initial_state=self.initial_state,
        )

    def startable(self, sample_time: float | None = None) -> Startable:
        """The plant at a sample time [s], for exports: at its first sample it is in the initial state."""
        return self._compiled(needed_time(self, sample_time))

    def _states(
        self, u: npt.ArrayLike, sample_time: float, state: OscillatorState | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Inputs, and motion and energies at their samples, shape (n, 6)."""
        inputs, steps = read_only(u, "u", ndim=1), self._compiled(positive_time(sample_time))
        if not inputs.size:
            return inputs, np.empty((0, 6))
        front, path = steps.state.copy(), np.empty((inputs.size, 6))
        if state is not None:
            if len(state) != len(OscillatorState._fields):
                raise ValueError(f"the state must hold {len(OscillatorState._fields)} numbers, got {len(state)}")
            front[: kernels.N_FRONT] = *state, 1.0

        def work(k: slice) -> int:
            return int(drive_memory(pointer(steps.step), steps.parameters, front, inputs[k], path[k]))

        if (lost := in_pieces(work, inputs.size)) >= 0:
            raise SimulationError(
                f"the motion leaves the finite numbers within {(lost + (state is not None)) * sample_time:.6g} s from "
                f"the start, at sample {lost}: the plant is unstable, or the method needs more substeps"
            )
        return inputs, path

    def _compiled(self, sample_time: float) -> Startable:
        law, (slope, *curve) = self.law, self._coefficients
        stiffness, substeps = self.stiffness + slope, self.steps_of(sample_time)
        push = 1.0 if self.excitation == "force" else -self.mass
        springs = self.damping, stiffness, law.offset, law.gain, law.A, law.beta, law.gamma, law.n
        flow, work = [], np.zeros(N_WORK if self.method in ("split", "strang") and law.n not in (1.0, 2.0) else 0)
        if work.size:
            prepare(law.A, law.beta, law.gamma, law.n, 0.0, work)
        if self.method == "strang":
            flow = _linear_flow(self.mass, self.damping, stiffness + law.gain * law.A, sample_time / substeps)
        steps = substeps, self.hold == "zoh", sample_time, sample_time / substeps, push
        parameters = read_only([*steps, self.mass, *springs, 1.0 / self.mass, *flow, *curve], finite=False)
        state = np.concatenate([self._start(0.0), [0.0], work])
        return Startable(_STEPS[self.method], parameters, state, stepping.complete)


_STEPS = {each: vars(kernels)[f"{each.replace('-', '_')}_step"] for each in METHODS}


def _linear_flow(mass: float, damping: float, stiffness: float, h: float) -> list[float]:
    """(y, y') after h from (y, y', F, rise of F), exactly for m y'' + c y' + k y = F: two rows of four, flat."""
    generator = np.zeros((4, 4))
    generator[:2] = [[0.0, h, 0.0, 0.0], [-stiffness * h / mass, -damping * h / mass, h / mass, 0.0]]
    generator[2, 3] = 1.0
    flow: list[float] = expm(generator)[:2].ravel().tolist()
    return flow
