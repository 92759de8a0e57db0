"""`hysim sweep`: a study in a file, over all cores or a cluster, which can be resumed.

A study is a TOML file: a task or a law on a record, its parameters, and the seed; docs/studies.md has the format. A
study with a task is code: its module or file is executed. A study with a response is data only.
"""

import functools
import glob
import importlib.util
import os
import pkgutil
import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated, Any, Literal

import hysim as hs
from hysim._basics.libraries import optional
from hysim.cli import models, options, outputs

_SPACES = ("grid", "list", "sample")


def sweep(
    study: Annotated[str, options.Value("STUDY.toml", role=options.INPUT)] | None = None,
    *,
    out: Annotated[str, options.Value("RESULTS.sqlite", role=options.RESULT)] | None = None,
    resume: bool = False,
    on_change: Literal["error", "keep", "restart"] = "error",
    processes: bool = False,
    dask: str | None = None,
    workers: int | None = None,
    shard: str | None = None,
    merge: bool = False,
    time_limit: float | None = None,
    show: Annotated[str, options.Value("DATABASE", role=options.INPUT)] | None = None,
    csv: options.ResultFile | None = None,
    plot: options.Picture | None = None,
    of: str | None = None,
) -> options.Result:
    """Compute a study over many parameters, or continue one.

    Compute a task for many sets of parameters, as a TOML file says, and keep every finished row in a database.

    An interrupted study continues with --resume. Exit code 1: some tasks failed; 3: the study is not finished. A study
    of the error of a law on a record, beside both files:

      seed = 1
      [response]
      law = "law.json"
      record = "loop.csv"
      [sample]
      method = "latin_hypercube"
      n = 1000
      distributions.beta = [0.0, 0.1]

    Parameters
    ----------
    study : description of the study; see the page on studies
    out : database of the rows
    resume : continue with the rows that are in the database
    on_change : with --resume, if the rows come from another study than this one
    processes : processes instead of threads
    dask : a dask cluster: address of its scheduler, or scheduler file
    workers : number of threads or processes (default: one for each core)
    shard : compute share K/N, such as 0/100 to 99/100, in a database of its own beside --out, or go on with it; auto or
        auto/N: the share that SLURM, Kubernetes or PBS numbers
    merge : compute nothing: enter the rows of all shards of --out into it
    time_limit : begin nothing that would end later than so long after the start [s]
    show : compute nothing: print what is in a database
    csv : write the rows; - writes them to the standard output
    plot : draw every row as a line over its parameters
    of : output whose size colours the lines (default: the first)

    Examples
    --------
    hysim sweep study.toml --out rows.sqlite --csv rows.csv --plot rows.svg
    hysim sweep study.toml --out rows.sqlite --resume
    hysim sweep study.toml --out rows.sqlite --shard 3/100 --time-limit 3300
    hysim sweep study.toml --out rows.sqlite --merge
    hysim sweep --show rows.sqlite
    """
    options.exclusive(processes=processes, dask=dask)
    options.exclusive(shard=shard, merge=merge, show=show)
    share = _share(shard) if shard else None
    if out == options.STANDARD:
        raise ValueError("the rows are kept in a database: give --out a file")
    if show is not None:
        if study or out:
            raise ValueError("--show takes a database and computes nothing: leave the study and --out out")
        result = hs.load_sweep(show)
    else:
        if not study:
            raise ValueError("give a study, such as study.toml, and --out RESULTS.sqlite, or --show RESULTS.sqlite")
        if not out:
            raise ValueError(f"the rows are kept in a database: give --out {Path(study).stem}.sqlite")
        if Path(out).exists() and not (resume or share or merge):
            raise ValueError(f"{out} exists: continue it with --resume, or give another --out")
        stores, out = (_stores(out) if merge else []), (_store(out, *share) if share else out)
        time_limit = 0.0 if merge else time_limit
        task, space, seed, files = read(study)
        outputs.keep(files, [out, csv, plot])
        with _executor(dask, processes) as executor:
            run = functools.partial(hs.sweep, task, space, executor=executor, workers=workers, seed=seed)
            result = run(store=out, shard=share, merge=stores, time_limit=time_limit, on_change=on_change)
    missing = [] if show else result.missing.tolist()
    contents: options.Files = {csv: result.to_csv, plot: lambda: _picture(result, of)}
    reached = show is not None or not result.errors
    unfinished = f"{len(missing)} tasks remain, the first is {missing[0]}" if missing else ""
    return options.Result(contents, result.summary, lambda: _document(result), reached, unfinished)


# Number of a job in an array, the first number, the step and the number of jobs.
_ARRAYS = (
    [f"SLURM_ARRAY_TASK_{name}" for name in ("ID", "MIN", "STEP", "COUNT")],
    ["JOB_COMPLETION_INDEX", "", "", ""],
    ["PBS_ARRAY_INDEX", "", "", ""],
)


def _share(text: str) -> tuple[int, int]:
    """The shard K/N, or that of this job in an array of jobs."""
    place, _, number = text.partition("/")
    if place == "auto":
        names = next((names for names in _ARRAYS if names[0] in os.environ), None)
        if names is None:
            known = ", ".join(names[0] for names in _ARRAYS)
            raise ValueError(f"--shard auto is for an array of jobs: none of {known} is set")
        own, first, step = (int(os.environ.get(name, default)) for name, default in zip(names, "001", strict=False))
        place, number = str((own - first) // step), number or os.environ.get(names[3], "")
    if not (re.fullmatch(r"\d{1,9}", place) and re.fullmatch(r"\d{1,9}", number)):
        raise ValueError(f"--shard takes K/N, such as 0/100, auto or auto/N, got {text!r}")
    return int(place), int(number)


def _store(out: str, k: int, n: int) -> str:
    path = Path(out)
    return str(path.with_name(f"{path.stem}.{k:0{len(str(n - 1))}d}-of-{n}{path.suffix}"))


def _stores(out: str) -> list[str]:
    path = Path(out)
    stores = sorted(glob.glob(f"{glob.escape(str(path.with_suffix('')))}.*-of-*{glob.escape(path.suffix)}"))
    if not stores:
        raise ValueError(f"there is no shard of {out}, such as {_store(out, 0, 100)}")
    return stores


def _executor(dask: str | None, processes: bool) -> AbstractContextManager[Any]:
    if not dask:
        return nullcontext("processes" if processes else "threads")
    client: Any = optional("distributed", "--dask", "dask", ValueError).Client
    return client(scheduler_file=dask) if Path(dask).is_file() else client(dask)  # type: ignore[no-any-return]


def _document(result: "hs.Sweep") -> dict[str, Any]:
    errors = {str(place): message for place, message in result.errors.items()}
    numbers = {"n_tasks": result.n_tasks, "n_done": len(result)}
    return numbers | {"parameters": list(result.parameters), "errors": errors, "outputs": result.ranges}


def _picture(result: "hs.Sweep", output: str | None) -> Any:
    name = output or next(iter(result.outputs), None)
    if name is None or name not in result.outputs:
        raise ValueError(f"no output {name!r} to draw: there are {', '.join(result.outputs) or 'no outputs'}")
    return outputs.on_axes(hs.plot.parallel_coordinates, result, name)


def read(path: str) -> tuple[Callable[..., Any], Any, int, list[str]]:
    """Task, parameters, seed and files of a study; ValueError if the file is no study, OSError if it cannot be read."""
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        _check(document, {"seed", "task", "response", *_SPACES}, "a study")
        source, space = _one_of(document, ("task", "response")), _one_of(document, _SPACES)
        folder, content = Path(path).resolve().parent, document[source]
        task = _function(content, folder) if source == "task" else _response(content, folder)
        names = [content.rpartition(":")[0]] if source == "task" else [content["law"], content["record"]]
        files = [str(folder / name) for name in names]
        return task, _space(space, document[space]), document.get("seed", 0), files
    except (ValueError, TypeError, KeyError, AttributeError, ImportError) as error:
        raise ValueError(f"{path}: {error}{' is missing' * isinstance(error, KeyError)}") from error


class FileTask:
    """A function in a file, which is loaded again in the process where it is unpickled."""

    def __init__(self, path: str, name: str) -> None:
        self.path, self.name = path, name
        spec: Any = importlib.util.spec_from_file_location(f"hysim_study_{Path(path).stem}", path)
        sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        self.function: Any = vars(module).get(name)
        if not callable(self.function):
            raise ValueError(f"{path} has no function {name!r}")
        functools.update_wrapper(self, self.function)  # with its attribute `batch`, if it has one

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.function(*arguments, **named)

    def __repr__(self) -> str:
        return f"{self.path}:{self.name}"

    def __reduce__(self) -> tuple[Any, ...]:
        return FileTask, (self.path, self.name)


def _function(text: str, folder: Path) -> Any:
    place, _, name = text.rpartition(":")
    if not place or not name:
        raise ValueError(f'task must be "module:function" or "file.py:function", got {text!r}')
    return FileTask(str(folder / place), name) if place.endswith(".py") else models.resolved(text)


def _response(table: Mapping[str, Any], folder: Path) -> Any:
    _check(table, {"law", "record", "u", "y", "measure"}, "[response]")
    name = table["law"]
    is_file = name.endswith(".json") or (folder / name).is_file()
    if not is_file and models.is_import_path(name):
        raise ValueError(f"law takes a family or a file, got {name!r}: a law of your own is code, which a task can use")
    law = hs.load_model(folder / name) if is_file else models.family(name)
    is_own = table["record"] != "table1"
    record = hs.load(folder / table["record"], u=table.get("u"), y=table.get("y")) if is_own else hs.datasets.table1()
    measure = table.get("measure", "rmse")
    return hs.response_task(law, record.u, record.y if measure in ("rmse", "sse") else None, measure)


def _space(kind: str, content: Any) -> Any:
    if kind == "grid":
        return {name: _values(values) for name, values in content.items()}
    if kind == "list":
        return content
    distributions = {name: _distribution(value) for name, value in content["distributions"].items()}
    return hs.Sample(**{**content, "distributions": distributions})


def _values(values: Any) -> Any:
    if not isinstance(values, Mapping):
        return values
    import numpy as np

    _check(values, {"from", "to", "number"}, "values of a parameter")
    return np.linspace(float(values["from"]), float(values["to"]), values["number"])


def _distribution(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return tuple(value)
    arguments = dict(value)
    return pkgutil.resolve_name(f"scipy.stats:{arguments.pop('name')}")(**arguments)


def _check(table: Mapping[str, Any], names: set[str], title: str) -> None:
    if unknown := table.keys() - names:
        raise ValueError(f"{title} has no {', '.join(sorted(unknown))}: there are {', '.join(sorted(names))}")


def _one_of(document: Mapping[str, Any], names: tuple[str, ...]) -> str:
    present = [name for name in names if name in document]
    if len(present) != 1:
        raise ValueError(f"give one of {', '.join(names)}, got {', '.join(present) or 'nothing'}")
    return present[0]
