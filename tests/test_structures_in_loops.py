"""A structure in a closed loop: its own motion under forces that are held, and an earthquake beside them."""

from dataclasses import replace

import numpy as np
import pytest
from frame_laws import bouc_wen
from scipy.linalg import expm
from strategies import needs_compiled, refused

import hysim as hs
from hysim.kernels.structure_path import follow

pytestmark = needs_compiled
H = 0.01
T = H * np.arange(500)
STEP = np.where(T > 0.1, 1.0, 0.0)
QUAKE = hs.signals.ground_motion(6.0, duration=5.0, sample_time=H, seed=2)[: T.size]
FRAME = hs.shear_frame([1.0, 0.8, 0.6], laws=bouc_wen(), damping=0.1, excitation="force")
CONTROLLERS = {
    "PID": hs.PID(kp=40.0, ki=30.0, kd=8.0, derivative_filter=0.02, limits=(-60.0, 55.0)),
    "TrackingController": hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=hs.Line(slope=0.02)),
        feedback=hs.PID(kp=5.0, ki=20.0),
        preview=True,
        limits=(-60.0, 60.0),
    ),
    "InverseFeedforward": hs.InverseFeedforward(law=hs.Line(slope=0.02)),
}


def test_one_compiled_motion_serves_responses_ensembles_and_loops():
    """It takes half a minute to compile."""
    frame = replace(FRAME, excitation="base")
    assert (frame.response(QUAKE, 1) == frame.response(QUAKE, 1.0)).all()
    frame.responses([1.0, 2.0], QUAKE, sample_time=1)
    hs.close_loop(FRAME, hs.PID(kp=1.0), T, STEP, ground_acceleration=QUAKE)
    hs.close_loop(hs.Structure(mass=2.0, stiffness=50.0, excitation="force"), hs.PID(kp=1.0), T, STEP)
    assert len(follow.signatures) == 1


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_a_linear_structure_is_a_transfer_function(controller):
    structure = hs.Structure(mass=2.0, damping=0.6, stiffness=50.0, excitation="force")
    ours = hs.close_loop(structure, controller, T, STEP)
    theirs = hs.close_loop(hs.TransferFunction(num=(1.0,), den=(2.0, 0.6, 50.0)), controller, T, STEP)
    for name in ("y", "error", "measurement"):
        assert getattr(ours, name) == pytest.approx(getattr(theirs, name), abs=1e-9)
    assert ours.u == pytest.approx(theirs.u, abs=1e-7)  # the gains are up to 1e2
    for name in ("limited_samples", "preview", "limits", "sample_time", "u0"):
        assert ours.conditions[name] == theirs.conditions[name]
    assert ours.conditions["plant"] == structure
    assert "ClosedLoop: 500 samples" in str(ours)


def test_an_oscillator_in_a_loop_moves_as_it_does_under_the_same_force():
    law = hs.BoucWen(A=30.0, beta=200.0, gamma=-50.0, u0=0.02)  # which is no place of the oscillator
    plant = hs.BoucWenOscillator(
        mass=2.0, damping=0.6, stiffness=20.0, law=law, hold="zoh", initial_state=(0.01, 0.1), substeps=8
    )
    run = hs.close_loop(plant, hs.PID(kp=40.0, ki=30.0, limits=(-60.0, 55.0)), T, STEP)
    assert run.y == pytest.approx(plant.response(run.drive, H), abs=1e-7 * np.ptp(run.y))


def test_two_masses_without_collocation_are_their_state_matrix():
    """The force is at the first mass, the controller reads the second one."""
    mass, stiffness = np.diag([1.0, 0.5]), np.array([[30.0, -20.0], [-20.0, 20.0]])
    structure = hs.Structure(
        mass=mass, damping=0.1 * mass, stiffness=stiffness, excitation="force", influence=(1.0, 0.0)
    )
    run = hs.close_loop(structure, hs.PID(kp=2.0, ki=3.0), T, STEP)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, stiffness), -0.1 * np.eye(2)]])
    b = np.array([0.0, 0.0, 1.0, 0.0])
    flow = expm(np.block([[A, b[:, np.newaxis]], [np.zeros((1, 5))]]) * H)
    x, integral = np.zeros(4), 0.0
    for k in range(T.size):
        assert run.y[k] == pytest.approx(x[1], abs=1e-9)
        u = 2.0 * (STEP[k] - x[1]) + integral
        integral += 3.0 * H * (STEP[k] - x[1])
        x = (flow @ np.append(x, u))[:4]


@pytest.mark.parametrize("output", ["displacement.1", "velocity", "drift.1", "force.0", "acceleration.2"])
def test_a_constant_force_is_that_of_simulate(output):
    """What the controller reads is the output of that name, dashpots and the jump of accelerations among it."""
    laws = [bouc_wen() + hs.Dashpot(c=0.3), bouc_wen(2.0), hs.Dahl(stiffness=90.0, coulomb=3.0)]
    frame = hs.shear_frame([1.0, 0.8, 0.6], laws=laws, damping=0.1, excitation="force", output=output)
    force = hs.InverseFeedforward()  # the command is the reference
    run = hs.close_loop(frame, force, T, np.full(T.size, 2.5))
    free = hs.simulate(frame, T, np.full(T.size, 2.5))
    assert run.u.tolist() == [2.5] * T.size
    first = 1 if output.startswith("acceleration") else 0  # the loop reads it before the force begins
    assert run.y[first:] == pytest.approx(free.y[first:], abs=1e-7 * np.abs(free.y).max())
    energies = ("element_work", "dissipated", "damping_loss", "input_work")
    for name in ("drift", "displacement", "velocity", "force", "peak_drift", "peak_force", *energies):
        values = free.signals[name]
        assert run.signals[name] == pytest.approx(values, abs=1e-7 * np.abs(values).max()), name
    assert set(run.signals) == set(free.signals) - {"t", "u", "y"}


def test_without_control_the_ground_moves_it_as_in_simulate():
    frame = replace(FRAME, output="drift.0")
    run = hs.close_loop(frame, hs.PID(kp=0.0), T, np.zeros(T.size), ground_acceleration=QUAKE)
    free = hs.simulate(replace(frame, excitation="base"), T, QUAKE)
    assert run.y.tolist() == free.y.tolist()
    for name in ("drift", "acceleration", "element_work", "input_work", "peak_drift"):
        expected = free.signals[name]
        assert run.signals[name] == pytest.approx(expected, abs=1e-12 * np.abs(expected).max()), name


@pytest.mark.parametrize("sweeps", [{"tolerance": 1e-10}, {"substeps": 4}])
def test_force_and_ground_together_balance_their_energy(sweeps):
    """A force that is limited jumps at each sample; four substeps resolve as much as the tolerance does."""
    frame = replace(FRAME, output="velocity", **sweeps)
    run = hs.close_loop(frame, hs.PID(kp=3.0, limits=(-0.8, 0.8)), T, np.zeros(T.size), ground_acceleration=QUAKE)
    assert run.conditions["limited_samples"] > 10
    assert np.abs(run.u).max() == 0.8
    scale = np.abs(run.signals["input_work"]).max()
    assert np.abs(run.signals["imbalance"]).max() < 1e-7 * scale


def test_the_linear_frame_in_an_earthquake_is_its_state_matrix():
    structure = hs.Structure(mass=(1.0, 2.0), damping=0.3, stiffness=[[50.0, -20.0], [-20.0, 20.0]], excitation="force")
    run = hs.close_loop(structure, hs.PID(kp=6.0), T, np.zeros(T.size), ground_acceleration=QUAKE)
    M, K = structure.mass_matrix, structure.stiffness_matrix
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -0.3 * np.linalg.inv(M)]])
    b = np.array([[0.0, 0.0, 0.0, 0.5], [0.0, 0.0, -1.0, -1.0]]).T
    joint = np.zeros((7, 7))  # state, force, acceleration of the ground, its slope
    joint[:4, :4], joint[:4, 4:6], joint[5, 6] = A, b, 1.0
    flow, x = expm(joint * H), np.zeros(4)
    for k in range(T.size - 1):
        x = (flow @ [*x, -6.0 * x[1], QUAKE[k], (QUAKE[k + 1] - QUAKE[k]) / H])[:4]
        assert run.signals["displacement"][k + 1] == pytest.approx(x[:2], abs=1e-9)


@pytest.mark.parametrize(
    ("output", "controller"),
    [("velocity", hs.PID(kp=4.0)), ("displacement", hs.PID(kp=10.0, kd=4.0, derivative_filter=0.01))],
)
def test_an_active_damper_reduces_drifts_and_wear_of_a_yielding_frame(output, controller):
    frame = replace(FRAME, output=output)
    free, damped = (
        hs.close_loop(frame, each, T, np.zeros(T.size), ground_acceleration=QUAKE)
        for each in (hs.PID(kp=0.0), controller)
    )
    assert free.signals["peak_drift"][-1, 0] > 0.06  # twice that of yielding
    assert damped.signals["peak_drift"][-1, 0] < 0.6 * free.signals["peak_drift"][-1, 0]
    assert damped.signals["dissipated"][-1].sum() < 0.5 * free.signals["dissipated"][-1].sum()


def test_a_stage_of_two_masses_follows_its_reference():
    """A drive with hysteresis between the ground and a carriage, on which a second drive moves the table."""
    drive = hs.BoucWen(beta=200.0, gamma=200.0, feedthrough=400.0, gain=400.0)
    stage = hs.Structure(
        mass=(1.0, 0.2),
        damping=hs.ModalDamping(ratio=0.2),
        elements=[hs.Element(drive, between=(0, 1)), hs.Element(drive, between=(1, 2))],
        excitation="force",
        influence=(1.0, 0.0),
    )
    run = hs.close_loop(stage, hs.PID(kp=200.0, ki=3000.0), T, 1e-3 * STEP)
    assert run.y[-1] == pytest.approx(1e-3, rel=1e-3)


def test_the_state_at_the_start_is_the_structures():
    frame = replace(FRAME, initial_state=(0.01, 0.02, 0.03, 0.0, 0.0, 0.0))
    run = hs.close_loop(frame, hs.PID(kp=10.0), T[:50], np.zeros(50))
    assert run.y[0] == 0.03
    assert run.u[0] == pytest.approx(-0.3)


def test_an_unstable_loop_names_its_time():
    with pytest.raises(hs.SimulationError, match="diverges at t = "):
        hs.close_loop(replace(FRAME, substeps=1), hs.PID(kp=-1e4, kd=-1e5), H * np.arange(5000), np.ones(5000))


LOOP = {"plant": FRAME, "controller": hs.PID(kp=1.0), "t": T, "reference": STEP}
test_errors = refused(
    ({"plant": replace(FRAME, excitation="base")}, 'its excitation must be "force", got "base"'),
    ({"u0": 1.0}, "leave out u0 and substeps"),
    ({"substeps": 2}, "leave out u0 and substeps"),
    ({"ground_acceleration": QUAKE[:3]}, "ground_acceleration and t must have equal lengths, got 3 and 500"),
    ({"plant": hs.mode(3.0, 0.1), "ground_acceleration": QUAKE}, "only a Structure stands on the ground"),
    call=lambda changed: hs.close_loop(**LOOP | changed),
)
