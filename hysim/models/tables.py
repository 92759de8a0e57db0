"""The numbers of laws: one name for each, and tables of every field over sets of laws."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_not_negative, check_positive, read_only
from hysim._basics.names import among
from hysim.models.search_space import Parameters

Tables = Mapping[str, FloatArray]
"""Every field over sets: (n_sets, 1) for a number, (n_sets, length) for a tuple, (n_sets, rows, columns)."""


def scalars_of(values: Mapping[str, Any]) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for name, value in values.items():
        if isinstance(value, tuple):
            numbers |= {f"{name}[{k}]": each for k, each in enumerate(value)}
        else:
            numbers[name] = value
    return numbers


def arguments_of(scalars: Mapping[str, float]) -> dict[str, Any]:
    arguments: dict[str, Any] = {}
    for name, value in scalars.items():
        base, bracket, _ = name.partition("[")
        number = value if type(value) is float else float(np.asarray(value).item())
        arguments[base] = (*arguments.get(base, ()), number) if bracket else number
    return arguments


_WITHIN: Mapping[str, Callable[[FloatArray, float], npt.NDArray[np.bool_]]] = {
    "below": np.less,
    "at most": np.less_equal,
    "at least": np.greater_equal,
    "of a size of at most": lambda values, bound: np.abs(values) <= bound,
}


def check_signs(tables: Tables, positive: Iterable[str], not_negative: Iterable[str]) -> None:
    """A ValueError for the first field of these with a number that is not positive, or negative."""
    check_positive(**{name: tables[name].min(initial=np.inf) for name in positive})
    check_not_negative(**{name: tables[name].min(initial=np.inf) for name in not_negative})


def check_within(tables: Tables, within: Mapping[str, tuple[str, float]]) -> None:
    """A ValueError for the first field of these with a number that is not, say, ``("at most", 1.0)``."""
    for name, (word, bound) in within.items():
        is_wrong = ~_WITHIN[word](tables[name], bound)
        if is_wrong.any():
            raise ValueError(f"{name} must be {word} {bound:g}, got {tables[name][is_wrong][0]}")


def check_increasing(name: str, table: FloatArray) -> None:
    """Refuse a table (n_sets, n) with a row that does not increase."""
    if not (np.diff(table) > 0.0).all():
        raise ValueError(f"{name} must increase, got {table[0].tolist() if len(table) == 1 else table}")


def check_points(tables: Tables, *names: str) -> None:
    """Refuse fields over inputs, the first of them, that are not equally long, or hold less than two points."""
    sizes = [tables[name].shape[1] for name in names]
    if len({*sizes}) > 1 or sizes[0] < 2:
        fields = f"{', '.join(names[:-1])} and {names[-1]}"
        raise ValueError(f"{fields} must be equally long and hold two points or more, got {sizes}")
    check_increasing(names[0], tables[names[0]])


def tables_of(
    family: str, defaults: Mapping[str, Any], parameters: Parameters, u: npt.ArrayLike
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Every field over sets, (n_sets, ...), and the inputs (1 or n_sets, n_samples).

    A parameter is a field or an element ``name[k]`` of a tuple; None is the default. Raises TypeError if a name is
    unknown, and ValueError if a value has too many axes, or lengths do not fit.
    """
    inputs = np.atleast_2d(read_only(u, "u"))
    if inputs.ndim != 2:
        raise ValueError(f"u must have 1 axis or 2, got shape {inputs.shape}")
    known = {name: value for name, value in parameters.items() if value is not None}
    for name in (name.partition("[")[0] for name in known):
        if name not in defaults:
            raise TypeError(f"unknown parameter {name!r}: {family} has {among(name, defaults)}")
    tables = {
        name: _table(name, known.get(name, default), 0 if type(default) is float else np.ndim(default))
        for name, default in defaults.items()
    }
    columns = {name: _table(name, value, 0) for name, value in known.items() if "[" in name}
    lengths = {name: len(table) for name, table in (tables | columns | {"u": inputs}).items() if len(table) != 1}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"parameters and inputs must have one length or length 1, got {lengths}")
    n_sets = next(iter(lengths.values()), 1)
    for name, own in tables.items():
        if len(own) != n_sets:  # numbers, which are most of them, cost less time without a view
            tables[name] = own.repeat(n_sets, 0) if own.size == 1 else np.broadcast_to(own, (n_sets, *own[0].shape))
    for name, column in columns.items():
        field, _, place = name.partition("[")
        table, k = tables[field], int(place[:-1])
        if not 0 <= k < table.shape[1]:
            raise ValueError(f"{name} is beyond the {table.shape[1]} numbers of {field}: give all of {field}")
        if not table.flags.writeable:  # the first of its numbers
            tables[field] = table = np.array(table)
        table[:, k] = column[:, 0]
    return tables, inputs


def table_of_one(value: Any) -> FloatArray:
    """A number (1, 1), or a field with axes of its own after one of length 1."""
    return np.array([[value]]) if isinstance(value, (int, float)) else np.array([value], dtype=float)


def _table(name: str, values: Any, ndim: int) -> FloatArray:
    """Values over sets, of a number (n_sets, 1), of a field with `ndim` axes (n_sets, ...)."""
    if ndim == 0 and type(values) is float and math.isfinite(values):  # most of them: checks take most of the time
        return table_of_one(values)
    array = read_only([values] if ndim == 1 and np.ndim(values) == 0 else values, name)  # as the constructor takes it
    if array.ndim > ndim + 1:
        raise ValueError(f"{name} has too many axes: got shape {array.shape}")
    if array.ndim == ndim:
        array = array[np.newaxis]
    return array[:, np.newaxis] if ndim == 0 else array
