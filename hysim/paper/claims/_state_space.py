"""Claims of section 2.6: the state-space forms, controllability and observability."""

from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.paper import printed
from hysim.paper.claims._claim import Claim, cross_checked, decided
from hysim.paper.claims.rounding import Number, Spread, spread, stands_for
from hysim.paper.printed import Matrix
from hysim.paper.state_space import EQUATIONS_7_8, EQUATIONS_13_14, StateSpace


def state_space_claims() -> tuple[Claim, ...]:
    """Claims of section 2.6 about (7) to (16)."""
    return (
        *_structural("eq10", "(7), (8)", EQUATIONS_7_8, printed.A_7, printed.C_8, printed.CONTROLLABILITY_10, "eq12",
                     printed.OBSERVABILITY_12),
        *_realisation(),
        *_structural("eq15", "(13), (14)", EQUATIONS_13_14, printed.A_13, printed.C_14, printed.CONTROLLABILITY_15,
                     "eq16", printed.OBSERVABILITY_16),
    )  # fmt: skip


def _realisation() -> tuple[Claim, ...]:
    """(13), (14) against (6), of which they are the state-space form."""
    damping, stiffness = printed.A_13[0]
    pairs = {
        "stiffness": ("(13)", "w_n^2 of (6)", stiffness, printed.DEN_6[2], -1.0),
        "damping": ("(13)", "2 xi w_n of (6)", damping, printed.DEN_6[1], -1.0),
        "gain": ("(14)", "k of (6)", printed.C_14[0][1], printed.NUM_6[0], 1.0),
    }
    return tuple(
        cross_checked(
            f"eq13-{name}",
            f"Section 2.6.2, equation {equation}",
            f"The entry that stands for {quantity}.",
            printed=entry,
            computed=_times(stands_for(coefficient), sign),
            method="the entry that the companion form of (6) would have",
        )
        for name, (equation, quantity, entry, coefficient, sign) in pairs.items()
    )


def _structural(
    controllability_id: str,
    model: str,
    system: StateSpace,
    A: Matrix,
    C: Matrix,
    controllability: Matrix,
    observability_id: str,
    observability: Matrix,
) -> tuple[Claim, ...]:
    entries: list[Number] = [*A[0], C[0][1]]

    def form(x: FloatArray) -> StateSpace:
        return StateSpace(A=[x[:2], [1.0, 0.0]], B=system.B, C=[[0.0, x[2]]])  # type: ignore[arg-type]

    return (
        *_matrix(
            controllability_id, "controllab", model, controllability, spread(lambda x: form(x).controllability, entries)
        ),
        *_matrix(observability_id, "observab", model, observability, spread(lambda x: form(x).observability, entries)),
    )


def _matrix(id: str, what: str, model: str, matrix: Matrix, computed: Spread) -> tuple[Claim, ...]:
    where = f"Section 2.6, equation ({id.removeprefix('eq')})"
    determinant = computed.value[0, 0] * computed.value[1, 1] - computed.value[0, 1] * computed.value[1, 0]
    rank = int(np.linalg.matrix_rank(computed.value))
    return (
        cross_checked(
            f"{id}-{what}ility-matrix",
            where,
            f"The {what}ility matrix of {model}.",
            printed=_exact_units(matrix),
            computed=computed,
            method="computed from the printed state-space form over the corners of its rounding",
        ),
        decided(
            f"{id}-{what}le",
            where,
            f"The model {model} is {what}le: the matrix is not singular.",
            holds=rank == int(printed.RANK) and _regular(computed),
            method="rank of the matrix, and a determinant that no rounding brings to zero",
            printed=float(printed.RANK),
            recomputed=float(rank),
            note=f"Determinant {determinant:.5g}.",
        ),
    )


def _regular(computed: Spread) -> bool:
    """Whether the determinant keeps its sign for every choice of entries in their ranges."""
    a, b, c, d = ([computed.low[i, j], computed.high[i, j]] for i in range(2) for j in range(2))
    values = [w * z - x * y for w in a for x in b for y in c for z in d]
    return bool(min(values) > 0.0 or max(values) < 0.0)


def _exact_units(matrix: Matrix) -> Any:
    """Zeros and ones are structure, not rounded numbers."""
    return [[float(text) if text in ("0", "1") else text for text in row] for row in matrix]


def _times(numbers: Spread, sign: float) -> Spread:
    low, high = sorted((sign * float(numbers.low), sign * float(numbers.high)))
    return Spread(value=sign * numbers.value, low=low, high=high)  # type: ignore[arg-type]
