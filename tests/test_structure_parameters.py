"""The numbers of a structure have names, and can be exchanged by them."""

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs

BOUC_WEN = hs.BoucWen(A=1.0, beta=50.0, gamma=40.0, feedthrough=20.0, gain=180.0)


def frame(**options):
    laws = (BOUC_WEN, hs.PrandtlIshlinskii(thresholds=(0.1, 0.2), weights=(1.0, 2.0)), BOUC_WEN + hs.Dashpot(c=2.0))
    return hs.shear_frame([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], laws, **options)


@pytest.mark.parametrize(
    ("damping", "own"),
    [
        (0.3, {"damping": 0.3}),
        (hs.ModalDamping(ratio=0.02), {"damping": 0.02}),
        (hs.ModalDamping(ratio=(0.02, 0.03, 0.04)), {"damping": 1.0, "damping[1]": 0.03}),
        (hs.Rayleigh(mass=0.1, stiffness=0.2), {"damping": 1.0, "damping.mass": 0.1, "damping.stiffness": 0.2}),
        ([1.0, 2.0, 3.0], {"damping": 1.0, "damping[2]": 3.0}),
        (np.diag([1.0, 2.0, 3.0]), {"damping": 1.0}),
    ],
)
def test_every_number_has_a_name(damping, own):
    scalars = frame(damping=damping, influence=(1.0, 1.0, 0.5)).scalars
    expected = own | {
        "mass": 1.0,
        "mass[2]": 3.0,
        "stiffness": 1.0,
        "influence[2]": 0.5,
        "elements.0.beta": 50.0,
        "elements.1.thresholds[1]": 0.2,
        "elements.2.bouc_wen.gamma": 40.0,
        "elements.2.dashpot.c": 2.0,
    }
    assert {name: scalars[name] for name in expected} == expected


@pytest.mark.parametrize(
    "damping",
    [0.3, hs.ModalDamping(ratio=(0.02, 0.03, 0.04)), hs.Rayleigh(mass=0.1, stiffness=0.2), np.diag([1.0, 2.0, 3.0])],
)
def test_own_numbers_make_the_same_structure(damping):
    structure = frame(damping=damping, initial_state=(0.0,) * 6)
    assert structure.assemble(structure.scalars) == structure


def test_each_number_can_be_exchanged():
    structure = frame(damping=hs.ModalDamping(ratio=(0.02, 0.03, 0.04)), influence=(1.0, 1.0, 1.0))
    for name, value in structure.scalars.items():
        assert structure.assemble({name: 0.05 + value}).scalars.get(name) == pytest.approx(
            1.0 if value == 1.0 and name in ("mass", "stiffness", "damping") else 0.05 + value
        ), name


def test_a_factor_multiplies_the_whole():
    structure = frame(damping=hs.Rayleigh(mass=0.1, stiffness=0.2))
    doubled = structure.assemble({"mass": 2.0, "stiffness": 3.0, "damping": 4.0, "mass[0]": 5.0})
    assert doubled.mass.tolist() == [10.0, 4.0, 6.0]
    np.testing.assert_allclose(doubled.stiffness, 3.0 * structure.stiffness)
    assert doubled.damping == hs.Rayleigh(mass=0.4, stiffness=0.8)


def test_a_star_names_all_elements_and_a_number_wins():
    other = frame().assemble({"elements.*.bouc_wen.beta": 7.0, "elements.0.beta": 8.0, "elements.*.beta": 9.0})
    assert other.elements[2].law.parts[0].beta == 7.0
    assert other.elements[0].law.beta == 8.0


def test_laws_of_ones_own_take_part():
    def step(parameters, state, u):
        state[0] = u
        return parameters[0] * u

    spring = hs.CustomLaw(step=step, parameters={"k": 2.0})
    structure = hs.shear_frame([1.0], laws=spring).assemble({"elements.0.k": 8.0})
    assert structure.periods()[0] == pytest.approx(2.0 * np.pi / np.sqrt(8.0))


@pytest.mark.parametrize("name", ["elements.0.bta", "elements.9.beta", "elements.*.bta", "scale", "damping[0]"])
def test_an_unknown_name_is_refused_with_those_that_exist(name):
    assert_refused(r"no parameter .*mass\[0\].*elements", frame().assemble, {name: 1.0})


def test_the_constructor_checks_the_numbers():
    assert_refused("mass", frame().assemble, {"mass": -1.0})
    assert_refused("thresholds", frame().assemble, {"elements.1.thresholds[0]": -1.0})
