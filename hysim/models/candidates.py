"""The models that the registry offers to `hysim.compare`: every family that can be identified without being told more.

A public family is its own candidate. One that is identified through a structure, or only from a start, names in a class
method ``candidates()`` what is tried instead; one that makes no sense without being told more names nothing.
"""

from typing import Any

from hysim._names import MODULE_OF
from hysim.models.model import every_family
from hysim.models.protocols import Direct, Identifiable, Offering


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
