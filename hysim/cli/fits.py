"""`hysim identify`, `posterior`, `compare` and `discover`: from records in files to models."""

import functools
import inspect
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import click

import hysim as hs
from hysim.cli import models, options, outputs, records
from hysim.errors import Interrupted

_FOLDER = ("parameters.csv", "samples.csv", "corner.svg", "posterior.json")
_IDENTIFIED = (
    "estimates", "stderr", "intervals", "interval_method", "free_names", "n_parameters", "noise", "sigma",
    "fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic", "whiteness", "seed", "success", "message",
    "warnings", "unsafe",
)  # fmt: skip


@dataclass(kw_only=True)
class IdentifyOptions(models.FitOptions):
    """Options of `identify` alone.

    Parameters
    ----------
    model :
    bounds : bounds of a parameter: beta=0:2 [unit of the parameter]
    depends : parameter that is a polynomial in a channel: gain=T:1
    seconds : time of the processor for the families that are tried without --model [s]
    intervals : method of the 95 % intervals
    cross_validate : leave out one sample at a time, one cycle, or one of K blocks
    max_evaluations : most parameter sets that the search simulates; a fit that ends by it is partial
    admissible : whether the law must be safe on smaller cycles, whatever its fit (default: where noise and creep allow
        the loss of fit)
    """

    model: models.ToIdentify | None = None  # type: ignore[assignment]
    seconds: float = 30.0
    bounds: options.Ranges | None = None
    depends: options.Depends | None = None
    intervals: Literal["linear", "profile", "bootstrap"] = "linear"
    cross_validate: options.Folds | None = None
    max_evaluations: int | None = None
    admissible: options.YesNo | None = None


def identify(
    file: options.RecordIn,
    others: tuple[options.RecordIn, ...] = (),
    *,
    settings: records.WeighedOptions,
    fit: IdentifyOptions,
    out: options.ModelOut | None = None,
    plot: options.Picture | None = None,
) -> options.Result:
    """Identify a model on a file of your own.

    Identify a model's parameters by its error in free run, and print them with their standard errors. Without --model
    the family is chosen, too.

    Exit code 1: the search did not converge, or the law is unsafe on smaller cycles.

    Parameters
    ----------
    others : further records with the same columns, such as those of other rates
    out : write the model; - writes it to the standard output
    plot : draw the records and the model

    Examples
    --------
    hysim identify loop.csv
    hysim identify loop.csv --model polynomial-bouc-wen --out law.json --plot fit.svg
    hysim identify loop.csv --u voltage --y displacement --model bouc-wen --fix n=1
    hysim identify drive.csv --y-file sensor.csv --model prandtl-ishlinskii --plays 8
    hysim identify test.csv --model oscillator --excitation base
    hysim identify quake.csv --model frame.json --free damping --sensor acceleration_2
    """
    subject = models.to_identify(fit)
    if others and (settings.weights is not None or settings.sensor or settings.y_file is not None):
        raise ValueError("--weights, --sensor and --y-file are for one file: leave out the others, or use Python")
    record, weights = records.read_with_weights(settings, file)
    measured: Any = records.of_structure(subject, record, settings.sensor) if settings.sensor else record
    if others:
        measured = [record, *(records.read(settings, path) for path in others)]
    subjects = (measured,) if subject is None else (subject, measured)
    result = hs.identify(*subjects, weights=weights, **options.taken(hs.identify, fit))

    def picture() -> Any:
        if settings.sensor:  # the record of one sensor is not the output of the structure
            return outputs.picture_of(hs.simulate(result, record.t, record.u))
        if not others:
            return outputs.on_axes(hs.plot.loop, record, result)

        def draw(panels: Any) -> None:
            for each, model, ax in zip(measured, result.models, panels, strict=True):
                hs.plot.loop(each, model, ax=ax)

        return outputs.in_panels(len(measured), draw)

    def document() -> dict[str, Any]:
        return {"family": type(result.model).__name__, **outputs.fields_of(result, _IDENTIFIED)}

    files: options.Files = {out: lambda: outputs.model(result, record.units), plot: picture}
    return options.Result(files, result.summary, document, bool(result.success))


def posterior(
    file: options.RecordIn,
    others: tuple[options.RecordIn, ...] = (),
    *,
    settings: records.RecordOptions,
    fit: models.FitOptions,
    priors: options.Ranges | None = None,
    samples: options.Count = 10000,
    out: str | None = None,
) -> options.Result:
    """Draw the distribution of a model's parameters given a file.

    Identify a model, draw its parameters from their posterior distribution, and print medians and intervals at 95 %.

    It needs the extra bayes. Exit code 1: the search did not converge, or the draws are too few to use.

    Parameters
    ----------
    others : further records with the same columns, such as those of other rates
    priors : flat prior of a parameter, or of sigma: n=1:3 (default: the box of the search) [unit of the parameter]
    samples : effective draws of each parameter
    out : folder to write into: parameters.csv, samples.csv, corner.svg and posterior.json

    Examples
    --------
    hysim posterior loop.csv --model bouc-wen --out posterior
    hysim posterior loop.csv --model play --resolution detect --noise quantised --samples 1000
    hysim posterior loop.csv --model bouc-wen --fix n=1 --prior sigma=0.01:0.1 --json
    """
    from hysim._basics.printing import csv_text

    subject = models.to_identify(fit)
    measured: Any = [records.read(settings, path) for path in (file, *others)]
    measured = measured if others else measured[0]
    paths = [] if out is None else [str(Path(out, name)) for name in _FOLDER]
    outputs.keep([file, *others, fit.model], paths)
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
    result = hs.identify(subject, measured, **options.taken(hs.identify, fit))
    chosen = options.taken(hs.sample_posterior, fit)
    draws = hs.sample_posterior(result, measured, priors=priors or {}, samples=samples, **chosen)
    rows = draws.rows()
    conditions = outputs.fields_of(draws, ("noise", "resolution", "priors", "n_evaluations", "seed", "warnings"))
    document = {"family": type(draws.model).__name__, "parameters": rows, **conditions}
    n = len(draws.names)
    side = max(1.25 * n, 4.0)  # inches, of a panel 1.25
    contents = (
        lambda: csv_text([rows[0], *(row.values() for row in rows)]),
        draws.to_csv,
        lambda: outputs.drawn(lambda canvas: hs.plot.corner(draws, axes=canvas.subplots(n, n)), side, side),
        lambda: outputs.to_json(document),
    )
    files: options.Files = dict(zip(paths, contents, strict=bool(paths)))
    return options.Result(files, draws.summary, lambda: document, bool(result.success) and not draws.warnings)


def compare(
    file: options.RecordIn,
    *,
    settings: records.RecordOptions,
    model: tuple[models.ToCompare, ...] = (),
    cross_validate: options.Folds | None = None,
    test: options.RecordIn | None = None,
    test_cycles: int | None = None,
    max_evaluations: int | None = None,
    seed: int = 0,
    csv: options.ResultFile | None = None,
    markdown: options.ResultFile | None = None,
    latex: options.ResultFile | None = None,
    out: options.ModelOut | None = None,
    plot: options.Picture | None = None,
) -> options.Result:
    """Compare models on a file of your own.

    Identify models on a record, all by the same protocol, and print them side by side.

    Beside them stands what the record cannot decide.

    Parameters
    ----------
    model : name of a family, such as bouc-wen; MODEL.json; or module:name of your own, which executes ./module.py or an
        installed module; once or more (default: all families)
    cross_validate : leave out one sample at a time, one cycle, or one of K blocks (default: loo up to 200 samples, then
        10)
    test : another record with the same columns, for the test only
    test_cycles : keep the last N cycles for the test
    max_evaluations : most parameter sets that the search of each model simulates; a fit that ends by it is partial
    csv : write the table; - writes it to the standard output, so too with the next two options
    markdown : write the table in Markdown
    latex : write the table in LaTeX
    out : write the model that predicts best, as identify does
    plot : draw the best models

    Examples
    --------
    hysim compare loop.csv
    hysim compare loop.csv --model bouc-wen --model preisach --model law.json --test-cycles 1
    hysim compare loop.csv --csv table.csv --plot loops.svg --out best.json
    """
    options.exclusive(test=test, test_cycles=test_cycles)
    record = records.read(settings, file)
    kept: Any = test_cycles if test is None else records.read(settings, test, uncut=True)
    subjects: dict[str, Any] = {}
    for name in model:
        subjects |= _subjects(name)
        record = models.in_units(record, models.read(name)[1] if name.endswith(".json") else {}, file)
    try:
        table = hs.compare(
            subjects or None, record, cross_validate=cross_validate or "auto", test=kept, seed=seed,
            max_evaluations=max_evaluations,
        )  # fmt: skip
    except Interrupted as interrupt:
        if not click.get_current_context().params["json"]:
            print(interrupt.finished.to_text())
        raise
    rows = min(4, len(table.rows))

    def draw(canvas: Any) -> None:
        hs.plot.comparison(table, axes=hs.plot.panels(canvas, 3 * rows, columns=3))

    files: options.Files = {
        out: lambda: _best(table),
        csv: table.to_csv,
        markdown: lambda: table.to_markdown() + "\n",
        latex: lambda: table.to_latex() + "\n",
        plot: lambda: outputs.drawn(draw, 9.0, 2.2 * rows),
    }
    return options.Result(files, table.to_text, lambda: _document(table))


def _subjects(name: str) -> dict[str, Any]:
    from hysim.models.model import candidates_named

    model = models.model_or_family(name)
    if name.endswith(".json") or models.is_import_path(name):
        return {models.name_of(name): model}
    of_family = candidates_named(model.__name__)
    return of_family if len(of_family) > 1 else dict.fromkeys([name], *of_family.values())


def _best(table: "hs.Comparison") -> str:
    """The model that predicts best; if no errors of prediction are known, the one with the smallest rmse."""
    ranked = table.ranked() or table.ranked("rmse")
    if not ranked:
        raise ValueError(f"no model could be compared: {'; '.join(table.failed.values())}")
    return outputs.model(ranked[0].model, table.record.units)


def _document(table: "hs.Comparison") -> dict[str, Any]:
    fields = ("rmse_ratio", "typical_ratio", "probability", "diverged")
    contrasts = {each.name: outputs.fields_of(each, fields) for each in table.contrasts}
    rows = [outputs.scalars(row) | contrasts.get(row.name, dict.fromkeys(fields)) for row in table.rows]
    verdict = outputs.fields_of(table, ("winner", "undecided", "verdict", "warnings"))
    return {"record": table.record.name, "units": table.record.units, **verdict, "rows": rows, "failed": table.failed}


@dataclass(kw_only=True)
class DiscoverOptions:
    """Options of `discover` alone.

    Parameters
    ----------
    route : meaning of the output: the memory, a feedthrough and a memory, or the displacement of an oscillator; auto
        tries the first two
    library : bouc-wen, duhem, or terms with commas between them: "u',|u'| z,u' |z|"
    degree : largest degree of the library's monomials; 2 by default, of an oscillator's 3
    symmetry : symmetry of the response; only odd for an oscillator
    mass : mass of an oscillator, if it is known [units of u s^2/y]
    damping : damping of an oscillator, if it is known [units of u s/y]
    stiffness : stiffness of an oscillator, if it is known [units of u/y]
    cross_validate : repeat the whole search without one sample at a time, or one of K blocks; not for an oscillator
    initial : whether the memory begins at a value of its own or at zero; by default the BIC decides
    seed :
    """

    route: Literal["auto", "memory", "output", "oscillator"] = "auto"
    library: options.Terms | None = None
    degree: int | None = None
    symmetry: Literal["odd", "even"] | None = None
    mass: float | None = None
    damping: float | None = None
    stiffness: float | None = None
    cross_validate: options.Blocks | None = None
    initial: Literal["auto", "free", "rest"] | None = None
    seed: int = 0


def discover(
    file: options.RecordIn,
    *,
    settings: records.RecordOptions,
    search: DiscoverOptions,
    out: options.ModelOut | None = None,
    plot: options.Picture | None = None,
) -> options.Result:
    """Find the law of the memory in a file of your own.

    Find the law of a memory by sparse regression (PySINDy) and free runs, and print it with its verdict.

    The verdict is hysteresis, a linear lag, or that records of one rate cannot decide.

    Parameters
    ----------
    out : write the model; - writes it to the standard output
    plot : draw the record and the law

    Examples
    --------
    hysim discover loop.csv --plot law.svg
    hysim discover test.csv --route oscillator --mass 2.5
    """
    used = {name: value for name, value in vars(search).items() if value is not None}
    route = used.pop("route")
    is_oscillator = route == "oscillator" or (route == "auto" and bool(used.keys() & {"mass", "damping", "stiffness"}))
    verb: Any = hs.discover_oscillator if is_oscillator else functools.partial(hs.discover, route=route)
    if unused := used.keys() - {"seed", *inspect.signature(verb).parameters}:
        user = "an oscillator" if is_oscillator else f"--route {route}"
        raise ValueError(f"{' and '.join(map(options.flag, sorted(unused)))} is not used by {user}: leave it out")
    record = records.read(settings, file)
    result = verb(record, **used)
    model = result.model
    files: options.Files = {
        out: lambda: outputs.model(model, record.units),
        plot: lambda: outputs.on_axes(hs.plot.loop, record, model),
    }
    unwritten = [name for name, path in (("--out", out), ("--plot", plot)) if path and model is None]
    if unwritten:
        files = {path: lambda: "" for path in files if path == options.STANDARD}
        print(f"hysim: {' and '.join(unwritten)} not written: {result.warnings[0]}", file=sys.stderr)
    return options.Result(files, result.summary, lambda: json.loads(result.to_json()), not unwritten)
