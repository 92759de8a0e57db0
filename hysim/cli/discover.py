"""`hysim discover`: the law of a memory from a record in a file."""

import argparse
import sys
from typing import Any

from hysim.cli import outputs, records
from hysim.cli.options import JSON, MODEL_OUT, SEED, Command

SUCCESS, NO_MODEL = 0, 1


def run(options: argparse.Namespace) -> int:
    """Discover, write the files that are asked for, and print the result."""
    from hysim.discovery import arguments, discover
    from hysim.models.storage import to_json

    chosen = {name: value for name, value in vars(options).items() if name in arguments.DEFAULTS}
    arguments.routes(options.route, arguments.given(chosen), called=_in_the_shell)
    record = records.read(options)
    discovery = discover(record, route=options.route, seed=options.seed, progress=outputs.progress(), **chosen)
    model = discovery.model
    files: outputs.Files = {
        options.out: lambda: to_json(model, units=record.units),
        options.plot: lambda: outputs.loop_of_model(record, model),
    }
    if model is None:
        files = {path: lambda: "" for path in files if path == records.STANDARD}
    outputs.write(options, files, discovery.to_json if options.json else discovery.summary)
    unwritten = [name for name, path in (("--out", options.out), ("--plot", options.plot)) if path and model is None]
    if unwritten:
        print(f"hysim: {' and '.join(unwritten)} not written: {discovery.warnings[0]}", file=sys.stderr)
    return NO_MODEL if unwritten else SUCCESS


def _in_the_shell(name: str, value: Any) -> str:
    """An argument of `discover` as an option."""
    name = f"--{name.replace('_', '-')}"
    return f"{name} {value}" if isinstance(value, str) else name


COMMAND = Command(
    "discover",
    "find the law of the memory in a file of your own",
    "Find the law of a memory by sparse regression (PySINDy) and free runs, and print it with its verdict: hysteresis, "
    "a linear lag, or that records of one rate cannot decide.",
    f"""
{records.OPTIONS}
--route auto|memory|output|oscillator  meaning of the output: the memory, a feedthrough and a memory, or the
    displacement of an oscillator [default: auto]
--library NAME|TERMS  bouc-wen, duhem, or terms with commas between them: "u',|u'| z,u' |z|"
--degree DEGREE  largest degree of the library's monomials [default: 2]
--symmetry odd|even  symmetry of the response; only odd for an oscillator
--mass VALUE  mass of an oscillator, if it is known [units of u s^2/y]
--damping VALUE  damping of an oscillator, if it is known [units of u s/y]
--stiffness VALUE  stiffness of an oscillator, if it is known [units of u/y]
--cross-validate loo|K  repeat the whole search without one sample at a time, or one of K blocks; not for an oscillator
--initial auto|free|rest  whether the memory begins at a value of its own or at zero; auto decides by the BIC
    [default: auto]
{SEED}
{MODEL_OUT}
--plot LOOP.svg  draw the record and the law
{JSON}
""",
    run,
)
