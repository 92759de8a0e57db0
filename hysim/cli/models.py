"""The models of the command line: what they are called there, and those in files."""

import argparse
import sys
from pathlib import Path
from typing import Any

import hysim
from hysim.cli.records import STANDARD

FAMILIES = {
    "bouc-wen": "BoucWen",
    "polynomial-bouc-wen": "PolynomialBoucWen",
    "zhu-wang": "ZhuWangBoucWen",
    "generalized-bouc-wen": "GeneralizedBoucWen",
    "transfer-function": "TransferFunction",
    "prandtl-ishlinskii": "PrandtlIshlinskii",
    "modified-prandtl-ishlinskii": "ModifiedPrandtlIshlinskii",
    "generalized-prandtl-ishlinskii": "GeneralizedPrandtlIshlinskii",
    "rate-dependent-prandtl-ishlinskii": "RateDependentPrandtlIshlinskii",
    "maxwell-slip": "MaxwellSlip",
    "dahl": "Dahl",
    "coleman-hodgdon": "ColemanHodgdon",
    "baber-noori": "BoucWenBaberNoori",
    "preisach": "Preisach",
    "line": "Line",
    "single-valued": "SingleValued",
}
"""Name on the command line to public name of what `identify` takes."""

STRUCTURES: dict[str, tuple[str, ...]] = {"transfer-function": ("poles", "zeros", "hold", "sample")}
"""Families that are identified through their `structure`, and its arguments."""

_REQUIRED = ("poles", "zeros")


def add_to(parser: argparse.ArgumentParser) -> None:
    """Add the choice of a family and the options of its structure."""
    parser.add_argument(
        "--model",
        metavar="NAME|MODEL.json",
        required=True,
        help=f"{', '.join(FAMILIES)}; or a file with the model to begin from",
    )
    group = parser.add_argument_group("transfer function")
    group.add_argument("--poles", metavar="N", type=int, help="number of poles")
    group.add_argument("--zeros", metavar="N", type=int, help="number of zeros, at most that of the poles")
    group.add_argument("--hold", choices=("zoh", "foh"), help="input between samples: held (zoh) or linear (foh)")
    group.add_argument("--sample", choices=("start", "end"), help="when of the hold an output was taken")


def family(options: argparse.Namespace) -> Any:
    """What `identify` takes for these options.

    Raises
    ------
    ValueError
        If there is no such family, an option belongs to another one, or one that this family needs is missing.
    """
    if options.model not in FAMILIES and Path(options.model).suffix != ".json":
        raise ValueError(f"there is no model {options.model!r}: give a .json file or one of {', '.join(FAMILIES)}")
    own = STRUCTURES.get(options.model, ())
    given = {name: getattr(options, name) for names in STRUCTURES.values() for name in names}
    for name, value in given.items():
        if value is not None and name not in own:
            raise ValueError(f"--{name} is no option of the model {options.model}")
        if value is None and name in own and name in _REQUIRED:
            raise ValueError(f"the model {options.model} needs --{name}")
    if options.model not in FAMILIES:
        return read(options.model)[0]
    model = getattr(hysim, FAMILIES[options.model])
    return model.structure(**{name: value for name, value in given.items() if value is not None}) if own else model


def read(path: str) -> tuple[Any, dict[str, str]]:
    """The model that a file or the standard input holds, and its units."""
    from hysim.models.storage import from_json

    if path == STANDARD:
        return from_json(sys.stdin.read(), "the standard input")
    return from_json(Path(path).read_bytes(), path)


def simulated(model: Any, record: "hysim.Record", units: dict[str, str]) -> "hysim.Simulation":
    """The model's free run over the record's input.

    Raises
    ------
    ValueError
        If the model has no response, such as a controller.
    """
    if not callable(getattr(model, "response", None)):
        raise ValueError(f"a {type(model).__name__} has no response to simulate: give a law or a plant")
    return hysim.simulate(model, record.t, record.u, units=units)
