"""Units of the numbers of laws, in units of the input u and the output y.

A number whose unit depends on a choice, such as that of a memory whose own unit is free, is not listed.
"""

from collections.abc import Mapping
from types import MappingProxyType

from hysim.models.law import Law

_PLAY = {"threshold": "u", "thresholds": "u", "gain": "y/u", "weights": "y/u", "offset": "y", "z0": "u"}
_PLANE = {"levels": "u", "weights": "y", "offset": "y", "z0": "u"}
_OF_MEMORY = {"n": "1", "offset": "y"}
_CORE = {
    "saturation": "y", "coercivity": "u", "squareness": "1", "feedthrough": "y/u", "offset": "y", "z0": "1",
}  # fmt: skip
_BOUC_WEN = _OF_MEMORY | {"feedthrough": "y/u"}

FIELD_UNITS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "BoucWen": _BOUC_WEN,
        **dict.fromkeys(("PolynomialBoucWen", "ZhuWangBoucWen", "GeneralizedBoucWen"), _OF_MEMORY),
        "BoucWenBaberNoori": _OF_MEMORY,
        "Duhem": {"feedthrough": "y/u", "offset": "y", "y0": "y"},
        "Dahl": {"stiffness": "y/u", "coulomb": "y", "offset": "y", "z0": "y"},
        "ColemanHodgdon": {"alpha": "1/u", "c": "y/u", "B": "y/u", "offset": "y", "z0": "y"},
        "JilesAtherton": {"alpha": "1", "c": "1", "anisotropy": "1", "reversible_feedback": "1", "offset": "y"}
        | dict.fromkeys(("Ms", "a", "k", "z0"), "u") | dict.fromkeys(("gain", "feedthrough"), "y/u"),
        **dict.fromkeys(("Play", "Stop", "PrandtlIshlinskii"), _PLAY),
        "ModifiedPrandtlIshlinskii": {"thresholds": "u", "offset": "y", "z0": "u"},
        "GeneralizedPrandtlIshlinskii": {"offset": "y"},
        "RateDependentPrandtlIshlinskii": _PLAY | {"beta": "s"},
        "ParametricPrandtlIshlinskii": {
            "exponent": "1", "decay": "u", "weight": "y/u", "offset": "y", "reach": "u", "plays": "1", "z0": "u",
        },
        "MaxwellSlip": {"stiffness": "y/u", "slips": "u", "feedthrough": "y/u", "offset": "y", "z0": "u"},
        **dict.fromkeys(("Preisach", "PreisachRelays"), _PLANE),
        "Tellinen": _CORE,
        "TellinenTable": {
            "inputs": "u", "lower": "y", "upper": "y", "feedthrough": "y/u", "offset": "y", "z0": "1",
        },
        "Chan": _CORE | {"gap": "u/y"},
        "EnergyPlays": {
            "thresholds": "u", "weights": "y", "field": "u", "feedthrough": "y/u", "offset": "y", "z0": "u",
        },
        "Line": {"offset": "y", "slope": "y/u"},
        "ReversalFilter": {"threshold": "u"},
    }
)  # fmt: skip
"""Units by the name of a family and the names of its fields; ``"1"`` is dimensionless."""


def field_unit(law: Law, name: str) -> str:
    """The unit of one number of a law, as in ``"y/u"``; empty where it is not known.

    A family that is not listed has those of the parameters that it declares for searches.

    >>> import hysim as hs
    >>> field_unit(hs.Dahl(), "stiffness")
    'y/u'
    """
    field = name.partition("[")[0]
    listed = FIELD_UNITS.get(type(law).__name__)
    if listed is not None:
        return listed.get(field, "")
    units = {each.name: each.unit for each in law.searched if each.unit != "1"}
    return units.get(field, "")
