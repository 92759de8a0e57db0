"""Results to plain JSON values and back (nan is null, an infinity its name), and warnings for users of a result."""

import json
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, Self

import numpy as np

from hysim._release import __version__
from hysim.models import storage
from hysim.models.model import is_model

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
        return storage.to_document(value)
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
        arguments = {name: _field(each, hints[name], kinds) for name, each in value["fields"].items()}
        return kind(**arguments)
    if storage.is_document(value):
        return storage.from_document(value, "the text")
    if isinstance(value, dict):
        return {name: from_plain(each, kinds) for name, each in value.items()}
    if isinstance(value, list):
        return tuple(from_plain(each, kinds) for each in value)
    return math.nan if value is None else float(value) if value in _INFINITE else value


def _field(value: Any, hint: Any, kinds: Sequence[type]) -> Any:
    optional = typing.get_origin(hint) in (types.UnionType, typing.Union) and type(None) in typing.get_args(hint)
    return None if value is None and optional else from_plain(value, kinds)


CONSTANT = "the output is constant: the fit in percent is not defined, and the output shows no effect of the input"
SWAPPED = "the input and the output may be swapped"
_CORRELATED = 1e-3  # probability of white residuals
RESTING = 1e-6  # of the output's standard deviation: smaller residuals are the end of a descent
ROUNDING = 1e-12  # of the output's size


def sentences(
    *,
    spread: float,
    size: float,
    rmse: float,
    whiteness: float,
    stderr: Mapping[str, float],
    reasons: tuple[str, ...],
    success: bool,
) -> tuple[str, ...]:
    """Warnings; `spread` and `size` are the output's standard deviation and largest magnitude."""
    warnings = [] if success else ["the search did not converge: better parameters may exist"]
    if spread == 0.0:
        warnings.append(CONSTANT)
    if unknown := [name for name, value in stderr.items() if np.isnan(value)]:
        why = f": {'; '.join(reasons)}" if reasons else ""
        warnings.append(f"no standard error for {', '.join(unknown)}{why}")
    if stderr and whiteness < _CORRELATED and rmse > max(RESTING * spread, ROUNDING * size):
        warnings.append("residuals are correlated (p < 0.001): the intervals are too narrow")
    return tuple(warnings)
