"""`hysim discover`: the law of a memory from a record in a file."""

import argparse
import sys
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim.discovery import Discovery
    from hysim.records import Record

SUCCESS = 0
NO_MODEL = 1


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
        help="what the output is: the memory, a feedthrough and a memory, or the displacement of an oscillator "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--library", metavar="NAME|TERM,...", type=_library, help="bouc-wen, duhem, or terms: \"u',|u'| z,u' |z|\""
    )
    parser.add_argument("--degree", type=int, default=2, help="of the library's monomials (default: %(default)s)")
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
        default="auto",
        help="whether the memory begins at a value of its own or at rest, at zero (default: %(default)s, by BIC)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random restarts (default: %(default)s)")
    parser.add_argument("--out", metavar="MODEL.json", help="write the law, - for the standard output")
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the record and the law; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print the whole result as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Discover, write the files that are asked for, and print the result."""
    from hysim.discovery import discover

    is_taken = outputs.check(options.out, inputs=[options.file], pictures=[options.plot], printed=options.json)
    _check(options)
    record = records.read(options)
    found = discover(
        record,
        route=options.route,
        library=options.library,
        degree=options.degree,
        symmetry=options.symmetry,
        mass=options.mass,
        damping=options.damping,
        stiffness=options.stiffness,
        cross_validate=options.cross_validate,
        initial=options.initial,
        seed=options.seed,
        progress=outputs.progress(),
    )
    texts = _files(options, found, record)
    if not is_taken:
        texts[records.STANDARD] = found.to_json() if options.json else found.summary() + "\n"
    outputs.write(texts)
    if found.model is None and (options.out or options.plot):
        print(f"hysim: {' and '.join(_unwritten(options))} not written: {found.warnings[0]}", file=sys.stderr)
        return NO_MODEL
    return SUCCESS


def _check(options: argparse.Namespace) -> None:
    """Refuse options that the route does not use, in the words of the shell."""
    from hysim.discovery import arguments

    named = {name: getattr(options, name) for name in arguments.DEFAULTS if name in options}
    arguments.routes(options.route, arguments.given(named), called=_option)


def _option(name: str, value: Any) -> str:
    option = f"--{name.replace('_', '-')}"
    return f"{option} {value}" if isinstance(value, str) else option


def _files(options: argparse.Namespace, found: "Discovery", record: "Record") -> dict[str | None, Any]:
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
