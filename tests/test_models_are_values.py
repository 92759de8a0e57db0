"""A model is what it holds: numbers that are finite, its own, and all that equality asks for."""

import dataclasses

import numpy as np
import pytest

import hysim as hs

NUMBERS = [
    (hs.BoucWen, {"beta": 0.7}, "beta"),
    (hs.PolynomialBoucWen, {"input_coefficients": (1.0, 0.2)}, "input_coefficients"),
    (hs.ZhuWangBoucWen, {"delta": 0.2}, "delta"),
    (hs.GeneralizedBoucWen, {"b4": 0.2}, "b4"),
    (hs.Duhem, {"p": [[1.0]], "q": [[0.0, -1.0]]}, "q"),
    (hs.Duhem, {"p": [[1.0]], "q": [[0.0]], "p_abs": [[0.5]], "q_abs": [[0.0, -1.0]]}, "q_abs"),
    (hs.Duhem, {"p": [[1.0]], "q": [[0.0]], "feedthrough": 2.0}, "feedthrough"),
    (hs.PrandtlIshlinskii, {"thresholds": (0.0, 0.5), "weights": (1.0, 2.0)}, "weights"),
    (hs.ModifiedPrandtlIshlinskii, {"dead_zones": (0.0, 0.5), "dead_zone_weights": (1.0, 2.0)}, "dead_zone_weights"),
    (hs.GeneralizedPrandtlIshlinskii, {"left": (1.0, 2.0, 0.1, 0.2, 0.3)}, "left"),
    (hs.RateDependentPrandtlIshlinskii, {"thresholds": (0.5,), "weights": (1.0,), "beta": 0.1}, "beta"),
    (hs.ParametricPrandtlIshlinskii, {"exponent": 0.5, "weight": 1.0, "reach": 2.0}, "exponent"),
    (hs.ParametricPrandtlIshlinskii, {"weight": 1.0, "reach": 2.0}, "reach"),
    (hs.Preisach, {"levels": (0.0, 1.0, 2.0), "weights": (1.0, 0.5, 2.0)}, "weights"),
    (hs.PreisachRelays, {"levels": (0.0, 1.0), "weights": (1.0,)}, "levels"),
    (hs.Play, {"threshold": 0.5}, "threshold"),
    (hs.MaxwellSlip, {"stiffness": (1.0, 2.0), "slips": (0.5, 0.1)}, "stiffness"),
    (hs.Dahl, {"coulomb": 0.7}, "coulomb"),
    (hs.ColemanHodgdon, {"B": 0.7}, "B"),
    (hs.BoucWenBaberNoori, {"delta_nu": 0.2}, "delta_nu"),
    (hs.JilesAtherton, {"k": 0.2}, "k"),
    (hs.Dashpot, {"c": 0.7}, "c"),
    (hs.LuGre, {"sigma1": 0.7}, "sigma1"),
    (hs.StribeckFriction, {"viscous": 0.7}, "viscous"),
    (hs.GeneralizedMaxwellSlip, {"stiffness": (1.0, 2.0), "weights": (0.5, 0.5)}, "weights"),
    (hs.ElasticBacklash, {"half_gap": 0.7}, "half_gap"),
    (hs.ExcessLoss, {"c": 0.7}, "c"),
    (hs.Tellinen, {"squareness": 0.7}, "squareness"),
    (hs.TellinenTable, {"upper": (-0.5, 2.0)}, "upper"),
    (hs.Chan, {"gap": 0.7}, "gap"),
    (hs.EnergyPlays, {"thresholds": (0.0, 0.5), "weights": (1.0, 2.0), "field": 0.3}, "weights"),
    (hs.TransferFunction, {"num": (1.0,), "den": (1.0, 2.0)}, "den"),
    (hs.BoucWenOscillator, {"mass": 2.0, "damping": 1.0, "stiffness": 3.0, "law": hs.BoucWen()}, "stiffness"),
    (hs.Amplifier, {"slew_rate": 2.0}, "slew_rate"),
    (hs.Creep, {"time_constants": (1.0, 2.0), "weights": (0.1, 0.2)}, "weights"),
    (hs.StateSpace, {"A": [[-1.0]], "B": [1.0], "C": [2.0]}, "A"),
    (hs.Modes, {"natural_frequencies": (1.0, 2.0), "damping_ratios": (0.1, 0.2), "gains": (1.0, 0.5)}, "gains"),
    (hs.Sensor, {"quantum": 0.1}, "quantum"),
    (hs.Line, {"slope": 2.0}, "slope"),
    (hs.SingleValued, {"u": [0.0, 1.0], "y": [0.0, 2.0]}, "y"),
]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("family", "arguments", "name"), NUMBERS)
def test_a_number_that_is_not_finite_is_refused_by_name(family, arguments, name, bad):
    values = np.array(arguments[name], dtype=float)
    values.flat[-1] = bad
    with pytest.raises(ValueError, match=f"{name} must be finite"):
        family(**arguments | {name: values})


@pytest.mark.parametrize("wrong", ["one", 1j, {}])
@pytest.mark.parametrize(("family", "arguments", "name"), NUMBERS)
def test_what_is_no_number_is_refused_by_name(family, arguments, name, wrong):
    with pytest.raises(TypeError, match=f"{name} must be"):
        family(**arguments | {name: wrong})


@pytest.mark.parametrize(("family", "arguments", "name"), NUMBERS)
def test_parameters_go_by_name(family, arguments, name):
    with pytest.raises(TypeError, match="positional"):
        family(*arguments.values())


@pytest.mark.parametrize(("family", "arguments", "name"), NUMBERS)
def test_equality_and_hash_see_every_number(family, arguments, name):
    model = family(**arguments)
    assert model == family(**arguments)
    assert {model: 1}[family(**arguments)] == 1
    values = np.array(arguments[name], dtype=float)
    values.flat[-1] *= 1 + 2**-52
    assert model != family(**arguments | {name: values})


def test_families_with_the_same_numbers_differ():
    assert hs.Line() != hs.SingleValued(u=[0.0], y=[0.0])
    assert hs.Line() != dataclasses.asdict(hs.Line())


def test_an_array_of_the_caller_stays_the_callers():
    y = np.array([0.0, 2.0])
    curve = hs.SingleValued(u=[0.0, 1.0], y=y)
    y[1] = 5.0
    assert curve.y.tolist() == [0.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        curve.y[0] = 1.0
