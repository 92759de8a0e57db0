"""Functional mock-up units beside Python: random laws of every family, on random and on hostile inputs.

    python experiments/fmu_agreement.py 20 [FAMILY ...]

Each law becomes units of FMI 2.0 and 3.0, which FMPy validates, loads and steps; the outputs are compared with
`law.response`. The number is that of the laws of each family. It needs a C compiler and FMPy.
"""

import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import hysim as hs
from hysim.models.protocols import needs_time

sys.path.insert(0, str(Path(__file__).parent))
from hostile_laws import DRAWS, Rng

VERSIONS = ("2.0", "3.0")
STEP = 1.0  # s
TURNS = np.array([0.0, 1e-300, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0, 100.0])  # strides in the law's own length


class Agreement(NamedTuple):
    """Of the units of a family in one version: problems of validation, compared inputs, and the largest difference."""

    problems: int
    random: int
    hostile: int
    diverged: int
    worst: float


def stepped(path: Path, u: np.ndarray, folder: str) -> np.ndarray | None:
    """Outputs of a unit at the ends of its steps; None where it says that it diverges."""
    model = fmpy.read_model_description(str(path))
    names = {each.name: each.valueReference for each in model.modelVariables}
    is_2 = model.fmiVersion == "2.0"
    unit = (FMU2Slave if is_2 else FMU3Slave)(
        guid=model.guid, modelIdentifier=model.coSimulation.modelIdentifier, instanceName="unit",
        unzipDirectory=fmpy.extract(str(path), folder),
    )  # fmt: skip
    write, read = (unit.setReal, unit.getReal) if is_2 else (unit.setFloat64, unit.getFloat64)
    y = np.empty(u.size)
    try:
        unit.instantiate()
        if "u0" in names:
            write([names["u0"]], [float(u[0])])
        if is_2:
            unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        for k, value in enumerate(u.tolist()):
            write([names["u"]], [value])
            unit.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
            y[k] = read([names["y"]])[0]
    except fmpy.fmi1.FMICallException:
        return None
    finally:
        unit.freeInstance()
    return y


def inputs(rng: Rng, length: float, random: int, hostile: int) -> list[np.ndarray]:
    """Random walks, and walks whose strides go from nothing to far beyond the law's length."""
    walks = [np.cumsum(rng.normal(size=2000)) * length * 0.2 for _ in range(random)]
    strides = [rng.choice(TURNS, 60) * rng.choice([-1.0, 1.0], 60) for _ in range(hostile)]
    return [*walks, *(length * np.cumsum(each) for each in strides)]


def agreement(family: str, version: str, laws: int = 20, hostile: int = 3, seed: int = 0) -> Agreement:
    """Random laws of a family, each on one random walk and `hostile` other inputs."""
    rng = np.random.default_rng(seed)
    problems, counts, diverged, worst = 0, [0, 0], 0, 0.0
    for _ in range(laws):
        law, length = DRAWS[family](rng)
        timed = {"sample_time": STEP} if needs_time(law) else {}
        with tempfile.TemporaryDirectory() as folder:
            path = hs.to_fmu(law, Path(folder, "law.fmu"), version, **timed)
            problems += len(validate_fmu(str(path)))
            for k, u in enumerate(inputs(rng, length, 1, hostile)):
                ours = stepped(path, u, folder)
                try:
                    theirs = law.response(u, **timed)
                except hs.SimulationError:
                    diverged += 1
                    worst = worst if ours is None else np.inf
                    continue
                counts[k > 0] += 1
                error = np.inf if ours is None else np.abs(ours - theirs).max()
                worst = max(worst, error / (np.ptp(theirs) or 1.0))
    return Agreement(problems, *counts, diverged, float(worst))


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for name in sys.argv[2:] or DRAWS:
        for fmi in VERSIONS:
            try:
                print(f"{name:30} FMI {fmi}  {agreement(name, fmi, number)}", flush=True)
            except (TypeError, ValueError) as error:
                print(f"{name:30} FMI {fmi}  not exported: {error}", flush=True)
