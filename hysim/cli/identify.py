"""`hysim identify`: the parameters of a model from a record in a file."""

import argparse
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records

if TYPE_CHECKING:
    from hysim.identification import Identification

SUCCESS, NOT_CONVERGED = 0, 1


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "identify",
        help="identify a model on a file of your own",
        description="Identify a model's parameters by its error in free run, and print them with their standard "
        "errors. Exit code 1: the search did not converge.",
    )
    records.add_to(parser)
    models.add_to(parser)
    parser.add_argument(
        "--fix",
        metavar="NAME=VALUE",
        type=_value,
        action="append",
        default=[],
        help="parameter that is not free: n=1 [unit of the parameter]",
    )
    parser.add_argument(
        "--free", metavar="NAME", action="append", default=[], help="parameter to free that is held by default"
    )
    parser.add_argument(
        "--bounds",
        metavar="NAME=LOW:HIGH",
        type=_bounds,
        action="append",
        default=[],
        help="limits: beta=0:2 [unit of the parameter]",
    )
    parser.add_argument(
        "--initial", choices=("free", "rest", "periodic"), help="state at the first sample; else as the family says"
    )
    parser.add_argument(
        "--noise",
        choices=("gaussian", "quantised", "robust"),
        default="gaussian",
        help="what disturbs the output; quantised needs --resolution (default: %(default)s)",
    )
    parser.add_argument(
        "--intervals",
        choices=("linear", "profile", "bootstrap"),
        default="linear",
        help="how the intervals at 95 %% are found (default: %(default)s)",
    )
    parser.add_argument(
        "--cross-validate",
        metavar="loo|cycles|K",
        type=folds,
        help="leave one sample out at a time, one cycle, or one of K blocks",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random starts (default: %(default)s)")
    parser.add_argument("--out", metavar="MODEL.json", help="write the model, - for the standard output")
    parser.add_argument("--plot", metavar="LOOP.svg", help=f"draw the record and the model; {outputs.PICTURE}")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Identify, write the files that are asked for, and print the result."""
    from hysim.identification import identify
    from hysim.models.storage import to_json

    is_taken = outputs.check(
        options.out, inputs=[options.file, options.model], pictures=[options.plot], printed=options.json
    )
    family, record = models.family(options), records.read(options)
    fit = identify(
        family,
        record,
        fixed=dict(options.fix),
        free=tuple(options.free),
        bounds=dict(options.bounds),
        initial=options.initial,
        noise=options.noise,
        intervals=options.intervals,
        cross_validate=options.cross_validate,
        seed=options.seed,
        progress=outputs.progress(),
    )
    texts: dict[str | None, Any] = {options.out: to_json(fit.model, units=record.units)}
    if options.plot:
        run = models.simulated(fit.model, record, dict(record.units))
        texts[options.plot] = outputs.loop(record, run, model=fit.model)
    if not is_taken:
        texts[records.STANDARD] = outputs.to_json(_document(fit)) if options.json else fit.summary() + "\n"
    outputs.write(texts)
    return SUCCESS if fit.success else NOT_CONVERGED


def _document(fit: "Identification") -> dict[str, Any]:
    names = (
        "estimates", "stderr", "intervals", "interval_method", "free_names", "n_parameters", "noise", "sigma",
        "fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic", "whiteness", "seed", "success", "message",
        "warnings",
    )  # fmt: skip
    return {"family": type(fit.model).__name__, **{name: getattr(fit, name) for name in names}}


def _value(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, _number(value, text, "NAME=VALUE")


def _bounds(text: str) -> tuple[str, tuple[float, float]]:
    name, _, interval = text.partition("=")
    low, _, high = interval.partition(":")
    return name, (_number(low, text, "NAME=LOW:HIGH"), _number(high, text, "NAME=LOW:HIGH"))


def _number(value: str, text: str, form: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected {form} with numbers, got {text!r}") from None


def folds(text: str) -> str | int:
    """What `--cross-validate` says."""
    if text not in ("loo", "cycles") and not text.isdigit():
        raise argparse.ArgumentTypeError(f"expected loo, cycles or a number of blocks, got {text!r}")
    return int(text) if text.isdigit() else text
