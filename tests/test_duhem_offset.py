"""The offset of the polynomial Duhem law: the output is shifted, the memory is not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hysim as hs
from hysim.models.search_space import Freedom

TERMS = {"u'": 1.0, "|u'| z": -0.6, "u' |z|": -0.3}
LAW = hs.Duhem.from_terms(TERMS, feedthrough=2.0, offset=7.0, y0=7.25)
PATH = np.array([0.0, 0.3, -1.4, 1.1, 1.1, -0.2, 0.4, -1.0, 1.5, -1.5])


@given(offset=st.floats(-100.0, 100.0))
def test_an_offset_shifts_the_output_and_leaves_the_memory(offset):
    plain = replace(LAW, offset=0.0, y0=0.25)
    shifted = replace(LAW, offset=offset, y0=0.25 + offset)
    room = 1e-14 * (1.0 + abs(offset))  # y0 less the offset is rounded
    assert shifted.memory(PATH) == pytest.approx(plain.memory(PATH), abs=room)
    assert shifted.response(PATH) == pytest.approx(offset + plain.response(PATH), abs=room)


def test_the_output_begins_at_y0():
    assert LAW.response(PATH)[0] == 7.25
    assert LAW.memory(PATH)[0] == 0.25


def test_bouc_wen_with_an_offset_is_a_duhem_law():
    bouc_wen = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, feedthrough=2.0, offset=7.0, z0=0.25)
    expected = bouc_wen.response(PATH)
    assert np.abs(LAW.response(PATH) - expected).max() < 1e-10 * np.ptp(expected)  # an integrated law's promise


def test_batches_are_the_path_to_the_bit():
    offsets = np.array([0.0, 7.0, -1.0 / 3.0])
    arrays = {name: getattr(LAW, name) for name in ("p", "q", "p_abs", "q_abs")}
    together = hs.Duhem.responses({**arrays, "feedthrough": 2.0, "offset": offsets, "y0": 7.25}, PATH)
    for row, offset in zip(together, offsets.tolist(), strict=True):
        assert np.array_equal(row, replace(LAW, offset=offset).response(PATH))


def test_the_inverse_undoes_the_response():
    assert LAW.inverse_response(LAW.response(PATH)) == pytest.approx(PATH, abs=1e-9)  # 1e-10 of the output's range


def test_an_offset_makes_the_memory_another_thing_than_the_output():
    law = hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -1.0}, offset=-2.0)
    assert list(law.terms) == ["u'", "|u'| z"]
    assert law.equation == "z' = u' (1) + |u'| (-1 z), y = -2 + z"
    assert LAW.equation == "z' = u' (1 - 0.3 |z|) + |u'| (-0.6 z), y = 7 + 2 u + z"
    assert LAW.latex.endswith(r", \quad y = 7 + 2 u + z")


def test_an_offset_is_identified():
    u = np.concatenate([np.linspace(0.0, 2.0, 40), np.linspace(2.0, -2.0, 80), np.linspace(-2.0, 2.0, 80)])
    record = hs.Record(u=u, y=LAW.response(u))
    start = hs.Duhem.from_terms({"u'": 0.9, "|u'| z": -0.5, "u' |z|": -0.4}, feedthrough=2.1, offset=7.1, y0=7.2)
    fit = hs.identify(start, record)
    truth = {**TERMS, "feedthrough": 2.0, "offset": 7.0, "y0": 7.25}
    assert fit.estimates == pytest.approx(truth, abs=1e-6)  # the search's xtol
    assert fit.model.response(u) == pytest.approx(record.y, abs=1e-6)


def test_an_offset_is_searched_where_there_is_one_or_it_is_asked_for():
    record = hs.Record(u=PATH, y=LAW.response(PATH))
    plain = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    assert "offset" in replace(plain, offset=1.0).search_space(record).names
    assert "offset" not in plain.search_space(record).names
    assert "offset" in plain.search_space(record, Freedom(free=("offset",))).names


def test_a_law_with_an_offset_comes_back_from_json(tmp_path):
    hs.save(LAW, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == LAW
