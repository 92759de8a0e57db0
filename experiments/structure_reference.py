"""The motion of a structure with hysteretic elements, by DOP853 on pieces on which everything is smooth.

    M x'' + C x' + K x + sum_e b_e f_e = p(t),    d_e = b_e . x,    p linear between the samples

Each law is written as its differential equation, with the sign of every drift velocity, the sign of every Bouc-Wen
memory and the state of every play (sticking or sliding) held fixed. An integration ends at each sample, and wherever
one of these changes: the event is located on the dense output, the step is repeated up to it, and the next
integration starts there with the new signs. So the method has its full order throughout. The energies are further
states. Nothing here uses a step of hysim: laws lend their parameters only.

A drift turns where its velocity changes sign, which is such an event: peaks are those of the continuous motion.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

import hysim as hs

Array = np.ndarray
_INSIDE = np.array([0.25, 0.5, 0.75])  # of a step: where its dense output is searched for an event that ends again
_QUIET = 1e-14  # of the largest value so far: an event function may fall as far below zero, which rounding does not
_MOST_PIECES = 1000  # of one sample


class Reference(NamedTuple):
    """Motion at the samples and continuous peaks; N masses, E elements.

    `displacement` and `velocity` are (n, N), `drift`, `force` and `element_work` (n, E), `input_work` and
    `damping_loss` (n,), `peak_drift` (E,); `n_pieces` counts the integrations.
    """

    displacement: Array
    velocity: Array
    drift: Array
    force: Array
    element_work: Array
    input_work: Array
    damping_loss: Array
    peak_drift: Array
    n_pieces: int


# ---------------------------------------------------------------------------------- laws as differential equations


class Group(Protocol):
    """Elements of one kind; `z` are the states, `s` the signs of the velocities.

    `place` is the element of each state; `clamped` tells that event functions are displacements, and round as these do.
    """

    place: Array
    clamped: bool

    def start(self) -> Array: ...
    def turn(self, elements: Array, z: Array, s: Array) -> None: ...
    def force(self, z: Array) -> Array: ...
    def rates(self, v: Array, s: Array, z: Array) -> Array: ...
    def margins(self, d: Array, s: Array, z: Array) -> Array: ...
    def switch(self, which: Array, d: Array, s: Array, z: Array) -> None: ...
    def scales(self, d: float) -> Array: ...


class Signed:
    """What laws have in common whose equation depends on the sign of their memory, which stands first in the states.

    `of` are their elements, and `A` the rates of their memories at zero.
    """

    clamped = False
    of: Array
    A: Array
    side: Array

    def turn(self, elements: Array, z: Array, s: Array) -> None:
        """A memory of exactly zero goes to the side that the motion takes it to."""
        at_zero = z[: self.of.size] == 0.0
        self.side = np.where(at_zero, np.where(self.A < 0.0, -1.0, 1.0) * s[self.of], self.side)

    def switch(self, which: Array, d: Array, s: Array, z: Array) -> None:
        self.side[which] *= -1.0


class Memories(Signed):
    """Bouc-Wen laws, z' = v (A - |z|^n (gamma + beta sgn(z v))), with weights `gain`; Dahl's is one with gamma = 0."""

    def __init__(self, place: Sequence[int], laws: Sequence[hs.BoucWen]) -> None:
        self.place = self.of = np.array(place)
        fields = ("A", "beta", "gamma", "n", "gain", "z0")
        self.A, self.beta, self.gamma, self.n, self.gain, self.z0 = np.array(
            [[vars(law)[name] for name in fields] for law in laws]
        ).T
        self.power = _power(self.n)
        self.side = np.ones(self.place.size)

    def start(self) -> Array:
        self.side = np.where(self.z0 < 0.0, -1.0, 1.0)
        return self.z0.copy()

    def force(self, z: Array) -> Array:
        return self.gain * z

    def rates(self, v: Array, s: Array, z: Array) -> Array:
        bend = self.gamma + self.beta * self.side * s[self.place]
        return v[self.place] * (self.A - self.power(self.side * z) * bend)

    def margins(self, d: Array, s: Array, z: Array) -> Array:
        return self.side * z

    def scales(self, d: float) -> Array:
        return np.abs(self.A) * d


class Plays:
    """Plays, z' = v while one slides and 0 while it sticks, with weights; stops are plays beside a spring."""

    clamped = True

    def __init__(self, place: Sequence[int], r: Sequence[float], weight: Sequence[float], z0: Sequence[float]) -> None:
        self.place, self.r, self.weight, self.z0 = np.array(place), np.array(r), np.array(weight), np.array(z0)
        self.slides = self.r == 0.0

    def start(self) -> Array:
        self.slides = self.r == 0.0
        return np.clip(self.z0, -self.r, self.r)

    def turn(self, elements: Array, z: Array, s: Array) -> None:
        self.slides = np.where(np.isin(self.place, elements), self.r == 0.0, self.slides)

    def force(self, z: Array) -> Array:
        return self.weight * z

    def rates(self, v: Array, s: Array, z: Array) -> Array:
        return np.where(self.slides, v[self.place], 0.0)

    def margins(self, d: Array, s: Array, z: Array) -> Array:
        """How far the motion may still go before a play slides; of one that slides there is no end but a turn."""
        return np.where(self.slides, np.inf, self.r - s[self.place] * (d[self.place] - z))

    def switch(self, which: Array, d: Array, s: Array, z: Array) -> None:
        """A play that begins to slide is at its distance from the input exactly."""
        self.slides[which] = True
        of = self.place[which]
        z[which] = d[of] - s[of] * self.r[which]

    def scales(self, d: float) -> Array:
        return np.full(self.place.size, d)


class Worn(Signed):
    """Baber and Noori's laws: states z, then e with e' = z v, as `hysim.BoucWenBaberNoori` documents them."""

    def __init__(self, place: Sequence[int], laws: Sequence[hs.BoucWenBaberNoori]) -> None:
        self.of = np.array(place)
        self.place = np.concatenate([self.of, self.of])
        names = ("A", "beta", "gamma", "n", "delta_a", "delta_nu", "delta_eta", "zeta_s", "q", "p", "psi", "delta_psi")
        self.values = {name: np.array([vars(law)[name] for law in laws]) for name in (*names, "lambda_", "gain", "z0")}
        self.A, self.power = self.values["A"], _power(self.values["n"])
        self.side = np.ones(self.of.size)

    def start(self) -> Array:
        z0 = self.values["z0"]
        self.side = np.where(z0 < 0.0, -1.0, 1.0)
        return np.concatenate([z0, np.zeros_like(z0)])

    def force(self, z: Array) -> Array:
        return np.concatenate([self.values["gain"] * z[: self.of.size], np.zeros(self.of.size)])

    def rates(self, v: Array, s: Array, z: Array) -> Array:
        k, (memory, e), direction, speed = self.values, z.reshape(2, -1), s[self.of], v[self.of]
        strength, stiffness = 1.0 + k["delta_nu"] * e, 1.0 + k["delta_eta"] * e
        yielding = (1.0 / (strength * (k["beta"] + k["gamma"]))) ** (1.0 / k["n"])
        depth = k["zeta_s"] * (1.0 - np.exp(-k["p"] * e))
        width = (k["psi"] + k["delta_psi"] * e) * (k["lambda_"] + depth)
        pinched = 1.0 - depth * np.exp(-(((memory * direction - k["q"] * yielding) / width) ** 2))
        bend = k["gamma"] + k["beta"] * self.side * direction
        slope = self.A - k["delta_a"] * e - strength * self.power(self.side * memory) * bend
        return np.concatenate([speed * pinched * slope / stiffness, speed * memory])

    def margins(self, d: Array, s: Array, z: Array) -> Array:
        return np.concatenate([self.side * z[: self.of.size], np.full(self.of.size, np.inf)])

    def scales(self, d: float) -> Array:
        z = np.abs(self.A) * d
        return np.concatenate([z, z * d])


def _power(n: Array) -> Callable[[Array], Array]:
    """w^n as a function of w; past an event w is below zero, where a whole power goes on smoothly."""
    if np.all(n == 1.0):
        return lambda w: w
    if np.all(n == 2.0):
        return lambda w: w * w
    if np.all(n == np.round(n)):
        return lambda w: w**n
    return lambda w: np.maximum(w, 0.0) ** n


class Elements(NamedTuple):
    """Forces of all elements, f = offset + slope d + rate v + what the groups add."""

    offset: Array
    slope: Array
    rate: Array
    groups: tuple[Group, ...]


def elements_of(laws: Sequence[Any]) -> Elements:
    """The differential equations of hysim's laws, sums among them; TypeError for a law that is not known here."""
    offset, slope, rate = np.zeros((3, len(laws)))
    memories: list[tuple[int, hs.BoucWen]] = []
    worn: list[tuple[int, hs.BoucWenBaberNoori]] = []
    plays: list[tuple[int, float, float, float]] = []

    def add(e: int, law: Any) -> None:
        if isinstance(law, hs.Sum):
            for part in law.parts:
                add(e, part)
            return
        if isinstance(law, hs.Dashpot):
            rate[e] += law.c
            return
        offset[e] += law.offset
        if isinstance(law, hs.BoucWen):
            slope[e] += law.feedthrough
            memories.append((e, law))
        elif isinstance(law, hs.Dahl):
            beta = law.stiffness / law.coulomb
            memories.append((e, hs.BoucWen(A=law.stiffness, beta=beta, gamma=0.0, n=1.0, z0=law.z0)))
        elif isinstance(law, hs.BoucWenBaberNoori):
            (linear,) = law.input_coefficients
            slope[e] += linear
            worn.append((e, law))
        elif isinstance(law, hs.MaxwellSlip):
            slope[e] += law.feedthrough + sum(law.stiffness)
            z0 = _each(law.z0, law.slips)
            plays.extend((e, r, -k, z) for r, k, z in zip(law.slips, law.stiffness, z0, strict=True))
        elif isinstance(law, hs.PrandtlIshlinskii):
            z0 = _each(law.z0, law.weights)
            plays.extend((e, r, w, z) for r, w, z in zip(law.thresholds, law.weights, z0, strict=True))
        elif isinstance(law, hs.Play):
            plays.append((e, law.threshold, law.gain, law.z0))
        elif isinstance(law, hs.Stop):
            slope[e] += law.gain
            plays.append((e, law.threshold, -law.gain, law.z0))
        else:
            raise TypeError(f"the differential equation of a {type(law).__name__} is not written here")

    for e, law in enumerate(laws):
        add(e, law)
    kinds: tuple[tuple[type[Group], Sequence[Any]], ...] = ((Memories, memories), (Worn, worn), (Plays, plays))
    groups = tuple(kind(*zip(*members, strict=True)) for kind, members in kinds if members)
    return Elements(offset, slope, rate, groups)


def _each(z0: tuple[float, ...], of: Sequence[float]) -> tuple[float, ...]:
    return z0 * len(of) if len(z0) == 1 else z0


# ---------------------------------------------------------------------------------- the motion


class _Motion:
    """Right side, events and signs; the state is x, x', the groups' states, input work, damping loss, element work."""

    def __init__(self, mass: Array, damping: Array, stiffness: Array, directions: Array, laws: Sequence[Any]) -> None:
        self.inverse = np.linalg.inv(mass)
        self.damping, self.stiffness, self.B = damping, stiffness, directions
        self.elements = elements_of(laws)
        self.N, self.E = mass.shape[0], directions.shape[0]
        sizes = [group.place.size for group in self.elements.groups]
        ends = 2 * self.N + np.cumsum([0, *sizes])
        self.parts = [slice(a, b) for a, b in pairwise(ends)]
        self.work = int(ends[-1])
        self.s = np.ones(self.E)
        self.load = self.load_slope = np.zeros(self.N)
        self.adders = [np.eye(self.E)[group.place].T for group in self.elements.groups]

    def start(self) -> Array:
        y = np.zeros(self.work + 2 + self.E)
        for group, part in zip(self.elements.groups, self.parts, strict=True):
            y[part] = group.start()
        return y

    def forces(self, d: Array, v: Array, y: Array) -> Array:
        own = self.elements
        f = own.offset + own.slope * d + own.rate * v
        for group, part, adder in zip(own.groups, self.parts, self.adders, strict=True):
            f = f + adder @ group.force(y[part])
        return f

    def rates(self, t: float, y: Array) -> Array:
        x, velocity = y[: self.N], y[self.N : 2 * self.N]
        d, v = self.B @ x, self.B @ velocity
        f, load, drag = self.forces(d, v, y), self.load + t * self.load_slope, self.damping @ velocity
        out = np.empty_like(y)
        out[: self.N] = velocity
        out[self.N : 2 * self.N] = self.inverse @ (load - drag - self.stiffness @ x - f @ self.B)
        for group, part in zip(self.elements.groups, self.parts, strict=True):
            out[part] = group.rates(v, self.s, y[part])
        out[self.work] = load @ velocity
        out[self.work + 1] = velocity @ drag
        out[self.work + 2 :] = f * v
        return out

    def margins(self, y: Array) -> Array:
        """Event functions, positive inside a piece: the velocities of the drifts first, then those of the groups."""
        d, v = self.B @ y[: self.N], self.B @ y[self.N : 2 * self.N]
        parts = zip(self.elements.groups, self.parts, strict=True)
        return np.concatenate([self.s * v, *(group.margins(d, self.s, y[part]) for group, part in parts)])

    def quiet(self, scale: Array) -> Array:
        """How far below zero an event function may be before it counts; it keeps rounding from being an event."""
        x, velocity = (np.max(scale[part]) for part in (slice(0, self.N), slice(self.N, 2 * self.N)))
        parts = zip(self.elements.groups, self.parts, strict=True)
        own = [np.full(group.place.size, x) if group.clamped else scale[part] for group, part in parts]
        return _QUIET * np.concatenate([np.full(self.E, velocity), *own])

    def switch(self, which: Array, y: Array) -> None:
        """Change the signs whose event functions are `which` (bool), in place; what turned sticks before it slides."""
        turned, begin, d = np.flatnonzero(which[: self.E]), self.E, self.B @ y[: self.N]
        self.s[turned] *= -1.0
        for group, part in zip(self.elements.groups, self.parts, strict=True):
            if turned.size:
                group.turn(turned, y[part], self.s)
            own = which[begin : begin + group.place.size] & (group.margins(d, self.s, y[part]) < 0.0)
            group.switch(np.flatnonzero(own), d, self.s, y[part])
            begin += group.place.size

    def first_signs(self, y: Array) -> None:
        """Directions at rest, those of the accelerations or, where these are zero too, of their rates."""
        acceleration = self.B @ self.rates(0.0, y)[self.N : 2 * self.N]
        jerk = self.B @ (self.inverse @ self.load_slope)
        self.s = np.where(acceleration != 0.0, np.sign(acceleration), np.where(jerk < 0.0, -1.0, 1.0))
        for group, part in zip(self.elements.groups, self.parts, strict=True):
            group.turn(np.arange(self.E), y[part], self.s)


def reference(
    mass: Array,
    damping: Array,
    stiffness: Array,
    directions: Array,
    laws: Sequence[Any],
    loads: Array,
    sample_time: float,
    tolerance: float = 1e-12,
) -> Reference:
    """The motion from rest.

    Parameters
    ----------
    mass, damping, stiffness : array, shape (N, N)
        Of the structure without its elements.
    directions : array, shape (E, N)
        b_e, one a row.
    laws : sequence of E laws
        hysim's, of which only the parameters are used.
    loads : array, shape (n, N)
        p at the samples; ``-a_g[:, None] * (mass @ influence)`` under an earthquake.
    sample_time : float
        [s].
    tolerance : float
        Relative, and absolute in units of the largest value so far.
    """
    motion = _Motion(mass, damping, stiffness, directions, laws)
    y = motion.start()
    n, h = loads.shape[0], sample_time
    scale = _first_scale(motion, loads, h)
    rows = np.empty((n, y.size))
    rows[0] = y
    peaks = np.abs(motion.B @ y[: motion.N])
    step, n_pieces = h, 0
    for k in range(n - 1):
        motion.load, motion.load_slope = loads[k], (loads[k + 1] - loads[k]) / h
        if k == 0:
            motion.first_signs(y)
        t = 0.0
        for _ in range(_MOST_PIECES):
            _settle(motion, y, scale)
            t, y, step = _piece(motion, t, y, h, tolerance, scale, step)
            n_pieces += 1
            scale = _grown(motion, scale, y)
            peaks = np.maximum(peaks, np.abs(motion.B @ y[: motion.N]))
            if t == h:
                break
            motion.switch(motion.margins(y) < 0.0, y)
        else:
            raise RuntimeError(f"more than {_MOST_PIECES} events after sample {k}")
        rows[k + 1] = y
    x, v, work = rows[:, : motion.N], rows[:, motion.N : 2 * motion.N], motion.work
    d, w = x @ motion.B.T, v @ motion.B.T
    f = np.array([motion.forces(*each) for each in zip(d, w, rows, strict=True)])
    return Reference(x, v, d, f, rows[:, work + 2 :], rows[:, work], rows[:, work + 1], peaks, n_pieces)


def _piece(
    motion: _Motion, t: float, y: Array, end: float, tolerance: float, scale: Array, step: float
) -> tuple[float, Array, float]:
    """Up to the first event or the end: time, state, and length of the last step.

    The dense output is less accurate than the step: if the event has not quite come, the next piece meets it at once,
    near its beginning, where the dense output is accurate.
    """
    quiet = motion.quiet(scale)
    solver = _solver(motion, t, y, end, tolerance, scale, step)
    while solver.status == "running":
        _advance(solver)
        before, after, dense = solver.t_old, solver.t, solver.dense_output()
        low = before
        for point in (*(before + _INSIDE * (after - before)), after):
            crossed = np.flatnonzero(motion.margins(solver.y if point == after else dense(point)) + quiet < 0.0)
            if crossed.size:
                instant = min(_root(motion, dense, quiet, int(each), low, point) for each in crossed)
                return instant, _up_to(motion, before, dense(before), instant, tolerance, scale), after - before
            low = point
    return end, solver.y, solver.step_size


def _root(motion: _Motion, dense: Callable[[float], Array], quiet: Array, which: int, low: float, high: float) -> float:
    """Time at which an event function passes below `-quiet`, on the dense output."""

    def value(time: float) -> float:
        return float(motion.margins(dense(time))[which] + quiet[which])

    return low if value(low) <= 0.0 else float(brentq(value, low, high, xtol=1e-18, rtol=1e-15))


def _up_to(motion: _Motion, t: float, y: Array, end: float, tolerance: float, scale: Array) -> Array:
    """The state at the event by steps of the method, which is more accurate than the dense output."""
    if end <= t:
        return y.copy()
    solver = _solver(motion, t, y, end, tolerance, scale, end - t)
    while solver.status == "running":
        _advance(solver)
    return np.asarray(solver.y)


def _advance(solver: DOP853) -> None:
    if (message := solver.step()) is not None:
        raise RuntimeError(f"DOP853 at {solver.t}: {message}")


def _solver(motion: _Motion, t: float, y: Array, end: float, tolerance: float, scale: Array, step: float) -> DOP853:
    return DOP853(motion.rates, t, y, end, first_step=min(step, end - t), rtol=tolerance, atol=tolerance * scale)


def _settle(motion: _Motion, y: Array, scale: Array) -> None:
    """Bring the signs in line with the state where they are not, by rounding or at the start."""
    quiet = motion.quiet(scale)
    for _ in range(4):
        wrong = motion.margins(y) + quiet < 0.0
        if not wrong.any():
            return
        motion.switch(wrong, y)


def _first_scale(motion: _Motion, loads: Array, h: float) -> Array:
    """Sizes of the states after a sample under the largest load: what counts as large before anything moved."""
    jolt = float(np.max(np.abs(loads @ motion.inverse))) or 1.0
    x, v = jolt * h * h, jolt * h
    groups = [group.scales(float(np.abs(motion.B).sum(axis=1).max()) * x) for group in motion.elements.groups]
    energy = np.full(2 + motion.E, v * v / float(np.max(np.abs(motion.inverse))))
    return np.concatenate([np.full(motion.N, x), np.full(motion.N, v), *groups, energy])


def _grown(motion: _Motion, scale: Array, y: Array) -> Array:
    """The sizes with those of a new state; displacements, velocities and energies have one size each."""
    size = np.maximum(scale, np.abs(y))
    for part in (slice(0, motion.N), slice(motion.N, 2 * motion.N), slice(motion.work, None)):
        size[part] = np.max(size[part])
    return size
