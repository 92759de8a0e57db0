"""`hysim page` and `hysim explore`: laws with sliders, as pages for a browser."""

import argparse
import tempfile
from pathlib import Path

from hysim.cli import models, records
from hysim.cli.options import MODEL_IN, Command


def run(options: argparse.Namespace) -> int:
    """Write the page of a model."""
    if options.model == options.data == records.STANDARD:
        raise ValueError("the standard input holds the model or the record, not both")
    from hysim.export import to_page

    model, units = models.read(options.model)
    record = None if options.data is None else records.read(options, options.data)
    own = {} if record is None else dict(record.units)
    to_page(
        model,
        options.out,
        record,
        between=options.between,
        units={**units, **own, **dict(options.unit)},
        title=options.title,
    )
    return 0


def explore(options: argparse.Namespace) -> int:
    """Write the page with a choice of families, and open it."""
    import webbrowser

    from hysim.export import explorer

    folder = tempfile.mkdtemp(prefix="hysim-") if options.out is None else ""
    page = explorer(Path(folder, "explorer.html") if options.out is None else Path(options.out))
    print(page)
    if not options.no_browser:
        webbrowser.open(page.resolve().as_uri())
    return 0


COMMAND = Command(
    "page",
    "write a law with sliders as a page for a browser",
    "Write a page on which the loop of a law follows sliders, one HTML file that works offline. With --data the "
    "measured points are part of it.",
    f"""
{MODEL_IN}
--out PAGE.html  the page [required]
--data FILE  record to show and to compare with: text with one sample a line, NPZ, NPY, MAT or HDF5
--between LOW,HIGH  lowest and highest input at the start [unit of u]
--title TEXT  heading of the page

{records.OPTIONS_WITHOUT_FILE}
""",
    run,
    """
hysim page law.json --out law.html
hysim page law.json --data loop.csv --out law.html
""",
)

EXPLORE = Command(
    "explore",
    "play with the families of laws in a browser",
    "Open a page with a choice of families and devices, whose loops follow sliders. It works offline.",
    """
--out PAGE.html  write the page to this file (default: a temporary one)
--no-browser  write it, and open no browser
""",
    explore,
    """
hysim explore
hysim explore --no-browser --out explorer.html
""",
)
