"""Several records share their parameters and not their states; a record that repeats itself needs no state at all."""

import re
from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.cli import main
from hysim.identification._problem import problem
from hysim.models.search_space import ALL_FREE

LAW = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5, offset=0.2)
CYCLE = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
INPUT = np.concatenate([CYCLE, [-0.4, 0.3, -0.2, 0.9]])


def record(z0=0.1, noise=0.005, seed=0, u=INPUT):
    rng = np.random.default_rng(seed)
    y = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5, offset=0.2, z0=z0).response(u)
    return hs.Record(u=u, y=y + noise * rng.standard_normal(u.size))


def test_sets_that_are_the_same_for_a_record_are_evaluated_once_with_the_same_bits():
    together = problem(LAW, [record(seed=k) for k in range(3)], ALL_FREE, "free")
    rng = np.random.default_rng(4)
    x = rng.uniform(together.space.lower, together.space.upper, (5, together.n_x)).repeat(3, axis=0)
    x[1::3, -1], x[2::3, 0] = together.space.lower[-1], together.space.lower[0]
    alone = [together.split(each[np.newaxis]) for each in x]
    for found, expected in zip(together.split(x), zip(*alone, strict=True), strict=True):
        np.testing.assert_array_equal(found, np.concatenate(expected))


def test_the_same_record_twice_halves_the_variances():
    one = hs.identify(LAW, record(0.0), fixed={"n": 1.0}, initial="rest")
    two = hs.identify(LAW, [record(0.0)] * 2, fixed={"n": 1.0}, initial="rest")
    n, d = INPUT.size, one.n_parameters
    ratio = (2 * n - d) / (n - d)  # of twice as many samples on more degrees of freedom
    for name in one.free_names:
        assert two.estimates[name] == pytest.approx(one.estimates[name], rel=1e-6, abs=1e-8)
        assert one.stderr[name] ** 2 == pytest.approx(ratio * two.stderr[name] ** 2, rel=1e-4)
    assert two.fit_percent == pytest.approx(one.fit_percent)
    np.testing.assert_array_equal(two.residual[:n], two.residual[n:])


def test_each_record_has_its_own_memory():
    fit = hs.identify(LAW, [record(0.1, seed=0), record(-0.3, seed=1)], fixed={"n": 1.0})
    assert fit.free_names == ("beta", "gamma", "feedthrough", "gain", "offset", "z0[0]", "z0[1]")
    assert [model.z0 for model in fit.models] == [fit.estimates["z0[0]"], fit.estimates["z0[1]"]]
    for name, true in (("z0[0]", 0.1), ("z0[1]", -0.3), ("beta", 1.4)):
        assert abs(fit.estimates[name] - true) < 4.0 * fit.stderr[name]
    assert fit.model == fit.models[0]
    assert "z0" not in fit.estimates
    assert fit.residual.size == 2 * INPUT.size
    responses = np.concatenate([model.response(INPUT) for model in fit.models])
    measured = np.concatenate([record(0.1, seed=0).y, record(-0.3, seed=1).y])
    np.testing.assert_allclose(fit.residual, measured - responses, atol=1e-12)


def test_the_command_line_draws_every_record_and_says_that_the_width_is_that_of_the_first(tmp_path, capsys):
    files = [str(tmp_path / f"{name}.csv") for name in ("one", "two")]
    for file, u in zip(files, (CYCLE, 0.5 * CYCLE), strict=True):
        np.savetxt(file, np.column_stack([u, hs.Play(threshold=0.2).response(u)]), header="u,y", delimiter=",")
    assert main(["identify", *files, "--model", "play", "--plot", str(picture := tmp_path / "loops.svg")]) == 0
    assert re.search("loop width 0.4 .*, of the first record", capsys.readouterr().out)
    assert all(f">{name}<" in picture.read_text() for name in ("one", "two"))


def test_records_may_begin_differently():
    steady = LAW.response(np.tile(CYCLE[:-1], 40))[-40:]
    records = [record(0.2, 0.0), record(0.0, 0.0), hs.Record(u=CYCLE[:-1], y=steady)]
    fit = hs.identify(LAW, records, fixed={"n": 1.0}, initial=("free", "rest", "periodic"))
    assert [name for name in fit.free_names if "z0" in name] == ["z0[0]"]
    assert fit.rmse < 1e-8
    assert fit.models[0].z0 == pytest.approx(0.2, abs=1e-6)
    assert fit.models[1].z0 == 0.0
    assert fit.models[2].response(CYCLE)[-1] == pytest.approx(fit.models[2].response(CYCLE)[0], abs=1e-12)


TWO = [record(), record()]
test_initial_must_fit_the_records = refused(
    *((TWO, {"initial": wrong}, "one for each of the 2 records") for wrong in (("free",), ("free",) * 3, [])),
    (TWO, {"initial": ("free", "warm")}, '"free", "rest", "still" or "periodic", got \'warm\''),
    (record(), {"initial": 3}, "got 3"),
    ([], {}, "no record"),
    ([record(), None], {}, TypeError, "takes a Record or several"),
    ([replace(record(), units={"y": unit}) for unit in ("um", "mm")], {}, "got y in mm and um"),
    call=lambda records, options: hs.identify(LAW, records, **options),
)


def test_records_are_left_out_one_at_a_time():
    rng = np.random.default_rng(3)
    u = [np.linspace(-1.0, 2.0, n) for n in (8, 12, 5)]
    records = [hs.Record(u=each, y=1.0 + 2.0 * each + 0.1 * rng.standard_normal(each.size)) for each in u]
    fit = hs.identify(hs.Line, records, cross_validate="records")
    errors = []
    for k, left_out in enumerate(records):
        others = [each for each in records if each is not records[k]]
        slope, offset = np.polyfit(*(np.concatenate([getattr(each, name) for each in others]) for name in "uy"), 1)
        errors.append(left_out.y - offset - slope * left_out.u)
    assert fit.cv_rmse == pytest.approx(np.sqrt(np.mean(np.concatenate(errors) ** 2)), rel=1e-10)
    assert_refused("at least 2 records", hs.identify, hs.Line, records[0], cross_validate="records")


def test_blocks_are_left_out_one_at_a_time_and_the_beginnings_of_records_never():
    u, y = np.arange(10.0), np.random.default_rng(4).standard_normal(10)
    errors = np.full(10, np.nan)
    for block in (np.arange(4, 7), np.arange(7, 10)):  # of the blocks of four, three and three samples
        kept = np.setdiff1d(np.arange(10), block)
        errors[block] = y[block] - np.polyval(np.polyfit(u[kept], y[kept], 1), u[block])
    fit = hs.identify(hs.Line, hs.Record(u=u, y=y), cross_validate=3)
    assert fit.cv_residual == pytest.approx(errors, rel=1e-10, nan_ok=True)
    several = hs.identify(hs.Line, [hs.Record(u=u, y=y), hs.Record(u=u[:5], y=y[:5])], cross_validate=3)
    assert np.flatnonzero(np.isnan(several.cv_residual)).tolist() == [0, 1, 2, 3, 10, 11]


def test_a_transfer_function_has_a_state_for_each_record():
    rng = np.random.default_rng(0)
    states = [(0.2, -0.1), (-0.4, 0.3)]
    records = []
    for state in states:
        true = hs.TransferFunction(num=(1.0, 3.0), den=(1.0, 0.8, 4.0), initial_state=state)
        u = np.repeat(rng.standard_normal(20), 5)
        records.append(hs.Record(u=u, y=true.response(u, 0.1), t=0.1 * np.arange(u.size)))
    fit = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1, initial="free"), records)
    assert [model.initial_state for model in fit.models] == [pytest.approx(state, abs=1e-5) for state in states]
    assert fit.model.den == pytest.approx((1.0, 0.8, 4.0), rel=1e-5)


@pytest.mark.parametrize("n", [0.7, 1.0, 1.6, 2.0, 5.0])
@pytest.mark.parametrize(("beta", "gamma"), [(0.9, 0.4), (1.2, -0.5), (0.5, 0.5), (0.2, 1.0)])
def test_the_steady_memory_is_that_of_many_periods(n, beta, gamma):
    """Of the classes I and II; each period contracts the memory, so that 400 leave nothing of its beginning."""
    for A in (1.0, -0.7):
        law = hs.BoucWen(A=A, beta=beta, gamma=np.sign(A) * gamma, n=n)
        period = hs.Record(u=CYCLE[:-1] + 0.3 * np.sin(np.arange(40)), y=np.zeros(40))
        found = law.steady({}, period)["z0"]
        repeated = law.memory(np.tile(period.u, 400))
        assert found.shape == (1,)
        assert found[0] == pytest.approx(repeated[-40], abs=1e-12)


def test_the_steady_memory_is_found_for_many_laws_and_nan_where_one_escapes():
    period = hs.Record(u=CYCLE[:-1], y=np.zeros(40))
    beta, gamma = np.array([0.9, -3.0, 1.2]), np.array([0.4, -3.0, -0.5])
    z0 = LAW.steady({"beta": beta, "gamma": gamma, "n": np.full(3, 2.0)}, period)["z0"]
    assert np.isfinite(z0).tolist() == [True, False, True]
    alone = [LAW.steady({"beta": b, "gamma": g, "n": 2.0}, period)["z0"][0] for b, g in zip(beta, gamma, strict=True)]
    np.testing.assert_array_equal(z0, alone)


def test_a_steady_record_gives_its_law_back():
    y = LAW.response(np.tile(CYCLE[:-1], 40))[-40:]
    fit = hs.identify(hs.BoucWen, hs.Record(u=CYCLE[:-1], y=y), initial="periodic", fixed={"n": 1.0})
    assert "z0" not in fit.free_names
    for name in ("beta", "gamma", "feedthrough", "gain", "offset"):
        assert fit.estimates[name] == pytest.approx(getattr(LAW, name), abs=1e-4)


def test_a_structure_without_a_steady_cycle_is_refused():
    u = np.repeat([0.0, 1.0, -1.0, 0.5], 10)
    rec = hs.Record(u=u, y=u, t=np.arange(40.0))
    with pytest.raises(ValueError, match="no steady cycle that could be computed"):
        hs.identify(hs.TransferFunction.structure(poles=1, zeros=0, initial="free"), rec, initial="periodic")
