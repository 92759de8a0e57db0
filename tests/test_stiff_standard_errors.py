"""Standard errors at optima that are much narrower than the box of the search."""

import math

import numpy as np
import pytest

import hysim as hs
from hysim.identification import _uncertainty


def bent(parameters, state, u):
    rate, gain, offset = parameters
    if u != state[0]:
        state[1] += (u - state[0]) * math.exp(-rate * abs(state[1]))
    state[0] = u
    return offset + gain * state[1]


LAW = hs.CustomLaw(
    step=bent,
    parameters={"rate": 2.0, "gain": 1.5, "offset": 0.1},
    state={"z0": 0.0},
    bounds={"rate": (-2e5, 2e5)},
    linear=("gain", "offset"),
)
U = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
SIGMA = 1e-3


@pytest.fixture(scope="module")
def record():
    return hs.Record(u=U, y=LAW.response(U) + SIGMA * np.random.default_rng(3).normal(size=U.size))


@pytest.mark.parametrize("is_short", [True, False])
def test_a_wide_box_has_the_standard_errors_of_the_exact_derivatives(record, is_short, monkeypatch):
    """A millionth of this box is 0.4: over it exp(-rate z) is no straight line. Long records take shorter steps."""
    if not is_short:
        monkeypatch.setattr(_uncertainty, "_FEW", 0)
    fit = hs.identify(LAW, record, fixed={"z0": 0.0})
    names = ("rate", "gain", "offset")
    jacobian = fit.model.response_jacobian(record.u, names)
    variance = np.sum(fit.residual**2) / (U.size - len(names))
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian.information()) * variance))
    stderr = [fit.stderr[name] for name in names]
    np.testing.assert_allclose(stderr, expected, rtol=1e-6 if is_short else 1e-3)
    monkeypatch.setattr(_uncertainty, "_bends", lambda *_: False)
    before = hs.identify(LAW, record, fixed={"z0": 0.0}).stderr["rate"]
    assert abs(before / expected[0] - 1.0) > 0.01  # what the step of the box alone gives


def test_two_records_with_states_of_their_own(monkeypatch):
    """The derivatives of both, in the places of their own states, are those by differences."""
    rng, laws = np.random.default_rng(1), [hs.Dahl(stiffness=2.0, coulomb=0.5, z0=z0) for z0 in (0.1, -0.2)]
    records = [hs.Record(u=U[:40], y=law.response(U[:40]) + 1e-3 * rng.normal(size=40)) for law in laws]
    by_differences = hs.identify(hs.Dahl, records, initial="free")
    monkeypatch.setattr(_uncertainty, "_bends", lambda *_: True)
    exact = hs.identify(hs.Dahl, records, initial="free")
    assert exact.stderr.keys() == by_differences.stderr.keys()
    for name, value in by_differences.stderr.items():
        assert exact.stderr[name] == pytest.approx(value, rel=1e-6), name
        assert exact.stderr[name] != value  # the other way was taken
