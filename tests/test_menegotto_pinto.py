"""The law of Menegotto and Pinto against Steel02 as OpenSees computes it, in strain and stress."""

import numpy as np
import pytest
from strategies import assert_batch_has_the_bits_of_its_laws, assert_cut_or_stepped_it_has_the_same_bits, refused

import hysim as hs


def steel02(strains, *, Fy, E0, b, R0, cR1, cR2, a1, a2, a3, a4):
    """Stress at each strain: asymptotes that meet at (eps_0, sig_0), and the curve between them, as published."""
    yielding, stress = Fy / E0, [0.0]
    largest, least, rises = yielding, -yielding, None
    for last, strain in zip(strains[:-1].tolist(), strains[1:].tolist(), strict=True):
        if (strain > last) is not rises:
            virgin, rises, s = rises is None, strain > last, 1.0 if strain > last else -1.0
            largest, least = max(largest, last), min(least, last)
            size, unit = (a3, a4) if rises else (a1, a2)
            shift = 1.0 if virgin else 1.0 + size * ((largest - least) / (2.0 * unit * yielding)) ** 0.8
            eps_r, sig_r = last, stress[-1]
            eps_0 = (s * Fy * shift * (1.0 - b) - sig_r + E0 * eps_r) / (E0 - b * E0)
            sig_0 = s * Fy * shift + b * E0 * (eps_0 - s * yielding * shift)
            xi = abs(((largest if rises else least) - eps_0) / yielding)
            R = R0 * (1.0 - cR1 * xi / (cR2 + xi))
        ratio = (strain - eps_r) / (eps_0 - eps_r)
        stress.append((b * ratio + (1.0 - b) * ratio / (1.0 + ratio**R) ** (1.0 / R)) * (sig_0 - sig_r) + sig_r)
    return np.array(stress)


RANGES = {
    "Fy": (200.0, 600.0), "E0": (2e5, 2e5), "b": (0.0, 0.1), "R0": (5.0, 25.0), "cR1": (0.5, 0.95), "cR2": (0.05, 0.3),
    "a1": (0.0, 0.1), "a2": (0.5, 2.0), "a3": (0.0, 0.1), "a4": (0.5, 2.0),
}  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_it_is_steel02_however_a_stroke_is_sampled(seed):
    rng = np.random.default_rng(seed)
    numbers = {name: rng.uniform(*ends) for name, ends in RANGES.items()}
    strains = np.append(0.0, 0.003 * rng.normal(size=200).cumsum())
    law = hs.MenegottoPinto.from_opensees(**numbers, least_reversal=0.0)
    y = law.response(strains)
    assert np.abs(y - steel02(strains, **numbers)).max() < 1e-12 * np.ptp(y)
    between = strains[:-1] + rng.random(strains.size - 1) * np.diff(strains)
    fine = np.append(np.column_stack([strains[:-1], between]), strains[-1])
    assert np.array_equal(law.response(fine)[::2], y)
    assert np.abs(law.inverse_response(y, u0=0.0) - strains).max() < 1e-12 or numbers["b"] < 1e-3
    assert_cut_or_stepped_it_has_the_same_bits(law, strains, 77)
    assert law.to_opensees() == pytest.approx(numbers, rel=1e-15)


def test_a_batch_has_the_bits_of_its_laws_and_hostile_numbers_stay_finite():
    sets = {"hardening": [0.1, 0.0], "R0": [20.0, 3.0], "a1": [0.0, 0.1], "z0": [0.0, 0.3]}
    assert_batch_has_the_bits_of_its_laws(hs.MenegottoPinto, sets, np.sin(np.linspace(0.0, 9.0, 60)), own_inputs=True)
    hostile = hs.MenegottoPinto(R0=1e6, cR1=0.0, cR2=1e-300, hardening=0.5, z0=9.0)  # beyond its asymptote
    assert hostile.response([0.0, 1e9, -1e9, 1.0]).tolist() == pytest.approx([4.5, 5e8 + 4.5, -5e8 - 0.5, 1.0])


def test_a_reversal_of_rounding_leaves_the_curve_as_it_is_unless_it_is_asked_for():
    """Steel02 begins anew at the elastic slope: what a solver rounds would keep a frame from yielding."""
    law, u = hs.MenegottoPinto(hardening=0.1), np.linspace(0.0, 4.0, 401)
    rounded = np.append(0.0, np.column_stack([u[1:], u[1:] - 1e-9]))  # each sample, and a little back
    assert np.array_equal(law.response(rounded)[1::2], law.response(u)[1:])
    steel = hs.MenegottoPinto(hardening=0.1, least_reversal=0.0)
    assert steel.response(rounded)[199] > steel.response(u)[100] + 0.01
    far = np.append(u, u[::-1])
    assert np.abs(law.response(far) - steel.response(far)).max() < 2e-6


def test_identify_recovers_a_steel_and_a_steady_cycle_is_refused():
    share = np.linspace(0.0, 1.0, 150)
    u = 0.02 * np.sin(10.0 * np.pi * share) * (0.2 + 0.8 * share)
    truth = hs.MenegottoPinto.from_opensees(Fy=420.0, E0=200e3, b=0.02)
    fit = hs.identify(hs.MenegottoPinto, hs.Record(u=u, y=truth.response(u)), fixed={"cR1": 0.925, "cR2": 0.15})
    assert fit.estimates == pytest.approx(truth.scalars, rel=1e-6, abs=1e-6)
    sharp = hs.Record(
        u=u, y=hs.MenegottoPinto.from_opensees(Fy=420.0, E0=200e3, b=0.02, R0=400.0, cR1=0.99).response(u)
    )
    fit = hs.identify(hs.MenegottoPinto, sharp, fixed={"cR2": 0.15, "a1": 0.0, "a3": 0.0, "z0": 0.0})
    assert (fit.success, fit.estimates["R0"], fit.fit_percent > 99.0) == (True, 25.0, True), fit.message
    with pytest.raises(ValueError, match="more than its initial force"):
        hs.identify(hs.MenegottoPinto, hs.Record(u=u, y=u), initial="periodic")


test_wrong_arguments_are_named = refused(
    (lambda: hs.MenegottoPinto(cR1=1.0), "cR1 must be below 1"),
    (lambda: hs.MenegottoPinto(offset=1.0).to_opensees(), "has no offset"),
)
