"""Derivatives of a law's response by its numbers, by extrapolated differences.

    D(h) = (y(p + h) - y(p - h)) / (2 h) = dy/dp + c_1 h + c_2 h^2 + ...

at steps h that fall by a factor of 8. Neville's rule eliminates the powers one after the other (the odd ones are those
of |z| at z = 0, and of one-sided differences), and each sample takes the value whose neighbours in the scheme agree
best with it: that of long steps where the output is smooth, of short ones where it has a kink nearby. Where laws exist
on one side alone, (y(p + h) - y(p)) / h takes the place of D. Source: C. J. F. Ridders, Accurate computation of F'(x)
and F'(x) F''(x), Adv. Eng. Software 4 (1982) 75.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.printing import frozen_result

_SHARE = 0.1  # of a number: the first step that is tried; of a zero, 1
_FALL = 8.0  # by which steps become shorter
_STEPS = 7  # the shortest resolves kinks a millionth of the longest away
_ORDERS = 4  # powers of h that are eliminated: more of them add rounding alone
_CLOSE = 1e-9  # estimated error of a column, of its largest value, at which the steps are short enough
_LARGEST, _SMALLEST = 0.05, 1e-5  # change of the output by the longest step, of its range
_MOST_TRIALS = 24  # of that step, for numbers far from the size that it supposes


@frozen_result
class Jacobian:
    """Derivatives of a response by the numbers of a law.

    Attributes
    ----------
    names : tuple of str
        The numbers, by their names in ``law.scalars``.
    matrix : array, shape (n_samples, n_names)
        dy/d(number) [unit of y / unit of the number].
    response : array, shape (n_samples,)
        The output itself [unit of y].
    """

    names: tuple[str, ...]
    matrix: FloatArray
    response: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        """The derivative by one number, shape (n_samples,); KeyError if it is not among `names`."""
        if name not in self.names:
            raise KeyError(f"no derivative by {name!r}: there are those by {', '.join(self.names)}")
        return self.matrix[:, self.names.index(name)]

    def information(self, sigma: float = 1.0) -> FloatArray:
        """Fisher information of the numbers for white noise of standard deviation `sigma`, (n_names, n_names)."""
        return np.asarray(self.matrix.T @ self.matrix / sigma**2)

    def summary(self) -> str:
        """A line for each number: the root mean square and the largest size of its derivative.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=20)
        >>> print(hs.Dahl(stiffness=2.0, coulomb=0.5).response_jacobian(u).summary())
        derivative of the response, 21 samples
        stiffness  rms 0.0674  largest 0.179
        coulomb    rms 0.797   largest 0.997
        offset     rms 1       largest 1
        z0         rms 0.244   largest 1
        """
        width = max(map(len, self.names), default=0)
        lines = [f"derivative of the response, {len(self.matrix)} samples"]
        for name, column in zip(self.names, self.matrix.T, strict=True):
            rms, largest = float(np.sqrt(np.mean(column**2))), float(np.abs(column).max())
            lines.append(f"{name:<{width}}  rms {rms:<6.3g}  largest {largest:.3g}".rstrip())
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()


def response_jacobian(law: Any, u: Any, names: Iterable[str] | None, fine: Any) -> Jacobian:
    """As `hysim.Law.response_jacobian`; `fine` is the law as the differences take it."""
    inputs = read_only(u, "u", ndim=1)
    asked = checked_names(law, law.scalars if names is None else names, "names")
    steps = {name: _admissible_step(law, name) for name in asked}
    impossible = [name for name, (_, sides) in steps.items() if not sides]
    if impossible and names is not None:
        raise ValueError(f"the output of this {type(law).__name__} has no derivative by {', '.join(impossible)} here")
    asked = tuple(name for name in asked if name not in impossible)
    y, near = law.response(inputs), fine.response(inputs)
    columns = [_column(fine, name, inputs, near, *steps[name]) for name in asked] if y.size else []
    matrix = np.column_stack(columns) if columns else np.zeros((y.size, len(asked)))
    return Jacobian(names=asked, matrix=matrix, response=y)


def _admissible_step(law: Any, name: str) -> tuple[float, tuple[float, ...]]:
    """A step, and the sides on which the constructor takes it: both if a step of this scheme has them."""
    first = _SHARE * abs(law.scalars[name]) or 1.0
    best: tuple[float, tuple[float, ...]] = first, ()
    for step in (first / _FALL**k for k in range(2 * _STEPS)):
        sides = _sides(law, name, step)
        if len(sides) > len(best[1]):
            best = step, sides
        if len(sides) == 2:
            break
    return best


def _sides(law: Any, name: str, step: float) -> tuple[float, ...]:
    """Sides on which the law exists, at this step and at the shortest one that begins with it."""
    sides = []
    for side in (1.0, -1.0):
        try:
            for each in (step, step / _FALL ** (_STEPS - 1)):
                law.with_scalars({name: law.scalars[name] + side * each})
        except ValueError:
            continue
        sides.append(side)
    return tuple(sides)


def _column(law: Any, name: str, u: FloatArray, y: FloatArray, step: float, sides: tuple[float, ...]) -> FloatArray:
    value, rounding = law.scalars[name], np.finfo(float).eps * np.abs(y).max()
    extent = np.ptp(y) or np.abs(y).max() or 1.0
    for _ in range(_MOST_TRIALS):
        change = np.abs(exchanged_outputs(law, {name: np.array([value + sides[0] * step])}, u) - y).max()
        if not change <= _LARGEST * extent:
            step /= _FALL
        elif 0.0 < change < _SMALLEST * extent and _sides(law, name, _FALL * step) == sides:
            step *= _FALL
        else:
            break
    best, smallest = np.full(y.size, np.nan), np.full(y.size, np.inf)
    before: list[FloatArray] = []
    for k in range(_STEPS):
        values = value + np.array((*sides, 0.0)[:2]) * step / _FALL**k
        width = values[0] - values[1]  # as it is between rounded numbers
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            row = [np.subtract(*exchanged_outputs(law, {name: values}, u)) / width]
            for order, longer in enumerate(before[:_ORDERS], 1):
                row.append(row[-1] + (row[-1] - longer) / (_FALL**order - 1.0))
                apart = np.maximum(np.abs(row[-1] - row[-2]), np.abs(row[-1] - longer)) + rounding / abs(width)
                is_better = apart < smallest
                best[is_better], smallest[is_better] = row[-1][is_better], apart[is_better]
        before = row
        if smallest.max() <= _CLOSE * np.abs(best).max():
            break
    return best


_SMALL = 0.1  # of the change that moves the output by its standard deviation


def sizes_along(law: Any, names: Iterable[str], u: FloatArray) -> FloatArray:
    """Values (n_names,), for zeros and small affine ones the change that moves the output by its standard deviation."""
    sizes = {name: abs(law.scalars[name]) for name in names}
    for name in (name for name, size in sizes.items() if size == 0.0 or name in law.columns):
        jacobian = law.response_jacobian(u, [name])
        spread, effect = float(np.std(jacobian.response)), float(np.sqrt(np.mean(jacobian.matrix**2)))
        if effect > 0.0 and sizes[name] * effect < _SMALL * spread:
            sizes[name] = spread / effect
    return np.array([size or 1.0 for size in sizes.values()])


def checked_names(law: Any, names: Iterable[str], argument: str = "free") -> tuple[str, ...]:
    """The names, each once; ValueError if the law has not one of them, and TypeError if they are a single string."""
    if isinstance(names, str):
        raise TypeError(f"{argument} must be a sequence of names, got the string {names!r}")
    asked = tuple(dict.fromkeys(names))
    if unknown := [name for name in asked if name not in law.scalars]:
        raise ValueError(f"{argument} has {unknown[0]!r}: a {type(law).__name__} has {', '.join(law.scalars)}")
    return asked


def exchanged_outputs(law: Any, numbers: Mapping[str, FloatArray], u: FloatArray) -> FloatArray:
    """Outputs (n_sets, n_samples) for values (n_sets,) of some numbers, in one batch."""
    tables = law.exchanged({name: values[:, np.newaxis] for name, values in numbers.items()})
    changed = {field: table for field, table in tables.items() if table is not law.tables[field]}
    is_number = {field: np.ndim(law.arguments[field]) == 0 for field in changed}
    return np.asarray(law.outputs({field: t[:, 0] if is_number[field] else t for field, t in changed.items()}, u))
