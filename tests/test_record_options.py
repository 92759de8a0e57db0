"""Ranges of samples, input and output in two files, structures of models and sensors, by options of the commands."""

import dataclasses
import functools

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.cli import Command, main, models, options, records

RECORD = hs.Record(
    t=0.1 * np.arange(60),
    u=np.sin(np.arange(60.0)),
    y=np.cos(np.arange(60.0)),
    units={"t": "s", "u": "V", "y": "um"},
    name="loop",
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A record as one file, and as two: with and without times."""
    monkeypatch.chdir(tmp_path)
    hs.save_record(RECORD, "loop.csv")
    (tmp_path / "drive.csv").write_text("t,voltage [V]\n" + "".join(f"{k},{10 * k}\n" for k in range(5)))
    (tmp_path / "sensor.csv").write_text("t,y [um],w\n" + "".join(f"{k + 0.5},{k},{k % 2}\n" for k in range(5)))
    (tmp_path / "inputs.txt").write_text("".join(f"{k}\n" for k in range(5)))
    (tmp_path / "outputs.txt").write_text("".join(f"{2 * k}\n" for k in range(5)))
    return tmp_path


def arguments_of(*words):
    """Arguments of the function of `hysim identify`."""
    arguments = {}
    command = Command("identify")
    values = command.make_context("identify", [*words]).params
    options.call(functools.wraps(command.function)(lambda **named: arguments.update(named)), values)
    return arguments


def chosen(*words):
    """The options for a record."""
    return arguments_of("loop.csv", *words, "--model", "line")["settings"]


def read(file, *words):
    return records.read(chosen(*words), file)


@pytest.mark.parametrize(
    ("arguments", "samples"),
    [
        (("--from", "10"), slice(10, None)),
        (("--to", "10"), slice(None, 10)),
        (("--from", "0.3s", "--to", "700ms"), slice(3, 7)),
        (("--from", "0.31s"), slice(4, None)),
        (("--from", "5", "--to", "50", "--every", "7"), slice(5, 50, 7)),
        (("--from=2000000us", "--to", "99s"), slice(20, None)),
    ],
)
def test_a_range_is_a_slice_of_the_record(folder, arguments, samples):
    assert read("loop.csv", *arguments) == RECORD[samples]


def test_parts_of_a_record_meet_without_a_gap(folder):
    cuts = np.random.default_rng(0).uniform(0.2, 5.7, 20).tolist()
    for cut in cuts:
        first, last = read("loop.csv", "--to", f"{cut!r}s"), read("loop.csv", "--from", f"{cut!r}s")
        assert [*first.u, *last.u] == RECORD.u.tolist()


def test_a_time_is_said_in_seconds_whatever_the_unit_of_the_file(folder):
    hs.save_record(RECORD.convert({"t": "ms"}), "fast.csv")
    assert read("fast.csv", "--from", "0.3s").u.tolist() == RECORD.u[3:].tolist()


def test_a_range_counts_before_the_record_is_resampled(folder):
    assert read("loop.csv", "--from", "1s", "--to", "2s", "--sample-time", "0.2").t.tolist() == pytest.approx(
        [1.0, 1.2, 1.4, 1.6, 1.8]
    )
    assert read("loop.csv", "--no-t", "--sample-time", "0.5", "--from", "1s").t[0] == 1.0


def test_the_test_record_of_a_comparison_is_not_cut(folder):
    assert len(records.read(chosen("--to", "10"), "loop.csv")) == 10
    assert len(records.read(chosen("--to", "10"), "loop.csv", uncut=True)) == 60


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--from", "60"), "0 of 60 samples between 0 and 5.9 s remain by --from, --to and --every: a record needs"),
        (("--from", "3", "--to", "4"), "1 of 60 samples between 0 and 5.9 s remain by --from, --to"),
        (("--no-t", "--to", "1s"), "--to 1s needs a time: name its column by --t, or give a number"),
    ],
)
def test_a_range_without_samples_is_refused(folder, arguments, message):
    assert_refused(message, read, "loop.csv", *arguments)


@pytest.mark.parametrize(("option", "value"), [("--from", "-1"), ("--from", "1.5"), ("--to", "3min"), ("--every", "0")])
def test_a_place_is_a_number_or_a_time(folder, capsys, option, value):
    assert main(["metrics", "loop.csv", f"{option}={value}"]) == 2
    assert "expected" in capsys.readouterr().err


def test_an_output_in_a_file_of_its_own_is_joined_by_times(folder):
    rec = read("drive.csv", "--y-file", "sensor.csv")
    assert (rec.t.tolist(), rec.u.tolist(), rec.y.tolist()) == ([0.5, 1.5, 2.5, 3.5], [5, 15, 25, 35], [0, 1, 2, 3])
    assert dict(rec.units) == {"u": "V", "y": "um"}
    both = records.read_with_weights(chosen("--y-file", "sensor.csv", "--weights", "w"), "drive.csv")
    assert both[1].tolist() == [0.0, 1.0, 0.0, 1.0]


def test_without_times_samples_belong_together_by_their_numbers(folder):
    rec = read("inputs.txt", "--y-file", "outputs.txt", "--from", "1")
    assert (rec.t, rec.u.tolist(), rec.y.tolist()) == (None, [1, 2, 3, 4], [2, 4, 6, 8])
    with pytest.raises(ValueError, match="the input has 60 samples and the output 5: without a time in both files"):
        read("loop.csv", "--y-file", "outputs.txt")
    with pytest.raises(ValueError, match=r"sensor.csv: no column 'y2', the columns are: t, y, w"):
        read("drive.csv", "--y-file", "sensor.csv", "--y", "y2")


def test_joined_times_have_the_unit_of_the_input_and_lie_within_its_own():
    slow = hs.Record(t=[0.0, 1.0, 2.0], u=[0.0, 10.0, 20.0], y=[0.0, 0.0, 0.0], units={"t": "s"})
    fast = hs.Record(t=[-10.0, 500.0, 1500.0, 2600.0], u=[0.0] * 4, y=[9.0, 1.0, 2.0, 9.0], units={"t": "ms"})
    in_hours = dataclasses.replace(slow, units={"t": "h"})
    assert hs.join_records(in_hours, in_hours).units["t"] == "h"
    joined = hs.join_records(slow, fast)
    assert (joined.t.tolist(), joined.u.tolist(), joined.y.tolist()) == ([0.5, 1.5], [5.0, 15.0], [1.0, 2.0])
    with pytest.raises(ValueError, match=r"the output's times, -0\.01 to 2\.6, are not within the input's, 5 to 7"):
        hs.join_records(dataclasses.replace(slow, t=slow.t + 5.0), fast)


def model_of(*words):
    return models.to_identify(arguments_of("loop.csv", *words)["fit"])


@pytest.mark.parametrize(
    ("arguments", "structure"),
    [
        (("prandtl-ishlinskii", "--plays", "4"), hs.PrandtlIshlinskii.structure(plays=4)),
        (("maxwell-slip", "--plays", "4"), hs.MaxwellSlip.structure(elements=4)),
        (("preisach", "--relay-intervals", "3", "--one-signed", "no"),
         hs.Preisach.structure(intervals=3, one_signed=False)),
        (("duhem", "--degree", "2"), hs.Duhem.structure(degree=2)),
        (("preisach",), hs.Preisach),
        (("oscillator", "--excitation", "base"), hs.BoucWenOscillator.structure(excitation="base")),
        (("oscillator", "--initial", "periodic", "--period", "9"),
         hs.BoucWenOscillator.structure(initial="periodic", period=9)),
        (("bouc-wen-oscillator",), hs.BoucWenOscillator.structure()),
    ],
)  # fmt: skip
def test_options_choose_the_structure_of_a_model(arguments, structure):
    assert model_of("--model", *arguments) == structure


test_an_option_of_another_model_is_refused = refused(
    (("bouc-wen", "--plays", "4"), "--plays is no option of the model bouc-wen"),
    (("preisach", "--plays", "4"), "--plays is no option of the model preisach"),
    (("oscillator", "--relay-intervals", "4"), "--relay-intervals is no option of the model oscillator"),
    (("duhem",), "the model duhem needs --degree"),
    (("transfer-function", "--zeros", "1"), "the model transfer-function needs --poles"),
    call=lambda arguments: model_of("--model", *arguments),
)


def test_an_oscillator_in_a_file_is_searched_in_its_own_setting(folder):
    hs.save(hs.BoucWenOscillator(mass=1.0, damping=0.1, stiffness=1.0, law=hs.BoucWen(), excitation="base"), "o.json")
    assert model_of("--model", "o.json") == hs.BoucWenOscillator.structure(excitation="base")
    assert model_of("--model", "o.json", "--excitation", "force") == hs.BoucWenOscillator.structure()


def test_sensors_of_a_structure_have_the_names_of_its_signals(folder, capsys):
    frame = hs.shear_frame([1.0, 1.0], laws=[hs.BoucWen(gain=5.0), hs.BoucWen(gain=4.0)])
    record = dataclasses.replace(RECORD, channels={"acceleration_2": RECORD.y, "drift_0": RECORD.u})
    measured = records.of_structure(frame, record, dict(record.channels))
    assert measured.sensors == (("acceleration", 1), ("drift", 0))
    assert measured.acceleration[:, 1].tolist() == RECORD.y.tolist()
    for name in ("drift_2", "acceleration_0", "speed_1", "drift"):
        with pytest.raises(ValueError, match=f"no signal '{name}': its signals are displacement_1 to displacement_2"):
            records.of_structure(frame, record, {name: 0})
    hs.save(frame, "frame.json")
    assert main(("identify", "loop.csv", "--model", "line", "--sensor", "drift_0=y")) == 2
    assert "--sensor is for structures in a file, got a Line" in capsys.readouterr().err


def test_the_columns_of_a_file_are_named_as_sensors(folder):
    with_sensors = chosen("--sensor", "drift_0=y", "--sensor", "force_0=u")
    record, _ = records.read_with_weights(with_sensors, "loop.csv")
    assert dict(with_sensors.sensor) == {"drift_0": "y", "force_0": "u"}
    assert record.channel("drift_0").tolist() == record.y.tolist() == RECORD.y.tolist()
    assert sorted(record.channels) == ["drift_0", "force_0"]
