"""Studies in TOML files: what is computed, for which parameters, from which seed.

seed = 1
task = "width.py:width"                 a function of a file beside this one, or "package.module:function"

[response]                              or, in place of the task, a law on a record
law = "law.json"                        or a name that `hysim identify --model` takes
record = "loop.csv"                     beside this file; or "table1"
u = "voltage"                           its columns
y = "displacement"
measure = "rmse"

[grid]                                  values of each parameter, all combinations
beta = [0.2, 0.5]
n = {from = 1.0, to = 2.0, number = 5}

[[list]]                                or one table for each task
beta = 0.2

[sample]                                or a sample
n = 64
method = "sobol"
distributions.beta = [0.2, 0.5]         low, high
distributions.n = {name = "norm", loc = 1.5, scale = 0.1}       of scipy.stats
"""

import importlib
import importlib.util
import math
import sys
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from hysim.cli import models

_SPACES = ("grid", "list", "sample")


class Study(NamedTuple):
    """Arguments of `sweep`, and the files that were read for them."""

    task: Callable[..., Any]
    space: Any
    seed: int
    files: tuple[str, ...]


def read(path: str) -> Study:
    """The study in a file.

    Raises
    ------
    ValueError
        If the file is not such a study; the message names it.
    OSError
        If it cannot be read.
    """
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        _check(document, {"seed", "task", "response", *_SPACES}, "a study")
        task, space = _one_of(document, ("task", "response")), _one_of(document, _SPACES)
        folder = Path(path).resolve().parent
        made = _named_task(document["task"], folder) if task == "task" else _response(document["response"], folder)
        files = _files(document[task], folder)
        return Study(made, _space(space, document[space]), document.get("seed", 0), files)
    except (ValueError, TypeError, KeyError, AttributeError, ImportError) as error:
        missing = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"{path}: {missing}") from error


def _files(source: Any, folder: Path) -> tuple[str, ...]:
    """The files that a task or a response is read from."""
    names = [source["law"], source["record"]] if isinstance(source, Mapping) else [source.rpartition(":")[0]]
    return tuple(str(folder / name) for name in names)


class FileTask:
    """A function of a file, which is loaded again where it is unpickled."""

    def __init__(self, path: str, name: str) -> None:
        self.path, self.name = path, name
        self.__wrapped__ = getattr(_module(path), name)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.__wrapped__(*arguments, **named)

    def __reduce__(self) -> tuple[Any, ...]:
        return FileTask, (self.path, self.name)

    def __getattr__(self, name: str) -> Any:
        if name == "batch":
            return getattr(self.__wrapped__, name)
        raise AttributeError(name)


def _module(path: str) -> Any:
    name = f"hysim_study_{Path(path).stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _named_task(text: str, folder: Path) -> Any:
    where, _, name = text.rpartition(":")
    if not where or not name:
        raise ValueError(f'task must be "module:function" or "file.py:function", got {text!r}')
    if where.endswith(".py"):
        return FileTask(str(folder / where), name)
    return getattr(importlib.import_module(where), name)


def _response(table: Mapping[str, Any], folder: Path) -> Any:
    import hysim

    _check(table, {"law", "record", "u", "y", "measure"}, "[response]")
    name = table["law"]
    law = getattr(hysim, models.FAMILIES[name]) if name in models.FAMILIES else hysim.load_model(folder / name)
    if table["record"] == "table1":
        record = hysim.datasets.table1()
    else:
        record = hysim.load(folder / table["record"], u=table["u"], y=table["y"])
    measure = table.get("measure", "rmse")
    return hysim.response_task(law, record.u, record.y if measure in ("rmse", "sse") else None, measure)


def _space(kind: str, content: Any) -> Any:
    if kind == "grid":
        return {name: _values(values) for name, values in content.items()}
    if kind == "list":
        return content
    from hysim.sweeps import Sample

    _check(content, {"n", "method", "seed", "distributions"}, "[sample]")
    distributions = {name: _distribution(given) for name, given in content["distributions"].items()}
    return Sample(**{**content, "distributions": distributions})


def _values(values: Any) -> Any:
    if not isinstance(values, Mapping):
        return values
    import numpy as np

    _check(values, {"from", "to", "number"}, "values of a parameter")
    first, last = float(values["from"]), float(values["to"])
    if not math.isfinite(last - first):
        raise ValueError(f"values go from one finite number to another, got {first:g} to {last:g}")
    return np.linspace(first, last, values["number"])


def _distribution(given: Any) -> Any:
    if not isinstance(given, Mapping):
        return tuple(given)
    from scipy import stats

    arguments = dict(given)
    return getattr(stats, arguments.pop("name"))(**arguments)


def _check(table: Mapping[str, Any], names: set[str], what: str) -> None:
    if unknown := table.keys() - names:
        raise ValueError(f"{what} has no {', '.join(sorted(unknown))}: there are {', '.join(sorted(names))}")


def _one_of(document: Mapping[str, Any], names: tuple[str, ...]) -> str:
    given = [name for name in names if name in document]
    if len(given) != 1:
        raise ValueError(f"give one of {', '.join(names)}, got {', '.join(given) or 'none'}")
    return given[0]
