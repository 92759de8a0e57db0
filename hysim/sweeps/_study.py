"""The facts of a study, which are checked when they are read from a store.

identity     name to text, which must be equal for two studies to be the same
n_tasks      number of tasks
parameters   name to column of the table of results
kinds        name to kind of its values, as NumPy has it
axes         names and values of the axes of a grid, or null
layout       names, shapes and columns of the outputs, once a task has succeeded
shards       what the names of the files with arrays begin with
"""

import json
import math
import re
import reprlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from zipfile import BadZipFile
from zlib import error as CompressionError  # noqa: N812

T = TypeVar("T")

_KINDS = "fibU"
_TOKEN = re.compile(r"[0-9a-f]{16}")
_DAMAGE = (
    ArithmeticError, AttributeError, BadZipFile, CompressionError, EOFError, LookupError, RecursionError, TypeError,
    ValueError,
)  # fmt: skip


class Output(NamedTuple):
    """Name and shape of an output, and its column if it is a number."""

    name: str
    shape: tuple[int, ...]
    column: str


class Study(NamedTuple):
    """The facts of a study; see the module."""

    identity: Mapping[str, str]
    n_tasks: int
    parameters: Mapping[str, str]
    kinds: Mapping[str, str]
    axes: tuple[tuple[str, list[Any]], ...] | None
    layout: tuple[Output, ...] | None
    shards: str

    @property
    def columns(self) -> list[str]:
        """Columns of parameters and of the outputs that are numbers."""
        outputs = [output.column for output in self.layout or () if not output.shape]
        return [*self.parameters.values(), *outputs]

    @property
    def rows(self) -> dict[str, str]:
        """The facts as texts in JSON, by their names; without a layout before it is known."""
        return {name: json.dumps(value) for name, value in self._asdict().items() if (name, value) != ("layout", None)}


def study_of(rows: Mapping[str, Any]) -> Study:
    """The study in the rows of a store; any of `_DAMAGE` if they are damaged."""
    facts = {name: json.loads(text) for name, text in rows.items()}
    identity, parameters, kinds = (_texts(facts[name]) for name in ("identity", "parameters", "kinds"))
    axes = None if facts["axes"] is None else tuple((_of(str, name), _of(list, v)) for name, v in facts["axes"])
    layout = tuple(_output(*each) for each in _of(list, facts["layout"])) if "layout" in facts else None
    study = Study(identity, _number(facts["n_tasks"]), parameters, kinds, axes, layout, _of(str, facts["shards"]))
    int(study.identity["seed"])
    if study.layout == ():
        raise ValueError("the layout has no output")
    if not study.parameters or study.parameters.keys() != study.kinds.keys():
        raise ValueError("parameters and kinds do not have the same names")
    if not {*study.kinds.values()} <= {*_KINDS}:
        raise ValueError(f"kinds must be among {', '.join(_KINDS)}, got {', '.join(study.kinds.values())}")
    if study.axes is not None:
        if [name for name, _ in study.axes] != [*study.parameters]:
            raise ValueError("axes and parameters do not have the same names")
        if math.prod(len(values) for _, values in study.axes) != study.n_tasks:
            raise ValueError(f"its axes do not have {study.n_tasks} combinations")
    if not _TOKEN.fullmatch(study.shards):
        raise ValueError("the names of shards do not begin with 16 hexadecimal digits")
    return study


@contextmanager
def damage_named(path: str | Path) -> Iterator[None]:
    """Turn the errors of damaged values into a ValueError that names the store."""
    try:
        yield
    except _DAMAGE as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error) or type(error).__name__
        raise ValueError(f"{path} is a damaged store, move it away: {reason}") from error


def _output(name: Any, shape: Any, column: Any) -> Output:
    return Output(_of(str, name), tuple(_number(length) for length in shape), _of(str, column))


def _texts(value: Any) -> dict[str, str]:
    return {name: _of(str, text) for name, text in _of(dict, value).items()}


def _number(value: Any) -> int:
    number = _of(int, value)
    if not 0 <= number < 2**63:
        raise ValueError(f"expected a number of tasks or samples, got {reprlib.repr(number)}")
    return number


def _of(kind: type[T], value: Any) -> T:
    """The value, if it is of this type; true and false are no numbers."""
    if type(value) is not kind:
        raise TypeError(f"expected a value of type {kind.__name__}, got {reprlib.repr(value)}")
    return value
