"""Studies of structures: the numbers of single runs, on every executor, and nothing is lost when they are killed."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from strategies import refused

import hysim as hs
from hysim.errors import SimulationError

SAMPLE_TIME = 0.02
SPACE = {"record": [0, 1], "scale": np.linspace(0.2, 3.0, 60).tolist()}


def frame(**options):
    column = hs.BoucWen(beta=50.0, gamma=50.0, feedthrough=20.0, gain=180.0)
    return hs.shear_frame([1.0, 1.0], laws=column, damping=hs.ModalDamping(ratio=0.02), **options)


def motions(duration=8.0):
    return [hs.signals.ground_motion(3.0, duration=duration, sample_time=SAMPLE_TIME, seed=seed) for seed in (1, 2)]


def task():
    return hs.structure_task(frame(), motions(), SAMPLE_TIME, ["peak_drift", "residual_drift", "energy"])


def run(path):
    hs.sweep(task(), SPACE, store=path, workers=1, progress=lambda done, total: time.sleep(0.01))


MIXED = hs.shear_frame(
    [1.0, 2.0],
    [300.0, 200.0],
    [hs.BoucWenBaberNoori(beta=5.0, gamma=5.0, gain=50.0), hs.Dahl() + hs.Dashpot(c=0.2)],
    damping=hs.Rayleigh.at(0.05, (1.0, 0.2)),
)
SIGNALS = {
    "peak_drift": "peak_drift",
    "residual_drift": "drift",
    "energy": "element_work",
    "peak_force": "peak_force",
    "peak_displacement": "peak_displacement",
    "peak_acceleration": "peak_acceleration",
}


@pytest.mark.parametrize("reduce", SIGNALS)
@pytest.mark.parametrize(
    ("structure", "parameters"),
    [
        (frame(), {"elements.0.beta": [25.0, 50.0, 75.0], "damping": [0.01, 0.02, 0.05], "scale": [1.0, 2.0, 3.0]}),
        (frame(substeps=2), {"elements.*.gain": [100.0, 200.0], "mass": [1.0, 1.3]}),
        (MIXED, {"stiffness": [0.5, 2.0], "damping.mass": [0.1, 0.2]}),
        (MIXED, {"elements.1.dahl.coulomb": [1.0, 2.0], "elements.1.dashpot.c": [0.0, 0.5]}),
    ],
    ids=["bouc-wen", "fixed steps", "matrices", "a sum"],
)
def test_responses_have_the_bits_of_single_runs(structure, parameters, reduce):
    a = motions(4.0)[0]
    rows = structure.responses(parameters, a, sample_time=SAMPLE_TIME, reduce=reduce)
    t = SAMPLE_TIME * np.arange(a.size)
    for k, row in enumerate(rows):
        own = {name: values[k] for name, values in parameters.items()}
        single = hs.simulate(
            structure.assemble({k: v for k, v in own.items() if k != "scale"}), t, own.get("scale", 1.0) * a
        )
        assert np.array_equal(single.signals[SIGNALS[reduce]][-1], row)


def test_responses_do_not_depend_on_the_number_of_threads():
    scales = np.linspace(0.1, 3.0, 31)
    one, two = (frame().responses(scales, motions(4.0)[0], sample_time=SAMPLE_TIME, workers=n) for n in (1, 2))
    assert np.array_equal(one, two)
    assert np.array_equal(one[7], frame().responses([scales[7]], motions(4.0)[0], sample_time=SAMPLE_TIME)[0])


def test_each_set_may_have_its_own_input():
    inputs = np.stack(motions(4.0))
    rows = frame().responses({}, inputs, sample_time=SAMPLE_TIME)
    for a, row in zip(inputs, rows, strict=True):
        assert np.array_equal(frame().responses([1.0], a, sample_time=SAMPLE_TIME)[0], row)


def test_a_motion_that_diverges_is_a_row_of_inf():
    escaping = hs.BoucWen(beta=-2000.0, gamma=0.0, n=2.0, gain=180.0)
    building = hs.shear_frame([1.0], laws=escaping, damping=hs.ModalDamping(ratio=0.02))
    a = motions(4.0)[0]
    rows = building.responses([0.01, 50.0], a, sample_time=SAMPLE_TIME)
    assert np.isfinite(rows[0]).all()
    assert np.isinf(rows[1]).all()
    with pytest.raises(SimulationError, match="diverges at t = "):
        hs.simulate(building, SAMPLE_TIME * np.arange(a.size), 50.0 * a)


test_errors_say_what_is_wrong = refused(
    ({"elements.0.nothing": [1.0]}, {}, "no parameter 'elements.0.nothing'"),
    ([1.0, 2.0], {"reduce": "drift"}, "reduce must be one of"),
    ({"damping": [0.1, 0.2], "scale": [1.0, 2.0, 3.0]}, {}, "one for each"),
    ({"elements.0.n": [-1.0]}, {}, "n must"),
    call=lambda parameters, options: frame().responses(parameters, motions(1.0)[0], sample_time=SAMPLE_TIME, **options),
)


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_a_study_is_the_same_on_every_executor(executor):
    study = hs.sweep(task(), SPACE, executor=executor, workers=2)
    single = frame().responses(SPACE["scale"], motions()[1], sample_time=SAMPLE_TIME)
    assert np.array_equal(study["peak_drift_each"][60:], single)
    assert np.array_equal(study["peak_drift"][60:], single.max(axis=1))


def test_a_killed_incremental_dynamic_analysis_goes_on_and_loses_nothing(tmp_path):
    path = tmp_path / "ida.hysim"
    code = f"import test_structure_studies as study; study.run({str(path)!r})"
    with subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parent) as child:
        while not (path.exists() and rows_in(path) > 5):
            assert child.poll() is None
            time.sleep(0.01)
        child.send_signal(signal.SIGKILL)
        child.wait()
    kept = hs.load_sweep(path)
    assert 5 < len(kept) < 120
    again = hs.sweep(task(), SPACE, store=path, workers=2)
    whole = hs.sweep(task(), SPACE)
    for name in ("peak_drift", "peak_drift_each", "residual_drift", "energy_each"):
        assert np.array_equal(again[name], whole[name])


def rows_in(path):
    try:
        return len(hs.load_sweep(path))
    except (OSError, ValueError):
        return 0


def test_the_largest_acceleration_under_a_force_has_the_force():
    plant = frame(excitation="force", influence=(1.0, 0.5))
    u = 5.0 * motions(4.0)[0]
    rows = plant.responses([1.0], u, sample_time=SAMPLE_TIME, reduce="peak_acceleration")
    sim = hs.simulate(plant, SAMPLE_TIME * np.arange(u.size), u)
    np.testing.assert_allclose(rows[0], abs(sim.signals["acceleration"]).max(axis=0), rtol=1e-9)
    np.testing.assert_allclose(sim.peaks["acceleration"], rows[0], rtol=1e-9)
