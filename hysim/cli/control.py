"""`hysim control`: a controller for a model in a file, and the achievements of its loop."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import hysim as hs
from hysim.cli import options, outputs

SUCCESS, NOT_WITHIN_BOUNDS = 0, 1
CONTROLLERS = {
    "pid": "with filter and setpoint weight",
    "integral": "integral action alone",
    "notch": "integral action behind a notch at the mode",
    "inverse": "of law, creep and amplifier, without feedback",
    "tracking": "that inverse and integral action",
    "model-following": "that inverse, the mode's, and integral action on the errors of the model",
}
"""Controllers that `--controller` takes."""


@dataclass(kw_only=True)
class DesignOptions:
    """Options of a design.

    plant: stages around the model, which replace its own
    -----
    mode : a resonance behind the law: natural frequency [Hz], damping ratio [1]
    creep : growth in a decade of time [%]
    noise : noise of the sensor [unit of y]
    quantum : step of the sensor's readings [unit of y]
    delay : age of the sensor's readings [s]

    controller
    ----------
    controller :
    sample_time : sample time of the controller [s]
    limits : limits of the command [unit of u] (default: the record's extremes, else none)
    max_sensitivity : largest |1/(1 + L)| at any frequency and slope of the law [1]
    max_voltage_noise : largest voltage noise that the sensor's noise may cause [unit of u]
    vary_mode : keep the bounds also where the mode's frequency is lower or higher by this [%]
    preview : the reference is known ahead, for as long as the inverse needs

    task of the loop
    ----------------
    reference : reference for which the gains are tuned; a text file has times [s] and values [unit of y] in its first
        two columns
    range : range of the triangle [unit of y] (default: the middle 80 % of the range that the limits allow)
    frequency : frequency of the triangle [Hz] (default: 1000 samples, 200 periods of a mode or 20 of a lag a cycle)
    step : step from a quarter of the range, or downwards from three [unit of y] (default: half the range)
    duration : duration of the step [s] (default: until the slowest mode is at rest)
    record : measured loop: its input's extremes are the limits, and its output is compared with the model's
    u : input of the record: name or number of its column (default: u)
    y : output of the record: name or number of its column (default: y)
    """

    mode: options.Mode | None = None
    creep: float | None = None
    noise: float | None = None
    quantum: float | None = None
    delay: float | None = None
    controller: Annotated[str, options.one_of(CONTROLLERS)] = "pid"
    sample_time: float
    limits: options.Pair | None = None
    max_sensitivity: float = 2.0
    max_voltage_noise: float | None = None
    vary_mode: float | None = None
    preview: bool = False
    reference: Annotated[str, options.file("triangle|step|FILE", options.INPUT)] = "triangle"
    range: options.Pair | None = None
    frequency: float | None = None
    step: float | None = None
    duration: float | None = None
    record: options.RecordIn | None = None
    u: options.Column | None = None
    y: options.Column | None = None


def control(
    model: options.ModelIn,
    *,
    settings: DesignOptions,
    out: options.ModelOut | None = None,
    c: options.Source | None = None,
    plot: options.Picture | None = None,
    json: bool = False,
) -> int:
    """Design a controller for a model, and print what it achieves.

    Tune a sampled controller on a model's simulated loop, and measure what it achieves.

    It is measured how far it reduces the hysteresis along a slow triangle and the vibration after a step. Exit code 1:
    no controller within the bounds was found.

    Parameters
    ----------
    out : write the controller; - writes it to the standard output
    c : write it as C99, and its header beside it
    plot : draw the loops and the steps

    Examples
    --------
    hysim control law.json --record loop.csv --sample-time 1e-4
    hysim control law.json --limits 0,100 --sample-time 1e-4 --mode 300,0.02 --controller tracking --out c.json
    hysim control law.json --limits 0,100 --sample-time 1e-4 --controller inverse --c stage.c
    """
    from hysim.cli import designs
    from hysim.models.storage import to_json

    source = Path(c or "")
    header = None if c is None else str(source.with_suffix(".h"))
    if c is not None and source.suffix != ".c":
        raise ValueError(f"C code is a file and its header beside it: call the file .c, got {c}")
    outputs.keep([model, settings.record, settings.reference], [header])

    def code(controller: Any) -> Any:
        return None if c is None else hs.to_c(controller, settings.sample_time, name=source.stem)

    design = designs.designed(model, settings, code)
    written = code(design.controller)
    files: outputs.Files = {
        out: lambda: to_json(design.controller, units=design.units),
        c: lambda: written.source,
        header: lambda: written.header,
        plot: lambda: designs.picture(design),
    }
    outputs.write(files, lambda: designs.text(design), lambda: designs.document(design))
    return SUCCESS if design.tuning is None or design.tuning.success else NOT_WITHIN_BOUNDS
