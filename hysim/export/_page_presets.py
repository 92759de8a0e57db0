"""Models with which `hysim explore` begins: one for every family of laws, and some devices."""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np

import hysim as hs
from hysim._atomic import write_text
from hysim._frozen import FloatArray
from hysim.benchmarks import noel_schoukens_plant
from hysim.export._page import Shown, checked_path, page_text

_DAMPER = {"u": "mm", "y": "kN"}
_CONTACT = {"u": "mm", "y": "N"}
_UNIT, _WIDE = (-1.0, 1.0), (-2.0, 2.0)
_MOST_PLAYS = 20


def presets() -> dict[str, Shown]:
    """Names to models, in the order in which the page lists them."""
    groups = {
        "Differential laws": _differential(),
        "Plays, stops, relays": _operators(),
        "Friction and backlash": _contacts(),
        "Magnetic cores": _cores(),
        "Devices": _devices(),
    }
    return {name: shown._replace(group=group) for group, models in groups.items() for name, shown in models.items()}


def explorer(path: str | Path) -> Path:
    """Write the page with a choice of families and devices.

    Parameters
    ----------
    path : path
        The file to write, which ends in ``.html`` or ``.htm``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    OSError
        If it cannot be written.
    ValueError
        For another ending of the path.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from hysim.export import explorer
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     "Loop explorer" in explorer(pathlib.Path(folder, "explorer.html")).read_text()
    True
    """
    page = checked_path(path)
    write_text(page, _text())
    return page


@lru_cache(maxsize=1)
def _text() -> str:
    return page_text(presets(), title="Loop explorer")


def _differential() -> dict[str, Shown]:
    skew = hs.GeneralizedBoucWen(beta=0.5, gamma=0.2, b2=0.1, b4=0.1)
    return {
        "Bouc-Wen": Shown(hs.BoucWen(beta=0.6, gamma=0.2, feedthrough=0.1), _WIDE),
        "Dahl": Shown(hs.Dahl(stiffness=1.0, coulomb=0.8), _WIDE),
        "Zhu-Wang: asymmetric": Shown(hs.ZhuWangBoucWen(beta=0.5, gamma=0.2, delta=0.15), _WIDE),
        "Generalised Bouc-Wen": Shown(skew, _WIDE),
        "Coleman-Hodgdon: magnet": Shown(hs.ColemanHodgdon(), _WIDE),
        "Duhem": Shown(hs.Duhem(p=np.array([[1.0, -0.5]]), q=np.array([[0.3, -0.2]])), _WIDE),
    }


def _devices() -> dict[str, Shown]:
    piezo = hs.PolynomialBoucWen(A=1.0, beta=0.05, gamma=-0.03, gain=-0.012, input_coefficients=(0.03, 4e-5))
    pinching = hs.BoucWenBaberNoori(
        beta=0.5, gamma=0.3, delta_nu=0.03, delta_eta=0.03, zeta_s=0.8, q=0.1, p=1.0, psi=0.3, lambda_=0.3
    )
    friction = hs.Dahl(stiffness=20.0, coulomb=4.0) + hs.Line(slope=0.25)
    damper = hs.BoucWen(A=10.0, beta=2.0, gamma=2.0, feedthrough=0.2) + hs.Dashpot(c=0.02)
    steel = hs.JilesAtherton(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=400.0, c=0.2)
    return {
        "Piezo actuator": Shown(piezo, (0.0, 100.0), {"u": "V", "y": "um"}),
        "Friction damper and spring": Shown(friction, (-8.0, 8.0), _DAMPER),
        "Magnetorheological damper": Shown(damper, (-8.0, 8.0), _DAMPER),
        "Baber-Noori: wear and pinching": Shown(pinching, (-4.0, 4.0), _DAMPER),
        "Noël-Schoukens benchmark": Shown(noel_schoukens_plant().law, (-2e-3, 2e-3), {"u": "m", "y": "N"}),
        "Steel core": Shown(steel, (-5e3, 5e3), {"u": "A/m", "y": "T"}),
    }


def _operators() -> dict[str, Shown]:
    thresholds, weights = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7), (0.4, 0.3, 0.2, 0.2, 0.1, 0.1)
    bent = hs.ModifiedPrandtlIshlinskii(
        thresholds=thresholds, weights=weights, dead_zones=(-0.4, 0.0, 0.4), dead_zone_weights=(0.3, 1.0, -0.3)
    )
    pushed = hs.GeneralizedPrandtlIshlinskii(thresholds=thresholds, weights=weights, left=(1.2, 1.4, 0.0, 0.0, 0.1))
    dense = hs.ParametricPrandtlIshlinskii(exponent=-0.3, decay=0.4, weight=0.5, reach=2.0, plays=20.0)
    timed = hs.RateDependentPrandtlIshlinskii(thresholds=thresholds, weights=weights, beta=0.005)
    relays = (0.1, 0.1, 0.3, 0.2, 0.3, 0.1, 0.1, 0.2, 0.1, 0.1)
    return {
        "Prandtl-Ishlinskii": Shown(_stack(6, 1.2), _WIDE, stack=True),
        "Prandtl-Ishlinskii: dead zones": Shown(bent, _UNIT),
        "Prandtl-Ishlinskii: envelopes": Shown(pushed, _WIDE),
        "Prandtl-Ishlinskii: density": Shown(dense, _UNIT),
        "Prandtl-Ishlinskii: with the rate": Shown(timed, _UNIT),
        "Play": Shown(hs.Play(threshold=0.25), _UNIT),
        "Stop": Shown(hs.Stop(threshold=0.4), _UNIT),
        "Filter of small reversals": Shown(hs.ReversalFilter(threshold=0.3), _UNIT),
        "Maxwell slip": Shown(hs.MaxwellSlip(stiffness=(1.0, 1.0, 1.0), slips=(0.2, 0.5, 0.9)), (-1.5, 1.5)),
        "Preisach": Shown(hs.Preisach.from_density(np.linspace(-1.0, 1.0, 11), _density), _UNIT),
        "Preisach relays": Shown(hs.PreisachRelays(levels=(-1.0, -0.5, 0.0, 0.5, 1.0), weights=relays), _UNIT),
    }


def _cores() -> dict[str, Shown]:
    core = hs.EnergyPlays(thresholds=(0.0, 0.2, 0.5), weights=(0.2, 0.6, 0.4), field=0.15)
    static = hs.MaxwellSlip(stiffness=(200.0, 100.0, 50.0), slips=(0.2, 0.5, 1.0))
    losses = static + hs.Dashpot(c=4.0) + hs.ExcessLoss(c=10.0)
    table = hs.TellinenTable(
        inputs=(-2.0, -1.0, 0.0, 1.0, 2.0), lower=(-1.0, -0.9, -0.5, 0.6, 1.0), upper=(-1.0, -0.6, 0.5, 0.9, 1.0)
    )
    return {
        "Magnetic core: Jiles-Atherton": Shown(
            hs.JilesAtherton(Ms=1.0, a=0.3, alpha=0.1, k=0.4, gain=1.0, feedthrough=0.0), _WIDE
        ),
        "Magnetic core: Tellinen": Shown(hs.Tellinen(coercivity=0.4, squareness=0.7), _WIDE),
        "Magnetic core: Tellinen's branches from a table": Shown(table, _WIDE),
        "Magnetic core: Chan": Shown(hs.Chan(coercivity=0.4, squareness=0.5), _WIDE),
        "Magnetic core: energy-based plays": Shown(core, _WIDE),
        "Magnetic core: static, eddy current and excess field": Shown(
            losses, _UNIT, {"u": "T", "y": "A/m"}, kind="sine"
        ),
    }


def _contacts() -> dict[str, Shown]:
    bristles = hs.LuGre(sigma0=20.0, sigma1=0.1, sigma2=0.02, coulomb=1.0, breakaway=1.5, stribeck_velocity=2.0)
    curve = hs.StribeckFriction(coulomb=1.0, breakaway=1.5, breakaway_velocity=1.0, viscous=0.05)
    slips = hs.GeneralizedMaxwellSlip(
        stiffness=(20.0, 10.0, 5.0), weights=(0.4, 0.3, 0.3), stribeck_velocity=2.0, attraction=50.0, viscous=0.02
    )
    shaft = hs.ElasticBacklash(stiffness=2.0, damping=0.05, half_gap=0.4)
    return {
        "Friction: LuGre": Shown(bristles, _UNIT, _CONTACT, kind="sine"),
        "Friction: Stribeck": Shown(curve, _UNIT, _CONTACT, kind="sine"),
        "Friction: Maxwell slip with a lag": Shown(slips, _UNIT, _CONTACT, kind="sine"),
        "Backlash of an elastic shaft": Shown(shaft, _UNIT, {"u": "rad", "y": "N m"}, kind="sine"),
    }


def _stack(plays: int, reach: float) -> hs.PrandtlIshlinskii:
    """Plays with thresholds in even steps and equal weights; the page may add more, whose weights are zero."""
    steps = np.arange(_MOST_PLAYS + 1)
    weights = np.where((steps > 0) & (steps <= plays), 1.0 / plays, 0.0)
    return hs.PrandtlIshlinskii(
        thresholds=tuple((reach * steps / plays).tolist()), weights=(0.3, *weights[1:].tolist()), z0=(0.0,)
    )


def _density(up: FloatArray, down: FloatArray) -> FloatArray:
    """Weight of relays: two bells, about the diagonal and about the line where both thresholds are opposite."""
    width, middle = up - down, 0.5 * (up + down)
    return np.exp(-4.0 * middle**2) * np.exp(-((width - 0.5) ** 2) / 0.2) / math.sqrt(math.pi)
