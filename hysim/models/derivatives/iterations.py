"""Functions of steps that the forward mode does not differentiate statement by statement.

Some steer: they say how long a step of a series may be or where a cell lies, and the output does not depend on it but
by rounding. Others iterate to a root: of these the result of one more step of Newton's rule is differentiated, which is
the theorem of implicit functions.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from typing import Any

_ROOTS = "hysim.kernels.tangents.roots"

STEERING = frozenset(
    {
        *(f"hysim.kernels.remainder.{name}" for name in ("fraction", "radius")),
        *(f"hysim.kernels.duhem.{name}" for name in ("serves", "untangled", "spread_within")),
        *(f"hysim.kernels.zhu_wang.{name}" for name in ("disc", "serves", "near", "free_length", "scale")),
        *(f"hysim.kernels.baber_noori.{name}" for name in ("nearness",)),
        *(f"hysim.kernels.baber_noori_series.{name}" for name in ("serves", "clear", "spread_within")),
    }
)

_GENERAL = frozenset(
    {
        ("hysim.kernels.elementary.linear_flow", "A"),
        ("hysim.kernels.elementary.quadratic_flow", "slope"),
        ("hysim.kernels.magnetics.anhysteretic.curve", "p"),
        ("hysim.kernels.magnetics.jiles_atherton.first_place", "coupling"),
        ("hysim.kernels.magnetics.chan.abscissa", "drop"),
        ("hysim.kernels.magnetics.chan.follow", "drop"),
        ("hysim.kernels.magnetics.chan.stay", "drop"),
    }
)
"""Functions and names of which zero is a special case that the general one covers, but for rounding."""

_AGAIN = {
    "hysim.kernels.boucwen.degenerate": "degenerate",
    "hysim.kernels.duhem.zero": "series_zero",
    "hysim.kernels.zhu_wang.ramp_zero": "ramp_zero",
    "hysim.kernels.zhu_wang.take_off": "take_off",
    "hysim.kernels.magnetics.chan.excess_inside": "excess_inside",
    "hysim.kernels.magnetics.anhysteretic.field_of": "field_of",
    "hysim.kernels.magnetics.jiles_atherton.reversible": "reversible",
    "hysim.kernels.magnetics.jiles_atherton.solve": "solve",
    "hysim.kernels.friction.backlash.arrival": "arrival",
}


_WHOLE_SERIES = {
    "hysim.kernels.duhem.ends": "ends",
    "hysim.kernels.baber_noori_series.ends": "worn_ends",
    "hysim.kernels.baber_noori_series.pinch_within": "pinch_within",
    "hysim.kernels.zhu_wang.is_last": "is_last",
}
"""Ends and bounds of series: a rate may need terms that the value does not need."""


def in_place_of(function: Callable[..., Any]) -> Any:
    """The function that is translated: itself, or one that ends no series before its last term."""
    name = _WHOLE_SERIES.get(_name(function))
    return function if name is None else vars(import_module(_ROOTS))[name]


def steers(function: Callable[..., Any]) -> bool:
    """Whether a function decides on the way of a computation only."""
    return _name(function) in STEERING


def is_general(function: Callable[..., Any], left: ast.expr, right: ast.expr) -> bool:
    """Whether ``left == right`` asks for a special case of a parameter, and not for the side on which a state is.

    That is so for an exponent of 1 or 2, for an element of the parameters, and for the names in this module.
    """
    if isinstance(right, ast.Constant) and right.value not in (0, 0.0):
        return True
    named = ast.unparse(left)
    return named.startswith("parameters[") or (_name(function), named) in _GENERAL


def one_more_step(function: Callable[..., Any]) -> Any:
    """The function that repeats the last step of an iteration: its results, and then the arguments; else None."""
    name = _AGAIN.get(_name(function))
    return None if name is None else vars(import_module(_ROOTS))[name]


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{function.__qualname__}"
