"""A simulated experiment shows what is in it, no more and no less."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import refused

import hysim as hs
from hysim.rig._camera import MARGIN, Scene

SMALL = hs.rig.Camera(shape=(24, 40))
QUIET = replace(SMALL, shot_noise=False, read_noise=0.0)
BINARY = replace(QUIET, scale=2.0**-4)  # whole pixels are added without rounding
SCENE = Scene.textured_edge((6, 9), direction=(0.6, 0.8), blur=1.2, grain=2.0, contrast=0.1, seed=3)


def electrons(camera, n, y=0.0):
    """Frames in electrons, shape (n, rows, columns)."""
    return np.array([camera.frame(y, number=k) for k in range(n)]) * (camera.full_well / (2**camera.bits - 1))


@given(st.integers(0, 30), st.floats(-3.0, 3.0))
def test_a_motion_by_whole_pixels_moves_the_same_bits(pixels, y):
    y = round(64.0 * y) / 64.0
    for shown in (BINARY.light, BINARY.frame):
        here, there = shown(y), shown(y + pixels * BINARY.scale)
        assert (there[:, pixels:] == here[:, : 40 - pixels]).all()


def test_down_is_ninety_degrees():
    camera = replace(QUIET, direction=90.0, scale=0.5)
    assert (camera.light(3.5)[7:] == camera.light(0.0)[:-7]).all()


@given(st.floats(-40.0, 40.0), st.floats(-40.0, 40.0))
def test_a_motion_by_parts_of_a_pixel_is_that_of_every_wave_of_the_picture(down, right):
    waves = np.fft.fft2(np.fft.irfft2(SCENE.coefficients, s=SCENE.period)) / math.prod(SCENE.period)
    seen = SCENE.shifted(np.array([[down, right]]))
    f, g = (np.fft.fftfreq(n) for n in SCENE.period)
    for row, column in ((0, 0), (2, 7), (5, 8)):
        x = row + MARGIN // 2 - down, column + MARGIN // 2 - right
        slow = (waves * np.exp(2j * np.pi * (f[:, np.newaxis] * x[0] + g * x[1]))).sum()
        assert abs(slow - seen[row, column]) < 1e-12  # rounding of 20 000 terms of a sum below one


def test_a_moving_actuator_blurs_into_the_mean_of_its_pictures():
    moving = np.linspace(0.0, 0.4, 7)
    slow = np.mean([QUIET.light(y) for y in moving], axis=0)
    assert np.abs(QUIET.light(moving) - slow).max() < 1e-14  # rounding
    assert np.abs(slow - QUIET.light(moving.mean())).max() > 0.01  # and it does blur
    t = np.linspace(0.0, 1.0, 101)
    camera = replace(QUIET, frame_rate=2.0, exposure=0.2, subsamples=4)
    frames = camera.frames(t, t)
    exposed = [camera.light(0.5 + 0.2 * part) for part in (0.125, 0.375, 0.625, 0.875)]
    counts = np.floor(255.0 * np.mean(exposed, axis=0) + 0.5)
    assert (np.abs(frames[1] - counts) <= 1.0).all()  # at a half, rounding decides
    assert abs(frames.exposed_y[1] - 0.6) < 1e-12


def test_shot_noise_has_the_variance_of_its_mean():
    camera = replace(SMALL, read_noise=0.0, full_well=1000.0, bits=12)
    seen, light = electrons(camera, 400), camera.full_well * camera.light(0.0)
    assert np.abs(seen.mean(axis=0) / light - 1.0).max() < 5.0 / math.sqrt(400 * light.min())  # five standard errors
    ratio = seen.var(axis=0, ddof=1) / light
    assert abs(ratio.mean() - 1.0) < 5.0 * math.sqrt(2.0 / (400 * light.size))  # likewise; a count's share is 1e-5


def test_read_noise_is_as_asked():
    camera = replace(QUIET, read_noise=30.0, bits=12)
    noise = electrons(camera, 50) - camera.full_well * camera.light(0.0)
    assert abs(noise.std() / 30.0 - 1.0) < 0.02  # 48 000 samples: five standard errors are 1.6 %


@pytest.mark.parametrize(("bits", "dtype", "largest"), [(8, np.uint8, 255), (12, np.uint16, 4095)])
def test_counts_are_the_nearest_and_stay_within_their_bits(bits, dtype, largest):
    camera = replace(QUIET, bits=bits)
    frame = camera.frame(0.3)
    assert frame.dtype == dtype
    assert np.abs(frame / largest - camera.light(0.3)).max() <= 0.5 / largest + 1e-12
    bright = replace(camera, gain_drift=5.0, drift_period=4.0).frame(0.3, t=1.0)
    dark = replace(camera, offset_drift=0.3, drift_period=4.0).frame(0.3, t=3.0)
    assert (int(bright.max()), int(dark.min())) == (largest, 0)


def test_the_illumination_drifts_as_its_sine():
    camera = replace(SMALL, gain_drift=0.1, offset_drift=0.05, drift_period=8.0)
    still = camera.light(0.2, 0.0)
    for t, swing in ((2.0, 1.0), (4.0, 0.0), (6.0, -1.0)):
        drifted = camera.light(0.2, t)
        assert np.abs(drifted - ((1.0 + 0.1 * swing) * still + 0.05 * swing)).max() < 1e-15


def test_the_microscope_shakes_every_frame_anew():
    still, shaken = (replace(QUIET, bits=12, jitter=jitter) for jitter in (0.0, 0.3))
    one, two = (shaken.frame(0.0, number=k) for k in (1, 2))
    assert (one != two).any()
    assert (one != still.frame(0.0, number=1)).any()
    assert (one == shaken.frame(0.0, number=1)).all()


def test_a_frame_depends_on_its_seed_and_number_alone():
    t, y = [0.0, 10.0], [0.0, 2.0]
    frames = SMALL.frames(t, y)
    backwards = {k: frames[k] for k in (9, 4, 0)}
    forwards = list(itertools.islice(frames, 10))
    assert all((forwards[k] == frame).all() for k, frame in backwards.items())
    assert (replace(SMALL).frames(t, y)[4] == forwards[4]).all()
    assert (forwards[4] != replace(SMALL, seed=1).frames(t, y)[4]).any()
    assert np.abs(replace(SMALL, texture=1).light(0.0) - SMALL.light(0.0)).max() > 0.1
    assert (frames[-1] == frames[len(frames) - 1]).all()
    with pytest.raises(IndexError):
        frames[len(frames)]


def test_a_million_frames_take_no_memory():
    frames = SMALL.frames([0.0, 1e6], [0.0, 2.0], at=np.arange(1_000_000.0))
    assert len(frames) == 1_000_000
    assert frames[999_999].shape == (24, 40)


def test_signal_to_noise_is_that_of_the_frames():
    camera = replace(SMALL, bits=12)
    light = camera.full_well * camera.light(0.0)
    noise = electrons(camera, 50) - light
    assert abs(camera.signal_to_noise - 20.0 * math.log10(light.std() / noise.std())) < 0.1  # 1 % of sampling error


def test_the_staircase_is_that_of_table_1():
    experiment = hs.rig.table1().run(hs.rig.staircase_drive(dwell=0.1))
    assert (experiment.voltages == hs.datasets.table1().u).all()
    assert (experiment.record("truth").u == hs.datasets.table1().u).all()
    ends = experiment.at + experiment.rig.camera.exposure
    assert (ends < 0.1 * np.arange(1, 53)).all()
    assert (ends > 0.1 * np.arange(1, 53) - 0.04).all()  # a frame's time and a sample


def test_the_rig_of_table_1_is_its_law():
    table = hs.datasets.table1()
    residual = table.y - hs.rig.LAW.response(table.u)
    assert hs.rig.LAW.response(table.u)[0] == 0.0
    residual -= residual.mean()
    assert abs(100.0 * (1.0 - np.linalg.norm(residual) / np.linalg.norm(table.y - table.y.mean())) - 96.31) < 0.01
    record = hs.rig.table1().run(hs.rig.staircase_drive(dwell=0.5, frames_per_step=2)).record("truth")
    assert len(record) == 52
    assert np.abs(record.y - hs.rig.LAW.response(table.u)).max() < 1e-4  # exp(-0.4 s x 31 / s) of a step's ringing


def test_several_frames_of_a_level_are_one_row():
    rig = hs.rig.Rig(camera=replace(SMALL, frame_rate=10.0))  # no law: the displacement is the voltage
    drive = hs.rig.Drive(u=[0.0] * 10 + [1.0] * 10, sample_time=0.1, dwell=1.0, frames_per_step=3)
    experiment = rig.run(drive)
    assert experiment.voltages.tolist() == [0.0] * 3 + [1.0] * 3
    record = experiment.record("truth", take="last")
    assert record.y.round(12).tolist() == [0.0, 1.0]
    assert record.t.tolist() == experiment.at[[2, 5]].tolist()


def test_square_waves_are_the_papers():
    slow = hs.rig.square_drive(18.0, 50.0, frequency=hs.rig.SQUARE_WAVES["slow"], cycles=2, sample_time=0.01)
    assert np.flatnonzero(np.diff(slow.u)).tolist() == [499, 999, 1499]  # 5 s on, 5 s off
    assert set(slow.u.tolist()) == {18.0, 50.0}
    fast = hs.rig.square_drive(sample_time=1e-4)
    edges = np.flatnonzero(np.diff(fast.u)) + 1
    assert np.abs(edges * 1e-4 * 2.0 * 1.01626 - np.arange(1.0, 10.0)).max() < 2.1e-4  # the nearest sample
    assert fast.u[[0, -1]].tolist() == [1.8, 5.0]


def test_the_op_amp_has_the_papers_gain_and_the_limits_of_its_supplies():
    amplifier = hs.rig.UA741
    assert amplifier.gain == 10.0
    assert amplifier.voltage([1.8, 4.0, 5.0]).tolist() == [18.0, 40.0, 44.0]
    assert round(amplifier.full_power_bandwidth(5.0)) == 15915


test_a_camera_that_cannot_be_is_refused = refused(
    ({"shape": (0, 3)}, "shape must be"),
    ({"scale": 0.0}, "scale must be positive, got 0"),
    ({"bits": 10}, "bits must be one of 8, 12, got 10"),
    ({"exposure": 0.1}, "exposure must be at most a frame's time"),
    ({"read_noise": -1.0}, "read_noise must not be negative"),
    ({"subsamples": 0}, "subsamples must be at least 1"),
    ({"seed": -1}, "seed must be at least 0"),
    ({"blur": math.nan}, "blur must be finite"),
    call=lambda wrong: hs.rig.Camera(**wrong),
)


def experiment():
    return hs.rig.Rig().run(hs.rig.staircase_drive(0.0, 1.0, 1.0, sample_time=0.1))


FAR = replace(hs.rig.table1(), camera=hs.rig.Camera(shape=(64, 64), scale=0.01)).run(hs.rig.staircase_drive(dwell=0.1))
HURRIED = hs.rig.staircase_drive(dwell=0.1, frames_per_step=5)
test_what_does_not_fit_together_is_refused = refused(
    (lambda: SMALL.frames([0.0, 1.0], [0.0]), "as long as y, got 2 times and 1 displacements"),
    (lambda: SMALL.frames([0.0, 1.0], [0.0, 0.0], at=[2.0]), "exposures must be within 0 to 1 s, got 2 to"),
    (lambda: FAR.frames(), "may span 1.28 um, 128 pixels, before the scene repeats, got 2.721 um: take a larger scale"),
    (lambda: hs.rig.Rig().run([0.0, 1.0]), TypeError, "drive must be a Drive, such as staircase_drive"),
    (lambda: hs.rig.Drive(u=[0.0, 1.0], sample_time=0.3, dwell=1.0), "whole number of samples"),
    (lambda: hs.rig.Drive(u=[0.0, 1.0, 2.0], sample_time=0.5, dwell=1.0), "whole number of levels"),
    (lambda: hs.rig.Rig().run(HURRIED), "take a longer dwell or fewer frames"),
    (lambda: hs.rig.square_drive(frequency=0.0), "frequency must be"),
    (lambda: hs.rig.Rig(camera="none"), TypeError, "camera must be of Camera, got str"),
    (lambda: experiment().record("exact"), "method must be one of truth"),
    (lambda: experiment().record("truth", take="first"), "take must be one of mean, last"),
)


def test_a_motion_beyond_the_scene_has_its_truth():
    assert FAR.record("truth").y.max() == pytest.approx(2.7209, abs=1e-4)
    assert abs(SMALL.light(180.0 * SMALL.scale) - SMALL.light(0.0)).max() < 1e-12  # it repeats: rounding
    assert len(SMALL.frames([0.0, 1.0], [-5.0, 5.68])) == 30  # 140 pixels, as far as no column is seen twice


@pytest.mark.extra("skimage")
def test_frames_give_the_displacement_back():
    rig = hs.rig.table1(texture=11)
    experiment = rig.run(hs.rig.staircase_drive(step=25.0, dwell=0.5))
    scale, truth = rig.camera.scale, experiment.record("truth").y
    fine, coarse = experiment.record("subpixel"), experiment.record("whole-pixel")
    assert np.sqrt(np.mean((fine.y - truth) ** 2)) < 0.02 * scale  # at 30 dB
    pixels = coarse.y / scale
    assert np.abs(pixels - np.round(pixels)).max() < 1e-9
    assert np.abs(coarse.y - truth).max() < 0.55 * scale  # half a pixel, and noise
    assert (coarse.resolution, fine.resolution) == (scale, None)
