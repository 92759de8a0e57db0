"""Inputs of the claims: the two tables, the models of Table 1, the closed loops."""

from collections.abc import Mapping, Sequence
from typing import Any

from hysim._frozen import frozen
from hysim.datasets import table1, table2
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.paper.approximations import Approximation, approximations
from hysim.paper.reidentification import Reidentification, TimeUnit
from hysim.paper.study import Study
from hysim.records import Record

Loop = Mapping[str, Any]
"""One closed loop: its plant, controller, conditions and measures by name, as in `summary.json`."""


@frozen
class Evidence:
    """Everything that a claim may be computed from.

    Parameters
    ----------
    table1, table2 : Record
        The paper's tables.
    study : Study
        The models of Table 1.
    reidentification : Reidentification
        (1) and (4) identified anew, and what Table 2 determines of a plant.
    approximations : mapping
        Estimates of (1) and (4) by the equation's number.
    control : mapping
        "hysteresis" and "vibration" to closed loops, as `hysim.paper.loops.control_measures` writes them.
    """

    table1: Record
    table2: Record
    study: Study
    reidentification: Reidentification
    approximations: Mapping[str, Approximation]
    control: Mapping[str, Sequence[Loop]]

    @property
    def loop(self) -> LoopMetrics:
        """Measures of Table 1's loop."""
        return loop_metrics(self.table1.u, self.table1.y)

    @property
    def pixel(self) -> float:
        """Resolution of Table 1 [um]."""
        return self.table1.resolution or 0.0

    def time_unit(self, name: str) -> TimeUnit:
        """(4) read in a unit of time."""
        return next(unit for unit in self.reidentification.time_units if unit.name == name)


def evidence(
    study: Study, reidentification: Reidentification, control: Mapping[str, Sequence[Loop]] | None = None
) -> Evidence:
    """The evidence of a study of Table 1; without closed loops, claims about them are not judged."""
    return Evidence(
        table1=table1(),
        table2=table2(),
        study=study,
        reidentification=reidentification,
        approximations={pair.name: pair for pair in approximations()},
        control=control or {},
    )
