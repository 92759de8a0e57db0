"""`hysim example`, `explore`, `reproduce`, `completion` and `warm-up`: what helps to learn and to set up."""

import os
import shlex
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import click
from click.shell_completion import get_completion_class

import hysim as hs
from hysim._basics.progress import Progress, announced_by, reports
from hysim.cli import options, outputs

_SEED = 1


class Device(NamedTuple):
    """A device whose record is written: what it is, the record, and commands to try on the file."""

    what: str
    record: "Callable[[], hs.Record]"
    tries: tuple[str, ...]


def _damper() -> "hs.Record":
    """Cycles of growing amplitude on a steel damper, whose load cell has noise."""
    import numpy as np

    cycle = np.sin(np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False))
    u = np.append(np.outer((2.0, 4.0, 6.0, 8.0, 10.0, 10.0), cycle), 0.0)
    law = hs.BoucWen(A=1.0, beta=0.35, gamma=0.15, n=1.5, feedthrough=1.2, gain=18.0)
    y = law.response(u) + 0.1 * np.random.default_rng(_SEED).standard_normal(u.size)
    units = {"t": "s", "u": "mm", "y": "kN"}
    return hs.Record(t=0.1 * np.arange(float(u.size)), u=u, y=y, units=units, name="steel damper, simulated")


def _magnet() -> "hs.Record":
    """First-order reversal curves of relays with two bells of thresholds."""
    import numpy as np

    edges = np.linspace(-100.0, 100.0, 41)
    law = hs.Preisach.from_density(edges, lambda a, b: np.exp(-((a + b) ** 2) / 800.0 - ((a - b - 80.0) ** 2) / 1800.0))
    u = hs.signals.reversal_curves(-100.0, 100.0, curves=20, samples_per_step=2)
    y = law.response(u)
    return hs.Record(u=u, y=1.5 * y / np.abs(y).max(), units={"u": "kA/m", "y": "T"}, name="magnet, simulated")


DEVICES = {
    "piezo": Device(
        "voltages and displacements measured on a piezo stack",
        lambda: hs.datasets.table1(dwell=1.0),
        ("metrics {}", "identify {} --model polynomial-bouc-wen --plot fit.svg"),
    ),
    "damper": Device(
        "simulated test of a steel damper, displacements and forces in cycles of growing amplitude",
        _damper,
        ("metrics {} --cycles", "identify {} --model bouc-wen --plot fit.svg"),
    ),
    "magnet": Device(
        "simulated first-order reversal curves of a magnet, fields and flux densities",
        _magnet,
        ("plot {} --kind minor-loops --out loops.svg", "plot {} --kind forc --out forc.svg"),
    ),
}
"""Devices that `--device` takes."""


Kind = Annotated[str, options.one_of({name: device.what for name, device in DEVICES.items()})]


def _notebook(path: Path) -> str:
    """Text of the notebook with the name of `path`, from a wheel or from a checkout."""
    package = Path(hs.__file__).parent
    folder = next(filter(Path.is_dir, (package / "data" / "notebooks", package.parent / "docs" / "notebooks")))
    if not (source := folder / path.name).is_file():
        known = ", ".join(sorted(each.name for each in folder.iterdir()))
        raise ValueError(f"the notebooks are {known}, got {path.name}")
    return source.read_text(encoding="utf-8")


def example(path: options.ResultFile | None = None, *, device: Kind = "piezo") -> None:
    """Write a file to try the other commands on, or a notebook.

    Write a record as a file like one of your own, or a notebook of Jupyter.

    The piezo's 52 samples were measured for a paper of 2016, which prints no times: one second a sample is an
    assumption. The other devices are simulated. The notebooks are first_fit, discover, compensate and study.

    Parameters
    ----------
    path : file to write, a table or a notebook (default: the device's name with the ending .csv)

    Examples
    --------
    hysim example
    hysim example damper.csv --device damper
    hysim example curves.mat --device magnet
    hysim example first_fit.ipynb
    """
    out = path or f"{device}.csv"
    if out != options.STANDARD and os.path.exists(out):
        raise ValueError(f"{out} is there already: give another name, as in hysim example mine.csv")
    if out.endswith(".ipynb"):
        notebook = _notebook(Path(out))
        opened = f"jupyter lab {shlex.quote(out)}"
        return outputs.write({out: lambda: notebook}, lambda: f"{out}: a notebook, to open as in: {opened}")
    what, make, tries = DEVICES[device]
    record = make()
    columns = {name: values for name in "tuy" if (values := vars(record)[name]) is not None}
    content = outputs.table(out, columns, record.units, resolution=record.resolution, name=record.name)
    names = ", ".join(f"{name} [{record.units[name]}]" for name in columns)
    lines = [f"{out}: {len(record)} samples of {names}: {what}. Try:", *(f"  hysim {each}" for each in tries)]
    return outputs.write({out: lambda: content}, lambda: "\n".join(lines).replace("{}", shlex.quote(out)))


def explore(*, out: options.Page | None = None, no_browser: bool = False) -> None:
    """Play with the families of laws in a browser.

    Open a page with a choice of families and devices, whose loops follow sliders. It works offline.

    Parameters
    ----------
    out : write the page to this file (default: a temporary one)
    no_browser : write it, and open no browser

    Examples
    --------
    hysim explore
    hysim explore --no-browser --out explorer.html
    """
    import webbrowser

    from hysim.export import explorer

    page = explorer(Path(tempfile.mkdtemp(prefix="hysim-"), "explorer.html") if out is None else Path(out))
    print(page)
    if not no_browser:
        webbrowser.open(page.resolve().as_uri())


def reproduce(
    *, out: str = "reproduction", quick: bool = False, thorough: bool = False, page: bool = False, json: bool = False
) -> bool:
    """Rebuild the paper's results and write a report.

    Identify, discover and compare models on the 52 voltage-displacement points of the paper.

    The folder holds report.html, summary.json, figures and tables.

    Parameters
    ----------
    out : folder to write into
    quick : skip the cross-validation
    thorough : search all controllers without their stored optima, and write these as optima.json
    page : also write table1.html, a page for a browser: the identified Bouc-Wen law with sliders over the 52 points
    json : print summary.json instead of the short table

    Examples
    --------
    hysim reproduce --quick
    hysim reproduce --out report --page
    """
    from hysim import paper

    result = paper.reproduce(out, quick=quick, page=page, thorough=thorough)
    if json:
        print((result.folder / "summary.json").read_text(encoding="utf-8"), end="")
    else:
        print(result)
    return all(fit.success for fit in result.findings.study.fits.values())


def completion(shell: Literal["bash", "zsh", "fish"]) -> None:
    """Write a script by which a shell completes commands and options.

    Write a script for a shell to the standard output.

    For the running shell: source <(hysim completion bash), or hysim completion fish | source; for all: write it to a
    file where the shell looks for such scripts.

    Parameters
    ----------
    shell : shell

    Examples
    --------
    hysim completion bash
    hysim completion fish
    """
    kind: Any = get_completion_class(shell)
    print(kind(click.get_current_context().find_root().command, {}, "hysim", "_HYSIM_COMPLETE").source())


def calls() -> dict[str, Callable[[], object]]:
    """Short calls that compile what most first calls need, by their names."""
    import numpy as np

    from hysim.kernels.stepping import signed
    from hysim.models.model import candidates
    from hysim.models.protocols import Invertible, needs_time
    from hysim.plants.oscillator_structure import METHODS

    u, record = np.sin(np.linspace(0.0, 13.0, 200)), hs.datasets.table1()
    t = 0.01 * np.arange(u.size)
    law = hs.BoucWen(n=1.5, feedthrough=1.0)
    frame = hs.shear_frame([1.0, 1.0], laws=[law, law], damping=hs.ModalDamping(ratio=0.03))
    stage = hs.Actuator(
        hysteresis=law, creep=hs.Creep(time_constants=(1.0,), weights=(0.1,)), vibration=hs.mode(20.0, 0.1)
    )
    follow = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), feedback=hs.PID(ki=1.0))
    learn = hs.AdaptiveInverse(law=law, free=("gain",), drift=(0.1,), noise=0.01)

    def one(family: Any) -> None:
        low, high = family.example.between
        model = family(**family.example.fields)
        time = [t[1]] * needs_time(model)
        y = model.response(low + (high - low) * (0.5 + 0.5 * u), *time)
        if isinstance(model, Invertible) and model.inverse_response is not None:
            with suppress(ValueError, hs.SimulationError):  # of a law that has no inverse for this output
                model.inverse_response(y, *time)

    plant = partial(hs.BoucWenOscillator, mass=1.0, damping=0.1, stiffness=1.0, law=law)
    every: dict[str, Callable[[], object]] = {name: partial(one, family) for name, family in hs.families().items()}
    every |= {f"oscillator, {each}": partial(plant(method=each).response, u, 0.1) for each in METHODS}
    every |= {
        f"identify {name}": partial(hs.identify, each, record, max_evaluations=1) for name, each in candidates().items()
    }
    return every | {
        "responses": lambda: hs.BoucWen.responses({"n": [1.0, 1.5, 2.0]}, u),
        "frame": lambda: hs.simulate(frame, t, u),
        "closed loop": lambda: [hs.close_loop(stage, each, t, u) for each in (follow, learn)],
        "laws in loops": lambda: [compiled() for compiled in signed],
    }


@reports
def compilation(progress: Progress | None = None) -> int:
    every = calls()
    announce = announced_by(progress) or (lambda _: None)
    for k, (name, call) in enumerate(every.items()):
        announce(name)
        if progress is not None:
            progress(k, len(every))
        call()
    return len(every)


def warm_up() -> None:
    """Compile in advance what first calls would compile.

    Make short calls of most functions, which takes minutes; their code is kept on disk for later processes.

    Examples
    --------
    hysim warm-up
    """
    print(f"{compilation()} calls have been compiled")
