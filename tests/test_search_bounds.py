"""An optimum at a bound: physics has some, the user may give some, and the search leaves its own."""

import numpy as np
import pytest

import hysim as hs
from hysim.identification.likelihood import again
from hysim.models.search_space import SearchSpace

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
        (hs.JilesAtherton, {"c": (True, True), "Ms": (True, False)}),
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
    law = hs.BoucWen(beta=2.0, gamma=0.5, n=0.3, gain=0.7, feedthrough=0.4)
    rec = record(law, 1e-3)
    fit = hs.identify(hs.BoucWen, rec, fixed={"z0": 0.0}, max_evaluations=3000)
    assert fit.estimates["n"] < 0.5
    again(fit, [rec], {}, None)  # which raises where its residual is another one
