"""`hysim sweep`: a study in a file, over all cores or a cluster, which can be resumed."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim._versions import optional
from hysim.cli import outputs, studies
from hysim.cli.options import JSON, Command
from hysim.cli.records import STANDARD

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.sweeps import Sweep

_STUDY = """

  seed = 1
  [response]
  law = "law.json"
  record = "loop.csv"
  [sample]
  method = "latin_hypercube"
  n = 1000
  distributions.beta = [0.0, 0.1]
"""

SUCCESS, SOME_FAILED = 0, 1


def run(options: argparse.Namespace) -> int:
    """Compute or show, write the table that is asked for, and print the summary."""
    from hysim.sweeps import load_sweep

    if options.out == STANDARD:
        raise ValueError("the rows are kept in a database: give --out a file")
    if options.show is not None and (options.study or options.out):
        raise ValueError("--show takes a database and computes nothing: leave the study and --out out")
    result = _computed(options) if options.show is None else load_sweep(options.show)
    files: outputs.Files = {options.csv: result.to_csv, options.plot: lambda: _picture(result, options.of)}
    outputs.write(options, files, result.summary, lambda: _document(result))
    return SOME_FAILED if result.errors and options.show is None else SUCCESS


def _document(result: "Sweep") -> dict[str, Any]:
    import numpy as np

    finite = {name: values[np.isfinite(values)] for name, values in result.outputs.items()}
    return {
        "n_tasks": result.n_tasks,
        "n_done": len(result),
        "parameters": list(result.parameters),
        "errors": {str(place): message for place, message in result.errors.items()},
        "outputs": {
            name: dict(zip(("lowest", "median", "highest"), np.quantile(values, [0.0, 0.5, 1.0]).tolist(), strict=True))
            | {"not_finite": len(result) - values.size}
            for name, values in finite.items()
            if values.size
        },
    }


def _picture(result: "Sweep", output: str | None) -> "Figure":
    from hysim import plot

    name = output or next(iter(result.outputs), None)
    if name is None or name not in result.outputs:
        raise ValueError(f"no output {name!r} to draw: there are {', '.join(result.outputs) or 'none'}")
    return outputs.drawn(lambda canvas: plot.parallel_coordinates(result, name, ax=canvas.add_subplot()))


def _computed(options: argparse.Namespace) -> Any:
    from hysim.sweeps import sweep

    if not options.study:
        raise ValueError("give a study, such as study.toml, and --out RESULTS.sqlite, or --show RESULTS.sqlite")
    if not options.out:
        raise ValueError(f"the rows are kept in a database: give --out {Path(options.study).stem}.sqlite")
    if Path(options.out).exists() and not options.resume:
        raise ValueError(f"{options.out} exists: continue it with --resume, or give another --out")
    task, space, seed, files = studies.read(options.study)
    outputs.keep(files, [options.out, options.csv, options.plot])
    with _executor(options) as executor:
        how = outputs.fields_of(options, ("workers", "on_change"))
        return sweep(task, space, executor=executor, store=options.out, seed=seed, **how)


@contextmanager
def _executor(options: argparse.Namespace) -> Iterator[Any]:
    if not options.dask:
        yield "processes" if options.processes else "threads"
        return
    client_class = optional("distributed", "--dask", "dask", ValueError).Client
    is_file = Path(options.dask).is_file()
    with client_class(scheduler_file=options.dask) if is_file else client_class(options.dask) as client:
        yield client


COMMAND = Command(
    "sweep",
    "compute a study over many parameters, or continue one",
    "Compute a task for many sets of parameters, as a TOML file says, and keep every finished row in a database. An "
    "interrupted study continues with --resume. Exit code 1: some tasks failed. A study of the error of a law on a "
    "record, beside both files:" + _STUDY,
    f"""
study [STUDY.toml]  description of the study; see the page on studies
--out RESULTS.sqlite  database of the rows
--resume  continue with the rows that are in the database
--on-change error|keep|restart  with --resume, if the rows come from another study than this one [default: error]
either --processes  processes instead of threads
or --dask ADDRESS  a dask cluster: address of its scheduler, or scheduler file
--workers N  number of threads or processes (default: one for each core)
--show DATABASE  compute nothing: print what is in a database
--csv TABLE.csv  write the rows; - writes them to the standard output
--plot LINES.svg  draw every row as a line over its parameters
--of OUTPUT  output whose size colours the lines (default: the first)
{JSON}
""",
    run,
    """
hysim sweep study.toml --out rows.sqlite --csv rows.csv --plot rows.svg
hysim sweep study.toml --out rows.sqlite --resume
hysim sweep --show rows.sqlite
""",
)
