"""Masses on linear and hysteretic elements.

    M x'' + C x' + K x + sum over elements of b f(b . x) = -M r a(t)    under the acceleration a of the base,
                                                         =  r u(t)      under a force u

x are the displacements relative to the ground; b is the direction of an element, f its law for the drift b . x, and r
the influence. The input is linear between the samples. How it is integrated: `hysim.kernels.structures.path`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky

from hysim._frozen import FloatArray, check_choice, check_whole, read_only
from hysim.models.model import family
from hysim.plants.structures.ensemble import Reduction, responses
from hysim.plants.structures.parts import Element, ModalDamping, Rayleigh, assembled
from hysim.plants.structures.search import SearchedStructure
from hysim.plants.structures.static import PushedStructure

_LOOSEST = 1e-3  # tolerance


@family
class Structure(SearchedStructure, PushedStructure):
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


def _elements(values: Any) -> tuple[Element, ...]:
    """The elements as a tuple."""
    members = (values,) if isinstance(values, Element) else tuple(values)
    for each in members:
        if not isinstance(each, Element):
            raise TypeError(f"elements must hold Elements, got {type(each).__name__}")
    return members


def shear_frame(
    masses: npt.ArrayLike,
    stiffnesses: npt.ArrayLike | None = None,
    laws: Any = None,
    **options: Any,
) -> Structure:
    """A frame whose rigid floors move sideways, one storey on the other.

    Parameters
    ----------
    masses : array, shape (n,)
        Of the floors, the lowest first [kg].
    stiffnesses : array, shape (n,), optional
        Of linear columns of each storey [N/m].
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
    if springs.size != n:
        raise ValueError(f"stiffnesses must hold one number for each of {n} storeys, got {springs.size}")
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
