"""Pages for a browser: one file that loads nothing, and that computes what Python computes."""

import base64
import dataclasses
import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, TELEPHONE, WIDE, started, wait_for

import hysim as hs
from hysim._columns.turning import TOLERANCE, complete_cycles
from hysim.cli import main
from hysim.export import explorer
from hysim.export._compilers import FOLDER, c_source, compiled, mark, module_of
from hysim.export._page import LARGEST, Shown, page_text, presets, to_page
from hysim.export._page_model import output_of, steps_of
from hysim.laws.dashpot import RatePart
from hysim.laws.friction.rated_law import TimedLaw
from hysim.models.model import every_family
from hysim.paper.reproduction import browser_page

WASM = Path(hs.__file__).parent / "export" / FOLDER
LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=-0.01, feedthrough=0.03)


@pytest.fixture(scope="module")
def models():
    return presets()


@pytest.fixture(scope="module")
def all_steps(models):
    return {each.name: each for shown in models.values() for each in steps_of(shown.model)}


def data_of(text):
    """The numbers in a page."""
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1])


def test_a_page_is_one_small_file_that_loads_nothing(tmp_path):
    record = hs.datasets.table1()
    page = to_page(LAW, tmp_path / "law.html", record)
    text = page.read_text(encoding="utf-8")
    assert page == tmp_path / "law.html"
    assert page.stat().st_size < LARGEST
    assert not re.search(r"https?:|//\w+\.\w|@import|url\(|<link(?! rel=\"icon\" href=\"data:,\")| src=", text)
    assert "default-src 'none'; connect-src 'none'" in text
    assert text == page_text({"Symmetric Bouc-Wen law": Shown(LAW)}, record)


def test_the_record_is_in_the_page_to_the_last_bit():
    record = hs.datasets.table1()
    data = data_of(page_text({"law": Shown(LAW)}, record))
    for signal, values in (("u", record.u), ("y", record.y)):
        held = np.frombuffer(gzip.decompress(base64.b64decode(data["record"][signal])), "<f8")
        np.testing.assert_array_equal(held, values)


@pytest.mark.parametrize("name", ["</script><b>", "<!-- <script>", '"&amp;', "\u2028"])
def test_names_are_text_wherever_they_stand(name):
    text = page_text({name: Shown(LAW)}, dataclasses.replace(hs.datasets.table1(), name=name))
    assert data_of(text)["record"]["name"] == data_of(text)["models"][0]["name"] == name
    assert text.count("<script") == text.count("</script>") == 2
    assert "<b>" not in text


def test_a_page_that_would_be_too_large_says_what_to_do(tmp_path):
    u = np.random.default_rng(1).random(20_000)
    with pytest.raises(ValueError, match=r"the page would have \d+ bytes, more than 300000: .*20000 samples"):
        to_page(hs.Line(slope=2.0), tmp_path / "law.html", hs.Record(u=u, y=u))
    assert not list(tmp_path.iterdir())


def test_a_page_is_a_file_that_a_browser_opens_as_one(tmp_path):
    for write in (explorer, lambda path: to_page(LAW, path)):
        with pytest.raises(ValueError, match=r"a page is a file \.html, got .*law\.txt"):
            write(tmp_path / "law.txt")
    assert not list(tmp_path.iterdir())


def test_what_is_no_law_is_refused_with_what_takes_it(tmp_path):
    with pytest.raises(TypeError, match=r"a page takes a law, .* got TransferFunction: plants .* by hysim.to_c"):
        to_page(hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), tmp_path / "plant.html")
    with pytest.raises(ValueError, match=r"between must be \(lowest, highest input\)"):
        to_page(LAW, tmp_path / "law.html", between=(1.0, 1.0))


def test_every_slider_begins_at_the_law_and_ends_inside_what_it_takes(models, tmp_path):
    data = data_of(explorer(tmp_path / "explorer.html").read_text(encoding="utf-8"))
    for model in data["models"]:
        name = model["name"]
        shown = models[name]
        laws = [each.at_sample_time(0.01) if isinstance(each, TimedLaw) else each for each in _parts(shown.model)]
        owners = [(law, field) for law in laws for field in law.scalars]
        assert model["controls"], name
        names = [control["name"] for control in [*model["controls"], *model["inputs"]]]
        assert len(set(names)) == len(names), name
        for control in model["controls"]:
            assert control["lower"] < control["upper"], (name, control)
            assert control["lower"] <= control["value"] <= control["upper"], (name, control)
            assert not control.get("log") or control["lower"] > 0.0, (name, control)
            if len(control["places"]) == 1 and not control.get("scale") and not shown.stack:
                assert model["values"][control["places"][0]] == control["value"], (name, control)
                law, field = owners[control["places"][0]]
                assert [law.with_scalars({field: control[end]}) for end in ("lower", "upper")]  # no ValueError


def test_the_equation_of_the_output_names_every_number_that_is_linear_in_it(models):
    assert output_of(hs.BoucWen) == "offset + feedthrough u + gain z"
    linear = {"offset", "gain", "feedthrough", "saturation", "slope", "weight"}
    for name, shown in models.items():
        for law in _parts(shown.model):
            text = output_of(type(law))
            if text or not isinstance(law, hs.Preisach):  # whose sum over a density has no short form
                assert linear & set(vars(law)) <= set(re.findall(r"\w+", text)), name
    assert output_of(hs.Cascade) == ""


def test_the_explorer_has_every_family_of_laws(models, tmp_path):
    shown = {type(part).__name__ for each in models.values() for part in _parts(each.model)}
    laws = {name for name, family in every_family().items() if family.__module__.startswith("hysim.laws.")}
    assert laws - shown == {"SingleValued"}  # a curve of knots
    assert explorer(tmp_path / "explorer.html").stat().st_size < LARGEST


def _parts(model):
    return [part for each in model.parts for part in _parts(each)] if isinstance(model, hs.Sum) else [model]


def test_the_package_has_the_modules_of_all_steps_and_no_others(all_steps):
    assert {path.name for path in WASM.iterdir()} == {f"{name}.wasm.gz" for name in all_steps}


def test_the_modules_of_the_package_are_made_of_the_steps_as_they_are(all_steps):
    for name, kernels in all_steps.items():
        module = gzip.decompress(WASM.joinpath(f"{name}.wasm.gz").read_bytes())
        assert module.endswith(mark(c_source(kernels))), f"{name} has changed: python .ci/build_pages.py"


def test_the_command_writes_the_same_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    table1 = hs.datasets.table1()
    rows = [f"{u},{y}" for u, y in zip(table1.u.tolist(), table1.y.tolist(), strict=True)]
    Path("loop.csv").write_text("\n".join(["voltage [V],displacement [um]", *rows]))
    hs.save(LAW, "law.json", units={"u": "V", "y": "um"})
    columns = ("--u", "voltage", "--y", "displacement")
    assert main(["page", "law.json", "--out", "page.html", "--data", "loop.csv", *columns, "--title", "Mine"]) == 0
    record = hs.load("loop.csv", u="voltage", y="displacement")
    assert Path("page.html").read_text(encoding="utf-8") == page_text({"Mine": Shown(LAW)}, record)
    assert main(["explore", "--no-browser", "--out", "explorer.html"]) == 0
    assert capsys.readouterr().out == "explorer.html\n"
    assert main(["page", "law.json", "--out", "no/page.html"]) == 2


def test_the_report_has_a_page_of_the_identified_law_on_request(reproduction):
    findings = reproduction.findings
    assert "table1.html" not in reproduction.files
    (name, text), *others = browser_page(findings).items()
    assert (name, others) == ("table1.html", [])
    data = data_of(text)
    law = findings.study.fits["bouc-wen"].model
    assert data["models"][0]["values"] == list(law.scalars.values())
    assert data["models"][0]["labels"]["u"] == "Voltage [V]"
    assert len(text.encode()) < LARGEST


# ---------------------------------------------------------------------------------- modules


@pytest.mark.extra("wasmtime")
@pytest.mark.parametrize("name", [name for name in presets() if "rate" not in name])
def test_modules_compute_what_python_computes(models, name):
    rng = np.random.default_rng(len(name))
    shown = models[name]
    low, high = shown.between
    u = low + (high - low) * np.concatenate([rng.random(200), np.linspace(0.0, 1.0, 40), np.full(3, 0.5)])
    for law in _parts(shown.model):
        if isinstance(law, RatePart):
            continue
        law = law.at_sample_time(0.01) if isinstance(law, TimedLaw) else law
        expected = law.response(u)
        np.testing.assert_allclose(by_module(law, u), expected, rtol=0.0, atol=1e-12 * np.ptp(expected))


def by_module(law, u):
    """Outputs of a law by its module under wasmtime."""
    import wasmtime

    engine = wasmtime.Engine()
    store = wasmtime.Store(engine)
    (kernels,) = steps_of(law)
    module = wasmtime.Module(engine, gzip.decompress(module_of(kernels)))
    assert not module.imports
    exports = wasmtime.Instance(store, module, []).exports(store)
    general = law if not law.structural or "n" not in law.structural else dataclasses.replace(law, n=1.5)
    parameters, state = law.startable().parameters, np.zeros(general.startable().state.size)
    front = law.packed[1]
    state[: front.size] = front
    arrays = [np.asarray(parameters), state, u, np.zeros(u.size)]
    base = (exports["__heap_base"].value(store) + 7) // 8 * 8
    places = (base + 8 * np.cumsum([0, *(each.size for each in arrays)])).tolist()
    memory = exports["memory"]
    if (lacking := places[-1] - memory.data_len(store)) > 0:
        memory.grow(store, -(-lacking // 65536))
    memory.write(store, np.concatenate(arrays).tobytes(), base)
    sizes = [parameters.size, state.size]
    exports["begin"](store, places[0], sizes[0], places[1], sizes[1], float(u[0]))
    exports["run"](store, places[0], sizes[0], places[1], sizes[1], places[2], places[3], u.size)
    return np.frombuffer(bytes(memory.read(store, places[3], places[4])), "<f8")


@pytest.mark.extra("ziglang")
def test_a_step_compiles_to_the_bytes_of_the_package(all_steps):
    for name in ("clamps_step", "boucwen_linear_step"):
        packaged = gzip.decompress(WASM.joinpath(f"{name}.wasm.gz").read_bytes())
        assert packaged == compiled(c_source(all_steps[name]))


@pytest.mark.extra("ziglang")
def test_a_law_of_the_user_has_a_page(tmp_path):
    from square_dahl import SquareDahl

    text = to_page(SquareDahl(), tmp_path / "own.html").read_text()
    assert [control["name"] for control in data_of(text)["models"][0]["controls"]][:2] == ["k", "coulomb"]


# ---------------------------------------------------------------------------------- in a browser


def in_a_browser(test):
    return pytest.mark.browser(pytest.mark.extra("websockets")(test))


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    pytest.importorskip("websockets")
    if BROWSER is None:
        pytest.skip("no chromium is installed")
    with started(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


def assert_as_python(state, record=None):
    """The page's output, its measures and the code that it shows are those of Python."""
    namespace = {"measured": record}
    exec(state["code"].replace('hs.load("measured.csv")', "measured"), namespace)
    y = namespace["y"]
    span = np.ptp(y)
    np.testing.assert_allclose(state["y"], y, rtol=0.0, atol=1e-9 * span)
    loop = hs.loop_metrics(state["u"], y)
    scale = np.ptp(state["u"]) * span
    for name in ("max_width", "mean_width", "mid_width", "area", "stroke", "closure_gap", "energy", "secant_stiffness"):
        assert state["measures"][name] == pytest.approx(vars(loop)[name], rel=1e-9, abs=1e-9 * max(scale, span)), name
    assert state["measures"]["orientation"] == loop.orientation
    return y


@in_a_browser
def test_every_model_of_the_explorer_follows_its_sliders_as_python_does(browser, models, tmp_path):
    browser.open(explorer(tmp_path / "explorer.html"))
    for place, name in enumerate(models):
        state = browser.choose("model", str(place))
        assert state["model"] == name
        assert_as_python(state)
        sliders = len(browser.value("window.hysim.model.controls.map(control => control.name)"))
        for slider in range(min(sliders, 4)):
            moved = browser.press(slider, "ArrowRight", times=7)
            assert moved["values"] != state["values"], (name, slider)
        assert_as_python(moved)
    assert len(browser.requests()) == 1  # the page itself


@in_a_browser
def test_a_record_is_compared_and_what_a_slider_says_in_a_frame_is_drawn_once(browser, tmp_path):
    record = hs.datasets.table1()
    page = to_page(hs.Dahl(stiffness=0.02, coulomb=5.0) + hs.Line(slope=0.01), tmp_path / "page.html", record)
    browser.open(page)
    state = browser.press(0, "PageUp", times=2)
    y = assert_as_python(state, record)
    assert state["fit"]["fit_percent"] == pytest.approx(hs.metrics.fit_percent(record.y, y), rel=1e-9)
    assert state["fit"]["rmse"] == pytest.approx(hs.metrics.rmse(record.y, y), rel=1e-9)
    for kind in ("triangle", "sine", "fading", "minor loops"):
        assert_as_python(browser.choose("kind", kind))
    assert len(browser.choose("kind", "triangle")["u"]) > 1990
    before = browser.drawn()["values"]
    browser.value(
        "(() => { window.hysim.times.length = 0; const slider = document.querySelector('input[type=range]');"
        " for (let k = 0; k < 40; k++) { slider.stepUp(); slider.dispatchEvent(new Event('input')); } })()"
    )
    assert browser.drawn()["values"] != before
    assert len(browser.value("window.hysim.times")) == 1


@in_a_browser
def test_the_address_holds_the_setting_and_reset_takes_it_back(browser, tmp_path):
    page = to_page(hs.BoucWen(), tmp_path / "page.html")
    browser.open(page)
    first = browser.drawn()
    assert first["address"] == ""
    browser.choose("kind", "fading")
    set_ = browser.press(1, "End")
    browser.open(page, set_["address"])
    again = browser.drawn()
    assert again["values"] == set_["values"] != first["values"]
    assert again["u"] == set_["u"]
    browser.value("document.getElementById('reset').click()")
    assert browser.drawn()["values"] == first["values"]


@in_a_browser
def test_axes_stay_while_a_slider_moves_until_they_are_fitted(browser, tmp_path):
    browser.open(to_page(hs.BoucWen(), tmp_path / "page.html"))
    limits = browser.value("window.hysim.limits")
    gain = browser.value("window.hysim.model.controls.findIndex(control => control.name === 'gain')")
    browser.press(gain, "Home")
    assert browser.value("window.hysim.limits") == limits
    browser.press(gain, "End")
    assert browser.value("document.getElementById('refit').className") == "wanted"
    browser.value("document.getElementById('refit').click()")
    assert browser.value("window.hysim.limits") != limits
    assert browser.value("document.getElementById('refit').className") == ""


@in_a_browser
def test_a_double_click_fits_the_axes(browser, tmp_path):
    browser.open(to_page(hs.BoucWen(), tmp_path / "page.html"))
    limits = browser.value("window.hysim.limits")
    browser.press(0, "End")
    browser.value("document.getElementById('loop').dispatchEvent(new MouseEvent('dblclick'))")
    assert browser.value("window.hysim.limits") != limits


@in_a_browser
def test_the_equation_of_the_output_has_the_numbers_of_the_sliders(browser, tmp_path):
    def shown():
        return browser.value("document.getElementById('output').textContent")

    law = hs.PolynomialBoucWen(gain=-0.5, offset=0.25, input_coefficients=(0.5, 0.0, -2e-6))
    browser.open(to_page(law, tmp_path / "law.html"))
    assert shown() == "y = offset + sum c_k u^k + gain z\n  = 0.25 + 0.5 u − 2e-6 u³ − 0.5 z"
    offset = browser.value("window.hysim.model.controls.findIndex(control => control.name === 'offset')")
    top = browser.press(offset, "End")["values"][5]
    assert shown().split("= ")[2].startswith(f"{top:.3g} + 0.5 u")
    browser.open(to_page(hs.Stop(threshold=0.5, gain=2.0, offset=-1.0) + hs.Dashpot(c=1.0), tmp_path / "sum.html"))
    assert shown() == "Stop     y = −1 + 2 (u - z)\nDashpot  y = u'"
    browser.open(to_page(hs.MaxwellSlip(stiffness=(1.0, 3.0), slips=(0.2, 0.5)), tmp_path / "stops.html"))
    assert shown().endswith("= (u - z₀) + 3 (u - z₁)")


@in_a_browser
def test_the_plays_that_are_drawn_are_those_of_python_at_the_moment(browser, models, tmp_path):
    browser.open(explorer(tmp_path / "explorer.html"))
    drawn = 0
    for place, (name, shown) in enumerate(models.items()):
        state = browser.choose("model", str(place))
        if state["memory"] is None:
            continue
        drawn += 1
        browser.choose("kind", "fading")
        for share in (0, 137, 400):
            browser.value(
                f"(() => {{ const moment = document.getElementById('moment'); moment.value = {share};"
                " moment.dispatchEvent(new Event('input')); })()"
            )
            state = browser.drawn()
            memory, u = state["memory"], np.array(state["u"][: state["moment"] + 1])
            assert state["moment"] == round(share / 400 * (len(state["u"]) - 1))
            assert memory["u"] == u[-1]
            if "rate" not in name:
                z = np.atleast_1d(_parts(shown.model)[0].memory(u)[-1])
                np.testing.assert_allclose(memory["z"], z, rtol=0.0, atol=1e-12 * np.ptp(shown.between), err_msg=name)
            inside = np.abs(np.subtract(memory["z"], u[-1])) <= np.array(memory["thresholds"]) * (1 + 1e-12) + 1e-12
            assert inside.all() or not memory["cone"], name
    assert drawn == 10


@in_a_browser
def test_reversals_of_ones_own_make_the_loop_that_python_makes(browser, tmp_path):
    rng = np.random.default_rng(5)
    page = to_page(hs.BoucWen(feedthrough=0.2), tmp_path / "page.html")
    lists = [np.round(rng.uniform(-1.0, 1.0, rng.integers(2, 9)), 2).tolist() for _ in range(12)]
    lists += [[0, 1, 2, -2, 2], [2, -2, -1.985, -2, 2], [0, 1, -1, 0.97, -0.3, 0.3], [1, -1, 1, 0.995, 1, -1]]
    browser.open(page)
    browser.choose("kind", "reversals")
    measured = 0
    for turns in lists:
        browser.value(
            f"(() => {{ const box = document.getElementById('reversals'); box.value = {json.dumps(turns)}.join('; ');"
            " box.dispatchEvent(new Event('change')); })()"
        )
        state = browser.drawn()
        assert state["input"]["reversals"] == [turn for k, turn in enumerate(turns) if not k or turn != turns[k - 1]]
        cycles = complete_cycles(np.array(state["u"]), TOLERANCE)
        assert bool(cycles) == (state["measures"] is not None), turns
        if cycles:
            measured += 1
            assert_as_python(state)
    assert measured > 3
    browser.open(page, state["address"])
    assert browser.drawn()["u"] == state["u"]
    before = state["input"]["reversals"]
    browser.value(
        "document.getElementById('loop').dispatchEvent(new MouseEvent('click', {clientX: 700, clientY: 300}))"
    )
    *others, last = browser.drawn()["input"]["reversals"]
    assert others == before
    low, high = browser.value("window.hysim.limits[0]")
    assert low <= last <= high
    browser.value("document.getElementById('shorter').click()")
    assert browser.drawn()["input"]["reversals"] == before
    browser.value(
        "(() => { const box = document.getElementById('reversals'); box.value = '1, x';"
        " box.dispatchEvent(new Event('change')); })()"
    )
    assert browser.drawn()["input"]["reversals"] == before
    assert browser.value("document.getElementById('reversals').ariaInvalid") == "true"


@in_a_browser
def test_a_film_of_the_input_runs_until_it_is_paused_and_its_moment_is_in_the_address(browser, tmp_path):
    page = to_page(hs.Play(), tmp_path / "page.html")
    browser.open(page)
    browser.value("document.getElementById('play').click()")
    wait_for(lambda: 0.01 < browser.value("window.hysim.passed") < 1.0)
    assert browser.value("document.getElementById('play').textContent") == "Pause"
    browser.value("document.getElementById('play').click()")
    state = browser.drawn()
    browser.open(page, state["address"])
    assert browser.drawn()["moment"] == state["moment"] < len(state["u"]) - 1


@in_a_browser
def test_no_model_of_the_explorer_is_wider_than_a_telephone(browser, models, tmp_path):
    browser.size(TELEPHONE)
    browser.open(explorer(tmp_path / "explorer.html"))
    for place, name in enumerate(models):
        browser.choose("model", str(place))
        browser.choose("kind", "reversals")
        assert browser.value("document.documentElement.scrollWidth") <= TELEPHONE, name
    browser.size(WIDE)


@in_a_browser
@pytest.mark.parametrize("width", [TELEPHONE, WIDE])
def test_nothing_is_wider_than_the_window(browser, tmp_path, width):
    browser.open(to_page(LAW, tmp_path / "page.html", hs.datasets.table1()))
    browser.size(width)
    assert browser.value("document.documentElement.scrollWidth") <= width
    assert browser.value(
        "[...document.querySelectorAll('input, select')].every(each => each.labels.length || each.ariaLabel)"
    )
    browser.size(WIDE)
