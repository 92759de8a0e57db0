"""`hysim control`: a controller for a model in a file, and the achievements of its loop."""

from pathlib import Path
from typing import Any

import hysim as hs
from hysim.cli import models, options, outputs


def control(
    model: options.ModelIn,
    *,
    settings: models.DesignOptions,
    out: options.ModelOut | None = None,
    c: options.Source | None = None,
    plot: options.Picture | None = None,
    json: bool = False,
) -> bool:
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

    def code(controller: Any) -> Any:
        return None if c is None else hs.to_c(controller, settings.sample_time, name=Path(c).stem)

    design = designs.designed(model, settings, code)
    written = code(design.controller)
    files: outputs.Files = {
        out: lambda: to_json(design.controller, units=design.units),
        c: lambda: written.source,
        c and str(Path(c).with_suffix(".h")): lambda: written.header,
        plot: lambda: designs.picture(design),
    }
    outputs.write(files, lambda: designs.text(design), lambda: designs.document(design))
    return design.tuning is None or design.tuning.success
