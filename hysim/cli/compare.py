"""`hysim compare`: models side by side on a record in a file."""

import argparse
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records
from hysim.cli.identify import folds

if TYPE_CHECKING:
    from hysim.comparison import Comparison, ComparisonRow, Contrast
    from hysim.plot import Figure
    from hysim.records import Record


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
    parser.add_argument("--out", metavar="MODEL.json", help="write the model that predicts best, as identify does")
    parser.add_argument("--plot", metavar="LOOPS.svg", help=f"draw the best models; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print the whole table as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Compare, write the files that are asked for, and print the table."""
    from hysim.comparison import compare

    tables = options.csv, options.markdown, options.latex
    inputs = [options.file, options.test, *options.model]
    is_taken = outputs.check(options.out, *tables, inputs=inputs, pictures=[options.plot], printed=options.json)
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
    texts: dict[str | None, Any] = {
        options.out: _best(table, record) if options.out else "",
        options.csv: table.to_csv(timings=options.timings),
        options.markdown: table.to_markdown(timings=options.timings) + "\n",
        options.latex: table.to_latex(timings=options.timings) + "\n",
    }
    if options.plot:
        texts[options.plot] = _picture(table)
    if not is_taken:
        text = table.to_text(timings=options.timings) + "\n"
        texts[records.STANDARD] = outputs.to_json(_document(table, options.timings)) if options.json else text
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


def _best(table: "Comparison", record: "Record") -> str:
    """The model that predicts best; of one without errors of prediction, that of the least rmse."""
    from hysim.models.storage import to_json

    ranked = table.ranked() or table.ranked("rmse")
    if not ranked:
        raise ValueError(f"no model could be compared: {'; '.join(table.failed.values())}")
    return to_json(ranked[0].model, units=record.units)


def _document(table: "Comparison", timings: bool) -> dict[str, Any]:
    contrasts = {each.name: each for each in table.contrasts}
    rows = [_plain(row) | _effects(contrasts.get(row.name)) for row in table.rows]
    return {
        "record": table.record.name,
        "units": table.record.units,
        "winner": table.winner,
        "undecided": table.undecided,
        "verdict": table.verdict,
        "warnings": table.warnings,
        "rows": [{name: value for name, value in row.items() if timings or name != "seconds"} for row in rows],
        "failed": table.failed,
    }


def _plain(row: "ComparisonRow") -> dict[str, Any]:
    """The row's numbers and words."""
    values = {field.name: getattr(row, field.name) for field in fields(row)}
    return {name: value for name, value in values.items() if isinstance(value, (str, int, float))}


def _effects(contrast: "Contrast | None") -> dict[str, Any]:
    """How a model compares with the best one; null for the best one itself, and where there is none."""
    names = ("rmse_ratio", "typical_ratio", "probability", "diverged")
    return {name: None if contrast is None else getattr(contrast, name) for name in names}


def _picture(table: "Comparison") -> "Figure":
    """Picture of the best models."""
    from hysim import plot

    with plot.house_style():
        rows = min(4, len(table.rows))
        canvas = plot.figure(width=9.0, height=2.2 * rows)
        plot.comparison(table, axes=plot.panels(canvas, 3 * rows, columns=3))
    return canvas
