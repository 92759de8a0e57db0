"""Sobol indices and the pictures of studies show what the study holds."""

import math

import numpy as np
import pytest
from scipy import stats
from strategies import assert_refused, refused

import hysim as hs

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
    assert indices.summary().splitlines()[2].split()[:2] == ["y", "b"]
    again = hs.sobol_indices(result)
    assert np.array_equal(again.total_order_interval["y"], indices.total_order_interval["y"])


def test_the_indices_are_those_of_scipy(result):
    uniform = stats.uniform(-math.pi, 2.0 * math.pi)
    found = stats.sobol_indices(
        func=lambda x: np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]),
        n=2048,
        dists=[uniform] * 3,
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
    (lambda a: 1.0 / (a > 0.5), SALTELLI, "192 of 192 are done, 96 failed"),
    (lambda a: 1.0, SALTELLI, "must be finite and vary"),
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

    lines = hs.plot.parallel_coordinates(grid, "y", ax=axes()).lines
    assert lines[-1].get_ydata().tolist() == [1.0, 1.0, 1.0]  # the largest a and b, the second of the names
    assert len(lines) == 12
