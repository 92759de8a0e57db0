"""Does every verb say of a fit what the returned model does, and is a stranger's record handled safely?

Simulated twins, whose truth is known: laws of several families under an input with noise of 0 to 1 % of its span, one
that begins in the middle of a cycle, an output that is rounded, creeps, is a butterfly or is pinched. Measured records:
those of experiment 36, in a folder that the command names. On each record

- the fit that each verb reports or draws (`every_verb.py`), and the largest difference between two of them,
- the flow of the README: load, identify, plot, invert, close a loop, compile the exported C and run it. A command
  outside the range of the record without a warning is counted, and the first command of C beside that of Python.

On twins with a noisy input the error of the returned model on this input stands over that of the true law behind the
best filter, and each true parameter is looked for in its interval at 95 %.

    python experiments/52_first_contact.py [FOLDER]
"""

import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from every_verb import largest_difference, numbers_of_every_verb
from measured_cores import core_loops
from results_folder import write_results
from step_runners import program_output

RESULTS = Path(__file__).parent / "results" / "first_contact"
NOISES = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)  # % of the span of the input
SEEDS = 2
BRIEF = 300  # sets that a search of a family beside the five simulates: the verbs agree wherever it ends
FILTERS = (0.0, *np.geomspace(1.0, 12.0, 12).tolist())  # thresholds of the best filter, in sizes of the noise
OUTPUT_NOISE = 1e-3  # of the range of the output
SPAN = 100.0  # V
MIRROR = 400  # samples of the mirror's records, half of which are reversals
DRIVEN = 50.0  # % of fit: a law that explains less is not driven

LAWS: dict[str, hs.Law] = {
    "Bouc-Wen": hs.BoucWen(beta=0.03, gamma=0.01, n=1.0, gain=-1.0, feedthrough=1.5),
    "polynomial Bouc-Wen": hs.PolynomialBoucWen(
        beta=0.03, gamma=0.01, n=1.0, gain=-1.0, input_coefficients=(1.2, 0.003)
    ),
    "Zhu-Wang": hs.ZhuWangBoucWen(beta=0.03, gamma=0.01, n=1.0, gain=-1.0, delta=0.001, input_coefficients=(1.5,)),
    "Dahl": hs.Dahl(stiffness=1.0, coulomb=20.0),
    "plays": hs.PrandtlIshlinskii(thresholds=(0.0, 5.0, 15.0, 30.0), weights=(1.0, 0.3, 0.2, 0.1)),
}
FAMILIES: dict[str, Any] = {name: type(law) for name, law in LAWS.items()}
OTHERS: dict[str, Any] = {
    "generalised Bouc-Wen": hs.GeneralizedBoucWen,
    "Baber-Noori": hs.BoucWenBaberNoori,
    "Coleman-Hodgdon": hs.ColemanHodgdon,
    "Duhem": hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -0.02, "|u'| u": 0.01}),
    "play": hs.Play,
    "stop": hs.Stop,
    "modified plays": hs.ModifiedPrandtlIshlinskii,
    "generalised plays": hs.GeneralizedPrandtlIshlinskii,
    "parametric plays": hs.ParametricPrandtlIshlinskii,
    "Maxwell slip": hs.MaxwellSlip,
    "Preisach": hs.Preisach,
    "energy plays": hs.EnergyPlays,
    "Jiles-Atherton": hs.JilesAtherton,
    "Tellinen": hs.Tellinen,
    "Chan": hs.Chan,
    "line": hs.Line,
}
HELD = {"n": 1.0}  # where the family has an exponent
CONDITIONS = ("mid-cycle", "rounded", "creeping", "butterfly", "pinched")

Row = dict[str, Any]


class Case(NamedTuple):
    """A record, the family that it is identified by, and where it is simulated the law and the noise of its input."""

    kind: str
    record: hs.Record
    family: str
    law: hs.Law | None = None
    noise: float = 0.0


def path_of_input(samples: int = 600) -> np.ndarray:
    """Three cycles over the whole span, and three smaller ones [V]."""
    phase = 2.0 * np.pi * np.arange(3 * samples) / samples
    return np.concatenate([0.5 * SPAN * (1.0 - np.cos(phase)), 0.5 * SPAN - 0.3 * SPAN * np.cos(phase)])


def twins(noises: tuple[float, ...], seeds: int, families: tuple[str, ...]) -> Iterator[Case]:
    """Records of known laws whose measured input has noise."""
    u = path_of_input()
    for family in families:
        law = LAWS[family]
        y = law.response(u)
        for noise in noises:
            for seed in range(seeds if noise else 1):
                rng = np.random.default_rng([seed, round(1000 * noise)])
                size = noise / 100.0 * SPAN
                measured = u + size * rng.standard_normal(u.size)
                output = y + OUTPUT_NOISE * np.ptp(y) * rng.standard_normal(u.size)
                name = f"{family}, noise {noise:g} %, {seed}"
                yield Case("twin", hs.Record(u=measured, y=output, name=name), family, law, size)


def conditions(families: tuple[str, ...]) -> Iterator[Case]:
    """Records of a piezo-like law that begin, end or are read as real ones are."""
    u, law = path_of_input(200), LAWS["Bouc-Wen"]
    y = law.response(u)
    pinch = hs.BoucWenBaberNoori(beta=0.03, gamma=0.01, zeta_s=0.9, q=0.1, p=0.05, psi=5.0, delta_psi=0.01)
    outputs = {
        "mid-cycle": (u[130:], y[130:]),
        "rounded": (np.round(u, 1), np.round(y, 1)),
        "creeping": (u, y + 0.02 * np.ptp(y) * np.log10(1.0 + np.arange(u.size))),
        "butterfly": (u - 0.5 * SPAN, (hs.Play(threshold=5.0).response(u - 0.5 * SPAN) / SPAN) ** 2),
        "pinched": (u - 0.5 * SPAN, pinch.response(u - 0.5 * SPAN)),
    }
    for name in CONDITIONS:
        for family in families:
            yield Case(name, hs.Record(u=outputs[name][0], y=outputs[name][1], name=f"{family}, {name}"), family)


def others() -> Iterator[Case]:
    """Every other family on a record without noise of the input and one with it, by short searches."""
    u, rng = path_of_input(120), np.random.default_rng(1)
    y = LAWS["Bouc-Wen"].response(u)
    for family in OTHERS:
        for noise in (0.0, 0.5):
            record = hs.Record(u=u + noise * rng.standard_normal(u.size), y=y, name=f"{family}, noise {noise:g} V")
            yield Case("other", record, family)


def measured(folder: Path) -> Iterator[Case]:
    """The records of a folder: mirror, damper, magnets, steel."""
    every = tuple(FAMILIES)
    path, place = folder / "fsm_cubespec" / "fsm_subset.npz", "300mV_train[0,0,0]"
    record = hs.load(path, u=f"u_{place}", y=f"y_{place}", t=False, name="mirror 300 mV")
    yield from _each(record[:MIRROR], every)
    path = folder / "mr_damper_labcontrol" / "data_simulation_4.2_MRdamper.mat"
    yield from _each(hs.load(path, u="x_F[0]", y="x_F[2]", t=False, name="damper 4.2"), every)
    for material in ("MnZn_ferrite", "amorf"):
        for loop in core_loops(folder, material):
            yield from _each(loop, every)
    for k in (1, 2, 3):
        path = folder / "steel_resspylab" / f"example_{k}.csv"
        yield from _each(hs.load(path, u="e_true", y="Sigma_true", name=f"coupon {k}"), (*every, "Baber-Noori"))


def _each(record: hs.Record, families: tuple[str, ...]) -> Iterator[Case]:
    for family in families:
        yield Case("measured", hs.Record(u=record.u, y=record.y, name=f"{family}, {record.name}"), family)


def row_of(case: Case, folder: Path, *, with_flow: bool) -> Row:
    """What the verbs say of the fit, how near it is to the truth, and what the flow of the README does."""
    family, held = (FAMILIES | OTHERS)[case.family], HELD if case.law is not None and "n" in case.law.scalars else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hs.HysimWarning)
        brief = BRIEF if case.kind == "other" else None
        fit = hs.identify(family, case.record, fixed=held, max_evaluations=brief)
        numbers = numbers_of_every_verb(fit, case.record, shell=None)
    own = case.record.y - fit.model.response(case.record.u)
    return {
        "kind": case.kind,
        "record": case.record.name,
        "family": case.family,
        "noise_percent": 100.0 * case.noise / SPAN,
        "model": fit.family,
        "success": fit.success,
        "fit_percent": fit.fit_percent,
        "verbs": len(numbers),
        "largest_difference": largest_difference(numbers),
        "at_search_bound": "search bound" in fit.message,
        "heals": any(fit.estimates[name] < 0.0 for name in fit.estimates if name.startswith("delta_")),
        "residual_is_the_models": bool(np.array_equal(fit.residual, own)),
        **_beside_truth(case, fit),
        **(flow(case.record, fit, folder) if with_flow and fit.fit_percent >= DRIVEN else NO_FLOW),
    }


def _beside_truth(case: Case, fit: hs.Identification) -> Row:
    """Error over that of the true law behind the best filter, and how many true parameters their intervals hold."""
    if case.law is None or not case.noise:
        return {"over_floor": None, "parameters": 0, "held": 0}
    record, law = case.record, case.law
    errors = [record.y - (hs.ReversalFilter(threshold=k * case.noise) >> law).response(record.u) for k in FILTERS]
    floor = min(float(np.sqrt(np.mean(error**2))) for error in errors)
    true = {name: value for name, value in law.scalars.items() if name in fit.stderr and name != "z0"}
    if case.family == "plays":  # whose thresholds are those of the fit
        true = {}
    ends = {name: fit.intervals[name] for name in true}
    known = {name: value for name, value in true.items() if np.isfinite(ends[name]).all()}
    held = sum(ends[name][0] <= value <= ends[name][1] for name, value in known.items())
    return {"over_floor": fit.rmse / floor, "parameters": len(known), "held": held}


NO_FLOW: Row = dict.fromkeys(("flow", "lowest", "highest", "outside_without_warning", "c_apart", "limited_percent"))


def flow(record: hs.Record, fit: hs.Identification, folder: Path) -> Row:
    """The rest of the README's flow: inverse, loop, and C, each with its warnings."""
    low, high = float(record.u.min()), float(record.u.max())
    middle, quarter = 0.5 * float(record.y.max() + record.y.min()), 0.25 * float(np.ptp(record.y))
    wanted = hs.signals.triangle(middle - quarter, middle + quarter, cycles=3, samples_per_cycle=200)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            hs.plot.loop(record, fit, ax=figure().add_subplot())
            voltage = fit.model.inverse_response(wanted)
            stage = hs.Actuator.of(fit)
            feedforward = hs.InverseFeedforward.of(stage)
            follow = hs.TrackingController(feedforward=feedforward, feedback=hs.PID(ki=10.0), limits=(low, high))
            run = hs.close_loop(stage, follow, 1e-3 * np.arange(wanted.size), wanted)
    except (ValueError, TypeError, hs.SimulationError) as error:
        return NO_FLOW | {"flow": f"refused: {error}"[:120]}
    warned = any(issubclass(each.category, hs.HysimWarning) for each in caught)
    margin = 1e-6 * (high - low)
    lowest, highest = float(min(voltage.min(), run.u.min())), float(max(voltage.max(), run.u.max()))
    outside = lowest < low - margin or highest > high + margin
    return {
        "flow": "done",
        "lowest": lowest,
        "highest": highest,
        "outside_without_warning": outside and not warned,
        "c_apart": _of_c(feedforward, wanted, folder),
        "limited_percent": 100.0 * run.conditions["limited_samples"] / wanted.size,
    }


def _of_c(feedforward: Any, wanted: np.ndarray, folder: Path) -> float | None:
    """Largest difference between the commands of the exported C and of Python, in spans of these."""
    if (compiler := shutil.which("cc")) is None:
        return None
    commands = program_output(compiler, hs.to_c(feedforward, name="inverse"), wanted[np.newaxis], folder)
    step, parameters, state = feedforward.compiled(1.0, feedforward.u0 or 0.0)
    ours = np.array([step(parameters, state, each, 0.0) for each in wanted.tolist()])
    known = ~(np.isnan(commands) & np.isnan(ours))  # where no input has the wanted output
    return float(np.abs(commands - ours)[known].max() / np.ptp(ours[known]))


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """Run all cases, print, and write table, figure and result."""
    if smoke:
        cases = [*twins((0.3,), 1, ("Bouc-Wen",)), *conditions(("plays",))][:2]
    else:
        cases = [*twins(NOISES, SEEDS, tuple(FAMILIES)), *conditions(tuple(FAMILIES)), *others()]
        cases += [] if folder is None else [*measured(folder)]
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for case in cases:
            row = row_of(case, Path(scratch), with_flow=smoke or case.kind != "twin" or case.noise == 0.0)
            rows.append({name: None if value != value else value for name, value in row.items()})
            if not smoke:
                print(line_of(rows[-1]), flush=True)
    if smoke:
        return rows
    return write_results(RESULTS, rows, draw, summary(rows))


def line_of(row: Row) -> str:
    """A row in words."""
    line = (
        f"{row['record']}: {row['model']}, {row['fit_percent']:.3f} %, verbs within {row['largest_difference']:.1e} %"
    )
    if row["over_floor"] is not None:
        line += f", {row['over_floor']:.2f} of the floor, {row['held']}/{row['parameters']}"
    if row["flow"] is not None:
        line += f", flow {row['flow']} [{row['lowest']}, {row['highest']}], C {row['c_apart']}"
    return line


def summary(rows: list[Row]) -> Row:
    """What the finding quotes."""
    noisy = [row for row in rows if row["over_floor"] is not None]
    over = [row["over_floor"] for row in noisy]
    flows = [row for row in rows if row["flow"] == "done"]
    parameters = sum(row["parameters"] for row in noisy)
    return {
        "records": len(rows),
        "measured": sum(row["kind"] == "measured" for row in rows),
        "verbs": min(row["verbs"] for row in rows),
        "largest_difference": max(row["largest_difference"] for row in rows),
        "residuals_not_the_models": sum(not row["residual_is_the_models"] for row in rows),
        "noisy_twins": len(noisy),
        "over_floor_median": float(np.median(over)),
        "over_floor_worst": max(over),
        "held_percent": 100.0 * sum(row["held"] for row in noisy) / parameters,
        "parameters": parameters,
        "baber_noori": sum(row["family"] == "Baber-Noori" and row["kind"] == "measured" for row in rows),
        "baber_noori_heals": sum(row["heals"] for row in rows),
        "baber_noori_at_search_bound": sum(row["at_search_bound"] for row in rows if row["family"] == "Baber-Noori"),
        "flows": len(flows),
        "flows_refused": sum(str(row["flow"]).startswith("refused") for row in rows),
        "outside_without_warning": sum(bool(row["outside_without_warning"]) for row in flows),
        "c_apart_worst": max((row["c_apart"] for row in flows if row["c_apart"] is not None), default=None),
    }


def draw(rows: list[Row]) -> Figure:
    """Error of the returned model over the floor, by the noise of the input."""
    fig = figure()
    ax = fig.add_subplot()
    for family in FAMILIES:
        own = [row for row in rows if row["family"] == family and row["over_floor"] is not None]
        if own:
            ax.plot([row["noise_percent"] for row in own], [row["over_floor"] for row in own], "o", label=family, ms=4)
    ax.axhline(1.3, color="0.5", lw=0.8)
    ax.set(xscale="log", xlabel="noise of the input [% of its span]", ylabel="error over that of the true law [-]")
    ax.legend()
    return fig


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]) if len(sys.argv) > 1 else None)
