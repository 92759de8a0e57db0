"""`sweep`: the same table whatever computes it, failures as rows, seeds of tasks, Sobol indices and pictures."""

import concurrent.futures
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
import sweep_tasks
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from strategies import assert_refused, refused

import hysim as hs
from hysim.sweeps import _sweep
from hysim.sweeps._chunks import seeds


def bits(result):
    """Every column but the seconds, to the bit."""
    columns = {name: values for name, values in result.columns.items() if name not in ("seconds", "error")}
    numbers = {name: (v.dtype.str, v.tobytes()) for name, v in {**columns, **result.arrays}.items()}
    return {**numbers, "task": result.task.tolist(), "error": result.error.tolist()}


@pytest.fixture(scope="module")
def serial():
    return hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, workers=1)


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_workers_do_not_change_a_bit(serial, executor):
    assert bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, executor=executor, workers=3)) == bits(serial)


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_chunks_do_not_change_a_bit(serial, size, monkeypatch):
    monkeypatch.setattr(_sweep._Run, "_size", lambda self, remaining, number: min(size, remaining))
    assert bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE)) == bits(serial)


class LastFirst(concurrent.futures.Executor):
    """Computes what was submitted last first, when asked for a result."""

    def __init__(self):
        self.waiting = []

    def submit(self, function, /, *args, **kwargs):
        future = concurrent.futures.Future()
        self.waiting.append((future, function, args, kwargs))
        if len(self.waiting) == 3:
            self.flush()
        return future

    def flush(self):
        while self.waiting:
            future, function, args, kwargs = self.waiting.pop()
            future.set_result(function(*args, **kwargs))


def test_any_executor_will_do_and_its_order_does_not_matter(serial, monkeypatch):
    backwards = LastFirst()
    monkeypatch.setattr(_sweep, "wait", lambda *args, **kwargs: backwards.flush())
    assert bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, executor=backwards, workers=2)) == bits(serial)


def test_a_dask_client_is_taken_by_its_executor(serial):
    class Client:
        def __init__(self, pool):
            self.pool = pool

        def get_executor(self):
            return self.pool

        def nthreads(self):
            return {"tcp://one": 2, "tcp://two": 1}

    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        assert bits(hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, executor=Client(pool))) == bits(serial)


def test_the_last_parameter_of_a_grid_changes_fastest(serial):
    assert len(serial) == serial.n_tasks == 120
    assert serial["a"][:7].tolist() == [0.1] * 6 + [serial["a"][6]]
    assert serial["b"][:6].tolist() == [1, 1, 2, 2, 3, 3]
    assert serial["way"][:3].tolist() == ["up", "down", "up"]
    assert serial["path"].shape == (120, 5)
    assert np.array_equal(np.isnan(serial["odd"]), serial["b"] == 2)
    assert not serial.errors


@given(seed=st.integers(0, 2**200), place=st.integers(0, 2**31))
def test_seeds_are_those_of_numpys_spawned_sequences(seed, place):
    spawned = np.random.SeedSequence(seed, spawn_key=(place,)).generate_state(1, np.uint64)[0] >> np.uint64(1)
    assert seeds(seed, np.array([place]))[0] == spawned


def test_another_seed_gives_other_numbers_and_the_same_one_the_same(serial):
    same, other = (hs.sweep(sweep_tasks.noisy, sweep_tasks.SPACE, seed=seed) for seed in (0, 1))
    assert np.array_equal(same["last"], serial["last"])
    assert not np.isin(other["last"], serial["last"]).any()


def test_a_batch_form_gives_the_same_bits_and_gets_columns():
    space = {"a": np.linspace(0.0, 1.0, 30), "b": [1.0, 3.0]}
    singly, together = hs.sweep(sweep_tasks.product, space), hs.sweep(sweep_tasks.with_batch, space)
    assert bits(singly) == bits(together)


@pytest.mark.parametrize("n", [1.0, 1.5])
def test_a_response_task_gives_the_measures_of_single_responses(n):
    rec = hs.datasets.table1()
    law = hs.BoucWen(A=0.02, beta=0.02, gamma=-0.01, n=n, feedthrough=0.02, offset=0.1)
    space = {"beta": np.linspace(0.01, 0.05, 9), "feedthrough": [0.02, 0.03]}
    result = hs.sweep(hs.response_task(law, rec.u, rec.y), space)
    for k in range(len(result)):
        y = law.with_scalars({name: result[name][k] for name in space}).response(rec.u)
        # squares and their sum in another order: some ulps
        assert result["rmse"][k] == pytest.approx(hs.metrics.rmse(rec.y, y), rel=1e-14)
    outputs = hs.sweep(hs.response_task(law, rec.u, measure="response"), space)["response"]
    assert np.array_equal(outputs[-1], y)


def test_a_batch_that_fails_leaves_the_rows_that_do_not():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=20)
    result = hs.sweep(hs.response_task(hs.BoucWen, u, measure="area"), {"n": [1.0, 2.0, -1.0, 3.0], "beta": [0.5, 0.7]})
    assert list(result.errors) == [4, 5]
    assert all("n must be" in message for message in result.errors.values())
    assert np.isfinite(np.delete(result["area"], [4, 5])).all()


def test_a_law_that_escapes_is_inf_and_no_error():
    u = np.linspace(0.0, 100.0, 50)
    result = hs.sweep(
        hs.response_task(hs.BoucWen(gamma=-2.0, n=2.0), u, measure="final"), [{"beta": 0.5}, {"beta": 3.0}]
    )
    assert result["final"][0] == math.inf
    assert math.isfinite(result["final"][1])
    assert not result.errors


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_a_failing_task_is_a_row_with_its_error(executor):
    result = hs.sweep(sweep_tasks.failing, {"a": [3, 1, 2, 3], "b": [0, 2]}, executor=executor, workers=2)
    assert result.errors == {
        0: "ValueError: no 3", 1: "ValueError: no 3", 2: "ZeroDivisionError: division by zero",
        4: "ZeroDivisionError: division by zero", 6: "ValueError: no 3", 7: "ValueError: no 3",
    }  # fmt: skip
    assert result["value"][[3, 5]].tolist() == [0.5, 1.0]
    assert np.isnan(np.delete(result["value"], [3, 5])).all()
    assert result["error"][3] == ""
    assert result.summary().splitlines()[:2] == ["8 of 8 tasks: 2 succeeded, 6 failed", "  4 x ValueError: no 3"]


def test_the_first_task_that_succeeds_says_what_a_row_is_and_not_the_fastest():
    import threading

    others = threading.Barrier(2)

    def task(k):
        if k == 0:
            raise RuntimeError("no layout")
        if k in (1, 2):
            others.wait()  # both are computed before either is settled
        return {2: {"y": [1.0]}, 3: {"x": 1.0}, 4: "one", 5: {"y": [3.0, 4.0], "w": 1.0}}.get(
            k, {"w": 0.5, "y": [1.0, 2.0]}
        )

    result = hs.sweep(task, {"k": range(7)}, workers=2)
    assert result["w"][[1, 5, 6]].tolist() == [0.5, 1.0, 0.5]
    assert result["y"][5].tolist() == [3.0, 4.0]
    assert result.errors == {
        0: "RuntimeError: no layout",
        2: "ValueError: the task returned y of shape (1,), where the first that succeeded returned the number w, "
        "y of shape (2,)",
        3: "ValueError: the task returned the number x, where the first that succeeded returned the number w, "
        "y of shape (2,)",
        4: "TypeError: a task returns numbers and arrays of numbers, got str for value",
    }
    assert np.isnan(result["y"][2]).all()


def test_where_every_task_fails_there_are_only_errors():
    result = hs.sweep(lambda k: 1 / 0, {"k": range(50)})
    assert len(result.errors) == 50
    assert not result.outputs


def test_a_task_may_use_its_array_again():
    own = np.empty(3)

    def task(k):
        own[:] = k
        return own

    assert hs.sweep(task, {"k": range(10)}, workers=1)["value"][:, 0].tolist() == list(range(10))


def test_a_list_has_its_own_tasks():
    result = hs.sweep(sweep_tasks.product, [{"a": 1, "b": 2.0}, {"a": 3, "b": 4.5}])
    assert result["value"].tolist() == [2.0, 13.5]
    assert result["a"].dtype == np.int64


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_a_sample_follows_its_distributions_and_its_seed(method):
    sample = hs.Sample(distributions={"a": (2.0, 4.0), "b": stats.norm(1.0, 0.5)}, n=256, method=method, seed=3)
    result = hs.sweep(sweep_tasks.product, sample)
    for name, fractions in {"a": (result["a"] - 2.0) / 2.0, "b": stats.norm(1.0, 0.5).cdf(result["b"])}.items():
        counts = np.histogram(fractions, bins=256, range=(0.0, 1.0))[0]
        assert (counts == 1).all(), name  # one in each of n slices, which both designs promise
    again = hs.Sample(distributions={"a": (2.0, 4.0), "b": stats.norm(1.0, 0.5)}, n=256, method=method, seed=4)
    assert not np.isin(again.draw()["a"], result["a"]).any()


test_a_wrong_space_is_refused = refused(
    ({}, "at least one parameter"),
    ({"a": [], "b": [1]}, "no value of a"),
    ({"a": [math.nan], "b": [1]}, "got nan"),
    ({"a": [1, "x"], "b": [1]}, TypeError, "all numbers, all strings"),
    ({"a": [2**70], "b": [1]}, "an integer beyond 2.63: give floats"),
    ({"a": 1.0, "b": [1]}, TypeError, "must be a sequence"),
    ({"a": [1]}, TypeError, "does not take the parameters a"),
    ({"a": [1], "seed": [1]}, "cannot be called 'seed'"),
    ([], "no task"),
    ([{"a": 1, "b": 2}, {"a": 1}], "task 1 of the list has a, the first has a, b"),
    ("ab", TypeError, "a space is"),
    call=lambda space: hs.sweep(sweep_tasks.product, space),
)


test_a_wrong_option_is_refused = refused(
    ({"executor": "dusk"}, "executor must be"),
    ({"executor": 3}, TypeError, "method submit"),
    ({"workers": 0}, "workers must be"),
    ({"seed": -1}, "not be negative"),
    ({"seed": 1.5}, TypeError, "a whole number"),
    ({"on_change": "ask"}, "on_change must be"),
    call=lambda options: hs.sweep(sweep_tasks.product, {"a": [1], "b": [1]}, **options),
)


test_a_wrong_sample_is_refused = refused(
    ({"n": 100}, "take 64 or 128"),
    ({"n": 0, "method": "latin_hypercube"}, "at least 1"),
    ({"n": 4, "method": "random"}, "one of sobol"),
    ({"n": 4, "distributions": {"a": (1.0, 0.0)}}, "in order"),
    ({"n": 4, "distributions": {}}, "at least one"),
    call=lambda arguments: hs.Sample(**{"distributions": {"a": (0.0, 1.0)}, **arguments}),
)


test_a_wrong_response_task_is_refused = refused(
    (hs.BoucWen, {"measure": "rmse"}, "y is needed"),
    (hs.BoucWen, {"measure": "width"}, "one of rmse"),
    (hs.BoucWen, {"y": [1.0]}, "equal lengths"),
    (hs.SingleValued, {"y": [1.0, 2.0]}, TypeError, "SingleValued cannot compute many laws"),
    call=lambda law, arguments: hs.response_task(law, [0.0, 1.0], **arguments),
)


def test_an_output_cannot_have_the_name_of_a_parameter():
    assert_refused("returned a, which is the name of another column", hs.sweep, lambda a: {"a": a}, {"a": [1.0]})


def test_progress_ends_at_the_total():
    seen = []
    hs.sweep(sweep_tasks.product, {"a": range(30), "b": [1, 2]}, progress=lambda *at: seen.append(at))
    assert (seen[0], seen[-1]) == ((0, 60), (60, 60))
    assert seen == sorted(seen)


def test_the_table_as_text_keeps_every_digit(serial):
    header, first, *rest = serial.to_csv().splitlines()
    assert header == "task,a,b,way,last,odd,seed,seconds,error"
    assert len(rest) == 119
    assert float(first.split(",")[4]) == serial["last"][0]
    assert_refused("no column 'width'", serial.__getitem__, "width", error=KeyError)


@pytest.mark.parametrize(("library", "view"), [("pandas", "to_frame"), ("xarray", "to_xarray")])
def test_a_view_says_what_it_needs(serial, library, view, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    assert_refused(rf"{view} needs {library}: pip install 'hysim\[tables\]'", getattr(serial, view), error=ImportError)


@pytest.mark.extra("pandas")
def test_the_frame_has_a_column_for_each_name(serial):
    frame = serial.to_frame()
    assert list(frame.columns) == list(serial.columns)
    assert np.array_equal(frame["last"].to_numpy(), serial["last"])


@pytest.mark.extra("xarray")
def test_the_dataset_has_the_axes_of_the_grid(serial):
    data = serial.to_xarray()
    assert data["last"].dims == ("a", "b", "way")
    assert data["path"].dims == ("a", "b", "way", "path_0")
    row = int(np.flatnonzero((serial["b"] == 3) & (serial["way"] == "down"))[0])
    assert data["last"].sel(a=0.1, b=3, way="down").item() == serial["last"][row]
    listed = hs.sweep(sweep_tasks.product, [{"a": 1, "b": 2.0}, {"a": 3, "b": 4.5}]).to_xarray()
    assert listed["value"].dims == ("task",)
    assert listed["b"].to_numpy().tolist() == [2.0, 4.5]


# ---------------------------------------------------------------------------------- Sobol indices and pictures


PI = (-math.pi, math.pi)


def ishigami(a, b, c):
    return {"y": math.sin(a) + 7.0 * math.sin(b) ** 2 + 0.1 * c**4 * math.sin(a)}


@pytest.fixture(scope="module")
def result():
    return hs.sweep(ishigami, hs.Sample(distributions={"a": PI, "b": PI, "c": PI}, n=2048, method="saltelli"))


def test_the_indices_of_ishigamis_function_are_the_published_ones(result):
    indices = hs.sobol_indices(result)
    # closed forms: a = 7, b = 0.1; the error of 2048 points of a Sobol sequence is below 0.02
    assert indices.first_order["y"] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.02)
    assert indices.total_order["y"] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    for name in ("first_order", "total_order"):
        low, high = getattr(indices, f"{name}_interval")["y"]
        assert (low < getattr(indices, name)["y"]).all()
        assert (getattr(indices, name)["y"] < high).all()
    assert [line.split()[0] for line in indices.summary().splitlines()] == ["output", "y", "y", "y"]
    again = hs.sobol_indices(result)
    assert np.array_equal(again.total_order_interval["y"], indices.total_order_interval["y"])


def test_the_indices_are_those_of_scipy(result):
    found = stats.sobol_indices(
        func=lambda x: np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]),
        n=2048,
        dists=[stats.uniform(-math.pi, 2.0 * math.pi)] * 3,
        rng=np.random.default_rng(0),
    )
    # other points of the same sequence, and the same estimators
    assert hs.sobol_indices(result).first_order["y"] == pytest.approx(found.first_order, abs=0.02)


def test_one_parameter_has_all_of_the_variance():
    sample = hs.Sample(distributions={"a": (0.0, 1.0)}, n=256, method="saltelli")
    indices = hs.sobol_indices(hs.sweep(lambda a: {"y": a}, sample))
    assert indices.total_order["y"] == pytest.approx([1.0], abs=0.02)  # the error of 256 points


SALTELLI = hs.Sample(distributions={"a": (0.0, 1.0)}, n=64, method="saltelli")
test_indices_of_another_sample_are_refused = refused(
    (lambda a, b: a + b, hs.Sample(distributions={"a": (0.0, 1.0), "b": (0.0, 1.0)}, n=64), "saltelli"),
    (lambda a, b: a + b, [{"a": 1.0, "b": 2.0}], "saltelli"),
    (lambda a: 1.0 / (a > 0.5), SALTELLI, "all 192 tasks: 192 are done, 96 failed"),
    (lambda a: 1.0, SALTELLI, "must be finite and vary"),
    (lambda a: a, replace(SALTELLI, n=1), "of two points or more"),
    (lambda a: {"y": np.zeros(3)}, SALTELLI, "need an output that is a number"),
    call=lambda task, sample: hs.sobol_indices(hs.sweep(task, sample)),
)


def axes():
    return hs.plot.figure().add_subplot()


def test_the_pictures_show_the_numbers(result):
    indices = hs.sobol_indices(result)
    drawn = hs.plot.sensitivities(indices, "y", ax=axes())
    assert [text.get_text() for text in drawn.get_xticklabels()] == ["a", "b", "c"]
    assert drawn.containers[1][0].get_ydata().tolist() == indices.total_order["y"].tolist()

    grid = hs.sweep(lambda a, b, c: {"y": a + 10.0 * b}, {"a": [1, 2, 3], "b": [0.0, 1.0], "c": ["x", "y"]})
    table = hs.plot.heat_map(grid, "a", "b", "y", ax=axes()).collections[0].get_array()
    assert table.tolist() == [[1.0, 2.0, 3.0], [11.0, 12.0, 13.0]]
    assert_refused("needs a grid", hs.plot.heat_map, result, "a", "b", "y", ax=axes())

    bands = hs.plot.quantile_bands(grid, "a", "y", ax=axes())
    assert bands.lines[0].get_xydata().tolist() == [[1.0, 6.0], [2.0, 7.0], [3.0, 8.0]]
    assert len(hs.plot.quantile_bands(result, "a", "y", ax=axes()).lines[0].get_xdata()) == 20
    assert_refused("no finite value", hs.plot.quantile_bands, hs.sweep(lambda a: math.nan, {"a": [1]}), "a", "value")

    lines = hs.plot.parallel_coordinates(grid, "y", ax=axes()).lines
    assert lines[-1].get_ydata().tolist() == [1.0, 1.0, 1.0]  # the largest a and b, the second of the names
    assert len(lines) == 12
