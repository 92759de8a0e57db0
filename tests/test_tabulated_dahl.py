"""Dahl's law between tables against its solution, and as the open-circuit voltage of a cell."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_batch_has_the_bits_of_its_laws, assert_cut_or_stepped_it_has_the_same_bits, refused

import hysim as hs

CHARGE = np.linspace(0.0, 1.0, 9)
RISING = 3.2 + 0.6 * CHARGE + 0.1 * np.tanh(15.0 * (CHARGE - 0.1))
FALLING = RISING - 0.06 + 0.03 * CHARGE
CELL = hs.TabulatedDahl.from_branches(CHARGE, RISING, FALLING, rate=20.0)


@pytest.mark.parametrize("seed", range(5))
def test_it_goes_exponentially_from_branch_to_branch_however_a_stroke_is_sampled(seed):
    u, h = np.random.default_rng(seed).uniform(-0.2, 1.2, 60), [0.3]
    for length in np.diff(u).tolist():
        h.append(np.sign(length) + (h[-1] - np.sign(length)) * np.exp(-20.0 * abs(length)))
    expected = np.interp(u, CHARGE, 0.5 * (RISING + FALLING)) + np.interp(u, CHARGE, 0.5 * (RISING - FALLING)) * h
    law = replace(CELL, z0=0.3)
    y = law.response(u)
    assert np.abs(y - expected).max() < 1e-14 * 4.0
    fine = np.append(np.column_stack([u[:-1], 0.5 * (u[:-1] + u[1:])]), u[-1])
    assert np.abs(law.response(fine)[::2] - y).max() < 1e-14
    assert_cut_or_stepped_it_has_the_same_bits(law, u, 17)
    inside = np.clip(u, 0.01, 0.99)
    assert np.abs(law.inverse_response(law.response(inside), u0=inside[0]) - inside).max() < 1e-9
    grown = law.regressors({"rate": np.array([20.0]), "z0": np.array([0.3])}, hs.Record(u=u, y=u))[0]
    assert np.abs(grown[:, :-1] @ [*CELL.centre, *CELL.amplitude] + grown[:, -1] - y).max() < 1e-14 * 4.0


def test_a_cell_is_identified_from_two_partial_cycles_and_predicted_on_a_third():
    noise, rng = 0.001, np.random.default_rng(0)
    cycles = [hs.signals.extremes(ends, max_step=0.01) for ends in ([0.0, 0.9, 0.2, 0.8], [1.0, 0.1, 0.7, 0.2])]
    recs = [hs.Record(u=u, y=CELL.response(u) + noise * rng.standard_normal(u.size)) for u in cycles]
    fit = hs.identify(hs.TabulatedDahl.over(*recs, nodes=9), recs)
    assert (fit.rmse, fit.estimates["rate"]) == pytest.approx((noise, 20.0), rel=0.1)
    third = hs.signals.extremes([0.2, 0.7, 0.45, 0.85, 0.2], max_step=0.01)
    predicted = replace(fit.model, z0=CELL.z0, u0=None).response(third)
    assert np.sqrt(np.mean((predicted - CELL.response(third)) ** 2)) < 0.5 * noise


def test_a_batch_has_the_bits_of_its_laws():
    sets = {"rate": [5.0, 0.1, 900.0], "z0": [0.0, -1.0, 1.0]}
    assert_batch_has_the_bits_of_its_laws(hs.TabulatedDahl, sets, np.sin(np.linspace(0.0, 9.0, 60)), own_inputs=True)


def test_a_capacity_that_begins_anew_becomes_a_signed_charge():
    charge = hs.signals.extremes([0.0, 3.0, 1.0, 2.0], max_step=0.1)
    current, turns = np.sign(np.diff(charge, prepend=-0.1)), (0, 30, 50)
    capacity = np.abs(charge - charge[[max(t for t in turns if t <= k - (k > 0)) for k in range(charge.size)]])
    assert capacity[31] == pytest.approx(0.1)
    assert np.abs(hs.signed_charge(capacity, current) - charge).max() < 1e-12


test_wrong_arguments_are_named = refused(
    (lambda: hs.TabulatedDahl(inputs=(0.0, 0.0)), "inputs must increase"),
    (lambda: hs.TabulatedDahl(inputs=(0.0, 1.0, 2.0)), "equally long"),
    (lambda: hs.signed_charge([0.0, 1.0, -1.0], [1.0, 1.0, 1.0]), "count up from zero"),
    (lambda: hs.signed_charge([0.0, 0.5, 0.49, 1.0], [1.0, 1.0, 1.0, 1.0]), "count up from zero"),
    (lambda: hs.TabulatedDahl.over(hs.Record(u=np.ones(3), y=np.arange(3.0))), "the input is constant"),
    (lambda: hs.TabulatedDahl(z0=2.0), "z0 must be of a size of at most 1"),
)
