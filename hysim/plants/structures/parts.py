"""Parts of a structure, elements and damping, and its numbers by name.

    mass, stiffness, damping        the number where it is one, or the ratio of a ModalDamping of one ratio;
                                    else a factor of the whole, 1 as it is
    mass[1], damping[0]             one of several, the ratio of a mode; likewise influence[2], initial_state[0]
    damping.mass, damping.stiffness of a Rayleigh damping
    elements.0.beta                 of the law of an element, by its own names, such as elements.0.thresholds[1]
    elements.0.bouc_wen.beta        of a part of a sum, or a stage of a cascade
    elements.*.beta                 one number for all elements whose law has this name

A factor multiplies what the other names leave; a name with a number wins over the one with the star.
"""

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Any, NamedTuple, Self

import numpy as np

from hysim._basics.frozen import FloatArray, check_not_negative, check_one_each, check_positive, check_whole, read_only
from hysim._basics.results import model_of
from hysim.errors import SimulationError
from hysim.laws.dashpot import Dashpot
from hysim.laws.friction.rated_law import RatedLaw
from hysim.laws.static import Line
from hysim.models.model import family
from hysim.models.parts import own
from hysim.models.protocols import Numbered, Sampled, Stepwise, needs_time
from hysim.models.sum import Sum
from hysim.signals import triangle

OF_NODES = ("displacement", "velocity", "acceleration")
OF_ELEMENTS = ("drift", "force")
"""Names of signals with a column for each mass, and for each element."""

_SAMPLES = 200  # of a cycle
_ROUNDING = 1e-9  # of the work of the whole force along the whole drift: less is none
MATRICES = ("mass", "stiffness", "damping")
_TUPLES = ("influence", "initial_state")
_ELEMENTS, _ALL = "elements", "*"
_SHOWN = 24  # names in a message


@family
class Element:
    """Element with memory, whose force is that of a law for its drift.

    Parameters
    ----------
    law : law
        Force [N] for the drift [m]: any rate-independent law, a `hysim.Dashpot`, or a sum of them; friction, such as
        `hysim.LuGre`, or a `hysim.ElasticBacklash`; a user's own family or `hysim.CustomLaw` too. A positive force
        resists a positive drift.
    between : (int, int)
        Nodes i and j; the drift is ``x_j - x_i``. Node 0 is the ground, the masses are nodes 1, 2, ...
    direction : tuple of float
        In place of `between`: the drift is the product of these numbers, one for each mass, with the displacements.

    Raises
    ------
    TypeError, ValueError
        If the law cannot be stepped, a node is not whole, not exactly one of `between` and `direction` is given, nodes
        are equal or negative, or the direction is zero.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Element(hs.Dahl(), between=(0, 1)).between
    (0, 1)
    """

    law: Any = field(kw_only=False)
    between: Any = ()
    direction: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(model_of(self.law), Stepwise):
            raise TypeError(f"an element takes a law that can be stepped, got {type(self.law).__name__}")
        if isinstance(self.law, Sampled):
            raise TypeError(f"an element's law must not depend on the sample time, got {type(self.law).__name__}")
        parted(self.law)
        nodes = tuple(self.between)
        if bool(nodes) == bool(self.direction):
            raise ValueError("an element takes either between=(i, j) or direction=(...)")
        if nodes:
            if len(nodes) != 2:
                raise ValueError(f"between must hold two nodes, got {len(nodes)}")
            for node in nodes:
                check_whole(int(node) if isinstance(node, np.integer) else node, "between", least=0)
            if nodes[0] == nodes[1]:
                raise ValueError(f"an element is between two different nodes, got {nodes[0]} twice")
        elif not any(self.direction):
            raise ValueError("direction must not be zero")
        object.__setattr__(self, "between", tuple(int(node) for node in nodes))

    @property
    def highest_node(self) -> int:
        """Number of the last mass that the element needs."""
        return max(self.between) if self.between else len(self.direction)

    def drift_row(self, n_nodes: int) -> FloatArray:
        """Weights of the displacements in the drift, shape (n_nodes,)."""
        if self.direction:
            check_one_each("direction", self.direction, n_nodes, "masses")
            return np.array(self.direction)
        row = np.zeros(n_nodes + 1)
        row[list(self.between)] = -1.0, 1.0
        return row[1:]


class Parted(NamedTuple):
    """A law as a part with memory, and the coefficient of its dashpots."""

    law: Any
    viscosity: float


def parted(law: Any) -> Parted:
    """The dashpots of a law apart from the rest; TypeError if anything else in it depends on time."""
    if isinstance(law, RatedLaw):
        return Parted(law, law.viscosity)
    if isinstance(law, Dashpot):
        return Parted(Line(slope=0.0), law.c)
    if isinstance(law, Sum) and law.dynamic:
        parts = [parted(part) for part in law.parts]
        if rated := [type(part.law).__name__ for part in parts if isinstance(part.law, RatedLaw)]:
            raise TypeError(f"an element takes a {rated[0]} by itself: put the other parts into a parallel element")
        rests = tuple(each.law for part, each in zip(law.parts, parts, strict=True) if not isinstance(part, Dashpot))
        rest = Line(slope=0.0) if not rests else rests[0] if len(rests) == 1 else Sum(parts=rests)
        return Parted(rest, sum(each.viscosity for each in parts))
    if needs_time(law):
        raise TypeError(
            f"of what depends on time an element takes friction and dashpots only, got {type(law).__name__}"
        )
    return Parted(law, 0.0)


def dissipates(law: Any, stroke: float) -> bool:
    """Whether the second cycle between plus and minus `stroke` [m], without dashpots, takes energy or no energy."""
    drift = stroke * triangle(-1.0, 1.0, cycles=2, samples_per_cycle=_SAMPLES)
    try:
        force = parted(law).law.response(drift)
    except SimulationError:
        return False
    work = np.trapezoid(force[-_SAMPLES - 1 :], drift[-_SAMPLES - 1 :])
    return bool(work >= -_ROUNDING * np.ptp(force) * np.ptp(drift))


@family
class Rayleigh:
    """Damping ``C = mass M + stiffness K``, with the stiffness K of small motions at the start.

    Parameters
    ----------
    mass, stiffness : float
        Factors of the mass matrix [1/s] and of the stiffness matrix [s].

    Examples
    --------
    >>> import hysim as hs
    >>> damping = hs.Rayleigh.at(0.05, periods=(1.0, 0.2))
    >>> round(damping.mass, 6), round(damping.stiffness, 6)
    (0.523599, 0.002653)
    """

    mass: float = 0.0
    stiffness: float = 0.0

    @classmethod
    def at(cls, ratio: float, periods: tuple[float, float]) -> Self:
        """Damping with one ratio at two periods [s]; ValueError unless these are positive and different."""
        check_not_negative(ratio=ratio)
        if len(periods) != 2 or periods[0] == periods[1]:
            raise ValueError(f"periods must be two different ones, got {periods}")
        check_positive(**{"the first period": periods[0], "the second period": periods[1]})
        first, second = (2.0 * np.pi / period for period in periods)
        factor = 2.0 * ratio / (first + second)
        return cls(mass=float(factor * first * second), stiffness=float(factor))

    def matrix(self, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
        """The damping matrix, shape (n_nodes, n_nodes)."""
        damping = self.mass * mass + self.stiffness * stiffness
        if np.linalg.eigvalsh(damping)[0] < -1e-9 * np.abs(damping).max():
            raise ValueError("the stiffness at the start is negative: Rayleigh damping would drive the motion")
        return damping


@family
class ModalDamping:
    """Damping by the ratio of each mode of small motions at the start.

    Parameters
    ----------
    ratio : float, or tuple of float
        Share of the critical damping: one for all modes, or one for each, that of the longest period first.

    Examples
    --------
    >>> import hysim as hs
    >>> frame = hs.Structure(mass=2.0, stiffness=8.0, damping=hs.ModalDamping(ratio=0.05))
    >>> frame.damping_matrix.round(12).tolist()
    [[0.4]]
    """

    ratio: Any = 0.0

    def __post_init__(self) -> None:
        ratios = read_only(self.ratio, "ratio")
        if ratios.ndim > 1:
            raise ValueError(f"ratio must be a number or have one axis, got shape {ratios.shape}")
        check_not_negative(ratio=ratios.min(initial=0.0))
        object.__setattr__(self, "ratio", tuple(ratios.tolist()) if ratios.ndim else float(ratios))

    def matrix(self, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
        """The damping matrix (n_nodes, n_nodes), or a stack; ValueError for a wrong number of ratios."""
        if np.ndim(self.ratio):
            check_one_each("ratio", self.ratio, mass.shape[-1], "modes")
        return modal_damping(np.asarray(self.ratio), mass, stiffness)


def modal_damping(ratios: FloatArray, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Damping matrices (..., n, n) with the ratios (..., n) of their modes, or one ratio for all."""
    root = np.linalg.cholesky(mass)
    half = np.linalg.solve(root, stiffness)
    squares, shapes = np.linalg.eigh(np.linalg.solve(root, np.swapaxes(half, -1, -2)))
    if (squares[..., 0] < -1e-9 * np.abs(squares[..., -1])).any():
        raise ValueError("the stiffness at the start is negative: modal damping needs modes that swing")
    scaled = root @ shapes
    weights = 2.0 * ratios * np.sqrt(np.maximum(squares, 0.0))
    return np.asarray((scaled * weights[..., np.newaxis, :]) @ np.swapaxes(scaled, -1, -2))


def scalars_of(structure: Any) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for name in MATRICES:
        numbers |= _numbers(name, vars(structure)[name])
    for name in _TUPLES:
        numbers |= {f"{name}[{k}]": value for k, value in enumerate(vars(structure)[name])}
    for k, element in enumerate(structure.elements):
        scalars = element.law.scalars if isinstance(element.law, Numbered) else {}
        numbers |= {f"{_ELEMENTS}.{k}.{name}": float(value) for name, value in scalars.items()}
    return numbers


def assembled(structure: Any, parameters: Mapping[str, float]) -> Any:
    """The structure with some numbers exchanged; ValueError if a name is unknown, or a constructor refuses a number."""
    others = expanded(structure.scalars, parameters)
    changes: dict[str, Any] = {}
    for name in MATRICES:
        if mine := {key: value for key, value in others.items() if key.partition("[")[0].partition(".")[0] == name}:
            changes[name] = _changed(name, vars(structure)[name], mine)
    for name in _TUPLES:
        if mine := {key: value for key, value in others.items() if key.startswith(f"{name}[")}:
            changes[name] = tuple(_placed(name, np.array(vars(structure)[name]), mine).tolist())
    elements = list(structure.elements)
    for k, element in enumerate(elements):
        if numbers := own(others, f"{_ELEMENTS}.{k}"):
            elements[k] = replace(element, law=element.law.with_scalars(numbers))
    return replace(structure, **changes, elements=tuple(elements))


def expanded(scalars: Mapping[str, float], parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters with those of all elements under the name of each; ValueError if a name is unknown."""
    shared: dict[str, float] = {}
    single: dict[str, float] = {}
    for name, value in parameters.items():
        if is_shared(name):
            shared |= dict.fromkeys(sharing(scalars, name), value)
        elif name in scalars:
            single[name] = value
        else:
            raise unknown(scalars, name)
    return shared | single


def is_shared(name: str) -> bool:
    return name.startswith(f"{_ELEMENTS}.{_ALL}.")


def sharing(scalars: Mapping[str, float], name: str) -> list[str]:
    """Names of the elements' numbers that a name of all elements stands for; ValueError if no element has it."""
    last = name.removeprefix(f"{_ELEMENTS}.{_ALL}.")
    names = [each for each in scalars if each.startswith(f"{_ELEMENTS}.") and each.split(".", 2)[2] == last]
    if not names:
        raise unknown(scalars, name)
    return names


def unknown(scalars: Mapping[str, float], name: str) -> ValueError:
    return ValueError(f"the structure has no parameter {name!r}; its parameters are {_listed(scalars)}")


def _listed(scalars: Iterable[str]) -> str:
    """The names in words, numbers of elements with the star where a law's name is that of several."""
    names: dict[str, None] = {}
    every = list(scalars)
    for name in every:
        parts = name.split(".", 2)
        last = parts[2] if parts[0] == _ELEMENTS else ""
        is_common = last and sum(each.split(".", 2)[2:] == [last] for each in every) > 1
        names[f"{_ELEMENTS}.k.{last}" if is_common else name] = None
    more = len(names) - _SHOWN
    shown = ", ".join(list(names)[:_SHOWN]) + (f" and {more} more" if more > 0 else "")
    legend = f" (k is the place of an element, or {_ALL} for all)"
    return shown + legend * any(".k." in each for each in names)


def _numbers(name: str, value: Any) -> dict[str, float]:
    if isinstance(value, Rayleigh):
        return {name: 1.0, f"{name}.mass": value.mass, f"{name}.stiffness": value.stiffness}
    several = np.asarray(value.ratio if isinstance(value, ModalDamping) else value)
    if several.ndim == 0:
        return {name: float(several)}
    return {name: 1.0} | ({f"{name}[{k}]": float(each) for k, each in enumerate(several)} if several.ndim == 1 else {})


def _changed(name: str, value: Any, numbers: Mapping[str, float]) -> Any:
    present = numbers.get(name)
    if isinstance(value, Rayleigh):
        own = [numbers.get(f"{name}.{part}", vars(value)[part]) for part in ("mass", "stiffness")]
        factor = 1.0 if present is None else present
        return Rayleigh(mass=factor * own[0], stiffness=factor * own[1])
    is_modal = isinstance(value, ModalDamping)
    several = np.array(value.ratio if is_modal else value)
    changed: Any = present
    if several.ndim:
        changed = _placed(name, several, numbers) * (1.0 if present is None else present)
    return ModalDamping(ratio=changed) if is_modal else changed


def _placed(name: str, values: FloatArray, numbers: Mapping[str, float]) -> FloatArray:
    """A vector with some numbers, ``name[k]``, exchanged."""
    changed = values.copy()
    for key, value in numbers.items():
        if key != name:
            changed[int(key[len(name) + 1 : -1])] = value
    return changed
