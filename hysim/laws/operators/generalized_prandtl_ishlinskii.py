"""The generalised Prandtl-Ishlinskii law: plays that the input pushes through envelope functions."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice, read_only
from hysim.laws.operators._bank import Plays
from hysim.laws.operators._bank_search import IDENTITY, Axis, BankStructure, named
from hysim.laws.operators._play_sums import EXAMPLE, PlaySum
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, spans
from hysim.models.search_space import Parameters
from hysim.models.tables import Tables
from hysim.records import Record

_AXES = (
    Axis(Parameter("bend", 0.02, 3.0), (0.3, 1.0)),  # between the ends of the input: nearly straight, nearly a step
    Axis(Parameter("skew", -3.0, 3.0), (0.0, -1.0, 1.0)),  # where the middle of the input is on the tanh
    Axis(Parameter("lead", 0.0, 3.0), (0.2,)),
)


@family
class GeneralizedPrandtlIshlinskii(Plays, PlaySum):
    """Generalised Prandtl-Ishlinskii law: plays that the input pushes through envelope functions.

    ::

        z_i(k) = max(gamma_left(u_k) - r_i, min(gamma_right(u_k) + r_i, z_i(k-1)))
        y      = offset + sum_i w_i z_i,    gamma(u) = a_0 tanh(a_1 u + a_2) + a_3 + a_4 u,    increasing

    A rising input pushes the plays along the left envelope, a falling one along the right one; the tanh lets the loop
    saturate, and two different envelopes make the rising branch another curve than the falling one. Sources: M. Al
    Janaideh, S. Rakheja and C.-Y. Su, IEEE/ASME Trans. Mechatronics 16 (2011), for the law and its inverse, with the
    envelopes a_0 tanh(a_1 u + a_2) + a_3 and a_4 u + a_3; the sum of the two is ours.

    Parameters
    ----------
    thresholds : sequence of float, length n_plays
        r_i, not negative and increasing [unit of gamma].
    weights : sequence of float, length n_plays
        w_i, of any sign [unit of y / unit of gamma].
    left : sequence of float, length 5
        a_0 ... a_4 of the envelope along which a rising input pushes; by default gamma(u) = u.
    right : sequence of float, length 5 or 0
        Those of a falling one; empty: the same. Where gamma_left - gamma_right > 2 r, play r follows the left envelope.
    offset, z0
        As in `PrandtlIshlinskii` [unit of y, unit of gamma].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, a threshold is negative, thresholds or an envelope do not rise.

    Examples
    --------
    >>> import hysim as hs
    >>> envelope = (1.0, 2.0, 0.0, 0.0, 0.0)
    >>> law = hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, 1.0), left=envelope)
    >>> y = law.response([0.0, 1.0, 0.5, -1.0])
    >>> y.round(6).tolist(), law.inverse_response(y).round(6).tolist()
    ([0.0, 1.428055, 1.225622, -1.428055], [0.0, 1.0, 0.5, -1.0])
    """

    left: tuple[float, ...] = IDENTITY
    right: tuple[float, ...] = ()
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    units: ClassVar = {"offset": "y"}
    by_input: ClassVar[bool] = False
    example = Example(
        {**EXAMPLE, "left": (1.2, 1.4, 0.0, 0.0, 0.1)}, (-2.0, 2.0), title="Prandtl-Ishlinskii: envelopes"
    )

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        _check_envelopes(tables["left"], tables["right"])

    @classmethod
    def structure(
        cls,
        *,
        plays: int = 10,
        thresholds: npt.ArrayLike = (),
        one_signed: bool | None = None,
        envelopes: int = 1,
        left: npt.ArrayLike = (),
        right: npt.ArrayLike = (),
    ) -> BankStructure:
        """Plays and envelopes for `hysim.identify`; `plays`, `thresholds` and `one_signed` as of `PrandtlIshlinskii`.

        One envelope is searched, or with ``envelopes=2`` also the ``lead`` in skew of the right one before the left
        one. It maps the ends of the record's input to themselves: thresholds are those of `PrandtlIshlinskii`; ``bend``
        is the part of the tanh passed on half the stroke (none for a straight envelope), ``skew`` the place of its
        middle. Envelopes `left` and `right` that are given, 5 coefficients each, are not searched. Raises ValueError or
        TypeError as `PrandtlIshlinskii.structure`, if `envelopes` is not 1 or 2, or an envelope does not increase.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.identify(hs.GeneralizedPrandtlIshlinskii.structure(plays=4), hs.datasets.table1()).n_parameters
        7
        """
        check_choice("envelopes", envelopes, (1, 2))
        known = {side: read_only(each, "envelopes", ndim=1) for side, each in (("left", left), ("right", right))}
        if known["left"].size:
            _check_envelopes(*(np.atleast_2d(side) for side in known.values()))
        plain = super().structure(plays=plays, thresholds=thresholds, one_signed=one_signed)
        if not known["left"].size:
            return replace(plain, axes=_AXES[: 1 + envelopes])
        numbers = [named(side, each.tolist()) for side, each in known.items()]
        return replace(plain, known=numbers[0] | numbers[1])

    @classmethod
    def derived(cls, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Coefficients ``left[0]`` ... ``left[4]`` for bend and skew, and those of the right envelope for a lead."""
        if "bend" not in parameters:
            return {}
        bend, skew = (np.asarray(parameters[name]) for name in ("bend", "skew"))
        left = named("left", _between_the_ends(bend, skew, record))
        right = _between_the_ends(bend, skew + parameters["lead"], record) if "lead" in parameters else []
        return left | named("right", right)

    def as_structure(self) -> BankStructure:
        left, right = (self.left, self.right) if self.thresholds else ((), ())
        one_signed = None if self.is_one_signed() else False
        return self.structure(thresholds=self.thresholds, one_signed=one_signed, left=left, right=right)

    def refusal(self) -> str | None:
        """Why the law has no inverse; None where it has one.

        With one envelope it has one where the plain law of the same plays is invertible, with two where the weights
        have one sign. In the gap between two envelopes the output stands still, and the nearest of its inputs is taken.
        """
        if self.right in ((), self.left):
            return self.plays.refusal()
        if any(self.weights) and min(self.weights) * max(self.weights) >= 0.0:
            return None
        return f"the law has no inverse: with two envelopes its weights must have one sign, got {self.weights}"


def _between_the_ends(bend: FloatArray, phase: FloatArray, record: Record) -> list[FloatArray]:
    """Coefficients of the envelope of this shape that takes the lowest and the highest input to themselves."""
    half, middle = spans(record)["h"], 0.5 * float(record.u.max() + record.u.min())
    low, high = np.tanh(phase - bend), np.tanh(phase + bend)
    height = 2.0 * half / (high - low)
    level = middle - 0.5 * height * (high + low)
    return [height, bend / half, phase - bend * middle / half, level, np.zeros_like(height)]


def _check_envelopes(left: FloatArray, right: FloatArray) -> None:
    for name, side in {"left": left, "right": right if right.shape[1] else left}.items():
        if side.shape[1] != len(IDENTITY):
            raise ValueError(f"{name} must hold 5 coefficients, got {side.shape[1]}")
        bend, line = side[:, 0] * side[:, 1], side[:, 4]
        if not ((bend >= 0.0) & (line >= 0.0) & (bend + line > 0.0)).all():
            raise ValueError(f"the envelope {name} must increase: a_0 a_1 and a_4 not negative, one of them positive")
