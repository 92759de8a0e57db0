"""Structures against an independent integration of their differential equations.

The reference (`experiments/structure_reference.py`) is DOP853 at 1e-12 on pieces between all events; it uses no step of
hysim. It is itself held to closed forms and to the one-mass oscillator here. Short earthquakes; the whole ones are in
`experiments/39_structures_work_precision.py`.
"""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import structure_cases as cases
from scipy.linalg import expm
from square_dahl import SquareDahl
from structure_reference import reference

import hysim as hs

YIELDING = 2.0 * cases.yielding_frame().ground[210:310]
CASES = {  # strong parts of the earthquakes
    "one mass": lambda: cases.one_mass().window(150, 250),
    "three storeys, n = 2": lambda: cases.three_storeys().window(210, 310),
    "three storeys, n = 1": lambda: cases.three_storeys(1.0).window(210, 310),
    "bilinear": lambda: replace(cases.yielding_frame().window(210, 310), ground=YIELDING),
    "pinching": lambda: cases.pinching().window(210, 310),
    "twenty storeys": lambda: cases.isolated_tower().window(330, 380),
}


@cache
def case(name):
    """A short case and its reference, computed once."""
    made = CASES[name]()
    return made, made.reference()


def largest(array):
    return float(np.abs(array).max())


# ---------------------------------------------------------------------------------- the reference itself


def test_the_reference_is_exact_on_a_linear_oscillator():
    """The exact flow under a load that is linear between samples, by a matrix exponential."""
    m, c, k, h = 2.0, 0.7, 30.0, 0.05
    ground = np.random.default_rng(0).normal(size=80)
    loads = -m * ground[:, None]
    found = reference(
        np.eye(1) * m, np.eye(1) * c, np.eye(1) * 10.0, np.eye(1), [hs.Play(threshold=0.0, gain=k - 10.0)], loads, h
    )
    augmented = np.zeros((4, 4))
    augmented[0, 1], augmented[1, :3], augmented[2, 3] = 1.0, (-k / m, -c / m, 1.0), 1.0
    flow, x = expm(augmented * h), [np.zeros(2)]
    for a, b in pairwise(ground):
        x.append((flow @ [*x[-1], -a, (a - b) / h])[:2])
    exact = np.array(x)
    # 80 integrations, each to 1e-12
    assert largest(found.displacement[:, 0] - exact[:, 0]) < 1e-11 * largest(exact[:, 0])
    assert largest(found.velocity[:, 0] - exact[:, 1]) < 1e-11 * largest(exact[:, 1])


def test_the_reference_agrees_with_the_oscillator():
    """hysim's own scheme for one mass, of order 6, with many substeps; it is another method by other means."""
    made, exact = case("one mass")
    (law,) = (law for _, law in made.elements)
    options = {"mass": made.masses[0], "damping": float(made.damping[0, 0]), "stiffness": 0.0, "law": law}
    plant = hs.BoucWenOscillator(**options, excitation="base", substeps=32)
    y = plant.response(made.ground, made.sample_time)
    assert largest(y - exact.drift[:, 0]) < 3e-12 * largest(y)


def test_the_reference_has_converged():
    made, exact = case("bilinear")
    coarser = made.reference(1e-10)
    assert largest(coarser.drift - exact.drift) < 1e-9 * largest(exact.drift)
    assert largest(coarser.peak_drift / exact.peak_drift - 1.0) < 1e-9


@pytest.mark.parametrize("name", CASES)
def test_the_energies_of_the_reference_balance(name):
    made, exact = case(name)
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", exact.velocity, made.mass, exact.velocity)
    elastic = 0.5 * np.einsum("ni,ij,nj->n", exact.displacement, made.stiffness, exact.displacement)
    spent = kinetic + elastic + exact.damping_loss + exact.element_work.sum(axis=1)
    assert largest(exact.input_work - spent) < 1e-12 * exact.input_work.max()  # six figures are rounding of the sums


# ---------------------------------------------------------------------------------- structures


FINEST = {  # errors with 8 substeps, of the largest value: five times what was measured
    "one mass": 5e-10,
    "three storeys, n = 2": 5e-10,
    "three storeys, n = 1": 2e-9,
    "bilinear": 2e-8,
    "pinching": 5e-10,
    "twenty storeys": 4e-9,
}
PEAK = 2e-7  # of a continuous peak drift by default; 1e-6 is what it is for, 4e-8 was measured


@pytest.mark.parametrize("name", CASES)
def test_a_structure_follows_its_differential_equations(name):
    made, exact = case(name)
    signals = made.structure(substeps=8).signals(made.ground, made.sample_time)
    assert largest(signals["drift"] - exact.drift) < FINEST[name] * largest(exact.drift)
    assert largest(signals["displacement"] - exact.displacement) < FINEST[name] * largest(exact.displacement)
    assert largest(signals["force"] - exact.force) < 2.0 * FINEST[name] * largest(exact.force)
    assert largest(signals["velocity"] - exact.velocity) < 2.0 * FINEST[name] * largest(exact.velocity)


@pytest.mark.parametrize("name", CASES)
def test_peaks_are_those_between_the_samples(name):
    made, exact = case(name)
    signals = made.structure().signals(made.ground, made.sample_time)
    assert (1.0 - np.abs(exact.drift).max(axis=0) / exact.peak_drift).max() > 5e-5  # samples miss them
    assert largest(signals["peak_drift"][-1] / exact.peak_drift - 1.0) < PEAK
    found = hs.simulate(made.structure(), made.times, made.ground).peaks["drift"]
    assert largest(found / exact.peak_drift - 1.0) < PEAK


@pytest.mark.parametrize("name", CASES)
def test_energies_are_those_of_the_differential_equations(name):
    made, exact = case(name)
    signals = made.structure().signals(made.ground, made.sample_time)
    unit = exact.input_work.max()
    for energy in ("input_work", "damping_loss", "element_work"):
        assert largest(signals[energy] - exact._asdict()[energy]) < 1e-7 * unit, energy
    assert largest(signals["imbalance"]) < 1e-8 * unit


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", CASES)
def test_the_tolerance_is_that_of_the_drifts(name, tolerance):
    made, exact = case(name)
    signals = made.structure(tolerance=tolerance).signals(made.ground, made.sample_time)
    # errors of the steps add up; an estimate that sees nothing would miss this by a factor of thousands
    assert largest(signals["drift"] - exact.drift) < 20.0 * tolerance * largest(exact.drift)


# ---------------------------------------------------------------------------------- order of accuracy


def errors(made, exact, counts):
    """Largest errors of the drifts by the number of substeps."""
    runs = [made.structure(substeps=n).signals(made.ground, made.sample_time)["drift"] for n in counts]
    return [largest(run - exact.drift) for run in runs]


def order(found, counts):
    """The power of the step with which errors fall."""
    return -np.polyfit(np.log(counts), np.log(found), 1)[0]


def test_the_order_on_a_smooth_branch():
    """Until the first reversal, under a load that rises smoothly: one long sample after the other."""
    made = cases.three_storeys()
    pushed = replace(made, ground=-2.0 * np.linspace(0.0, 1.0, 4) ** 2, sample_time=0.04)
    exact, counts = pushed.reference(), (1, 2, 4)
    assert (np.diff(np.abs(exact.drift), axis=0) > 0.0).all()  # nothing turns
    assert order(errors(pushed, exact, counts), counts) > 3.8


@pytest.mark.parametrize("name", ["one mass", "three storeys, n = 2", "pinching"])
def test_the_order_across_reversals(name):
    """With samples four times as long; with short ones the division of moments hides the order below 1e-8."""
    made, _ = case(name)
    slower = replace(made, ground=made.ground[::4], sample_time=4.0 * made.sample_time)
    exact, counts = slower.reference(), (1, 2, 4)
    assert order(errors(slower, exact, counts), counts) > 3.8


# ---------------------------------------------------------------------------------- laws without an equation


def central_differences(plant, ground, h, count):
    """Drifts by a plain loop around the laws' steps, of order 2 with steps of h / count."""
    M, C, K, B = plant.mass_matrix, plant.damping_matrix, plant.stiffness_matrix, plant.drift_matrix
    laws = [element.law.compiled() for element in plant.elements]
    h, inverse = h / count, np.linalg.inv(M + 0.5 * h / count * C)
    loads, out = -M @ np.ones(len(M)), [np.zeros(len(laws))]
    x, before = np.zeros(len(M)), -0.5 * h * h * np.ones(len(M)) * ground[0]
    for shake in np.interp(np.arange((ground.size - 1) * count) / count, np.arange(ground.size), ground):
        f = [law.step(law.parameters, law.state, d) for law, d in zip(laws, B @ x, strict=True)]
        right = h * h * (loads * shake - K @ x - f @ B) + 2.0 * M @ x - (M - 0.5 * h * C) @ before
        before, x = x, inverse @ right
        out.append(B @ x)
    return np.array(out)[::count]


def test_a_preisach_link_and_a_law_of_the_user():
    """Their motion is what a plain loop of order 2 converges to, and each further substep comes nearer to it."""
    levels = np.linspace(-0.04, 0.04, 81)
    link = hs.Preisach.from_density(levels, lambda a, b: -4e6 * np.exp(-(((a - b) / 0.03) ** 2)))
    link = replace(link, offset=-float(link.response([0.0])[0]), z0=(-0.04, 0.04, -0.03, 0.02, -0.01, 0.005))
    link = replace(link, offset=link.offset - float(link.response([0.0])[0]))
    own = SquareDahl(k=6e4, coulomb=250.0, c=0.0)
    elements = (hs.Element(own, between=(0, 1)), hs.Element(link, between=(1, 2)))
    options = {"mass": (100.0, 100.0), "stiffness": np.array([[1.8e5, -8e4], [-8e4, 8e4]]), "damping": 40.0}
    made = cases.three_storeys().window(200, 300)
    finest, rough = (
        hs.Structure(**options, elements=elements, substeps=n).signals(made.ground, made.sample_time)["drift"]
        for n in (16, 1)
    )
    coarse, fine = (
        central_differences(hs.Structure(**options, elements=elements), made.ground, made.sample_time, n)
        for n in (8, 16)
    )
    assert largest(rough - finest) < 1e-3 * largest(finest)
    assert largest(coarse - finest) > 2.0 * largest(fine - finest)  # the loop comes nearer
    assert largest((4.0 * fine - coarse) / 3.0 - finest) < 1e-4 * largest(finest)  # and would end there
