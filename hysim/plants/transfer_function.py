"""Linear plants: transfer functions, simulated and identified from sampled data, matrices, and resonances.

Systems of other packages are taken by their A, B, C and D, or num and den.

Where the input is held, the output of a sample may be taken at the start of the hold, before that sample's input has
moved the states, or at its end. System identification tools take the start. A staircase read when each step had settled
belongs to the end: taken as the start, each output must be explained by the step before, one sample too early.

With den monic the output is affine in the numerator and in the initial state, the state of the observability form. The
delay, where it is not known, is searched beside the denominator.
"""

import math
from collections.abc import Iterable, Mapping, Sized
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics import frozen
from hysim._basics.frozen import FloatArray, NotNegative, check_not_negative, check_positive, checked, read_only
from hysim.errors import SimulationError
from hysim.models.composable import Composable
from hysim.models.model import family
from hysim.models.protocols import CompiledLaw, Startable, Subject, check_continued, needed_time, positive_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants import _transfer_function_search as search
from hysim.plants._linear_response import LinearPlants, LinearState, affine_columns
from hysim.records import Record

Hold = Literal["zoh", "foh"]
Sample = Literal["start", "end"]

FREQUENCY = (0.1, np.pi)  # box of a section's frequency: rad over the whole record, rad per sample
DAMPING = (1e-3, 30.0)  # box of its damping ratio; two real poles above 1
LATEST = 0.25  # of the record: the largest delay that is searched
_AT_ZERO = 0.01  # of the output's span: an output that begins at zero
_LONG = 1000  # samples from which the starts from the record are relied upon
_AGREED = 0.02  # of the box: starts from different cutoffs this close to their median are one optimum
_MAJORITY = 3  # of them are enough to search no further
_SCREENED = 64  # random points beside starts that differ
_PHYSICAL = {  # the record shows nothing slower or faster, and a pole is stable
    **dict.fromkeys(("log frequency", "log rate"), (True, True)),
    **dict.fromkeys(("log damping", "delay"), (True, False)),
}


@family
class TransferFunction(Composable):
    """Continuous-time transfer function.

    ::

        G(s) = exp(-delay s) (num_0 s^m + ... + num_m) / (den_0 s^n + ... + den_n),   m <= n

    Parameters
    ----------
    num, den : sequence of float
        Coefficients of descending powers of s [s^-1]. The numerator's degree is at most the denominator's.
    delay : float
        Dead time [s], not negative.
    hold : {"zoh", "foh"}
        Whether the input is held between samples, or linear.
    sample : {"start", "end"}
        Whether an output is taken at the start or the end of the time for which its input is held; with
        ``hold="foh"`` it is taken at the sample.
    initial_state : sequence of float
        Free response and its derivatives at the begin of the first hold, (y, y', ...); empty for rest.

    Raises
    ------
    ValueError
        If the plant is not proper, den begins with zero, or an option is unknown.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0), sample="end")
    >>> lag.response([1.0, 1.0], sample_time=1.0).round(6).tolist()
    [0.632121, 0.864665]
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    delay: NotNegative = 0.0
    hold: Hold = "zoh"
    sample: Sample = "start"
    initial_state: tuple[float, ...] = ()

    dynamic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_sample(self.hold, self.sample)
        if not self.den or self.den[0] == 0.0:
            raise ValueError(f"den must begin with a coefficient that is not zero, got {self.den}")
        if not self.num:
            raise ValueError("num must hold at least one coefficient")
        if not all(math.isfinite(each / self.den[0]) for each in (*self.num, *self.den)):
            raise ValueError(f"num and den over the first of den must be finite, got {self.num} and {self.den}")
        if len(self.num) > len(self.den):
            raise ValueError(f"the numerator's degree {len(self.num) - 1} is above the denominator's {self.order}")
        if len(self.initial_state) not in (0, self.order):
            raise ValueError(f"initial_state must be empty or hold {self.order} numbers, got {len(self.initial_state)}")

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.den) - 1

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Roots of the denominator [rad/s]."""
        return np.roots(self.den).astype(np.complex128)

    @property
    def zeros(self) -> npt.NDArray[np.complex128]:
        """Roots of the numerator [rad/s]."""
        return np.roots(self.num).astype(np.complex128)

    @property
    def dc_gain(self) -> float:
        """G(0) [unit of y / unit of u]; infinite with a pole at zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.divide(self.num[-1], self.den[-1]))

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Output (n,) at the samples of `u` (n,), which is zero before the first of them, exact under the hold.

        The samples are `sample_time` apart [s]. Raises SimulationError if the output diverges, as an unstable plant's
        may, and ValueError if `u` is not finite or has not one axis, or the sample time is not positive.
        """
        return self.advance(u, sample_time=sample_time)[0]

    def advance(
        self, u: npt.ArrayLike, state: LinearState | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, LinearState]:
        """As `response`, continued from `state` (by default the initial one), and the state at the end; same bits."""
        inputs = read_only(u, "u", ndim=1)
        time = positive_time(needed_time(self, sample_time))
        with np.errstate(all="ignore"):
            plant = self._plant(float(time))
            begin = state
            if begin is None:
                free = np.array(self.initial_state or [0.0] * self.order) * plant.rate[0] ** -np.arange(self.order)
                begin = LinearState(np.stack([np.zeros(self.order), free]), np.empty((2, 0)), time)
            check_continued(time, begin.sample_time)
            if not inputs.size:
                return inputs, begin
            both = np.stack([inputs, np.zeros_like(inputs)])
            forced, end = plant.continued(both, begin, hold=self.hold, sample=self.sample, free=True)
            y = forced.sum(axis=0)
        if not np.isfinite(y).all():
            k = int(np.argmin(np.isfinite(y)))
            raise SimulationError(f"the output leaves the finite numbers at sample {k}; the poles are {self.poles}")
        return y, end._replace(sample_time=time)

    def startable(self, sample_time: float | None = None) -> Startable:
        """A step with the bits of `response` at a sample time [s]; the input is zero before its first sample."""
        plant = self._plant(positive_time(needed_time(self, sample_time)))
        return plant.startable(self.initial_state, hold=self.hold, sample=self.sample)

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        """The plant at rest at `u0`, plus the free response; ValueError without a sample time [s] or such a rest."""
        law = self.startable(sample_time).law
        if u0:
            if self.order and not self.den[-1]:
                raise ValueError(f"the plant integrates: it cannot rest at u = {u0:g}")
            plant, level = self._plant(needed_time(self, sample_time)), u0 * self.den[0] / self.den[-1]
            plant.rest_at(u0, level, law.state)
        return law

    def filtered(self, signals: FloatArray, sample_time: float) -> FloatArray:
        """Outputs (n_signals, n_samples) from rest for several inputs at once; they may be infinite or nan."""
        return self.filtered_sets({}, signals, sample_time)

    def filtered_sets(self, parameters: Parameters, signals: FloatArray, sample_time: float) -> FloatArray:
        """Outputs from rest for inputs (n_sets, n_signals, n_samples); they may be infinite or nan."""
        each = signals.reshape(1, -1, signals.shape[-1])
        return self._plant(sample_time).filtered(each, hold=self.hold, sample=self.sample).reshape(signals.shape)

    def free_responses(self, parameters: Parameters, record: Record) -> FloatArray:
        """No column: the initial state is known."""
        return np.empty((1, len(record), 0))

    @classmethod
    def structure(
        cls,
        *,
        poles: int,
        zeros: int,
        delay: float | str = 0.0,
        hold: Hold = "zoh",
        sample: Sample = "start",
        initial: Literal["rest", "free"] | None = None,
    ) -> "TransferFunctionStructure":
        """Numbers of poles and zeros for `hysim.identify`, and how the record was sampled.

        Parameters
        ----------
        poles, zeros : int
            Their numbers, zeros <= poles.
        delay : float or "free"
            The dead time [s]. ``"free"`` has it identified, from 0 to a quarter of the record unless
            ``bounds={"delay": (lower, upper)}`` says otherwise; it need not be a whole number of samples.
        hold, sample : str
            As in the constructor.
        initial : {"rest", "free"}, optional
            Whether the initial state is zero, or identified; by default the one with the lower BIC on the record.

        Returns
        -------
        TransferFunctionStructure

        Raises
        ------
        ValueError, TypeError
            If the numbers do not fit, or an option is unknown.

        Examples
        --------
        >>> import hysim as hs
        >>> fit = hs.identify(hs.TransferFunction.structure(poles=4, zeros=1), hs.datasets.table1(dwell=1.0))
        >>> fit.n_parameters, round(fit.fit_percent, 1)
        (6, 91.5)
        """
        if isinstance(delay, str) and delay != "free":
            raise ValueError(f'delay must be a number of seconds or "free", got {delay!r}')
        return TransferFunctionStructure(
            poles=poles,
            zeros=zeros,
            delay=None if isinstance(delay, str) else delay,
            hold=hold,
            sample=sample,
            initial=initial,
        )

    @classmethod
    def candidates(cls) -> dict[str, "TransferFunctionStructure"]:
        """Two poles and one zero for `hysim.compare`: one mode, or a lag with a creep."""
        return {cls.__name__: cls.structure(poles=2, zeros=1)}

    @classmethod
    def structures(
        cls,
        *,
        poles: Iterable[int] = range(1, 6),
        zeros: Iterable[int] | None = None,
        delays: Iterable[float | str] = (0.0,),
        hold: Hold = "zoh",
        sample: Sample = "start",
        initial: Literal["rest", "free"] | None = None,
    ) -> dict[str, "TransferFunctionStructure"]:
        """Candidates for `hysim.select`: a structure for every combination of the numbers and delays, by its name.

        `zeros` below the number of poles are taken, by default all; other arguments and errors as in `structure`.

        Examples
        --------
        >>> import hysim as hs
        >>> list(hs.TransferFunction.structures(poles=(1, 2), delays=(0.0, "free")))[1:3]
        ['1 pole, 0 zeros, free delay', '2 poles, 0 zeros']
        """
        numbers, late = None if zeros is None else set(zeros), tuple(delays)
        results = [
            cls.structure(poles=n, zeros=m, delay=delay, hold=hold, sample=sample, initial=initial)
            for n in poles
            for m in range(n)
            if numbers is None or m in numbers
            for delay in late
        ]
        return {str(structure): structure for structure in results}

    def _plant(self, sample_time: float) -> LinearPlants:
        with np.errstate(all="ignore"):
            numerator = np.concatenate([np.zeros(self.order + 1 - len(self.num)), self.num]) / self.den[0]
            monic = np.array(self.den[1:]) / self.den[0]
        return LinearPlants.of(monic[np.newaxis], numerator[np.newaxis], np.array([self.delay]), sample_time)


@checked
class TransferFunctionStructure(Subject, Composable):
    """The shape of a transfer function, to be identified; see `TransferFunction.structure`.

    The search runs over second-order sections s^2 + 2 zeta omega s + omega^2 (and one of first order for an odd number
    of poles) on log scales, stable by construction: omega from 0.1 rad over the whole record to the Nyquist rate, zeta
    from 0.001 to 30, so that real poles may lie at both ends. Resonances above the Nyquist rate fit noise: samples look
    the same as for those below. A free delay, here None, is searched up to a quarter of the record.
    """

    poles: int
    zeros: int
    delay: NotNegative | None = 0.0
    hold: Hold = "zoh"
    sample: Sample = "start"
    initial: Literal["rest", "free"] | None = None

    def __post_init__(self) -> None:
        _check_sample(self.hold, self.sample)
        if not all(isinstance(number, int) for number in (self.poles, self.zeros)):
            raise TypeError(f"numbers of poles and zeros must be int, got {self!r}")
        if not 0 <= self.zeros <= self.poles or self.poles < 1:
            raise ValueError(f"there must be at least one pole, and no more zeros than poles, got {self!r}")

    def __str__(self) -> str:
        poles, zeros = (f"{n} {what}{'s' * (n != 1)}" for n, what in ((self.poles, "pole"), (self.zeros, "zero")))
        late = ", free delay" if self.delay is None else f", delay {self.delay:g} s" if self.delay else ""
        return f"{poles}, {zeros}{late}"

    @property
    def columns(self) -> tuple[str, ...]:
        return (*(f"num[{k}]" for k in range(self.zeros + 1)), *(f"x0[{k}]" for k in range(self.poles)))

    @property
    def denominator(self) -> tuple[str, ...]:
        """The denominator's names, which are searched; ``den[0]`` is one."""
        return tuple(f"den[{k}]" for k in range(1, self.poles + 1))

    @property
    def sampling(self) -> dict[str, str]:
        """How the record was sampled, by the names of `affine_columns`."""
        return {"hold": self.hold, "sample": self.sample}

    @property
    def free_delay(self) -> tuple[str, ...]:
        return ("delay",) if self.delay is None else ()

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        sample_time = record.sample_time
        if np.ptp(record.u) == 0.0 and record.u[0] == 0.0:
            raise ValueError("the input is zero throughout: nothing can be identified from it")
        names = (*self.denominator, *self.free_delay, *self.columns)
        defaults = dict.fromkeys(names, 0.0)
        for name in (*freedom.fixed, *freedom.bounds):
            if name in self.denominator:
                raise ValueError(f"{name!r} cannot be fixed or bounded: the denominator is searched by its sections")
        at_rest = self.columns[self.zeros + 1 :] if freedom.starts_at_rest(self.initial or "rest") else ()
        held = freedom.held(defaults, at_rest=at_rest)
        limits = freedom.limits(defaults, held)
        known_delay = held.get("delay", self.delay)
        earliest, latest = limits.pop("delay", (0.0, LATEST * len(record) * sample_time))
        if min(earliest, known_delay or 0.0) < 0.0 or not latest < np.inf:
            raise ValueError(f"a delay must not be negative or infinite, got {known_delay or (earliest, latest)}")
        pairs = self.poles // 2
        low, high = np.log(FREQUENCY[0] / len(record)), np.log(FREQUENCY[1])
        coordinates = [f"{what}[{k}]" for k in range(pairs) for what in ("log frequency", "log damping")]
        box = [(low, high), (float(np.log(DAMPING[0])), float(np.log(DAMPING[1])))] * pairs
        if self.poles % 2:
            coordinates.append("log rate")
            box.append((low, high))
        if known_delay is None:
            coordinates.append("delay")
            box.append((earliest / sample_time, latest / sample_time))
        lower, upper = np.array(box).T
        starts, agreed = self._starts(record, lower, upper, known_delay, at_rest=bool(at_rest))
        return SearchSpace.of(
            names,
            self.columns,
            held,
            coordinates=tuple(coordinates),
            lower=lower,
            upper=upper,
            starts=starts,
            screened=None if len(record) < _LONG else 0 if agreed else _SCREENED,
            parameters=lambda x: self._searched(np.atleast_2d(x), sample_time, known_delay),
            bounds=limits,
            state=self.columns[self.zeros + 1 :],
            physical={name: _PHYSICAL[name.partition("[")[0]] for name in coordinates},
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        delay = parameters["delay"] if self.delay is None else self.delay
        monic, step = self.monic(parameters), record.sample_time
        return affine_columns(monic, record.u, step, delay, zeros=self.zeros, **self.sampling)

    def monic(self, parameters: Parameters) -> FloatArray:
        """Denominators without their leading one, (n_sets, n)."""
        return np.stack([np.atleast_1d(parameters[name]) for name in self.denominator], axis=1)

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """Rest where input and output begin at zero, else what the record says; empty if the structure says it."""
        if self.initial is not None:
            return ()
        slack = _AT_ZERO * float(np.ptp(record.y))
        begins_at_zero = record.u[0] == 0.0 and abs(record.y[0]) <= slack
        return ("rest",) if begins_at_zero else ("rest", "free")

    def with_unit_gain(self) -> search.UnitGain:
        """The structure with the gain at rest one, for use with a stage that carries the gain."""
        return search.UnitGain(self)

    def assemble(self, parameters: Mapping[str, float]) -> TransferFunction:
        initial_state = tuple(parameters[f"x0[{k}]"] for k in range(self.poles))
        return TransferFunction(
            num=tuple(parameters[f"num[{k}]"] for k in range(self.zeros + 1)),
            den=(1.0, *(parameters[name] for name in self.denominator)),
            delay=parameters["delay"] if self.delay is None else self.delay,
            hold=self.hold,
            sample=self.sample,
            initial_state=initial_state if any(initial_state) else (),
        )

    def notes(self, record: Record, model: TransferFunction) -> tuple[str, ...]:
        n_parameters = self.poles + self.zeros + 1 + len(self.free_delay)
        return search.notes(record, model.response(record.u, record.sample_time), n_parameters)

    def _starts(
        self, record: Record, lower: FloatArray, upper: FloatArray, delay: float | None, *, at_rest: bool
    ) -> tuple[FloatArray, bool]:
        """Starts by regression on a long record, and whether they suffice: those of one delay must agree."""
        if len(record) < _LONG:
            return np.empty((0, lower.size)), False
        h = record.sample_time
        delays = search.likely_delays(record, lower[-1] * h, upper[-1] * h) if delay is None else [delay]
        results = search.guesses(self, record, delays, at_rest=at_rest)
        starts = np.array([self._coordinates(each, h)[: lower.size] for each in results]).reshape(-1, lower.size)
        starts = np.clip(starts, lower, upper)
        if delay is None or len(starts) < _MAJORITY:
            return starts, len(starts) >= _MAJORITY
        apart = np.abs(starts - np.median(starts, axis=0))
        return starts, bool(np.sum((apart < _AGREED * (upper - lower)).all(axis=1)) >= _MAJORITY)

    def _coordinates(self, guess: search.Guess, sample_time: float) -> FloatArray:
        return np.append(search.sections(guess.poles, sample_time), guess.delay / sample_time)

    def _searched(self, x: FloatArray, sample_time: float, delay: float | None) -> dict[str, FloatArray]:
        columns = search.denominators(x, self.poles).T
        results = {name: columns[k] / sample_time**k for k, name in enumerate(self.denominator, 1)}
        late = x[:, -1] * sample_time if delay is None else np.full(len(x), delay)
        return results | dict.fromkeys(self.free_delay, late)


def _check_sample(hold: str, sample: str) -> None:
    if (hold, sample) == ("foh", "end"):
        raise ValueError('sample="end" needs an input that is held, hold="zoh"')


@family
class StateSpace:
    """A linear stage with one input and one output.

    ``x' = A x + B u(t - delay)`` and ``y = C x + D u(t - delay)``

    Parameters
    ----------
    A : array, shape (n, n)
        [1/s]
    B, C : array, shape (n,)
        Input and output.
    D, delay : float
        What passes through [unit of y / unit of u], and dead time [s], not negative.

    Raises
    ------
    ValueError
        If shapes do not fit, or the delay is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.StateSpace(A=[[-2.0]], B=[1.0], C=[3.0])
    >>> lag.dc_gain, lag.poles.real.tolist()
    (1.5, [-2.0])
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float = 0.0
    delay: NotNegative = 0.0

    def __post_init__(self) -> None:
        n = self.B.size
        if self.A.shape != (n, n) or self.B.shape != (n,) or self.C.shape != (n,):
            raise ValueError(
                f"A, B and C must have the shapes (n, n), (n,) and (n,), got {self.A.shape}, {self.B.shape} and "
                f"{self.C.shape}"
            )

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues of A [rad/s]."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @property
    def dc_gain(self) -> float:
        """Output under a constant input of one, at rest; infinite with a pole at zero."""
        rest = resting_states(self.A, self.B)
        return self.D + float(self.C @ rest) if np.isfinite(rest).all() else math.inf


def resting_states(A: FloatArray, B: FloatArray) -> FloatArray:
    """The x with A x + B = 0; infinite where A is singular."""
    try:
        return np.asarray(np.linalg.solve(A, -B))
    except np.linalg.LinAlgError:
        return np.full(B.size, math.inf)


def linear_plant(system: Any) -> Any:
    """A system of another package as a plant of hysim; ValueError if it is discrete or has several signals."""
    by_matrices = all(hasattr(system, name) for name in "ABCD")  # systems of SciPy and python-control share no class
    own = isinstance(system, StateSpace | TransferFunction)
    if own or not (by_matrices or all(hasattr(system, name) for name in ("num", "den"))):
        return system
    if getattr(system, "dt", None):
        raise ValueError(f"vibration must be a system in continuous time, got one with dt = {system.dt}")
    if by_matrices:
        A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
        if D.size != 1:
            raise ValueError(f"vibration must have one input and one output, got D of the shape {D.shape}")
        return StateSpace(A=A, B=B.ravel(), C=C.ravel(), D=float(D.item()))
    return TransferFunction(num=_polynomial(system.num), den=_polynomial(system.den))


def _polynomial(coefficients: Any) -> tuple[float, ...]:
    """Coefficients as such, or as the one entry of a matrix of them."""
    while len(coefficients) == 1 and isinstance(coefficients[0], Sized):
        coefficients = coefficients[0]
    if isinstance(coefficients[0], Sized):
        raise ValueError("vibration must have one input and one output, got a matrix of transfer functions")
    return tuple(float(value) for value in np.trim_zeros(np.asarray(coefficients), "f")) or (0.0,)


def mode(natural_frequency: float, damping_ratio: float, gain: float = 1.0, *, delay: float = 0.0) -> TransferFunction:
    """One resonance as a transfer function, ``exp(-delay s) gain w^2 / (s^2 + 2 zeta w s + w^2)``.

    The natural frequency w is positive [rad/s], the damping ratio zeta and the delay [s] are not negative, else
    ValueError; the gain is that at rest [unit of y / unit of its input].

    Examples
    --------
    >>> import hysim as hs
    >>> hs.mode(2.0, 0.1).den
    (1.0, 0.4, 4.0)
    """
    check_positive(natural_frequency=natural_frequency)
    check_not_negative(damping_ratio=damping_ratio)
    damping, stiffness = 2.0 * damping_ratio * natural_frequency, natural_frequency**2
    return TransferFunction(num=(gain * stiffness,), den=(1.0, damping, stiffness), delay=delay)


@family
class Modes:
    """Several resonances side by side.

    ::

        G(s) = exp(-delay s) sum_i  g_i w_i^2 / (s^2 + 2 zeta_i w_i s + w_i^2)
        d/dt (q_i, q_i' / w_i) = w_i [[0, 1], [-1, -2 zeta_i]] (q_i, q_i' / w_i) + (0, w_i v),    y = sum g_i q_i

    Parameters
    ----------
    natural_frequencies, damping_ratios : sequence of float
        Positive [rad/s], and not negative.
    gains : sequence of float
        Static gains; their sum is the gain at rest [unit of y / unit of the input].
    delay : float
        Dead time [s], not negative.

    Raises
    ------
    ValueError
        If lengths differ or a number is outside its range.

    Examples
    --------
    >>> import hysim as hs
    >>> pair = hs.Modes(natural_frequencies=(3.0, 20.0), damping_ratios=(0.01, 0.02), gains=(0.9, 0.1))
    >>> pair.dc_gain, pair.poles.size
    (1.0, 4)
    """

    natural_frequencies: tuple[float, ...]
    damping_ratios: tuple[float, ...]
    gains: tuple[float, ...]
    delay: NotNegative = 0.0

    def __post_init__(self) -> None:
        modes = {name: vars(self)[name] for name in ("natural_frequencies", "damping_ratios", "gains")}
        frozen.check_lengths(empty=False, **modes)
        check_positive(natural_frequencies=min(self.natural_frequencies))
        check_not_negative(damping_ratios=min(self.damping_ratios))

    @property
    def dc_gain(self) -> float:
        """Sum of the static gains."""
        return float(sum(self.gains))

    @property
    def poles(self) -> npt.NDArray[np.complex128]:
        """Two of each mode [rad/s]."""
        w, zeta = np.array(self.natural_frequencies), np.array(self.damping_ratios)
        apart = np.sqrt(zeta.astype(complex) ** 2 - 1.0)
        return np.concatenate([w * (-zeta + apart), w * (-zeta - apart)])

    @property
    def state_space(self) -> StateSpace:
        """The states (q_i, q_i' / w_i) of each mode."""
        n = len(self.gains)
        A, B, C = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.zeros(2 * n)
        for i, (w, zeta) in enumerate(zip(self.natural_frequencies, self.damping_ratios, strict=True)):
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, w], [-w, -2.0 * zeta * w]]
        B[1::2], C[::2] = self.natural_frequencies, self.gains
        return StateSpace(A=A, B=B, C=C, delay=self.delay)
