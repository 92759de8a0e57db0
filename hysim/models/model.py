"""The `family` decorator of models, and the registry of families.

A model is a specification. It is frozen and keyword-only, its numbers are finite floats, and it is
compared by value. Evolving state is separate: it is passed in and returned.

A family is also known by its name, however it is written: ``"bouc-wen"``, ``"BoucWen"``, ``"bouc_wen"``. `candidates`
are what the registry offers to `hysim.compare`: every family that can be identified without being told more, but
structural components, which are laws of members with a virgin state and are tried where they are named. One that is
identified through a structure, or only from a start, names in a class method ``candidates()`` what is tried instead;
one that makes no sense without being told more names nothing.
"""

import importlib
from collections.abc import Mapping
from dataclasses import field, fields
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar, dataclass_transform

import numpy as np

from hysim._basics.frozen import checked, items
from hysim._basics.names import MODULE_OF, meant, plain
from hysim._basics.printing import shown, summary_text, value_in_words, wrapped
from hysim.models.protocols import Direct, Identifiable, Offering

T = TypeVar("T")

_BY_NAME = "hysim.laws.components"  # tried where they are named
_LAWS = "hysim.laws."
ROOMS = ("hysim.models.", _LAWS, "hysim.plants.")  # where hysim's own families are

FAMILIES: dict[str, type] = {}


@classmethod  # type: ignore[misc]
def not_offered(cls: Any) -> dict[str, Any]:
    """None: `hysim.compare` tries the family only where it is named."""
    return {}


class Example(NamedTuple):
    """The law that stands for its family in the gallery, on the pages and in tests.

    `fields` are the arguments of its constructor, `between` are the lowest and the highest input. `title` is its name
    in the explorer, which leaves out a family without one; `group` is the heading there, by default that of the
    family's folder. `units` are labels of u and y, and `kind` is the input with which its page begins. `stack` replaces
    the sliders of plays with equal weights and even thresholds by those of their number and reach.
    """

    fields: Mapping[str, Any]
    between: tuple[float, float] = (-1.0, 1.0)
    title: str = ""
    group: str = ""
    units: Mapping[str, str] = MappingProxyType({})
    kind: str = "triangle"
    stack: bool = False


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
def family(cls: type[T]) -> type[T]:
    """Make `cls` a frozen model, and enter it into the registry of families under its name."""
    if cls.__name__ in MODULE_OF and cls.__module__.partition(".")[0] != "hysim":
        raise TypeError(f"{cls.__name__} is a name of hysim, by which its files are read: take another one")
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
    """A model in one line: its family, and the parameters that differ from their defaults."""
    if not is_model(value):
        return type(value).__name__
    defaults = {each.name: each.default for each in fields(value)}
    told = [
        f"{name} = {in_brief(each) if is_model(each) else value_in_words(each)}"
        for name, each in items(value).items()
        if isinstance(each, np.ndarray) or each != defaults[name]
    ]
    return f"{type(value).__name__} ({', '.join(told)})" if told else type(value).__name__


def is_model(value: Any) -> bool:
    """Whether a value is of a family in the registry."""
    return FAMILIES.get(type(value).__name__) is type(value)


def _models_in(name: str, value: Any) -> dict[str, Any]:
    members = {f"{name}[{k}]": each for k, each in enumerate(value)} if isinstance(value, tuple) else {name: value}
    return {place: each for place, each in members.items() if is_model(each)}


def every_family() -> dict[str, type]:
    """The registry after every public model of hysim has entered its family."""
    _load(ROOMS)
    return FAMILIES


def families() -> dict[str, type[Any]]:
    """The families of hysim's laws by their names, in the order of the public names.

    A family's example law is ``family(**family.example.fields)``. Families of your own are not among them.

    Returns
    -------
    dict
        Names to classes.

    Examples
    --------
    >>> import hysim as hs
    >>> list(hs.families())[:2]
    ['BoucWen', 'PolynomialBoucWen']
    >>> hs.families()["Dahl"].example.fields
    {'stiffness': 1.0, 'coulomb': 0.8}
    """
    _load((_LAWS,))
    laws = (name for name, module in MODULE_OF.items() if module.startswith(_LAWS))
    return {name: FAMILIES[name] for name in laws if name in FAMILIES}


def _load(rooms: tuple[str, ...]) -> None:
    for module in dict.fromkeys(MODULE_OF.values()):
        if module.startswith(rooms):
            importlib.import_module(module)  # enters its families


def candidates() -> dict[str, Any]:
    """Name to class, start or structure of every family, in the order of the public names.

    Examples
    --------
    >>> list(candidates())[:2]
    ['BoucWen', 'PolynomialBoucWen']
    """
    families = every_family()
    collected: dict[str, Any] = {}
    for name in (*MODULE_OF, *(name for name in families if name not in MODULE_OF)):
        if name in families and not MODULE_OF.get(name, "").startswith(_BY_NAME):
            collected |= _of_family(name, families[name])
    return collected


def family_named(name: str) -> Any:
    """The family of this name, whatever its capitals, hyphens and underscores.

    Those of hysim are known without being loaded, those of the user once they are defined. ValueError, with the name
    that may have been meant, if there is none.

    Examples
    --------
    >>> family_named("bouc-wen").__name__
    'BoucWen'
    """
    public = [each for each, module in MODULE_OF.items() if module.startswith(ROOMS)]
    known = {plain(each): each for each in (*FAMILIES, *public)}
    if plain(name) not in known:
        known |= {plain(short): each for short, each in short_names().items()}
    if (family := known.get(plain(name))) is not None:
        if family in public:
            importlib.import_module(MODULE_OF[family])  # enters it into the families
        if family in FAMILIES:
            return FAMILIES[family]
    raise ValueError(f"there is no family {name!r}{meant(name, every_family())}")


def short_names() -> dict[str, str]:
    """Short names of families to their names; loads every family.

    Examples
    --------
    >>> short_names()["zhu-wang"]
    'ZhuWangBoucWen'
    """
    return {short: name for name, each in every_family().items() if (short := vars(each).get("short"))}


def candidates_named(name: str) -> dict[str, Any]:
    """Candidates of `hysim.compare` in the family of this name, by the names of rows; ValueError if unknown."""
    family = family_named(name)
    collected = _of_family(family.__name__, family) or {family.__name__: family}
    if not all(map(is_identifiable, collected.values())):
        raise ValueError(
            f"the family {family.__name__} needs more than its name: give a structure, or a model to start from"
        )
    return collected


def is_identifiable(subject: Any) -> bool:
    """Whether `identify` takes a class, a model or a structure."""
    return isinstance(subject, Direct) or is_searched(subject)


def is_searched(subject: Any) -> bool:
    """Whether `identify` searches for the parameters of a class, a model or a structure."""
    return isinstance(subject, Identifiable)


def _of_family(name: str, family: Any) -> dict[str, Any]:
    if isinstance(family, Offering):
        return dict(family.candidates())
    return {name: family} if is_identifiable(family) else {}
