"""Do the rules of structural components agree with OpenSees, and are they found again from a noisy test?

Each rule is driven through the same growing cycles as its counterpart in OpenSees, with 20 and with 2 000 steps a
stroke: what is left with many steps is a difference of the rules, which docs/components.md explains.

Forty tests of pinching joints are simulated, half of them by each of two rules with random numbers: pairs of growing
cycles, each amplitude 5 % off, with noise of half a percent of the force's range. The law that made the test is
identified. So are, from a few of them, those of Baber and Noori, and of Preisach. The error is that in free run against
the noisy force, in percent of its range, and that of a number the median over those that every test tells.

A spectrum of constant ductility is that of a bilinear law for 100 periods in 20 earthquakes; OpenSees solves the same
equations, with one Newmark step a sample, for some of the systems that the search asks for.

``python experiments/58_components.py FOLDER`` identifies measured records of steel and of a damper, which are public
and not part of hysim, and adds them to the result.
"""

import sys
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from peers.contest import peer
from results_folder import cpu_timed, median_and_worst, stored_result, wall_timed, write_files, write_results

RESULTS = Path(__file__).parent / "results" / "components"
STEPS, CORNERS = (20, 2000), np.append(0.0, np.ravel([np.linspace(1.2, 4.0, 8), -np.linspace(1.2, 4.0, 8)], order="F"))
TESTS, RIVALS, NOISE = 20, 3, 0.005  # of each of two laws, of them with rivals, and of the force's range
AMPLITUDES = np.repeat([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0], 2)
NONE = 1e9  # capacity of a mode that OpenSees cannot leave out
IMK, FOLZ = hs.IbarraMedinaKrawinkler, hs.FolzFiliatrault
OTHERS = hs.BoucWenBaberNoori, hs.Preisach
HARDENING, DUCTILITY, SAMPLED = 0.05, 4.0, 10  # of the spectrum, and periods that OpenSees solves
SOLUTION: dict[str, tuple[Any, ...]] = {
    "constraints": ("Plain",), "numberer": ("Plain",), "system": ("ProfileSPD",), "test": ("NormUnbalance", 1e-10, 20),
    "algorithm": ("Newton",), "integrator": ("Newmark", 0.5, 0.25), "analysis": ("Transient",),
}  # fmt: skip
Row = dict[str, Any]


def in_both(*numbers: float) -> tuple[float, ...]:
    """Numbers for a rising and for a falling input."""
    return (*numbers, *numbers)


def imk(a: Mapping[str, float]) -> tuple[Any, ...]:
    """Arguments of the pinching material."""
    modes = [a[f"Lambda_{mode}"] or NONE for mode in "SCAK"]
    side = a["Up"], a["Upc"], NONE, a["Fy"], a["FmaxFy"], a["ResF"]
    return (
        "IMKPinching",
        a["Ke"],
        *in_both(*side),
        *modes,
        *in_both(*in_both(a["c"])),
        1.0,
        1.0,
        a["kappaF"],
        a["kappaD"],
    )


RULES: dict[Any, Callable[[Mapping[str, float]], tuple[Any, ...]]] = {
    hs.Bilinear(isotropic=0.03): lambda a: ("Hardening", a["E"], a["sigmaY"], a["H_iso"], a["H_kin"]),
    hs.FlagShape(): lambda a: ("SelfCentering", *a.values()),
    hs.Slack(slack=0.3): lambda a: ("ElasticPPGap", *a.values(), "damage"),
    hs.OriginOriented(): lambda a: ("OriginCentered", *a.values()),
    hs.PeakOriented(): lambda a: (
        "Hysteretic", 1.0, 1.0, 1.05, 2.0, 1.5, 11.0, -1.0, -1.0, -1.05, -2.0, -1.5, -11.0, 1.0, 1.0, 0.0, 0.0, 0.4
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
    row: Row = {"law": type(law).__name__, "material": words(law.to_opensees())[0]}
    for steps in STEPS:
        u = growing(CORNERS, steps)
        y, other = law.response(u), theirs(ops, words(law.to_opensees()), u)
        row[f"difference_{steps}_percent"] = 100.0 * float(np.abs(y - other).max() / np.ptp(y))
        row |= {"theirs": np.round(other, 4).tolist()} if steps == STEPS[0] else {}
    return row


def simulated(family: Any, seed: int) -> tuple[Any, hs.Record]:
    """A law with random numbers, and a noisy test of it."""
    rng = np.random.default_rng(seed)
    boxes = {
        IMK: {
            "stiffness": (5.0, 20.0), "yield_input": (0.6, 1.2), "hardening_ratio": (0.01, 0.08),
            "cap_input": (3.0, 5.0), "capping_ratio": (0.03, 0.15), "residual": (0.0, 0.3),
            "pinch_force": (0.15, 0.6), "pinch_input": (0.0, 0.5), "Lambda_s": (30.0, 120.0), "Lambda_k": (30.0, 120.0),
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


def their_ductility(ops: Any, period: float, strength: float, ground: np.ndarray, step: float) -> float:
    """Ductility of one bilinear oscillator in OpenSees, one step a sample."""
    w, peak = 2.0 * np.pi / period, 0.0
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    for node in (1, 2):
        ops.node(node, 0.0)
    ops.fix(1, 1)
    ops.mass(2, 1.0)
    ops.uniaxialMaterial("Steel01", 1, strength, w * w, HARDENING)
    ops.element("zeroLength", 1, 1, 2, "-mat", 1, "-dir", 1)
    ops.rayleigh(0.1 * w, 0.0, 0.0, 0.0)  # 5 % of the critical damping
    ops.timeSeries("Path", 1, "-dt", step, "-values", *ground.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    for word, options in SOLUTION.items():
        getattr(ops, word)(*options)
    for _ in ground:
        ops.analyze(1, step)
        peak = max(peak, abs(ops.nodeDisp(2, 1)))
    return peak * w * w / strength


def spectrum(ops: Any, n_records: int, n_periods: int) -> Row:
    """Seconds of a spectrum of constant ductility, and those of a loop in OpenSees from a sample of its systems."""
    motions = [hs.signals.ground_motion(3.0, duration=30.0, sample_time=0.01, seed=k) for k in range(n_records)]
    periods, law = np.geomspace(0.1, 3.0, n_periods), hs.Bilinear(hardening=HARDENING)
    hs.response_spectrum(motions[:1], 0.01, periods[:1], law=law, ductility=DUCTILITY)  # compiles
    found, seconds = wall_timed(hs.response_spectrum, motions, 0.01, periods, law=law, ductility=DUCTILITY)
    offs, theirs_seconds = [], []
    for k in range(0, n_periods, max(1, n_periods // SAMPLED)):
        strength = found.pseudo_acceleration[0, k]

        def excess(x: float, k: int = k) -> float:
            return their_ductility(ops, periods[k], float(np.exp(x)), motions[0], 0.01) - DUCTILITY

        around = np.log(strength) + np.array([-0.2, 0.2])
        root, spent = wall_timed(brentq, excess, *around, xtol=1e-4)
        theirs_seconds.append(spent)
        offs.append(100.0 * abs(np.expm1(root - np.log(strength))))
    return {
        "spectrum_records": n_records, "spectrum_periods": n_periods, "spectrum_seconds": seconds,
        "their_seconds_a_system": float(np.median(theirs_seconds)),
        "their_seconds_in_all": float(np.median(theirs_seconds)) * n_records * n_periods,
        "their_strength_off_percent": float(np.median(offs)), "their_strength_worst_off_percent": max(offs),
    }  # fmt: skip


def measured(folder: Path) -> list[Row]:
    """Errors and seconds on three steel coupons and a magnetorheological damper, whose files stand in a folder."""
    recs = {
        "damper": hs.load(
            folder / "mr_damper_labcontrol/data_simulation_4.2_MRdamper.mat", u="x_F[0]", y="x_F[2]", t=False
        )
    }
    for k in (1, 2, 3):
        recs[f"steel {k}"] = hs.load(folder / f"steel_resspylab/example_{k}.csv", u="e_true", y="Sigma_true")
    rows = []
    for (name, rec), law in product(recs.items(), (hs.Bilinear, hs.MenegottoPinto, hs.VaianaRosati, *OTHERS)):
        fit, seconds = cpu_timed(hs.identify, law, rec)
        error = 100.0 * fit.rmse / float(np.ptp(rec.y))
        rows.append({"record": name, "law": law.__name__, "error_percent": error, "seconds": seconds})
    return rows


def main(smoke: bool = False) -> list[Row]:
    """Compare, calibrate and time, and unless it is a smoke run write table, figure and JSON."""
    ops = peer("openseespy.opensees")
    if ops is None:
        return calibrated(FOLZ, 0, ())
    rules = [beside_opensees(ops, law, words) for law, words in RULES.items()]
    families = [(family, k) for family in (IMK, FOLZ) for k in range(1 if smoke else TESTS)]
    tests = [row for family, k in families for row in calibrated(family, k, OTHERS if k < RIVALS and not smoke else ())]
    numbers: Row = spectrum(ops, *((1, 2) if smoke else (20, 100))) | {"rules": rules}
    for name in dict.fromkeys(row["law"] for row in tests):
        own = [row for row in tests if row["law"] == name]
        for what in ("error_percent", "seconds"):
            numbers[f"{name}_{what}"] = median_and_worst(what, [row[what] for row in own])
    for family in (IMK, FOLZ):
        offs = [row["numbers_off_percent"] for row in tests if row["law"] == family.__name__]
        numbers[f"{family.__name__}_numbers"] = median_and_worst("off_percent", offs)
    return write_results(RESULTS, tests, partial(draw, rules), numbers, smoke=smoke)


def draw(rules: list[Row], rows: list[Row]) -> Figure:
    """Every rule over growing cycles, on top of its counterpart."""
    canvas = figure(width=10.0, height=5.0)
    u = growing(CORNERS, STEPS[0])
    for ax, law, row in zip(canvas.subplots(2, 4).flat, RULES, rules, strict=True):
        ax.plot(u, row["theirs"], color="#D55E00", lw=2.5, alpha=0.5, label="OpenSees")
        ax.plot(u, law.response(u), color="k", lw=0.7, label="hysim")
        ax.set(title=row["material"], xticks=[-4, 0, 4])
    canvas.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    if len(sys.argv) > 1:  # the measured records alone, beside what is stored
        stored = stored_result(RESULTS) | {"measured": measured(Path(sys.argv[1]))}
        write_files(RESULTS, stored.pop("rows"), partial(draw, stored["rules"]), stored)
    else:
        main()
