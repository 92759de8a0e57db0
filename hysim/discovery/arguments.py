"""Which arguments of `discover` each route uses.

| argument | memory, output | oscillator |
|---|---|---|
| library | yes | only "bouc-wen" |
| degree | yes, but not with a library of names | yes |
| symmetry | yes | only "odd" |
| signs, optimizer, derivative, initial, cross_validate | yes | no |
| structure, mass, damping, stiffness | no | yes |
| seed, progress | yes | yes |

An argument that has its default value is not given. The automatic route tries those routes that use all arguments
that are given.
"""

from collections.abc import Callable, Mapping
from typing import Any

ROUTES = ("auto", "memory", "output", "oscillator")

DEFAULTS: dict[str, Any] = {
    "library": None,
    "degree": 2,
    "symmetry": None,
    "signs": None,
    "optimizer": "STLSQ",
    "derivative": "auto",
    "initial": "auto",
    "cross_validate": None,
    "structure": None,
    "mass": None,
    "damping": None,
    "stiffness": None,
}

_TRIED = {"auto": ("memory", "output", "oscillator")}
_OF_AN_OSCILLATOR = ("structure", "mass", "damping", "stiffness")


def given(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that do not have their default values."""
    return {name: value for name, value in arguments.items() if not _is_default(name, value)}


def routes(
    route: str,
    arguments: Mapping[str, Any],
    *,
    called: Callable[[str, Any], str] = lambda name, value: f"{name}={value!r}" if isinstance(value, str) else name,
) -> tuple[str, ...]:
    """The routes that `route` tries: those that use every argument that is given.

    `called` says how an argument is written where the reader is, by default in Python.

    Raises
    ------
    ValueError
        If the route is unknown, does not use an argument, or no route uses all of them.
    """
    if route not in ROUTES:
        raise ValueError(f"route must be one of {', '.join(ROUTES)}, got {route!r}")
    if "degree" in arguments and not isinstance(arguments.get("library", ""), str):
        raise ValueError(f"{called('degree', arguments['degree'])} is not used with a library of names: leave it out")
    tried = _TRIED.get(route, (route,))
    users = {name: tuple(each for each in tried if _uses(each, name, value)) for name, value in arguments.items()}
    for name, value in arguments.items():
        if not users[name]:
            others = [called("route", each) for each in ROUTES[1:] if _uses(each, name, value)]
            mend = f", or use {' or '.join(others)}" if others else ""
            raise ValueError(f"{called(name, value)} is not used by {called('route', route)}: leave it out{mend}")
    chosen = tuple(each for each in tried if all(each in users[name] for name in arguments))
    if not chosen:
        first = next(name for name in arguments if "oscillator" not in users[name])
        second = next(name for name in arguments if users[name] == ("oscillator",))
        raise ValueError(
            f"no route uses both {called(first, arguments[first])} and {called(second, arguments[second])}: the "
            f"first is for {' or '.join(called('route', each) for each in users[first])}, the second for "
            f"{called('route', 'oscillator')}; leave one of them out"
        )
    return chosen


def not_tried(route: str, arguments: Mapping[str, Any]) -> str:
    """Warning that a route was not tried because of some arguments."""
    unused = [name for name, value in arguments.items() if not _uses(route, name, value)]
    return (
        f"The {route} route was not tried, because it does not use {', '.join(unused)}; the laws that were tried "
        "explain little of these records."
    )


def _uses(route: str, name: str, value: Any) -> bool:
    if name == "degree":
        return True
    if route != "oscillator":
        return name not in _OF_AN_OSCILLATOR
    return (
        name in _OF_AN_OSCILLATOR
        or (name == "library" and value == "bouc-wen")
        or (name == "symmetry" and value == "odd")
    )


def _is_default(name: str, value: Any) -> bool:
    default = DEFAULTS[name]
    if name == "signs":
        return not value
    return value is default or (isinstance(default, str | int) and type(value) is type(default) and value == default)
