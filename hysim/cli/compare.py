"""`hysim compare`: models side by side on a record in a file."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records
from hysim.cli.identify import folds

if TYPE_CHECKING:
    from hysim.comparison import Comparison


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "compare",
        help="compare models on a file of your own",
        description="Identify models on a record, all by the same protocol, and print them side by side with what the "
        "record cannot decide.",
    )
    records.add_to(parser)
    parser.add_argument(
        "--model",
        metavar="NAME|MODEL.json",
        action="append",
        default=[],
        help="a family to identify or a model to take as it is, once or more (default: all families)",
    )
    parser.add_argument(
        "--cross-validate",
        metavar="loo|cycles|K",
        type=folds,
        help="leave one sample out at a time, one cycle, or one of K blocks (default: loo up to 200 samples, then 10)",
    )
    test = parser.add_mutually_exclusive_group()
    test.add_argument("--test", metavar="FILE", help="another record with the same columns, which no fit sees")
    test.add_argument("--test-cycles", metavar="N", type=int, help="keep the last N cycles for the test")
    parser.add_argument("--seed", type=int, default=0, help="of the random starts (default: %(default)s)")
    parser.add_argument("--timings", action="store_true", help="add the seconds of each fit to the tables")
    for form in ("csv", "markdown", "latex"):
        parser.add_argument(f"--{form}", metavar="PATH", help="write the table there, - for the standard output")
    parser.add_argument("--plot", metavar="LOOPS.svg", help="draw the best models, - for the standard output")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Compare, write the files that are asked for, and print the table."""
    from hysim.comparison import compare

    is_taken = outputs.check(options.csv, options.markdown, options.latex, pictures=[options.plot])
    record, test = records.read(options), options.test_cycles
    if options.test is not None:
        test = records.read(argparse.Namespace(**{**vars(options), "file": options.test}))
    table = compare(
        _chosen(options.model),
        record,
        cross_validate=options.cross_validate or "auto",
        test=test,
        seed=options.seed,
        progress=outputs.progress(),
    )
    texts = {
        options.csv: table.to_csv(timings=options.timings),
        options.markdown: table.to_markdown(timings=options.timings) + "\n",
        options.latex: table.to_latex(timings=options.timings) + "\n",
    }
    if options.plot:
        texts[options.plot] = _picture(table)
    if not is_taken:
        texts[records.STANDARD] = table.to_text(timings=options.timings) + "\n"
    outputs.write(texts)
    return 0


def _chosen(names: list[str]) -> Mapping[str, Any] | None:
    """What `compare` takes for these names; None for all families."""
    from hysim.models.candidates import candidates

    if not names:
        return None
    families, chosen = candidates(), {}
    for name in names:
        if Path(name).suffix == ".json":
            chosen[Path(name).stem] = models.read(name)[0]
        elif models.FAMILIES.get(name) in families:
            chosen[name] = families[models.FAMILIES[name]]
        else:
            raise ValueError(f"there is no model {name!r}: give a .json file or one of {', '.join(models.FAMILIES)}")
    return chosen


def _picture(table: "Comparison") -> str:
    """Picture of the best models, the same bytes each time."""
    from hysim import plot

    with plot.house_style():
        rows = min(4, len(table.rows))
        canvas = plot.figure(width=9.0, height=2.2 * rows)
        plot.comparison(table, axes=plot.panels(canvas, 3 * rows, columns=3))
    return plot.to_svg(canvas, name="comparison") + "\n"
