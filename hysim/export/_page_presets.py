"""Models with which `hysim explore` begins: one for every family of laws, and some devices."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import hysim as hs
from hysim._basics.atomic import write_text
from hysim.benchmarks import noel_schoukens_plant
from hysim.export._page import Shown, checked_path, page_text
from hysim.models.model import families

_GROUPS = {
    "differential": "Differential laws",
    "operators": "Plays, stops, relays",
    "friction": "Friction and backlash",
    "magnetic": "Magnetic cores",
}
"""Headings of the folders of the laws, in the order of the page; devices stand last."""

_DEVICES = "Devices"
_DAMPER = {"u": "mm", "y": "kN"}


def presets() -> dict[str, Shown]:
    examples = {family.example.title: _shown(family) for family in families().values() if family.example.title}
    every = {**examples, **_sums_and_materials()}
    groups = (*_GROUPS.values(), _DEVICES)
    return {name: each for group in groups for name, each in every.items() if each.group == group}


def explorer(path: str | Path) -> Path:
    """Write the page with a choice of families to an ``.html`` file, and return its path; else a ValueError."""
    page = checked_path(path)
    write_text(page, _text())
    return page


@lru_cache(maxsize=1)
def _text() -> str:
    return page_text(presets(), title="Loop explorer")


def _shown(family: type[Any]) -> Shown:
    fields, between, _, group, units, kind, stack = family.example
    folder = family.__module__.split(".")[-2]
    return Shown(family(**fields), between, units, stack, group or _GROUPS[folder], kind)


def _sums_and_materials() -> dict[str, Shown]:
    """Sums of laws, and other numbers of laws than those of their examples."""
    friction = hs.Dahl(stiffness=20.0, coulomb=4.0) + hs.Line(slope=0.25)
    damper = hs.BoucWen(A=10.0, beta=2.0, gamma=2.0, feedthrough=0.2) + hs.Dashpot(c=0.02)
    steel = hs.JilesAtherton(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=400.0, c=0.2)
    static = hs.MaxwellSlip(stiffness=(200.0, 100.0, 50.0), slips=(0.2, 0.5, 1.0))
    core = Shown(
        static + hs.Dashpot(c=4.0) + hs.ExcessLoss(c=10.0),
        (-1.0, 1.0),
        {"u": "T", "y": "A/m"},
        group=_GROUPS["magnetic"],
        kind="sine",
    )
    benchmark = noel_schoukens_plant().law
    return {
        "Magnetic core: static, eddy current and excess field": core,
        "Friction damper and spring": Shown(friction, (-8.0, 8.0), _DAMPER, group=_DEVICES),
        "Magnetorheological damper": Shown(damper, (-8.0, 8.0), _DAMPER, group=_DEVICES),
        "Noël-Schoukens benchmark": Shown(benchmark, (-2e-3, 2e-3), {"u": "m", "y": "N"}, group=_DEVICES),
        "Steel core": Shown(steel, (-5e3, 5e3), {"u": "A/m", "y": "T"}, group=_DEVICES),
    }
