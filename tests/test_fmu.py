"""A functional mock-up unit describes the model, is the same bytes each time, and does in FMPy what the law does."""

import ctypes
import dataclasses
import math
import re
import shutil
import struct
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from square_dahl import SquareDahl
from strategies import COMPILER, assert_refused, needs_compiler

import hysim as hs
from hysim.export import _compilers, _fmu
from hysim.export._program import Field, Program, field_unit
from hysim.models.protocols import needs_time

VERSIONS = ("2.0", "3.0")
LAW = hs.Dahl(stiffness=2.0, coulomb=0.5, offset=0.1, z0=0.2)
DAHL = """
static void dahl_pack(const double *fields, double *parameters, double *state)
{
    parameters[0] = fields[0];
    parameters[1] = fields[1];
    parameters[2] = fields[2];
    state[1] = fields[3];
}

static void dahl_start(const double *parameters, double *state, double u0)
{
    (void)parameters;
    state[0] = u0;
}

static double dahl_step(const double *parameters, double *state, double u)
{
    const double way = u - state[0], side = way < 0.0 ? -1.0 : 1.0, end = side * parameters[1];

    state[1] = end + (state[1] - end) * exp(-parameters[0] / parameters[1] * fabs(way));
    state[0] = u;
    return parameters[2] + state[1];
}
"""
FIELDS = (Field("stiffness", 2.0, "y/u"), Field("coulomb", 0.5, "y"), Field("offset", 0.1, "y"), Field("z0", 0.2, "y"))
FRICTION = Program(
    source=DAHL,
    step="dahl_step",
    inputs=("u",),
    output="y",
    parameters=np.array([2.0, 0.5, 0.1]),
    state=np.array([0.0, 0.2]),
    start="dahl_start",
    fields=FIELDS,
    pack="dahl_pack",
    memory=2,
)
INTEGRATOR = Program(
    source="static double sum(const double *p, double *s, double r, double m) { return s[0] += p[0] * (r - m); }",
    step="sum",
    inputs=("reference", "measurement"),
    output="command",
    parameters=np.array([0.5]),
    state=np.array([1.0]),
    sample_time=0.01,
)
UNITS = {"u": "mm", "y": "N"}
STEP = 0.1  # s


def driven_by_fmpy(test):
    return needs_compiler(pytest.mark.extra("fmpy")(test))


def of_each_version(test):
    return driven_by_fmpy(pytest.mark.parametrize("version", VERSIONS)(test))


def unit(folder, program=FRICTION, version="2.0", platforms=(), u0=0.0):
    """A unit in a file."""
    path = folder / f"{program.step}{version[0]}.fmu"
    path.write_bytes(_fmu.archive(program, "Friction", version, platforms, UNITS, u0))
    return path


def described(path):
    """Root of the description, and the attributes of the variables by their names."""
    root = ElementTree.fromstring(zipfile.ZipFile(path).read("modelDescription.xml"))
    places = {each: dict(each.attrib) for each in root.find("ModelVariables")}
    for element, attributes in places.items():
        attributes.update({} if (real := element.find("Real")) is None else real.attrib)
    return root, {attributes["name"]: attributes for attributes in places.values()}


@pytest.mark.parametrize("version", VERSIONS)
def test_the_description_names_variables_with_units(tmp_path, version):
    root, variables = described(unit(tmp_path, version=version, u0=0.5))
    assert root.get("fmiVersion") == version
    assert "one communication step late" in root.get("description")
    roles = {name: (each["causality"], each["variability"]) for name, each in variables.items() if name != "time"}
    assert roles == {
        "u": ("input", "continuous"),
        "y": ("output", "continuous"),
        "u0": ("parameter", "fixed"),
        **dict.fromkeys(("stiffness", "coulomb", "offset", "z0"), ("parameter", "tunable")),
    }
    assert [variables[name]["start"] for name in ("u", "u0", "stiffness")] == ["0.5", "0.5", "2.0"]
    assert variables["stiffness"]["unit"] == "N/mm"
    assert ("time" in variables) == (version == "3.0")
    base = {each.get("name"): each.find("BaseUnit").attrib for each in root.find("UnitDefinitions")}
    assert base["N/mm"] == {"kg": "1", "s": "-2", "factor": "1000.0"}
    assert root.find("DefaultExperiment") is None


@pytest.mark.parametrize("version", VERSIONS)
def test_a_sampled_model_says_its_sample_time(tmp_path, version):
    root, variables = described(unit(tmp_path, INTEGRATOR, version))
    assert root.find("DefaultExperiment").get("stepSize") == "0.01"
    assert (variables["sample_time"]["variability"], variables["sample_time"]["start"]) == ("constant", "0.01")
    assert "u0" not in variables
    assert [variables[name]["unit"] for name in ("reference", "measurement", "command")] == ["N", "N", "mm"]
    assert root.find("CoSimulation").get("fixedInternalStepSize") == ("0.01" if version == "3.0" else None)


def test_a_controller_with_preview_says_how_far_ahead_its_reference_is(tmp_path):
    assert "later" not in described(unit(tmp_path, INTEGRATOR))[0].get("description")
    ahead = dataclasses.replace(INTEGRATOR, ahead=7)
    assert "The reference is that of 7 samples later." in described(unit(tmp_path, ahead))[0].get("description")


def test_units_of_parameters_are_those_of_fields_that_the_families_have():
    for name, family in hs.families().items():
        assert family.units.keys() <= {each.name for each in dataclasses.fields(family)}, name
    assert field_unit(hs.Dahl(), "z0") == "y"
    assert field_unit(hs.Chan(), "gap") == "u/y"
    assert field_unit(SquareDahl(), "k") == "y/u"
    assert field_unit(SquareDahl(), "offset") == ""


def test_a_law_whose_numbers_cannot_be_followed_has_no_parameters(tmp_path):
    levels = {"levels": (-1.0, 0.0, 1.0), "weights": (1.0, 0.5, 1.0)}
    fresh, after = hs.Preisach(**levels), hs.Preisach(**levels, z0=(0.5, -0.2))
    units = [described(hs.to_fmu(law, tmp_path / "law.fmu", platforms=()))[1] for law in (fresh, after)]
    assert units[0]["weights[0]"]["variability"] == "fixed"  # outputs at turning points would be those of before
    assert units[1].keys() == {"u", "y", "u0"}


@pytest.mark.parametrize("version", VERSIONS)
def test_equal_models_are_equal_bytes_and_others_have_another_token(tmp_path, version):
    first, again = (unit(tmp_path / name, version=version) for name in ("a", "b") if (tmp_path / name).mkdir() is None)
    assert first.read_bytes() == again.read_bytes()
    assert {each.date_time for each in zipfile.ZipFile(first).infolist()} == {(1980, 1, 1, 0, 0, 0)}
    other = unit(tmp_path, dataclasses.replace(FRICTION, parameters=np.array([2.0, 0.5, 0.2])), version)
    tokens = {described(path)[0].get("guid" if version == "2.0" else "instantiationToken") for path in (first, other)}
    assert len(tokens) == 2
    assert all(token.encode() in zipfile.ZipFile(first).read("sources/Friction.c") for token in tokens - {
        described(other)[0].get("guid" if version == "2.0" else "instantiationToken")
    })  # fmt: skip


@pytest.mark.parametrize("name", ["u", "y", "u0", "time"])
def test_two_variables_of_one_name_are_refused(tmp_path, name):
    clash = dataclasses.replace(FRICTION, fields=(FIELDS[0]._replace(name=name), *FIELDS[1:]))
    assert_refused(f"two variables of the unit would be called '{name}'", unit, tmp_path, clash)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"version": "1.0"}, ValueError, "version must be one of 2.0, 3.0, got '1.0'"),
        ({"name": "my law"}, ValueError, "name must be letters, digits and underscores after a letter, got 'my law'"),
        ({"name": "u\n"}, ValueError, "name must be letters"),
        ({"path": "law.zip"}, ValueError, "a functional mock-up unit is a file .fmu, got 'law.zip'"),
        ({"path": "none/law.fmu"}, OSError, "No such file"),
        ({"platforms": ("amiga",)}, ValueError, "platforms must be one of linux, windows, mac, got 'amiga'"),
        ({"platforms": "linux"}, TypeError, r"platforms must be a sequence such as \('linux',\), got 'linux'"),
        ({"u0": math.nan}, ValueError, "u0 must be finite, got nan"),
        ({"thing": "law"}, TypeError, "str"),
        ({"sample_time": -1.0}, ValueError, "sample_time"),
        ({"units": {"u": 1.0}}, TypeError, "units must be labels by the names u, y and t"),
    ],
)
def test_what_makes_no_unit_is_refused(tmp_path, monkeypatch, arguments, error, message):
    monkeypatch.chdir(tmp_path)
    assert_refused(message, hs.to_fmu, error=error, **{"thing": LAW, "path": "law.fmu", "platforms": (), **arguments})
    assert list(tmp_path.iterdir()) == []


def test_without_a_compiler_there_are_sources_and_a_library_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(_compilers.shutil, "which", lambda _: None)
    monkeypatch.setattr(_compilers, "find_spec", lambda _: None)
    names = zipfile.ZipFile(unit(tmp_path, version="3.0", platforms=None)).namelist()
    assert names == ["modelDescription.xml", "sources/Friction.c", "sources/buildDescription.xml"]
    with pytest.raises(ImportError, match=r"a shared library for mac needs a compiler: pip install 'hysim\[export\]'"):
        unit(tmp_path, platforms=("mac",))


@needs_compiler
def test_an_error_of_the_compiler_is_an_error(tmp_path):
    with pytest.raises(OSError, match=r"could not compile the source for .*error"):
        unit(tmp_path, dataclasses.replace(FRICTION, source="static double"), platforms=None)


@needs_compiler
@pytest.mark.parametrize(("version", "program"), [("2.0", FRICTION), ("3.0", INTEGRATOR)], ids=["law", "controller"])
def test_the_source_compiles_without_a_warning_also_under_a_prefix(tmp_path, version, program):
    (tmp_path / "unit.c").write_bytes(zipfile.ZipFile(unit(tmp_path, program, version)).read("sources/Friction.c"))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-shared", "-fPIC"]
    prefix = f"-DFMI{version[0]}_FUNCTION_PREFIX=axis_"
    command = [COMPILER, *strict, prefix, "unit.c", "-o", "unit.so", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    get_version = vars(ctypes)["CDLL"](str(tmp_path / "unit.so"))[f"axis_fmi{version[0]}GetVersion"]
    get_version.restype = ctypes.c_char_p
    assert get_version().decode() == version


def test_a_universal_file_holds_the_libraries_of_both_processors():
    parts = [struct.pack("<III", 0xFEEDFACF, cpu, sub) + bytes(n) for cpu, sub, n in ((7, 3, 50), (12, 0, 20_000))]
    both = _compilers.universal(parts)
    assert struct.unpack(">II", both[:8]) == (0xCAFEBABE, 2)
    for k, part in enumerate(parts):
        cpu, _, offset, size, alignment = struct.unpack(">IIIII", both[8 + 20 * k : 28 + 20 * k])
        assert (cpu, offset % 2**alignment) == ((7, 12)[k], 0)
        assert both[offset : offset + size] == part


@pytest.mark.extra("ziglang")
def test_zig_compiles_for_systems_that_are_not_here(tmp_path):
    files = zipfile.ZipFile(unit(tmp_path, platforms=("windows", "mac")))
    assert files.read("binaries/win64/Friction.dll")[:2] == b"MZ"
    assert files.read("binaries/darwin64/Friction.dylib")[:4] == b"\xca\xfe\xba\xbe"
    assert b"fmi2DoStep" in files.read("binaries/win64/Friction.dll")


# ------------------------------------------------------------------------------------------------ in FMPy


def driven(path, u, start_values, **options):
    """The output at the communication points of a simulation by FMPy."""
    import fmpy

    t = STEP * np.arange(u.size)
    signals = np.array(list(zip(t, u, strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        path, start_time=0.0, stop_time=t[-1], output_interval=STEP, input=signals, output=["y"],
        start_values=start_values, fmi_type="CoSimulation", **options,
    )  # fmt: skip
    return result["y"]


class Slave:
    """A unit that is called step by step, in both versions by the same names."""

    def __init__(self, path, folder):
        import fmpy
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        model = fmpy.read_model_description(path)
        self.is_2 = model.fmiVersion == "2.0"
        self.references = {each.name: each.valueReference for each in model.modelVariables}
        self.unit = (FMU2Slave if self.is_2 else FMU3Slave)(
            guid=model.guid, unzipDirectory=fmpy.extract(path, folder), instanceName="x",
            modelIdentifier=model.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.unit.instantiate()

    def get(self, name):
        unit = self.unit
        return (unit.getReal if self.is_2 else unit.getFloat64)([self.references[name]])[0]

    def set(self, **values):
        unit = self.unit
        references = [self.references[name] for name in values]
        (unit.setReal if self.is_2 else unit.setFloat64)(references, list(values.values()))

    def start(self, **values):
        self.set(**values)
        if self.is_2:
            self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def outputs(self, u, first=0, step=STEP):
        """Outputs at the ends of steps."""
        y = []
        for k, value in enumerate(np.asarray(u).tolist(), first):
            self.set(u=value)
            self.unit.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
            y.append(self.get("y"))
        return np.array(y)

    def save(self):
        return (self.unit.getFMUstate if self.is_2 else self.unit.getFMUState)()

    def load(self, state):
        (self.unit.setFMUstate if self.is_2 else self.unit.setFMUState)(state)

    def to_bytes(self, state):
        return (self.unit.serializeFMUstate if self.is_2 else self.unit.serializeFMUState)(state)

    def from_bytes(self, data):
        return (self.unit.deSerializeFMUstate if self.is_2 else self.unit.deserializeFMUState)(data)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Units with a library for this machine, by program and version."""
    folder = tmp_path_factory.mktemp("units")
    programs = {"law": FRICTION, "controller": INTEGRATOR}
    return {
        (name, version): str(unit(folder, program, version, platforms=None))
        for name, program in programs.items()
        for version in VERSIONS
    }


@pytest.fixture
def slave(tmp_path, compiled):
    """A function that makes and starts an instance of a unit; it is closed afterwards."""
    made = []

    def make(version, program="law", **values):
        made.append(Slave(compiled[program, version], tmp_path / str(len(made))))
        made[-1].start(**values)
        return made[-1]

    yield make
    for each in made:
        each.unit.freeInstance()


U = 0.3 + np.sin(0.7 * np.arange(120)) * np.linspace(1.0, 0.3, 120)
ALLOWED = 1e-12 * np.ptp(LAW.response(U))  # rounding of exp and of other orders of the operations


@driven_by_fmpy
@pytest.mark.parametrize("program", ["law", "controller"])
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_finds_no_problem(compiled, version, program):
    from fmpy.validation import validate_fmu

    assert validate_fmu(compiled[program, version]) == []


@of_each_version
def test_a_library_exports_the_functions_of_the_standard_and_nothing_else(compiled, tmp_path, version):
    """Those that the standard's header lists; of FMI 2.0 without model exchange."""
    import fmpy

    if shutil.which("nm") is None:
        pytest.skip("the names are listed by nm, which is not here")
    library = next((Path(fmpy.extract(compiled["law", version], tmp_path)) / "binaries").glob("*/*"))
    listed = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True)
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{version[0]}Functions.h").read_text()
    common, _, others = header.partition("Functions for FMI2 for Model Exchange")
    wanted = common + others.partition("Functions for FMI2 for Co-Simulation")[2]
    names = set(re.findall(r"^#define (fmi\d\w+) +fmi\dFullName", wanted, flags=re.MULTILINE))
    assert {line.split()[-1] for line in listed.stdout.splitlines()} == names


@of_each_version
def test_a_simulation_gives_the_response_of_the_law_one_step_late(compiled, version):
    path = compiled["law", version]
    y = driven(path, U, {"u0": U[0]})
    expected = LAW.response(U)
    assert y[0] == pytest.approx(expected[0], abs=ALLOWED)
    np.testing.assert_allclose(y[1:], expected[:-1], rtol=0.0, atol=ALLOWED)
    changed = dataclasses.replace(LAW, stiffness=5.0, z0=-0.1)
    y = driven(path, U, {"stiffness": 5.0, "z0": -0.1, "u0": -2.0})
    np.testing.assert_allclose(y[1:], changed.response([-2.0, *U])[1:-1], rtol=0.0, atol=ALLOWED)


MODELS = {  # functions: a plant compiles its stages, which no collection of tests should wait for
    "wide play that begins beside its first input": lambda: hs.Play(threshold=0.6, z0=3.0),
    "relays": lambda: hs.Preisach(levels=(-1.0, 0.0, 0.5, 1.0), weights=(1.0, 0.5, 1.0, -0.2, 0.3, 0.7)),
    "general exponent": lambda: hs.BoucWen(n=1.4, feedthrough=0.5),
    "family of the user": lambda: SquareDahl(k=3.0, coulomb=0.4),
    "sum": lambda: hs.Dahl(stiffness=2.0) + hs.Play(threshold=0.2),
    "sum with a dashpot": lambda: hs.Dahl(stiffness=2.0) + hs.Dashpot(c=0.1),
    "cascade": lambda: hs.Play(threshold=0.2) >> hs.TransferFunction(num=(2.0,), den=(0.3, 1.0)),
    "mode": lambda: hs.mode(2.0, 0.1),
    "actuator": lambda: hs.Actuator(hysteresis=LAW, creep=hs.Creep.per_decade(1.5), vibration=hs.mode(5.0, 0.1)),
    "oscillator": lambda: hs.BoucWenOscillator(mass=1e-2, damping=0.01, stiffness=1.0, law=hs.BoucWen()),
    "rate-dependent": lambda: hs.RateDependentPrandtlIshlinskii(thresholds=(0.1, 0.4), weights=(1.0, 0.5), beta=0.1),
}


@driven_by_fmpy
@pytest.mark.parametrize("name", MODELS)
def test_units_of_all_kinds_do_what_their_models_do(tmp_path, name):
    """Versions take turns; the simulation begins at the first input."""
    model, version = MODELS[name](), VERSIONS[len(name) % 2]
    timed = needs_time(model)
    path = hs.to_fmu(model, tmp_path / "model.fmu", version, STEP if timed else None)
    y = hs.simulate(model, STEP * np.arange(U.size), U).y
    variables = described(path)[1]
    assert ("sample_time" in variables) == timed
    ours = driven(str(path), U, {"u0": U[0]} if "u0" in variables else {})
    np.testing.assert_allclose(ours[1:], y[:-1], rtol=0.0, atol=1e-12 * np.ptp(y))
    assert ours[0] == pytest.approx(y[0], abs=1e-12 * np.ptp(y))


@driven_by_fmpy
@pytest.mark.parametrize("name", ["sum with a dashpot", "actuator", "rate-dependent"])
def test_a_sampled_unit_has_rested_at_its_start_input(tmp_path, name):
    model, start = MODELS[name](), 1.5
    path = hs.to_fmu(model, tmp_path / "model.fmu", "2.0", STEP)
    y = hs.simulate(model, STEP * np.arange(U.size + 1), [start, *U]).y
    np.testing.assert_allclose(driven(str(path), U, {"u0": start})[1:], y[1:-1], rtol=0.0, atol=1e-12 * np.ptp(y))


CONTROLLERS = {
    "pid": lambda: hs.PID(kp=0.5, ki=2.0, kd=0.01, derivative_filter=0.05, limits=(-0.5, 0.6)),
    "inverse and integral": lambda: hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=hs.BoucWen(feedthrough=0.5)), feedback=hs.PID(ki=1.0), limits=(-1.0, 1.0)
    ),
    "inverse alone": lambda: hs.InverseFeedforward(law=hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.5))),
}


@driven_by_fmpy
@pytest.mark.parametrize("name", CONTROLLERS)
def test_units_of_controllers_do_what_the_controllers_do(tmp_path, name):
    controller = CONTROLLERS[name]()
    path = hs.to_fmu(controller, tmp_path / "controller.fmu", VERSIONS[len(name) % 2], STEP, u0=0.1, y0=0.2)
    ours = Slave(str(path), tmp_path / "unit")
    ours.start()
    theirs = controller.compiled(STEP, 0.1, 0.2)
    scale = np.ptp(U)
    for k, (reference, measurement) in enumerate(zip(U.tolist(), np.roll(U, 2).tolist(), strict=True)):
        values = {"reference": reference, "measurement": measurement}
        ours.set(**{name: value for name, value in values.items() if name in ours.references})
        ours.unit.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
        command = theirs.step(theirs.parameters, theirs.state, reference, measurement)
        assert ours.get("command") == pytest.approx(command, abs=1e-12 * scale)
    ours.unit.freeInstance()


@of_each_version
def test_fmpy_builds_a_unit_from_its_sources(tmp_path, version):
    import fmpy
    from fmpy.build import build_platform_binary

    if shutil.which("cmake") is None:
        pytest.skip("FMPy builds with cmake, which is not here")
    folder = fmpy.extract(str(unit(tmp_path, version=version)), tmp_path / "unit")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    expected = LAW.response(U)
    np.testing.assert_allclose(driven(str(folder), U, {"u0": U[0]})[1:], expected[:-1], rtol=0.0, atol=ALLOWED)


@of_each_version
def test_a_saved_state_continues_with_the_same_bits(slave, version):
    friction = slave(version, u0=0.2)
    friction.outputs(U[:50])
    state = friction.save()
    data = friction.to_bytes(state)
    rest = friction.outputs(U[50:], 50)
    friction.load(state)
    assert friction.outputs(U[50:], 50).tolist() == rest.tolist()
    other = slave(version, u0=9.0, stiffness=7.0)
    other.load(other.from_bytes(data))
    assert other.get("stiffness") == 2.0
    assert other.outputs(U[50:], 50).tolist() == rest.tolist()


@of_each_version
def test_a_state_of_another_model_is_refused(slave, version):
    friction, integrator = slave(version), slave(version, "controller")
    data = friction.to_bytes(friction.save())
    assert_refused("status 3", integrator.from_bytes, data, error=Exception)


@of_each_version
def test_reset_forgets_parameters_and_memory(slave, version):
    friction = slave(version)
    first = friction.outputs(U)
    friction.unit.reset()
    assert friction.get("stiffness") == 2.0
    friction.start(stiffness=4.0)
    assert friction.outputs(U).tolist() != first.tolist()
    friction.unit.reset()
    friction.start()
    assert friction.outputs(U).tolist() == first.tolist()


@of_each_version
def test_a_parameter_that_is_tuned_in_the_course_of_a_simulation_keeps_the_memory(slave, version):
    friction = slave(version, u0=U[0])
    friction.outputs(U[:60])
    friction.set(stiffness=6.0, offset=1.0)
    _, state = LAW.advance(U[:60])
    tuned, _ = dataclasses.replace(LAW, stiffness=6.0, offset=1.0).advance(U[60:], state)
    np.testing.assert_allclose(friction.outputs(U[60:], 60), tuned, rtol=0.0, atol=ALLOWED)
    for refused in ({"u0": 1.0}, {"coulomb": math.nan}, {"y": 1.0}):
        assert_refused("status 3", friction.set, error=Exception, **refused)
    assert friction.get("coulomb") == 0.5


@of_each_version
@pytest.mark.parametrize("u", [math.nan, math.inf])
def test_an_input_that_is_not_finite_is_refused_and_changes_nothing(slave, version, u):
    friction = slave(version)
    before = friction.to_bytes(friction.save())
    friction.set(u=u)
    with pytest.raises(Exception, match="status 3"):
        friction.unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP)
    friction.set(u=0.0)
    assert friction.to_bytes(friction.save()) == before


@of_each_version
@pytest.mark.parametrize(("step", "per_step"), [(0.01, 1), (0.03, 3), (0.0025, 0.25)])
def test_a_sampled_model_runs_at_its_own_sample_time(slave, version, step, per_step):
    """1 + 0.5 k after k samples of a unit error, whatever the communication step."""
    integrator = slave(version, "controller", reference=1.0)
    assert integrator.get("sample_time") == 0.01
    assert integrator.get("command") == 1.5  # at the first sample, which is computed, but not yet done
    for k in range(40):
        integrator.unit.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
        assert integrator.get("command") == 1.0 + 0.5 * math.ceil((k + 1) * per_step)


@of_each_version
def test_a_model_that_diverges_ends_the_simulation(tmp_path, version):
    source = "static double grow(const double *p, double *s, double u) { return s[0] = p[0] * s[0] + u; }"
    program = Program(
        source=source, step="grow", inputs=("u",), output="y", parameters=np.array([1e200]), state=np.array([1.0])
    )
    model = Slave(unit(tmp_path, program, version, platforms=None), tmp_path / "unit")
    model.start()
    assert model.outputs([0.0]).tolist() == [1e200]
    assert_refused("status 3", model.outputs, [0.0], 1, error=Exception)
    model.unit.freeInstance()


# ------------------------------------------------------------------------------------- on the command line


@pytest.fixture
def run(tmp_path, monkeypatch, shell):
    """Run `hysim fmu` in a folder with a law and a record: exit code and standard error."""
    monkeypatch.chdir(tmp_path)
    hs.save(LAW, "law.json", units={"u": "mm", "y": "N"})
    hs.save(hs.PID(kp=1.0), "pid.json")
    Path("loop.csv").write_text("u,y\n0,0\n1,1\n")

    def fmu(*arguments):
        code, out, err = shell("fmu", *arguments)
        assert out == ""
        return code, err

    return fmu


def test_a_unit_is_written_from_the_command_line(run):
    options = ("--version", "3.0", "--platforms", "none", "--u0", "0.5", "--unit", "y=kN", "--name", "Brake")
    assert run("law.json", "--out", "law.fmu", *options) == (0, "")
    root, variables = described("law.fmu")
    assert (root.get("fmiVersion"), root.get("modelName")) == ("3.0", "Brake")
    assert [variables[name]["unit"] for name in ("u", "y", "stiffness")] == ["mm", "kN", "kN/mm"]
    assert variables["u0"]["start"] == "0.5"
    same = hs.to_fmu(LAW, "a.fmu", "3.0", name="Brake", units={"u": "mm", "y": "kN"}, platforms=(), u0=0.5)
    assert same.read_bytes() == Path("law.fmu").read_bytes()
    assert run("pid.json", "--out", "pid.fmu", "--sample-time", "0.01", "--platforms", "none") == (0, "")
    assert described("pid.fmu")[1]["sample_time"]["start"] == "0.01"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("law.json", "--out", "law.zip"), "is a file .fmu, got 'law.zip'"),
        (("law.json", "--out", "none/law.fmu"), "its folder does not exist"),
        (("law.json", "--out", "law.fmu", "--version", "1.0"), "expected 2.0, 3.0, got '1.0'"),
        (("law.json", "--out", "law.fmu", "--platforms", "linux,amiga"), "got 'amiga'"),
        (("law.json", "--out", "law.fmu", "--name", "my law"), "name must be letters"),
        (("law.json", "--out", "law.fmu", "--sample-time", "0"), "'--sample-time': expected a positive number"),
        (("pid.json", "--out", "pid.fmu"), "sample"),
        (("loop.csv", "--out", "law.fmu"), "does not hold a model"),
        (("none.json", "--out", "law.fmu"), "No such file"),
        (("law.json",), "Missing option '--out'"),
    ],
)
def test_what_makes_no_unit_is_refused_in_one_line(run, tmp_path, arguments, message):
    code, err = run(*arguments)
    assert (code, err.count("\n")) == (2, 1)
    assert message in err
    assert not list(tmp_path.glob("*.fmu"))
