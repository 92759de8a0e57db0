"""Lightly damped oscillators settle in few periods, and undamped and unstable ones are refused as quickly."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_refused, needs_compiled

import hysim as hs
from hysim.discovery._hidden_memory import Oscillator, Response
from hysim.kernels import memory_terms
from hysim.laws.differential.terms import bouc_wen_terms
from hysim.models.steady_cycle import fixed_point
from hysim.plants.oscillator import attracting_state

STEP, OMEGA = 0.01, 12.0
U = 20.0 * np.sin(2.0 * np.pi * np.arange(100) / 100) + 3.0
MOST = 300  # periods: the last attempt begins after 256


def oscillator(zeta: float, kind: str = "linear") -> hs.BoucWenOscillator:
    """A linear plant, or one with a hysteretic, an elastic, or a cubic spring as well."""
    A = {"hysteretic": 50.0, "elastic": 50.0}.get(kind, 0.0)
    beta = 0.3 if kind == "hysteretic" else 0.0
    cubic = 20.0 if kind == "cubic" else 0.0
    law = hs.PolynomialBoucWen(A=A, beta=beta, gamma=0.5 * beta, input_coefficients=(0.0, 0.0, cubic))
    return hs.BoucWenOscillator(mass=1.0, damping=2.0 * zeta * OMEGA, stiffness=OMEGA**2 - A, law=law)


@pytest.fixture
def periods(monkeypatch) -> list[int]:
    """Grows by one for each period that an oscillator goes through."""
    runs: list[int] = []
    states = hs.BoucWenOscillator._states

    def counted(self, u, *rest):
        runs.append(len(u))
        return states(self, u, *rest)

    monkeypatch.setattr(hs.BoucWenOscillator, "_states", counted)
    return runs


def plain(plant: hs.BoucWenOscillator, n_periods: int) -> np.ndarray:
    """The last of many periods."""
    return plant.response(np.tile(U, n_periods), STEP)[-U.size :]


@needs_compiled
@pytest.mark.parametrize("kind", ["linear", "hysteretic", "elastic", "cubic"])
@pytest.mark.parametrize(
    ("zeta", "most", "n_periods"),
    [
        (5e-4, MOST, 4000),  # a deviation keeps exp(-0.006) of its size in a period: 4e-11 after 4000
        (0.01, 60, 400),  # of which a period takes 11 %: 1e-21 after 400
    ],
    ids=["lightly damped", "moderately damped"],
)
def test_a_damped_plant_settles_in_few_periods_where_thousands_lead(zeta, most, n_periods, kind, periods):
    plant = oscillator(zeta, kind)
    y = plant.periodic_response(U, STEP)
    assert len(periods) < most
    assert np.abs(y - plain(plant, n_periods)).max() < 1e-8 * np.abs(y).max()


@pytest.mark.parametrize("kind", ["linear", "elastic", "cubic"])
def test_an_undamped_plant_is_refused_quickly(kind, periods):
    assert_refused("has not settled", oscillator(0.0, kind).periodic_response, U, STEP, error=hs.SimulationError)
    assert len(periods) < (400 if kind == "cubic" else 60)


@needs_compiled
@pytest.mark.parametrize("zeta", [-1e-4, -2e-3])
def test_an_unstable_plant_is_refused(zeta, periods):
    with pytest.raises(hs.SimulationError, match=r"has not settled|leaves the finite numbers"):
        oscillator(zeta).periodic_response(U, STEP)
    assert len(periods) < 450


def test_a_fixed_point_that_does_not_attract_is_not_used():
    """Newton's method finds the fixed point at 1 of both maps; the second one leads away from it."""
    state, scale = np.array([1.5, 1.2, 0.9]), np.ones(3)
    for size, expected in ((0.999, True), (1.001, False)):
        found = attracting_state(lambda x, size=size: 1.0 + size * (x - 1.0), state, scale, 1e-10)
        assert (found is not None) == expected
        assert found is None or np.abs(found - 1.0).max() < 1e-9
    assert_refused("needs damping", attracting_state, lambda x: 2.0 - x, state, scale, 1e-10, error=hs.SimulationError)


@needs_compiled
def test_the_search_settles_a_lightly_damped_plant_too(monkeypatch):
    runs, motion = [], memory_terms.motion

    def counted(*given):
        runs.append(1)
        return motion(*given)

    monkeypatch.setattr(memory_terms, "motion", counted)
    structure = hs.BoucWenOscillator.structure(initial="periodic", period=100, oversampling=4)
    plant = replace(oscillator(5e-4, "hysteretic"), substeps=4)
    record = hs.Record(u=U, y=plant.periodic_response(U, STEP), t=STEP * np.arange(100))
    law = dict(zip(bouc_wen_terms(1.0), (50.0, -0.3, -0.15), strict=True))
    known = {"mass": 1.0, "damping": plant.damping, "stiffness": plant.stiffness}
    y = Response(structure, [record], {}).outputs([Oscillator(known, law)])[0]
    assert len(runs) < MOST
    assert np.abs(y - record.y).max() < 1e-4 * np.abs(y).max()  # the steps of the two methods differ
    runs.clear()
    undamped = Oscillator(known | {"damping": 0.0}, {})
    assert np.isinf(Response(structure, [record], {}).outputs([undamped])).all()
    assert len(runs) < 60


EXPLOSIVE = """
import numpy as np
import hysim as hs
law = hs.BoucWen(A=1.28e-3, beta=-4.604545134491883e37, gamma=4.604545144315831e37, n=8.14)
plant = hs.BoucWenOscillator(mass=2.1e-3, damping=0.019, stiffness=7.3, law=law, substeps=4)
try:
    plant.response(np.sin(2 * np.pi * np.arange(200) / 100), 1 / 300)
except hs.SimulationError as error:
    print("refused:", error)
"""


@needs_compiled
def test_a_law_that_diverges_within_a_step_ends():
    """In a process of its own: a step that does not end cannot be interrupted."""
    ended = subprocess.run([sys.executable, "-c", EXPLOSIVE], capture_output=True, text=True, timeout=60, check=True)
    assert "refused: the motion leaves the finite numbers" in ended.stdout


# ----------------------------------------------------------------------- the memory with which a cycle ends as it began


def memory_after(one_pass, start):
    """The fixed point of the same pass for all sets, from `start` (n_sets,)."""
    return fixed_point(lambda sets: one_pass, np.array(start)[:, np.newaxis])[:, 0]


def test_a_cycle_that_leads_away_is_not_found():
    """The pass, which saturates as a memory does, has fixed points at 0 and at the ends of z = 1.5 tanh z."""
    ends = memory_after(lambda z: 1.5 * np.tanh(z), [0.3, -0.3, 2.0])
    assert ends == pytest.approx([1.28783945, -1.28783945, 1.28783945], abs=2e-3)  # after eight passes


@pytest.mark.parametrize("factor", [0.95, 0.0, -0.9])
def test_a_cycle_that_attracts_is_found_to_rounding(factor):
    assert memory_after(lambda z: 2.0 + factor * (z - 2.0), [-5.0, 1e3]) == pytest.approx(2.0, abs=1e-9)


def test_a_pass_that_overshoots_by_more_than_it_was_off_has_no_steady_cycle():
    assert np.abs(memory_after(lambda z: -1.5 * z, [1.0])[0]) > 1.0
