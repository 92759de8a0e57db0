"""Masses on linear and hysteretic elements.

    M x'' + C x' + K x + sum over elements of b f(b . x) = -M r a(t)    under the acceleration a of the base,
                                                         =  r u(t)      under a force u

x are the displacements relative to the ground; b is the direction of an element, f its law for the drift b . x, and r
the influence. The input is linear between the samples. How it is integrated: `hysim.kernels.structure_path`.

Pushed slowly, under displacement control, it has

    K x + sum over elements of b f(b . x) = factor p,        c . x = control

p is the pattern of the loads, c the direction whose displacement is told. The unknowns of each control value are x and
the factor, so that the path goes on where the factor falls. Laws move from one control value to the next along straight
drifts. Newton's method has the slopes of the laws along these strokes, by differences; its steps are shortened until
the forces out of balance fall, and a stroke on which that does not help is halved.

**Response spectra** of earthquakes are peaks of elastic oscillators, and of those of one ductility or strength.

    u'' + 2 zeta omega u' + omega^2 f(u) / k0 = -scale a(t),    k0 = f'(0)

has the ductility max |u| / yield_input of an oscillator under a(t) itself whose force is divided by the scale. The
yield strength of that one is its mass times omega^2 yield_input / scale. A search for a strength varies the scale only.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky

from hysim._basics import frozen
from hysim._basics.frozen import FloatArray, check_choice, check_positive, check_whole, read_only, whole_substeps
from hysim._basics.parallel import in_chunks, map_on_threads
from hysim._basics.printing import aligned, extent, frozen_result, summary_text
from hysim._basics.results import model_of
from hysim.errors import SimulationError
from hysim.laws.static import Line
from hysim.models.model import family
from hysim.models.protocols import positive_time
from hysim.plants.structures.assembly import Laws, MovingStructure
from hysim.plants.structures.ensemble import AT_ONCE, REDUCTIONS, Reduction, reduced, values_by_name
from hysim.plants.structures.parts import Element, ModalDamping, Rayleigh, assembled
from hysim.plants.structures.search import SearchedStructure

_BALANCED = 1e-12  # force out of balance, as a share of the largest force so far
_ENOUGH = 1e-10  # as `_BALANCED`, where no further step helps
_WORST = 1e-8  # as `_BALANCED`, with stiff elements
_ROUNDING = 8.0 * 2.0**-52  # of displacements, by the largest stiffness: forces cannot be balanced better
_MOST_STEPS = 40  # of Newton's method
_MOST_CUTS = 10  # halvings of one of its steps
_MOST_HALVINGS = 26  # of a stroke
_DIFFERENCE = 1e-5  # share of a stroke: central differences then err at about 1e-10
_LOOSEST = 1e-3  # tolerance


@frozen_result
class StaticResponse:
    """Equilibria of a structure that is pushed slowly.

    Parameters
    ----------
    control, factor : array, shape (n,)
        Displacement that was told [m], and loads by the pattern: the forces at the masses are `factor` times `pattern`.
    pattern : array, shape (n_nodes,)
        Pattern of the loads [N].
    displacement : array, shape (n, n_nodes)
        [m]
    drift, force : array, shape (n, n_elements)
        Of the elements [m], [N]; dashpots have none.
    residual : array, shape (n,)
        Largest force out of balance over the largest force so far: at most 1e-10, or the rounding of displacements.
    """

    control: FloatArray
    factor: FloatArray
    pattern: FloatArray
    displacement: FloatArray
    drift: FloatArray
    force: FloatArray
    residual: FloatArray

    @property
    def base_shear(self) -> FloatArray:
        """Sum of the loads, which the ground takes if every mass moves along one axis, shape (n,) [N]."""
        return np.asarray(self.factor * self.pattern.sum())

    def __str__(self) -> str:
        rows = {
            "control": extent(self.control, "m"),
            "base shear": extent(self.base_shear, "N"),
            "residual": f"{self.residual.max(initial=0.0):.1e}",
        }
        return summary_text([f"StaticResponse: {self.control.size} equilibria"], rows)


class _Equilibrium(NamedTuple):
    """Displacements, loads by the pattern, forces of the elements, and the share out of balance."""

    x: FloatArray
    factor: float
    force: FloatArray
    residual: float


class _Columns:
    """The laws of the elements, each after the last equilibrium."""

    def __init__(self, laws: Laws, slopes: FloatArray, drifts: FloatArray) -> None:
        self.members = [law.started(float(d)) for law, d in zip(laws.steppers, drifts, strict=True)]
        self.places = laws.places
        self.slopes, self.drifts = slopes, drifts
        self.saved = [law.state[place] for law, place in zip(self.members, self.places, strict=True)]
        self.keep(drifts)

    def force(self, e: int, drift: float) -> float:
        law = self.members[e]
        law.state[self.places[e]] = self.saved[e]
        return float(law.step(law.parameters, law.state, drift))

    def forces(self, drifts: FloatArray) -> FloatArray:
        return np.array([self.force(e, float(d)) for e, d in enumerate(drifts)])

    def tangents(self, drifts: FloatArray) -> FloatArray:
        slopes = self.slopes.copy()
        for e, (drift, begin) in enumerate(zip(drifts, self.drifts, strict=True)):
            d = _DIFFERENCE * abs(drift - begin)
            if drift + d > drift - d:
                slopes[e] = (self.force(e, drift + d) - self.force(e, drift - d)) / ((drift + d) - (drift - d))
        return slopes

    def keep(self, drifts: FloatArray) -> None:
        self.drifts = drifts
        self.forces(drifts)
        self.saved = [law.state[place] for law, place in zip(self.members, self.places, strict=True)]


class _Push:
    def __init__(self, structure: MovingStructure, x: FloatArray, pattern: FloatArray, row: FloatArray) -> None:
        self.stiffness, self.rows = structure.stiffness_matrix, structure.drift_matrix
        self.slopes, self.pattern, self.row = structure.elastic_slopes, pattern, row
        self.columns = _Columns(structure.laws, self.slopes, self.rows @ x)
        self.unit = float(np.abs(structure.initial_stiffness).max()) or 1.0
        self.direction = self.correction(self.slopes, np.zeros(x.size), 1.0)[0]
        self.largest = 0.0
        self.now = self.balance(x, 0.0)

    def balance(self, x: FloatArray, factor: float) -> _Equilibrium:
        at = _Equilibrium(x, factor, self.columns.forces(self.rows @ x), 0.0)
        size = self.size(at)
        return at._replace(residual=float(np.abs(self.out_of_balance(at)).max()) / size) if size else at

    def size(self, at: _Equilibrium) -> float:
        """The largest force so far: of a load, of linear springs at a mass, or of an element."""
        parts = (at.factor * self.pattern, self.stiffness @ at.x, at.force)
        return max(self.largest, *(float(np.abs(part).max(initial=0.0)) for part in parts))

    def allowed(self, at: _Equilibrium) -> float:
        rounding, size = _ROUNDING * self.unit * float(np.abs(at.x).max()), self.size(at)
        return min(max(_ENOUGH, rounding / size), _WORST) if size else _ENOUGH

    def out_of_balance(self, at: _Equilibrium) -> FloatArray:
        """Loads less resisting forces, shape (n,)."""
        resisted = self.stiffness @ at.x + self.rows.T @ at.force
        return np.asarray(at.factor * self.pattern - resisted)

    def correction(self, tangents: FloatArray, off: FloatArray, rise: float) -> tuple[FloatArray, float]:
        """Changes of displacements and factor that balance `off` and raise the control by `rise`."""
        rows, n = self.rows, off.size
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = (self.stiffness + rows.T @ (tangents[:, np.newaxis] * rows)) / self.unit
        largest = np.abs(self.pattern).max() or 1.0
        matrix[:n, n], matrix[n, :n] = -self.pattern / largest, self.row
        wanted = np.append(off / self.unit, rise)
        try:
            change = np.linalg.solve(matrix, wanted)
        except np.linalg.LinAlgError:
            change = np.linalg.lstsq(matrix, wanted)[0]
        return change[:n], float(change[n] * self.unit / largest)

    def corrected(self, x: FloatArray, factor: float) -> _Equilibrium:
        """The equilibrium near displacements that have the control value; out of balance if no equilibrium is found."""
        at = self.balance(x, factor)
        for _ in range(_MOST_STEPS):
            if at.residual <= _BALANCED or not np.isfinite(at.residual):
                break
            off = self.out_of_balance(at)
            change, rise = self.correction(self.columns.tangents(self.rows @ at.x), off, 0.0)
            size = float(np.abs(off).max())
            for cut in range(_MOST_CUTS):
                share = 0.5**cut
                tried = self.balance(at.x + share * change, at.factor + share * rise)
                if float(np.abs(self.out_of_balance(tried)).max()) < size:
                    break
            else:
                break
            at = tried
        return at

    def to(self, control: float, halvings: int = 0) -> bool:
        """Move to a control value; whether an equilibrium is there."""
        begin, rise = self.now, control - float(self.row @ self.now.x)
        x = begin.x + rise * self.direction
        best = self.corrected(x, begin.factor)
        if not best.residual <= self.allowed(best):
            change, factor = self.correction(self.slopes, np.zeros(x.size), rise)
            best = self.corrected(begin.x + change, begin.factor + factor)
        if best.residual <= self.allowed(best):
            if rise:
                self.direction = (best.x - begin.x) / rise
            self.now = best
            self.largest = self.size(best)
            self.columns.keep(self.rows @ best.x)
            return True
        middle = control - 0.5 * rise
        if halvings == _MOST_HALVINGS or not min(control, control - rise) < middle < max(control, control - rise):
            return False
        return self.to(middle, halvings + 1) and self.to(control, halvings + 1)


def strokes(turns: Any, begin: float, steps: int) -> FloatArray:
    """Control values from `begin` along turning points, `steps` of them on each stroke."""
    points = [begin, *np.asarray(turns, dtype=float).tolist()]
    parts = [np.linspace(a, b, steps + 1)[1:] for a, b in itertools.pairwise(points) if a != b]
    return np.concatenate([[begin], *parts])


@family
class Structure(SearchedStructure):
    """Masses on linear and hysteretic elements, under a moving base or a force.

    ``M x'' + C x' + K x + sum b f(b . x) = -M r a(t)`` or ``= r u(t)``.

    Parameters
    ----------
    mass : float or array, shape (n,) or (n, n)
        Of all masses alike, of each, or a symmetric positive definite matrix [kg].
    damping : float or array, shape (n,) or (n, n), Rayleigh, or ModalDamping
        From each mass to the ground, or a symmetric matrix [N s/m].
    stiffness : float or array, shape (n,) or (n, n)
        Of linear springs from each mass to the ground, or a symmetric matrix [N/m].
    elements : sequence of Element
        Laws between the nodes. Their dashpots are a part of the damping matrix; forces and work are the elements' own.
    excitation : {"base", "force"}
        Whether the input is the acceleration of the base [m/s^2] or a force [N].
    influence : tuple of float
        Displacement of each mass when the base moves by one, by default 1; or the share of the force at each mass, by
        default all of it at the last one.
    output : str
        Output y: ``"displacement"``, ``"velocity"``, ``"acceleration"`` with the number of the mass, such as
        ``"acceleration.2"``; ``"drift.0"``, ``"force.0"`` with the place of the element; without a number the last.
    substeps : int, optional
        Equal steps between two samples, of order 4. By default steps are divided by `tolerance`.
    tolerance : float
        Largest disagreement of two sweeps of a step, as a share of the largest drift so far; between 1e-12 and 1e-3.
        The error of the drifts is about as large.
    initial_state : tuple of float
        Displacements and velocities at the first sample, one behind the other; empty for rest.

    Raises
    ------
    ValueError, TypeError
        If sizes do not fit, a matrix is not symmetric, the mass is not positive definite, a number is not finite, an
        option is unknown, or an element is not an `Element`.

    Examples
    --------
    Two storeys on Bouc-Wen columns under a pulse of the ground:

    >>> import numpy as np, hysim as hs
    >>> column = hs.BoucWen(A=1.0, beta=50.0, gamma=50.0, feedthrough=20.0, gain=180.0)
    >>> columns = (hs.Element(column, between=(0, 1)), hs.Element(column, between=(1, 2)))
    >>> frame = hs.Structure(mass=(1.0, 1.0), damping=hs.ModalDamping(ratio=0.02), elements=columns)
    >>> frame.periods().round(4).tolist()
    [0.7189, 0.2746]
    >>> t = np.arange(0.0, 4.0, 0.01)
    >>> sim = hs.simulate(frame, t, 3.0 * np.sin(9.0 * t) * (t < 1.4))
    >>> sim.peaks["drift"].shape, bool(abs(sim.signals["imbalance"]).max() < 1e-8 * sim.signals["input_work"].max())
    ((2,), True)
    """

    dynamic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", _elements(self.elements))
        if not isinstance(self.damping, Rayleigh | ModalDamping):
            object.__setattr__(self, "damping", read_only(self.damping, "damping"))
        if not 1e-12 <= self.tolerance <= _LOOSEST:
            raise ValueError(f"tolerance must be between 1e-12 and {_LOOSEST:g}, got {self.tolerance:g}")
        if self.influence:
            frozen.check_one_each("influence", self.influence, self.n_nodes, "masses")
        if len(self.initial_state) not in (0, 2 * self.n_nodes):
            raise ValueError(
                f"initial_state must hold {self.n_nodes} displacements and {self.n_nodes} velocities, "
                f"got {len(self.initial_state)} numbers"
            )
        try:
            cholesky(self.mass_matrix)
        except LinAlgError:
            raise ValueError("the mass matrix must be positive definite") from None
        self.place_of(self.output)
        self.matrices  # noqa: B018  # raises what its parts raise

    def assemble(self, parameters: Mapping[str, float]) -> "Structure":
        """The structure with some numbers exchanged, by their names in `scalars`.

        ``"mass"``, ``"stiffness"`` and ``"damping"`` are the number itself, where the argument is one or a
        `ModalDamping` of one ratio, and else a factor of the whole, 1 as it is; there are ``"mass[0]"``,
        ``"damping[1]"`` of several, too, and ``"damping.mass"`` of a `Rayleigh`. The numbers of laws have the laws' own
        names, ``"elements.0.thresholds[1]"``, those of sums the parts' labels, ``"elements.0.bouc_wen.beta"``;
        ``"elements.*.beta"`` is one number for all elements with this name. A ValueError is raised if a name is
        unknown, or a constructor refuses a number.

        Examples
        --------
        >>> import hysim as hs
        >>> frame = hs.shear_frame([2.0, 2.0], laws=hs.Dahl(), damping=hs.ModalDamping(ratio=0.02))
        >>> other = frame.assemble({"damping": 0.05, "elements.*.stiffness": 3.0})
        >>> other.damping.ratio, [element.law.stiffness for element in other.elements]
        (0.05, [3.0, 3.0])
        """
        structure: Structure = assembled(self, parameters)
        return structure

    def responses(
        self,
        parameters_or_scales: Mapping[str, npt.ArrayLike] | npt.ArrayLike,
        ground_accelerations: npt.ArrayLike,
        *,
        sample_time: float,
        reduce: Reduction = "peak_drift",
        workers: int | None = None,
    ) -> FloatArray:
        """One measure of many structures at once, on all cores.

        Parameters
        ----------
        parameters_or_scales : mapping, or array, shape (n_sets,)
            Names of parameters, as `scalars` has them, to a value for all sets or one for each; ``"scale"`` multiplies
            the input, and ``"elements.*.beta"`` is that of every element. Or scales of the input alone. What is not
            named is that of this structure.
        ground_accelerations : array, shape (n_samples,) or (n_sets, n_samples)
            Input of all sets, or of each, linear between its samples [m/s^2, or N under a force].
        sample_time : float
            Time between two samples [s].
        reduce : str
            ``"peak_drift"``, also between samples, ``"residual_drift"`` (after the last sample), ``"peak_force"`` or
            ``"energy"`` (the work that each element has taken), both with dashpots, of each element;
            ``"peak_displacement"`` or ``"peak_acceleration"`` (absolute, at samples), of each mass.
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_elements) or (n_sets, n)
            The numbers that `signals` has of each set; inf where the motion diverges or cannot be resolved.

        Raises
        ------
        ValueError
            If a name is unknown, lengths do not fit, or the constructor would refuse a value.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> column = hs.BoucWen(beta=50.0, gamma=50.0, feedthrough=20.0, gain=180.0)
        >>> frame = hs.shear_frame([1.0, 1.0], laws=column, damping=hs.ModalDamping(ratio=0.02))
        >>> a = np.sin(9.0 * np.arange(0.0, 4.0, 0.01))
        >>> frame.responses([0.5, 1.0, 2.0], a, sample_time=0.01).shape
        (3, 2)
        >>> frame.responses({"elements.*.beta": [25.0, 50.0]}, a, sample_time=0.01, reduce="energy").shape
        (2, 2)
        """
        check_choice("reduce", reduce, REDUCTIONS)
        positive_time(sample_time)
        u = read_only(ground_accelerations, "ground_accelerations")
        if u.ndim not in (1, 2) or not u.shape[-1]:
            raise ValueError(f"ground_accelerations must have the shape (n,) or (n_sets, n), got {u.shape}")
        u = u[np.newaxis] if u.ndim == 1 else u
        values = values_by_name(self, parameters_or_scales)
        sizes = {name: column.size for name, column in values.items() if column.size != 1}
        sizes |= {"ground_accelerations": len(u)} if len(u) > 1 else {}
        n_sets = next(iter(sizes.values()), 1)
        if unequal := {name: size for name, size in sizes.items() if size != n_sets}:
            raise ValueError(f"every parameter needs one value, or one for each of {n_sets} sets, got {unequal}")
        of_nodes = reduce in ("peak_displacement", "peak_acceleration")
        out = np.empty((n_sets, self.n_nodes if of_nodes else len(self.elements)))

        def work(start: int, stop: int) -> None:
            rows = slice(start, stop)
            chosen = {name: column if column.size == 1 else column[rows] for name, column in values.items()}
            out[rows] = reduced(self, chosen, u[rows] if len(u) > 1 else u, stop - start, sample_time, reduce)

        in_chunks(work, n_sets, workers=workers, minimum=max(1, AT_ONCE // u.shape[1]), n_samples=u.shape[1])
        return out

    def pushover(self, pattern: npt.ArrayLike, control: npt.ArrayLike, *, at: str = "displacement") -> StaticResponse:
        """Equilibria under loads that grow slowly, told by a displacement.

        ``K x + sum b f(b . x) = factor pattern``. The factor follows from the control, so that the path goes on where
        the structure softens. Between two control values each drift moves straight: dashpots and masses do nothing.

        Parameters
        ----------
        pattern : array, shape (n_nodes,)
            Loads at the masses for a factor of one [N].
        control : array, shape (n,)
            Displacements of what `at` names, one behind the other; the structure begins at `initial_state` [m].
        at : str
            What is controlled: ``"displacement.k"`` of the mass k, by default the last one, or ``"drift.k"``.

        Returns
        -------
        StaticResponse

        Raises
        ------
        SimulationError, ValueError
            If no equilibrium is found, as where the structure would snap through while the control rests, with the
            control value; if the pattern has not one number a mass or is zero, a number is infinite, or `at` unknown.

        Examples
        --------
        >>> import hysim as hs
        >>> column = hs.MaxwellSlip(stiffness=(90.0,), slips=(0.01,), feedthrough=10.0)
        >>> frame = hs.shear_frame([1.0, 1.0], laws=column)
        >>> push = frame.pushover([1.0, 2.0], [0.01, 0.02, 0.04])
        >>> push.base_shear.round(6).tolist()
        [0.6, 1.03125, 1.21875]
        """
        values = read_only(control, "control", ndim=1)
        return self._pushed(pattern, at, lambda begin: values)

    def cyclic(
        self,
        protocol: npt.ArrayLike,
        pattern: npt.ArrayLike | None = None,
        *,
        at: str = "displacement",
        steps: int = 50,
    ) -> StaticResponse:
        """Equilibria along slow cycles, as of a test with a jack.

        Parameters
        ----------
        protocol : array, shape (n,)
            Turning points of what `at` names, such as 0, 1, -1, 2, -2, 0 times the displacement at yield [m].
        pattern : array, shape (n_nodes,), optional
            Loads at the masses for a factor of one; by default a jack at what is controlled: one newton at the mass,
            or at both ends of the element.
        at, steps : str, and int
            As of `pushover`, and equal steps of each stroke.

        Returns
        -------
        StaticResponse
            It begins with the displacement of `initial_state`. Errors are those of `pushover`.

        Examples
        --------
        >>> import hysim as hs
        >>> column = hs.MaxwellSlip(stiffness=(90.0,), slips=(0.01,), feedthrough=10.0)
        >>> test = hs.shear_frame([1.0], laws=column).cyclic([0.02, -0.02, 0.0], steps=2)
        >>> test.control.tolist(), test.factor.round(6).tolist()
        ([0.0, 0.01, 0.02, 0.0, -0.02, -0.01, 0.0], [0.0, 1.0, 1.1, -0.9, -1.1, -0.1, 0.9])
        """
        check_whole(steps, "steps")
        turns = read_only(protocol, "protocol", ndim=1)
        return self._pushed(pattern, at, lambda begin: strokes(turns, begin, steps))

    def _pushed(self, pattern: npt.ArrayLike | None, at: str, control: Callable[[float], FloatArray]) -> StaticResponse:
        row = self._controlled(at)
        loads = row if pattern is None else read_only(pattern, "pattern", ndim=1)
        n, n_elements = self.n_nodes, len(self.elements)
        frozen.check_one_each("pattern", loads, n, "masses")
        if not loads.any():
            raise ValueError("pattern must not be zero")
        x = np.array(self.initial_state[:n] or np.zeros(n))
        push = _Push(self, x, loads, row)
        values, equilibria = control(float(row @ x)), []
        for k, value in enumerate(values.tolist()):
            with np.errstate(all="ignore"):
                reached = push.to(value)
            if not reached:
                raise SimulationError(
                    f"no equilibrium was found at control value {k} ({value:g} m): control a displacement that grows "
                    "all along, or use smaller steps"
                )
            equilibria.append(push.now)
        return StaticResponse(
            control=values,
            factor=np.array([each.factor for each in equilibria]),
            pattern=loads,
            displacement=np.array([each.x for each in equilibria]).reshape(len(equilibria), n),
            drift=np.array([push.rows @ each.x for each in equilibria]).reshape(len(equilibria), n_elements),
            force=np.array([each.force for each in equilibria]).reshape(len(equilibria), n_elements),
            residual=np.array([each.residual for each in equilibria]),
        )

    def _controlled(self, at: str) -> FloatArray:
        """Direction of a displacement or a drift, shape (n_nodes,)."""
        name, place = self.place_of(at)
        if name not in ("displacement", "drift"):
            raise ValueError(f'what is controlled must be a "displacement" or a "drift", got {at!r}')
        return np.asarray(self.drift_matrix[place] if name == "drift" else np.eye(self.n_nodes)[place])


def _elements(values: Any) -> tuple[Element, ...]:
    members = (values,) if isinstance(values, Element) else tuple(values)
    for each in members:
        if not isinstance(each, Element):
            raise TypeError(f"elements must hold Elements, got {type(each).__name__}")
    return members


def shear_frame(
    masses: npt.ArrayLike, stiffnesses: npt.ArrayLike | None = None, laws: Any = None, **options: Any
) -> Structure:
    """A frame whose rigid floors move sideways, one storey on the other.

    Parameters
    ----------
    masses, stiffnesses : array, shape (n,)
        Of the floors, the lowest first [kg], and, optional, of linear columns of each storey [N/m].
    laws : law, or sequence of n laws or None, optional
        Force of each storey's columns for its drift, beside the linear ones; one law for all storeys alike.
    **options
        Other arguments of `Structure`, such as ``damping``.

    Returns
    -------
    Structure
        Element k is the storey k between nodes k and k + 1; a storey without law has none.

    Raises
    ------
    ValueError
        If lengths differ, or there are neither stiffnesses nor laws.

    Examples
    --------
    >>> import hysim as hs
    >>> frame = hs.shear_frame([2.0, 2.0], [800.0, 400.0], damping=hs.ModalDamping(ratio=0.05))
    >>> frame.stiffness_matrix.tolist()
    [[1200.0, -400.0], [-400.0, 400.0]]
    """
    floors = read_only(masses, "masses", ndim=1)
    n = floors.size
    if stiffnesses is None and laws is None:
        raise ValueError("a frame needs stiffnesses, laws, or both")
    springs = np.zeros(n) if stiffnesses is None else read_only(stiffnesses, "stiffnesses", ndim=1)
    frozen.check_one_each("stiffnesses", springs, n, "storeys")
    several: Sequence[Any] = laws if isinstance(laws, (list, tuple)) else [laws] * n
    if len(several) != n:
        raise ValueError(f"laws must hold one for each of {n} storeys, got {len(several)}")
    rows = np.eye(n) - np.eye(n, k=-1)
    return Structure(
        mass=floors,
        stiffness=rows.T @ (springs[:, np.newaxis] * rows),
        elements=tuple(Element(law, between=(k, k + 1)) for k, law in enumerate(several) if law is not None),
        **options,
    )


_PHASE = 0.18  # of an elastic oscillator in a step: peaks between its ends then err by less than 1e-10
_TOLERANCE = 1e-8  # ductilities err by less than 1e-6; coarser steps make small reversals, after which steel is elastic
_AT_REST, _EQUAL = 1e-8, 1e-3  # stroke by yield_input; difference of the slopes to both sides
_STEP, _MOST = math.log(1.2), math.log(1e8)  # of a scale; half the step was tried, and misses as many crossings
_CLOSE, _NARROW = 1e-6, 1e-10  # in ln(ductility); in ln(scale) where the ductility jumps
_MOST_ZEROS = 1e7  # after a record, whose last velocity an oscillator stores for a quarter of its period
_DIVERGED = 1e6  # times the elastic displacement; down to periods of 1 ms the weakest oscillators follow the ground


@frozen_result
class ResponseSpectrum:
    """Result of `hysim.response_spectrum`; tables have the shape (n_records, n_periods).

    Parameters
    ----------
    periods, damping : array, shape (n_periods,), and float
        Periods of small motions [s], and share of their critical damping.
    elastic_acceleration, pseudo_acceleration : array
        Elastic pseudo-acceleration, and yield strength over mass, or without a law the first again [unit of the input].
    ductility : array
        Peak displacement over that at yield; 1 without a law, inf where the motion diverges.
    """

    periods: FloatArray
    damping: float
    elastic_acceleration: FloatArray
    pseudo_acceleration: FloatArray
    ductility: FloatArray

    @property
    def displacement(self) -> FloatArray:
        """Peak displacement relative to the ground [unit of the ground acceleration times s^2]."""
        return np.asarray(self.ductility * self.pseudo_acceleration * (self.periods / (2.0 * math.pi)) ** 2)

    @property
    def reduction_factor(self) -> FloatArray:
        """Elastic demand over the yield strength."""
        return np.asarray(self.elastic_acceleration / self.pseudo_acceleration)

    def __str__(self) -> str:
        tables = (self.displacement, self.pseudo_acceleration, self.ductility, self.reduction_factor)
        medians = np.array([self.periods, *(np.median(table, axis=0) for table in tables)])
        shown = medians[:, np.unique(np.linspace(0, self.periods.size - 1, 7).astype(int))]
        names = ["  period", "displacement", "pseudo-acceleration", "ductility", "reduction factor"]
        lines = aligned([names, *([f"  {row[0]:.3g}", *(f"{each:.4g}" for each in row[1:])] for row in shown.T)])
        size = f"medians of {len(self.ductility)} records, {self.periods.size} periods, damping {self.damping:g}"
        return summary_text([f"ResponseSpectrum: {size}", *lines])


def response_spectrum(
    ground_accelerations: npt.ArrayLike | Sequence[npt.ArrayLike],
    sample_time: float,
    periods: npt.ArrayLike,
    *,
    law: Any = None,
    yield_input: float = 1.0,
    damping: float = 0.05,
    ductility: float | None = None,
    strength: npt.ArrayLike | None = None,
    workers: int | None = None,
) -> ResponseSpectrum:
    """Peaks of oscillators in earthquakes: elastic ones, or ones of a law with one ductility or one strength.

    Parameters
    ----------
    ground_accelerations : array, shape (n_samples,) or (n_records, n_samples), or sequence of arrays
        Records, linear between samples. Each is continued by zeros for the longest period.
    sample_time, periods : float, and array, shape (n_periods,)
        Time between two samples of all records, and periods of small motions [s].
    law, yield_input : law, or result of a fit of one, and float, optional
        Shape of the restoring force, in any units, and the input at which its ductility is 1.
    damping : float
        Share of the critical damping of small motions, from 0 to below 1.
    ductility : float, optional
        At least 1: the largest strength with this ductility is searched for, downwards from the elastic demand in steps
        of 1.2. Where the ductility jumps over this value, it is the strength before the jump.
    strength : float, or array, shape (n_periods,) or (n_records, n_periods), optional
        Yield strength over mass [unit of the ground acceleration]; its ductility is computed.
    workers : int, optional
        Number of threads; by default one for each core. The result does not depend on it.

    Returns
    -------
    ResponseSpectrum

    Raises
    ------
    TypeError, ValueError
        If the law cannot be an `Element`, or has no positive stiffness at rest; if a number is out of its range, a law
        comes without ductility and strength or with both, or no strength has the ductility.

    Examples
    --------
    >>> import hysim as hs
    >>> quake = hs.signals.ground_motion(3.0, duration=20.0, sample_time=0.01, seed=1)
    >>> spectrum = hs.response_spectrum(quake, 0.01, [0.2, 1.0], law=hs.MenegottoPinto(), ductility=4.0)
    >>> spectrum.reduction_factor.round(3).tolist()
    [[2.176, 2.441]]
    """
    h, T = positive_time(sample_time), read_only(periods, "periods", ndim=1)
    if (n_zeros := T.max(initial=0.0) / h) > _MOST_ZEROS:
        raise ValueError(f"periods of up to {T.max():g} s need {n_zeros:.3g} zeros after a record: take shorter ones")
    records = ground_records(ground_accelerations, math.ceil(n_zeros))
    strengths = np.broadcast_to(read_only(1.0 if strength is None else strength, "strength"), (len(records), T.size))
    check_positive(periods=min(T, default=0.0), yield_input=yield_input, strength=strengths.min(initial=1.0))
    if not 0.0 <= damping < 1.0 <= (1.0 if ductility is None else ductility) < math.inf:
        raise ValueError(f"damping must be from 0 to below 1, ductility at least 1, got {damping} and {ductility}")
    if (ductility is not None) + (strength is not None) != (law is not None):
        raise ValueError("a law needs either ductility= or strength=; elastic oscillators have no law and neither")
    omega, spring = 2.0 * math.pi / T, Line(slope=1.0) if law is None else model_of(law)
    oscillator = shear_frame([1.0], laws=spring, damping=1.0, tolerance=_TOLERANCE)
    parts = [(w, whole_substeps(w * h / _PHASE)) for w in omega.tolist()]
    linear = [shear_frame([1.0], laws=Line(slope=w * w), damping=2.0 * damping * w, substeps=n) for w, n in parts]
    at_yield, mass = omega**2 * yield_input, _slope(oscillator, yield_input) / omega**2

    def work(k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        run: dict[str, Any] = {"ground_accelerations": records[k], "sample_time": h, "workers": 1}
        demand = omega**2 * np.array([each.responses([1.0], **run)[0, 0] for each in linear])
        if not demand.all():
            raise ValueError(f"record {k} of ground_accelerations is zero or empty")
        if law is None:
            return demand, demand, np.ones(T.size)

        def peaks(scales: FloatArray, places: Any) -> FloatArray:
            numbers = {"mass": mass[places], "damping": (2.0 * damping * omega * mass)[places], "scale": scales}
            values = oscillator.responses(numbers, **run)[:, 0] / yield_input
            return np.where(values < _DIVERGED * scales * (demand / at_yield)[places], values, np.inf)

        if ductility is None:
            return demand, strengths[k], peaks(at_yield / strengths[k], slice(None))
        scales, ductilities = _first_crossing(peaks, ductility, at_yield / demand)
        return demand, at_yield / scales, ductilities

    tables = np.swapaxes(map_on_threads(work, len(records), workers=workers), 0, 1)
    names = ("elastic_acceleration", "pseudo_acceleration", "ductility")
    return ResponseSpectrum(periods=T, damping=damping, **dict(zip(names, tables, strict=True)))


def ground_records(values: Any, n_zeros: int = 0) -> list[FloatArray]:
    """One record, the rows of a table, or a sequence of records, each continued by zeros."""
    are_several = isinstance(values, list | tuple) and any(np.ndim(row) for row in values[:1])
    rows = values if are_several else np.atleast_2d(read_only(values, "ground_accelerations"))
    return [np.append(read_only(row, "ground_accelerations", ndim=1), np.zeros(n_zeros)) for row in rows]


def _slope(oscillator: Structure, yield_input: float) -> float:
    law, stroke = oscillator.laws.steppers[0], _AT_REST * yield_input
    members = ((law.started(0.0), u) for u in (stroke, -stroke))
    up, down = (each.step(each.parameters, each.state, u) / u for each, u in members)
    if not (min(up, down) > 0.0 and abs(up - down) <= _EQUAL * max(up, down)):
        words = f"at inputs of +-{_AT_REST:g} yield_input output over input is {up:g} and {down:g}"
        raise ValueError(f"the law needs no force at rest and one positive stiffness on both sides: {words}")
    return float(0.5 * (up + down))


def _first_crossing(peaks: Any, ductility: float, elastic: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest scales with a ductility, or those before it jumps, and the ductilities; trials begin at `elastic`."""
    from scipy.optimize import elementwise

    def excess(x: FloatArray, places: Any) -> FloatArray:
        return np.asarray(np.log(peaks(np.exp(x), places) / ductility).clip(max=5.0))  # of infinite ones, too

    start, every = np.log(elastic), np.arange(elastic.size)
    x, remaining, is_above = start.copy(), every, excess(start, every) >= 0.0
    while remaining.size:
        x[remaining] += np.where(is_above[remaining], -_STEP, _STEP)  # smooth laws yield before their yield_input
        if np.abs(x - start).max() > _MOST:
            raise ValueError("no strength has this ductility: is yield_input the input at which the law yields?")
        remaining = remaining[(excess(x[remaining], remaining) >= 0.0) == is_above[remaining]]
    low, tolerances = np.where(is_above, x, x - _STEP), {"xatol": _NARROW, "xrtol": 0.0, "fatol": _CLOSE, "frtol": 0.0}
    root = elementwise.find_root(excess, (low, low + _STEP), args=(every,), tolerances=tolerances)
    x, value = np.where(np.abs(root.f_x) <= _CLOSE, (root.x, root.f_x), (root.bracket[0], root.f_bracket[0]))
    return np.exp(x), ductility * np.exp(value)
