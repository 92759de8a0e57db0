"""The public names in reading order, the modules that hold them, and the nearest name to a misspelt one."""

from collections.abc import Collection, Iterable
from pathlib import Path

_LINES = Path(__file__).parents[1].joinpath("__init__.pyi").read_text(encoding="utf-8").splitlines()
_WORDS = [line.split() for line in _LINES]  # "from hysim.records import Record as Record"

MODULE_OF = {words[3]: words[1] for words in _WORDS if words[:1] == ["from"]}
"""Public name to the module that holds it; ``hysim`` for a module of that name."""

_MANY, _FIRST = 100, 6  # names that are all printed, and those that are printed of more


def nearest(name: object, known: Iterable[object]) -> str | None:
    """The known name that is nearest to a misspelt one, whatever its capitals, hyphens and underscores; else None."""
    from difflib import get_close_matches  # which is loaded with the first error, not with hysim

    forms = {plain(each): each for each in map(str, known)}
    word = plain(str(name))
    near = get_close_matches(word, forms, n=3)
    near.sort(key=lambda each: sorted(each) != sorted(word))  # two letters in each other's place before all else
    return forms[near[0]] if near else None


def meant(name: object, known: Iterable[object]) -> str:
    """The end of a message about an unknown name: the nearest known one, or nothing."""
    near = nearest(name, known)
    return "" if near is None else f"; did you mean {near!r}?"


def among(name: object, known: Iterable[object]) -> str:
    names = [*map(str, known)]
    shown = names if len(names) <= _MANY else [*names[:_FIRST], f"{len(names) - _FIRST} others"]
    return f"{', '.join(shown)}{meant(name, names)}"


def check_parameters(known: Collection[str], **arguments: Iterable[str]) -> None:
    """A ValueError for the first name in an argument that is none of the known parameters."""
    for argument, names in arguments.items():
        for name in names:
            if name not in known:
                raise ValueError(f"{argument} names {name!r}; the parameters are {among(name, known)}")


def plain(name: str) -> str:
    """A name without what people write in different ways: capitals, hyphens, underscores, points and blanks."""
    return name.lower().replace("-", "").replace("_", "").replace(" ", "").replace(".", "")
