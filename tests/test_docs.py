"""The Python blocks of the documentation run, page by page; the README is short, runs, and its links lead somewhere."""

import inspect
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from strategies import assert_refused, loaded

import hysim as hs

DOCS = Path(__file__).parent.parent / "docs"
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("teaching/*.md")])
NEEDS = {
    "camera": pytest.mark.extra("skimage"),
    "control": pytest.mark.extra("slycot"),
    "dataframes": pytest.mark.extra("pandas", "xarray"),
    "posterior": pytest.mark.extra("emcee"),
}

WITHOUT_FIGURE = {"decisions", "scope", "versions"}  # reasons, a list of what is not there, a table of versions


page_runs = loaded(DOCS / "page_runs.py")


@pytest.mark.parametrize("page", [pytest.param(page, id=page.stem, marks=NEEDS.get(page.stem, ())) for page in PAGES])
def test_python_blocks_of_a_page_run_in_order_and_print_and_draw_what_it_shows(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = page_runs.printed_by(page)
    assert blocks
    for printed, shown in blocks:
        if shown is not None:
            words, numbers = page_runs.words_and_numbers(printed)
            shown_words, shown_numbers = page_runs.words_and_numbers(shown)
            assert words == shown_words
            np.testing.assert_allclose(numbers, shown_numbers, rtol=1e-2, atol=1e-9)  # other machines round otherwise
    for name, figure in page_runs.figures_of(page).items():
        assert page_runs.labels(tmp_path / name) == page_runs.labels(figure)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_has_a_figure_and_code_of_at_most_90_columns(page):
    text = page.read_text()
    assert re.search(r"!\[[^]]+\]\(|\{\{ \w*figure|\{\{ accuracy", text) or page.stem in WITHOUT_FIGURE
    for language, code in re.findall(r"^```(\w+)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL):
        wide = [line for line in code.splitlines() if len(line) > 90]
        assert not wide or language == "text", wide  # a text is what a block prints


def test_every_stored_figure_is_on_a_page():
    text = "".join(page.read_text() for page in [*PAGES, DOCS.parent / "README.md"])
    assert [path.name for path in (DOCS / "figures").iterdir() if f"figures/{path.name})" not in text] == []


def test_the_page_on_installation_explains_every_extra():
    extras = tomllib.loads((DOCS.parent / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    rows = re.findall(r"^\| `(\w+)` \|", (DOCS / "installation.md").read_text(), flags=re.MULTILINE)
    assert sorted(rows) == sorted(extras)


@pytest.fixture(scope="module")
def gallery():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS)
        yield loaded(DOCS / "gallery.py")


def test_the_gallery_has_every_law_every_plant_and_every_picture(gallery):
    drawn = gallery.family_cards(), gallery.plant_cards(), gallery.picture_cards()
    assert {"LuGre", "BoucWen", "Preisach"} <= hs.families().keys()
    assert {"loop", "forc", "heat_map"} <= gallery.pictures().keys()
    names = [*hs.families(), *gallery.plants(), *(f"plot.{name}" for name in gallery.pictures())]
    assert all("".join(drawn).count(f"(reference/hysim.{name}.rst):") == 1 for name in names)
    figures = re.findall(r"\]\((figures/[^)]+)\)\]", "".join(drawn))
    assert len(figures) == len(gallery.plants()) + len(gallery.pictures())
    assert all((DOCS / figure).exists() for figure in figures)


def test_every_law_of_the_gallery_has_sliders_on_its_page(gallery):
    frames, template = gallery.frames(), (DOCS / "_templates" / "autosummary" / "class.rst").read_text()
    cards = gallery.family_cards()
    assert frames.keys() == {f"hysim.{name}" for name in hs.families() if name != "SingleValued"}  # a curve of knots
    assert all(cards.count(f'"reference/{name}.html#sliders"') == 1 for name in frames)
    assert frames["hysim.LuGre"] == "explorer.html#model=Friction%3A+LuGre"
    assert frames["hysim.Dashpot"].startswith("explorer.html#model=Magnetorheological")
    assert '<iframe id="sliders" src="../{{ frames[fullname] }}"' in template


@pytest.mark.parametrize("name", hs.families())
def test_the_gallery_draws_the_example_of_every_law(gallery, name):
    family = hs.families()[name]
    y = gallery.loop(family(**family.example.fields), family.example.between)[1]
    assert np.isfinite(y).all()
    assert np.ptp(y) > 0.0


def test_a_picture_that_no_page_draws_is_named(gallery):
    with pytest.raises(LookupError, match=r"no page of docs/ has a figure of hs\.plot\.nothing"):
        gallery.figure_of("hs.plot.nothing")


def test_every_public_name_stands_in_the_reference_once(gallery):
    front_door = loaded(DOCS / "front_door.py")
    listed = re.findall(r"^   (\w\S*)$", "\n".join(front_door.groups().values()), flags=re.MULTILINE)
    names = [name for name in hs.__all__ if name[0] != "_" and not inspect.ismodule(getattr(hs, name))]
    assert sorted(name for name in listed if "." not in name) == sorted(names)
    assert len(set(listed)) == len(listed)
    assert front_door.heading_of(hs.LuGre) == "Friction, backlash and dashpots"
    assert front_door.heading_of(hs.Structure) == "Structures"


@pytest.mark.extra("sphinx")
def test_every_formula_of_the_pages_becomes_mathml(gallery):
    mathml = loaded(DOCS / "mathml.py")
    prose = [re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL) for page in PAGES]
    blocks = [tex for text in prose for tex in re.findall(r"^\$\$\n(.*?)\n\$\$$", text, flags=re.MULTILINE | re.DOTALL)]
    cards = re.findall(r"\$([^$]+)\$", gallery.family_cards())
    assert len(blocks) > 20 < len(cards)
    assert all(mathml.mathml(tex, as_block=True).startswith("<math") for tex in [*blocks, *cards])
    assert mathml.mathml("z''").count("′") == 2
    assert mathml.mathml("|z|").count('lspace="0" rspace="0">|</mo>') == 2
    assert_refused("foo", mathml.mathml, r"\foo", error=mathml.MathError)


# ---------------------------------------------------------------------------------- the README


ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("heading", ["Run", "Test"])
def test_a_heading_has_one_command_of_one_line(heading):
    section = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL)[1]
    commands = re.findall(r"^```\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL)
    assert len(commands) == 1
    assert len(commands[0].splitlines()) == 1
    assert "-m venv" in commands[0]


def test_it_is_read_in_a_few_minutes():
    assert len(README.splitlines()) <= 90
    assert len(README.split()) <= 700
    (block,) = blocks("python")
    assert len([line for line in block.splitlines() if line.strip()]) <= 12


def test_its_python_block_prints_what_stands_below_it(capsys):
    namespace = {}
    (block,), (shown,) = blocks("python"), blocks("text")
    exec(compile(block, "README.md", "exec"), namespace)
    assert capsys.readouterr().out == shown
    (low, high), run = (namespace["rec"].u.min(), namespace["rec"].u.max()), namespace["run"]
    assert namespace["stage"].amplifier.limits == (low, high)
    assert low <= run.u.min() <= run.u.max() <= high
    assert run.conditions["limited_samples"] == 0
    # the loop is late by one sample, in which the triangle moves by 7.5 nm; most of the rest are the sensor's 76 nm
    late = run.y[401:] - namespace["wanted"][400:-1]
    assert abs(late).max() < 0.06


def test_its_shell_commands_run(tmp_path, run):
    commands = [line.split() for text in blocks("shell") for line in text.splitlines()]
    assert [(program, run(*words)[0]) for program, *words in commands] == 3 * [("hysim", 0)]
    assert {path.name for path in tmp_path.iterdir()} >= {"loop.csv", "law.json", "fit.svg", "inverse.c"}


def test_every_link_leads_to_a_file():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 12
    assert [link for link in links if not (ROOT / link).exists()] == []
