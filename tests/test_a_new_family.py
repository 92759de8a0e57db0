"""Two families that hysim does not have take part in every verb: one by its step, one by the slope of two states.

They are `tests/square_dahl.py` and `tests/fading_dahl.py`.
"""

import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from fading_dahl import FadingDahl
from scipy.integrate import solve_ivp
from square_dahl import SquareDahl
from strategies import assert_cut_or_stepped_it_has_the_same_bits, needs_compiler, printed_by_main
from strategies import refused as refused_with

import hysim as hs
from hysim.models.model import FAMILIES

LAWS = {
    "step": SquareDahl(k=3.0, coulomb=0.4, c=0.8, offset=0.1),
    "slope": FadingDahl(k=3.0, coulomb=0.4, fading=0.6, way=0.7, c=0.8, offset=0.1),
}
U = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
T = np.arange(0.0, 4.0, 0.01)


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


def record_of(law, noise=0.0):
    y = law.response(U) + noise * np.random.default_rng(1).normal(size=U.size)
    return hs.Record(u=U, y=y, t=np.arange(U.size) * 0.01)


def equation(law, s):
    """Slopes of the hidden states, of one or two."""
    if isinstance(law, FadingDahl):
        return lambda u, x: law.slope(law, *x, u, s)
    return lambda u, x: [law.k * (1.0 - s * x[0] / law.coulomb) ** 2]


def test_response_is_that_of_the_differential_equation(law):
    u, x = np.array([0.0, 1.0, -0.3, 0.2, -1.0]), [0.0] * (len(law.state_at(0.0)) - 1)
    y = [law.offset]
    for before, after in itertools.pairwise(u):
        way = solve_ivp(equation(law, np.sign(after - before)), (before, after), x, "DOP853", rtol=1e-12, atol=1e-14)
        x = way.y[:, -1]
        y.append(law.offset + law.c * after + x[0])
    assert law.response(u) == pytest.approx(y, abs=1e-10)


def test_more_samples_on_a_branch_change_nothing(law):
    fine = np.interp(np.arange(0.0, U.size - 0.99, 0.125), np.arange(U.size), U)
    assert np.abs(law.remembered(fine)[::8] - law.remembered(U)).max() < 1e-9


def test_cut_or_stepped_it_has_the_same_bits(law):
    assert_cut_or_stepped_it_has_the_same_bits(law, U, 50)
    assert law.offset + law.c * U + law.remembered(U)[:, 0] == pytest.approx(law.response(U), abs=1e-15)


def test_a_batch_has_the_rows_and_their_measures(law):
    sets, y = {**law.scalars, "k": [1.0, 3.0]}, law.response(U)
    assert np.array_equal(law.responses(sets, U)[1], y)
    assert law.responses(sets, U, reduce="area")[1] == pytest.approx(hs.loop_metrics(U, y).area, rel=1e-12)
    assert law.responses(sets, U, reduce="sse", target=y)[1] == 0.0


def test_the_inverse_undoes_the_response(law):
    assert law.inverse_response(law.response(U)) == pytest.approx(U, abs=1e-12 if law is LAWS["step"] else 1e-9)


def test_derivatives_are_those_of_differences(law):
    jacobian = law.response_jacobian(U, ("coulomb", "k"))
    for name in ("coulomb", "k"):
        more, less = (law.with_scalars({name: law.scalars[name] + h}).response(U) for h in (1e-5, -1e-5))
        assert jacobian[name] == pytest.approx((more - less) / 2e-5, abs=1e-6)


def test_derivatives_of_a_law_that_stands_somewhere_are_those_of_its_response(law):
    placed = law.placed(0.5)
    jacobian = placed.response_jacobian(U[:9], ("coulomb",))
    more, less = (placed.with_scalars({"coulomb": law.coulomb + h}).response(U[:9]) for h in (1e-5, -1e-5))
    assert jacobian["coulomb"] == pytest.approx((more - less) / 2e-5, abs=1e-6)


def test_identify_finds_it_with_intervals(law):
    record, start = record_of(law, 1e-3), FadingDahl(way=0.7) if law is LAWS["slope"] else SquareDahl
    fit = hs.identify(start, record)
    for name in ("k", "coulomb", "c", "offset", *(("fading",) if law is LAWS["slope"] else ())):
        assert fit.estimates[name] == pytest.approx(getattr(law, name), abs=5.0 * fit.stderr[name])
        assert 0.0 < fit.stderr[name] < 0.1 * abs(getattr(law, name)) + 1e-3
    assert np.array_equal(fit.residual, record.y - fit.model.response(U))


def test_compare_ranks_it(law):
    assert hs.compare({"mine": law, "line": hs.Line}, record_of(law)).ranked()[0].name == "mine"


def test_it_is_saved_and_printed(law, tmp_path):
    hs.save(law, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == law
    assert "coulomb = 0.4" in str(law)


def test_it_stands_in_sums_and_cascades(law):
    y = law.response(U)
    assert (law + hs.Line(slope=2.0)).response(U) == pytest.approx(y + 2.0 * U, abs=1e-14)
    assert (hs.Line(slope=0.5) >> law).response(2.0 * U) == pytest.approx(y, abs=1e-14)


def test_a_loop_is_closed_around_it(law):
    loop = hs.close_loop(law, hs.PID(kp=0.2, ki=20.0), T, 0.5 * np.sin(2.0 * T))
    assert np.abs(loop.error[100:]).max() < 0.05


def test_its_inverse_is_a_feedforward(law):
    reference = 0.1 + 0.7 * np.sin(2.0 * T)
    loop = hs.close_loop(law, hs.InverseFeedforward(law=law), T, reference)
    assert loop.y[1:] == pytest.approx(reference[:-1], abs=1e-9)  # y is read just before the next command


def height(k: float) -> dict[str, float]:
    """A task of a study: the largest output of the law."""
    return {"height": float(SquareDahl(k=k).response(U).max())}


def test_a_study_varies_it():
    study = hs.sweep(height, {"k": [0.5, 1.0, 2.0]}, workers=1)
    assert (np.diff(study["height"]) > 0.0).all()


@needs_compiler
def test_its_c_has_its_numbers(law, tmp_path):
    in_c = printed_by_main(hs.to_c(law, name="mine"), tmp_path, U)
    assert in_c == pytest.approx(law.response(U), abs=1e-12)


@pytest.mark.extra("ziglang")
def test_its_page_is_written(law, tmp_path):
    assert "coulomb" in hs.to_page(law, tmp_path / "law.html").read_text()


def test_it_is_drawn(law):
    assert hs.plot.loop(hs.simulate(law, T[: U.size], U)).lines


def test_the_command_line_takes_it_by_its_import_path(law, tmp_path, shell):
    """In a process of its own, too, where nothing has imported the family."""
    hs.save_record(record_of(law), tmp_path / "record.csv")
    words = ["--model", f"{type(law).__module__}:{type(law).__name__}", "--json", "--fix", "k=3"]
    code, out, err = shell(*(words := ["identify", str(tmp_path / "record.csv"), *words]))
    assert code == 0, err
    if law is LAWS["step"]:
        path = os.pathsep.join([os.path.dirname(__file__), *filter(None, sys.path)])
        command = [sys.executable, "-m", "hysim", *words]
        done = subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (0, out), done.stderr
    assert "coulomb" in out


def test_functions_of_two_families_have_no_name_in_common():
    """numba links functions of one name, from whatever file of its cache."""
    steps = [family.step.__globals__ for family in (FadingDahl, hs.ZhuWangBoucWen, hs.BoucWenBaberNoori)]
    names = [each[name].__qualname__ for each in steps for name in ("slope", "rates", "follow")]
    assert len(set(names)) == len(names)


def test_a_family_of_a_family_has_its_fields_and_its_functions():
    @hs.family
    class Doubled(FadingDahl):
        factor: float = 2.0

        @staticmethod
        def output(p, z, u):
            return p.factor * (p.offset + p.c * u + z)

    own = LAWS["slope"].arguments
    assert Doubled(**own, factor=3.0).response(U) == pytest.approx(3.0 * LAWS["slope"].response(U), abs=1e-12)


# ---------------------------------------------------------------------------------- what is wrong


def test_a_slope_whose_text_cannot_be_read_is_refused():
    exec("def slope(p, z, u, s):\n    return p.k", names := {})
    with pytest.raises(TypeError, match="source of the slope of Unread"):
        type("Unread", (hs.Law,), {"__annotations__": {"k": float}, "k": 1.0, "slope": staticmethod(names["slope"])})


def refused(p, z, u, s):
    return p.stifness


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"stiffness": float}, "has no parameter 'stifness'"),
        ({"stifness": float, "tolerance": float}, "field 'tolerance'"),
        ({"weights": tuple[float, ...], "stifness": float}, "must be the last field"),
        ({"stifness": float, "output": staticmethod(lambda p, z, u: z)}, "must be a plain function"),
        ({"stifness": float, "output": staticmethod(refused)}, "takes other arguments"),
    ],
)
def test_a_law_that_cannot_be_meant_is_refused_where_it_is_defined(names, message):
    fields = {name: kind for name, kind in names.items() if name != "output"}
    functions = {name: kind for name, kind in names.items() if name == "output"}
    with pytest.raises(TypeError, match=message):
        type("Wrong", (hs.Law,), {"__annotations__": fields, "slope": staticmethod(refused), **functions})


def line(p, z, u, s):
    return p.gain - s * z / p.gain


def helped(p, z, u, s):
    return stiff(p, z, u, s)


LINE, HELPED = staticmethod(line), staticmethod(helped)


def own(name="Own", slope=LINE, *, entered=True, searched=(), **numbers):
    names = {"__annotations__": dict.fromkeys(numbers, float), "slope": slope, "searched": searched, **numbers}
    cls = type(name, (hs.Law,), names)
    return hs.family(cls) if entered else cls


RECORD = hs.Record(u=U, y=hs.Dahl().response(U))


@pytest.fixture(autouse=True)
def families_of_hysim_stay_alone():
    yield
    for name in ("Own", "Bare"):
        FAMILIES.pop(name, None)


test_a_family_with_an_error_is_refused_by_its_cause = refused_with(
    (lambda: own(gain=1.0, at=0.2, z0=0.0), "Own has a field 'at', a name that hysim uses itself"),
    (lambda: own(gain=1.0, memory=0.2, z0=0.0), "Own has a field 'memory'"),
    (lambda: own("Dahl", gain=1.0, z0=0.0), "Dahl is a name of hysim"),
    (lambda: own(gain=1.0, slope=line, z0=0.0), "must be a plain function, under staticmethod"),
    (lambda: own(gain=1.0)().response([0.0, 1.0]), "Own has no field 'z0'"),
    (lambda: own(gain=1.0, z0=0.0, entered=False)().response([0.0, 1.0]), "@hs.family above the class"),
    (
        lambda: hs.identify(own(gain=1.0, z0=0.0, searched=(hs.Parameter("gian", 0.1, 9.0),)), RECORD),
        "no field; did you mean 'gain'",
    ),
    (
        lambda: own(gain=1.0, slope=HELPED, z0=0.0)().response([0.0, 1.0]),
        "the slope of Own does not .* put @numba.njit",
    ),
    (lambda: hs.family(type("Bare", (hs.Law,), {}))().response([0.0, 1.0]), "Bare has no field 'z0'"),
    error=TypeError,
)

test_a_search_of_nothing_and_a_slope_that_is_no_number_are_refused = refused_with(
    (lambda: hs.identify(own(gain=1.0, z0=0.0), RECORD), "Own says in `searched` no parameter to search"),
    (lambda: own(gain=1.0, z0=0.0)(gain=0.0).response([0.0, 1.0]), hs.SimulationError, "or its slope is no number"),
)


def test_a_whole_number_is_a_number():
    assert own(gain=2, z0=0.0)().response([0.0, 0.1])[1] == own(gain=2.0, z0=0.0)().response([0.0, 0.1])[1]


def stiff(p, z, u, s):
    return p.gain * (1.0 - s * z / p.limit)


def jumping(p, z, u, s):
    return (p.rising if z >= 0.0 else p.falling) * (1.0 - s * z)


def jumping_at_zero(p, z, u, s):
    return (p.rising if z > 0.0 else p.falling) * (1.0 - s * z)


def test_a_slope_may_jump_where_the_first_state_is_zero():
    numbers = {"rising": 1.2, "falling": 2.7, "z0": 0.0}
    z1 = 1.0 - np.exp(-1.2)
    crossed = 1.0 - np.log(1.0 + z1) / 1.2
    expected = [0.0, z1, np.exp(2.7 * (-1.0 - crossed)) - 1.0]
    searched = hs.Parameter("rising", 0.01, 100.0, log=True), hs.Parameter("falling", 0.01, 100.0, log=True)
    for slope in (jumping, jumping_at_zero):
        law = own(slope=staticmethod(slope), searched=searched, **numbers)()
        np.testing.assert_allclose(law.response([0.0, 1.0, -1.0]), expected, rtol=0.0, atol=1e-10)
        fit = hs.identify(law, hs.Record(u=U, y=law.response(U)))
        assert dict(fit.estimates) == pytest.approx(numbers, rel=1e-8)


def test_an_output_that_is_not_affine_as_said_is_no_success():
    searched = hs.Parameter("gain", affine=True), hs.Parameter("limit", 0.05, 10.0, log=True)
    family = own(gain=1.0, limit=0.5, z0=0.0, slope=staticmethod(stiff), searched=searched)
    y = family(gain=3.0).response(U) + 2e-3 * np.random.default_rng(0).normal(size=U.size)
    fit = hs.identify(family, hs.Record(u=U, y=y))
    assert not fit.success
    assert any("is the output affine as `searched` says?" in each for each in fit.warnings)


def test_of_an_affine_parameter_only_a_side_that_is_physical_counts():
    """In units of the output's span."""

    def fitted(*sides, **others):
        class Bare(hs.Law):
            offset: float = 0.0
            z0: float = 0.0
            searched = (hs.Parameter("offset", *sides, unit="y", affine=True, **others),)

            @staticmethod
            def slope(p, z, u, s):
                return 1.0

            @staticmethod
            def output(p, z, u):
                return p.offset + z

        fit = hs.identify(hs.family(Bare), hs.Record(u=U, y=30.0 + U - U[0]), initial="rest")
        return fit.estimates["offset"] / np.ptp(U)

    assert fitted(-1.0, 1.0) == pytest.approx(30.0 / np.ptp(U))
    assert fitted(1.0, 3.0, physical=(True, False)) == pytest.approx(30.0 / np.ptp(U))
    assert fitted(1.0, 3.0, physical=(False, True)) == pytest.approx(3.0)


def test_a_model_of_a_class_that_is_defined_anew_says_so():
    before = own(gain=1.0, z0=0.0)()
    own(gain=1.0, z0=0.0)
    with pytest.raises(TypeError, match="of a class that was defined anew"):
        hs.save(before, "own.json")
