"""An identification does not depend on the units in which input and output are stated."""

import functools

import numpy as np
import pytest
from square_dahl import SquareDahl

import hysim as hs
from hysim.models.model import candidates

RNG = np.random.default_rng(0)
SHARE = np.linspace(0.0, 1.0, 100)
U = np.sin(6.0 * np.pi * SHARE) * (1.0 - 0.5 * SHARE)
TRUTH = hs.BoucWen(beta=1.2, gamma=0.5, gain=2.0, feedthrough=0.5, offset=0.3)
Y = TRUTH.response(U) + 0.01 * RNG.standard_normal(U.size)
FACTORS = ((2.0**-100, 1.0), (1.0, 2.0**100), (1e30, 1e-25))
FREE_OF_ROUNDING = 1e-6  # of the rmse: where a search that is rounded otherwise comes to rest on the same optimum
SUBJECTS = {
    **{name: each for name, each in candidates().items() if name.partition(" ")[0] in hs.__all__},
    "SquareDahl": SquareDahl,
    "BoucWenBaberNoori": hs.BoucWenBaberNoori,
    "LuGre": hs.LuGre,
    "GeneralizedMaxwellSlip": hs.GeneralizedMaxwellSlip,
    "StribeckFriction": hs.StribeckFriction,
    "ElasticBacklash": hs.ElasticBacklash,
    "Dashpot": hs.Dashpot,
    "ExcessLoss": hs.ExcessLoss,
    "a sum": hs.Sum.structure(hs.Dahl, hs.Line),
    "a cascade": hs.Cascade.structure(hs.Play, hs.TransferFunction.structure(poles=1, zeros=0)),
}


def fitted(name: str, u_factor: float, y_factor: float) -> hs.Identification:
    record = hs.Record(u=u_factor * U, y=y_factor * Y, t=0.01 * np.arange(U.size))
    return hs.identify(SUBJECTS[name], record, max_evaluations=100)


@pytest.mark.parametrize("name", SUBJECTS)
def test_a_record_in_other_units_has_the_same_fit(name):
    """In both units at once; one search scales all families, so that three of them stand for single units."""
    plain = fitted(name, 1.0, 1.0)
    for factors in FACTORS if name in ("BoucWen", "SquareDahl", "a cascade") else FACTORS[-1:]:
        scaled = fitted(name, *factors)
        apart = np.abs(scaled.residual / factors[1] - plain.residual).max()
        assert apart <= FREE_OF_ROUNDING * plain.rmse
        assert scaled.free_names == plain.free_names


@pytest.mark.parametrize(("u_factor", "y_factor"), [(1e-30, 1e30), (1e30, 1e-30), (1.0, 1e12)])
def test_estimates_and_errors_are_those_of_the_other_units(u_factor, y_factor):
    plain = hs.identify(hs.Dahl, hs.Record(u=U, y=Y))
    fit = hs.identify(hs.Dahl, hs.Record(u=u_factor * U, y=y_factor * Y))
    units = {"stiffness": y_factor / u_factor, "coulomb": y_factor, "offset": y_factor, "z0": y_factor}
    for name, unit in units.items():
        assert fit.estimates[name] / unit == pytest.approx(plain.estimates[name], rel=1e-6)
        assert fit.stderr[name] / unit == pytest.approx(plain.stderr[name], rel=1e-4)  # of differences
    assert fit.success


def test_a_core_in_unknown_units_has_a_feedthrough_of_its_own():
    steel = hs.JilesAtherton(Ms=1.2e6, a=60.0, alpha=1e-4, k=50.0, c=0.2)
    u = 200.0 * np.sin(np.linspace(0.0, 4.0 * np.pi, 81))
    freed = [
        "feedthrough" in hs.identify(hs.JilesAtherton, record, max_evaluations=50).free_names
        for record in (
            hs.Record(u=u, y=steel.response(u), units={"u": "A/m", "y": "T"}),
            hs.Record(u=u, y=1e4 * steel.response(u), units={"u": "A/m", "y": "G"}),
            hs.Record(u=u, y=1e-8 * steel.response(u)),
        )
    ]
    assert freed == [False, True, True]


@pytest.mark.parametrize(
    "verb", [functools.partial(hs.identify, hs.BoucWen), hs.discover, functools.partial(hs.compare, ["dahl"])]
)
@pytest.mark.parametrize(("u_factor", "y_factor", "name"), [(1e-300, 1.0, "input u"), (1.0, 1e300, "output y")])
def test_numbers_whose_squares_are_none_are_refused_in_one_sentence(verb, u_factor, y_factor, name):
    with pytest.raises(ValueError, match=f"takes records between 1e-40 and 1e\\+40 in size, got an {name}"):
        verb(hs.Record(u=u_factor * U, y=y_factor * Y))


@pytest.mark.parametrize(("u_factor", "y_factor"), [(2.0**-100, 1.0), (1e30, 1.0), (1.0, 1e-30)])
def test_an_oscillator_of_any_mass_is_found(u_factor, y_factor):
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0, n=1.0)
    plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law, substeps=4)
    lines = np.zeros(65, dtype=complex)
    lines[1:14] = np.exp(2j * np.pi * RNG.random(13))
    force = 2000.0 * np.fft.irfft(lines)
    force -= force[0]
    y = plant.response(force, 1.0 / 750.0)
    record = hs.Record(u=u_factor * force, y=y_factor * y, t=np.arange(128) / 750.0)
    fit = hs.identify(hs.BoucWenOscillator.structure(), record, fixed={"n": 1.0}, max_evaluations=100)
    assert fit.estimates["mass"] * y_factor / u_factor == pytest.approx(2.0, rel=1e-2)  # the integration's error
