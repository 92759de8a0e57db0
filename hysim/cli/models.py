"""Models of the command line: families by name, models in files, and laws of the user by import path."""

import inspect
import os
import pkgutil
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import hysim as hs
from hysim._basics.names import MODULE_OF
from hysim.cli import options

_PLANTS = ("oscillator", "actuator")
_OPTIONS = {
    "elements": "plays", "intervals": "relay_intervals", "hysteresis": "law", "amplifier": "first_order_amplifier",
}  # fmt: skip
"""Arguments of a structure whose option has another name, and that name."""


_NEEDED = ("poles", "zeros", "degree")
_OF_ACTUATOR: dict[str, Any] = {"hysteresis": "bouc-wen", "creep": False, "delay": False}


def names() -> list[str]:
    """Names of all families that can be compared without further arguments; loads every family."""
    from hysim.models.model import candidates

    return _short(name.split()[0] for name in candidates() if name.split()[0] in hs.__all__)


def names_to_identify() -> list[str]:
    """Names of all models that `hysim identify` takes: those to compare, further laws and plants."""
    from hysim.models.model import is_identifiable

    laws = _short(name for name, law in hs.families().items() if is_identifiable(law))
    return [*dict.fromkeys([*names(), *laws, *_PLANTS])]


def _offered() -> list[str]:
    """Names of laws and plants for a shell to complete, which are known without loading a family."""
    laws = [name for name, module in MODULE_OF.items() if module.startswith("hysim.laws.") and name[0].isupper()]
    return [*map(_hyphenated, laws), "transfer-function", *_PLANTS]


def _short(families: Iterable[str]) -> list[str]:
    """The names of families on the command line, short where they have a short one; loads every family."""
    from hysim.models.model import short_names

    short = {family: name for name, family in short_names().items()}
    return [short.get(name, _hyphenated(name)) for name in dict.fromkeys(families)]


def _hyphenated(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", name).lower()


_FORMS = f"name of a family, such as bouc-wen; MODEL.json, as that of a structure; or {options.OWN}"
ToCompare = Annotated[str, options.Value("MODEL", role=options.INPUT, offers=_offered, help=_FORMS, models=names)]
ToIdentify = Annotated[
    str, options.Value("MODEL", role=options.INPUT, offers=_offered, help=_FORMS, models=names_to_identify)
]
Law = Annotated[str, options.Value("MODEL", offers=_offered)]


@dataclass(kw_only=True)
class StructureOptions:
    """Options of the structure of other models.

    structure of the model
    ------
    plays : number of plays, or of a Maxwell-slip model's elements
    relay_intervals : number of intervals between the levels of a Preisach model
    smoothness : strength of the penalty on a Preisach model's density, auto for the best
    one_signed : whether the weights of plays or relays have one sign (default: chosen by the BIC)
    degree : degree of a Duhem law's polynomials

    transfer function
    ------
    poles : number of poles
    zeros : number of zeros, at most that of the poles
    sample : whether an output was read at the start or at the end of the hold

    transfer function and oscillator
    ------
    hold : input between samples: held (zoh), linear (foh), or of an oscillator the sum of the lines below half the
        record's rate

    oscillator: the model oscillator, a mass on a Bouc-Wen spring
    ------
    oversampling : steps of the simulation between two samples
    period : samples of a period, with --initial periodic
    excitation : whether the input is a force, or the acceleration of the base

    actuator: the model actuator, from records of several rates
    ------
    law : law of the actuator, as --model (default: bouc-wen)
    modes : number of resonances, 0 to 3 (default: 1)
    creep : creep that grows by so many percent a decade
    creep_elements : creep of so many log-spaced elements
    delay : a dead time
    first_order_amplifier : a time constant before the law
    """

    plays: options.Count | None = None
    relay_intervals: options.Count | None = None
    smoothness: options.Smoothness | None = None
    one_signed: options.YesNo | None = None
    degree: options.Count | None = None
    poles: int | None = None
    zeros: int | None = None
    sample: Literal["start", "end"] | None = None
    hold: Literal["zoh", "foh", "band-limited"] | None = None
    oversampling: int | None = None
    period: int | None = None
    excitation: Literal["force", "base"] | None = None
    law: Law | None = None
    modes: int | None = None
    creep: bool = False
    creep_elements: int | None = None
    delay: bool = False
    first_order_amplifier: bool = False


@dataclass(kw_only=True)
class FitOptions(StructureOptions):
    """Options of a model to identify.

    Parameters
    ----------
    model :
    fixed : parameter that is not free: n=1 [unit of the parameter]
    free : parameter that is free, where it is fixed by default
    initial : state at the first sample (default: chosen by the BIC, or free)
    noise : noise of the output; quantised needs --resolution (default: gaussian)
    seed :
    """

    model: ToIdentify
    fixed: options.Fixed | None = None
    free: tuple[str, ...] = ()
    initial: Literal["free", "rest", "still", "periodic"] | None = None
    noise: Literal["gaussian", "quantised", "robust"] | None = None
    seed: int = 0


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
    sample_time: options.Positive
    limits: options.Pair | None = None
    max_sensitivity: float = 2.0
    max_voltage_noise: float | None = None
    vary_mode: options.Percent | None = None
    preview: bool = False
    reference: Annotated[str, options.Value("triangle|step|FILE", role=options.INPUT)] = "triangle"
    range: options.Pair | None = None
    frequency: options.Positive | None = None
    step: float | None = None
    duration: options.Positive | None = None
    record: options.RecordIn | None = None
    u: options.Column | None = None
    y: options.Column | None = None


def family(name: str) -> Any:
    """The family with a name such as ``bouc-wen``; a ValueError that lists the names if it is unknown."""
    from hysim.models.model import family_named

    if name == "structure":
        raise ValueError("a structure has no default: give one in a file, MODEL.json, which hs.save writes")
    try:
        return family_named("BoucWenOscillator" if name == "oscillator" else name)
    except ValueError:
        known = names_to_identify()
        near = options.suggestion(name, known) or f"give one of {', '.join(known)}"
        words = f"there is no model {name!r}: {near} (models of your own: MODEL.json or module:name)"
        raise ValueError(words) from None


def resolved(path: str) -> Any:
    """The object at an import path, `module:name`, the current folder included; ValueError if it is not found."""
    folder = os.getcwd()
    if folder not in sys.path:
        sys.path.insert(0, folder)  # as `python -m hysim` has it
    try:
        return pkgutil.resolve_name(path)
    except (ModuleNotFoundError, AttributeError) as error:
        places = f"modules are looked for in {folder} and among the installed packages"
        raise ValueError(f"{path} is not there: {error}; {places}") from None


def is_import_path(text: str) -> bool:
    return bool(re.fullmatch(r"[^\W\d]\w*(\.\w+)*:\w+(\.\w+)*", text)) and not Path(text).exists()


def imported(path: str) -> Any:
    """The family or model at an import path; a ValueError if there is no such name, or it is no law."""
    from hysim.models.model import is_identifiable
    from hysim.models.protocols import Responding

    law = resolved(path)
    if not (isinstance(law, Responding) or is_identifiable(law)):
        raise ValueError(f"{path} is no law: expected a model, or a class of models, with a response; got {law!r}")
    return law


def model_or_family(text: str) -> Any:
    """The family or model that ``--model`` names: a family's name, a JSON file, or an import path."""
    if Path(text).suffix == ".json":
        return read(text)[0]
    if is_import_path(text):
        return imported(text)
    if Path(text).is_file():
        raise ValueError(f"the file {text} is no model: give the name of a family, or of a model file, MODEL.json")
    return family(text)


def to_identify(chosen: FitOptions) -> Any:
    """The argument of `identify`, None without --model; `initial` becomes None where the structure takes it."""
    name: str | None = chosen.model
    used = {each.name: value for each in fields(StructureOptions) if (value := vars(chosen)[each.name]) != each.default}
    if name is None:
        for each in used:
            raise ValueError(f"{options.flag(each)} is an option of one model: give --model, too")
        return None
    model = model_or_family(name)
    kind = model if isinstance(model, type) else type(model)
    is_oscillator = kind.__name__ == "BoucWenOscillator"
    if is_oscillator and model is not kind:  # its numbers are searched anew, in the same setting
        used = {"excitation": model.excitation, "hold": model.hold} | used
        model = kind
    taken = _arguments(model)
    for each in used:
        if each not in taken:
            others = [other for other in names_to_identify() if each in _arguments(family(other))]
            raise ValueError(f"{options.flag(each)} is no option of the model {name}, but of {', '.join(others)}")
    for each in _NEEDED:
        if each in taken and each not in used:
            raise ValueError(f"the model {name} needs {options.flag(each)}")
    structure = {taken[each]: value for each, value in used.items()}
    if is_oscillator and chosen.initial is not None:
        structure["initial"], chosen.initial = chosen.initial, None  # its structure says how the record begins
    if model is hs.Actuator:
        structure = _OF_ACTUATOR | structure
        structure["hysteresis"] = model_or_family(structure["hysteresis"])
        structure["amplifier"] = "first-order" if chosen.first_order_amplifier else None
    return model.structure(**structure) if structure or is_oscillator else model


def _arguments(model: Any) -> dict[str, str]:
    """Arguments of a family's structure, if it has one, by the options that stand for them."""
    from hysim.models.protocols import Structured

    if not (isinstance(model, type) and isinstance(model, Structured)):
        return {}
    own = {_OPTIONS.get(name, name): name for name in inspect.signature(model.structure).parameters}
    return own | ({"creep_elements": "creep"} if model is hs.Actuator else {})


def read(path: str) -> tuple[Any, dict[str, str]]:
    """The model in a file, on standard input or at an import path (a class: with its default values), and its units."""
    from hysim.models.storage import from_json

    if is_import_path(path):
        law = imported(path)
        try:
            return (law() if isinstance(law, type) else law), {}
        except TypeError as error:
            raise ValueError(f"{path} needs values for its parameters: give an instance ({error})") from None
    if path == options.STANDARD:
        return from_json(sys.stdin.read(), "the standard input")
    if not Path(path).exists() and path in names_to_identify():
        raise ValueError(f"{path} is a family without numbers: write a model of it by hysim identify --out {path}.json")
    return from_json(Path(path).read_bytes(), path)


def read_in_seconds(path: str) -> tuple[Any, dict[str, str]]:
    """As `read`, for a command with a sample time [s]; ValueError for a model that counts time in another unit."""
    from hysim.models.protocols import needs_time

    model, units = read(path)
    if needs_time(model) and (unit := units.get("t", "s")) != "s":
        raise ValueError(f"{path} counts time in {unit}, and the sample time is in s: identify it from times in s")
    return model, units


def in_units(record: "hs.Record", units: Mapping[str, str], source: str, signals: str = "tuy") -> "hs.Record":
    """The record in these units, where it has others; ValueError if they differ by more than a prefix."""
    known = {name: units[name] for name in signals if name in units}
    other = {name: unit for name, unit in known.items() if record.units.get(name, unit) != unit}
    try:
        return record.convert(other) if other else record
    except ValueError as error:
        raise ValueError(f"{source} is not in the units of the model: {error}") from None


def name_of(path: str) -> str:
    """The name under which tables and pictures show a model: of its file without the ending, or in its module."""
    return path.rpartition(":")[2] if is_import_path(path) else Path(path).stem


def simulated(model: Any, record: "hs.Record", units: dict[str, str]) -> "hs.Simulation":
    """The model's free run over the record's input; a ValueError if it has no response, such as a controller."""
    from hysim.models.protocols import Responding
    from hysim.simulation import free_run

    if not isinstance(model, Responding):
        raise ValueError(f"a {type(model).__name__} has no response to simulate: give a law or a plant")
    return free_run(model, record, units)
