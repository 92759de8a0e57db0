"""The facts of a study, checked when they are read from a store, which may be damaged.

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
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile
from zlib import error as CompressionError  # noqa: N812

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
        facts = {name: json.dumps(value) for name, value in self._asdict().items()}
        return facts if self.layout is not None else {name: text for name, text in facts.items() if name != "layout"}


def study_of(rows: Mapping[str, Any]) -> Study:
    """The study in the rows of a store; any of `_DAMAGE` if they are damaged."""
    facts = {name: json.loads(text) for name, text in rows.items()}
    study = Study(
        identity=_texts(facts["identity"]),
        n_tasks=_number(facts["n_tasks"]),
        parameters=_texts(facts["parameters"]),
        kinds=_texts(facts["kinds"]),
        axes=None if facts["axes"] is None else tuple((_text(name), _listed(values)) for name, values in facts["axes"]),
        layout=tuple(_output(*each) for each in _listed(facts["layout"])) if "layout" in facts else None,
        shards=_text(facts["shards"]),
    )
    int(study.identity["seed"])
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
    return Output(_text(name), tuple(_number(length) for length in shape), _text(column))


def _listed(value: Any) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise TypeError(f"a list was expected, got {_shown(value)}")
    return value


def _texts(value: Any) -> dict[str, str]:
    if not isinstance(value, dict):
        raise TypeError(f"a mapping was expected, got {_shown(value)}")
    return {name: _text(text) for name, text in value.items()}


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"a text was expected, got {_shown(value)}")
    return value


def _number(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise TypeError(f"a number of tasks or samples was expected, got {_shown(value)}")
    return value


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
