"""An element of a structure: a law for the force between two nodes, or along a direction."""

from dataclasses import field
from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray, check_whole
from hysim.errors import SimulationError
from hysim.laws.dashpot import Dashpot
from hysim.laws.static import Line
from hysim.models.model import family
from hysim.models.protocols import Rated, Sampled, Stepwise, needs_time
from hysim.models.sum import Sum
from hysim.signals import triangle

_SAMPLES = 200  # of a cycle
_ROUNDING = 1e-9  # of the work of the whole force along the whole drift: less is none


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
    TypeError
        If the law cannot be stepped, or a node is not a whole number.
    ValueError
        If not exactly one of `between` and `direction` is given, the nodes are the same or negative, or the direction
        is zero.

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
        if not isinstance(self.law, Stepwise) or isinstance(self.law, type):
            name = self.law.__name__ if isinstance(self.law, type) else type(self.law).__name__
            raise TypeError(f"an element takes a law that can be stepped, got {name}")
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
            if len(self.direction) != n_nodes:
                raise ValueError(
                    f"direction must hold one number for each of {n_nodes} masses, got {len(self.direction)}"
                )
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
    if isinstance(law, Rated):
        return Parted(law, law.viscosity)
    if isinstance(law, Dashpot):
        return Parted(Line(slope=0.0), law.c)
    if isinstance(law, Sum) and law.dynamic:
        parts = [parted(part) for part in law.parts]
        if rated := [type(part.law).__name__ for part in parts if isinstance(part.law, Rated)]:
            raise TypeError(f"an element takes a {rated[0]} by itself: put the other parts into an element beside it")
        rests = tuple(each.law for part, each in zip(law.parts, parts, strict=True) if not isinstance(part, Dashpot))
        rest = Line(slope=0.0) if not rests else rests[0] if len(rests) == 1 else Sum(parts=rests)
        return Parted(rest, sum(each.viscosity for each in parts))
    if needs_time(law):
        raise TypeError(
            f"of what depends on time an element takes friction and dashpots only, got {type(law).__name__}"
        )
    return Parted(law, 0.0)


def dissipates(law: Any, stroke: float) -> bool:
    """Whether the second cycle between plus and minus `stroke` [m], without dashpots, takes energy or none."""
    drift = stroke * triangle(-1.0, 1.0, cycles=2, samples_per_cycle=_SAMPLES)
    try:
        force = parted(law).law.response(drift)
    except SimulationError:
        return False
    work = np.trapezoid(force[-_SAMPLES - 1 :], drift[-_SAMPLES - 1 :])
    return bool(work >= -_ROUNDING * np.ptp(force) * np.ptp(drift))
