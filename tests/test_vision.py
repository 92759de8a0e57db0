"""Displacements from frames: unbiased, as sure as they say, and never made up."""

import gc
import weakref

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.cli import main

iio = pytest.importorskip("imageio.v3")
pytestmark = pytest.mark.extra("skimage")
SIZE = 80


def speckle(rng, length, size=SIZE):
    """A band-limited texture, on a field twice as wide: the picture of it moved to the right and down."""
    down, right = (2.0 * np.pi * frequency(2 * size) for frequency in (np.fft.fftfreq, np.fft.rfftfreq))
    fall = np.exp(-0.5 * length**2 * (down[:, None] ** 2 + right**2))
    spectrum = fall * np.fft.rfft2(rng.standard_normal((2 * size, 2 * size)))
    spectrum /= np.fft.irfft2(spectrum).std()

    def picture(x, y=0.0):
        phase = np.exp(-1j * (down[:, None] * y + right * x))
        return np.fft.irfft2(spectrum * phase)[:size, :size]

    return picture


def edge(rng, angle=0.0, roughness=0.0, width=2.0, size=SIZE):
    """A smooth edge in the middle, its normal `angle` radians from the right, with a texture on one side."""
    rows, columns = np.mgrid[0.0:size, 0.0:size] - size / 2
    texture = speckle(rng, 2.0, size)

    def picture(x, y=0.0):
        along = (columns - x) * np.cos(angle) + (rows - y) * np.sin(angle)
        return (1.0 + np.tanh(along / width)) * (1.0 + roughness * texture(x, y))

    return picture


def seen(picture, shifts, snr, rng):
    """Frames with noise of so many decibels below the picture."""
    frames = np.array([picture(*np.atleast_1d(shift)) for shift in shifts])
    return frames + 10.0 ** (-snr / 20.0) * frames[0].std() * rng.standard_normal(frames.shape)


MAKERS = {
    "fine": lambda rng: speckle(rng, 1.0),
    "coarse": lambda rng: speckle(rng, 3.0),
    "edge": lambda rng: edge(rng, angle=0.2, roughness=0.3),
    "straight edge": edge,
}


@pytest.mark.parametrize(("snr", "most"), [(30, 0.02), (20, 0.05)])
@pytest.mark.parametrize("name", MAKERS)
def test_shifts_over_a_pixel_are_unbiased_and_as_sure_as_they_say(name, snr, most):
    rng = np.random.default_rng(snr)
    shifts = np.linspace(0.0, 1.0, 9)[1:]
    errors, sure = [], []
    for _ in range(5):
        moved = hs.vision.displacement(seen(MAKERS[name](rng), [0.0, *shifts], snr, rng), 1.0, direction="x")
        errors.append(moved.y[1:] - shifts)
        sure.append(moved.uncertainty[1:])
    ratio = np.sqrt(np.mean(np.square(errors) / np.square(sure)))
    assert np.sqrt(np.mean(np.square(errors))) <= most
    assert abs(np.mean(errors)) <= 0.01
    assert 0.5 < ratio < 1.8  # all 8 shifts share the noise of one reference: 5 draws, at two standard errors


def test_content_may_enter_and_leave():
    shifts = np.array([0.0, 3.3, -9.6, 14.2, 31.7, -24.9])  # of 80 pixels
    moved = hs.vision.displacement(
        seen(speckle(np.random.default_rng(1), 2.0), shifts, 40, np.random.default_rng(2)), 1.0
    )
    assert np.abs(moved.y - shifts).max() < 0.01  # three standard errors of the least overlap
    assert set(moved.status) == {"ok"}


def test_whole_pixels_are_whole():
    shifts = np.linspace(0.0, 5.0, 21)
    frames = seen(speckle(np.random.default_rng(3), 2.0), shifts, 40, np.random.default_rng(4))
    moved = hs.vision.displacement(frames, 0.0763, method="whole-pixel")
    assert (moved.y == 0.0763 * np.rint(moved.y / 0.0763)).all()
    assert np.abs(moved.y / 0.0763 - shifts).max() < 0.51
    assert moved.resolution == 0.0763
    assert moved.record(u=shifts).resolution == 0.0763
    assert np.allclose(moved.uncertainty, 0.0763 / np.sqrt(12.0), rtol=1e-3)  # the noise's share is smaller


def test_the_light_may_change_in_gain_offset_and_slope():
    picture, ramp = speckle(np.random.default_rng(5), 2.0), np.linspace(-1.0, 1.0, SIZE)
    frames = [picture(0.0), 0.5 * picture(0.37) + 7.0 + ramp + 0.5 * ramp[:, None]]
    assert hs.vision.displacement(frames, 1.0, direction="x").y[1] == pytest.approx(0.37, abs=1e-3)


@pytest.mark.parametrize("size", [1e30, 1e-30])
def test_frames_may_be_as_large_and_small_as_single_precision(size):
    frames = np.array([speckle(np.random.default_rng(5), 2.0)(d) for d in (0.0, 0.37)])
    assert hs.vision.displacement(size * frames, 1.0, direction="x").y[1] == pytest.approx(0.37, abs=1e-3)


def test_the_direction_is_that_of_the_motion_and_positive_to_the_right():
    picture, along = speckle(np.random.default_rng(6), 2.0), np.linspace(0.0, 4.0, 6)
    for angle, expected in ((30.0, 30.0), (150.0, -30.0), (90.0, 90.0), (-90.0, 90.0)):
        x, y = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        moved = hs.vision.displacement([picture(d * x, d * y) for d in along], 1.0)
        assert moved.direction == pytest.approx(expected, abs=0.02)
        assert np.abs(moved.y) == pytest.approx(along, abs=1e-3)
        assert np.sign(moved.y[-1]) == (1.0 if angle == expected else -1.0)
        assert np.abs(moved.across).max() < 1e-3


def test_a_straight_edge_shows_one_direction_only():
    frames = [edge(np.random.default_rng(7), angle=0.5)(d) for d in (0.0, 1.0, 2.5)]
    across = hs.vision.displacement(frames, 1.0)
    assert across.direction == pytest.approx(np.degrees(0.5), abs=0.1)
    assert across.y == pytest.approx(np.cos(0.5) * np.array([0.0, 1.0, 2.5]), abs=2e-3)
    assert hs.vision.displacement(frames, 1.0, direction="x").y == pytest.approx([0.0, 1.0, 2.5], abs=2e-3)
    assert np.isnan(across.across).all()
    with pytest.raises(ValueError, match="the picture is a straight edge, which shows no motion along"):
        hs.vision.displacement(frames, 1.0, direction=np.degrees(0.5) + 90.0)


def test_lost_and_blurred_frames_are_flagged_and_never_filled_in():
    rng = np.random.default_rng(8)
    picture, shifts = speckle(rng, 2.0), np.arange(12.0) / 3.0
    frames = seen(picture, shifts, 30, rng)
    frames[3], frames[5] = 0.0, rng.standard_normal((SIZE, SIZE))
    frames[8] = np.mean([picture(shifts[8] + d) for d in np.linspace(-4.0, 4.0, 17)], axis=0)
    moved = hs.vision.displacement(frames, 1.0)
    assert [k for k, status in enumerate(moved.status) if status == "lost"] == [3, 5]
    assert [k for k, status in enumerate(moved.status) if status == "blurred"] == [8]
    assert np.flatnonzero(np.isnan(moved.y)).tolist() == [3, 5]
    assert np.nanmax(np.abs(moved.y - shifts)) < 0.1
    assert_refused(r'^frame 3 is lost, and 2 of 12 are: on_lost="drop" leaves them out$', moved.record, u=shifts)
    assert len(moved.record(u=shifts, on_lost="drop")) == 10
    marks = hs.plot.displacement(moved, hs.plot.figure().add_subplot()).get_legend_handles_labels()[1]
    assert marks == ["± 2 standard errors", "blurred", "lost"]


@pytest.mark.parametrize("down", [0.0, 1.0], ids=["grating", "checkerboard"])
@pytest.mark.parametrize("share", [0.3, -0.45])
def test_a_periodic_picture_is_followed_by_steps_below_half_a_period(down, share):
    rng, shifts = np.random.default_rng(18), 12.0 * share * np.arange(5.0)
    rows, columns = (2.0 * np.pi / 12.0 * place for place in np.mgrid[0.0:128.0, 0.0:128.0])
    frames = seen(lambda x: np.sin(columns - np.pi * x / 6.0) * np.cos(down * rows / 2.0), shifts, 30, rng)
    moved = hs.vision.displacement(frames, 1.0, direction="x")
    assert np.abs(moved.y - shifts).max() < 0.05
    assert set(moved.status) == {"ok"}


def test_a_running_reference_follows_a_picture_that_leaves():
    rng = np.random.default_rng(9)
    wide, shifts = speckle(rng, 2.0, size=2 * SIZE), np.linspace(0.0, 200.0, 21)
    frames = [wide(-d)[:SIZE, :SIZE] + 0.03 * rng.standard_normal((SIZE, SIZE)) for d in shifts]
    frames[10] = np.zeros((SIZE, SIZE))  # no reason to give a reference up
    moved = hs.vision.displacement(frames, 1.0, reference="running", direction=180.0)
    assert [k for k, status in enumerate(moved.status) if status != "ok"] == [10]
    assert np.nanmax(np.abs(moved.y - shifts)) < 0.05
    assert moved.uncertainty[-1] > 2.0 * moved.uncertainty[1]
    fixed = hs.vision.displacement(frames, 1.0, direction=180.0)
    assert "lost" in fixed.status
    assert np.nanmax(np.abs(fixed.y - shifts)) < 0.05


def test_a_reference_is_a_frame_or_a_picture():
    frames = [speckle(np.random.default_rng(10), 2.0)(d) for d in (0.0, 0.5, 1.25)]
    expected = np.array([-0.5, 0.0, 0.75])
    for reference in (1, frames[1]):
        moved = hs.vision.displacement(frames, 1.0, reference=reference, direction="x")
        assert moved.y == pytest.approx(expected, abs=1e-3)
    assert_refused("come only once", hs.vision.displacement, iter(frames), 1.0, reference=1)


def test_only_the_region_counts():
    picture, still = (speckle(np.random.default_rng(seed), 2.0) for seed in (11, 12))
    frames = [picture(d) for d in (0.0, 6.3)]
    for frame in frames:
        frame[66:] = 5.0 * still(0.0)[66:]
    moved = hs.vision.displacement(frames, 1.0, region=(0, 64, 8, 72), direction="x")
    assert moved.y[1] == pytest.approx(6.3, abs=2e-3)


def test_frames_pass_one_at_a_time():
    picture, alive, most = speckle(np.random.default_rng(13), 2.0), [], []

    def frames():
        for d in np.linspace(0.0, 2.0, 12):
            frame = picture(d)
            alive.append(weakref.ref(frame))
            most.append(sum(one() is not None for one in alive))
            yield frame
            del frame

    calls = []
    moved = hs.vision.displacement(frames(), 1.0, progress=lambda *call: calls.append(call))
    assert len(moved) == 12
    assert max(most) <= 3
    assert calls[-1] == (12, 0)


@pytest.fixture(scope="module")
def stairs(tmp_path_factory):
    """Frames of 8 bits in files of every kind, and what they show."""
    gc.freeze()  # the reader of films asks for a collection at the end of each
    folder = tmp_path_factory.mktemp("stairs")
    shifts = np.arange(11) / 2.0
    grey = seen(speckle(np.random.default_rng(14), 2.0, size=64), shifts, 30, np.random.default_rng(15))
    grey = (128.0 + 30.0 * grey).clip(0, 255).astype(np.uint8)
    colour = np.stack([grey, grey, grey], axis=-1)
    for name in ("png", "mixed", "cut", "empty"):
        (folder / name).mkdir()
    for k, frame in enumerate(colour):
        iio.imwrite(folder / "png" / f"frame{k}.png", frame, plugin="pillow")
    iio.imwrite(folder / "pages.tif", grey.astype(np.uint16) * 16, plugin="tifffile")
    iio.imwrite(folder / "grey.avi", grey, plugin="pyav", codec="ffv1", in_pixel_format="gray", out_pixel_format="gray")
    iio.imwrite(folder / "clip.mp4", colour, plugin="pyav", codec="libx264")
    iio.imwrite(folder / "mixed" / "a1.png", grey[0], plugin="pillow")
    iio.imwrite(folder / "mixed" / "a2.png", grey[0][:48], plugin="pillow")
    for name in ("pages.tif", "grey.avi", "clip.mp4", "png/frame3.png"):
        whole = (folder / name).read_bytes()
        (folder / "cut" / name.split("/")[-1]).write_bytes(whole[: 6 * len(whole) // 10])
    (folder / "text.png").write_text("no picture")
    (folder / "volts.csv").write_text("t [s],u [V]\n" + "".join(f"{k / 10},{5 * k}\n" for k in range(11)))
    (folder / "few.csv").write_text("u [V]\n0\n5\n10\n")
    return folder, shifts, grey


@pytest.mark.parametrize("name", ["png", "pages.tif", "grey.avi", "clip.mp4"])
def test_files_of_every_kind_show_the_same(stairs, name):
    folder, shifts, grey = stairs
    source = hs.vision.read_frames(folder / name)
    assert source.n_frames == len(list(source)) == 11
    moved = hs.vision.displacement(folder / name, 1.0, direction="x")
    lossy = name.endswith("mp4")
    assert np.abs(moved.y - shifts).max() < (0.3 if lossy else 0.05)
    if not lossy:  # luminance of equal colours is rounded to 1e-6, and 12 bits are 16 times as much
        assert moved.y == pytest.approx(hs.vision.displacement(grey, 1.0, direction="x").y, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere", "nowhere: there is no such file or folder"),
        ("empty", "empty: there are no PNG or TIFF files in this folder"),
        ("few.csv", "few.csv: frames are read from a folder of PNG or TIFF files, or from a PNG, TIFF, AVI or MP4"),
        ("text.png", "text.png: not a readable .png file"),
        ("cut/pages.tif", "pages.tif: the file is damaged or truncated"),
        ("cut/grey.avi", "grey.avi: not a readable .avi file"),
        ("cut/clip.mp4", "clip.mp4: not a readable .mp4 file"),
        ("cut/frame3.png", "frame3.png: not a readable .png file: image file is truncated"),
        ("mixed", "a2.png is 48 x 64 pixels where the first one is 64 x 64: all frames must have one size"),
        ("png --scale 0", "scale must be the length of a pixel, a positive number, got 0.0"),
        (
            "png --region 0,64,0,70",
            "region must be (top, bottom, left, right) inside 64 x 64 pixels, got (0, 64, 0, 70)",
        ),
        (
            "png --voltage few.csv --u u",
            "there are 3 voltages for 11 frames: give one for each frame, or the times of both as --t and --frame-rate",
        ),
        ("png --voltage few.csv", "--voltage needs --u COLUMN"),
        ("png --u u", "--u and --t are columns of a file with voltages"),
        ("png --frame-rate 0", "'--frame-rate': expected a positive number"),
        ("png --reference 11", "there is no frame 11 to be the reference"),
    ],
)
def test_what_is_wrong_is_one_line_and_no_file(stairs, name, message, monkeypatch, capsys):
    monkeypatch.chdir(stairs[0])
    assert main(["measure", "--scale", "1", "--out", "bad.csv", *name.split()]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert not (stairs[0] / "bad.csv").exists()


def test_the_command_joins_frames_and_voltages(stairs, monkeypatch, capsys):
    folder, shifts, _ = stairs
    monkeypatch.chdir(folder)
    command = ["measure", "png", "--scale", "0.0763", "--voltage", "volts.csv", "--u", "u", "--t", "t"]
    assert main([*command, "--frame-rate", "20", "--out", "rec.csv", "--plot", "moved.svg", "--json"]) == 0
    assert '"ok": 11' in capsys.readouterr().out
    rec = hs.load("rec.csv", u="u", y="y", t="t")
    assert rec.u.tolist() == [5.0 * (k // 2) for k in range(11)]  # the log has a voltage for every second frame
    assert rec.y == pytest.approx(0.0763 * shifts, abs=0.005)
    assert dict(rec.units) == {"t": "s", "u": "V", "y": "um"}
    assert (folder / "moved.svg").read_text().startswith("<svg")
    assert main(["measure", "grey.avi", "--scale", "0.0763", "--out", "-", "--method", "whole-pixel"]) == 0
    assert capsys.readouterr().out.startswith("y [um],uncertainty [um],quality\n0.0,")


def test_voltages_are_joined_by_their_time():
    moved = hs.vision.displacement(np.array([speckle(np.random.default_rng(16), 2.0)(d) for d in (0.0, 1.0, 2.0)]), 1.0)
    rec = moved.record([0.0, 5.0, 10.0, 15.0], frame_times=[0.1, 0.3, 0.45], u_times=0.1 * np.arange(1, 5))
    assert rec.u.tolist() == [0.0, 10.0, 15.0]  # 0.1 + 0.1 + 0.1 is not 0.3, and the frame sees the new voltage
    assert rec.t.tolist() == [0.1, 0.3, 0.45]
    with pytest.raises(ValueError, match=r"^frame 0 at 0.1 is before the voltages, which begin at 0.2$"):
        moved.record([0.0, 5.0], frame_times=[0.1, 0.3, 0.4], u_times=[0.2, 0.3])
    assert_refused("u_times are given without frame_times", moved.record, [0.0, 5.0], u_times=[0.2, 0.3])


def test_frames_beyond_the_log_are_told():
    moved = hs.vision.displacement(np.array([speckle(np.random.default_rng(16), 2.0)(d) for d in (0.0, 1.0, 2.0)]), 1.0)
    with pytest.warns(hs.HysimWarning, match=r"^1 of 3 frames come after .* at 0.3: they have its last voltage, 5$"):
        moved.record([0.0, 3.0, 5.0], frame_times=[0.1, 0.4, 0.5], u_times=[0.1, 0.2, 0.3])
    assert moved.record([3.0], frame_times=[0.1, 0.2, 0.4], u_times=[0.1]).u.tolist() == [3.0] * 3  # no step is known


def test_lost_frames_are_dropped_without_voltages(tmp_path, capsys):
    picture = speckle(np.random.default_rng(16), 2.0)
    iio.imwrite(
        tmp_path / "film.tif", np.float32([picture(0.0), np.zeros((SIZE, SIZE)), *map(picture, [1.0, 2.0, 3.0])])
    )
    command = ["measure", str(tmp_path / "film.tif"), "--scale", "1", "--frame-rate", "10", "--out", "-"]
    for words, lines in ((["--on-lost", "drop"], 5), ([], 6)):
        assert main([*command, *words]) == 0
        assert len((table := capsys.readouterr().out).splitlines()) == lines
        assert table.splitlines()[-1].startswith("0.4,")


test_wrong_arguments_are_refused = refused(
    ({"frames": np.zeros((4, 4))}, "frames must have the shape"),
    ({"frames": []}, "there are no frames"),
    ({"frames": np.ones((2, 32, 32))}, "is of one grey"),
    ({"frames": [np.full((32, 32), np.nan)]}, "frame 0 must be finite"),
    ({"frames": [np.ones((32, 32), dtype=complex)]}, TypeError, "frame 0 must hold real numbers"),
    ({"frames": [np.ones((32, 32, 7))]}, "frame 0 must have the shape"),
    ({"scale": -1.0}, "scale must be"),
    ({"method": "pixel"}, "method must be one of subpixel, whole-pixel"),
    ({"direction": "up"}, 'direction must be "x", "y"'),
    ({"direction": 30.0, "method": "whole-pixel"}, "whole pixels are counted along rows or columns"),
    ({"reference": "last"}, 'reference must be "first", "running"'),
    ({"reference": np.eye(40)}, "frame 0 is 32 x 32 pixels where the first one is 40 x 40"),
    ({"region": (0, 8, 0, 32)}, "at least 16 x 16 pixels"),
    ({"region": (0, 32)}, r"region must be \(top, bottom, left, right\) inside 32 x 32 pixels"),
    ({"frames": 3.0}, TypeError, "frames must be an array, a path or give one frame after the other"),
    call=lambda arguments: hs.vision.displacement(**{"frames": [np.eye(32), np.eye(32)], "scale": 1.0} | arguments),
)
