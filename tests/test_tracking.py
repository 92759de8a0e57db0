"""Parameters that drift: filters along a record, and an inverse that adapts."""

import numpy as np
import pytest
from strategies import refused

import hysim as hs

LAW = hs.BoucWen(beta=0.8, gamma=-0.2, feedthrough=0.3)
U = hs.signals.triangle(-1.5, 1.5, cycles=12, samples_per_cycle=40)
FADING = np.linspace(1.0, 0.8, U.size)
NOISE = 0.005


def moved(law, numbers, inputs):
    """Outputs of a law whose numbers are others at each sample."""
    state, y = law.state_at(float(inputs[0])), []
    for k, u in enumerate(inputs.tolist()):
        own = law.with_scalars({name: float(values[k]) for name, values in numbers.items()})
        output, state = own.advance([u], state)
        y.append(float(output[0]))
    return np.array(y)


@pytest.fixture(scope="module")
def record():
    y = moved(LAW, {"gain": FADING}, U)
    return hs.Record(u=U, y=y + NOISE * np.random.default_rng(5).standard_normal(U.size))


@pytest.mark.parametrize("method", ["sigma-point", "particle"])
def test_a_gain_that_fades_is_followed(record, method):
    track = hs.track_parameters(
        LAW, record, ["gain"], drift={"gain": 0.2}, jump={"gain": 0.0}, noise=NOISE, method=method
    )
    lower, upper = track.band("gain")
    assert np.abs(track["gain"][40:] - FADING[40:]).max() < 0.04
    assert np.mean((lower <= FADING) & (upper >= FADING)) > 0.9
    assert track.model.gain == pytest.approx(0.8, abs=0.03)
    assert track.residual == pytest.approx(record.y - track.predicted)


@pytest.mark.parametrize("law", [hs.Bilinear(stiffness=1.2), hs.MenegottoPinto(stiffness=1.2),
                                 hs.Duhem(p=[[1.2, -0.5]], q=[[-0.3]])])  # fmt: skip
def test_a_law_of_several_memories_or_of_coefficients_is_followed(law):
    u, first = hs.signals.triangle(-3.0, 3.0, cycles=4, samples_per_cycle=40), next(iter(law.scalars))
    y = law.response(u) + 0.01 * np.random.default_rng(0).standard_normal(u.size)
    track = hs.track_parameters(law, hs.Record(u=u, y=y), [first], drift={first: 0.05}, noise=0.01)
    assert track[first][-1] == pytest.approx(1.2, rel=0.05)


def test_errors_and_band_of_a_walk_are_those_that_the_filter_expects():
    rng = np.random.default_rng(8)
    gain = 1.0 + 0.2 / np.sqrt(U.size) * np.cumsum(rng.standard_normal(U.size))
    walked = hs.Record(u=U, y=moved(LAW, {"gain": gain}, U) + NOISE * rng.standard_normal(U.size))
    track = hs.track_parameters(LAW, walked, ["gain"], drift={"gain": 0.2}, jump={"gain": 0.0}, noise=NOISE)
    lower, upper = track.band("gain")
    assert track.consistency == pytest.approx(1.0, abs=0.2)  # three standard deviations of the mean of 481 squares
    assert 0.88 < np.mean((lower <= gain) & (gain <= upper)) < 0.99  # neighbouring errors are alike: about 60 count


def test_the_step_is_exact_where_nothing_drifts():
    """A walk of next to nothing leaves the memory of the law itself, whatever the measurement says."""
    y = LAW.response(U)
    track = hs.track_parameters(LAW, hs.Record(u=U, y=y + 0.1), ["gain"], drift={"gain": 0.0}, noise=1.0)
    np.testing.assert_allclose(track.predicted, y, atol=1e-6)  # 1e-13 of a variance is kept: its root is 3e-7
    assert track.jumps == ()


def test_a_jump_is_seen_and_caught_up_with(record):
    n = np.where(np.arange(U.size) < 240, 1.5, 2.2)
    law = hs.BoucWen(beta=0.8, gamma=-0.2, n=1.5, feedthrough=0.3)
    y = moved(law, {"n": n}, U) + NOISE * np.random.default_rng(6).standard_normal(U.size)
    track = hs.track_parameters(law, hs.Record(u=U, y=y), ["n"], drift={"n": 0.05}, jump={"n": 0.5}, noise=NOISE)
    assert len(track.jumps) == 1
    assert 240 <= track.jumps[0] < 270
    assert abs(track["n"][239] - 1.5) < 0.05
    assert abs(track["n"][-1] - 2.2) < 0.15
    blind = hs.track_parameters(law, hs.Record(u=U, y=y), ["n"], drift={"n": 0.05}, jump={"n": 0.0}, noise=NOISE)
    assert blind.jumps == ()
    assert abs(blind["n"][320] - 2.2) > 2.0 * abs(track["n"][320] - 2.2)


def test_a_number_that_must_be_positive_stays_so(record):
    law = hs.Dahl(stiffness=2.0, coulomb=0.5)
    y = law.response(U) + 0.2 * np.random.default_rng(1).standard_normal(U.size)
    track = hs.track_parameters(law, hs.Record(u=U, y=y), ["coulomb"], drift={"coulomb": 2.0}, noise=0.2)
    assert (track.lower > 0.0).all()


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_an_offset_near_zero_is_followed_in_any_unit(unit):
    u, law = U[:161], hs.BoucWen(beta=0.8, gain=unit, offset=1e-4 * unit)
    offset = law.offset + unit * np.linspace(0.0, 0.2, u.size)
    y = law.response(u) - law.offset + offset + NOISE * unit * np.random.default_rng(2).standard_normal(u.size)
    track = hs.track_parameters(law, hs.Record(u=u, y=y), ["offset"], noise=NOISE * unit)
    assert np.mean((track.lower[:, 0] <= offset) & (offset <= track.upper[:, 0])) > 0.9


def scalar_filter(y, known, slopes, first, step, noise):
    """Means, variances and the log-likelihood of a walk x with y = known + slopes x, by Kalman's equations."""
    x, variance, total, means = 1.0, first**2, 0.0, []
    for measured, rest, slope in zip(y, known, slopes, strict=True):
        variance += step**2
        error, spread = measured - rest - slope * x, slope**2 * variance + noise**2
        total -= 0.5 * (error**2 / spread + np.log(2.0 * np.pi * spread))
        x += variance * slope / spread * error
        variance *= noise**2 / spread
        means.append(x)
    return np.array(means), total


def test_of_a_gain_the_filter_is_that_of_kalman_with_its_likelihood(record):
    """The output is linear in the gain, whose law has the same memory whatever the gain."""
    drift = 0.1
    track = hs.track_parameters(LAW, record, ["gain"], drift={"gain": drift}, jump={"gain": 0.0}, noise=NOISE)
    step = drift / np.sqrt(U.size)
    means, total = scalar_filter(record.y, 0.3 * U, LAW.memory(U), drift, step, NOISE)
    np.testing.assert_allclose(track["gain"], means, atol=1e-6)  # 1e-13 of a variance is kept
    assert track.log_likelihood == pytest.approx(total, abs=1e-3)
    assert track.searched == ()


def test_the_most_likely_drift_is_found_and_reported(record):
    short, fading, u = record[:241], FADING[:241], U[:241]
    options = {"jump": {"gain": 0.0}, "noise": NOISE}
    track = hs.track_parameters(LAW, short, ["gain"], **options)
    assert track.searched == ("gain",)
    assert "(most likely)" in str(track)
    for factor in (0.3, 3.0):
        step = factor * track.drift["gain"] / np.sqrt(u.size)
        _, total = scalar_filter(short.y, 0.3 * u, LAW.memory(u), 0.1, step, NOISE)
        assert total < track.log_likelihood
    lower, upper = track.band("gain")
    assert np.mean((lower <= fading) & (upper >= fading)) > 0.9
    wide = hs.track_parameters(LAW, short, ["gain"], drift={"gain": 0.2}, **options)
    assert wide.drift == {"gain": 0.2}
    assert np.mean(upper - lower) < 0.8 * np.mean(np.subtract(*wide.band("gain")[::-1]))


def test_of_two_drifts_one_may_be_given(record):
    names, options = ["gain", "beta", "gain"], {"drift": {"beta": 0.05}, "jump": {"gain": 0.0}, "noise": NOISE}
    track = hs.track_parameters(LAW, record[:61], names, **options)
    assert (track.names, track.searched) == (("gain", "beta"), ("gain",))
    assert track.drift["beta"] == 0.05


def test_the_likelihood_of_particles_is_near_that_of_sigma_points(record):
    options = {"drift": {"gain": 0.2}, "jump": {"gain": 0.0}, "noise": NOISE}
    exact, drawn = (hs.track_parameters(LAW, record, ["gain"], method=method, **options).log_likelihood
                    for method in ("sigma-point", "particle"))  # fmt: skip
    assert drawn == pytest.approx(exact, abs=5.0)  # 500 particles: about one off in a few seeds


def test_noise_is_estimated_from_the_record(record):
    track = hs.track_parameters(LAW, record, ["gain"], drift={"gain": 0.1})
    assert track.noise == pytest.approx(NOISE, rel=0.2)


PLAYS = hs.PrandtlIshlinskii(thresholds=tuple(0.1 * k for k in range(50)), weights=(0.02,) * 50)
test_arguments_are_checked = refused(
    (LAW, "slope", {}, "free has 'slope': a BoucWen has A, beta"),
    (LAW, "z0", {}, "z0 is the memory at the first sample"),
    (LAW, "gain", {"drift": {"n": 1.0}}, "drift has 'n', which is not free"),
    (LAW, "gain", {"drift": 0.1}, TypeError, "drift must be a mapping, got float"),
    (LAW, "gain", {"particles_count": 0}, "particles_count must be an integer of at least 1, got 0"),
    (LAW, "gain", {"method": "kalman"}, "method must be one of sigma-point, particle, got 'kalman'"),
    (PLAYS, "offset", {}, 'remembers 51 numbers: use method="particle"'),
    (PLAYS, "thresholds[0]", {}, r"thresholds\[0\] is 0 and cannot be negative: leave it out of free"),
    (LAW, "gain", {"drift": {"gain": np.inf}}, "drift must be finite and not negative"),
    (hs.PID(kp=1.0), "kp", {}, TypeError, "law must be a law that a step describes"),
    (LAW, "gain", {"drift": {"gain": 0.1}, "noise": NOISE}, KeyError, "'n' is not tracked: gain"),
    call=lambda law, name, options: hs.track_parameters(law, hs.Record(u=U, y=U), [name], **options)["n"],
)


# ---------------------------------------------------------------------------------- an inverse that adapts

LOOP_LAW = hs.BoucWen(beta=0.5, gamma=0.1, feedthrough=1.5, gain=-0.7)
T = 0.01 * np.arange(U.size)


def follow(controller, numbers, reference, noise=0.0):
    """The output of the drifting plant under a controller that sees the last one."""
    state, memory, rng, seen, y = controller.initial(0.01), LOOP_LAW.state_at(0.0), np.random.default_rng(2), 0.0, []
    for k, r in enumerate(reference.tolist()):
        u, state = controller.step(state, r, seen)
        own = LOOP_LAW.with_scalars({name: float(values[k]) for name, values in numbers.items()})
        output, memory = own.advance([u], memory)
        y.append(float(output[0]))
        seen = y[-1] + noise * rng.standard_normal()
    return np.array(y), state


def test_an_adaptive_inverse_of_the_true_law_is_the_fixed_one():
    adaptive = hs.AdaptiveInverse(law=LOOP_LAW, free=("gain", "beta"), drift=(0.1, 0.1), noise=0.01)
    fixed = hs.InverseFeedforward(law=LOOP_LAW)
    runs = [hs.close_loop(LOOP_LAW, each, T, U) for each in (adaptive, fixed)]
    np.testing.assert_allclose(runs[0].u, runs[1].u, atol=1e-9)


def test_an_adaptive_inverse_follows_gain_and_shape():
    """Both drift by a fifth; the memory of its law must follow the shape."""
    numbers = {"gain": -0.7 * FADING, "beta": 0.5 * (2.0 - FADING)}
    adaptive = hs.AdaptiveInverse(law=LOOP_LAW, free=("gain", "beta"), drift=(0.05, 0.05), noise=1e-3)
    y, state = follow(adaptive, numbers, U, noise=1e-3)
    fixed, _ = follow(hs.InverseFeedforward(law=LOOP_LAW), numbers, U, noise=1e-3)
    last = slice(-80, None)
    errors = [np.sqrt(np.mean((each[last] - U[last]) ** 2)) for each in (y, fixed)]
    assert errors[0] < 0.05 * errors[1]
    np.testing.assert_allclose(state.state[1:3], [0.14, 0.1], atol=0.03)  # where both have gone


test_numbers_that_the_step_does_not_take_as_they_are_are_refused = refused(
    ({"law": hs.Dahl(), "free": ("coulomb",)}, "does not take coulomb as it is"),
    ({"drift": (0.1, 0.1)}, "free and drift must name as many numbers, got 1 and 2"),
    ({"free": ("z0",)}, "does not drift"),
    ({"noise": 0.0}, "noise must be positive, got 0.0"),
    ({"law": hs.PID(kp=1.0), "free": ("kp",)}, TypeError, "law must be a law that a step describes"),
    call=lambda options: hs.AdaptiveInverse(
        **{"law": LOOP_LAW, "free": ("gain",), "drift": (0.1,), "noise": 0.1} | options
    ),
)
