"""The parameters of a step as expressions: the numbers of `Law.pack`, in Python, in C and in JavaScript."""

import ctypes
import json
import shutil
import subprocess

import numpy as np
import pytest
from component_rules import PATHS
from strategies import refused

import hysim as hs
from hysim.export._packing import OPERATIONS, Symbol, packing
from hysim.models.law import Law
from hysim.models.model import every_family

PLAYS = {"thresholds": (0.0, 0.2, 0.5), "weights": (1.0, 0.5, 0.3)}
RELAYS = {"levels": (0.0, 1.0, 2.5, 3.0), "weights": (1.0, 0.5, 1.0, -0.2, 0.3, 0.7)}
DUHEM = {"u'": 1.0, "u' u^2": 0.2, "u' |z|": -0.3, "|u'| z": -0.6}
LAWS = {
    "ReversalFilter": hs.ReversalFilter(threshold=0.3),
    "BoucWen": hs.BoucWen(n=1.4, feedthrough=0.5),
    "PolynomialBoucWen": hs.PolynomialBoucWen(n=1.0, input_coefficients=(0.5, 0.1)),
    "ZhuWangBoucWen": hs.ZhuWangBoucWen(n=1.4, delta=0.2),
    "GeneralizedBoucWen": hs.GeneralizedBoucWen(n=1.4, b2=0.1, b6=-0.1),
    "BoucWenBaberNoori": hs.BoucWenBaberNoori(n=1.4, delta_nu=0.1, zeta_s=0.5, q=0.1),
    "Duhem": hs.Duhem.from_terms(DUHEM, feedthrough=0.5, offset=0.1, y0=0.2),
    "PrandtlIshlinskii": hs.PrandtlIshlinskii(**PLAYS),
    "ModifiedPrandtlIshlinskii": hs.ModifiedPrandtlIshlinskii(
        **PLAYS, dead_zones=(-0.4, 0.0, 0.3), dead_zone_weights=(0.2, 1.0, 0.4)
    ),
    "GeneralizedPrandtlIshlinskii": hs.GeneralizedPrandtlIshlinskii(**PLAYS, left=(1.0, 1.0, 0.0, 0.0, 0.5)),
    "ParametricPrandtlIshlinskii": hs.ParametricPrandtlIshlinskii(
        exponent=-0.5, decay=0.3, weight=0.4, reach=2.0, plays=12.0
    ),
    "Play": hs.Play(),
    "Stop": hs.Stop(),
    "MaxwellSlip": hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(9.0, 0.4)),
    "PreisachRelays": hs.PreisachRelays(**RELAYS),
    "Preisach": hs.Preisach(**RELAYS),
    "Tellinen": hs.Tellinen(),
    "TellinenTable": hs.TellinenTable(),
    "Chan": hs.Chan(gap=0.2),
    "EnergyPlays": hs.EnergyPlays(**PLAYS, field=0.3),
    "Dahl": hs.Dahl(),
    "TabulatedDahl": hs.TabulatedDahl(),
    "ColemanHodgdon": hs.ColemanHodgdon(),
    "VaianaRosati": hs.VaianaRosati(f_0=(0.4, 0.3), gamma_1=0.2),
    "MenegottoPinto": hs.MenegottoPinto(a1=0.1),
    "JilesAtherton": hs.JilesAtherton(),
    "Line": hs.Line(slope=1.0),
    **{name: getattr(hs, name)() for name in PATHS},
    "IbarraMedinaKrawinkler": hs.IbarraMedinaKrawinkler(
        **dict.fromkeys(("Lambda_s", "Lambda_c", "Lambda_k", "Lambda_a"), 9.0)
    ),
}
POSITIVE = (
    "n",
    "coulomb",
    "psi",
    "lambda_",
    "decay",
    "reach",
    "beta",
    "gamma",
    "slips",
    "stiffness",
    "left",
    "field",
    "alpha",
)
SIZES = (1e-300, 1e-150, 1e-20, 1e-3, 1.0, 1e3, 1e20, 1e150, 1e300)
CLOSE = 1e-13  # functions of another library: a rounding each


def values_of(law, rng, hostile):
    """Numbers of another law of the family, as large or small as they get where `hostile`."""
    own = packing(law).fields
    values = rng.normal(size=len(own)) * (rng.choice(SIZES, len(own)) if hostile else 1.0)
    base = [name.partition("[")[0] for name in own]
    for k, (name, field) in enumerate(zip(own, base, strict=True)):
        value = abs(values[k]) if field in POSITIVE or field in ("threshold", "thresholds") else values[k]
        value = min(max(value, 1e-3), 50.0) if name == "n" else value
        value = min(value, 3.0) if name == "exponent" else value
        values[k] = max(value, -0.9) if name == "exponent" else value
    for field in ("thresholds", "levels"):
        places = [k for k, each in enumerate(base) if each == field]
        values[places] = np.sort(values[places])
    return values


def test_every_law_is_here():
    laws = {name: family for name, family in every_family().items() if issubclass(family, Law)}
    assert set(LAWS) == {name for name, family in laws.items() if family.__module__.startswith("hysim.")}


def evaluated(expressions, values):
    """Parameters and memory for values of the fields."""
    results = [np.float64(value) for value in values]

    def number(each):
        return results[each.place] if isinstance(each, Symbol) else each

    with np.errstate(all="ignore"):
        for operation, operands in expressions.tape.entries[len(results) :]:
            results.append(OPERATIONS[operation].evaluate(*map(number, operands)))
    return [np.array([number(each) for each in row], float) for row in (expressions.parameters, expressions.memory)]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("hostile", [False, True])
def test_expressions_give_the_bits_of_pack(name, hostile):
    law, rng = LAWS[name], np.random.default_rng(7)
    expressions = packing(law)
    assert expressions.fields == tuple(each for each in law.scalars if each not in law.structural)
    for _ in range(12):
        values = values_of(law, rng, hostile)
        columns = {each: np.array([[value]]) for each, value in zip(expressions.fields, values, strict=True)}
        with np.errstate(all="ignore"):
            parameters, memory = law.pack(law.completed(law.exchanged(columns)))
        for ours, theirs in zip(evaluated(expressions, values), (parameters[0], memory[0]), strict=True):
            np.testing.assert_array_equal(ours, theirs.astype(float))


@pytest.mark.parametrize("name", LAWS)
def test_they_are_those_of_the_law_itself(name):
    law = LAWS[name]
    expressions = packing(law)
    parameters, memory = evaluated(expressions, [law.scalars[each] for each in expressions.fields])
    np.testing.assert_array_equal(parameters, law.packed[0])
    np.testing.assert_array_equal(memory, law.packed[1])


def test_numbers_that_are_not_free_are_constants():
    law = LAWS["BoucWenBaberNoori"]
    few = packing(law, free=("offset", "gain"))
    assert few.fields == ("gain", "offset")
    assert sum(not isinstance(number, float) for number in few.parameters) == 2
    assert packing(law, free=()).parameters == tuple(law.packed[0].tolist())
    assert "(void)fields;" in packing(law, free=()).to_c("pack")


test_what_cannot_be_traced_is_named = refused(
    (LAWS["ParametricPrandtlIshlinskii"], "plays", "plays of this ParametricPrandtlIshlinskii decides"),
    (hs.BoucWen(), "n", "n of this BoucWen decides"),
    (hs.Preisach(**RELAYS, z0=(1.5,)), "z0[0]", r"as expressions of z0\[0\]: .*, and relays must have no z0"),
    (hs.Play(), "slope", "a Play has threshold, gain, offset, z0"),
    call=lambda law, name: packing(law, free=(name,)),
)


def cases():
    """Packings with values of their fields, random and hostile, and what Python makes of them."""
    rng = np.random.default_rng(11)
    for name, law in LAWS.items():
        expressions = packing(law)
        for hostile in (False, True, True):
            values = values_of(law, rng, hostile)
            yield name, expressions, values, np.concatenate(evaluated(expressions, values))


def agree(ours, theirs, name):
    """Equal but for a few roundings; a difference of two is no larger than a rounding of the largest."""
    same = (ours == theirs) | (np.isnan(ours) & np.isnan(theirs))
    with np.errstate(all="ignore"):
        near = np.abs(ours - theirs) <= CLOSE * np.maximum(np.abs(theirs), name.startswith("Parametric"))
    assert (same | near).all(), name


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler is installed")
def test_a_c_compiler_agrees(tmp_path):
    text = "#include <math.h>\n"
    for k, law in enumerate(LAWS.values()):
        text += packing(law).to_c(f"pack_{k}")
        text += f"void entry_{k}(const double *f, double *p, double *s) {{ pack_{k}(f, p, s); }}\n"
    (tmp_path / "pack.c").write_text(text)
    flags = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "pack.c", "-o", "pack.so", "-lm"], cwd=tmp_path, check=True)
    library, numbers = ctypes.CDLL(str(tmp_path / "pack.so")), {name: k for k, name in enumerate(LAWS)}
    for name, expressions, values, expected in cases():
        size = len(expressions.parameters)
        ours = np.full(expected.size, np.nan)
        places = (array.ctypes.data_as(ctypes.c_void_p) for array in (values, ours[:size], ours[size:]))
        library[f"entry_{numbers[name]}"](*places)
        agree(ours, expected, name)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_javascript_agrees(tmp_path):
    text = "".join(packing(law).to_js(f"pack_{name}") for name, law in LAWS.items()) + "const all = [];\n"
    every = list(cases())
    for name, expressions, values, expected in every:
        size = len(expressions.parameters)
        text += f"{{ const p = new Float64Array({size}), s = new Float64Array({expected.size - size});\n"
        text += f"pack_{name}({json.dumps(values.tolist())}, p, s); all.push([...p, ...s].map(String)); }}\n"
    (tmp_path / "pack.js").write_text(text + "console.log(JSON.stringify(all));\n")
    done = subprocess.run(["node", "pack.js"], cwd=tmp_path, check=True, capture_output=True, text=True)
    for (name, *_, expected), ours in zip(every, json.loads(done.stdout), strict=True):
        agree(np.array([float(number.replace("Infinity", "inf")) for number in ours]), expected, name)
