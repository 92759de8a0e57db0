"""The kernels of a memory under an oscillator: along a displacement, and in motion, against laws that are known."""

import numpy as np
import pytest
from scipy.linalg import expm

import hysim as hs
from hysim.discovery._hidden_memory import cases, memory_arrays
from hysim.kernels import memory_terms
from hysim.laws.differential.terms import RELAXATION, bouc_wen_terms

PLANT = {"mass": 2.0, "damping": 0.4, "stiffness": 3.0}


def test_the_memory_along_a_path_is_that_of_the_law_and_its_slopes_are_derivatives():
    path = np.sin(np.linspace(0.0, 9.0, 4001))
    terms = bouc_wen_terms(1.0)
    units = np.array([cases(term, 1) for term in terms])

    def run(coefficients: list[float], relaxation: float = 0.0) -> np.ndarray:
        found = np.zeros((5, path.size))
        polynomial = memory_arrays(dict(zip(terms, coefficients, strict=True)), 1).polynomial
        assert memory_terms.along(np.diff(path), 1e-3, polynomial, relaxation, units, found[0], found[1:])
        return found

    found = run([1.0, -0.6, -0.3])
    exact = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3).memory(path)
    assert np.abs(found[0] - exact).max() < 1e-5  # second order: the square of increments of 2e-3
    for k in range(3):
        moved = [1.0, -0.6, -0.3]
        moved[k] += 1e-6
        assert np.abs((run(moved)[0] - found[0]) / 1e-6 - found[1 + k]).max() < 1e-4  # the difference's own error
    assert np.abs((run([1.0, -0.6, -0.3], 1e-6)[0] - found[0]) / 1e-6 - found[4]).max() < 1e-4
    assert RELAXATION.name == "z"


def motion(coefficients, force, h, degree=1):
    """Displacement from rest, and the last state."""
    polynomial, extra, power, relaxation = memory_arrays(coefficients, degree)
    plant = np.array([*PLANT.values(), relaxation, power])
    state, y = np.zeros(3), np.zeros(force.size)
    assert memory_terms.motion(plant, polynomial, extra, force, h, state, y[1:])
    return y, state


@pytest.mark.parametrize("n", [1.0, 1.5])
def test_the_motion_is_that_of_the_oscillator(n):
    t = np.linspace(0.0, 20.0, 4001)
    force = 3.0 * np.sin(1.1 * t) * np.exp(-0.05 * t)
    numbers = [1.3, -0.6, -0.2]
    y, state = motion(dict(zip(bouc_wen_terms(n), numbers, strict=True)), force, t[1])
    spring = hs.BoucWen(A=1.3, beta=0.6, gamma=0.2, n=n)
    exact = hs.simulate(hs.BoucWenOscillator(**PLANT, law=spring), t, force)
    # steps that go over a reversal or a zero of z leave the square of 5e-3
    assert np.abs(y - exact.y).max() < 1e-5 * np.ptp(exact.y)
    assert state[2] == pytest.approx(exact.signals["z"][-1], abs=1e-4)


def test_a_linear_memory_that_relaxes_moves_as_its_matrix_says_to_fourth_order():
    """m y'' + c y' + k y + z = F, z' = 1.3 y' - 0.8 z, under a force that rises by 1 a second."""
    m, c, k = PLANT.values()
    linear = {bouc_wen_terms(1.0)[0]: 1.3, RELAXATION: -0.8}
    flow = np.zeros((5, 5))  # of y, y', z, F, dF/dt
    flow[0, 1] = flow[3, 4] = 1.0
    flow[1, :4] = [-k / m, -c / m, -1.0 / m, 1.0 / m]
    flow[2, 1:3] = [1.3, -0.8]
    exact = (expm(4.0 * flow) @ [0.0, 0.0, 0.0, 0.5, 1.0])[:3]
    errors = [np.abs(motion(linear, np.linspace(0.5, 4.5, 1 + n), 4.0 / n)[1] - exact).max() for n in (40, 80)]
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 14.0  # 16 for the fourth order
