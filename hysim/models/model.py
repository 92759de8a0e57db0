"""The `family` decorator of models, and the registry of families.

A model is a specification. It is frozen and keyword-only, its numbers are finite floats, and it is
compared by value. Evolving state is separate: it is passed in and returned.
"""

import importlib
from dataclasses import field, fields
from typing import Any, TypeVar, dataclass_transform

import numpy as np

from hysim._frozen import checked, items
from hysim._names import MODULE_OF
from hysim._printing import shown, summary_text, value_in_words, wrapped

T = TypeVar("T")

ROOMS = ("hysim.models.", "hysim.laws.", "hysim.plants.")  # where hysim's own families are

FAMILIES: dict[str, type] = {}


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
def family(cls: type[T]) -> type[T]:
    """Make `cls` a frozen model, and enter it into the registry of families under its name."""
    specification = checked(cls)
    specification.__str__ = _in_words  # type: ignore[method-assign]
    FAMILIES[cls.__name__] = specification
    return shown(specification)


def _in_words(self: Any) -> str:
    """Parameters by name; the models among them a line each."""
    name = type(self).__name__
    plain: list[str] = []
    inside: dict[str, str] = {}
    for parameter, value in items(self).items():
        if models := _models_in(parameter, value):
            inside |= {place: in_brief(each) for place, each in models.items()}
        elif value is not None:
            plain.append(f"{parameter} = {value_in_words(value)}")
    if inside:
        return summary_text([name, wrapped(plain)], inside)
    return summary_text([wrapped(plain, most=9, first=f"{name}: ") or name])


def in_brief(value: Any) -> str:
    """A model in one line: its family, and the parameters that are not as they are by default."""
    if not _is_model(value):
        return type(value).__name__
    defaults = {each.name: each.default for each in fields(value)}
    told = [
        f"{name} = {in_brief(each) if _is_model(each) else value_in_words(each)}"
        for name, each in items(value).items()
        if isinstance(each, np.ndarray) or each != defaults[name]
    ]
    return f"{type(value).__name__} ({', '.join(told)})" if told else type(value).__name__


def _is_model(value: Any) -> bool:
    return FAMILIES.get(type(value).__name__) is type(value)


def _models_in(name: str, value: Any) -> dict[str, Any]:
    """The models that a parameter holds, by their places."""
    members = {f"{name}[{k}]": each for k, each in enumerate(value)} if isinstance(value, tuple) else {name: value}
    return {place: each for place, each in members.items() if _is_model(each)}


def every_family() -> dict[str, type]:
    """The registry after every public model of hysim has entered its family."""
    for module in dict.fromkeys(MODULE_OF.values()):
        if module.startswith(ROOMS):
            importlib.import_module(module)
    return FAMILIES
