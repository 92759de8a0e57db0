"""Masses on linear and hysteretic elements.

    M x'' + C x' + K x + sum over elements of b f(b . x) = -M r a(t)    under the acceleration a of the base,
                                                         =  r u(t)      under a force u

x are the displacements relative to the ground; b is the direction of an element, f its law for the drift b . x, and r
the influence. The input is linear between the samples. How it is integrated: `hysim.kernels.structures.path`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky, eigh

from hysim._frozen import FloatArray, check_choice, check_whole, read_only
from hysim._parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels.structures.path import Elements, Motion, Plant, Tracks, follow
from hysim.models.model import family
from hysim.models.protocols import positive_time
from hysim.plants.structures import assembly
from hysim.plants.structures.damping import ModalDamping, Rayleigh
from hysim.plants.structures.element import Element, dissipates, parted
from hysim.plants.structures.ensemble import Reduction, responses
from hysim.plants.structures.parameters import assembled, scalars_of
from hysim.plants.structures.records import OF_ELEMENTS, OF_NODES
from hysim.plants.structures.search import SearchedStructure
from hysim.plants.structures.static import Frame, StaticResponse, pushed, strokes

_OUTPUTS = (*OF_NODES, *OF_ELEMENTS)
_LOOSEST = 1e-3  # tolerance


_IMBALANCE = 0.05  # share of the largest work that may be missing


class StructureState(NamedTuple):
    """State of a simulation: what moves along, `started` after the first sample, and the energies at the start."""

    motion: Motion
    started: bool
    stored: float


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
        Laws between the nodes; their dashpots are a part of the damping.
    excitation : {"base", "force"}
        Whether the input is the acceleration of the base [m/s^2] or a force [N].
    influence : tuple of float
        Displacement of each mass when the base moves by one, by default 1; or the share of the force at each mass, by
        default all of it at the last one.
    output : str
        Signal that is the output y: ``"displacement"``, ``"velocity"``, ``"acceleration"``, with the number of the
        mass, such as ``"acceleration.2"``; ``"drift.0"`` or ``"force.0"`` with the place of the element. Without a
        number the last one.
    substeps : int, optional
        Equal steps between two samples, of order 4. By default steps are divided by `tolerance`.
    tolerance : float
        Largest disagreement of two sweeps of a step, as a share of the largest drift so far; between 1e-12 and 1e-3.
        The error of the drifts is about as large.
    initial_state : tuple of float
        Displacements and velocities at the first sample, one behind the other; empty for rest.

    Raises
    ------
    ValueError
        If sizes do not fit, a matrix is not symmetric, the mass is not positive definite, a number is not finite, or
        an option is unknown.
    TypeError
        If an element is not an `Element`.

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

    mass: FloatArray
    damping: Any = 0.0
    stiffness: FloatArray = 0.0  # type: ignore[assignment]
    elements: Any = ()
    excitation: str = "base"
    influence: tuple[float, ...] = ()
    output: str = "displacement"
    substeps: int | None = None
    tolerance: float = 1e-8
    initial_state: tuple[float, ...] = ()

    dynamic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", _elements(self.elements))
        if not isinstance(self.damping, Rayleigh | ModalDamping):
            object.__setattr__(self, "damping", read_only(self.damping, "damping"))
        check_choice("excitation", self.excitation, ("base", "force"))
        if self.substeps is not None:
            check_whole(self.substeps, "substeps")
        if not 1e-12 <= self.tolerance <= _LOOSEST:
            raise ValueError(f"tolerance must be between 1e-12 and {_LOOSEST:g}, got {self.tolerance:g}")
        if len(self.influence) not in (0, self.n_nodes):
            raise ValueError(
                f"influence must hold one number for each of {self.n_nodes} masses, got {len(self.influence)}"
            )
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

    # ------------------------------------------------------------------------------ what it is made of

    @cached_property
    def n_nodes(self) -> int:
        """Number of masses."""
        damping = () if isinstance(self.damping, Rayleigh | ModalDamping) else np.shape(self.damping)
        shapes = (np.shape(self.mass), damping, np.shape(self.stiffness))
        return int(max([1, *(shape[0] for shape in shapes if shape), *(each.highest_node for each in self.elements)]))

    @cached_property
    def mass_matrix(self) -> FloatArray:
        """Mass, shape (n, n) [kg]."""
        return _matrix(self.mass, "mass", self.n_nodes)

    @cached_property
    def stiffness_matrix(self) -> FloatArray:
        """Linear stiffness without the elements, shape (n, n) [N/m]."""
        return _matrix(self.stiffness, "stiffness", self.n_nodes)

    @cached_property
    def drift_matrix(self) -> FloatArray:
        """Drifts by displacements, shape (n_elements, n)."""
        rows = [element.drift_row(self.n_nodes) for element in self.elements]
        return read_only(np.array(rows).reshape(-1, self.n_nodes))

    @cached_property
    def laws(self) -> assembly.Laws:
        """Steps and memories of the elements, without their dashpots."""
        return assembly.laws_of([parted(element.law).law for element in self.elements])

    @cached_property
    def elastic_slopes(self) -> FloatArray:
        """Slope of each element at its start, zero where it is negative, shape (n_elements,) [N/m]."""
        rows = (read_only(each[np.newaxis], finite=False) for each in (self.laws.parameters, self.laws.states))
        return read_only(self.laws.slopes(*rows)[0])

    @cached_property
    def initial_stiffness(self) -> FloatArray:
        """Stiffness with the elastic slopes of the elements, shape (n, n) [N/m]."""
        rows = self.drift_matrix
        return read_only(self.stiffness_matrix + rows.T @ (self.elastic_slopes[:, np.newaxis] * rows))

    @cached_property
    def own_damping(self) -> FloatArray:
        """Damping without the dashpots of the elements, shape (n, n) [N s/m]."""
        if isinstance(self.damping, Rayleigh | ModalDamping):
            return read_only(self.damping.matrix(self.mass_matrix, self.initial_stiffness))
        return _matrix(self.damping, "damping", self.n_nodes)

    @cached_property
    def viscosities(self) -> FloatArray:
        """Coefficient of each element's dashpots, shape (n_elements,) [N s/m]."""
        return read_only([parted(element.law).viscosity for element in self.elements])

    @cached_property
    def damping_matrix(self) -> FloatArray:
        """Damping with the dashpots of the elements, shape (n, n) [N s/m]."""
        rows = self.drift_matrix
        return read_only(self.own_damping + rows.T @ (self.viscosities[:, np.newaxis] * rows))

    @cached_property
    def force_directions(self) -> FloatArray:
        """Force at each mass under an input of one, shape (1, n)."""
        if self.excitation == "base":
            return read_only(-(self.mass_matrix @ np.array(self.influence or np.ones(self.n_nodes)))[np.newaxis])
        last = np.arange(self.n_nodes) == self.n_nodes - 1
        return read_only(np.array(self.influence or last.astype(float))[np.newaxis])

    @cached_property
    def matrices(self) -> assembly.Matrices:
        """The linear part, as one row."""
        parts = (self.mass_matrix, self.damping_matrix, self.initial_stiffness, self.force_directions)
        mass, damping, stiffness, directions = (part[np.newaxis] for part in parts)
        return assembly.Matrices(mass, damping, stiffness, self.drift_matrix, directions)

    @cached_property
    def kernel_elements(self) -> Elements:
        """The elements as the kernel takes them."""
        return assembly.elements_of(self.laws, self.drift_matrix, self.elastic_slopes)

    @property
    def scalars(self) -> dict[str, float]:
        """Every number by name, such as ``"damping"`` and ``"elements.0.beta"``; see `assemble`."""
        return scalars_of(self)

    def assemble(self, parameters: Mapping[str, float]) -> "Structure":
        """The structure with some numbers exchanged.

        Parameters
        ----------
        parameters : mapping
            Names in `scalars` to numbers. ``"mass"``, ``"stiffness"`` and ``"damping"`` are the number itself, where
            the argument is one or a `ModalDamping` of one ratio, and else a factor of the whole, 1 as it is; there
            are ``"mass[0]"``, ``"damping[1]"`` of several, too, and ``"damping.mass"`` of a `Rayleigh`. The numbers
            of laws have the laws' own names, ``"elements.0.thresholds[1]"``, those of sums the parts' labels,
            ``"elements.0.bouc_wen.beta"``; ``"elements.*.beta"`` is one number for all elements with this name.

        Returns
        -------
        Structure

        Raises
        ------
        ValueError
            If a name is unknown, or a constructor refuses a number.

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

    def with_substeps(self, substeps: int | None) -> "Structure":
        return replace(self, substeps=substeps)

    @property
    def fastest_rate(self) -> float:
        return float(assembly.linear_parts(self.matrices)[2][0])

    def dissipative(self, strokes: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each element is no source of energy in cycles between plus and minus its stroke [m]."""
        pairs = zip(self.elements, strokes.tolist(), strict=True)
        return np.array([dissipates(element.law, stroke) for element, stroke in pairs])

    @property
    def widths(self) -> dict[str, int]:
        return {name: self._column_count(name) for name in _OUTPUTS}

    @property
    def sensor(self) -> tuple[str, int]:
        return self.place_of(self.output)

    # ------------------------------------------------------------------------------ small motions

    def periods(self) -> FloatArray:
        """Periods of small motions at the start, the longest first, shape (n,) [s]; inf for a mass that is free.

        Raises ValueError if the stiffness at the start is negative.
        """
        squares = eigh(self.initial_stiffness, self.mass_matrix, eigvals_only=True)
        if squares[0] < -1e-9 * np.abs(squares).max():
            raise ValueError("the stiffness at the start is negative: small motions have no periods")
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * np.pi / np.sqrt(np.maximum(squares, 0.0)))

    def modes(self) -> FloatArray:
        """Shapes of small motions at the start, one a column, in the order of `periods`, shape (n, n).

        They have modal masses of one; the largest displacement of each is positive.
        """
        shapes = eigh(self.initial_stiffness, self.mass_matrix)[1]
        largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(self.n_nodes)]
        return np.asarray(shapes * np.sign(largest))

    # ------------------------------------------------------------------------------ slow motions

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
        SimulationError
            If no equilibrium is found, as where the structure would snap through while the control rests; it names the
            control value.
        ValueError
            If the pattern has not one number for each mass or is zero, a number is not finite, or `at` names neither a
            displacement nor a drift.

        Examples
        --------
        >>> import hysim as hs
        >>> column = hs.MaxwellSlip(stiffness=(90.0,), slips=(0.01,), feedthrough=10.0)
        >>> frame = hs.shear_frame([1.0, 1.0], laws=column)
        >>> push = frame.pushover([1.0, 2.0], [0.01, 0.02, 0.04])
        >>> push.base_shear.round(6).tolist()
        [0.6, 1.03125, 1.21875]
        """
        loads = read_only(pattern, "pattern", ndim=1)
        if loads.size != self.n_nodes:
            raise ValueError(f"pattern must hold one number for each of {self.n_nodes} masses, got {loads.size}")
        values = read_only(control, "control", ndim=1)
        return pushed(self._at_rest, self._first_displacements, loads, self._controlled(at), lambda begin: values)

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
        at : str
            As of `pushover`.
        steps : int
            Equal steps of each stroke.

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
        turns, row = read_only(protocol, "protocol", ndim=1), self._controlled(at)
        loads = row if pattern is None else read_only(pattern, "pattern", ndim=1)
        if loads.size != self.n_nodes:
            raise ValueError(f"pattern must hold one number for each of {self.n_nodes} masses, got {loads.size}")
        return pushed(self._at_rest, self._first_displacements, loads, row, lambda begin: strokes(turns, begin, steps))

    @property
    def _at_rest(self) -> Frame:
        return Frame(self.stiffness_matrix, self.drift_matrix, self.laws, self.elastic_slopes)

    @property
    def _first_displacements(self) -> FloatArray:
        return np.array(self.initial_state[: self.n_nodes] or np.zeros(self.n_nodes))

    def _controlled(self, at: str) -> FloatArray:
        """Direction of a displacement or a drift, shape (n_nodes,)."""
        name, place = self.place_of(at)
        if name not in ("displacement", "drift"):
            raise ValueError(f'what is controlled must be a "displacement" or a "drift", got {at!r}')
        return np.asarray(self.drift_matrix[place] if name == "drift" else np.eye(self.n_nodes)[place])

    # ------------------------------------------------------------------------------ motion

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Output y at the samples of an input that is linear between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Acceleration of the base [m/s^2] or force [N]; at its first sample the structure has the initial state.
        sample_time : float
            Time between two samples [s].

        Returns
        -------
        array, shape (n_samples,)
            The signal that `output` names.

        Raises
        ------
        SimulationError
            If the motion diverges, or cannot be resolved; it names the time.
        ValueError
            If u is not finite or has not one axis, or the sample time is not positive.
        """
        return self.signals(u, sample_time)["y"]

    def signals(self, u: npt.ArrayLike, sample_time: float) -> dict[str, FloatArray]:
        """Every signal at the samples of `u`, by name; arguments and errors as of `response`.

        Returns
        -------
        mapping
            ``"y"``; ``"displacement"``, ``"velocity"`` (n_samples, n), relative to the ground [m], [m/s];
            ``"acceleration"``, absolute under a moving base of influence 1 [m/s^2]; ``"drift"``, ``"force"``
            (n_samples, n_elements) [m], [N]; ``"peak_drift"``, ``"peak_force"``, ``"peak_displacement"``,
            ``"peak_acceleration"``, the largest sizes so far, those of drifts and displacements also between samples;
            and energies since the start [J]: ``"kinetic"``, ``"elastic"`` (of `stiffness`), ``"damping_loss"``,
            ``"input_work"``, ``"element_work"`` (n_samples, n_elements), which is stored and dissipated, and
            ``"dissipated"``, without what elastic unloading would return, force^2 / (2 k) with the slope k at the
            start; ``"imbalance"`` is the input less all others, the error of the method.
        """
        return self.advance(u, sample_time)[0]

    def advance(
        self,
        u: npt.ArrayLike,
        sample_time: float,
        state: StructureState | None = None,
        *,
        progress: Callable[[int, int], None] | None = None,
    ) -> tuple[dict[str, FloatArray], StructureState]:
        """As `signals`, continued from `state`, by default the initial one, and the state after the last sample.

        The bits are those of one uncut input, which goes on from the state's, one sample before the first.
        ``progress(done, total)`` is called now and then.
        """
        inputs = read_only(u, "u", ndim=1)
        begun, tracks = self._followed(inputs, sample_time, state, progress, with_laws=False)
        return self.signals_of(inputs, begun, tracks), begun

    def memories(self, u: npt.ArrayLike, sample_time: float) -> tuple[FloatArray, ...]:
        """State of each element's law at the samples of `u`, its last input and its memory.

        Parameters
        ----------
        u : array, shape (n_samples,)
            As of `response`.
        sample_time : float
            [s]

        Returns
        -------
        tuple of arrays, shape (n_samples, n_numbers)
        """
        states = self._followed(read_only(u, "u", ndim=1), sample_time, None, None, with_laws=True)[1].laws
        ends = np.cumsum([each.state.size for each in self.laws.steppers])[:-1]
        parts = np.split(states, ends, axis=1) if self.elements else []
        return tuple(part[:, place] for part, place in zip(parts, self.laws.places, strict=True))

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
            ``"energy"`` (the work that each element has taken), of each element; ``"peak_displacement"`` or
            ``"peak_acceleration"`` (absolute, at samples), of each mass.
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
        return responses(self, parameters_or_scales, ground_accelerations, sample_time, reduce, workers)

    def start(self) -> StructureState:
        """The state before the first sample."""
        x = np.array(self.initial_state or np.zeros(2 * self.n_nodes))
        motion = assembly.motion_at(self.kernel_elements, self.laws, x, len(self.force_directions))
        return StructureState(motion, False, self._stored(x[np.newaxis])[0])

    def _followed(
        self, u: FloatArray, sample_time: float, state: StructureState | None,
        progress: Callable[[int, int], None] | None, *, with_laws: bool,
    ) -> tuple[StructureState, Tracks]:  # fmt: skip
        """The state after the samples, and all of them."""
        positive_time(sample_time)
        before = state or self.start()
        motion = Motion(*(part.copy() for part in before.motion))
        A, loads, rates = assembly.linear_parts(self.matrices)
        pushing = np.array([float(self.excitation == "force")])
        plant = Plant(A[0], loads[0], np.array(self.damping_matrix), np.array(self.force_directions), pushing)
        steps = assembly.steps_of(float(rates[0]), sample_time, self.substeps, self.tolerance)
        elements, flows = self.kernel_elements, assembly.flows_of(self.kernel_elements, plant, steps)
        n, tracks = u.size, assembly.empty_tracks(u.size, motion, with_laws=with_laws)
        inputs, room = np.ascontiguousarray(u[:, np.newaxis]), assembly.room_for(motion)

        def run(k: slice) -> int:
            rows = Tracks(*(part[k] for part in tracks))
            is_first = k.start == 0 and not before.started
            lost = int(follow(elements, flows, plant, steps, is_first, inputs[k], motion, room, rows))
            if progress is not None:
                progress(k.stop, n)
            return lost

        with np.errstate(all="ignore"):
            lost = in_pieces(run, n)
        if lost >= 0:
            hint = "; if it should not, use more substeps, or substeps=None" if self.substeps else ""
            raise SimulationError(f"the motion diverges at t = {lost * sample_time:g}{hint}")
        self.check_resolved(motion)
        return StructureState(motion, before.started or n > 0, before.stored), tracks

    def check_resolved(self, motion: Motion) -> None:
        """Refuse a motion with steps whose sweeps do not agree, which could not be divided further."""
        errors, peaks = motion.carry[4][np.newaxis], motion.peaks[np.newaxis, : len(self.elements)]
        apart = float(assembly.uncertainty(errors, peaks)[0])
        if not apart <= assembly.LEAST_CERTAIN:
            raise SimulationError(
                f"the motion is not resolved: the drift of a step is uncertain by {apart:.2g} of the largest one; "
                + ("use more substeps, or substeps=None" if self.substeps else "use a smaller sample_time")
            )

    def _stored(self, x: FloatArray) -> FloatArray:
        """Kinetic and elastic energy of states (k, m), shape (k,)."""
        kinetic, elastic = self._energies(x)
        return kinetic + elastic

    def _energies(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        n = self.n_nodes
        kinetic = 0.5 * np.einsum("ki,ij,kj->k", x[:, n:], self.mass_matrix, x[:, n:])
        elastic = 0.5 * np.einsum("ki,ij,kj->k", x[:, :n], self.stiffness_matrix, x[:, :n])
        return kinetic, elastic

    def signals_of(self, u: FloatArray, state: StructureState, tracks: Tracks) -> dict[str, FloatArray]:
        """Signals by name of tracks under the inputs `u`, which end in `state`."""
        n, n_elements = self.n_nodes, len(self.elements)
        x, (force, _, drift, rate, _) = tracks.x, np.moveaxis(tracks.carry, 1, 0)
        kinetic, elastic = self._energies(x)
        work = tracks.work[:, 2:]
        slopes = self.elastic_slopes
        with np.errstate(divide="ignore", invalid="ignore"):
            returned = np.where(slopes > 0.0, (force**2 - self._first_forces**2) / (2.0 * slopes), 0.0)
        imbalance = tracks.work[:, 0] - tracks.work[:, 1] - work.sum(axis=1) - (kinetic + elastic - state.stored)
        viscous = rate * self.viscosities
        signals = {
            "displacement": x[:, :n],
            "velocity": x[:, n:],
            "acceleration": self._accelerations(x, force, u),
            "drift": drift,
            "force": force + viscous,
            "peak_drift": tracks.peaks[:, :n_elements],
            "peak_force": tracks.peaks[:, n_elements : 2 * n_elements],
            "peak_displacement": tracks.peaks[:, 2 * n_elements : 2 * n_elements + n],
            "peak_acceleration": tracks.peaks[:, 2 * n_elements + n :],
            "kinetic": kinetic,
            "elastic": elastic,
            "damping_loss": tracks.work[:, 1],
            "input_work": tracks.work[:, 0],
            "element_work": work,
            "dissipated": work - returned,
            "imbalance": imbalance,
        }
        largest = float(np.abs(tracks.work).max(initial=0.0))
        if (wrong := float(np.abs(imbalance).max(initial=0.0))) > _IMBALANCE * largest:
            raise SimulationError(
                f"the motion is not resolved: {wrong / largest:.2g} of the energy is missing; "
                + ("use more substeps, or substeps=None" if self.substeps else "use a smaller tolerance")
            )
        name, place = self.place_of(self.output)
        arrays = {"y": signals[name][:, place], **signals}
        return {each: np.ascontiguousarray(values) for each, values in arrays.items()}

    @cached_property
    def _first_forces(self) -> FloatArray:
        return np.asarray(self.start().motion.carry[0])

    def _accelerations(self, x: FloatArray, force: FloatArray, u: FloatArray) -> FloatArray:
        """Accelerations (k, n): under a moving base without that of the base, which is added to have absolute ones."""
        n = self.n_nodes
        inner = x[:, :n] @ self.stiffness_matrix.T + x[:, n:] @ self.damping_matrix.T + force @ self.drift_matrix
        outer = u[:, np.newaxis] * self.force_directions if self.excitation == "force" else 0.0
        return np.asarray(np.linalg.solve(self.mass_matrix, (outer - inner).T).T)

    def _column_count(self, signal: str) -> int:
        return len(self.elements) if signal in OF_ELEMENTS else self.n_nodes

    def place_of(self, output: str) -> tuple[str, int]:
        """Name and column of an output; ValueError if there is none of this name."""
        name, _, place = output.partition(".")
        first, count = int(name not in OF_ELEMENTS), self._column_count(name)
        if name not in _OUTPUTS or not (place.isdecimal() or not place):
            raise ValueError(f'output must be a name such as "displacement" or "drift.0", got {output!r}')
        column = int(place) - first if place else count - 1
        if not 0 <= column < count:
            raise ValueError(f"output {output!r} names none of the {count} {'elements' if not first else 'masses'}")
        return name, column


def _elements(values: Any) -> tuple[Element, ...]:
    """The elements as a tuple."""
    members = (values,) if isinstance(values, Element) else tuple(values)
    for each in members:
        if not isinstance(each, Element):
            raise TypeError(f"elements must hold Elements, got {type(each).__name__}")
    return members


def _matrix(values: FloatArray, name: str, n_nodes: int) -> FloatArray:
    """A number for each mass, one for all, or a symmetric matrix, as a matrix."""
    if values.ndim < 2:
        if values.ndim and values.size != n_nodes:
            raise ValueError(f"{name} must hold one number for each of {n_nodes} masses, got {values.size}")
        return read_only(np.diag(np.broadcast_to(values, n_nodes)))
    if values.shape != (n_nodes, n_nodes):
        raise ValueError(f"{name} must have the shape ({n_nodes}, {n_nodes}), got {values.shape}")
    if not np.allclose(values, values.T, rtol=1e-12, atol=1e-12 * np.abs(values).max()):
        raise ValueError(f"{name} must be a symmetric matrix")
    return read_only(0.5 * (values + values.T))
