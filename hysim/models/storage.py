"""Models to and from JSON: the version of hysim, the family, the parameters, the units.

A parameter that is a model itself is stored by its own family and parameters.
"""

import importlib
import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from hysim import __version__
from hysim._atomic import write_text
from hysim.models.model import FAMILIES

_MODULES = ("boucwen", "duhem", "oscillator", "static", "transfer_function")


def save(model: Any, path: str | Path, *, units: Mapping[str, str] | None = None) -> None:
    """Write a model to a JSON file; every number comes back to the bit.

    Parameters
    ----------
    model : model
        Of one of hysim's families.
    path : path
        The file; it appears whole or not at all.
    units : mapping, optional
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``.

    Raises
    ------
    TypeError
        If `model` is not a model.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, hysim as hs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hs.save(hs.Line(slope=0.1), f"{folder}/line.json", units={"u": "V", "y": "um"})
    ...     hs.load_model(f"{folder}/line.json")
    Line(offset=0.0, slope=0.1)
    """
    family = type(model).__name__
    if FAMILIES.get(family) not in (type(model),):
        raise TypeError(f"save takes a model of hysim, got {family}")
    document = {
        "hysim": __version__,
        **_description(model),
        "units": dict(units or {}),
    }
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def load_model(path: str | Path) -> Any:
    """Read a model that `save` wrote.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    model

    Raises
    ------
    ValueError
        If the file does not hold a model; the message names the file and what is wrong.
    OSError
        If it cannot be read.
    """
    for module in _MODULES:
        importlib.import_module(f"hysim.models.{module}")
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
        family, parameters = str(document["family"]), {**document["parameters"]}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} does not hold a model of hysim: {type(error).__name__}: {error}") from None
    return _rebuilt(family, parameters, path)


def _rebuilt(family: str, parameters: Mapping[str, Any], path: str | Path) -> Any:
    if family not in FAMILIES:
        raise ValueError(f"{path} holds a model of the family {family!r}; there are {', '.join(sorted(FAMILIES))}")
    values = {
        name: _rebuilt(str(value["family"]), value["parameters"], path) if _describes_model(value) else value
        for name, value in parameters.items()
    }
    try:
        loaded = FAMILIES[family](**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} does not hold a {family}: {error}") from None
    if missing := [field.name for field in fields(loaded) if field.name not in parameters]:
        raise ValueError(f"{path} does not hold a whole {family}: {', '.join(missing)} missing")
    return loaded


def _describes_model(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == {"family", "parameters"} and isinstance(value["parameters"], dict)


def _description(model: Any) -> dict[str, Any]:
    parameters = {field.name: _plain(getattr(model, field.name)) for field in fields(model)}
    return {"family": type(model).__name__, "parameters": parameters}


def _plain(value: Any) -> Any:
    if type(value) in FAMILIES.values():
        return _description(value)
    return value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value
