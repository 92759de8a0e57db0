"""Which samples are left out together in a cross-validation."""

import numpy as np
import numpy.typing as npt


def folds(count: str | int, n: int, *, name: str = "folds") -> list[npt.NDArray[np.intp]]:
    """Samples of each fold, every one of `n` samples in one: ``"loo"`` is one at a time, an int that many blocks.

    Raises
    ------
    ValueError
        If `count` is neither; it is called `name`.

    Examples
    --------
    >>> [fold.tolist() for fold in folds(2, 5)]
    [[0, 1, 2], [3, 4]]
    """
    number = n if count == "loo" else count
    if not isinstance(number, int) or isinstance(number, bool) or not 2 <= number <= n:
        raise ValueError(f'{name} must be "loo" or a number of blocks from 2 to {n}, got {count!r}')
    return np.array_split(np.arange(n), number)
