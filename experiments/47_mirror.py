"""Do laws of the three piezos of a mirror explain what a linear model leaves, on a realisation that was left out?

The CubeSpec Fine Steering Mirror (M. Floren et al., ISMA 2024; CC BY 4.0): three piezo voltages, three displacements of
the mirror, orthogonal multisines up to 3 kHz at 100, 200 and 300 mV, 6 400 samples a second. The outputs are tip and
tilt, for displacements at 0, 120 and 240 degrees. Each is the sum of three laws, one for each piezo, behind which
stand modes that they have in common and a delay. Beside it stands the same structure with a line for each piezo.

Both are identified on half a period of one realisation at 100 mV and one at 300 mV, in which each level has the same
weight. The state is periodic: samples before this half run ahead with the weight zero. They are tested on whole periods
of a third realisation, at 100, 200 and 300 mV. It is a subset of the published test: one realisation of several, tip
and tilt for three displacements. The search begins at modes that were read off the measured frequency responses. Lines
are identified at each level alone, too: what differs between these two no law in front of the modes explains.

    python experiments/47_mirror.py FOLDER [CASES.jsonl]    with a file, its cases are kept and others are added to it

FOLDER holds fsm_subset.npz: u_100mV_train, y_100mV_train, ... of the axes (sample, channel, realisation, period).
Nothing of it is stored here but errors and parameters.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.models.storage import from_json, to_json
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import append_lines, cpu_timed, stored_lines, write_results

RESULTS = Path(__file__).parent / "results" / "mirror"
INPUTS = ("u", "u2", "u3")
OUTPUTS = {"tip": (2.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0), "tilt": (0.0, 3.0**-0.5, -(3.0**-0.5))}
SAMPLE_TIME = 1.0 / 6400.0  # [s]
AHEAD, HALF = 1024, 4096  # samples that run ahead, until the modes have decayed, and those that are learnt from
LEVELS, LEARNT = (100, 200, 300), (100, 300)  # mV
FREQUENCIES = (640.0, 808.0, 920.0, 990.0, 1315.0, 1440.0, 1685.0, 2120.0, 2280.0, 2540.0, 2800.0, 3120.0)
"""Where the measured responses peak [Hz], and one near the end for what is beyond."""
DAMPING_RATIO, DELAY = 0.012, 5e-5
THRESHOLDS = (0.0, 0.05, 0.15, 0.3, 0.6)  # V
LINES = "lines"
LAWS: dict[str, Callable[[], Any]] = {
    LINES: lambda: hs.Line,
    "Prandtl-Ishlinskii": lambda: hs.PrandtlIshlinskii.structure(thresholds=THRESHOLDS),
}
ALONE = tuple(f"lines at {level} mV" for level in LEARNT)
PUBLISHED = {"linear": (18.6, 6.6, 16.3), "nonlinear": (6.37, 4.84, 4.19)}
"""One model for all levels, errors of the whole published test in percent, means of three displacements."""
Row = dict[str, Any]


# ---------------------------------------------------------------------------------- records


def record(u: np.ndarray, y: np.ndarray, level: int, ahead: int = AHEAD) -> hs.Record:
    """One period of the inputs (n, 3) and of the output (n,), after its last part, which runs ahead."""
    inputs, output = np.concatenate([u[-ahead:], u]), np.concatenate([y[-ahead:], y])
    return hs.Record(
        u=inputs[:, 0],
        y=output,
        t=SAMPLE_TIME * np.arange(output.size),
        channels=dict(zip(INPUTS[1:], inputs[:, 1:].T, strict=True)),
        units={"t": "s", "u": "V", "y": "um"},
        name=f"{level} mV",
    )


def measured(folder: Path, output: str) -> dict[str, dict[int, hs.Record]]:
    """Records by level that are learnt from, and those of the realisation that is left out."""
    with np.load(folder / "fsm_subset.npz") as data:
        arrays = {name: np.asarray(data[name], dtype=float) for name in data.files}

    def of(level: int, part: str) -> hs.Record:
        u, y = (arrays[f"{signal}_{level}mV_{part}"][:, :, 0].mean(axis=-1) for signal in "uy")
        return record(u, 1e6 * y @ np.array(OUTPUTS[output]), level)

    return {
        "train": {level: of(level, "train")[: AHEAD + HALF] for level in LEARNT},
        "test": {level: of(level, "test") for level in LEVELS},
    }


def weights(records: Sequence[hs.Record], ahead: int = AHEAD) -> list[np.ndarray]:
    """Equal weights of the records, and none of what runs ahead."""
    return [np.append(np.zeros(ahead), np.full(len(rec) - ahead, np.var(rec.y) ** -1)) for rec in records]


# ---------------------------------------------------------------------------------- one case


def error_percent(model: hs.MultiInputActuator, rec: hs.Record, ahead: int = AHEAD) -> float:
    """Error of the free run in percent of the output's standard deviation."""
    residual = (rec.y - model.response_of(rec))[ahead:]
    return 100.0 * float(np.sqrt(np.mean(residual**2)) / np.std(rec.y[ahead:]))


def first_guess(rec: hs.Record, ahead: int = AHEAD, peaks: Sequence[float] = FREQUENCIES) -> hs.MultiInputActuator:
    """Modes at the peaks of the responses, with the gains that fit a record best."""
    common = {"damping_ratios": (DAMPING_RATIO,), "gains": (1.0,), "delay": DELAY}
    frequencies = tuple(2.0 * np.pi * f for f in peaks)
    alone = [hs.Actuator(vibration=hs.Modes(natural_frequencies=(w,), **common)) for w in frequencies]
    inputs = [rec.u, *(rec.channel(name) for name in INPUTS[1:])]
    columns = np.stack([each.response(u, SAMPLE_TIME) for u in inputs for each in alone], axis=1)
    gains = np.linalg.lstsq(columns[ahead:], rec.y[ahead:], rcond=None)[0].reshape(len(INPUTS), -1)
    damping_ratios = (DAMPING_RATIO,) * len(frequencies)
    vibrations = [
        hs.Modes(natural_frequencies=frequencies, damping_ratios=damping_ratios, gains=tuple(row), delay=DELAY)
        for row in gains.tolist()
    ]
    return hs.MultiInputActuator(inputs=INPUTS, actuators=tuple(hs.Actuator(vibration=each) for each in vibrations))


def identified(name: str, records: Sequence[hs.Record], start: hs.MultiInputActuator, ahead: int = AHEAD) -> Any:
    """The fit of a structure with these laws, from the modes of `start` on."""
    modes = len(start.actuators[0].vibration.gains)
    structure = hs.Actuator.structure(dict.fromkeys(INPUTS, LAWS[name]()), modes=modes, creep=False, start=start)
    return hs.identify(structure, records, weights=weights(records, ahead), initial="rest")


def case(folder: Path, output: str, name: str, start: Any) -> Row:
    """One model of one output."""
    records = measured(folder, output)
    learnt = [rec for level, rec in records["train"].items() if name not in ALONE or f"lines at {level} mV" == name]
    fit, seconds = cpu_timed(identified, LINES if name in ALONE else name, learnt, start or first_guess(learnt[-1]))
    model = fit.model
    return {
        "output": output,
        "model": name,
        "n_parameters": fit.n_parameters,
        "train_percent": float(np.mean([error_percent(model, rec) for rec in learnt])),
        "test_percent": {str(level): error_percent(model, rec) for level, rec in records["test"].items()},
        "frequencies_hz": sorted(w / (2.0 * np.pi) for w in model.actuators[0].vibration.natural_frequencies),
        "cpu_seconds": seconds,
        "success": fit.success,
        "message": fit.message,
        "stored": to_json(model),
    }


def computed(folder: Path, file: Path | None) -> list[Row]:
    """All cases, each stored in the file as soon as it is known; the lines first, with whose modes the others begin."""
    known = {(row["output"], row["model"]): row for row in stored_lines(file)}
    for output in OUTPUTS:
        for name in (*LAWS, *ALONE):
            if (output, name) in known:
                continue
            start = None if name == LINES else from_json(known[output, LINES]["stored"], "the lines")[0]
            row = known[output, name] = case(folder, output, name, start)
            print({key: value for key, value in row.items() if key != "stored"}, flush=True)
            append_lines(file, row)
    return [known[output, name] for output in OUTPUTS for name in (*LAWS, *ALONE)]


# ---------------------------------------------------------------------------------- results


def table_row(row: Row) -> Row:
    """A case without its model and its message."""
    own = {name: row[name] for name in ("output", "model", "n_parameters", "train_percent")}
    tests = {f"test_{level}_percent": row["test_percent"][str(level)] for level in LEVELS}
    return own | tests | {"cpu_seconds": row["cpu_seconds"], "success": row["success"]}


def twin(laws: Sequence[Any], peak: float) -> hs.MultiInputActuator:
    """A simulated axis: these laws behind one mode."""
    mode = hs.Modes(natural_frequencies=(2.0 * np.pi * peak,), damping_ratios=(0.02,), gains=(1.0,), delay=DELAY)
    return hs.MultiInputActuator(
        inputs=INPUTS, actuators=tuple(hs.Actuator(hysteresis=law, vibration=mode) for law in laws)
    )


def smoke_run() -> list[Row]:
    """Lines and plays on a simulated axis, whose plays are told."""
    weights_of = ((2.0, 0.4, 0.3, 0.3, 0.2), (-1.0, -0.2, -0.2, -0.1, -0.1), (0.5, 0.1, 0.1, 0.1, 0.1))
    truth = twin([hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=w) for w in weights_of], 800.0)
    ahead, rng = 100, np.random.default_rng(0)
    u = rng.uniform(-1.0, 1.0, (300, 3))
    rec = record(u, np.zeros(len(u)), 300, ahead)
    y = truth.response_of(rec)[ahead:] + 1e-3 * rng.standard_normal(len(u))
    rec = record(u, y, 300, ahead)
    start, rows = first_guess(rec, ahead, (790.0,)), []
    for name in (LINES, "Prandtl-Ishlinskii"):
        fit = identified(name, [rec], start, ahead)
        rows.append({"model": name, "train_percent": error_percent(fit.model, rec, ahead)})
    return rows


def main(smoke: bool = False, folder: Path | None = None, file: Path | None = None) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        return smoke_run()
    if folder is None:
        raise ValueError("the folder with fsm_subset.npz is needed: python experiments/47_mirror.py FOLDER")
    cases = computed(folder, file)
    rows = [table_row(row) for row in cases]
    frequencies = {f"{row['output']}, {row['model']}": row["frequencies_hz"] for row in cases if row["model"] in ALONE}
    write_results(RESULTS, rows, draw, {"published_percent": PUBLISHED, "frequencies_hz": frequencies})
    for row in rows:
        print(row)
    return rows


def draw(rows: list[Row]) -> Figure:
    """Error on the realisation that was left out against the level, by output and model."""
    canvas = figure(height=3.2)
    colours = dict(zip((*LAWS, *ALONE), ("#000000", "#0072B2", "#999999", "#E69F00"), strict=True))
    axes = canvas.subplots(1, 2, sharey=True)
    for ax, output in zip(axes, OUTPUTS, strict=True):
        for row in rows:
            if row["output"] == output:
                errors = [row[f"test_{level}_percent"] for level in LEVELS]
                dashes = "dashed" if row["model"] in ALONE else "solid"
                ax.plot(
                    LEVELS, errors, "o", color=colours[row["model"]], linestyle=dashes, label=row["model"], markersize=4
                )
        ax.set(title=output, xlabel="amplitude [mV]", xticks=LEVELS, ylim=(0.0, 36.0))
    axes[0].set_ylabel("error / standard deviation [%]")
    axes[1].legend(fontsize=7)
    return canvas


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(folder=Path(sys.argv[1]), file=Path(sys.argv[2]) if len(sys.argv) > 2 else None)
