"""A family that hysim does not have, `tests/square_dahl.py`, takes part in every verb."""

import inspect
import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from square_dahl import SquareDahl

import hysim as hs

LAW = SquareDahl(k=3.0, coulomb=0.4, c=0.8, offset=0.1)
U = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
RECORD = hs.Record(u=U, y=LAW.response(U), t=np.arange(U.size) * 0.01)


def obvious(law, u):
    """The law's own differential equation, with a thousand steps a stroke."""
    force, y = law.z0, [law.offset + law.c * u[0] + law.z0]
    for before, after in itertools.pairwise(u):
        du = (after - before) / 1000
        for _ in range(1000):
            middle = force + 0.5 * du * law.k * (1.0 - np.sign(du) * force / law.coulomb) ** 2
            force += du * law.k * (1.0 - np.sign(du) * middle / law.coulomb) ** 2
        y.append(law.offset + law.c * after + force)
    return np.array(y)


def test_it_has_at_most_forty_lines():
    assert len(inspect.getsource(SquareDahl).splitlines()) <= 40


def test_response_is_that_of_the_differential_equation():
    u = np.array([0.0, 1.0, -0.3, 0.2, -1.0])
    assert LAW.response(u) == pytest.approx(obvious(LAW, u), abs=1e-6)


def test_a_cut_input_gives_the_same_bits():
    first, state = LAW.advance(U[:50])
    assert np.array_equal(np.append(first, LAW.advance(U[50:], state)[0]), LAW.response(U))
    assert LAW.offset + LAW.c * U + LAW.memory(U) == pytest.approx(LAW.response(U), abs=1e-15)


def test_a_batch_has_the_rows_and_their_measures():
    sets = {"k": [1.0, 3.0], "coulomb": 0.4, "c": 0.8, "offset": 0.1}
    assert np.array_equal(SquareDahl.responses(sets, U)[1], LAW.response(U))
    measured = SquareDahl.responses(sets, U, reduce="area")[1]
    assert measured == pytest.approx(hs.loop_metrics(U, RECORD.y).area, rel=1e-12)
    assert SquareDahl.responses(sets, U, reduce="sse", target=RECORD.y)[1] == 0.0


def test_the_inverse_undoes_the_response():
    assert LAW.inverse_response(RECORD.y) == pytest.approx(U, abs=1e-12)


def test_identify_finds_it_with_intervals():
    noise = 1e-3 * np.random.default_rng(1).normal(size=U.size)
    fit = hs.identify(SquareDahl, hs.Record(u=U, y=RECORD.y + noise))
    for name in ("k", "coulomb", "c", "offset"):
        assert fit.estimates[name] == pytest.approx(getattr(LAW, name), abs=5.0 * fit.stderr[name])
        assert 0.0 < fit.stderr[name] < 0.1 * abs(getattr(LAW, name)) + 1e-3


def test_compare_ranks_it():
    comparison = hs.compare({"mine": SquareDahl, "line": hs.Line}, RECORD)
    assert comparison.ranked()[0].name == "mine"


def test_it_is_saved_and_printed(tmp_path):
    hs.save(LAW, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == LAW
    assert "coulomb = 0.4" in str(LAW)


def test_a_loop_is_closed_around_it():
    t = np.arange(0.0, 4.0, 0.01)
    loop = hs.close_loop(LAW, hs.PID(kp=0.2, ki=20.0), t, 0.5 * np.sin(2.0 * t))
    assert np.abs(loop.error[100:]).max() < 0.05


def test_its_inverse_is_a_feedforward():
    t = np.arange(0.0, 4.0, 0.01)
    reference = 0.1 + 0.7 * np.sin(2.0 * t)
    loop = hs.close_loop(LAW, hs.InverseFeedforward(law=LAW), t, reference)
    assert loop.y[1:] == pytest.approx(reference[:-1], abs=1e-10)  # y is read just before the next command


def height(k: float) -> dict[str, float]:
    """A task of a study: the largest output of the law."""
    return {"height": float(SquareDahl(k=k).response(U).max())}


def test_a_study_varies_it():
    study = hs.sweep(height, {"k": [0.5, 1.0, 2.0]}, workers=1)
    assert (np.diff(study["height"]) > 0.0).all()


def test_it_is_drawn():
    assert hs.plot.loop(hs.simulate(LAW, RECORD.t, U)).lines


def test_the_command_line_takes_it_by_its_import_path(tmp_path):
    hs.save_record(RECORD, tmp_path / "record.csv")
    command = [sys.executable, "-m", "hysim", "identify", "record.csv", "--model", "square_dahl:SquareDahl", "--json"]
    path = os.pathsep.join([os.path.dirname(__file__), *filter(None, sys.path)])
    done = subprocess.run(command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "coulomb" in done.stdout
