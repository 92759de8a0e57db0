"""`hysim compare`: models side by side on a record in a file."""

import argparse
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records
from hysim.cli.options import JSON, SEED, Command
from hysim.errors import Interrupted

if TYPE_CHECKING:
    from hysim.comparison import Comparison
    from hysim.plot import Figure
    from hysim.records import Record

_CONTRASTED = ("rmse_ratio", "typical_ratio", "probability", "diverged")


def run(options: argparse.Namespace) -> int:
    """Compare, write the files that are asked for, and print the table."""
    from hysim.comparison import compare

    record, test = records.read(options), options.test_cycles
    if options.test is not None:
        test = records.read(options, options.test, uncut=True)
    subjects: dict[str, Any] = {}
    for name in options.model:
        subjects |= _subjects(name)
    try:
        table = compare(
            subjects or None,
            record,
            cross_validate=options.cross_validate or "auto",
            test=test,
            seed=options.seed,
            max_evaluations=options.max_evaluations,
        )
    except Interrupted as interrupt:
        if not options.json:
            print(interrupt.finished.to_text())
        raise
    files: outputs.Files = {
        options.out: lambda: _best(table, record),
        options.csv: lambda: table.to_csv(),
        options.markdown: lambda: table.to_markdown() + "\n",
        options.latex: lambda: table.to_latex() + "\n",
        options.plot: lambda: _picture(table),
    }
    outputs.write(options, files, lambda: table.to_text(), lambda: _document(table))
    return 0


def _subjects(name: str) -> dict[str, Any]:
    """Subjects of the comparison for a family's name, a file or an import path."""
    from hysim.models.model import candidates_named

    model = models.model_or_family(name)
    if name.endswith(".json") or models.is_import_path(name):
        return {models.name_of(name): model}
    try:
        of_family = candidates_named(model.__name__)
    except ValueError:
        raise ValueError(f"the model {name} cannot be compared without further arguments: give a .json file") from None
    return of_family if len(of_family) > 1 else dict.fromkeys([name], *of_family.values())


def _best(table: "Comparison", record: "Record") -> str:
    """The model that predicts best; if no errors of prediction are known, the one with the smallest rmse."""
    from hysim.models.storage import to_json

    ranked = table.ranked() or table.ranked("rmse")
    if not ranked:
        raise ValueError(f"no model could be compared: {'; '.join(table.failed.values())}")
    return to_json(ranked[0].model, units=record.units)


def _document(table: "Comparison") -> dict[str, Any]:
    contrasts = {each.name: outputs.fields_of(each, _CONTRASTED) for each in table.contrasts}
    rows = [outputs.scalars(row) | contrasts.get(row.name, dict.fromkeys(_CONTRASTED)) for row in table.rows]
    return {
        "record": table.record.name,
        "units": table.record.units,
        "winner": table.winner,
        "undecided": table.undecided,
        "verdict": table.verdict,
        "warnings": table.warnings,
        "rows": rows,
        "failed": table.failed,
    }


def _picture(table: "Comparison") -> "Figure":
    from hysim import plot

    rows = min(4, len(table.rows))
    return outputs.drawn(
        lambda canvas: plot.comparison(table, axes=plot.panels(canvas, 3 * rows, columns=3)), 9.0, 2.2 * rows
    )


COMMAND = Command(
    "compare",
    "compare models on a file of your own",
    "Identify models on a record, all by the same protocol, and print them side by side with what the record cannot "
    "decide.",
    f"""
{records.OPTIONS}
--model MODEL...  {models.FORMS}; once or more (default: all families)
--cross-validate loo|cycles|K  leave out one sample at a time, one cycle, or one of K blocks (default: loo up to 200
    samples, then 10)
either --test FILE  another record with the same columns, for the test only
or --test-cycles N  keep the last N cycles for the test
--max-evaluations N  most parameter sets that the search of each model simulates; a fit that ends by it is partial
{SEED}
--csv PATH  write the table; - writes it to the standard output, so too with the next two options
--markdown PATH  write the table in Markdown
--latex PATH  write the table in LaTeX
--out MODEL.json  write the model that predicts best, as identify does
--plot LOOPS.svg  draw the best models
{JSON}
""",
    run,
    """
hysim compare loop.csv
hysim compare loop.csv --model bouc-wen --model preisach --model law.json --test-cycles 1
hysim compare loop.csv --csv table.csv --plot loops.svg --out best.json
""",
)
