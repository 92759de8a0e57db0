"""Samples at which no coordinate has an effect, as few rows with the same sums of squares.

A sum of plays forgets what was before its record once the input has moved far enough. From there on the columns C and
the target t of the regression are the same for every set of parameters. With [C t] = Q R, the triangle R stands for
all of these samples: || C b - t || = || R [b, -1] || for all b, to rounding.
"""

from dataclasses import dataclass

from hysim._frozen import FloatArray


@dataclass(frozen=True)
class Settled:
    """Rows that stand for the samples of each record from `first` on.

    `columns` are (n_rows, n_linear), `target` (n_rows,), `names` those of the linear parameters, and `scale` is the
    size of all outputs. Weights are taken into account.
    """

    first: tuple[int, ...]
    names: tuple[str, ...]
    columns: FloatArray
    target: FloatArray
    scale: float
