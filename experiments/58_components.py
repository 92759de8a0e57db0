"""Do the rules of structural components agree with OpenSees, and are they found again from a noisy test?

Each rule is driven through the same growing cycles as its counterpart in OpenSees, with 20 and with 2 000 steps a
stroke: what is left with many steps is a difference of the rules, which docs/components.md explains.

Forty tests of pinching joints are simulated, half of them by each of two rules with random numbers: pairs of growing
cycles, each amplitude 5 % off, with noise of half a percent of the force's range. The law that made the test is
identified. So are, from a few of them, those of Baber and Noori, and of Preisach. The error is that in free run against
the noisy force, in percent of its range, and that of a number the median over those that every test tells.

A spectrum of constant ductility is that of a bilinear law for 100 periods in 20 earthquakes; OpenSees solves the same
equations, with one Newmark step a sample, for some of the systems that the search asks for.
"""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from peers.contest import peer
from results_folder import cpu_timed, wall_timed, write_results

RESULTS = Path(__file__).parent / "results" / "components"
STEPS, CYCLES, REACH = (20, 2000), np.linspace(0.3, 1.0, 8), 4.0
TESTS, RIVALS, NOISE = 20, 3, 0.005  # of each of two laws, of them with rivals, and of the force's range
AMPLITUDES = np.repeat([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0], 2)
NONE = 1e9  # capacity of a mode that OpenSees cannot leave out
IMK, FOLZ = hs.IbarraMedinaKrawinkler, hs.FolzFiliatrault
Row = dict[str, Any]


def in_both(*numbers: float) -> tuple[float, ...]:
    """Numbers for a rising and for a falling input."""
    return (*numbers, *numbers)


def imk(a: Mapping[str, float]) -> tuple[Any, ...]:
    """Arguments of the pinching material."""
    modes = [a[f"Lambda_{mode}"] or NONE for mode in "SCAK"]
    side = a["Up"], a["Upc"], NONE, a["Fy"], a["FmaxFy"], a["ResF"]
    return "IMKPinching", a["Ke"], *in_both(*side), *modes, *in_both(*in_both(a["c"])), 1.0, 1.0, a["kappaF"], a["kappaD"]


RULES: dict[Any, Callable[[Mapping[str, float]], tuple[Any, ...]]] = {
    hs.Bilinear(isotropic=0.03): lambda a: ("Hardening", a["E"], a["sigmaY"], a["H_iso"], a["H_kin"]),
    hs.FlagShape(): lambda a: ("SelfCentering", *a.values()),
    hs.Slack(slack=0.3): lambda a: ("ElasticPPGap", *a.values(), "damage"),
    hs.OriginOriented(): lambda a: ("OriginCentered", *a.values()),
    hs.PeakOriented(): lambda a: (
        "Hysteretic", *(1.0, 1.0, 1.05, 2.0, 1.5, 11.0, -1.0, -1.0, -1.05, -2.0, -1.5, -11.0), *(1.0, 1.0, 0.0, 0.0, 0.4)
    ),
    IMK(**dict.fromkeys(("Lambda_s", "Lambda_c", "Lambda_k"), 60.0)): imk,
    FOLZ(knee_input=0.5, pinch_input=0.1, peak_input=3.0): lambda a: ("SAWS", *a.values()),
    hs.MenegottoPinto(a1=0.02, a3=0.02, least_reversal=0.0): lambda a: ("Steel02", *a.values()),
}  # fmt: skip


def growing(corners: np.ndarray, steps: int) -> np.ndarray:
    """An input through these corners, with so many steps in each stroke."""
    return np.interp(np.arange((len(corners) - 1) * steps + 1) / steps, np.arange(len(corners)), corners)


def theirs(ops: Any, words: tuple[Any, ...], u: np.ndarray) -> np.ndarray:
    """Stresses of a material of OpenSees."""
    ops.wipe()
    ops.uniaxialMaterial(words[0], 1, *words[1:])
    ops.testUniaxialMaterial(1)
    return np.array([(ops.setStrain(each), ops.getStress())[1] for each in u.tolist()])


def beside_opensees(ops: Any, law: Any, words: Callable[[Mapping[str, float]], tuple[Any, ...]]) -> Row:
    """Largest differences from the counterpart, in percent of the force's range."""
    corners = np.append(0.0, REACH * np.ravel([CYCLES, -CYCLES], order="F"))
    row: Row = {"law": type(law).__name__, "material": words(law.to_opensees())[0]}
    for steps in STEPS:
        u = growing(corners, steps)
        y, other = law.response(u), theirs(ops, words(law.to_opensees()), u)
        row[f"difference_{steps}_percent"] = 100.0 * float(np.abs(y - other).max() / np.ptp(y))
        row |= {"u": u.tolist(), "y": y.tolist(), "theirs": other.tolist()} if steps == STEPS[0] else {}
    return row


def simulated(family: Any, seed: int) -> tuple[Any, hs.Record]:
    """A law with random numbers, and a noisy test of it."""
    rng = np.random.default_rng(seed)
    boxes = {
        IMK: {
            "stiffness": (5.0, 20.0), "yield_input": (0.6, 1.2), "hardening_ratio": (0.01, 0.08), "cap_input": (3.0, 5.0),
            "capping_ratio": (0.03, 0.15), "residual": (0.0, 0.3), "pinch_force": (0.15, 0.6), "pinch_input": (0.0, 0.5),
            "Lambda_s": (30.0, 120.0), "Lambda_k": (30.0, 120.0),
        },
        FOLZ: {
            "stiffness": (5.0, 20.0), "knee_input": (0.4, 1.0), "pinch_input": (0.05, 0.2), "peak_input": (3.0, 8.0),
            "r_1": (0.02, 0.1), "r_2": (-0.1, -0.03), "r_3": (1.0, 2.0), "r_4": (0.01, 0.03), "alpha": (0.4, 0.9),
            "beta": (1.02, 1.2),
        },
    }  # fmt: skip
    law = family(**{name: rng.uniform(*box) for name, box in boxes[family].items()})
    sizes = AMPLITUDES * (1.0 + 0.05 * rng.normal(size=AMPLITUDES.size))
    u = growing(np.append(0.0, np.ravel([sizes, -sizes], order="F")), 40)
    y = law.response(u)
    return law, hs.Record(u=u, y=y + NOISE * np.ptp(y) * rng.normal(size=y.size))


def calibrated(family: Any, seed: int, rivals: tuple[Any, ...]) -> list[Row]:
    """The law of a simulated test and its rivals, identified: errors and seconds."""
    truth, rec = simulated(family, seed)
    told = [name for name in truth.scalars if name not in ("cap_input", "capping_ratio", "residual", "c")]
    rows = []
    for law in (family, *rivals):
        fit, seconds = cpu_timed(hs.identify, law, rec)
        row = {"test": f"{family.__name__} {seed}", "law": law.__name__, "seconds": seconds}
        row["error_percent"] = 100.0 * fit.rmse / float(np.ptp(rec.y))
        if law is family:
            off = [abs(fit.estimates[name] / truth.scalars[name] - 1.0) for name in told if truth.scalars[name] != 0.0]
            row["numbers_off_percent"] = 100.0 * float(np.median(off))
        rows.append(row)
    return rows
