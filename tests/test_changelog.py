"""The changelog names what there is, and its newest version is the one that is installed."""

import functools
import re
from pathlib import Path

import pytest

import hysim as hs
from hysim.cli import COMMANDS, Command

ROOT = Path(__file__).parent.parent
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
REMOVED = re.compile(r"^### Removed\n.*?(?=^##)", re.MULTILINE | re.DOTALL)
OLD_NAMES = re.compile(r"^\|[^|]*\|", re.MULTILINE)
NOW = OLD_NAMES.sub("|", REMOVED.sub("", CHANGELOG))
QUOTED = re.findall(r"`([^`]+)`", NOW)


@pytest.mark.parametrize("name", sorted({name for text in QUOTED for name in re.findall(r"\bhs\.(\w[\w.]*\w)", text)}))
def test_every_name_of_the_changelog_exists(name):
    assert functools.reduce(getattr, name.split("."), hs) is not None


def test_every_command_and_option_of_the_changelog_exists():
    known = {option for name in COMMANDS for each in Command(name).params for option in each.opts}
    options = {option for text in QUOTED for option in re.findall(r"(?<!\S)--[a-z][\w-]*", text)}
    assert options
    assert options <= known
    assert {text.split()[1] for text in QUOTED if text.startswith("hysim ")} <= COMMANDS.keys()


def test_the_newest_version_is_the_one_that_is_installed_and_cited():
    (version, date), *_ = re.findall(r"^## (\S+) - (\d{4}-\d\d-\d\d)$", CHANGELOG, flags=re.MULTILINE)
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert hs.__version__ == version
    assert f"\nversion: {version}\n" in cited
    assert f"\ndate-released: {date}\n" in cited
