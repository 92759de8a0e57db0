"""Models of the command line: families by name, models in files, and laws of the user by import path."""

import argparse
import inspect
import os
import pkgutil
import re
import sys
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import hysim
from hysim.cli.options import OWN
from hysim.cli.records import STANDARD
from hysim.cli.shell.words import suggestion

FORMS = f"name of a family, such as bouc-wen; MODEL.json; or {OWN}"
"""Values of an option for models."""

OPTIONS = f"""
--model MODEL  {FORMS}; an unknown name lists the names [required]

structure of the model:
--plays COUNT  number of plays, or of a Maxwell-slip model's elements
--relay-intervals COUNT  number of intervals between the levels of a Preisach model
--one-signed yes|no  whether the weights of plays or relays have one sign (default: chosen by the BIC)
--degree COUNT  degree of a Duhem law's polynomials

transfer function:
--poles N  number of poles
--zeros N  number of zeros, at most that of the poles
--sample start|end  whether an output was read at the start or at the end of the hold

transfer function and oscillator:
--hold zoh|foh|band-limited  input between samples: held (zoh), linear (foh), or of an oscillator the sum of the lines
    below half the record's rate

oscillator: the model oscillator, a mass on a Bouc-Wen spring
--oversampling N  steps of the simulation between two samples
--period N  samples of a period, with --initial periodic
--excitation force|base  whether the input is a force, or the acceleration of the base

actuator: the model actuator, from records of several rates
--law MODEL  law of the actuator, as --model (default: bouc-wen)
--modes N  number of resonances, 0 to 3 (default: 1)
--creep  creep that grows by so many percent a decade
--creep-elements N  creep of so many log-spaced elements
--delay  a dead time
--first-order-amplifier  a time constant before the law
"""
"""The choice of a family and the options of its structure."""

_PLANTS = ("oscillator", "actuator")
_STRUCTURAL = (
    "plays", "relay_intervals", "one_signed", "degree", "poles", "zeros", "sample", "hold", "oversampling", "period",
    "excitation",
)  # fmt: skip
_ARGUMENTS = {"plays": ("plays", "elements"), "relay_intervals": ("intervals",)}
"""Arguments of a structure that an option of another name stands for."""

_NEEDED = ("poles", "zeros", "degree")
_OF_ACTUATOR = ("law", "modes", "creep", "creep_elements", "delay", "first_order_amplifier")


@runtime_checkable
class _Structured(Protocol):
    """A family that `identify` takes through a structure."""

    structure: Any


def names() -> list[str]:
    """Names of all families that can be compared without further arguments; loads every family."""
    from hysim.models.candidates import candidates, short_names

    short = {family: name for name, family in short_names().items()}
    families = dict.fromkeys(name.split()[0] for name in candidates() if name.split()[0] in hysim.__all__)
    return [short.get(name, _hyphenated(name)) for name in families]


def names_to_identify() -> list[str]:
    """Names of all models that `hysim identify` takes: those to compare, further laws and plants."""
    from hysim.models.candidates import is_identifiable, short_names
    from hysim.models.model import every_family

    short = {family: name for name, family in short_names().items()}
    laws = [
        short.get(name, _hyphenated(name))
        for name, law in every_family().items()
        if law.__module__.startswith("hysim.laws.") and is_identifiable(law)
    ]
    return [*dict.fromkeys([*names(), *laws, *_PLANTS])]


def family(name: str) -> Any:
    """The family with a name such as ``bouc-wen``; a ValueError, which lists the names, if there is none."""
    from hysim.models.model import FAMILIES

    public = _public(name)
    law = resolved(f"hysim:{public[name]}") if name in public else None
    if law is None or FAMILIES.get(public[name]) is not law:
        known = names_to_identify()
        near = suggestion(name, known) or f"give one of {', '.join(known)}"
        raise ValueError(f"there is no model {name!r}: {near} (models of your own: MODEL.json or module:name)")
    if name == "structure":
        raise ValueError("a structure has no default: give one in a file, MODEL.json, which hs.save writes")
    return law


def _public(name: str) -> dict[str, str]:
    """Names of classes by their names on the command line; with the short ones where `name` is no other."""
    public = {_hyphenated(each): each for each in hysim.__all__ if each[0].isupper()}
    if name in public:
        return public
    from hysim.models.candidates import short_names  # which loads every family

    return public | short_names()


def _hyphenated(name: str) -> str:
    """``bouc-wen`` of ``BoucWen``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", name).lower()


def resolved(path: str) -> Any:
    """The object at an import path, `module:name`; modules in the current folder are importable.

    A ValueError is raised if there is no such module, or it does not have the name.
    """
    module, _, name = path.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())  # as `python -m hysim` has it
    try:
        return pkgutil.resolve_name(path)
    except ModuleNotFoundError as error:
        if error.name is None or module.split(".")[0] != error.name.split(".")[0]:
            raise  # the module is there, and imports another one that is missing
        raise ValueError(f"there is no module {module!r} in {os.getcwd()} or among the installed packages") from None
    except AttributeError:
        raise ValueError(f"{sys.modules[module]!r} has no {name!r}") from None


def is_import_path(text: str) -> bool:
    """Whether a text is `module:name`, and not the path of a file."""
    return bool(re.fullmatch(r"[^\W\d]\w*(\.\w+)*:\w+(\.\w+)*", text)) and not Path(text).exists()


def imported(path: str) -> Any:
    """The family or model at an import path; a ValueError if there is no such name, or it is no law."""
    from hysim.models.candidates import is_identifiable
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


def to_identify(options: argparse.Namespace) -> Any:
    """The argument of `identify` for these options.

    A ValueError is raised if there is no such model, an option belongs to another one, or one that this model needs is
    missing.
    """
    from hysim.models.model import FAMILIES

    whole = {name: value for name in _OF_ACTUATOR if (value := vars(options)[name]) is not None and value is not False}
    used = {name: vars(options)[name] for name in _STRUCTURAL if vars(options)[name] is not None}
    if foreign := [*used] if options.model == "actuator" else [*whole]:
        raise ValueError(f"--{foreign[0].replace('_', '-')} is no option of the model {options.model}")
    if options.model == "actuator":
        return _actuator(whole)
    model = model_or_family(options.model)
    oscillator, linear = (FAMILIES.get(name) for name in ("BoucWenOscillator", "TransferFunction"))  # if it is loaded
    if oscillator is not None and isinstance(model, oscillator):  # its numbers are searched anew, in the same setting
        for name in ("excitation", "hold"):
            setattr(options, name, vars(options)[name] or vars(model)[name])
        model = oscillator
    used = {name: vars(options)[name] for name in _STRUCTURAL if vars(options)[name] is not None}
    taken = {name: argument for name in _STRUCTURAL if (argument := _argument(model, name))}
    if foreign := [name for name in used if name not in taken]:
        others = [name for name in names_to_identify() if _argument(family(name), foreign[0])]
        raise ValueError(
            f"--{foreign[0].replace('_', '-')} is no option of the model {options.model}, but of {', '.join(others)}"
        )
    if missing := [name for name in _NEEDED if name in taken and name not in used]:
        raise ValueError(f"the model {options.model} needs --{missing[0]}")
    structure = {taken[name]: value == "yes" if name == "one_signed" else value for name, value in used.items()}
    if model is oscillator and options.initial is not None:
        structure["initial"], options.initial = options.initial, None  # its structure says how the record begins
    is_structure_needed = structure or any(model is each for each in (oscillator, linear))
    return model.structure(**structure) if is_structure_needed else model


def _argument(model: Any, option: str) -> str | None:
    """The argument of a family's structure for which an option stands; None if it takes none such."""
    if not (isinstance(model, type) and isinstance(model, _Structured)):
        return None
    arguments = inspect.signature(model.structure).parameters
    return next((name for name in _ARGUMENTS.get(option, (option,)) if name in arguments), None)


def _actuator(structure: dict[str, Any]) -> Any:
    """The structure of an actuator with these options."""
    return hysim.Actuator.structure(
        model_or_family(structure.get("law", "bouc-wen")),
        creep=structure.get("creep_elements", "creep" in structure),
        modes=structure.get("modes", 1),
        delay="delay" in structure,
        amplifier="first-order" if "first_order_amplifier" in structure else None,
    )


def read(path: str) -> tuple[Any, dict[str, str]]:
    """The model in a file, on the standard input, or at an import path, and its units.

    A class at an import path stands for the model with its default values.
    """
    from hysim.models.storage import from_json

    if is_import_path(path):
        law = imported(path)
        try:
            return (law() if isinstance(law, type) else law), {}
        except TypeError as error:
            raise ValueError(f"{path} needs values for its parameters: give an instance ({error})") from None
    if path == STANDARD:
        return from_json(sys.stdin.read(), "the standard input")
    if not Path(path).exists() and path in _public(path):
        raise ValueError(f"{path} is a family without numbers: write a model of it by hysim identify --out {path}.json")
    return from_json(Path(path).read_bytes(), path)


def name_of(path: str) -> str:
    """The name under which tables and pictures show a model: of its file without the ending, or in its module."""
    return path.rpartition(":")[2] if is_import_path(path) else Path(path).stem


def simulated(model: Any, record: "hysim.Record", units: dict[str, str]) -> "hysim.Simulation":
    """The model's free run over the record's input; a ValueError if it has no response, such as a controller."""
    from hysim.models.protocols import Responding
    from hysim.simulation import free_run

    if not isinstance(model, Responding):
        raise ValueError(f"a {type(model).__name__} has no response to simulate: give a law or a plant")
    return free_run(model, record, units)
