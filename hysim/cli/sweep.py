"""`hysim sweep`: a study in a file, over all cores or a cluster, resumable."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim.cli import outputs, studies
from hysim.cli.records import STANDARD

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.sweeps import Sweep

SUCCESS, SOME_FAILED = 0, 1


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "sweep",
        help="compute a study over many parameters, and go on with one",
        description="Compute a task for many sets of parameters, as a TOML file says, and keep every finished row in "
        "a database. What was interrupted goes on with --resume. Exit code 1: some tasks failed.",
    )
    parser.add_argument("study", metavar="STUDY.toml", nargs="?", help="what to compute; see the page on studies")
    parser.add_argument("--out", metavar="RESULTS.sqlite", help="where the rows are kept")
    parser.add_argument("--resume", action="store_true", help="go on with the rows that are there")
    parser.add_argument(
        "--on-change",
        choices=("error", "keep", "restart"),
        default="error",
        help="with --resume, if the study is another one than that of the rows (default: %(default)s)",
    )
    who = parser.add_mutually_exclusive_group()
    who.add_argument("--processes", action="store_true", help="processes in place of threads")
    who.add_argument("--dask", metavar="ADDRESS", help="a dask cluster: address of its scheduler, or scheduler file")
    parser.add_argument("--workers", metavar="N", type=int, help="threads or processes; else one for each core")
    parser.add_argument("--show", metavar="RESULTS.sqlite", help="compute nothing: say what is in a database")
    parser.add_argument("--csv", metavar="TABLE.csv", help="write the rows, - for the standard output")
    parser.add_argument(
        "--plot", metavar="LINES.svg", help=f"draw every row as a line over its parameters; {outputs.PICTURE}"
    )
    parser.add_argument("--of", metavar="OUTPUT", help="output whose size colours the lines (default: the first)")
    parser.add_argument("--json", action="store_true", help="print the summary and the ranges as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Compute or show, write the table that is asked for, and print the summary."""
    from hysim.sweeps import load_sweep

    if options.out == STANDARD:
        raise ValueError("the rows are kept in a database: give --out a file")
    is_taken = outputs.check(
        *(options.out, options.csv), inputs=[options.study, options.show], pictures=[options.plot], printed=options.json
    )
    if options.show is not None:
        if options.study or options.out:
            raise ValueError("--show takes a database and computes nothing: leave the study and --out out")
        result, code = load_sweep(options.show), SUCCESS
    else:
        result = _computed(options)
        code = SOME_FAILED if result.errors else SUCCESS
    texts: dict[str | None, Any] = {options.csv: result.to_csv() if options.csv else ""}
    if options.plot:
        texts[options.plot] = _picture(result, options.of)
    if not is_taken:
        texts[STANDARD] = outputs.to_json(_document(result)) if options.json else result.summary() + "\n"
    outputs.write(texts)
    return code


def _document(result: "Sweep") -> dict[str, Any]:
    import numpy as np

    known = {name: values[np.isfinite(values)] for name, values in result.outputs.items()}
    return {
        "n_tasks": result.n_tasks,
        "n_done": len(result),
        "parameters": list(result.parameters),
        "errors": {str(place): message for place, message in result.errors.items()},
        "outputs": {
            name: dict(zip(("lowest", "median", "highest"), np.quantile(values, [0.0, 0.5, 1.0]).tolist(), strict=True))
            | {"not_finite": len(result) - values.size}
            for name, values in known.items()
            if values.size
        },
    }


def _picture(result: "Sweep", output: str | None) -> "Figure":
    from hysim import plot

    name = output or next(iter(result.outputs), None)
    if name is None or name not in result.outputs:
        raise ValueError(f"no output {name!r} to draw: there are {', '.join(result.outputs) or 'none'}")
    with plot.house_style():
        canvas = plot.figure()
        plot.parallel_coordinates(result, name, ax=canvas.add_subplot())
    return canvas


def _computed(options: argparse.Namespace) -> Any:
    from hysim.sweeps import sweep

    if not options.study or not options.out:
        raise ValueError("give a study and --out RESULTS.sqlite, or --show RESULTS.sqlite")
    if Path(options.out).exists() and not options.resume:
        raise ValueError(f"{options.out} exists: --resume goes on with it; else give another --out")
    task, space, seed, files = studies.read(options.study)
    outputs.keep(files, [options.out, options.csv, options.plot])
    with _executor(options) as executor:
        return sweep(
            task,
            space,
            executor=executor,
            workers=options.workers,
            store=options.out,
            seed=seed,
            on_change=options.on_change,
            progress=progress(),
        )


@contextmanager
def _executor(options: argparse.Namespace) -> Iterator[Any]:
    if not options.dask:
        yield "processes" if options.processes else "threads"
        return
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("--dask needs distributed: pip install 'hysim[dask]'") from None
    is_file = Path(options.dask).is_file()
    with Client(scheduler_file=options.dask) if is_file else Client(options.dask) as client:
        yield client


def progress() -> Callable[[int, int], None] | None:
    """Tasks done, their rate and the time left, on the standard error if that is a terminal."""
    if not sys.stderr.isatty():
        return None
    began: list[tuple[float, int]] = []

    def show(done: int, total: int) -> None:
        began.append((time.monotonic(), done)) if not began else None
        elapsed, computed = time.monotonic() - began[0][0], done - began[0][1]
        rate = computed / elapsed if computed else 0.0
        left = f", {rate:.3g} a second, {_clock((total - done) / rate)} left" if rate else ""
        end = "\n" if done >= total else ""
        print(f"\r\x1b[K{done}/{total}{left}", end=end, file=sys.stderr, flush=True)

    return show


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}"
