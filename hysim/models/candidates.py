"""The models that the registry offers to `hysim.compare`: every family that can be identified without being told more.

A family is also known by its name, however it is written: ``"bouc-wen"``, ``"BoucWen"``, ``"bouc_wen"``.

A public family is its own candidate. One that is identified through a structure, or only from a start, names in a class
method ``candidates()`` what is tried instead; one that makes no sense without being told more names nothing.
"""

import importlib
from typing import Any, Protocol, runtime_checkable

from hysim._names import MODULE_OF, meant, plain
from hysim.models.model import FAMILIES, ROOMS, every_family
from hysim.models.protocols import Direct, Identifiable, Offering


@runtime_checkable
class _Short(Protocol):
    """A family with a short name."""

    short: str


def candidates() -> dict[str, Any]:
    """Name to class, start or structure of every family, in the order of the public names.

    Examples
    --------
    >>> list(candidates())[:2]
    ['BoucWen', 'PolynomialBoucWen']
    """
    families = every_family()
    found: dict[str, Any] = {}
    for name in (*MODULE_OF, *(name for name in families if name not in MODULE_OF)):
        if name in families:
            found |= _of_family(name, families[name])
    return found


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
    return {each.short: name for name, each in every_family().items() if isinstance(each, _Short) and each.short}


def candidates_named(name: str) -> dict[str, Any]:
    """Candidates of `hysim.compare` in the family of this name, by the names of rows; ValueError if there is none."""
    family = family_named(name)
    found = _of_family(family.__name__, family)
    if not found:
        raise ValueError(
            f"the family {family.__name__} needs more than its name: give a structure, or a model to start from"
        )
    return found


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
