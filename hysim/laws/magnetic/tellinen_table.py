"""Tellinen's law between two tabulated branches."""

import math
from typing import ClassVar, Self

import numpy as np

from hysim._basics.frozen import check_whole
from hysim.kernels import tellinen_table as kernels
from hysim.metrics import loop_metrics
from hysim.models.law import Law
from hysim.models.model import Example, family, not_offered
from hysim.models.parameters import Parameter
from hysim.models.tables import Tables, check_points
from hysim.records import Record


@family
class TellinenTable(Law):
    """Tellinen's law of magnetic cores between the branches of a measured loop, straight between their points.

    ::

        y        = offset + feedthrough u + m
        rising   m' = (upper - m) / (upper - lower) lower',    falling  m' = (m - lower) / (upper - lower) upper'

    As `Tellinen`, with branches of any shape, level beyond the table. Every stroke is exact, piece by piece. Source: J.
    Tellinen, IEEE Trans. Magn. 34 (1998) 2200; the Modelica Standard Library's ``GenericHystTellinenTable``.

    Parameters
    ----------
    inputs : sequence of float, length n
        Increasing, at least two [unit of u].
    lower, upper : sequence of float, length n
        Branches of a rising and a falling input, neither falling, the upper nowhere below the lower one [unit of y].
    feedthrough : float
        Slope dy/du beside the branches [unit of y / unit of u].
    offset : float
        Output beside the branches [unit of y].
    z0 : float
        Place between the branches at the first sample, from -1 (lower) to 1 (upper).

    Raises
    ------
    ValueError
        If a number is not finite, lengths differ, inputs do not increase, branches fall or cross, or z0 is beyond +-1.

    Examples
    --------
    >>> import hysim as hs
    >>> u = (-2.0, -1.0, 0.0, 1.0, 2.0)
    >>> law = hs.TellinenTable(inputs=u, lower=(-1.0, -0.9, -0.5, 0.6, 1.0), upper=(-1.0, -0.6, 0.5, 0.9, 1.0))
    >>> law.response([0.0, 2.0, 0.0, -0.5]).round(4).tolist()
    [0.0, 1.0, 0.5, -0.05]
    """

    inputs: tuple[float, ...] = (-1.0, 1.0)
    lower: tuple[float, ...] = (-1.0, 1.0)
    upper: tuple[float, ...] = (-1.0, 1.0)
    feedthrough: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    units: ClassVar = {"inputs": "u", "lower": "y", "upper": "y", "z0": "1"}
    example = Example(
        {
            "inputs": (-2.0, -1.0, 0.0, 1.0, 2.0), "lower": (-1.0, -0.9, -0.5, 0.6, 1.0),
            "upper": (-1.0, -0.6, 0.5, 0.9, 1.0),
        },
        (-2.0, 2.0),
        title="Magnetic core: Tellinen's branches from a table",
    )  # fmt: skip
    step = staticmethod(kernels.step)
    step_fields = ("offset", "feedthrough", "inputs", "lower", "upper")
    within: ClassVar = {"z0": ("of a size of at most", 1.0)}
    searched = (
        Parameter("feedthrough", unit="y/u", affine=True),
        Parameter("offset", unit="y", affine=True),
        Parameter("z0", -1.0, 1.0, physical=(True, True)),
    )

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse what is no pair of branches, or no place between them."""
        super().check(tables)
        check_points(tables, "inputs", "lower", "upper")
        for name in ("lower", "upper"):
            if (np.diff(tables[name]) < 0.0).any():
                raise ValueError(f"the branch {name} must not fall")
        if (tables["lower"] > tables["upper"]).any():
            raise ValueError("the branch upper must not lie below the branch lower")

    candidates = not_offered  # its branches are those of a loop, which `from_loop` takes from a record

    @property
    def known_slopes(self) -> tuple[float, float]:
        """From that of the feedthrough alone to that of a branch where it is steepest."""
        slopes = np.diff([self.lower, self.upper], axis=1) / np.diff(self.inputs)
        return self.feedthrough, self.feedthrough + float(slopes.max())

    @property
    def output_bounds(self) -> tuple[float, float]:
        """The ends of the table; no limit with a feedthrough."""
        ends = (self.lower[0], self.upper[-1]) if self.feedthrough == 0.0 else (-math.inf, math.inf)
        return self.offset + ends[0], self.offset + ends[1]

    @classmethod
    def from_loop(cls, record: Record, *, nodes: int = 64, cycles: int = 1, feedthrough: float = 0.0) -> Self:
        """The law whose limiting loop is the last complete cycle of a record.

        The branches are those of `hysim.loop_metrics` at even steps of the input, less the feedthrough, with the
        highest value so far where noise lets one fall. At both ends they are closed in their middle.

        Parameters
        ----------
        record : Record
            A loop that runs counterclockwise, at best into saturation.
        nodes : int
            Points of each branch, at least 3.
        cycles : int
            Number of last complete cycles that are averaged.
        feedthrough : float
            Slope with which the output goes on beyond the loop [unit of y / unit of u].

        Returns
        -------
        TellinenTable
            Its `z0` is the place of the record's first sample between the branches.

        Raises
        ------
        ValueError, TypeError
            If the record has no complete cycle, or the number of nodes is not whole or less than 3.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-90.0, 90.0, cycles=2, samples_per_cycle=200)
        >>> record = hs.Record(u=u, y=hs.Tellinen(coercivity=20.0).response(u))
        >>> table = hs.TellinenTable.from_loop(record)
        >>> bool(abs(table.response(u) - record.y)[200:].max() < 0.02)
        True
        """
        check_whole(nodes, "nodes", least=3)
        loop = loop_metrics(record.u, record.y, cycles=cycles)
        inputs = np.linspace(loop.u[0], loop.u[-1], nodes)
        sides = np.array([np.interp(inputs, loop.u, side) for side in (loop.loading, loop.unloading)])
        sides -= feedthrough * inputs
        sides[:, [0, -1]] = sides[:, [0, -1]].mean(axis=0)
        rising = np.maximum.accumulate(np.minimum(sides, sides[:, -1:]), axis=1)
        lower, upper = rising[0], np.maximum(rising[0], rising[1])
        first = float(record.y[0]) - feedthrough * float(record.u[0])
        ends = [float(np.interp(record.u[0], inputs, side)) for side in (lower, upper)]
        width = ends[1] - ends[0]
        place = min(max((2.0 * first - ends[0] - ends[1]) / width, -1.0), 1.0) if width > 0.0 else 0.0
        points = [tuple(values.tolist()) for values in (inputs, lower, upper)]
        return cls(inputs=points[0], lower=points[1], upper=points[2], feedthrough=feedthrough, z0=place)
