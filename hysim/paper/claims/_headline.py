"""The two headline claims: hysteresis reduced by 90 %, vibration reduced to 97 %.

The paper defines neither. Each definition is a claim of its own, reproduced if a loop reaches the printed number
within its rounding; the best loop of each plant counts, of those within voltage limits if there are any.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from hysim.paper import printed
from hysim.paper.claims._claim import Claim, decided
from hysim.paper.claims.rounding import half_unit, stands_for

Loop = Mapping[str, Any]
"""One closed loop: its plant, controller, conditions and measures by name."""

VIBRATION_MEASURES = {
    "overshoot": "overshoot_reduction_percent",
    "residual-rms": "residual_rms_reduction_percent",
    "settling-time": "settling_time_reduction_percent",
}
MAX_SENSITIVITY = 2.0
"""Largest maximum sensitivity of a loop that counts."""
_WHERE = "Abstract and section 4"


def headline_claims(control: Mapping[str, Sequence[Loop]]) -> tuple[Claim, ...]:
    """The headline claims, of the loops under "hysteresis" and "vibration"."""
    hysteresis, vibration = control.get("hysteresis", ()), control.get("vibration", ())
    claims = [
        _hysteresis("bouc-wen", "bouc-wen+eq7", "hysteresis_reduction_percent", hysteresis),
        _hysteresis("eq1", "eq1", "lag_reduction_percent", hysteresis),
    ]
    for plant in ("eq4", "eq6"):
        claims += _vibration(plant, vibration)
    claims.append(_to_97(vibration))
    return tuple(claim for claim in claims if claim is not None)


def _hysteresis(name: str, plant: str, key: str, loops: Sequence[Loop]) -> Claim | None:
    best = _best(loops, plant, (key,))
    if best is None:
        return None
    return _reached(
        f"hysteresis-90-{name}",
        "The controller reduces the hysteresis by 90 %"
        + (": of (1), which has only lag." if name == "eq1" else ": of a law with memory, before (7)."),
        printed.HYSTERESIS_REDUCTION,
        *best,
        "reduction of the loop's relative width" if name != "eq1" else "reduction of the loop that lag opens",
        _fragile(loops, plant, key),
    )


def _vibration(plant: str, loops: Sequence[Loop]) -> tuple[Claim, ...]:
    """The three measures of one loop, and the least of them; one is never shown without the others."""
    best = _best(loops, plant, tuple(VIBRATION_MEASURES.values()))
    if best is None:
        return ()
    least, loop = best
    figures = {name: _number(loop.get(key)) for name, key in VIBRATION_MEASURES.items()}
    together = ", ".join(f"{name.replace('-', ' ')} {figure:.1f} %" for name, figure in figures.items())
    return tuple(
        _reached(
            f"vibration-97-{name}-{plant}",
            f"The controller reduces the vibration of ({plant.removeprefix('eq')}) by 97 %.",
            printed.VIBRATION_REDUCTION,
            figure,
            loop,
            "the least of the three reductions"
            if name == "all-three"
            else f"reduction of the {name.replace('-', ' ')}",
            f"The same loop's reductions: {together}.",
        )
        for name, figure in {**figures, "all-three": least}.items()
    )


def _to_97(loops: Sequence[Loop]) -> Claim | None:
    """The sentence read as it stands: 97 % of the vibration is left."""
    best = _best(loops, "eq4", (VIBRATION_MEASURES["overshoot"],))
    if best is None:
        return None
    left = 100.0 - best[0]
    target = stands_for(printed.VIBRATION_REDUCTION)
    return decided(
        "vibration-97-as-worded",
        _WHERE,
        "The vibration is reduced to 97 %, so that 97 % of it are left.",
        holds=bool(target.low <= left <= target.high),
        method="what the best loop on (4) leaves of the overshoot",
        printed=float(printed.VIBRATION_REDUCTION),
        recomputed=left,
        unit="%",
        note="The hysteresis is said to be reduced by its figure, the vibration to it.",
    )


def _reached(id: str, statement: str, text: str, value: float, loop: Loop, method: str, note: str = "") -> Claim:
    return decided(
        id,
        _WHERE,
        statement,
        holds=value >= float(text) - half_unit(text),
        method=f"{method}, of the best loop simulated; reached within the printed figure's rounding",
        printed=float(text),
        recomputed=value,
        unit="%",
        note=" ".join(part for part in (note, _conditions(loop)) if part),
    )


def _best(loops: Iterable[Loop], plant: str, keys: tuple[str, ...]) -> tuple[float, Loop] | None:
    """The loop on this plant whose least figure is the greatest, and that figure; loops within limits go first.

    A loop counts only with a maximum sensitivity of at most 2, as is commonly asked.
    """
    of_plant = [loop for loop in loops if loop.get("plant") == plant and _sensitivity(loop) <= MAX_SENSITIVITY]
    scored = [(min(_number(loop.get(key)) for key in keys), loop) for loop in of_plant if _complete(loop, keys)]
    limited = [(figure, loop) for figure, loop in scored if _limited(loop)]
    return max(limited or scored, key=lambda pair: pair[0], default=None)


def _sensitivity(loop: Loop) -> float:
    return float(loop.get("conditions", {}).get("max_sensitivity", 0.0))


def _fragile(loops: Sequence[Loop], plant: str, key: str) -> str:
    """Reductions of the loops that do not count."""
    reached = {_sensitivity(loop): _number(loop.get(key)) for loop in loops if loop.get("plant") == plant}
    return " ".join(
        f"A loop with a maximum sensitivity of {sensitivity:.0f} reaches {figure:.1f} %."
        for sensitivity, figure in reached.items()
        if sensitivity > MAX_SENSITIVITY
    )


def _complete(loop: Loop, keys: tuple[str, ...]) -> bool:
    return not any(math.isnan(_number(loop.get(key))) for key in keys)


def _limited(loop: Loop) -> bool:
    return loop.get("limits") not in (None, "", "none", "unlimited")


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def _conditions(loop: Loop) -> str:
    """The controller and the conditions, in words where the loop has them."""
    said = [f"{name}: {words}" for name in ("controller", "reference", "limits") if (words := _words(loop.get(name)))]
    return f"Of the loop with {'; '.join(said)}." if said else ""


def _words(value: Any) -> str:
    """Text as it is, a pair of limits as a range, and nothing of what does not fit a line."""
    if isinstance(value, (list, tuple)):
        return " to ".join(f"{item:g}" for item in value)
    return value if isinstance(value, str) else ""
