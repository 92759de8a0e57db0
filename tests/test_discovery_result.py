"""What `discover` returns: a model that all verbs take, text, JSON, and shares of an ensemble."""

import json
import os
import pickle
from dataclasses import replace

import numpy as np
import pytest
from discovered import LAW, TRUTH, multisine, record_of, zigzag

import hysim as hs
from hysim import Discovery

WHOLE = zigzag(0.0, 1.0, -0.5, 1.5, -2.0, 2.0, -2.0)  # it ends with a cycle
T = np.arange(240) / 100.0
SLOW, FAST = np.sin(2.0 * np.pi * T), np.sin(2.0 * np.pi * 4.0 * T)


@pytest.fixture(scope="module")
def record():
    return record_of(lambda u: 5.0 + 40.0 * u + 60.0 * LAW.memory(u), WHOLE, noise=0.01)


@pytest.fixture(scope="module")
def hidden(record):
    """A memory behind an output, without time."""
    return hs.discover(record, route="output", library=list(TRUTH), cross_validate=3)


@pytest.fixture(scope="module")
def timed():
    """The same law under two rates."""
    records = [record_of(LAW.memory, u, noise=0.01, seed=seed) for seed, u in enumerate((2.0 * SLOW, 2.0 * FAST))]
    return hs.discover([hs.Record(u=r.u, y=r.y, t=T) for r in records], route="memory", library=list(TRUTH))


@pytest.fixture(scope="module")
def every_term():
    """All terms of the library, by the memory route."""
    return hs.discover(record_of(LAW.memory, multisine(200), noise=0.01), route="memory")


@pytest.mark.parametrize("name", ["hidden", "timed", "every_term"])
def test_a_discovery_comes_back_from_json_and_pickling_as_it_was(name, request):
    found = request.getfixturevalue(name)
    text = found.to_json()
    back = Discovery.from_json(text)
    assert back == found
    assert back.to_json() == text
    assert back.summary() == found.summary()
    assert pickle.loads(pickle.dumps(found)) == found
    assert hash(back) == hash(found)
    json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))


@pytest.mark.parametrize("text", ["", "{}", '{"discovery": 3}', '{"discovery": {"result": "Judgement", "fields": {}}}'])
def test_other_text_is_refused(text):
    with pytest.raises(ValueError, match="this is no discovery of hysim"):
        Discovery.from_json(text)


def test_a_discovery_is_a_value(hidden):
    with pytest.raises(AttributeError):
        hidden.verdict = "linear lag"
    with pytest.raises(TypeError):
        hidden.coefficients["u'"] = 2.0
    with pytest.raises(TypeError):
        hidden.judgement.held_out["law"] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        hidden.thresholds[0] = 1.0


def test_the_law_is_text_and_latex(hidden):
    assert hidden.equation.startswith("z' = u' (1 - 0.")
    assert hidden.latex.startswith(r"\dot{z} = \dot{u} \left(1 - 0.")
    assert r", \quad y = " in hidden.latex
    assert "'" not in hidden.latex


def test_the_summary_has_the_law_its_verdict_and_every_number(hidden):
    lines = hidden.summary().splitlines()
    assert lines[0] == hidden.equation
    assert hidden.verdict in lines[1]
    names = [line.split(" = ")[0].strip() for line in lines if "+-" in line]
    assert names == [*TRUTH, "feedthrough", "offset", "gain"]
    assert f"cross-validated rmse: {hidden.cv_rmse:.4g}" in map(str.strip, lines)


def test_warnings_are_printed_under_their_heading_and_stored(hidden):
    assert "Warnings" not in replace(hidden, warnings=()).summary()
    sentences = ("The first sentence.", "The second one.")
    warned = replace(hidden, warnings=sentences)
    assert warned.summary().splitlines()[-3:] == ["Warnings", *(f"  {each}" for each in sentences)]
    assert " ".join(sentences) in str(warned)
    assert Discovery.from_json(warned.to_json()) == warned
    assert json.loads(warned.to_json())["discovery"]["fields"]["warnings"] == list(sentences)


def test_the_verbs_take_what_was_found(hidden, record, tmp_path):
    model = hidden.model
    hs.save(model, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == model
    y = hs.simulate(model, None, record.u).y
    assert np.sqrt(np.mean((record.y - y) ** 2)) == pytest.approx(hidden.scores["rmse"], rel=1e-9)  # rounding
    row = hs.compare({"found": hidden}, record)["found"]
    assert row.model == model
    assert row.n_parameters == hidden.n_parameters
    assert row.fit_percent == pytest.approx(hidden.scores["fit_percent"], abs=1e-9)
    start = "rest" if hidden.n_parameters == len(hidden.stderr) - 1 else "free"  # all numbers but "u'", which is 1
    again = hs.identify(model, record, fixed={"n": 1.0, "A": 1.0}, initial=start)
    for name in ("beta", "gamma", "feedthrough", "gain"):
        assert again.estimates[name] == pytest.approx(getattr(model, name), rel=1e-4)  # the same optimum
    assert model.inverse_response(y[:20], u0=record.u[0]) == pytest.approx(record.u[:20], abs=1e-9)


def test_held_out_samples_are_worse_than_fitted_ones(hidden):
    assert hidden.scores["rmse"] < hidden.cv_rmse < 1.5 * hidden.scores["rmse"]


def test_true_terms_are_in_most_of_the_ensemble(every_term):
    assert list(every_term.inclusion) == [
        *("u'", "u' |z|", "u' z", "u' |z| z", "u' z^2"),
        *("|u'|", "|u'| |z|", "|u'| z", "|u'| |z| z", "|u'| z^2"),
    ]
    assert all(0.0 <= share <= 1.0 for share in every_term.inclusion.values())
    assert min(every_term.inclusion[term] for term in TRUTH) > 0.9


def test_a_law_at_two_rates_is_hysteresis(timed):
    assert timed.verdict == timed.judgement.verdict == "rate-independent hysteresis"
    assert timed.judgement.rate_spread == pytest.approx(4.0, rel=0.1)
    assert len(timed.models) == 2


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"), reason="takes minutes uncompiled")
def test_a_lag_at_two_rates_is_a_lag():
    plant = hs.TransferFunction(num=(20.0,), den=(1.0, 20.0), hold="foh")
    records = [hs.Record(u=u, y=plant.response(u, T[1]), t=T) for u in (SLOW, FAST)]
    found = hs.discover(records, library="duhem", degree=1)
    assert found.verdict == "linear lag"
    slow, as_it_was, fast = found.judgement.widths["rival"]
    # sin(atan(omega / 20)) at 1 Hz, sampled at 100 points a cycle, and at a tenth and at ten times of it
    exact = np.sin(np.arctan(0.1 * np.pi * np.array([0.1, 1.0, 10.0])))
    assert [slow, as_it_was, fast] == pytest.approx(exact, rel=0.01)
    assert len(set(found.judgement.widths["law"])) == 1


def test_numpys_random_state_and_the_data_are_left_as_they_were(record):
    np.random.seed(3)  # noqa: NPY002
    before = np.random.get_state()  # noqa: NPY002
    u, y = record.u.copy(), record.y.copy()
    first, second = (
        hs.discover(record, route="output", library=list(TRUTH), derivative="weak", seed=1) for _ in range(2)
    )
    after = np.random.get_state()  # noqa: NPY002
    assert first == second
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    assert np.array_equal(record.u, u)
    assert np.array_equal(record.y, y)
