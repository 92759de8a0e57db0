"""A law of every family that an element takes: a column of about 100 N/m that yields at about 0.03 m."""

import math

import numpy as np
from square_dahl import SquareDahl

import hysim as hs


def stable_play(parameters, state, u):
    """A slip as a user writes it, beside a spring."""
    state[1] = min(max(state[1] + u - state[0], -parameters[1]), parameters[1])
    state[0] = u
    return parameters[2] * u + parameters[0] * state[1]


def bouc_wen(n: float = 1.0, **others: float) -> hs.BoucWen:
    """A column with 70 N/m in the hysteretic part."""
    shape = {"A": 1.0, "beta": 0.6 * 0.03**-n, "gamma": 0.4 * 0.03**-n, "n": n, "gain": 70.0, "feedthrough": 30.0}
    return hs.BoucWen(**{**shape, **others})


LEVELS = tuple((0.02 * np.arange(-4.0, 5.0)).tolist())
RELAYS = tuple(0.02 + 0.01 * math.cos(k) for k in range(len(LEVELS) * (len(LEVELS) - 1) // 2))
SPRING = hs.Line(slope=60.0)
GROWN = {"A": 1.0, "beta": 0.6 / 0.03, "gamma": 0.4 / 0.03, "n": 1.0}

SMOOTH = {
    "BoucWen": bouc_wen(),
    "BoucWen of n = 2": bouc_wen(2.0),
    "BoucWen of n = 1.5": bouc_wen(1.5),
    "BoucWen that softens": bouc_wen(2.0, feedthrough=-2.0),
    "PolynomialBoucWen": hs.PolynomialBoucWen(**GROWN, gain=70.0, input_coefficients=(30.0, 0.0, 400.0)),
    "ZhuWangBoucWen": hs.ZhuWangBoucWen(**GROWN, gain=70.0, input_coefficients=(30.0,), delta=5.0),
    "GeneralizedBoucWen": hs.GeneralizedBoucWen(
        **GROWN, b2=3.0, b3=-2.0, b4=1.0, b5=0.5, b6=-1.0, gain=70.0, input_coefficients=(30.0,)
    ),
    "BoucWenBaberNoori": hs.BoucWenBaberNoori(
        **GROWN, gain=70.0, input_coefficients=(30.0,), delta_nu=20.0, delta_eta=10.0, delta_a=2.0
    ),
    "BoucWenBaberNoori that pinches": hs.BoucWenBaberNoori(
        **{"delta_nu": 5.0, "delta_eta": 5.0, "zeta_s": 0.7, "q": 0.1, "p": 50.0, "psi": 0.01, "lambda_": 0.3},
        **{**GROWN, "gain": 70.0, "input_coefficients": (30.0,), "delta_psi": 0.02},
    ),
    "Duhem": hs.Duhem.from_terms({"u'": 70.0, "|u'| z": -30.0}, feedthrough=30.0),
    "Dahl": hs.Dahl(stiffness=100.0, coulomb=3.0),
    "ColemanHodgdon": hs.ColemanHodgdon(alpha=30.0, c=30.0, B=100.0),
    "VaianaRosati": hs.VaianaRosati(k_b=30.0, f_0=2.3, alpha=30.0, gamma_1=0.5, gamma_2=50.0),
    "MenegottoPinto": hs.MenegottoPinto(stiffness=100.0, yield_input=0.02, hardening=10.0),
    "JilesAtherton": hs.JilesAtherton(Ms=0.03, a=0.02, alpha=-0.5, k=0.03, gain=100.0, feedthrough=50.0),
    "Tellinen": hs.Tellinen(saturation=2.0, coercivity=0.01, squareness=0.4, feedthrough=30.0),
    "SquareDahl": SquareDahl(k=70.0, coulomb=2.0, c=30.0),
    "Line": hs.Line(slope=100.0),
    "Sum": bouc_wen() + hs.Dahl(stiffness=30.0, coulomb=1.0) + hs.Dashpot(c=0.3),
    "Cascade": hs.Line(slope=2.0) >> bouc_wen(2.0, gain=35.0, feedthrough=15.0),
}
KINKED = {
    "Play": hs.Play(threshold=0.01, gain=100.0),
    "Stop": hs.Stop(threshold=0.02, gain=70.0) + SPRING,
    "PrandtlIshlinskii": hs.PrandtlIshlinskii(thresholds=(0.0, 0.01, 0.03), weights=(60.0, 30.0, 10.0)),
    "ModifiedPrandtlIshlinskii": hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, 0.01), weights=(0.7, 0.3), dead_zones=(-0.03, 0.0, 0.03), dead_zone_weights=(20.0, 90.0, -20.0)
    ),
    "GeneralizedPrandtlIshlinskii": hs.GeneralizedPrandtlIshlinskii(
        thresholds=(0.0, 0.01), weights=(70.0, 30.0), left=(0.05, 10.0, 0.0, 0.0, 0.5)
    ),
    "ParametricPrandtlIshlinskii": hs.ParametricPrandtlIshlinskii(
        exponent=0.5,
        decay=0.02,
        reach=0.1,
        weight=30.0,
        weight_slope=0.0,
        offset=0.0,
        input_coefficients=(60.0,),
        plays=8.0,
        z0=(0.0,),
    ),
    "MaxwellSlip": hs.MaxwellSlip(stiffness=(40.0, 40.0), slips=(0.01, 0.03), feedthrough=20.0),
    "Bilinear": hs.Bilinear(stiffness=100.0, hardening=20.0, yield_input=0.02),
    "FlagShape": hs.FlagShape(stiffness=100.0, hardening=20.0, activation=0.02),
    "Slack": hs.Slack(stiffness=70.0, opposite_stiffness=70.0, slack=0.01, yield_input=0.02) + SPRING,
    "OriginOriented": hs.OriginOriented(stiffness=100.0, hardening=20.0, yield_input=0.02),
    "PeakOriented": hs.PeakOriented(stiffness=100.0, hardening_ratio=0.2, yield_input=0.02),
    "IbarraMedinaKrawinkler": hs.IbarraMedinaKrawinkler(stiffness=100.0, yield_input=0.02, cap_input=0.2, Lambda_s=1.0),
    "FolzFiliatrault": hs.FolzFiliatrault(stiffness=100.0, knee_input=0.03, pinch_input=0.005, peak_input=0.3),
    "TabulatedDahl": hs.TabulatedDahl(
        inputs=(-0.1, 0.0, 0.1), centre=(-6.0, 0.0, 6.0), amplitude=(1.0, 2.0, 1.0), rate=40.0
    ),
    "TellinenTable": hs.TellinenTable(
        inputs=(-0.1, -0.02, 0.0, 0.02, 0.1),
        lower=(-1.0, -0.9, -0.3, 0.7, 1.0),
        upper=(-1.0, -0.7, 0.3, 0.9, 1.0),
        feedthrough=30.0,
    ),
    "Chan": hs.Chan(saturation=1.0, coercivity=0.01, squareness=0.3, feedthrough=30.0),
    "EnergyPlays": hs.EnergyPlays(thresholds=(0.0, 0.01), weights=(1.0, 2.0), field=0.02, feedthrough=30.0),
    "Preisach": hs.Preisach(levels=LEVELS, weights=RELAYS) + SPRING,
    "CustomLaw": hs.CustomLaw(step=stable_play, parameters={"k": 70.0, "slip": 0.02, "c": 30.0}, state={"z": 0.0}),
}
JUMPING = {"PreisachRelays": hs.PreisachRelays(levels=LEVELS, weights=RELAYS) + SPRING}
LAWS = {**SMOOTH, **KINKED, **JUMPING}
MEMBERS = [part for law in LAWS.values() for part in (law, *(law.parts if isinstance(law, hs.Sum) else ()))]
FAMILIES = {type(part).__name__ for part in MEMBERS}
