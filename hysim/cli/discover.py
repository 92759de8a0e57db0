"""`hysim discover`: the law of a memory from a record in a file."""

import argparse
import sys
from typing import Any

from hysim.cli import outputs, records
from hysim.cli.options import JSON, MODEL_OUT, SEED, Command

SUCCESS, NO_MODEL = 0, 1
PLANT = ("mass", "damping", "stiffness")
ONLY_WITHOUT_PLANT = ("library", "cross_validate", "initial")


def run(options: argparse.Namespace) -> int:
    """Discover, write the files that are asked for, and print the result."""
    from hysim.discovery import discover, discover_oscillator
    from hysim.models.storage import to_json

    is_oscillator, arguments = _arguments(options)
    record = records.read(options)
    verb = discover_oscillator if is_oscillator else discover
    discovery = verb(record, seed=options.seed, **arguments)
    model = discovery.model
    files: outputs.Files = {
        options.out: lambda: to_json(model, units=record.units),
        options.plot: lambda: outputs.loop(record, model),
    }
    if model is None:
        files = {path: lambda: "" for path in files if path == records.STANDARD}
    outputs.write(options, files, discovery.to_json if options.json else discovery.summary)
    unwritten = [name for name, path in (("--out", options.out), ("--plot", options.plot)) if path and model is None]
    if unwritten:
        print(f"hysim: {' and '.join(unwritten)} not written: {discovery.warnings[0]}", file=sys.stderr)
    return NO_MODEL if unwritten else SUCCESS


def _arguments(options: argparse.Namespace) -> tuple[bool, dict[str, Any]]:
    """Whether the records are an oscillator's, and the options that were used, refused in the words of the shell."""
    names = (*PLANT, *ONLY_WITHOUT_PLANT, "degree", "symmetry")
    used = {name: value for name, value in vars(options).items() if name in names and value is not None}
    is_oscillator = options.route == "oscillator" or (options.route == "auto" and any(name in used for name in PLANT))
    for name in ONLY_WITHOUT_PLANT if is_oscillator else PLANT:
        if name in used:
            route = "an oscillator" if is_oscillator else f"--route {options.route}"
            raise ValueError(f"--{name.replace('_', '-')} is not used by {route}: leave it out")
    if is_oscillator and options.symmetry == "even":
        raise ValueError("--symmetry even is not used by an oscillator: leave it out, or use --symmetry odd")
    if "degree" in used and isinstance(options.library, list):
        raise ValueError("--degree is not used with a library of names: leave it out")
    return is_oscillator, used if is_oscillator else {"route": options.route, **used}


COMMAND = Command(
    "discover",
    "find the law of the memory in a file of your own",
    "Find the law of a memory by sparse regression (PySINDy) and free runs, and print it with its verdict: hysteresis, "
    "a linear lag, or that records of one rate cannot decide.",
    f"""
{records.OPTIONS}
--route auto|memory|output|oscillator  meaning of the output: the memory, a feedthrough and a memory, or the
    displacement of an oscillator; auto tries the first two [default: auto]
--library NAME|TERMS  bouc-wen, duhem, or terms with commas between them: "u',|u'| z,u' |z|"
--degree DEGREE  largest degree of the library's monomials; 2 by default, of an oscillator's 3
--symmetry odd|even  symmetry of the response; only odd for an oscillator
--mass VALUE  mass of an oscillator, if it is known [units of u s^2/y]
--damping VALUE  damping of an oscillator, if it is known [units of u s/y]
--stiffness VALUE  stiffness of an oscillator, if it is known [units of u/y]
--cross-validate loo|K  repeat the whole search without one sample at a time, or one of K blocks; not for an oscillator
--initial auto|free|rest  whether the memory begins at a value of its own or at zero; by default the
    BIC decides
{SEED}
{MODEL_OUT}
--plot LOOP.svg  draw the record and the law
{JSON}
""",
    run,
    """
hysim discover loop.csv --plot law.svg
hysim discover test.csv --route oscillator --mass 2.5
""",
)
