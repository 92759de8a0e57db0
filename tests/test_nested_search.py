"""A larger family never fits worse than a family that it contains, and says what its stages are good for."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import hysim as hs
from hysim.identification._assumptions import decided
from hysim.identification._problem import Setting, problem, problems
from hysim.identification._search import optima, polish
from hysim.models.law import Law
from hysim.models.model import every_family
from hysim.models.search_space import Freedom

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
@pytest.mark.parametrize("name", ["GeneralizedBoucWen", "PolynomialBoucWen"])
def test_a_larger_family_never_fits_worse(name, of):
    """Though its search has one random point beside the start that the simpler family gives."""
    *_, larger = problems(PAIRS[name](), [RECORDS[of][::2]], Freedom(), None)
    alone = replace(larger.space, starts=larger.space.starts[:0], screened=1)
    known = optima(larger.simpler, seed=0)
    floor = (1e-9 * larger.scale) ** 2 * larger.y.size  # both fits are exact, to the rounding of the memory
    best = optima(replace(larger, space=alone), seed=0, known=known)[0]
    assert best.cost <= known[0].cost * (1.0 + ROUNDING) + floor


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
    record = RECORDS["noise"]
    fit = hs.identify(hs.BoucWenBaberNoori, record)
    assert "the BIC leaves out wear, pinching and lambda_" in fit.message
    assert fit.estimates["delta_nu"] == fit.estimates["zeta_s"] == 0.0
    assert "zeta_s" not in fit.free_names

    fit = hs.identify(hs.BoucWenBaberNoori, RECORDS["pinching"])
    assert "the BIC keeps wear and pinching and leaves out lambda_" in fit.message
    assert {"delta_nu", "zeta_s", "psi"} <= set(fit.free_names)
    assert not {"lambda_", "delta_a"} & set(fit.free_names)


def test_the_spread_of_the_pinching_is_freed_where_the_record_shows_it():
    u = hs.signals.growing_sine(1.0, cycles=5, samples_per_cycle=60)
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
