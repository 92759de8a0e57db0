"""Models and results to and from JSON: version of hysim, family, parameters, units; nan is null, inf its name."""

import importlib
import json
import math
import types
import typing
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from hysim._basics.atomic import write_all
from hysim._basics.frozen import given_items, last_names
from hysim._basics.names import MODULE_OF
from hysim._basics.release import __version__
from hysim._basics.results import model_of
from hysim.models.model import FAMILIES, every_family, is_model
from hysim.records import InputOutput

_DEEPEST = 100  # lists and mappings in each other: a chain of chains takes three for a model
_MOST_DIGITS = 4_300  # which Python converts by default
_TOO_DEEP = f"lists and mappings are nested more than {_DEEPEST} deep"
_LONGEST, _BRIEF = 1000, 60  # signs of a message, and of a value in it


def save(model: Any, path: str | Path, *, units: Mapping[str, str] | None = None) -> None:
    """Write a model to a JSON file; every number that is read back is identical to the bit.

    Parameters
    ----------
    model : model, or result of `identify` or `discover`
        Of one of hysim's families. Of a result its model is written; ``result.to_json()`` is the text of all of it.
    path : path
        The file; it appears whole or not at all.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``, and of other signals of a plant.

    Raises
    ------
    TypeError, ValueError, OSError
        If `model` is not a model or holds more models in models than `load_model` takes; if the file cannot be written.

    Examples
    --------
    >>> import tempfile, hysim as hs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hs.save(hs.Line(slope=0.1), f"{folder}/line.json", units={"u": "V", "y": "um"})
    ...     hs.load_model(f"{folder}/line.json")
    Line(offset=0.0, slope=0.1)
    """
    write_all({path: to_json(model, units=units)})


def to_json(model: Any, *, units: Mapping[str, str] | None = None) -> str:
    model = model_of(model)
    if not is_model(model):
        advice = ": hs.save_record(record, path) writes a record" if isinstance(model, InputOutput) else ""
        if type(model).__name__ in FAMILIES:
            advice = ", of a class that was defined anew since: make the model again"
        raise TypeError(f"save takes a model of hysim, got {type(model).__name__}{advice}")
    document = {"hysim": __version__, **to_document(model), "units": dict(units or {})}
    _check_depth(document)
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def load_model(path: str | Path) -> Any:
    """Read a model that `save` wrote; ValueError names what is wrong in the file, OSError if it cannot be read."""
    return from_json(Path(path).read_bytes(), path)[0]


def from_json(text: str | bytes, source: str | Path) -> tuple[Any, dict[str, str]]:
    """The model that `to_json` wrote, and the units; errors call the text by the name of its `source`."""
    try:
        document = json.loads(text, object_pairs_hook=_each_name_once, parse_int=_integer)
        _check_depth(document)
        units = _units(document)
    except (RecursionError, ValueError) as error:
        is_json = not isinstance(error, json.JSONDecodeError | UnicodeDecodeError) or text.lstrip()[:1] in ("{", b"{")
        advice = "" if is_json else "; if it is a record: read it with hs.load"
        reason = _TOO_DEEP if isinstance(error, RecursionError) else _one_line(error)
        raise ValueError(f"{source} does not hold a model of hysim: {reason}{advice}") from None
    return from_document(document, source), units


def _units(document: Any) -> dict[str, str]:
    if not isinstance(document, dict):
        raise ValueError(f'expected a mapping with "family" and "parameters", got {_shown(document)}')
    if missing := [name for name in ("family", "parameters") if name not in document]:
        raise ValueError(f"{' and '.join(map(repr, missing))} missing")
    units = document.get("units", {})
    if not isinstance(units, dict) or not all(isinstance(unit, str) for unit in units.values()):
        raise ValueError(f"units must be a mapping of names to labels, got {_shown(units)}")
    return units


def _integer(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits is no parameter")
    return int(digits)


def _each_name_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A mapping of JSON whose names are unique; `json` would keep only the last value of a repeated name."""
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        twice = next(name for name, number in Counter(name for name, _ in pairs).items() if number > 1)
        raise ValueError(f"{twice!r} is there twice")
    return mapping


def _check_depth(document: Any) -> None:
    layer = [document]
    for _ in range(_DEEPEST):
        layer = [item for each in layer for item in _members(each)]
        if not layer:
            return
    raise ValueError(_TOO_DEEP)


def _members(value: Any) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


def from_document(document: Mapping[str, Any], path: str | Path) -> Any:
    """The model of a family with its parameters, models among them; `path` is what the messages call its place."""
    family, stored = document["family"], document["parameters"]
    if not isinstance(family, str):
        raise ValueError(f"{path} does not hold a model of hysim: the family must be a name, got {_shown(family)}")
    if not isinstance(stored, Mapping):
        raise ValueError(f"{path} does not hold a {family}: parameters must be a mapping, got {_shown(stored)}")
    if family in MODULE_OF:
        importlib.import_module(MODULE_OF[family])  # enters it into the families
    if family not in FAMILIES:
        known = f"{', '.join(sorted(every_family()))}; import first the module of a family of your own"
        raise ValueError(f"{path} holds a model of the family {_shown(family)}; there are {known}")
    try:
        parameters = {name: _value(value, path) for name, value in stored.items()}
        loaded = FAMILIES[family](**parameters)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"{path} does not hold a {family}: {_one_line(error)}") from None
    optional = {*parameters, *last_names(type(loaded))}
    if missing := [field.name for field in fields(loaded) if field.name not in optional]:
        raise ValueError(f"{path} does not hold a whole {family}: {', '.join(missing)} missing")
    return loaded


def _value(value: Any, path: str | Path) -> Any:
    if isinstance(value, list):
        return [_value(each, path) for each in value]
    return from_document(value, path) if is_document(value) else value


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _BRIEF else f"{text[: _BRIEF - 4]} ..."


def is_document(value: Any) -> bool:
    return isinstance(value, dict) and value.keys() == {"family", "parameters"}


def to_document(value: Any) -> Any:
    if is_model(value):
        parameters = {name: to_document(item) for name, item in given_items(value).items()}
        return {"family": type(value).__name__, "parameters": parameters}
    if isinstance(value, tuple):
        return [to_document(each) for each in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


_INFINITE = ("inf", "-inf")


class Stored:
    """A result that is stored as JSON under `json_name`; its parts are results of the classes `json_parts`."""

    json_name: ClassVar[str]
    json_parts: ClassVar[tuple[type, ...]] = ()

    def to_json(self) -> str:
        """The whole result as JSON, with the version of hysim; a TypeError if a model is not of hysim's families."""
        document = {"hysim": __version__, self.json_name: to_plain(self)}
        return json.dumps(document, indent=2, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The result that `to_json` wrote, every number to the bit; a ValueError if the text does not hold one."""
        try:
            result = from_plain(json.loads(text)[cls.json_name], (cls, *cls.json_parts))
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            raise ValueError(f"this is no {cls.json_name} of hysim: {type(error).__name__}: {error}") from None
        if not isinstance(result, cls):
            raise ValueError(f"this is no {cls.json_name} of hysim, but {type(result).__name__}")
        return result


def to_plain(value: Any) -> Any:
    if is_model(value):
        return to_document(value)
    if is_dataclass(value) and not isinstance(value, type):
        contents = {field.name: to_plain(vars(value)[field.name]) for field in fields(value)}
        return {"result": type(value).__name__, "fields": contents}
    if isinstance(value, Mapping):
        return {name: to_plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [to_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    raise TypeError(f"{type(value).__name__} has no form in JSON")


def from_plain(value: Any, kinds: Sequence[type]) -> Any:
    if isinstance(value, dict) and value.keys() == {"result", "fields"}:
        kind = {each.__name__: each for each in kinds}[value["result"]]
        hints = typing.get_type_hints(kind)
        return kind(**{name: _field(each, hints[name], kinds) for name, each in value["fields"].items()})
    if is_document(value):
        return from_document(value, "the text")
    if isinstance(value, dict):
        return {name: from_plain(each, kinds) for name, each in value.items()}
    if isinstance(value, list):
        return tuple(from_plain(each, kinds) for each in value)
    return math.nan if value is None else float(value) if value in _INFINITE else value


def _field(value: Any, hint: Any, kinds: Sequence[type]) -> Any:
    optional = typing.get_origin(hint) in (types.UnionType, typing.Union) and type(None) in typing.get_args(hint)
    return None if value is None and optional else from_plain(value, kinds)
