"""Models with which `hysim explore` begins: one for every family of laws, and some devices."""

import math

import numpy as np

import hysim as hs
from hysim._frozen import FloatArray
from hysim.export._page import Shown

_PIEZO = {"u": "V", "y": "um"}
_DAMPER = {"u": "mm", "y": "kN"}
_MOST_PLAYS = 20
_ENVELOPE = (1.2, 1.4, 0.0, 0.0, 0.1)


def presets() -> dict[str, Shown]:
    """Names to models."""
    grid = np.linspace(-1.0, 1.0, 11)
    thresholds = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7)
    return {
        "Bouc-Wen": Shown(hs.BoucWen(beta=0.6, gamma=0.2, feedthrough=0.1), (-2.0, 2.0)),
        "Prandtl-Ishlinskii": Shown(_stack(6, 1.2), (-2.0, 2.0), stack=True),
        "Dahl": Shown(hs.Dahl(stiffness=1.0, coulomb=0.8), (-2.0, 2.0)),
        "Piezo actuator": Shown(
            hs.PolynomialBoucWen(A=1.0, beta=0.05, gamma=-0.03, gain=-0.012, input_coefficients=(0.03, 4e-5)),
            *((0.0, 100.0), _PIEZO),
        ),
        "Friction damper with a spring": Shown(hs.Dahl(stiffness=20.0, coulomb=4.0) + hs.Line(slope=0.25), (-8.0, 8.0), _DAMPER),
        "Pinching and wear (Baber-Noori)": Shown(
            hs.BoucWenBaberNoori(beta=0.5, gamma=0.3, delta_nu=0.03, delta_eta=0.03, zeta_s=0.8, q=0.1, p=1.0, psi=0.3, lambda_=0.3),
            *((-4.0, 4.0), _DAMPER),
        ),
        "Asymmetric: Zhu-Wang": Shown(hs.ZhuWangBoucWen(beta=0.5, gamma=0.2, delta=0.15), (-2.0, 2.0)),
        "Asymmetric: generalised Bouc-Wen": Shown(hs.GeneralizedBoucWen(beta=0.5, gamma=0.2, b2=0.1, b4=0.1), (-2.0, 2.0)),
        "Magnet (Coleman-Hodgdon)": Shown(hs.ColemanHodgdon(), (-2.0, 2.0)),
        "Duhem": Shown(hs.Duhem(p=((1.0, -0.5), (0.0, 0.0)), q=((0.3, -0.2), (0.0, 0.0))), (-2.0, 2.0)),
        "Play": Shown(hs.Play(threshold=0.25), (-1.0, 1.0)),
        "Stop": Shown(hs.Stop(threshold=0.4), (-1.0, 1.0)),
        "Maxwell slip": Shown(hs.MaxwellSlip(stiffness=(1.0, 1.0, 1.0), slips=(0.2, 0.5, 0.9)), (-1.5, 1.5)),
        "Prandtl-Ishlinskii with dead zones": Shown(
            hs.ModifiedPrandtlIshlinskii(
                thresholds=thresholds, weights=(0.4, 0.3, 0.2, 0.2, 0.1, 0.1),
                dead_zones=(-0.4, 0.0, 0.4), dead_zone_weights=(0.3, 1.0, -0.3),
            ),
            (-1.0, 1.0),
        ),
        "Prandtl-Ishlinskii with envelopes": Shown(
            hs.GeneralizedPrandtlIshlinskii(thresholds=thresholds, weights=(0.3, 0.2, 0.2, 0.2, 0.1, 0.1), left=_ENVELOPE),
            (-2.0, 2.0),
        ),
        "Prandtl-Ishlinskii of a density": Shown(
            hs.ParametricPrandtlIshlinskii(exponent=-0.3, decay=0.4, weight=0.5, reach=2.0, plays=20.0), (-1.0, 1.0)
        ),
        "Prandtl-Ishlinskii with the rate": Shown(
            hs.RateDependentPrandtlIshlinskii(thresholds=thresholds, weights=(0.3, 0.2, 0.2, 0.2, 0.1, 0.1), beta=0.01),
            (-1.0, 1.0),
        ),
        "Preisach": Shown(hs.Preisach.from_density(grid, _density), (-1.0, 1.0)),
        "Preisach relays": Shown(
            hs.PreisachRelays(levels=(-1.0, -0.5, 0.0, 0.5, 1.0), weights=(0.1, 0.1, 0.3, 0.2, 0.3, 0.1, 0.1, 0.2, 0.1, 0.1)),
            (-1.0, 1.0),
        ),
    }  # fmt: skip


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
