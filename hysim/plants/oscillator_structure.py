"""An oscillator to be identified, and how its record was made.

    fine input -> steps of the method -> y at the fine rate -> low-pass filters -> every r-th sample, the record

The law is that of Bouc and Wen with gain 1: a gain of the memory could not be told from A, beta and gamma, nor a
feedthrough from the stiffness. Stiffness and A are told apart by the memory's own curvature alone. The output is
affine in no parameter: all are searched.

The search begins with input and output: for known y the equation of motion is linear in what multiplies known signals,

    m y'' + c y' + k y + A w(y) = F,    dw/dy = 1 - |w|^n (g + b sign(w y')),

where w is the memory of a law with A = 1, exact along the measured y. What is left to search is (b, g, n), which costs
no simulation of the plant.

**The equation along a displacement**, m y'' + c y' + k y + z = F, is filtered: both sides go through 1/D(s), D = m s^2
+ c s + K of a linear plant: noise is not differentiated, and the equation's error becomes about one of the displacement
(Sanathanan and Koerner 1963, Steiglitz and McBride 1965). The nearest linear plant is that without z, D its last
result. A period is filtered by its spectrum, others in time from rest.

**Other rates.** A periodic input that holds no line above half its rate is brought to a higher one by its spectrum. So
is one from rest, which goes on at both ends as linear prediction continues it (J. P. Burg, 1967), and fades. The output
comes back by stages of a symmetric 31-tap Hamming low-pass each, with the cutoff at half of the new rate, without
delay, every r-th sample kept. Beyond its ends a periodic signal repeats itself, any other is mirrored at the end point.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
import scipy

from hysim._basics.frozen import Count, FloatArray, check_whole, checked, read_only
from hysim._basics.parallel import in_chunks
from hysim.errors import SimulationError
from hysim.kernels import boucwen as kernels
from hysim.laws.differential.boucwen import BoucWen
from hysim.models.protocols import Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record, span_of

Excitation = Literal["force", "base"]
Method = Literal["split", "runge-kutta", "newmark", "strang"]
METHODS: tuple[Method, ...] = get_args(Method)
"""Ways to step an oscillator."""

_ROUNDS = 20  # of the linear fit: it settles in five to ten
_SETTLED = 1e-9
_DAMPING = (1e-3, 2.0)  # damping ratio of D
_HIGHEST = 3.0  # lines up to this multiple of the highest excited one are compared
_EXCITED = 1e-3  # share of the largest line of the input
HALF_FILTER = 15
_BEYOND = 128  # samples by which a record is continued at either end
_PREDICTING = 32  # samples from which the next one is predicted


class Motion(NamedTuple):
    """Force and displacement, (n_samples,), every `sample_time`: one period, or all since rest."""

    force: FloatArray
    y: FloatArray
    sample_time: float
    periodic: bool


class Linear(NamedTuple):
    """The linear plant nearest to a record."""

    mass: float
    damping: float
    stiffness: float


Filter = Callable[[FloatArray, int], FloatArray]
"""Signals (..., n_samples) and a power k to s^k mass / D(s) of them, shape (..., n_compared)."""


def linear_plant(motion: Motion) -> Linear | None:
    """The linear plant nearest to the record; None if its mass or stiffness is not positive."""
    frequency = _resonance(motion)
    plant = Linear(1.0, 0.2 * frequency, frequency**2)
    for _ in range(_ROUNDS):
        filtered = filtering(motion, plant)
        columns = np.stack([filtered(motion.y, power) for power in (2, 1, 0)], axis=1)
        mass, damping, stiffness = regression(columns, filtered(motion.force, 0))
        if not (mass > 0.0 and stiffness > 0.0):
            return None
        last, plant = plant, checked_plant(mass, damping, stiffness)
        if np.allclose(plant, last, rtol=_SETTLED, atol=0.0):
            break
    return plant


def checked_plant(mass: float, damping: float, stiffness: float) -> Linear:
    """The plant with a damping ratio that a filter can have."""
    critical = 2.0 * math.sqrt(mass * stiffness)
    return Linear(mass, min(max(damping, _DAMPING[0] * critical), _DAMPING[1] * critical), stiffness)


def regression(columns: FloatArray, target: FloatArray) -> list[float]:
    size = np.linalg.norm(columns, axis=0)
    solution: list[float] = (np.linalg.lstsq(columns / size, target, rcond=None)[0] / size).tolist()
    return solution


def filtering(motion: Motion, plant: Linear) -> Filter:
    """mass / D(s) of a plant: on the spectrum of one period, real parts before imaginary ones, or in time from rest."""
    denominator = [each / plant.mass for each in plant]  # else a light plant and a heavy one overflow
    if motion.periodic:
        s = 2j * np.pi * np.fft.rfftfreq(motion.y.size, motion.sample_time)
        force = np.abs(np.fft.rfft(motion.force))
        highest = np.flatnonzero(force > _EXCITED * force[1:].max())[-1]
        s = s[1 : int(_HIGHEST * highest) + 1]

        def by_spectrum(signals: FloatArray, power: int) -> FloatArray:
            spectrum = np.fft.rfft(signals)[..., 1 : s.size + 1] * (s**power / np.polyval(denominator, s))
            return np.concatenate([spectrum.real, spectrum.imag], axis=-1)

        return by_spectrum

    numerators, poles, _ = scipy.signal.cont2discrete((np.eye(3)[::-1], denominator), motion.sample_time, "foh")

    def in_time(signals: FloatArray, power: int) -> FloatArray:
        return np.asarray(scipy.signal.lfilter(numerators[power], poles, signals, axis=-1))

    return in_time


def _resonance(motion: Motion) -> float:
    """Angular frequency at which the output is largest for its input, among the lines that are excited [rad/s]."""
    force, y = (np.abs(np.fft.rfft(signal - signal.mean())) for signal in (motion.force, motion.y))
    excited = np.flatnonzero(force > 0.1 * force.max())
    line = excited[np.argmax(y[excited] / force[excited])]
    return float(2.0 * np.pi * max(line, 1) / (motion.y.size * motion.sample_time))


def interpolated(period: FloatArray, factor: int) -> FloatArray:
    """One period (n,) at `factor` times the rate; a line at half the old rate is shared by both of its signs."""
    if factor == 1:
        return period
    spectrum = np.fft.rfft(period)
    if period.size % 2 == 0:
        spectrum[-1] *= 0.5
    return np.asarray(np.fft.irfft(spectrum, factor * period.size) * factor)


def interpolated_record(u: FloatArray, factor: int) -> FloatArray:
    """A record (n,) at `factor` times the rate, from its first to its last sample, shape ((n - 1) factor + 1,)."""
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, _BEYOND + 1) / _BEYOND)
    weights = _prediction(u, min(_PREDICTING, u.size // 3))
    behind = _continued(u, weights) * fade
    before = _continued(u[::-1], weights) * fade
    fine = interpolated(np.concatenate([before[::-1], u, behind]), factor)
    return fine[_BEYOND * factor : (_BEYOND + u.size - 1) * factor + 1]


def _prediction(u: FloatArray, order: int) -> FloatArray:
    """Weights of the last samples, the latest first, that predict the next one, by Burg's method; they are stable."""
    ahead, behind, weights = u[1:], u[:-1], np.empty(0)
    for _ in range(order):
        power = float(ahead @ ahead + behind @ behind)
        k = 2.0 * float(ahead @ behind) / power if power > 0.0 else 0.0
        weights = np.append(weights - k * weights[::-1], k)
        ahead, behind = (ahead - k * behind)[1:], (behind - k * ahead)[:-1]
    return weights


def _continued(u: FloatArray, weights: FloatArray) -> FloatArray:
    """The samples after the last one as far as they can be predicted."""
    values = np.concatenate([u[u.size - weights.size :], np.zeros(_BEYOND)])
    for k in range(weights.size, values.size):
        values[k] = weights @ values[k - weights.size : k][::-1]
    return values[weights.size :]


def without_spikes(y: FloatArray) -> FloatArray:
    """The output with each sample that stands out from its neighbours, as no mass moves, on the cubic through them."""
    cubic = np.convolve(y, np.array([-1.0, 4.0, 0.0, 4.0, -1.0]) / 6.0, mode="valid")
    apart = np.pad(np.abs(y[2:-2] - cubic), 2)
    stands_out = (apart > _SPIKE * np.median(apart)) & (apart == scipy.ndimage.maximum_filter1d(apart, 5))
    return np.where(stands_out, np.pad(cubic, 2), y)


def decimated(y: FloatArray, stages: Sequence[int], *, periodic: bool = False) -> FloatArray:
    """Every (product of stages)-th sample of `y`, filtered stage by stage, with more than 15 samples at each."""
    for factor in stages:
        y = _stage(y, factor, periodic)
    return y


def _stage(y: FloatArray, factor: int, periodic: bool) -> FloatArray:
    taps = scipy.signal.firwin(2 * HALF_FILTER + 1, 1.0 / factor)
    if periodic:
        before, after = y[-HALF_FILTER:], y[:HALF_FILTER]
    else:
        before, after = 2.0 * y[0] - y[HALF_FILTER:0:-1], 2.0 * y[-1] - y[-2 : -2 - HALF_FILTER : -1]
    # the first of the filtered outputs is number 2 * HALF_FILTER of the convolution: zeros move it onto the grid
    lead = np.zeros(-2 * HALF_FILTER % factor)
    filtered = scipy.signal.upfirdn(taps, np.concatenate([lead, before, y, after]), down=factor)
    first = (lead.size + 2 * HALF_FILTER) // factor
    return np.asarray(filtered[first : first - (-y.size // factor)])


_MOST_STEPS = 1000  # between two samples: a mass with less inertia than asks for more cannot be told from none
_COARSE = 0.1  # of the residual, an error of the steps that is said
_NOISE_FREE = 1e-6  # of the range of the output, an error that matters even to a record without noise
_AT_REST = 0.2  # of the standard deviation of the output: less may be an offset or noise
_FREQUENCIES = 8  # tried where no linear plant is near
_SCREENED = 256
_WORSE = 10.0  # times the least error of a start, with which another one is a rival of it
_IMPROVED = 6  # of the screened points: with 3, two of 160 random plants with a free n ended too early (by hand)
_APART, _SAME = 0.1, 0.03  # distances in units of the box: of points to be improved, and of what becomes of them
NAMES = ("mass", "damping", "stiffness", "A", "beta", "gamma", "n")
_PLANT, _LAW = NAMES[:3], NAMES[3:]
_SCALED = NAMES[:4]  # a base pushes with the mass: only the ratios of these can be told
_REST_OF_LAW = {"z0": 0.0, "gain": 1.0, "offset": 0.0, "feedthrough": 0.0}
_BOX = {"mass": (0.1, 10.0), "damping": (0.0, 2.0), "stiffness": (-10.0, 10.0), "A": (0.0, 10.0)}
_STARTS = 2
_SPIKE = 20.0  # times the median distance from the cubic through the neighbours: normal noise of 1e6 samples has 7.3
_REPEATS = 0.1  # share of the input's rms by which a period may differ from the mean one: measured inputs are noisy


def start(motion: Motion, laws: SearchSpace, wanted: int) -> tuple[Linear, list[dict[str, float]]]:
    """The plant of small motions, and the best sets of mass, damping, stiffness, A, beta, gamma, n."""
    nearest = linear_plant(motion)
    starts = _starts(motion, nearest, laws, wanted) if nearest else _starts_from_afar(motion, laws, wanted)
    sets = [each for _, each in starts]
    if sets:
        return _small_motions(sets[0]), sets
    if nearest is None:
        raise ValueError(
            "the record is not that of a mass on springs: no plant with a positive mass is near; check the sign of u "
            "and y, the time, excitation=, and that the record begins at rest"
        )
    return nearest, sets


def _starts_from_afar(motion: Motion, laws: SearchSpace, wanted: int) -> list[tuple[float, dict[str, float]]]:
    """As `_starts`, with the filter that the best set asks for which is found with any filter."""
    frequencies = np.geomspace(4.0 / motion.y.size, 1.0, _FREQUENCIES) / motion.sample_time
    tried = [each for w in frequencies for each in _starts(motion, Linear(1.0, 0.2 * w, w**2), laws, 1)]
    best = sorted(tried, key=lambda each: each[0])[:1]
    return [again for _, each in best for again in _starts(motion, _small_motions(each), laws, wanted)] or best


def _small_motions(values: Mapping[str, float]) -> Linear:
    return checked_plant(values["mass"], values["damping"], values["stiffness"] + values["A"])


def _starts(motion: Motion, plant: Linear, laws: SearchSpace, wanted: int) -> list[tuple[float, dict[str, float]]]:
    """The best sets with the share of the force that each leaves unexplained, in the order of these."""
    from scipy.optimize import minimize

    equation = _Equation(motion, plant, laws)

    def error(x: FloatArray) -> float:
        return float(equation.errors(np.clip(x, laws.lower, laws.upper)[np.newaxis])[0])

    points = np.concatenate([laws.starts, _spread(laws)])
    chosen = _apart(laws, points, equation.errors(points), _APART)[:_IMPROVED]
    options = {"xatol": 3e-3, "fatol": 1e-5 * equation.linear_error, "maxfev": 100}
    reached = [minimize(error, points[k], method="Nelder-Mead", options=options) for k in chosen]
    ends = np.clip([each.x for each in reached], laws.lower, laws.upper).reshape(-1, laws.lower.size)
    errors = np.array([each.fun for each in reached])
    sets = [(float(errors[k]), equation.parameters(ends[k])) for k in _apart(laws, ends, errors, _SAME)]
    likely = [(e, p) for e, p in sets if e <= _WORSE * sets[0][0]]
    return [(e, p) for e, p in likely if min(p["mass"], p["A"], p["stiffness"] + p["A"]) > 0.0][:wanted]


class _Equation:
    """The equation of motion along a measured displacement, for many laws at once."""

    def __init__(self, motion: Motion, plant: Linear, laws: SearchSpace) -> None:
        self.laws, self.filtered, self.periodic = laws, filtering(motion, plant), motion.periodic
        self.along = read_only(np.tile(motion.y, 2) if motion.periodic else motion.y)
        self.known = np.stack([self.filtered(motion.y, power) for power in (2, 1, 0)], axis=1)
        self.basis = np.linalg.qr(self.known)[0]
        self.target = self.filtered(motion.force, 0)
        self.left = self.target - self.basis @ (self.basis.T @ self.target)
        self.size = float(self.target @ self.target)
        self.linear_error = float(self.left @ self.left) / self.size or 1.0

    def memories(self, x: FloatArray) -> FloatArray:
        """Filtered memories (n_sets, n_compared) of the laws at the coordinates x."""
        law = self.laws.parameters(x)
        names = ("A", "beta", "gamma", "n", "z0")
        memory = read_only(np.stack([np.broadcast_to(law[name], len(x)) for name in names], axis=1))
        output = read_only(np.tile([1.0, 0.0, 0.0], (len(x), 1)))
        w = np.empty((len(x), self.along.size))

        def work(begin: int, end: int) -> None:
            kernels.batch(memory[begin:end], output[begin:end], self.along[np.newaxis], w[begin:end])

        in_chunks(work, len(x), minimum=8)
        if self.periodic:
            w = w[:, self.along.size // 2 :]
        with np.errstate(invalid="ignore", over="ignore"):
            return self.filtered(w, 0)

    def errors(self, x: FloatArray) -> FloatArray:
        """Share of the force's sum of squares that the best mass, damping, stiffness and A leave, (n_sets,)."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            w = self.memories(x)
            w = w - (w @ self.basis) @ self.basis.T
            errors = self.linear_error - (w @ self.left) ** 2 / np.sum(w**2, axis=1) / self.size
        return np.where(np.isfinite(errors), errors, np.inf)

    def parameters(self, x: FloatArray) -> dict[str, float]:
        columns = np.column_stack([self.known, self.memories(x[np.newaxis])[0]])
        mass, damping, stiffness, A = regression(columns, self.target)
        law = {name: float(value[0]) for name, value in self.laws.parameters(x[np.newaxis]).items()}
        unit = abs(A) ** (1.0 - law["n"]) if A else 1.0  # z = A w
        shape = {"beta": law["beta"] * unit, "gamma": law["gamma"] * unit, "n": law["n"]}
        return {"mass": mass, "damping": damping, "stiffness": stiffness, "A": A, **shape}


def _spread(laws: SearchSpace) -> FloatArray:
    from scipy.stats import qmc

    unit = qmc.Sobol(laws.lower.size, scramble=False).random(_SCREENED)
    return np.asarray(laws.lower + unit * (laws.upper - laws.lower))


def _apart(laws: SearchSpace, points: FloatArray, errors: FloatArray, distance: float) -> list[int]:
    """Finite points, best first, that are farther from each other than `distance`, in units of the box."""
    unit = (points - laws.lower) / (laws.upper - laws.lower)
    ranked = np.argsort(errors, kind="stable")
    chosen: list[int] = []
    for k in ranked[np.isfinite(errors[ranked])].tolist():
        if all(np.abs(unit[k] - unit[other]).max() > distance for other in chosen):
            chosen.append(k)
    return chosen


@checked
class OscillatorStructure(Subject):
    """An oscillator to be identified; see `BoucWenOscillator.structure`, whose class is `family`.

    The box reaches from a tenth of the mass that the search begins with to ten times that mass, from no damping to
    twice the critical one or that of small motions, and to ten times the stiffness of small motions for both springs;
    that of the law is the one of `hysim.BoucWen`, with the displacement as its input and A not negative.
    """

    runs_as_searched: ClassVar[bool] = False
    family: type
    method: Method = "split"
    oversampling: Count = 4
    decimation: tuple[int, ...] = ()
    initial: Literal["rest", "periodic"] = "rest"
    period: Count | None = None
    hold: Literal["foh", "zoh", "band-limited"] = "foh"
    excitation: Excitation = "force"

    def __post_init__(self) -> None:
        for factor in self.decimation:
            check_whole(factor, "decimation")
        if self.decimation and np.prod(self.decimation) != self.oversampling:
            raise ValueError(
                f"the stages of decimation must multiply to the oversampling {self.oversampling}, got {self.decimation}"
            )
        if (self.initial == "periodic") != (self.period is not None):
            raise ValueError('initial="periodic" takes a period in samples, and nothing else does')

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        if freedom.initial is not None:
            raise ValueError("the structure says how the record begins: BoucWenOscillator.structure(initial=...)")
        motion = self.motion(record)
        redundant = (_SCALED,) if self.excitation == "base" else ()
        held = freedom.held(dict.fromkeys(NAMES, 1.0), redundant=redundant)
        limits = freedom.limits(dict.fromkeys(NAMES, 1.0), held)
        linear, starts = start(motion, _unit_laws(motion.y, held, limits), _STARTS)
        starts = starts or [_without_memory(linear)]
        factor = _factor(starts[0], held) if redundant else 1.0
        starts, linear = [_scaled(each, factor) for each in starts], Linear(*(factor * value for value in linear))
        box = _Box(held, _limits(linear, held, limits), Record(u=motion.y, y=linear.stiffness * motion.y))
        laws = box.laws(starts[0])
        return SearchSpace.of(
            NAMES,
            (),
            held,
            coordinates=(*box.plant, *laws.coordinates),
            lower=np.concatenate([box.side(0), laws.lower]),
            upper=np.concatenate([box.side(1), laws.upper]),
            starts=np.array([box.encode(one) for one in starts]),
            parameters=lambda x: box.decode(np.atleast_2d(x), laws),
            physical={**laws.physical, **dict.fromkeys(("damping", "A"), (True, False))},
            redundant=redundant,
            screened=0,
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output itself, shape (n_sets, n_samples, 1), sets on threads; inf for a set that diverges."""
        sets = np.stack(np.broadcast_arrays(*(np.atleast_1d(parameters[name]) for name in NAMES)), axis=1)
        outputs = np.empty((len(sets), len(record), 1))

        def simulate(begin: int, end: int) -> None:
            for k in range(begin, end):
                plant = replace(self.assemble(dict(zip(NAMES, sets[k].tolist(), strict=True))), substeps=1)
                outputs[k, :, 0] = self._output(plant, record)

        in_chunks(simulate, len(sets), minimum=1)
        return outputs

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The oscillator with these parameters, its steps as fine as those of the identification."""
        return self.family(
            mass=parameters["mass"],
            damping=parameters["damping"],
            stiffness=parameters["stiffness"],
            law=BoucWen(**{name: parameters[name] for name in _LAW}),
            excitation=self.excitation,
            hold="foh" if self.hold == "band-limited" else self.hold,
            method=self.method,
            substeps=self.oversampling,
        )

    def standing(self, model: Any, record: Record) -> Any:
        """The oscillator at the first sample of a record that repeats itself: in the steady state, if it has one."""
        if self.period is None:
            return model
        force, step = self.fine_input(record.u), record.sample_time / self.oversampling
        try:
            y, velocity, z = replace(model, substeps=1).steady_motion(force, step)[0].tolist()
        except SimulationError:
            return model
        return replace(model, initial_state=(y, velocity), law=replace(model.law, z0=z))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """A beginning that is not at rest, and the error of the steps, where that is not small next to the residual."""
        moves = self.period is None and abs(float(record.y[0])) > _AT_REST * float(record.y.std())
        begin = ("the record does not begin at rest, as is assumed: cut it where the mass rests at zero",) * moves
        if self.method != "split":
            return begin
        coarse, fine = (self._output(replace(model, substeps=substeps), record) for substeps in (1, 2))
        error, rmse = (float(np.sqrt(np.mean((coarse - other) ** 2))) for other in (fine, record.y))
        text = f"the steps are too coarse: with twice as many the output moves by {error:.2g} rms, give oversampling="
        return begin + (text,) * (error > max(_COARSE * rmse, _NOISE_FREE * float(np.ptp(record.y))))

    def _output(self, plant: Any, record: Record) -> FloatArray:
        force, step = self.fine_input(record.u), record.sample_time / self.oversampling
        run = plant.response if self.period is None else plant.periodic_response
        try:
            y = run(force, step) if plant.steps_of(step) <= _MOST_STEPS else np.full(force.size, np.inf)
        except SimulationError:
            y = np.full(force.size, np.inf)
        return np.resize(self.sampled(y), len(record))

    def motion(self, record: Record) -> Motion:
        """Force and displacement from which the start is computed; of a periodic record, the mean period."""
        sample_time = record.sample_time
        span_of(record)  # which raises
        if len(record) <= 2 * HALF_FILTER:
            raise ValueError(f"the record must have more than {2 * HALF_FILTER} samples, got {len(record)}")
        u, y = self._mean_period(record.u), self._mean_period(without_spikes(record.y))
        if np.ptp(y) == 0.0:
            raise ValueError("the output is constant: nothing can be identified from it")
        difference = float((record.u - np.resize(u, len(record))).std() / record.u.std())
        if difference > _REPEATS:
            raise ValueError(
                f"u does not repeat itself every {self.period} samples: it differs from its mean period by "
                f"{100.0 * difference:.0f} % of its rms"
            )
        return Motion(u if self.excitation == "force" else -u, y, sample_time, self.period is not None)

    def _mean_period(self, signal: FloatArray) -> FloatArray:
        if self.period is None:
            return signal
        if signal.size < self.period:
            raise ValueError(f"the record holds {signal.size} samples, less than a period of {self.period}")
        n_full = signal.size // self.period * self.period
        return np.asarray(signal[:n_full].reshape(-1, self.period).mean(axis=0))

    def fine_input(self, u: FloatArray) -> FloatArray:
        u, factor = self._mean_period(u), self.oversampling
        if self.hold == "band-limited":
            return interpolated(u, factor) if self.period else interpolated_record(u, factor)
        if self.hold == "zoh":
            return np.repeat(u, factor) if self.period else np.repeat(u, factor)[: 1 - factor or None]
        places = np.arange(u.size * factor if self.period else (u.size - 1) * factor + 1) / factor
        return np.asarray(np.interp(places, np.arange(u.size + 1), np.append(u, u[0])))

    def sampled(self, y: FloatArray) -> FloatArray:
        if self.decimation:
            return decimated(y, self.decimation, periodic=self.period is not None)
        return y[:: self.oversampling]


class _Box(NamedTuple):
    """Coordinates of the free parameters: the mass on a log scale, the law by its own chart, others plain."""

    held: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]
    spring: Record  # displacement and force of a linear spring, which scale the law

    @property
    def plant(self) -> tuple[str, ...]:
        return tuple(name for name in _PLANT if name not in self.held)

    def side(self, which: int) -> FloatArray:
        """Lower (0) or upper (1) side of the plant's part."""
        return self._plant({name: self.limits[name][which] for name in self.plant})

    def _plant(self, values: Mapping[str, float]) -> FloatArray:
        return np.array([math.log(values[name]) if name == "mass" else values[name] for name in self.plant])

    def laws(self, values: Mapping[str, float]) -> SearchSpace:
        fixed = {name: value for name, value in self.held.items() if name in _LAW}
        bounds = {name: pair for name, pair in self.limits.items() if name in _LAW}
        law = BoucWen(**{name: values[name] for name in _LAW})
        return law.search_space(self.spring, Freedom(fixed | _REST_OF_LAW, (), bounds))

    def encode(self, values: Mapping[str, float]) -> FloatArray:
        """Coordinates (n_x,) inside the box."""
        plant = np.clip(self._plant(values), self.side(0), self.side(1))
        return np.concatenate([plant, self.laws(values).starts[0]])

    def decode(self, x: FloatArray, laws: SearchSpace) -> dict[str, FloatArray]:
        """All parameters, (n_sets,) each."""
        n_plant = len(self.plant)
        plant = {name: np.full(len(x), self.held[name]) for name in _PLANT if name in self.held}
        plant |= {name: np.exp(x[:, k]) if name == "mass" else x[:, k] for k, name in enumerate(self.plant)}
        law = laws.parameters(x[:, n_plant:])
        return plant | {name: law[name] for name in _LAW}


def _unit_laws(y: FloatArray, held: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> SearchSpace:
    """Laws with A = 1 along the displacement y; only n may be known."""
    fixed = {"A": 1.0, **_REST_OF_LAW} | {name: value for name, value in held.items() if name == "n"}
    bounds = {name: pair for name, pair in limits.items() if name == "n"}
    return BoucWen().search_space(Record(u=y, y=y), Freedom(fixed, (), bounds))


def _limits(
    linear: Linear, held: Mapping[str, float], user: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """The user's bounds, those of the plant and of A completed by the default box."""
    mass, damping, stiffness = linear
    damping = max(2.0 * np.sqrt(mass * stiffness), damping)
    units = {"mass": mass, "damping": damping, "stiffness": stiffness, "A": stiffness}
    limits = dict(user)
    for name in units.keys() - held.keys():
        own = tuple(float(units[name] * side) for side in _BOX[name])
        lower, upper = user.get(name, own)
        limits[name] = (own[0] if np.isinf(lower) else lower, own[1] if np.isinf(upper) else upper)
    if limits.get("mass", (1.0, 1.0))[0] <= 0.0:
        limits["mass"] = (0.1 * min(linear.mass, limits["mass"][1]), limits["mass"][1])
    return limits


def _without_memory(linear: Linear) -> dict[str, float]:
    """Half of the spring in a law that is hardly curved: where no law was found along the displacement."""
    half = 0.5 * linear.stiffness
    return {**linear._asdict(), "stiffness": half, "A": half, "beta": 0.0, "gamma": 0.0, "n": 1.0}


def _factor(values: Mapping[str, float], held: Mapping[str, float]) -> float:
    """Factor of the plant of unit mass by which one of its scaled parameters has the value it is held at."""
    known = [held[name] / values[name] for name in _SCALED if name in held and values[name] * held[name] > 0.0]
    return float(known[0]) if known else 1.0


def _scaled(values: Mapping[str, float], factor: float) -> dict[str, float]:
    scaled = {name: value * factor if name in _SCALED else value for name, value in values.items()}
    unit = factor ** (1.0 - values["n"])
    return scaled | {"beta": values["beta"] * unit, "gamma": values["gamma"] * unit}
