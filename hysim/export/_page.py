"""Pages for a browser: a law's loop that follows sliders, in one HTML file that needs nothing else.

The page computes with the law's step, as WebAssembly (`hysim.export._compilers`). Files of the folder `page` are its
parts, joined in the order of `_PARTS`. `hysim explore` begins with a model of every family of laws, and some devices.
"""

import base64
import gzip
import json
from collections.abc import Mapping
from functools import lru_cache
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

import hysim as hs
from hysim._basics.atomic import write_all
from hysim._basics.frozen import FloatArray, items
from hysim._basics.prefixes import label, printed
from hysim._basics.release import __version__
from hysim._basics.results import model_of
from hysim._columns.excursions import measured_cycles
from hysim._columns.turning import TOLERANCE, Samples
from hysim.benchmarks import noel_schoukens_plant
from hysim.export._compilers import compressed
from hysim.export._page_model import Parts, about, heading, node_of, plane_of, rounded, slider
from hysim.models.model import families
from hysim.records import Record

LARGEST = 300_000
"""Most bytes of a page."""

_PARTS = ("step", "inputs", "measures", "draw", "memory", "equations", "code", "control", "page")
_SAMPLES = 200  # of the input on which the sliders' ends are found
_BRANCHES = 5  # of the same input
_PERIOD = 1.0  # of the input at first [s]


class Shown(NamedTuple):
    """A model of a page, the input between which it begins, labels of units, and the group in which it is listed.

    The plays of a Prandtl-Ishlinskii law with `stack` have equal weights and even thresholds, and sliders for both.
    `kind` is the input with which it begins.
    """

    model: Any
    between: tuple[float, float] | None = None
    units: Mapping[str, str] = MappingProxyType({})
    stack: bool = False
    group: str = ""
    kind: str = "triangle"


def to_page(
    thing: Any,
    path: str | Path,
    record: Record | None = None,
    *,
    between: tuple[float, float] | None = None,
    units: Mapping[str, str] | None = None,
    title: str | None = None,
) -> Path:
    """Write a page on which a law's loop follows sliders: one HTML file that works offline.

    The page shows the loop and its measures for a triangle, a sine, a fading triangle or minor loops, and over the
    measured points of a record. It computes with the law's own step, compiled to WebAssembly, and sends nothing.

    Parameters
    ----------
    thing : law, sum or cascade of laws, or result of a fit
        The model with which the page begins. A law that is not hysim's own needs the extra `export`.
    path : path
        The file to write, which ends in ``.html`` or ``.htm``.
    record : Record, optional
        Measured samples to show and to compare with; they become part of the file.
    between : (float, float), optional
        Lowest and highest input at the start [unit of u]; by default those of the record, of a Preisach law's levels,
        of twice the largest threshold of plays, or -1 and 1.
    units : mapping, optional
        Labels of the units of ``"u"`` and ``"y"``; by default the record's.
    title : str, optional
        Heading of the page; by default the name of the law's family.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TypeError
        If the thing is no law, and no sum or cascade of laws.
    ValueError
        If the page would be larger than 300 KB; the message says what to do. For another ending of the path.
    ImportError
        If the law's step must be compiled and the extra `export` is missing.

    Examples
    --------
    >>> import tempfile, pathlib, hysim as hs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = hs.to_page(hs.Dahl(coulomb=0.5), pathlib.Path(folder, "dahl.html"), units={"u": "mm", "y": "N"})
    ...     page.read_text()[:15]
    '<!DOCTYPE html>'
    """
    page, thing = checked_path(path), model_of(thing)
    name = heading(thing) if title is None else title
    text = page_text({name: Shown(thing, between, units or {})}, record)
    size = len(text.encode())
    if size > LARGEST:
        samples = "" if record is None else f": give a record of fewer than {len(record)} samples, such as record[::2]"
        raise ValueError(f"the page would have {size} bytes, more than {LARGEST}{samples}")
    write_all({page: text})
    return page


def checked_path(path: str | Path) -> Path:
    """The path of a page; ValueError for one that a browser would not open as a page."""
    page = Path(path)
    if page.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"a page is a file .html, got {str(path)!r}")
    return page


def page_text(models: Mapping[str, Shown], record: Record | None = None, *, title: str = "") -> str:
    """The page as a text; the same arguments give the same text."""
    modules: dict[str, bytes] = {}
    packs: list[str] = []
    time = 0.5 * _PERIOD * _BRANCHES / _SAMPLES
    described = [_model(name, shown, Parts(modules, packs, sample_time=time), record) for name, shown in models.items()]
    codes = {name: gzip.decompress(module) for name, module in modules.items()}  # smaller if compressed together
    sizes = {name: len(code) for name, code in codes.items()}
    joined = base64.b64encode(compressed(b"".join(codes.values()))).decode()
    measured = None if record is None else _record(record)
    data = {"models": described, "modules": sizes, "code": joined, "record": measured}
    folder = files("hysim.export").joinpath("page")
    lines = (line for name in _PARTS for line in folder.joinpath(f"{name}.js").read_text(encoding="utf-8").splitlines())
    return Template(folder.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        title=escape(title or next(iter(models))),
        version=__version__,
        style=folder.joinpath("page.css").read_text(encoding="utf-8").strip(),
        script="\n".join(line for line in lines if not line.lstrip().startswith("//")),
        packs=",\n".join(f"(() => {{\n{pack.strip()}\nreturn pack{k};\n}})()" for k, pack in enumerate(packs)),
        data=_json_for_script(json.dumps(data, separators=(",", ":"), ensure_ascii=False)),
    )


def _model(name: str, shown: Shown, parts: Parts, record: Record | None) -> dict[str, Any]:
    thing, units = shown.model, {**({} if record is None else record.units), **shown.units}
    low, high = shown.between or _between(thing, record)
    if not low < high:
        raise ValueError(f"between must be (lowest, highest input), got {(low, high)}")
    middle, amplitude = 0.5 * (low + high), 0.5 * (high - low)
    branches = np.arange(_SAMPLES + 1) / _SAMPLES * _BRANCHES
    u = middle + amplitude * np.interp(branches, np.arange(_BRANCHES + 1), [0.0, 1.0, -1.0, 1.0, -0.5, 0.5])
    node = node_of(thing, u, parts)
    if shown.stack:
        parts.controls[:], node["stack"] = _stack(parts.controls, thing), True
    summary, equation = about(thing)
    words = {"name": name, "group": shown.group, "about": summary, "equation": equation}
    model: dict[str, Any] = {**words, "node": node, "values": parts.values, "controls": parts.controls}
    inputs = _inputs(amplitude, middle, parts.timed)
    units_in_words = {signal: printed(units.get(signal, "")) for signal in "uy"}
    labels = {**{signal: label(units, signal) for signal in "uy"}, "unit": units_in_words}
    model |= {"inputs": inputs, "kind": shown.kind, "timed": parts.timed, "labels": labels}
    return model | {"plane": plane_of(node)}


def _inputs(amplitude: float, middle: float, timed: bool) -> list[dict[str, Any]]:
    period = slider("period", _PERIOD, 0.01, 100.0, log=True, unit="s")
    return [
        slider("amplitude", amplitude, rounded(amplitude / 20.0, 4), rounded(2.0 * amplitude, 4)),
        slider("middle", middle, rounded(middle - 2.0 * amplitude, 4), rounded(middle + 2.0 * amplitude, 4)),
        slider("cycles", 2, 1, 6, whole=True),
        slider("smaller loops", 4, 0, 12, whole=True),
        *[period] * timed,
    ]


def _stack(controls: list[dict[str, Any]], law: Any) -> list[dict[str, Any]]:
    """Sliders for number, largest threshold and weights of the plays after that of threshold zero, and its weight."""
    places = {name: k for k, name in enumerate(law.scalars)}
    most, weight = len(law.thresholds) - 1, sum(law.weights[1:])
    plays = sum(each != 0.0 for each in law.weights[1:])
    reach = rounded(law.thresholds[plays], 4)
    thresholds, weights = ([places[f"{name}[{k + 1}]"] for k in range(most)] for name in ("thresholds", "weights"))
    return [
        slider("plays", plays, 1, most, whole=True, places=[], stack="plays"),
        slider("largest threshold", reach, 0.1 * reach, 2.5 * reach, places=thresholds, stack="reach"),
        slider("weight of all plays", weight, -2.0 * weight, 2.0 * weight, places=weights, stack="weight"),
        slider("weight of the input", law.weights[0], -1.0, 2.0, places=[places["weights[0]"]]),
        *(control for control in controls if control["name"] == "offset"),
    ]


def _between(thing: Any, record: Record | None) -> tuple[float, float]:
    if record is not None:
        return float(record.u.min()), float(record.u.max())
    fields = {name: np.asarray(value) for name, value in items(thing).items() if isinstance(value, tuple) and value}
    if "levels" in fields:
        return float(fields["levels"][0]), float(fields["levels"][-1])
    if "thresholds" in fields and (most := 2.0 * float(fields["thresholds"].max())) > 0.0:
        return -most, most
    return -1.0, 1.0


def _record(record: Record) -> dict[str, Any]:
    try:
        loops = measured_cycles(record.u, 1, TOLERANCE)
    except ValueError:
        cycle = None
    else:
        last = loops.cycles[0]
        cuts = [] if loops.places is None else [place for place in loops.places.tolist() if place % 1.0]
        ranges = {"loading": _ranges(last.loading), "unloading": _ranges(last.unloading)}
        cycle = {"cuts": cuts, **ranges, "path": [last.path.start, last.path.stop]}
    names = {"name": record.name or "record", "python": 'hs.load("measured.csv")'}
    step = None if record.t is None else float(np.mean(np.diff(record.t)))
    return {**names, "u": _packed(record.u), "y": _packed(record.y), "cycle": cycle, "sampleTime": step}


def _ranges(samples: Samples) -> list[list[int]]:
    """First and last but one sample of each run of neighbours."""
    if isinstance(samples, slice):
        return [[samples.start, samples.stop]]
    runs = np.split(samples, np.flatnonzero(np.diff(samples) != 1) + 1)
    return [[int(run[0]), int(run[-1]) + 1] for run in runs]


def _packed(values: FloatArray) -> str:
    return base64.b64encode(compressed(values.astype("<f8").tobytes())).decode()


def _json_for_script(text: str) -> str:
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


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
    write_all({page: _text()})
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
    field, units = static + hs.Dashpot(c=4.0) + hs.ExcessLoss(c=10.0), {"u": "T", "y": "A/m"}
    core = Shown(field, (-1.0, 1.0), units, group=_GROUPS["magnetic"], kind="sine")
    benchmark = noel_schoukens_plant().law
    return {
        "Magnetic core: static, eddy current and excess field": core,
        "Friction damper and spring": Shown(friction, (-8.0, 8.0), _DAMPER, group=_DEVICES),
        "Magnetorheological damper": Shown(damper, (-8.0, 8.0), _DAMPER, group=_DEVICES),
        "Noël-Schoukens benchmark": Shown(benchmark, (-2e-3, 2e-3), {"u": "m", "y": "N"}, group=_DEVICES),
        "Steel core": Shown(steel, (-5e3, 5e3), {"u": "A/m", "y": "T"}, group=_DEVICES),
    }
