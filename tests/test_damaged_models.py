"""A file that holds no model is refused in one line that names it, whatever stands at whichever place of it."""

import copy
import json
import sys

import pytest
from strategies import assert_refused
from test_model_storage import MODELS

import hysim as hs
from hysim.cli import main
from hysim.models.storage import from_json, to_json


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


def places(value, above=()):
    """Where something stands in a document, from the outside in."""
    yield above
    members = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, member in members:
        yield from places(member, (*above, key))


def replaced(document, place, value):
    if not place:
        return value
    changed = copy.deepcopy(document)
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    return changed


HOSTILE = {"400 digits": 10**400, "in a list": [10**400, 1.0], "900 lists": nested(900), "null": None, "empty": {}}
BY_FAMILY = {type(model).__name__: model for model in MODELS}


def said_of(text):
    """The message with which a text is refused, or None for a model; another error passes through."""
    try:
        from_json(text, "x.json")
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("family", BY_FAMILY)
def test_a_hostile_value_at_any_place_is_one_line(family):
    document = json.loads(to_json(BY_FAMILY[family]))
    refused = 0
    for place in places(document):
        for value in HOSTILE.values():
            said = said_of(json.dumps(replaced(document, place, value)))
            if said is not None:
                refused += 1
                assert said.startswith("x.json "), (place, value)
                assert "\n" not in said, (place, value)
                assert len(said) <= 1200, (place, value)
    assert refused > 3 * len(document["parameters"])  # null may stand for a default


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"family": "Line", "parameters": {"slope": 1' + 400 * "0" + ', "offset": 0}}', "got a number beyond"),
        ('{"family": "Line", "parameters": {"slope": 1' + 5000 * "0" + ', "offset": 0}}', "does not hold a model"),
        ('{"family": "Line", "parameters": {"slope": 1e400, "offset": 0}}', "slope must be finite, got inf"),
        ('{"family": "Line", "parameters": {"slope": 1, "slope": 2, "offset": 0}}', "'slope' is there twice"),
        ('{"family": "Line", "family": "PID", "parameters": {}}', "'family' is there twice"),
        ('{"family": "Line", "parameters": {"slope": ' + 900 * "[" + 900 * "]" + "}}", "nested more than 100 deep"),
        ('{"family": "Line", "parameters": {"slope": ' + 10**5 * "[" + 10**5 * "]" + "}}", "does not hold a model"),
        (10**5 * '{"a":', "does not hold a model"),
        ('{"family": null, "parameters": {}}', "the family must be a name, got None"),
        ("\ufeff{}", "does not hold a model"),
    ],
)  # fmt: skip
def test_a_file_that_is_damaged_is_one_line_in_python_and_on_the_command_line(tmp_path, capsys, text, words):
    path = tmp_path / "bad.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words) as caught:
        hs.load_model(path)
    assert str(path) in str(caught.value)
    (tmp_path / "loop.csv").write_text("u,y\n0,0\n1,1\n")
    assert main(["simulate", str(path), str(tmp_path / "loop.csv")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)


def test_the_recursion_limit_of_who_calls_makes_no_difference(tmp_path):
    deep = hs.Line()
    for _ in range(20):
        deep = hs.Cascade(stages=(deep, hs.Line()))
    hs.save(deep, tmp_path / "deep.json")
    assert hs.load_model(tmp_path / "deep.json") == deep
    for _ in range(20):
        deep = hs.Cascade(stages=(deep, hs.Line()))
    assert_refused("nested more than 100 deep", hs.save, deep, tmp_path / "deeper.json")
    assert not (tmp_path / "deeper.json").exists()


@pytest.mark.parametrize("make", [lambda n: hs.BoucWen(A=n), lambda n: hs.Preisach(levels=(0, n), weights=(1,))])
def test_a_number_beyond_the_largest_float_is_not_finite(make):
    assert_refused(r"must be finite, got a number beyond 1\.8e\+308", make, 10**400)
    assert sys.float_info.max < 10**400
