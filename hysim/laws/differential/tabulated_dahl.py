"""Dahl's law between two branches from a table: the one-state hysteresis of battery cells and robot joints."""

import math
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_whole, vectors
from hysim.kernels.tellinen_table import N_HEAD, branch, interval
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family, not_offered
from hysim.models.parameters import Parameter, affine
from hysim.models.search_space import Parameters
from hysim.models.tables import Tables, check_points
from hysim.records import Record, span_of


@family
class TabulatedDahl(Law):
    """Dahl's law with a centre and an amplitude from a table: a state h is drawn from one branch to the other.

    ::

        y = centre(u) + amplitude(u) h,    dh = rate (sgn(du) - h) |du|

    On a long way up the output runs along ``centre + amplitude``, on a long way down along ``centre - amplitude``. The
    state does not know the tables, so that every stroke is exact.

    Parameters
    ----------
    inputs : sequence of float, length n
        Increasing, at least two [unit of u].
    centre, amplitude : sequence of float, length n
        Mean and half the distance of both branches there, straight between the inputs and level beyond them [unit of
        y]. A negative amplitude turns the loop round.
    rate : float
        Rate at which a stroke comes to its branch, positive [1 / unit of u].
    z0 : float
        State at the first sample, from -1 to 1.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits, lengths differ, or the inputs do not increase.

    Notes
    -----
    For a battery u is the state of charge and y the voltage at rest: the one-state hysteresis of G. L. Plett (J. Power
    Sources 134 (2004) 262) without a time, so that h does not change where the current is zero. For a joint u is the
    angle and y the torque. The output is affine in both tables: `identify` searches the rate and the initial state
    alone, and keeps the inputs of its start, ``hs.identify(hs.TabulatedDahl.over(record), record)``.

    Examples
    --------
    >>> import hysim as hs
    >>> cell = hs.TabulatedDahl.from_branches([0.0, 0.5, 1.0], [3.3, 3.6, 4.1], [3.2, 3.5, 4.1], rate=20.0)
    >>> cell.response([0.5, 0.6, 0.5]).round(4).tolist()
    [3.55, 3.6946, 3.5126]
    """

    inputs: tuple[float, ...] = (-1.0, 1.0)
    centre: tuple[float, ...] = (-1.0, 1.0)
    amplitude: tuple[float, ...] = (0.5, 0.5)
    rate: float = 5.0
    z0: float = 0.0

    positive = ("rate",)
    within: ClassVar = {"z0": ("of a size of at most", 1.0)}
    units: ClassVar = {"inputs": "u", "centre": "y", "amplitude": "y", "z0": "1"}
    example = Example(
        {"inputs": (-1.0, 0.0, 1.0), "centre": (-1.0, 0.0, 1.0), "amplitude": (0.1, 0.4, 0.1)},
        (-1.0, 1.0),
        title="Dahl's law from a table: cell at rest",
    )
    searched = (
        *affine("centre", "amplitude", unit="y"),
        Parameter("rate", 0.1, 1e3, unit="1/u", log=True),
        Parameter("z0", -1.0, 1.0, physical=(True, True)),
    )

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` is (u, h), `parameters` (rate, number of inputs, the tables)."""
        length = u - state[0]
        if length != 0.0:
            state[1] += (math.copysign(1.0, length) - state[1]) * -math.expm1(-parameters[0] * abs(length))
            state[0] = u
        n = (parameters.size - N_HEAD) // 3
        k = interval(parameters, N_HEAD, n, u)
        centre = branch(parameters, N_HEAD + n, n, k, u)
        return float(centre + branch(parameters, N_HEAD + 2 * n, n, k, u) * state[1])

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        check_points(tables, "inputs", "centre", "amplitude")

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters (rate, number of inputs, the tables), and the memory (u, h)."""
        size = np.full_like(tables["rate"], tables["inputs"].shape[1])
        constants = [tables["rate"], size, *(tables[name] for name in ("inputs", "centre", "amplitude"))]
        return Packed(np.concatenate(constants, axis=1), cls.initial_memory(tables))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """As `Law.regressors`: one hat over each input, and its product with the state."""
        n = len(self.inputs)
        state = dict.fromkeys(self.columns, 0.0) | {f"amplitude[{k}]": 1.0 for k in range(n)}
        h = self.outputs({**parameters, **state}, record.u)
        hats = np.column_stack([np.interp(record.u, self.inputs, row) for row in np.eye(n)])
        columns = np.empty((len(h), len(record), 2 * n + 1))
        columns[:, :, :n], columns[:, :, n:-1], columns[:, :, -1] = hats, h[:, :, np.newaxis] * hats, 0.0
        return columns

    candidates = not_offered  # where its inputs stand is for the user to say

    @classmethod
    def over(cls, *records: Record, nodes: int = 12) -> Self:
        """A start for `hysim.identify`: inputs at even steps over those of records, and no loop yet."""
        check_whole(nodes, "nodes", least=2)
        u, y = np.concatenate([each.u for each in records]), np.concatenate([each.y for each in records])
        inputs, level = np.linspace(u.min(), u.max(), nodes), (float(y.mean()),) * nodes
        return cls(inputs=tuple(inputs.tolist()), centre=level, amplitude=(0.0,) * nodes, rate=10.0 / span_of(*records))

    @classmethod
    def from_branches(
        cls, inputs: npt.ArrayLike, rising: npt.ArrayLike, falling: npt.ArrayLike, *, rate: float, z0: float = 0.0
    ) -> Self:
        """The law between the branches of a rising and of a falling input, such as charge and discharge.

        Parameters
        ----------
        inputs, rising, falling : array, shape (n,)
            Increasing inputs [unit of u], and the outputs of both branches there [unit of y].
        rate, z0 : float
            As in the law.

        Returns
        -------
        TabulatedDahl

        Raises
        ------
        ValueError
            If the lengths differ, or the law is none.
        """
        u, up, down = vectors(inputs=inputs, rising=rising, falling=falling)
        centre, amplitude = (tuple(each.tolist()) for each in (0.5 * (up + down), 0.5 * (up - down)))
        return cls(inputs=tuple(u.tolist()), centre=centre, amplitude=amplitude, rate=rate, z0=z0)
