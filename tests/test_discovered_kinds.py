"""Every kind of law that `discover` can return is printed, stored, typeset, drawn and simulated as it is printed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from discovered import DAHL, LAW, TRUTH, duhem, multisine, record_of, zigzag

import hysim as hs
from hysim import plot
from hysim.cli import main
from hysim.discovery import discover
from hysim.discovery._hidden_memory import Oscillator, Response
from hysim.discovery._oscillator import Search, _Fitted, _tried
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_terms, power_term
from hysim.plants.oscillator_structure import linear_plant

STEP = 1.0 / 750.0
PLANT = {"mass": 2.0, "damping": 10.0, "stiffness": 5e4}
T = STEP * np.arange(256)
U = 60.0 * np.sin(2.0 * np.pi * (20.0 + 20.0 * T / T[-1]) * T)
PERIODIC = 40.0 * (np.sin(2.0 * np.pi * np.arange(128) / 128 * 3.0) + np.cos(2.0 * np.pi * np.arange(128) / 128 * 2.0))

SPRING, DISSIPATIVE, CONSERVATIVE = bouc_wen_terms(1.0)
CUBIC = power_term(True, 3.0, even=False)
OSCILLATORS = {
    "n held": {SPRING: 5e4, DISSIPATIVE: -800.0, CONSERVATIVE: 300.0},
    "n free": dict(zip(bouc_wen_terms(1.3), (5e4, -200.0, 80.0), strict=True)),
    "n below one": dict(zip(bouc_wen_terms(0.7), (5e4, -2000.0, 500.0), strict=True)),
    "two terms": {SPRING: 5e4, DISSIPATIVE: -800.0},
    "lag": {SPRING: 5e4, RELAXATION: -100.0},
    "not of Bouc and Wen": {SPRING: 5e4, DISSIPATIVE: -800.0, CUBIC: -0.5},
    "rate-dependent": {SPRING: 5e4, DISSIPATIVE: -800.0, RELAXATION: -50.0},
    "no structure": {},
}
VERDICTS = {"lag": "linear lag", "rate-dependent": "rate-dependent hysteresis", "no structure": "no structure found"}
LAWS = {
    "memory": (lambda u: LAW.memory(u), {"route": "memory", "library": list(TRUTH)}),
    "output": (lambda u: 5.0 + 40.0 * u - 60.0 * LAW.memory(u), {"route": "output", "library": list(TRUTH)}),
    "Duhem": (duhem(DAHL), {"library": list(DAHL)}),
    "hidden Duhem": (
        hs.Duhem.from_terms({"u'": 1.0, "|u'|": 0.1, "|u'| z": -0.5}, feedthrough=2.0, y0=0.3).response,
        {"route": "output", "library": ["u'", "|u'|", "|u'| z"]},
    ),
    "any exponent": (hs.BoucWen(beta=0.6, gamma=0.2, n=1.6, z0=0.1).memory, {"route": "memory", "degree": 1}),
    "line": (lambda u: 3.0 * u, {"library": ["u'"], "route": "memory"}),
}


def vibrating(law: dict[Term, float], structure: object, u: np.ndarray) -> tuple[hs.OscillatorDiscovery, hs.Record]:
    """The discovery whose law is this one, on the record that it makes."""
    blank = hs.Record(u=u, y=np.ones(u.size), t=STEP * np.arange(u.size))
    oscillator = Oscillator(dict(PLANT), dict(law))
    y = Response(structure, (blank,), {}).outputs([oscillator])[0]
    record = replace(blank, y=y + 1e-6 * np.random.default_rng(0).standard_normal(u.size))
    response, library = Response(structure, (record,), {}), (SPRING, DISSIPATIVE, CONSERVATIVE)
    search = Search(response, library, 0, lambda done, total: None)
    elastic = search._without_memory(linear_plant(structure.motion(record)))
    stderr = dict.fromkeys((*PLANT, *(term.named("z") for term in law)), 1e-3)
    stderr |= {"n": 1e-3} if not all(term.is_polynomial or term.relaxing for term in law) else {}
    fitted = _Fitted(search, oscillator, stderr, search.response.measured - y)
    regression = search.response.regression(oscillator, fitted.residual, search.library)
    return search._described(_tried(fitted, regression), elastic, {}), record


@pytest.fixture(scope="module")
def kinds() -> dict[str, tuple[hs.Discovery, hs.Record]]:
    rest = hs.BoucWenOscillator.structure()
    found = {name: vibrating(law, rest, U) for name, law in OSCILLATORS.items()}
    steady = hs.BoucWenOscillator.structure(initial="periodic", period=128)
    for name in ("n held", "lag", "no structure"):
        found[f"{name}, periodic"] = vibrating(OSCILLATORS[name], steady, np.tile(PERIODIC, 4))
    path = np.concatenate([zigzag(0.0, 1.0, -0.5, 1.5, -2.0, 2.0, -2.0), [-1.0]])
    for name, (response, options) in LAWS.items():
        u = multisine(150) if name == "any exponent" else path
        record = record_of(response, u, noise=0.003)
        found[name] = discover(record, **options), record
    found["unstable"] = replace(found["memory"][0], verdict="unstable", warnings=("It diverges.",)), found["memory"][1]
    return found


NAMES = [*OSCILLATORS, "n held, periodic", "lag, periodic", "no structure, periodic", *LAWS, "unstable"]
WITHOUT_MODEL = ("not of Bouc and Wen", "rate-dependent")


@pytest.mark.parametrize("name", NAMES)
def test_every_kind_is_printed_stored_typeset_and_drawn(name, kinds):
    found, _ = kinds[name]
    if name in OSCILLATORS:
        assert found.verdict == VERDICTS.get(name, "rate-independent hysteresis")
    assert (found.model is None) == (name in WITHOUT_MODEL)
    summary = found.summary()
    assert summary.splitlines()[0] == found.equation
    assert all(f"{key} = {value:.6g}" in summary for key, value in found.initial_states[0].items())
    assert all(f"  {key} = {value:.6g}" in summary for key, value in found.parameters.items())
    assert all(sentence in summary.partition("\nWarnings\n")[2] for sentence in found.warnings)
    assert repr(found).startswith(f"<{type(found).__name__}: ")
    assert "initial state" in str(found)
    back = type(found).from_json(found.to_json())
    assert back == found
    assert back.to_json() == found.to_json()
    assert back.summary() == summary
    assert "'" not in found.latex
    assert "^-" not in found.latex
    plot.selection(found)


@pytest.mark.parametrize("name", NAMES)
def test_every_kind_goes_through_the_command_line(name, kinds, tmp_path, monkeypatch, capsys):
    found, record = kinds[name]
    columns = [record.u, record.y] if record.t is None else [record.u, record.y, record.t]
    np.savetxt(
        tmp_path / "r.csv", np.column_stack(columns), delimiter=",", header="u,y,t"[: 2 * len(columns) - 1], comments=""
    )
    verb = "discover_oscillator" if isinstance(found, hs.OscillatorDiscovery) else "discover"
    monkeypatch.setattr(f"hysim.{verb}", lambda record, **options: found)
    command = ["discover", str(tmp_path / "r.csv"), *["--route", "oscillator"] * (verb == "discover_oscillator")]
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["discovery"]["fields"]["equation"] == found.equation
    files = [tmp_path / "law.json", tmp_path / "loop.svg"]
    code = main([*command, "--out", str(files[0]), "--plot", str(files[1])])
    out, err = capsys.readouterr()
    assert out == found.summary() + "\n"
    if found.model is None:
        assert (code, [file.exists() for file in files]) == (1, [False, False])
        assert err == f"hysim: --out and --plot not written: {found.warnings[0]}\n"
        assert (main([*command, "--out", "-"]), capsys.readouterr().out) == (1, "")
        assert found.warnings[0].startswith("There is no model of this law")
    else:
        assert (code, err) == (0, "")
        assert hs.load_model(files[0]) == found.model


@pytest.mark.parametrize("name", NAMES)
def test_the_model_is_the_law_that_is_printed_from_the_state_that_is_printed(name, kinds):
    found, record = kinds[name]
    if found.model is None:
        assert found.models == ()
        return
    assert found.models == (found.model,)
    y = hs.simulate(found.model, record.t, record.u).y
    # Runge-Kutta's 4 steps a sample for the oscillators here: 1e-5 of the output; half of that for the printed numbers
    close = 2e-4 * float(np.ptp(record.y))
    assert y == pytest.approx(of_the_text(found, record), abs=close)
    assert hs.metrics.rmse(record.y, y) == pytest.approx(found.scores["rmse"], rel=0.05, abs=close)


def of_the_text(found: hs.Discovery | hs.OscillatorDiscovery, record: hs.Record) -> np.ndarray:
    """The output of the law as its names and numbers say, in many small steps."""
    state, numbers = found.initial_states[0], found.parameters
    fine = 64
    u = np.interp(np.arange((len(record) - 1) * fine + 1) / fine, np.arange(len(record)), record.u)

    def slope(rate: float, at: float, z: float) -> float:
        words = {"u'": rate, "|u'|": abs(rate), "u": at, "z": z, "y": z, "|z|": abs(z)}
        total = 0.0
        for name, value in found.coefficients.items():
            for word in name.split():
                base, _, power = word.partition("^")
                value *= words[base] ** float(power or 1) if words[base] else 0.0
            total += value
        return total

    if isinstance(found, hs.Discovery):
        z = [state.get("z0", state.get("y0"))]
        for du, at in zip(np.diff(u), u[:-1], strict=True):
            half = z[-1] + 0.5 * slope(du, at, z[-1])
            z.append(z[-1] + slope(du, at + 0.5 * du, half))
        y = numbers.get("offset", 0.0) + numbers.get("feedthrough", 0.0) * u + numbers.get("gain", 1.0) * np.array(z)
        return y[::fine]
    y, v, z, h = *state.values(), STEP / fine
    out = [y]
    for force in 0.5 * (u[:-1] + u[1:]):
        half = y + 0.5 * h * v, v + 0.5 * h * acceleration(numbers, force, y, v, z), z + 0.5 * h * slope(v, y, z)
        y, v, z = y + h * half[1], v + h * acceleration(numbers, force, *half), z + h * slope(half[1], *half[::2])
        out.append(y)
    return np.array(out)[::fine]


def acceleration(numbers: dict[str, float], force: float, y: float, v: float, z: float) -> float:
    return (force - numbers["damping"] * v - numbers["stiffness"] * y - z) / numbers["mass"]


def test_a_state_is_zero_at_rest_and_not_in_a_steady_motion(kinds):
    assert kinds["n held"][0].initial == "rest"
    assert set(kinds["n held"][0].initial_states[0].values()) == {0.0}
    found = kinds["n held, periodic"][0]
    assert found.initial == "periodic"
    model, state = found.model, tuple(found.initial_states[0].values())
    assert (*model.initial_state, model.law.z0) == state
    assert min(map(abs, state)) > 0.0


def test_initial_states_are_counted_as_parameters_where_they_are_free(kinds):
    found = kinds["memory"][0]
    assert found.n_parameters == len(TRUTH) + (found.initial == "free")
    free = replace(found, initial="free")
    assert f"{free.n_parameters} parameters, 1 of them an initial state\n" in free.summary()
    two = replace(free, initial_states=({"z0": 0.5}, {"z0": -1.0}))
    assert f"{free.n_parameters} parameters, 2 of them initial states\n" in two.summary()
    assert "initial state (free): z0 = 0.5; z0 = -1\n" in two.summary()
    rest = replace(found, initial="rest").summary()
    assert f"{free.n_parameters} parameters\n" in rest
    assert "initial state (rest): z0 = " in rest


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--route", "memory", "--mass", "2"], "--mass is not used by --route memory: leave it out"),
        (["--mass", "2", "--library", "duhem"], "--library is not used by an oscillator: leave it out"),
        (["--route", "oscillator", "--cross-validate", "3"], "--cross-validate is not used by an oscillator"),
        (["--route", "oscillator", "--symmetry", "even"], '--symmetry must be left out or "odd"'),
        (["--library", "u',|u'| z", "--degree", "2"], "--degree is not used with a library of names: leave it out"),
    ],
)
def test_the_command_line_refuses_what_a_verb_does_not_use(options, message, tmp_path, capsys):
    np.savetxt(tmp_path / "r.csv", np.stack([U, U], axis=1), delimiter=",", header="u,y", comments="")
    assert main(["discover", str(tmp_path / "r.csv"), *options]) == 2
    assert message in capsys.readouterr().err


def test_a_known_mass_means_an_oscillator(tmp_path, capsys, kinds, monkeypatch):
    found, record = kinds["n held"]
    arguments = []

    def verb(record, *, seed, mass, degree):
        arguments.append({"mass": mass, "degree": degree, "seed": seed})
        return found

    monkeypatch.setattr("hysim.discover_oscillator", verb)
    columns = np.stack([record.u, record.y, record.t], axis=1)
    np.savetxt(tmp_path / "r.csv", columns, delimiter=",", header="u,y,t", comments="")
    assert main(["discover", str(tmp_path / "r.csv"), "--mass", "2", "--degree", "2"]) == 0
    assert {name: arguments[0][name] for name in ("mass", "degree", "seed")} == {"mass": 2.0, "degree": 2, "seed": 0}
    assert capsys.readouterr().out == found.summary() + "\n"
