"""`hysim discover`: the law of a memory from a record in a file."""

import argparse
import sys
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim.discovery import Discovery, OscillatorDiscovery
    from hysim.records import Record

SUCCESS = 0
NO_MODEL = 1
PLANT = ("mass", "damping", "stiffness")
ONLY_WITHOUT_PLANT = ("library", "cross_validate", "initial")


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "discover",
        help="find the law of the memory in a file of your own",
        description="Find the law of a memory by sparse regression (PySINDy) and free runs, and print it with its "
        "verdict: hysteresis, a linear lag, or what one rate cannot tell.",
    )
    records.add_to(parser)
    parser.add_argument(
        "--route",
        choices=("auto", "memory", "output", "oscillator"),
        default="auto",
        help="what the output is: the memory, a feedthrough and a memory, or the displacement of an oscillator; auto "
        "tries the first two (default: %(default)s)",
    )
    parser.add_argument(
        "--library", metavar="NAME|TERM,...", type=_library, help="bouc-wen, duhem, or terms: \"u',|u'| z,u' |z|\""
    )
    parser.add_argument("--degree", type=int, help="highest degree of the terms (default: 2, of an oscillator's 3)")
    parser.add_argument("--symmetry", choices=("odd", "even"), help="of the response; an oscillator's may be odd")
    for name, unit in (("mass", "u s^2/y"), ("damping", "u s/y"), ("stiffness", "u/y")):
        parser.add_argument(
            f"--{name}", metavar="VALUE", type=float, help=f"of an oscillator, where it is known [units of {unit}]"
        )
    parser.add_argument(
        "--cross-validate",
        metavar="loo|K",
        type=_folds,
        help="repeat the whole search with one sample left out at a time, or one of K blocks; not for an oscillator",
    )
    parser.add_argument(
        "--initial",
        choices=("auto", "free", "rest"),
        help="whether the memory begins at a value of its own or at rest, at zero (default: auto, by BIC); not for an "
        "oscillator",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random restarts (default: %(default)s)")
    parser.add_argument("--out", metavar="MODEL.json", help="write the law, - for the standard output")
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the record and the law; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print the whole result as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Discover, write the files that are asked for, and print the result."""
    from hysim.discovery import discover, discover_oscillator

    is_taken = outputs.check(options.out, inputs=[options.file], pictures=[options.plot], printed=options.json)
    is_oscillator, arguments = _arguments(options)
    record = records.read(options)
    verb = discover_oscillator if is_oscillator else discover
    found = verb(record, **arguments, seed=options.seed, progress=outputs.progress())
    texts = _files(options, found, record)
    if not is_taken:
        texts[records.STANDARD] = found.to_json() if options.json else found.summary() + "\n"
    outputs.write(texts)
    if found.model is None and (options.out or options.plot):
        print(f"hysim: {' and '.join(_unwritten(options))} not written: {found.warnings[0]}", file=sys.stderr)
        return NO_MODEL
    return SUCCESS


def _arguments(options: argparse.Namespace) -> tuple[bool, dict[str, Any]]:
    """Whether the records are an oscillator's, and the arguments that are given, refused in the words of the shell."""
    names = (*PLANT, *ONLY_WITHOUT_PLANT, "degree", "symmetry")
    given = {name: value for name, value in vars(options).items() if name in names and value is not None}
    is_oscillator = options.route == "oscillator" or (options.route == "auto" and any(name in given for name in PLANT))
    for name in ONLY_WITHOUT_PLANT if is_oscillator else PLANT:
        if name in given:
            route = "an oscillator" if is_oscillator else f"--route {options.route}"
            raise ValueError(f"--{name.replace('_', '-')} is not used by {route}: leave it out")
    if is_oscillator and options.symmetry == "even":
        raise ValueError("--symmetry even is not used by an oscillator: leave it out, or use --symmetry odd")
    if "degree" in given and isinstance(options.library, list):
        raise ValueError("--degree is not used with a library of names: leave it out")
    return is_oscillator, given if is_oscillator else {"route": options.route, **given}


def _files(
    options: argparse.Namespace, found: "Discovery | OscillatorDiscovery", record: "Record"
) -> dict[str | None, Any]:
    """The model and its picture for the files that are asked for; nothing where there is no model."""
    from hysim.models.storage import to_json

    if found.model is None:
        return {}
    texts: dict[str | None, Any] = {options.out: to_json(found.model, units=record.units)}
    if options.plot:
        run = models.simulated(found.model, record, dict(record.units))
        texts[options.plot] = outputs.loop(record, run, model=found.model)
    return texts


def _unwritten(options: argparse.Namespace) -> list[str]:
    return [name for name, path in (("--out", options.out), ("--plot", options.plot)) if path]


def _library(text: str) -> str | list[str]:
    names = [name.strip() for name in text.split(",")]
    return names if len(names) > 1 or "'" in text else text


def _folds(text: str) -> str | int:
    if text != "loo" and not (text.isdigit() and int(text) > 1):
        raise argparse.ArgumentTypeError(f"expected loo or a number of blocks from 2 on, got {text!r}")
    return int(text) if text.isdigit() else text
