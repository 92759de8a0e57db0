"""Signals of several masses and elements are written, printed and drawn; ground motions drive plants from a shell."""

import csv
import io

import numpy as np
import pytest
from strategies import assert_refused, document_of, refused_in_one_line

import hysim as hs

PLANT = '''
import numpy as np


class TwoFloors:
    """Two floors that move with the ground, as a plant of a user: the signals have one column for each."""

    dynamic = True
    excitation = "base"

    def response(self, u, sample_time):
        return self.signals(u, sample_time)["y"]

    def signals(self, u, sample_time):
        floors = np.stack([0.5 * u, 2.0 * u], axis=1)
        elements = {"peak_acceleration": floors, "drift": floors - 1.0, "force": 3.0 * floors}
        return {"y": floors[:, 1], "displacement": floors, **elements, "kinetic": u**2}


frame = TwoFloors()
'''
MOTION = np.array([0.0, 1.0, -2.0, 0.5])
NODES = ["displacement_1", "displacement_2", "peak_acceleration_1", "peak_acceleration_2"]
COLUMNS = ["t", "u", "y", *NODES, "drift_0", "drift_1", "force_0", "force_1", "kinetic"]
AT2 = "PEER\nQUAKE, SITE, 0\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 4, DT= .1 SEC\n 0. .1E+01-.2E+01\n.5\n"
G = 9.80665


@pytest.fixture
def run(tmp_path, monkeypatch, shell):
    """Run a command in a folder with a plant and ground motions: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "floors.py").write_text(PLANT)
    (tmp_path / "quake.AT2").write_text(AT2)
    (tmp_path / "quake.csv").write_text("time [s],acceleration [g]\n0,0\n0.1,1\n0.2,-2\n0.3,0.5\n")
    (tmp_path / "plain.csv").write_text("t,u [mm/s^2]\n0,0\n0.1,1\n0.2,-2\n0.3,0.5\n")
    (tmp_path / "list.txt").write_text("four values (g)\n0. 1. -2.\n.5\n")
    law = hs.BoucWen(A=20.0, beta=200.0, gamma=200.0)
    for excitation in ("base", "force"):
        plant = hs.BoucWenOscillator(mass=1.0, damping=0.6, stiffness=20.0, law=law, excitation=excitation)
        hs.save(plant, tmp_path / f"{excitation}.json", units={"y": "m"})

    return shell


@pytest.fixture
def simulation():
    namespace = {}
    exec(PLANT, namespace)
    return hs.simulate(namespace["frame"], [0.0, 0.1, 0.2, 0.3], MOTION, units={"t": "s", "drift": "m"})


def table_of(text):
    header, *rows = csv.reader(io.StringIO(text))
    return header, np.array(rows, dtype=float).T


def test_signals_become_columns_numbered_as_nodes_and_elements_are(simulation):
    columns = simulation.columns
    assert list(columns) == COLUMNS
    assert columns["displacement_2"].tolist() == (2.0 * MOTION).tolist()
    assert columns["drift_0"].tolist() == (0.5 * MOTION - 1.0).tolist()
    assert {values.shape for values in columns.values()} == {(4,)}


def test_signals_with_columns_are_printed_by_their_number_and_extent(simulation):
    assert "  drift              2 columns, -5 to 1 m" in str(simulation).splitlines()
    assert repr(simulation) == "<Simulation: 4 samples>"


def test_a_memory_with_several_places_is_written_as_columns(run, tmp_path):
    law = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0))
    hs.save(law, tmp_path / "stops.json")
    code, out, err = run("simulate", "stops.json", "plain.csv")
    header, values = table_of(out)
    assert (code, err, header[:5]) == (0, "", ["t", "u [mm/s^2]", "y", "z_0", "z_1"])
    assert values[3:5].T.tolist() == law.memory(MOTION).tolist()


@pytest.mark.parametrize(
    ("file", "options"), [("quake.AT2", []), ("quake.csv", []), ("list.txt", ["--sample-time", "0.1"]), ("-", [])]
)
def test_a_ground_motion_moves_a_plant(run, file, options):
    code, out, err = run("simulate", "floors:frame", file, *options, stdin=AT2)
    header, values = table_of(out)
    assert (code, err) == (0, "")
    assert header == ["t [s]", "u [m/s^2]", *COLUMNS[2:]]
    assert values[0].tolist() == [0.0, 0.1, 0.2, 0.3]
    assert values[1].tolist() == (MOTION * G).tolist()
    assert values[header.index("displacement_1")].tolist() == (0.5 * (MOTION * G)).tolist()


def test_a_ground_motion_moves_an_oscillator_as_in_python(run):
    plant = hs.load_model("base.json")
    t, a = hs.load_ground_motion("quake.AT2")
    document = document_of(run, "simulate", "base.json", "quake.AT2")
    assert document["units"] == {"t": "s", "u": "m/s^2", "y": "m"}
    assert document["columns"]["y"] == hs.simulate(plant, t, a).y.tolist()


def test_a_column_u_stays_as_it_is_and_columns_can_be_named(run):
    plain = table_of(run("simulate", "base.json", "plain.csv")[1])
    named = table_of(run("simulate", "base.json", "quake.csv", "--u", "acceleration", "--t", "time")[1])
    said = table_of(run("simulate", "floors:frame", "list.txt", "--sample-time", "0.1", "--unit", "u=gal")[1])
    assert (plain[0][1], named[0][1], said[0][1]) == ("u [mm/s^2]", "u [g]", "u [m/s^2]")
    assert plain[1][1].tolist() == named[1][1].tolist() == MOTION.tolist()
    assert said[1][1].tolist() == (MOTION / 100.0).tolist()


def test_a_header_of_numbers_is_skipped(run, tmp_path):
    (tmp_path / "numbers.txt").write_text("station\n1940 5 18\n0. 1.\n-2. .5\n")
    options = ["--sample-time", "0.1", "--skip", "2"]
    assert table_of(run("simulate", "base.json", "numbers.txt", *options)[1])[1][1].tolist() == MOTION.tolist()
    (tmp_path / "titled.csv").write_text("a title;\nof two lines\n" + (tmp_path / "plain.csv").read_text())
    assert run("simulate", "base.json", "titled.csv", "--skip", "2") == run("simulate", "base.json", "plain.csv")


def test_a_ground_motion_with_times_is_brought_to_even_steps(run):
    _, values = table_of(run("simulate", "floors:frame", "quake.csv", "--sample-time", "0.05")[1])
    assert values[0] == pytest.approx(np.arange(7) * 0.05)
    assert values[1][:3] == pytest.approx([0.0, 0.5 * G, G])


test_what_moves_nothing_is_one_line_and_exit_2 = refused_in_one_line(
    (["base.json", "quake.AT2", "--u", "1"], "is an AT2 file, which has no columns: leave out --u, --t and --no-t"),
    (["base.json", "list.txt"], "in reading order, pass their --sample-time"),
    (["force.json", "quake.csv"], "no column is called u, the columns are: time, acceleration; name it by --u"),
    (["base.json", "none.csv"], "none.csv: No such file or directory"),
    (["base.json", "-"], "<stdin>: there is no column of times beside the accelerations"),
    call=lambda run, words: run("simulate", *words, stdin="acc\nx\n"),
)


@pytest.mark.parametrize("ending", [".npz", ".mat", ".csv"])
def test_a_table_of_any_format_holds_every_column(run, tmp_path, ending):
    out = tmp_path / f"motion{ending}"
    assert run("simulate", "floors:frame", "quake.AT2", "--out", out) == (0, "", "")
    record = hs.load(out, u="drift_1", y="displacement_2", t="t")
    assert record.y.tolist() == (2.0 * (MOTION * G)).tolist()
    assert record.t.tolist() == [0.0, 0.1, 0.2, 0.3]


def test_loops_of_elements_are_drawn(run, tmp_path, simulation):
    assert run("simulate", "floors:frame", "quake.AT2", "--plot", tmp_path / "loops.svg")[0] == 0
    assert "element 1" in (tmp_path / "loops.svg").read_text()
    panels = hs.plot.element_loops(simulation, hs.plot.figure().subplots(2))
    assert [ax.lines[0].get_ydata().tolist() for ax in panels] == simulation.signals["force"].T.tolist()
    assert panels[0].get_xlabel() == "Drift [m]"
    with pytest.raises(ValueError, match="no drift and force of elements, it has u, z, y"):
        hs.plot.element_loops(hs.simulate(hs.BoucWen(), None, [0.0, 1.0]))


def test_signals_are_drawn_with_a_line_for_each_column(simulation):
    drift, kinetic = hs.plot.signals(simulation, "drift", "kinetic", axes=hs.plot.figure().subplots(2))
    assert [text.get_text() for text in drift.get_legend().get_texts()] == ["drift_0", "drift_1"]
    assert drift.lines[1].get_ydata().tolist() == simulation.signals["drift"][:, 1].tolist()
    assert (drift.get_ylabel(), kinetic.get_ylabel(), kinetic.get_xlabel()) == ("Drift [m]", "Kinetic", "Time [s]")
    assert kinetic.get_legend() is None
    with pytest.raises(ValueError, match=r"give signals out of t, u, y, displacement, .* got velocity"):
        hs.plot.signals(simulation, "velocity")
    assert_refused("got no name", hs.plot.signals, simulation)


@pytest.fixture
def frame(run, tmp_path):
    """Two storeys that yield under the motion of the AT2 file, in a file."""
    laws = [hs.BoucWen(A=stiffness, beta=0.1 * stiffness, gamma=0.1 * stiffness) for stiffness in (900.0, 600.0)]
    plant = hs.shear_frame([2.0, 1.0], laws=laws, damping=hs.ModalDamping(ratio=0.05))
    hs.save(plant, tmp_path / "frame.json", units={"y": "m", "drift": "m", "force": "N"})
    return plant


@pytest.mark.parametrize("file", ["quake.AT2", "quake.csv"])
def test_a_frame_is_moved_by_a_ground_motion_and_all_its_signals_are_written(run, frame, file):
    simulation = hs.simulate(frame, *hs.load_ground_motion(file))
    document = document_of(run, "simulate", "frame.json", file)
    assert document["units"]["u"] == "m/s^2"
    assert document["units"]["drift_1"] == "m"
    assert document["columns"].keys() == simulation.columns.keys()
    for name, column in (("displacement_2", "y"), ("drift_0", "displacement_1"), ("peak_acceleration_1", None)):
        assert document["columns"][name] == simulation.columns[name].tolist()
        assert column is None or document["columns"][name] == simulation.columns[column].tolist()
    assert np.abs(simulation.signals["force"]).max() > 0.0


def test_the_loops_of_a_frame_are_drawn_and_its_signals_printed(run, frame, tmp_path):
    assert run("simulate", "frame.json", "quake.AT2", "--plot", "frame.svg", "--out", "frame.csv") == (0, "", "")
    assert "element 1" in (tmp_path / "frame.svg").read_text()
    simulation = hs.simulate(frame, *hs.load_ground_motion("quake.AT2"))
    lines = str(simulation).splitlines()
    drift = next(line for line in lines if line.startswith("  drift"))
    assert "2 columns" in drift
    assert drift.endswith(f"peak {simulation.peaks['drift'].max():.4g}")
    assert len(lines) <= 10
