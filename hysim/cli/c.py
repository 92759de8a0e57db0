"""`hysim c`: a model in a file, or its inverse, as C99."""

import argparse
from pathlib import Path
from typing import Any

from hysim._atomic import write_all
from hysim.cli import models, outputs
from hysim.cli.options import MODEL_IN, Command, positive


def run(options: argparse.Namespace) -> int:
    """Write header, source and a program around them."""
    from hysim.export import to_c

    out = Path(options.out)
    if out.suffix != ".c":
        raise ValueError(f"--out is a C source, and its header stands beside it: call the file .c, got {options.out}")
    paths = {end: str(out.with_name(out.stem + end)) for end in (".h", ".c", "_main.c")}
    outputs.keep([options.model], paths.values())
    model, _ = models.read(options.model)
    sample_time = None if options.sample_time is None else positive("--sample-time", options.sample_time)
    code = to_c(_inverse(model) if options.inverse else model, sample_time, name=out.stem, u0=options.u0)
    texts = {".h": code.header, ".c": code.source, "_main.c": code.main}
    write_all({paths[end]: text for end, text in texts.items()})
    compiled = f"cc -std=c99 -O2 -ffp-contract=off {paths['.c']} {paths['_main.c']} -lm -o {out.with_suffix('')}"
    print(
        f"wrote {', '.join(paths.values())}; a program that reads one input in each line is compiled by\n  {compiled}"
    )
    return 0


def _inverse(model: Any) -> Any:
    from hysim.control import InverseFeedforward

    return InverseFeedforward(law=model)


COMMAND = Command(
    "c",
    "write a model, or its inverse, as C99 for the device that it runs on",
    "Write a law, a sum, a cascade or a plant as C99 with math.h alone: MODEL.h, MODEL.c, and MODEL_main.c, a program "
    "that reads inputs, one in each line, and prints outputs. A controller that is tuned on the model is written by "
    "hysim control --c. A value that begins with a minus sign is joined by an equals sign: --u0=-10.",
    f"""
{MODEL_IN}
--out MODEL.c  the source; the other files stand beside it [required]
--inverse  the inverse of the law: the input that gives a wanted output
--sample-time TIME  time between two samples of a plant, or of a law that depends on time [s]
--u0 VALUE  input at rest, at which an inverse starts [unit of u] [default: 0]
""",
    run,
    """
hysim c law.json --out law.c
hysim c law.json --inverse --out inverse.c
""",
)
