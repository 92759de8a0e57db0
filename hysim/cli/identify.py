"""`hysim identify`: the parameters of a model from a record in a file."""

import argparse
from typing import TYPE_CHECKING, Any

from hysim.cli import models, outputs, records, sensors
from hysim.cli.options import JSON, MODEL_OUT, SEED, Command

if TYPE_CHECKING:
    from hysim.plot import Figure

SUCCESS, NOT_CONVERGED = 0, 1
ADMISSIBLE = {None: None, "yes": True, "no": False}


def run(options: argparse.Namespace) -> int:
    """Identify, write the files that are asked for, and print the result."""
    from hysim.identification import identify
    from hysim.models.storage import to_json
    from hysim.simulation import simulate

    model = models.to_identify(options)
    if options.others and (options.weights is not None or options.sensor or options.y_file is not None):
        raise ValueError("--weights, --sensor and --y-file are for one file: leave out the others, or use Python")
    record, weights = records.read_with_weights(options)
    others = [records.read(options, file) for file in options.others]
    measured: Any = sensors.of_structure(model, record, dict(options.sensor)) if options.sensor else record
    fit = identify(
        model,
        [measured, *others] if others else measured,
        fixed=dict(options.fix),
        free=tuple(options.free),
        bounds=dict(options.bounds),
        depends=dict(options.depends) or None,
        weights=weights,
        admissible=ADMISSIBLE[options.admissible],
        **outputs.fields_of(options, ("initial", "noise", "intervals", "cross_validate", "max_evaluations", "seed")),
    )
    names = (
        "estimates", "stderr", "intervals", "interval_method", "free_names", "n_parameters", "noise", "sigma",
        "fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic", "whiteness", "seed", "success", "message",
        "warnings", "unsafe",
    )  # fmt: skip

    def picture() -> "Figure":
        if options.sensor:  # the record of one sensor is not the output of the structure
            return outputs.picture_of(simulate(fit, record.t, record.u))
        return outputs.loop(record, fit)

    files: outputs.Files = {options.out: lambda: to_json(fit, units=record.units), options.plot: picture}
    family = {"family": type(fit.model).__name__}
    outputs.write(options, files, fit.summary, lambda: family | outputs.fields_of(fit, names))
    return SUCCESS if fit.success else NOT_CONVERGED


COMMAND = Command(
    "identify",
    "identify a model on a file of your own",
    "Identify a model's parameters by its error in free run, and print them with their standard errors. Exit code 1: "
    "the search did not converge, or the law is unsafe on smaller cycles.",
    f"""
{records.OPTIONS_WITH_WEIGHTS.replace(records.FILE, records.FILES)}
{models.OPTIONS}
--sensor SENSOR=COLUMN...  what a sensor on a structure measured, by the names of hysim simulate, and its column:
    drift_0, or acceleration_2=roof (default: the structure's own output, in the column --y)

--fix NAME=VALUE...  parameter that is not free: n=1 [unit of the parameter]
--free NAME...  parameter that is free, where it is fixed by default
--bounds NAME=LOW:HIGH...  bounds of a parameter: beta=0:2 [unit of the parameter]
--depends NAME=CHANNEL:DEGREE...  parameter that is a polynomial in a channel: gain=T:1
--initial free|rest|still|periodic  state at the first sample (default: chosen by the BIC, or free)
--noise gaussian|quantised|robust  noise of the output; quantised needs --resolution (default: gaussian)
--intervals linear|profile|bootstrap  method of the 95 % intervals [default: linear]
--cross-validate loo|cycles|K  leave out one sample at a time, one cycle, or one of K blocks
--max-evaluations N  most parameter sets that the search simulates; a fit that ends by it is partial
--admissible yes|no  whether the law must be safe on smaller cycles, whatever its fit (default: where noise and creep
    allow the loss of fit)
{SEED}
{MODEL_OUT}
--plot LOOP.svg  draw the record and the model
{JSON}
""",
    run,
    """
hysim identify loop.csv --model polynomial-bouc-wen --out law.json --plot fit.svg
hysim identify loop.csv --u voltage --y displacement --model bouc-wen --fix n=1
hysim identify drive.csv --y-file sensor.csv --model prandtl-ishlinskii --plays 8
hysim identify test.csv --model oscillator --excitation base
hysim identify quake.csv --model frame.json --free damping --sensor acceleration_2
""",
)
