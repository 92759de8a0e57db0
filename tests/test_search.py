"""The search of an identification: steps of the descent, laws in place of integrated ones, families in families."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import hysim as hs
from hysim.identification._assumptions import decided
from hysim.identification._descent import Constraint, Descent
from hysim.identification._noise import Gaussian
from hysim.identification._problem import Setting, problem, problems
from hysim.identification._search import optima, polish, sharing
from hysim.identification.likelihood import again
from hysim.identification.marquardt import bounded_steps
from hysim.models.law import Law
from hysim.models.model import every_family
from hysim.models.search_space import Freedom, SearchSpace

# ---------------------------------------------------------------------------------- a step of the descent


LOOP = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)
SETS = 6


@pytest.fixture(scope="module")
def descent():
    """Of a Dahl law: the logarithms of its stiffness and its Coulomb level are searched."""
    y = hs.Dahl(stiffness=5.0, coulomb=2.0).response(LOOP)
    record = hs.Record(u=LOOP, y=y + 0.01 * np.random.default_rng(0).standard_normal(LOOP.size))
    whole = problem(hs.Dahl(), [record], Freedom({}, (), {}), None)
    assert whole.space.coordinates == ("stiffness", "coulomb")
    return Descent(whole, Gaussian(1e-9), whole.y[np.newaxis], np.ones((1, whole.y.size)))


def drawn(descent, seed):
    """Some sets of parameters."""
    rng, space = np.random.default_rng(seed), descent.problem.space
    x = np.log([5.0, 2.0]) + rng.uniform(-1.0, 1.0, (SETS, 2))
    return np.concatenate([x, rng.uniform(0.5, 1.0, (SETS, len(space.linear)))], axis=1)


def named(descent, theta, places):
    """The parameter at each set's place."""
    return descent.problem.named(theta)[np.arange(SETS), places]


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("place", [0, 1])
def test_a_step_is_the_regression_inside_the_box(descent, side, place):
    """A coordinate a little from its side is driven beyond it; the others make the best of the step to the side."""
    theta, rng = drawn(descent, 1), np.random.default_rng(2)
    lower, upper = descent.box()
    near = lower[place] + 1e-3 if side < 0.0 else upper[place] - 2e-3
    theta[:, place] = near
    slopes = rng.standard_normal((SETS, LOOP.size, theta.shape[1]))
    wanted = rng.uniform(-0.1, 0.1, theta.shape)
    wanted[:, place] = side * 0.1
    residual = np.einsum("snk,sk->sn", slopes, wanted) + 1e-3 * rng.standard_normal((SETS, LOOP.size))
    steps = bounded_steps(slopes, residual, np.full(SETS, 1e-18), lower - theta, upper - theta, n_damped=2)
    stepped = np.clip(theta + steps, lower, upper)
    for k in range(SETS):
        best = lsq_linear(slopes[k], residual[k], (lower - theta[k], upper - theta[k]), tol=1e-14).x
        assert stepped[k] - theta[k] == pytest.approx(best, abs=1e-6)
        assert stepped[k, place] == (lower if side < 0.0 else upper)[place]
    assert np.abs(stepped - theta).max() > 0.05


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("factor", [0.5, 0.99, 3.0])
def test_a_constraint_on_a_curved_parameter_is_met_to_rounding(descent, place, factor):
    theta = drawn(descent, 3)
    places = np.full(SETS, place)
    constraint = Constraint(places, factor * named(descent, theta, places))
    assert not descent.keeps(theta, constraint).any()
    restored = descent.restored(theta, constraint, places)
    assert named(descent, restored, places) == pytest.approx(constraint.value, rel=1e-11)
    assert descent.keeps(restored, constraint).all()
    others = [k for k in range(theta.shape[1]) if k != place]
    assert np.array_equal(restored[:, others], theta[:, others])


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_whether_a_constraint_is_kept_does_not_depend_on_the_unit(descent, size):
    theta = drawn(descent, 4)
    theta[:, 0] = np.log(size)
    places = np.zeros(SETS, dtype=int)
    value = named(descent, theta, places)
    assert descent.keeps(theta, Constraint(places, value * (1.0 + 1e-9))).all()
    assert not descent.keeps(theta, Constraint(places, value * (1.0 + 1e-7))).any()


def test_sets_descend_together_as_each_does_alone(descent):
    theta = drawn(descent, 5)
    together = descent.run(theta)
    for k in range(SETS):
        alone = descent.run(theta[k : k + 1])
        assert together.theta[k] == pytest.approx(alone.theta[0], rel=1e-9)  # sums of a batch are rounded otherwise
        assert bool(together.at_rest[k]) == bool(alone.at_rest[0])


def test_a_narrow_bent_valley_is_followed_to_its_end():
    """A saturating loop is fitted by memories that nearly diverge: the curvatures of the cost differ by 1e9.

    The start is where straight steps, with slopes over a millionth of the box, lower the cost by 2 % in 200 steps.
    """
    u = np.concatenate([np.linspace(1.0, -1.0, 64), np.linspace(-1.0, 1.0, 64)[1:]])
    record = hs.Record(u=u, y=np.tanh((u - 0.2 * np.sign(np.diff(u, prepend=2.0))) / 0.3))
    whole = problem(hs.BoucWen(), [record], Freedom({}, (), {}), None)
    start = np.array([[2.348185, -2.371288, 0.636117, 0.17317]])
    (end,) = polish(whole, start)
    assert end.converged
    assert end.cost < 0.02 * whole.costs(start)[0]


# ----------------------------------------------------------------- laws that a search takes in place of integrated ones


N_LAWS, N_SAMPLES = 24, 60


def hostile(seed, **ranges):
    """Parameters of many laws, those of positive ranges drawn by the logarithm."""
    rng = np.random.default_rng(seed)
    own = {
        name: np.exp(rng.uniform(*np.log(pair), N_LAWS)) if pair[0] > 0.0 else rng.uniform(*pair, N_LAWS)
        for name, pair in ranges.items()
    }
    return {"n": np.exp(rng.uniform(np.log(0.5), np.log(10.0), N_LAWS)), "z0": rng.uniform(-0.5, 0.5, N_LAWS), **own}


WEAR = {"beta": (0.0, 4.0), "gamma": (-3.0, 3.0), "delta_nu": (-0.05, 0.3), "delta_eta": (-0.02, 0.3)}
PINCHING = {"zeta_s": (0.1, 0.99), "q": (-0.5, 0.5), "p": (0.1, 50.0), "psi": (0.05, 2.0), "lambda_": (0.05, 2.0)}
LAWS = {
    "ramp": (hs.ZhuWangBoucWen(), hostile(0, beta=(0.0, 4.0), gamma=(-3.0, 3.0), delta=(-1.0, 1.0))),
    "wear": (hs.BoucWenBaberNoori(), hostile(1, **WEAR)),
    "pinching": (hs.BoucWenBaberNoori(), hostile(2, **WEAR | PINCHING | {"gamma": (0.1, 3.0)})),
}


def strokes():
    """An input that crosses zeros of the memory in one sample, and stays near one for many."""
    rng = np.random.default_rng(3)
    return np.concatenate([rng.uniform(-1.5, 1.5, N_SAMPLES), 1e-3 * np.cumsum(rng.standard_normal(N_SAMPLES))])


@pytest.mark.parametrize("of", LAWS)
def test_the_close_law_has_the_output_of_the_law(of):
    law, sets = LAWS[of]
    y, close = (type(each).responses(sets, strokes(), workers=1) for each in (law, law.known_to(1e-8)))
    is_finite = np.isfinite(y).all(axis=1)
    assert np.array_equal(np.isfinite(close).all(axis=1), is_finite)
    assert is_finite.sum() > N_LAWS // 2
    error = np.abs(close[is_finite] - y[is_finite]).max(axis=1) / np.ptp(y[is_finite], axis=1)
    # Each step leaves out 1e-8, of which a law that pinches and grows keeps some hundreds.
    assert 0.0 < error.max() < 1e-5
    assert np.median(error) < 1e-7


def test_a_record_that_turns_at_most_samples_is_searched_on_its_beginning():
    u = np.random.default_rng(4).uniform(-0.5, 0.5, 2500)
    u[[1040, 700]] = -1.0, 1.0
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=u)], Freedom(), None)
    assert whole.thinned(250) is None
    short = whole.beginning(1000)
    assert short is not None
    assert np.array_equal(short.parts[0].record.u, u[:1041])
    grown = u * np.linspace(0.1, 1.0, u.size) ** 4  # has most of its span near its end only
    assert problem(hs.BoucWen(), [hs.Record(u=grown, y=u)], Freedom(), None).beginning(1000) is None


def test_the_beginning_leads_to_the_optimum_of_the_whole_record():
    rng = np.random.default_rng(5)
    u = np.concatenate([[-1.0, 1.0], rng.uniform(-1.0, 1.0, 2200)])
    truth = hs.BoucWen(beta=1.2, gamma=-0.4, n=1.0, gain=0.5, feedthrough=0.3)
    y = truth.response(u) + 0.01 * rng.standard_normal(u.size)
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=y)], Freedom(fixed={"n": 1.0}), None)
    assert whole.beginning(1000) is not None
    true_cost = float(np.sum((truth.response(u) - y) ** 2))
    assert optima(whole, seed=0)[0].cost <= true_cost


# ---------------------------------------------------------------------------------- families that contain another


FAMILIES = {name: cls for name, cls in every_family().items() if cls.__module__.startswith("hysim.")}
PAIRS = {name: cls for name, cls in sorted(FAMILIES.items()) if issubclass(cls, Law) and cls.contains is not None}
ROUNDING = 1e-6  # of the cost: a search ends where a step gains 2e-8 of it


def hostile_records():
    """Name to record: what makes a search end elsewhere."""
    rng = np.random.default_rng(7)
    t = np.linspace(0.0, 3.0, 121)
    u = 30.0 * np.sin(2.0 * np.pi * t + 1.0) * np.interp(t, [0.0, 3.0], [0.3, 1.0])
    stack = hs.BoucWen(beta=0.05, gamma=-0.02, n=1.6, gain=-0.5, feedthrough=1.0, z0=3.0)
    y = stack.response(u)
    noise = rng.standard_normal(u.size)
    minor = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=30)
    minor = np.concatenate([minor, 0.4 + 0.2 * minor, 0.7 + 0.1 * minor])
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.1, 0.2), weights=(0.5, 0.4, 0.3))
    pinched = hs.BoucWenBaberNoori(
        beta=0.5, gamma=0.4, delta_nu=0.002, delta_eta=0.004, zeta_s=0.9, p=0.05, psi=0.3, gain=3.0
    )
    return {
        "mid-cycle": hs.Record(u=u, y=y),
        "noise": hs.Record(u=u, y=y + 0.1 * np.std(y) * noise),
        "minor loops": hs.Record(u=minor, y=stack.response(minor)),
        "few samples": hs.Record(u=u[::6], y=(y + 0.01 * np.std(y) * noise)[::6]),
        "other device": hs.Record(u=minor, y=plays.response(minor) + 0.1 * minor**3),
        "pinching": hs.Record(u=u / 5.0, y=pinched.response(u / 5.0) + 0.02 * noise),
    }


RECORDS = hostile_records()


def test_the_pairs_are_those_that_the_families_declare():
    assert set(PAIRS) == {"PolynomialBoucWen", "GeneralizedBoucWen", "ZhuWangBoucWen", "BoucWenBaberNoori"}


@pytest.mark.parametrize("name", PAIRS)
def test_a_larger_family_has_the_outputs_of_the_simpler_one(name):
    larger = PAIRS[name]()
    simple = larger.simpler()
    law = simple.family.assemble({"beta": 0.7, "gamma": -0.2, "n": 1.4, "gain": -2.0, "offset": 0.3, "z0": 0.1})
    law = law.assemble({"feedthrough": 0.6})
    u = RECORDS["mid-cycle"].u / 10.0
    same = larger.assemble(simple.enlarged(law.scalars)).response(u)
    np.testing.assert_allclose(same, law.response(u), rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("of", RECORDS)
def test_a_larger_family_never_fits_worse(of):
    """Though its search has one random point beside the start that the simpler family gives."""
    with sharing():  # both families contain the same one
        for family in (hs.GeneralizedBoucWen, hs.PolynomialBoucWen):
            *_, larger = problems(family(), [RECORDS[of][::3]], Freedom(), None)
            alone = replace(larger.space, starts=larger.space.starts[:0], screened=1)
            known = optima(larger.simpler, seed=0)
            floor = (1e-9 * larger.scale) ** 2 * larger.y.size  # both fits are exact, to the rounding of the memory
            best = optima(replace(larger, space=alone), seed=0, known=known)[0]
            assert best.cost <= known[0].cost * (1.0 + ROUNDING) + floor, family


def test_a_start_from_the_simpler_family_is_where_that_family_stands():
    records = [RECORDS["mid-cycle"], RECORDS["noise"]]
    for family in PAIRS.values():
        larger = problem(family(), records, Freedom(fixed={"offset": 0.1}), None)
        x = np.array([[0.3, 0.2, np.log(1.5), 0.4, -0.2]])
        assert larger.simpler.space.coordinates == ("loading", "unloading", "n", "z0[0]", "z0[1]")
        begun = larger.begun(x)
        simple = larger.simpler
        for k in range(2):
            expected = larger.enlarged(simple.estimates(simple.completed(x)[0], k))
            reached = larger.parameters(begun, k)
            for name in ("beta", "gamma", "n", "z0"):
                assert reached[name][0] == pytest.approx(expected[name], rel=1e-9), (family, name)


def test_the_criterion_chooses_the_stages_and_the_user_may_ask_for_one():
    fit = hs.identify(hs.BoucWenBaberNoori, RECORDS["noise"])
    assert "the BIC leaves out wear, pinching and lambda_" in fit.message
    assert fit.estimates["delta_nu"] == fit.estimates["zeta_s"] == 0.0
    assert "zeta_s" not in fit.free_names

    fit = hs.identify(hs.BoucWenBaberNoori, RECORDS["pinching"])
    assert "the BIC keeps wear and pinching and leaves out lambda_" in fit.message
    assert {"delta_nu", "zeta_s", "psi"} <= set(fit.free_names)
    assert not {"lambda_", "delta_a"} & set(fit.free_names)


def test_the_spread_of_the_pinching_is_freed_where_the_record_shows_it():
    u = hs.signals.growing_sine(1.0, cycles=4, samples_per_cycle=40)
    pinched = {"delta_nu": 0.02, "delta_eta": 0.02, "zeta_s": 0.9, "q": 0.2, "p": 0.8, "psi": 0.15}
    law = hs.BoucWenBaberNoori(beta=1.5, gamma=0.8, n=1.2, lambda_=0.2, input_coefficients=(0.1,), **pinched)
    fit = hs.identify(hs.BoucWenBaberNoori, hs.Record(u=u, y=law.response(u)))
    assert "the BIC keeps wear, pinching and lambda_" in fit.message
    assert fit.model.lambda_ == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize(
    ("freedom", "law", "stages"),
    [
        (Freedom(), hs.BoucWenBaberNoori(), ["", "wear", "pinching", "lambda_"]),
        (Freedom(fixed={"zeta_s": 0.0}), hs.BoucWenBaberNoori(), ["", "wear"]),
        (Freedom(fixed={"delta_nu": 0.1, "delta_eta": 0.0}), hs.BoucWenBaberNoori(), ["", "pinching", "lambda_"]),
        (Freedom(free=("lambda_",)), hs.BoucWenBaberNoori(), ["lambda_"]),
        (Freedom(fixed={"lambda_": 0.3}), hs.BoucWenBaberNoori(), ["", "wear", "pinching"]),
        (Freedom(bounds={"delta_nu": (0.0, 1.0)}), hs.BoucWenBaberNoori(), ["wear", "pinching", "lambda_"]),
        (Freedom(), hs.BoucWenBaberNoori(delta_eta=0.1), ["wear", "pinching", "lambda_"]),
        (Freedom(), hs.BoucWenBaberNoori(zeta_s=0.5), ["pinching", "lambda_"]),
    ],
)
def test_stages_follow_what_the_user_says(freedom, law, stages):
    candidates = problems(law, [RECORDS["pinching"]], freedom, None)
    assert [each.stage.word for each in candidates] == stages
    names = candidates[-1].space.names
    assert ("lambda_" in names) == (stages[-1] == "lambda_")
    assert not set(freedom.fixed) & set(names)
    for each in candidates:
        parameters = each.parameters(each.space.starts)
        for name, value in freedom.fixed.items():
            assert parameters[name][0] == value
        for name, (lower, upper) in freedom.bounds.items():
            assert lower <= parameters[name][0] <= upper


def test_what_holds_parameters_of_a_family_passes_its_stages_on():
    (held,) = hs.BoucWenBaberNoori.candidates().values()
    chain = decided(held, Setting([RECORDS["pinching"]], Freedom())).problems
    assert [each.stage.word for each in chain] == ["", "wear", "pinching", "lambda_"]
    for each in (*chain, chain[0].simpler):
        assert "n" not in each.space.names
        assert each.space.held["n"] == 1.0
        assert (each.rough() is each) == (each is chain[0].simpler)


def test_a_polish_takes_the_law_itself_only_for_the_costs_of_its_ends(monkeypatch):
    _, worn, *_ = problems(hs.BoucWenBaberNoori(), [RECORDS["pinching"]], Freedom(), None)
    starts = worn.begun(np.array([[0.3, 0.2, np.log(1.2), 0.4], [0.8, -0.3, 0.0, 0.0]])[:, : worn.simpler.n_x])
    pack, taken = hs.BoucWenBaberNoori.pack.__func__, Counter()

    def counted(cls, tables):
        taken[cls.tolerance] += len(tables["n"])
        return pack(cls, tables)

    monkeypatch.setattr(hs.BoucWenBaberNoori, "pack", classmethod(counted))
    assert len(polish(worn, starts)) == len(starts)
    assert taken[hs.BoucWenBaberNoori.tolerance] == len(starts)
    assert taken[1e-8] > 10 * len(starts)


def test_the_close_law_of_a_close_law_is_itself():
    held = next(iter(hs.BoucWenBaberNoori.candidates().values()))
    assert held.known_to(1e-8).known_to(1e-8) == held.known_to(1e-8) != held
    assert hs.BoucWen().known_to(1e-8) == hs.BoucWen()


def test_the_rough_law_of_a_search_is_near_the_law():
    u = RECORDS["pinching"].u
    for own in (
        {},
        {"delta_nu": 0.02, "delta_eta": 0.05, "delta_a": 0.01},
        {"delta_nu": 0.02, "zeta_s": 0.9, "q": 0.2},
    ):
        for n in (1.0, 2.0, 1.4):
            law = hs.BoucWenBaberNoori(beta=0.4, gamma=0.3, n=n, **own)
            y = law.response(u)
            # steps that leave out 1e-4 of the memory, some hundreds of times
            assert np.abs(law.known_to(1e-4).response(u) - y).max() <= 0.02 * np.ptp(y)


# ---------------------------------------------------------------------------------- bounds


U = hs.signals.decaying_sine(1.0, cycles=4, samples_per_cycle=40)


def record(law: hs.Law, noise: float = 0.0) -> hs.Record:
    y = law.response(U)
    return hs.Record(u=U, y=y + noise * np.ptp(y) * np.random.default_rng(3).standard_normal(U.size))


def test_a_box_that_is_too_small_is_widened():
    law = hs.BoucWen(beta=2.0, gamma=0.5, n=0.3, gain=0.7, feedthrough=0.4)
    fit = hs.identify(hs.BoucWen, record(law), fixed={"z0": 0.0})
    assert fit.success
    assert fit.estimates["n"] == pytest.approx(0.3, rel=1e-4)  # noise-free; the box begins at 0.5


def test_a_parameter_that_runs_away_is_no_success():
    known = {"n": 1.0, "beta": 0.05, "gamma": 0.02, "gain": 0.7}
    law = hs.BoucWen(z0=40.0, **known)
    fit = hs.identify(hs.BoucWen, record(law, 1e-3), fixed={"A": 1.0, **known})
    reach = (2.0 * 1.25**4 - 1.0) * np.ptp(U)  # the box from -1 to 1, widened four times
    assert not fit.success
    assert fit.estimates["z0"] == pytest.approx(reach)
    words = f"z0 reached its search bound {reach:.4g}: widen it with bounds="
    assert fit.message.startswith(words)
    assert f"NOT converged: {words}" in fit.summary().splitlines()[0]
    assert words in fit.warnings


def test_where_a_parameter_runs_away_to_does_not_depend_on_the_seed():
    noisy_line = hs.Record(u=U, y=2.0 * U + 0.01 * np.random.default_rng(3).standard_normal(U.size))
    (message,) = {hs.identify(hs.Dahl, noisy_line, seed=seed, admissible=False).message for seed in range(4)}
    assert message.startswith("coulomb reached its search bound")


def test_a_bound_that_was_given_is_the_users():
    law = hs.BoucWen(beta=1.2, gamma=0.4, n=1.5)
    fit = hs.identify(hs.BoucWen, record(law), bounds={"n": (2.0, 3.0)})
    assert fit.success
    assert fit.estimates["n"] == pytest.approx(2.0, rel=1e-12)  # by its logarithm
    assert fit.message.startswith("converged; n is at its given bound 2")


def test_damage_does_not_heal():
    healing = hs.BoucWenBaberNoori(beta=1.5, gamma=0.5, delta_nu=-0.05, delta_eta=-0.05)
    worn = hs.BoucWenBaberNoori(beta=1.5, gamma=0.5, delta_nu=0.1, delta_eta=0.1)
    fixed = {"n": 1.0, "zeta_s": 0.0, "input_coefficients[0]": 0.0}
    fit = hs.identify(worn, record(healing), fixed=fixed)
    assert fit.success
    assert fit.estimates["delta_nu"] == fit.estimates["delta_eta"] == 0.0
    assert "delta_nu is at its physical bound 0" in fit.message
    asked = hs.identify(worn, record(healing), fixed=fixed, bounds={"delta_nu": (-1.0, 1.0), "delta_eta": (-1.0, 1.0)})
    assert asked.estimates["delta_nu"] == pytest.approx(-0.05, rel=1e-3)  # noise-free


@pytest.mark.parametrize(
    ("family", "physical"),
    [
        (hs.Tellinen, {"squareness": (True, True), "z0": (True, True), "coercivity": (False, False)}),
        (hs.JilesAtherton, {"c": (True, True), "Ms": (False, False)}),
        (hs.BoucWenBaberNoori(zeta_s=0.5), {"delta_nu": (True, False), "zeta_s": (True, True), "n": (False, True)}),
        (hs.Play(threshold=0.1, gain=1.0), {"threshold": (True, False), "z0": (False, False)}),
    ],
)
def test_limits_of_physics_are_declared(family, physical):
    family = family() if isinstance(family, type) else family
    space = family.search_space(hs.Record(u=U, y=U))
    assert {name: space.physical.get(name, (False, False)) for name in physical} == physical


def test_only_the_sides_that_are_open_are_widened():
    space = box(physical={"a": (True, False)}, by_user={"b": (False, True)})
    low, high = space.open_sides(np.array([0.0, 1.0, 1.0]))
    assert (low.tolist(), high.tolist()) == ([False] * 3, [False, False, True])
    wider = space.widened(low, high)
    assert wider.lower.tolist() == [0.0, 0.0, 0.0]
    assert wider.upper.tolist() == [1.0, 1.0, 1.25]
    assert wider.regions["half"][1].tolist() == [1.0, 0.5, 1.25]


def box(**kinds) -> SearchSpace:
    lower, upper = np.zeros(3), np.ones(3)
    return SearchSpace(
        coordinates=("a", "b", "c"), lower=lower, upper=upper, starts=0.5 * np.ones((1, 3)), names=("a", "b", "c"),
        columns=(), linear=(), held={}, parameters=lambda x: dict(zip("abc", x.T, strict=True)),
        regions={"half": (lower, np.array([1.0, 0.5, 1.0]))}, **kinds,
    )  # fmt: skip


def test_a_fit_beyond_the_box_is_put_together_again():
    rec = record(hs.BoucWen(beta=2.0, gamma=0.5, n=0.3, gain=0.7, feedthrough=0.4), 1e-3)
    fit = hs.identify(hs.BoucWen, rec, fixed={"z0": 0.0}, max_evaluations=3000)
    assert fit.estimates["n"] < 0.5
    again(fit, [rec], {}, None)  # which raises where its residual is another one
