"""`hysim simulate`, `control`, `page`, `c` and `fmu`: what is done with a model in a file."""

from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, runtime_checkable

import hysim as hs
from hysim._basics.atomic import write_all
from hysim.cli import models, options, outputs, records


@runtime_checkable
class _Shaken(Protocol):
    excitation: str


def simulate(
    model: options.ModelIn,
    file: options.RecordIn,
    *,
    settings: records.InputOptions,
    out: options.Table | None = None,
    plot: options.Picture | None = None,
    json: bool = False,
) -> None:
    """Drive a model with the input in a file of your own.

    Simulate a model in free run, and write its signals as columns.

    The columns are t if there is a time, u, y, the memory z of a law and further signals of a plant, those of a
    structure as drift_0, drift_1, ... for its elements and displacement_1, ... for its nodes. An AT2 file of PEER is
    read as the acceleration of the ground in m/s^2; so is, for a plant that its base moves, a file without a column u;
    --unit u=g says the unit if it states none.

    Parameters
    ----------
    out : the columns (default: the standard output)
    plot : draw the loop; of a structure, the loops of its elements
    json : print the columns as JSON, beside a file if --out is used

    Examples
    --------
    hysim simulate law.json drive.csv --out response.csv
    hysim simulate frame.json quake.at2 --out response.csv --plot loops.svg
    hysim simulate law.json loop.csv | hysim plot - --out loop.svg
    """
    from hysim.models.protocols import needs_time
    from hysim.simulation import column_units

    if file.endswith(".json") and model.endswith((".csv", ".tsv", ".txt", ".npz", ".mat", ".h5")):
        raise ValueError(f"the model stands before the record: hysim simulate {file} {model}")
    law, units = models.read(model)
    of_the_ground = isinstance(law, _Shaken) and law.excitation == "base"
    known = {"t": "s", **units} if needs_time(law) else units
    record = models.in_units(records.read_input(settings, file, of_the_ground=of_the_ground), known, file, "tu")
    units |= (settings.units or {}) | {signal: unit for signal, unit in record.units.items() if signal != "y"}
    simulation = models.simulated(law, record, units)
    columns = simulation.columns
    labels = column_units(columns, units)

    def document() -> dict[str, Any]:
        return {"units": labels, "columns": {name: column.tolist() for name, column in columns.items()}}

    files: dict[str | None, Any] = {plot: lambda: outputs.picture_of(simulation)}
    if out is not None or not json:
        path = out or options.STANDARD
        files[path] = lambda: outputs.table(path, columns, labels)
    outputs.write(files, (lambda: "") if json else None, document)


def control(
    model: options.ModelIn,
    *,
    settings: models.DesignOptions,
    out: options.ModelOut | None = None,
    c: options.Source | None = None,
    plot: options.Picture | None = None,
) -> options.Result:
    """Design a controller for a model, and print what it achieves.

    Tune a sampled controller on a model's simulated loop, and measure what it achieves.

    It reduces the hysteresis along a slow triangle and the vibration after a step. Exit code 1: none keeps the bounds.

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

    def code(controller: Any) -> Any:
        return None if c is None else hs.to_c(controller, settings.sample_time, name=Path(c).stem)

    design = designs.designed(model, settings, code)
    written = code(design.controller)
    files: options.Files = {
        out: lambda: outputs.model(design.controller, design.triangle.closed.units),
        c: lambda: written.source,
        c and str(Path(c).with_suffix(".h")): lambda: written.header,
        plot: lambda: designs.picture(design),
    }
    reached = design.tuning is None or design.tuning.success
    return options.Result(files, lambda: designs.text(design), lambda: designs.document(design), reached)


def page(
    model: options.ModelIn,
    *,
    out: options.Page,
    data: options.RecordIn | None = None,
    between: options.Pair | None = None,
    title: str | None = None,
    settings: records.RecordOptions,
) -> None:
    """Write a law with sliders as a page for a browser.

    Write a page on which the loop of a law follows sliders, one HTML file that works offline.

    With --data the measured points are part of it.

    Parameters
    ----------
    out : the page
    data : record to show and to compare with: text with one sample a line, NPZ, NPY, MAT or HDF5
    between : lowest and highest input at the start [unit of u]
    title : heading of the page

    Examples
    --------
    hysim page law.json --out law.html
    hysim page law.json --data loop.csv --out law.html
    """
    law, units = models.read(model)
    record = None if data is None else records.read(settings, data)
    units |= (dict(record.units) if record else {}) | (settings.units or {})
    hs.to_page(law, out, record, between=between, units=units, title=title)


def c(
    model: options.ModelIn,
    *,
    out: options.Source,
    inverse: bool = False,
    sample_time: options.Positive | None = None,
    u0: float | None = None,
) -> None:
    """Write a model, or its inverse, as C99 for the device that it runs on.

    Write a law, a sum, a cascade or a plant as C99 with math.h alone.

    The files are MODEL.h, MODEL.c, and MODEL_main.c, a program that reads inputs, one in each line, and prints outputs.
    A controller that is tuned on the model is written by hysim control --c.

    Parameters
    ----------
    out : the source; the other files stand beside it
    inverse : the inverse of the law: the input that gives a wanted output
    sample_time : time between two samples of a plant, or of a law that depends on time [s]
    u0 : with --inverse, input at which it starts (default: where the law in the file stands) [unit of u]

    Examples
    --------
    hysim c law.json --out law.c
    hysim c law.json --inverse --out inverse.c
    """
    law, _ = models.read_in_seconds(model)
    stem = str(Path(out).with_suffix(""))
    code = hs.to_c(hs.InverseFeedforward(law=law) if inverse else law, sample_time, name=Path(out).stem, u0=u0)
    files: dict[Any, str | bytes] = {f"{stem}.h": code.header, f"{stem}.c": code.source, f"{stem}_main.c": code.main}
    write_all(files)
    print(f"wrote {', '.join(files)}; a program that reads one input in each line is compiled by")
    print(f"  cc -std=c99 -O2 -ffp-contract=off {stem}.c {stem}_main.c -lm -o {stem}")


Platform = Literal["linux", "windows", "mac"]


def _platforms(text: str) -> tuple[str, ...]:
    return () if text == "none" else tuple(name.strip() for name in text.split(","))


def fmu(
    model: options.ModelIn,
    *,
    out: Annotated[str, options.Value("MODEL.fmu", role=options.RESULT)],
    version: Literal["2.0", "3.0"] = "2.0",
    sample_time: options.Positive | None = None,
    name: str | None = None,
    units: options.Units | None = None,
    u0: float | None = None,
    y0: float | None = None,
    platforms: Annotated[tuple[Platform, ...], options.Value("PLATFORMS", _platforms)] | None = None,
) -> None:
    """Write a model as a functional mock-up unit for Simulink, Modelica and other tools.

    Write a model as a functional mock-up unit (FMU) for co-simulation.

    It holds its description, its C sources, and shared libraries. The output is one communication step late.

    Parameters
    ----------
    out : the file to write
    version : version of FMI
    sample_time : time between two samples of a plant or a controller [s]
    name : name of the model, a name in C (default: that of its class)
    units : unit of u or y, such as u=V (default: those in the model's file)
    u0 : input of a law, or command of a controller, before the simulation (default: where the law in the file stands)
        [unit of u]
    y0 : displacement at which a controller starts (default: at rest) [unit of y]
    platforms : linux, windows, mac, with commas between them, for which it holds a shared library, or none (default:
        this machine, if it has a C compiler)

    Examples
    --------
    hysim fmu law.json --out law.fmu
    hysim fmu actuator.json --sample-time 1e-4 --version 3.0 --out actuator.fmu
    """
    law, own = models.read_in_seconds(model)
    labels = {**own, **(units or {})}
    hs.to_fmu(law, out, version, sample_time, name=name, units=labels, platforms=platforms, u0=u0, y0=y0)
