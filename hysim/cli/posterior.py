"""`hysim posterior`: the distribution of a model's parameters from a record in a file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim._printing import csv_text
from hysim.cli import models, outputs, records
from hysim.cli.options import JSON, SEED, Command

if TYPE_CHECKING:
    from hysim.plot import Figure
    from hysim.posterior import Posterior

SUCCESS, NOT_CONVERGED = 0, 1

_RESULTS = _TABLE, _DRAWS, _PICTURE, _DOCUMENT = "parameters.csv", "samples.csv", "corner.svg", "posterior.json"
_PANEL = 1.25  # width of a panel of the corner picture [inch]
_SETTINGS = ("noise", "resolution", "priors", "n_evaluations", "seed", "warnings")


def run(options: argparse.Namespace) -> int:
    """Identify, sample, write the files of the folder, and print the table."""
    from hysim.identification import identify
    from hysim.posterior import sample_posterior

    model = models.to_identify(options)
    measured: Any = [records.read(options, file) for file in (options.file, *options.others)]
    measured = measured if options.others else measured[0]
    if options.out is not None:
        results = [str(Path(options.out, name)) for name in _RESULTS]
        outputs.keep([options.file, *options.others, options.model], results)
        Path(options.out).mkdir(parents=True, exist_ok=True)
    fit = identify(
        model,
        measured,
        fixed=dict(options.fix),
        free=tuple(options.free),
        **outputs.fields_of(options, ("initial", "noise", "seed")),
    )
    posterior = sample_posterior(
        fit,
        measured,
        priors=dict(options.prior),
        **outputs.fields_of(options, ("initial", "noise", "samples", "seed")),
    )
    outputs.write(options, _files(options.out, posterior), posterior.summary, lambda: _document(posterior))
    return NOT_CONVERGED if posterior.warnings or not fit.success else SUCCESS


def _files(out: str | None, posterior: "Posterior") -> outputs.Files:
    """The files of the folder."""
    if out is None:
        return {}
    return {
        str(Path(out, _TABLE)): lambda: _table(posterior),
        str(Path(out, _DRAWS)): posterior.to_csv,
        str(Path(out, _PICTURE)): lambda: _corner(posterior),
        str(Path(out, _DOCUMENT)): lambda: outputs.to_json(_document(posterior)),
    }


def _rows(posterior: "Posterior") -> list[dict[str, Any]]:
    """Each parameter with its median, interval at 95 % and diagnostics."""
    ends, median = posterior.interval(), posterior.median
    return [
        {
            "name": name,
            "median": median[name],
            "lower": ends[name][0],
            "upper": ends[name][1],
            "mean": float(draws.mean()),
            "standard_deviation": float(draws.std(ddof=1)),
            "effective_samples": posterior.effective_samples[name],
            "rhat": posterior.rhat[name],
        }
        for name, draws in posterior.samples.items()
    ]


def _table(posterior: "Posterior") -> str:
    rows = _rows(posterior)
    return csv_text([rows[0], *(row.values() for row in rows)])


def _document(posterior: "Posterior") -> dict[str, Any]:
    settings = outputs.fields_of(posterior, _SETTINGS)
    return {"family": type(posterior.model).__name__, "parameters": _rows(posterior), **settings}


def _corner(posterior: "Posterior") -> "Figure":
    from hysim import plot

    n = len(posterior.names)
    side = max(_PANEL * n, 4.0)
    return outputs.drawn(lambda canvas: plot.corner(posterior, axes=canvas.subplots(n, n)), side, side)


COMMAND = Command(
    "posterior",
    "draw the distribution of a model's parameters given a file",
    "Identify a model, draw its parameters from their posterior distribution, and print medians and intervals at 95 %. "
    "It needs the extra bayes. Exit code 1: the search did not converge, or the draws are too few to use.",
    f"""
{records.OPTIONS.replace(records.FILE, records.FILES)}
{models.OPTIONS}
--fix NAME=VALUE...  parameter that is not free: n=1 [unit of the parameter]
--free NAME...  parameter that is free, where it is fixed by default
--prior NAME=LOW:HIGH...  flat prior of a parameter, or of sigma: n=1:3 (default: the box of the search) [unit of the
    parameter]
--initial free|rest|still|periodic  state at the first sample (default: chosen by the BIC, or free)
--noise gaussian|quantised|robust  noise of the output; quantised needs --resolution (default: gaussian)
--samples COUNT  effective draws of each parameter [default: 10000]
{SEED}
--out DIR  folder to write into: parameters.csv, samples.csv, corner.svg and posterior.json
{JSON}
""",
    run,
    """
hysim posterior loop.csv --model bouc-wen --out posterior
hysim posterior loop.csv --model play --resolution detect --noise quantised --samples 1000
hysim posterior loop.csv --model bouc-wen --fix n=1 --prior sigma=0.01:0.1 --json
""",
)
