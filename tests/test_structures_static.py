"""Slow motions of structures: every equilibrium is one, along each family's own force."""

import numpy as np
import pytest
from frame_laws import JUMPING, LAWS, bouc_wen
from strategies import needs_compiled, refused

import hysim as hs

WALK = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).normal(size=40) * 0.02)])
TURNS = 0.1 * np.array([1.0, -1.0, 2.0, -2.0, 0.0])
BALANCED = {name: law for name, law in LAWS.items() if name not in JUMPING}


def quick(law):
    """A law without its dashpots, which do nothing in a slow motion."""
    parts = [part for part in law.parts if not isinstance(part, hs.Dashpot)] if isinstance(law, hs.Sum) else []
    return hs.Sum(parts=tuple(parts)) if len(parts) > 1 else law


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_one_storey_is_its_law(law):
    push = hs.shear_frame([1.0], laws=law).pushover([2.0], WALK)
    expected = quick(law).response(WALK)
    assert push.control == pytest.approx(WALK, abs=0.0)
    assert push.drift[:, 0] == pytest.approx(WALK, abs=1e-16)
    assert push.force[:, 0] == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
    assert push.base_shear == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("law", BALANCED.values(), ids=BALANCED)
@pytest.mark.parametrize("at", ["displacement", "drift.1"])
def test_three_storeys_are_in_balance_along_cycles(law, at):
    frame = hs.shear_frame([1.0, 0.8, 0.6], [3.0, 0.0, 2.0], laws=law)
    test = frame.cyclic(TURNS, [1.0, 2.0, 3.0], at=at, steps=10)
    inner = test.displacement @ frame.stiffness_matrix + test.force @ frame.drift_matrix
    loads = test.factor[:, np.newaxis] * test.pattern
    assert np.abs(loads - inner).max() <= 1e-10 * np.abs(test.force).max()
    assert test.residual.max() <= 1e-10
    for k, element in enumerate(frame.elements):  # each element went along its own law
        expected = quick(element.law).response(np.append(0.0, test.drift[:, k]))[1:]
        assert test.force[:, k] == pytest.approx(expected, abs=2e-8 * np.abs(expected).max())
    controlled = test.displacement[:, 2] if at == "displacement" else test.drift[:, 1]
    assert controlled == pytest.approx(test.control, abs=1e-15)


def test_an_elastic_frame_is_a_linear_system():
    frame = hs.Structure(mass=(1.0, 2.0), stiffness=[[30.0, -10.0], [-10.0, 12.0]])
    push = frame.pushover([1.0, 3.0], [0.0, 0.1, -0.2])
    shape = np.linalg.solve(frame.stiffness_matrix, [1.0, 3.0])
    assert push.displacement == pytest.approx(np.outer(push.control, shape / shape[1]), abs=1e-15)
    assert push.base_shear == pytest.approx(4.0 * push.control / shape[1], rel=1e-12)


def test_the_path_goes_on_beyond_the_largest_load():
    frame = hs.shear_frame([1.0, 1.0], [100.0, 100.0], laws=[bouc_wen(2.0, feedthrough=-115.0), None])
    push = frame.pushover([1.0, 1.0], np.linspace(0.0, 0.5, 101))
    top = int(push.factor.argmax())
    assert 3 < top < 80
    assert push.factor[-1] < 0.0 < push.factor[top]
    assert (
        np.diff(push.displacement[top:] @ [-1.0, 1.0]) < 0.0
    ).all()  # the upper storey unloads while the lower one softens
    assert push.residual.max() <= 1e-10


@pytest.mark.parametrize("law", [hs.MaxwellSlip(stiffness=(1e7,), slips=(2e-7,)), hs.Stop(threshold=0.01, gain=100.0)])
def test_stiff_slips_and_mechanisms_are_in_balance(law):
    frame = hs.shear_frame([1.0, 1.0, 1.0], [10.0, 20.0, 30.0], laws=law)
    test = frame.cyclic(TURNS, [1.0, 2.0, 3.0], steps=8)
    assert test.residual.max() <= 1e-9  # a displacement of 0.1 m rounds to 1.4e-17 m, which is 1.4e-10 N on 1e7 N/m


@needs_compiled
def test_a_slow_motion_of_masses_comes_close():
    frame = hs.shear_frame([1.0, 0.8], laws=bouc_wen(), damping=2.0, excitation="force", output="displacement.2")
    slow = frame.cyclic([0.1, -0.05], [0.0, 1.0], steps=20)
    t = np.linspace(0.0, 400.0, 20001)
    load = np.interp(t, np.linspace(0.0, 400.0, slow.factor.size), slow.factor)
    peaks = hs.simulate(frame, t, load).signals["displacement"]
    places = np.linspace(0, t.size - 1, slow.factor.size).round().astype(int)
    assert np.abs(peaks[places] - slow.displacement).max() < 0.02 * 0.1  # rests of the motion, as 1 / duration


def test_cycles_begin_where_the_structure_does_and_have_the_steps_that_were_asked_for():
    frame = hs.Structure(mass=1.0, stiffness=4.0, initial_state=(0.5, 0.0))
    test = frame.cyclic([0.5, 1.0, 0.0], steps=2)
    assert test.control.tolist() == [0.5, 0.75, 1.0, 0.5, 0.0]
    assert test.factor == pytest.approx(4.0 * test.control, abs=1e-15)
    assert "5 equilibria" in str(test)


def test_a_jack_between_the_ends_of_an_element_pushes_both():
    frame = hs.shear_frame([1.0, 1.0], [10.0, 10.0], laws=[None, bouc_wen()])
    assert frame.cyclic([0.1], at="drift.0").pattern.tolist() == [-1.0, 1.0]


test_errors = refused(
    (lambda frame: frame.pushover([1.0], [0.1]), "pattern must hold one number for each of 2 masses, got 1"),
    (lambda frame: frame.cyclic([0.1], [1.0, 1.0, 1.0]), "for each of 2 masses, got 3"),
    (lambda frame: frame.pushover([1.0, 1.0], [np.nan]), "control must be finite"),
    (lambda frame: frame.pushover([0.0, 0.0], [0.1]), "pattern must not be zero"),
    (lambda frame: frame.pushover([1.0, 1.0], [0.1], at="force.0"), 'must be a "displacement" or a "drift"'),
    (lambda frame: frame.pushover([1.0, 1.0], [0.1], at="displacement.3"), "names none of the 2 masses"),
    (lambda frame: frame.cyclic([0.1], steps=0), "steps must be at least 1, got 0"),
    call=lambda call: call(hs.shear_frame([1.0, 1.0], laws=bouc_wen())),
)


def test_where_forces_jump_over_the_balance_the_control_value_is_named():
    frame = hs.shear_frame([1.0, 0.8, 0.6], laws=JUMPING["PreisachRelays"])
    with pytest.raises(hs.SimulationError, match="no equilibrium was found at control value"):
        frame.cyclic(TURNS, [1.0, 2.0, 3.0], steps=40)
