"""The state at the first sample, and the signs of weights, are chosen by the record where the user says nothing."""

import numpy as np
import pytest

import hysim as hs
from hysim._columns.input_noise import repeated_cycle

TRIANGLE = hs.signals.triangle(-1.0, 1.0, cycles=5, samples_per_cycle=40)
LAW = hs.PrandtlIshlinskii(
    thresholds=tuple(np.linspace(0.0, 0.9, 10).tolist()), weights=tuple((0.6 ** np.arange(10)).tolist())
)
NOISE = 2e-3


def measured(u, y, seed=0):
    return hs.Record(u=u, y=y + NOISE * np.random.default_rng(seed).standard_normal(u.size))


def error(model_or_class, record, **options):
    return hs.identify(model_or_class, record, **options).rmse


# ---------------------------------------------------------------------------------- the repeated cycle


@pytest.mark.parametrize(
    ("begin", "end"), [(0, 200), (0, 101), (7, 108), (7, 56), (7, 47), (0, 40), (0, 41), (33, 90)],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("noise", [0.0, 1e-3, 5e-3])
def test_a_cycle_is_found_whole_or_cut_short(begin, end, noise):
    u = TRIANGLE[begin:end] + noise * np.random.default_rng(1).standard_normal(end - begin)
    found = repeated_cycle(u)
    if noise == 0.0 or end - begin > 41:
        assert found is not None
        assert abs(found - 40) <= 1 + (noise > 0.0)


@pytest.mark.parametrize(
    "u",
    [
        TRIANGLE[7:40],
        np.linspace(0.0, 1.0, 20),
        np.interp(np.arange(0.0, 6.01, 0.1), np.arange(7), [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -2.5]),
        np.zeros(9),
    ],
    ids=["less than a cycle", "one branch", "growing", "constant"],
)
def test_what_does_not_repeat_itself_has_no_cycle(u):
    assert repeated_cycle(u) is None


def test_minor_loops_belong_to_the_cycle():
    corners = np.array([0.0, 1.0, 0.5, 0.8, -1.0] * 3 + [0.0])
    u = np.interp(np.arange(0.0, 15.01, 0.05), np.arange(16), corners)
    assert repeated_cycle(u) == 100
    assert repeated_cycle(u[30:160]) == 100


# ---------------------------------------------------------------------------------- state


@pytest.mark.parametrize("cycles", [1.2, 2.0, 2.5, 3.3])
@pytest.mark.parametrize("offset", [0.0, 3.0])
def test_a_record_that_begins_in_mid_cycle_is_as_good_as_its_noise(cycles, offset):
    u = offset + TRIANGLE
    part = slice(53, 53 + round(40 * cycles))
    record = measured(u[part], LAW.response(u)[part])
    structure = hs.PrandtlIshlinskii.structure(thresholds=LAW.thresholds)
    fit = hs.identify(structure, record)
    assert fit.rmse < 1.05 * NOISE
    assert "a cycle of 40 samples, which the input repeats" in fit.message or offset == 0.0
    assert fit.rmse <= min(error(structure, record, initial=state) for state in ("rest", "still", "periodic"))


def test_plays_may_have_rested_at_the_first_input():
    u = 3.0 + np.append(np.linspace(0.0, 1.0, 11), TRIANGLE[21:100])
    law = hs.PrandtlIshlinskii(thresholds=LAW.thresholds, weights=LAW.weights, z0=(3.0,))
    fit = hs.identify(hs.PrandtlIshlinskii.structure(thresholds=LAW.thresholds), measured(u, law.response(u)))
    assert fit.rmse < 1.05 * NOISE
    assert "stood still at its first value" in fit.message


def test_a_lag_in_mid_cycle_is_as_good_as_its_noise():
    u = 1.0 + TRIANGLE
    t = 0.05 * np.arange(u.size)
    y = hs.TransferFunction(num=(2.0,), den=(1.0, 1.0)).response(u, 0.05)
    part = slice(90, 200)
    record = hs.Record(t=t[part], u=u[part], y=measured(u, y).y[part])
    structure = hs.TransferFunction.structure(poles=1, zeros=0)
    fit = hs.identify(structure, record)
    assert fit.rmse < 1.05 * NOISE
    assert "a state at the first sample that is identified (else the BIC is" in fit.message
    assert error(structure, record, initial="rest") > 5.0 * NOISE


def test_the_users_word_wins():
    record = measured(3.0 + TRIANGLE[53:173], LAW.response(3.0 + TRIANGLE)[53:173])
    fit = hs.identify(hs.PrandtlIshlinskii.structure(plays=5, one_signed=True), record, initial="rest")
    assert "assumed" not in fit.message
    assert fit.estimates["turn"] == 0.0
    held = hs.identify(hs.PrandtlIshlinskii.structure(plays=5, one_signed=True), record, fixed={"turn": 1.5})
    assert held.estimates["turn"] == 1.5


@pytest.mark.parametrize("cycles", [1.5, 2.5])
def test_a_periodic_record_need_not_hold_whole_periods(cycles):
    law = hs.BoucWen(beta=1.5, gamma=0.5, n=1.0, gain=2.0)
    u = 0.3 + TRIANGLE
    part = slice(53, 53 + round(40 * cycles))
    fit = hs.identify(hs.BoucWen, hs.Record(u=u[part], y=law.response(u)[part]), initial="periodic", fixed={"n": 1.0})
    assert fit.estimates["beta"] == pytest.approx(1.5, abs=1e-4)  # the law nears its cycle for one cycle before
    assert fit.estimates["z0"] == pytest.approx(law.memory(u)[53], abs=1e-4) or "z0" not in fit.free_names


def test_a_steady_memory_costs_few_passes(monkeypatch):
    law, calls = hs.BoucWen(beta=1.5, gamma=0.5, n=1.3), []
    original = type(law)._passes

    def counted(self, parameters, u):
        passes = original(self, parameters, u)
        return lambda sets: calls.append(u.size) or passes(sets)

    monkeypatch.setattr(type(law), "_passes", counted)
    record = hs.Record(u=TRIANGLE[50:90], y=np.zeros(40))
    law.steady({"beta": np.linspace(0.5, 2.0, 100)}, record)
    assert calls.count(41) <= 3
    assert sum(calls) <= 5 * 41


# ---------------------------------------------------------------------------------- signs


def butterfly():
    """Strain of a ferroelectric, about the square of a polarisation that lags: a loop that crosses itself."""
    u = TRIANGLE[10:]
    polarisation = hs.PrandtlIshlinskii(thresholds=(0.3, 0.5, 0.7), weights=(1.0, 1.0, 1.0)).response(TRIANGLE)[10:]
    return measured(u, polarisation**2)


def inductor():
    """Flux of a core that saturates."""
    u = 4.0 * TRIANGLE
    return measured(u, np.tanh(hs.Play(threshold=0.6).response(u)))


def test_a_loop_that_crosses_itself_gets_both_signs():
    record = butterfly()
    fit = hs.identify(hs.Preisach.structure(intervals=10), record)
    assert "weights of both signs (else the BIC is" in fit.message
    assert fit.rmse < 0.2 * error(hs.Preisach.structure(one_signed=True, intervals=10), record)


@pytest.mark.parametrize("offset", [0.0, 1e10])
def test_a_loop_that_saturates_gets_both_signs(offset):
    record = hs.Record(u=inductor().u, y=inductor().y + offset)
    fit = hs.identify(hs.PrandtlIshlinskii, record)
    assert "weights of both signs (else the BIC is" in fit.message
    assert fit.rmse < 0.5 * error(hs.PrandtlIshlinskii.structure(one_signed=True), record)
    assert fit.message.count("search bound") <= 1


def test_weights_of_one_sign_stay_where_they_are_the_truth():
    fit = hs.identify(hs.PrandtlIshlinskii, measured(TRIANGLE, LAW.response(TRIANGLE)))
    assert "weights of one sign" in fit.message
    assert fit.model.is_one_signed()


@pytest.mark.parametrize("record", [inductor()], ids=["inductor"])
@pytest.mark.parametrize(
    "family",
    [
        hs.PrandtlIshlinskii,
        hs.MaxwellSlip,
        hs.ModifiedPrandtlIshlinskii,
        hs.GeneralizedPrandtlIshlinskii,
        hs.Preisach,
        hs.PreisachRelays,
    ],
)
def test_a_family_that_contains_another_never_fits_worse(family, record):
    wide, narrow = (error(family.structure(one_signed=sign), record, initial="rest") for sign in (False, True))
    assert wide <= narrow * (1.0 + 1e-6)


@pytest.mark.parametrize("u0", [0.0, 0.4])
def test_a_sum_leaves_to_the_record_what_its_plays_leave(u0):
    u = np.append(u0, np.tile(hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=80)[1:], 2))
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.7, -0.4), z0=(u0, u0, u0))
    record = hs.Record(u=u, y=law.response(u) + 0.3 * u)
    plays = hs.PrandtlIshlinskii.structure(thresholds=law.thresholds)
    found = hs.identify(hs.Sum.structure(plays, hs.Line), record)
    assert found.fit_percent > 99.999
    assert "weights of both signs" in found.message
    assert ("stood still" in found.message) == (u0 != 0.0)


def test_a_cascade_leaves_to_the_record_what_its_carrier_leaves():
    t = np.linspace(0.0, 1.0, 200)
    u = np.cos(2.0 * np.pi * 4.0 * t) * np.linspace(1.0, 0.6, t.size)
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.7, -0.4), z0=(0.0, 0.0, 0.0))
    plant = hs.TransferFunction(num=(400.0,), den=(1.0, 28.0, 400.0))
    record = hs.Record(u=u, y=(law >> plant).response(u, t[1]), t=t)
    plays = hs.PrandtlIshlinskii.structure(thresholds=law.thresholds)
    found = hs.identify(hs.Cascade.structure(plays, hs.TransferFunction.structure(poles=2, zeros=0)), record)
    assert found.fit_percent > 99.99
    assert "prandtl_ishlinskii with weights of both signs" in found.message
