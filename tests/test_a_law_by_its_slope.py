"""A family with two hidden states, `tests/fading_dahl.py`, says its slope alone and takes part in every verb."""

import inspect
import itertools
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from fading_dahl import FadingDahl
from scipy.integrate import solve_ivp

import hysim as hs

LAW = FadingDahl(k=3.0, coulomb=0.4, fading=0.6, way=0.7, c=0.8, offset=0.1)
U = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
RECORD = hs.Record(u=U, y=LAW.response(U), t=np.arange(U.size) * 0.01)
compiler = shutil.which("gcc") or shutil.which("cc")


def test_it_has_at_most_forty_lines():
    assert len(inspect.getsource(FadingDahl).splitlines()) <= 40


def test_response_is_that_of_the_differential_equation():
    u, x, y = np.array([0.0, 1.0, -0.3, 0.2, -1.0]), [0.0, 0.0], [LAW.offset]
    for before, after in itertools.pairwise(u):
        s = float(np.sign(after - before))
        way = solve_ivp(
            lambda v, x, s=s: LAW.slope(LAW, *x, v, s), (before, after), x, "DOP853", rtol=1e-12, atol=1e-14
        )
        x = way.y[:, -1]
        y.append(LAW.offset + LAW.c * after + x[0])
    assert LAW.response(u) == pytest.approx(y, abs=1e-10)


def test_more_samples_on_a_branch_change_nothing():
    fine = np.interp(np.arange(0.0, U.size - 0.99, 0.125), np.arange(U.size), U)
    assert np.abs(LAW.remembered(fine)[::8] - LAW.remembered(U)).max() < 1e-9


def test_a_cut_input_gives_the_same_bits():
    first, state = LAW.advance(U[:50])
    assert len(state) == 3
    assert np.array_equal(np.append(first, LAW.advance(U[50:], state)[0]), LAW.response(U))
    assert LAW.offset + LAW.c * U + LAW.remembered(U)[:, 0] == pytest.approx(LAW.response(U), abs=1e-15)


def test_a_batch_has_the_rows_and_their_measures():
    sets = {**LAW.scalars, "k": [1.0, 3.0]}
    assert np.array_equal(FadingDahl.responses(sets, U)[1], LAW.response(U))
    measured = FadingDahl.responses(sets, U, reduce="area")[1]
    assert measured == pytest.approx(hs.loop_metrics(U, RECORD.y).area, rel=1e-12)


def test_the_inverse_undoes_the_response():
    assert LAW.inverse_response(RECORD.y) == pytest.approx(U, abs=1e-9)


def test_derivatives_are_those_of_differences():
    jacobian = LAW.response_jacobian(U, ("fading", "k"))
    for name in ("fading", "k"):
        more, less = (LAW.with_scalars({name: LAW.scalars[name] + h}).response(U) for h in (1e-5, -1e-5))
        assert jacobian[name] == pytest.approx((more - less) / 2e-5, abs=1e-6)


def test_identify_finds_it_with_intervals():
    noise = 1e-3 * np.random.default_rng(1).normal(size=U.size)
    fit = hs.identify(FadingDahl(way=0.7), hs.Record(u=U, y=RECORD.y + noise))
    for name in ("k", "coulomb", "fading", "c", "offset"):
        assert fit.estimates[name] == pytest.approx(getattr(LAW, name), abs=5.0 * fit.stderr[name])
    assert np.array_equal(fit.residual, RECORD.y + noise - fit.model.response(U))


def test_compare_ranks_it():
    comparison = hs.compare({"mine": FadingDahl(way=0.7), "line": hs.Line}, RECORD)
    assert comparison.ranked()[0].name == "mine"


def test_it_is_saved_and_printed(tmp_path):
    hs.save(LAW, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == LAW
    assert "fading = 0.6" in str(LAW)


def test_it_stands_in_sums_and_cascades():
    assert (LAW + hs.Line(slope=2.0)).response(U) == pytest.approx(RECORD.y + 2.0 * U, abs=1e-14)
    assert (hs.Line(slope=0.5) >> LAW).response(2.0 * U) == pytest.approx(RECORD.y, abs=1e-14)


def test_loops_are_closed_around_it():
    t = np.arange(0.0, 4.0, 0.01)
    loop = hs.close_loop(LAW, hs.PID(kp=0.2, ki=20.0), t, 0.5 * np.sin(2.0 * t))
    assert np.abs(loop.error[100:]).max() < 0.05
    reference = 0.1 + 0.7 * np.sin(2.0 * t)
    loop = hs.close_loop(LAW, hs.InverseFeedforward(law=LAW), t, reference)
    assert loop.y[1:] == pytest.approx(reference[:-1], abs=1e-9)


@pytest.mark.skipif(compiler is None, reason="there is no C compiler here")
def test_its_c_has_its_numbers(tmp_path):
    source = hs.to_c(LAW, name="fading")
    source.write(tmp_path)
    command = [compiler, "-std=c99", "-O2", "-ffp-contract=off", "fading_main.c", "fading.c", "-o", "main", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    lines = "\n".join(map(repr, U.tolist())) + "\n"
    out = subprocess.run([tmp_path / "main"], input=lines, capture_output=True, text=True, check=True).stdout
    assert np.array(out.split(), float) == pytest.approx(RECORD.y, abs=1e-12)


def test_its_page_has_its_equation(tmp_path):
    assert "fading" in hs.to_page(LAW, tmp_path / "law.html").read_text()


def test_it_is_drawn():
    assert hs.plot.loop(hs.simulate(LAW, RECORD.t, U)).lines


def test_the_command_line_takes_it_by_its_import_path(tmp_path):
    hs.save_record(RECORD, tmp_path / "record.csv")
    command = [sys.executable, "-m", "hysim", "identify", "record.csv", "--model", "fading_dahl:FadingDahl", "--json"]
    path = os.pathsep.join([os.path.dirname(__file__), *filter(None, sys.path)])
    done = subprocess.run(command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "coulomb" in done.stdout


def test_one_that_diverges_is_named():
    with pytest.raises(hs.SimulationError, match="diverges at sample 1"):
        FadingDahl(fading=-5.0, way=0.01).response([0.0, 50.0])


def test_a_slope_whose_text_cannot_be_read_is_refused():
    names = {}
    exec("def slope(p, z, u, s):\n    return p.k", names)
    with pytest.raises(TypeError, match="source of the slope of Unread"):
        type("Unread", (hs.Law,), {"__annotations__": {"k": float}, "k": 1.0, "slope": staticmethod(names["slope"])})


def test_a_slope_that_names_no_field_is_refused():
    with pytest.raises(TypeError, match="Misspelt has no parameter 'stifness'"):

        class Misspelt(hs.Law):
            stiffness: float = 1.0

            @staticmethod
            def slope(p, z, u, s):
                return p.stifness
