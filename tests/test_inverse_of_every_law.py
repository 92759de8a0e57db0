"""The inverse of every law that has one, as the feed-forward that closes a loop by itself, and what it copies."""

import numpy as np
import pytest
from numba import njit
from strategies import assert_refused

import hysim as hs
from hysim._basics.frozen import checked
from hysim.kernels.stepping import drive
from hysim.models.inverse_search import inverse_step, searched_inverse
from hysim.models.model import every_family
from hysim.plants.actuator import is_law

CLOSE = 1e-10  # of the range of the reference
H = 1.0  # s
LINE = hs.Line(slope=1.0)
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.5, 0.3), offset=0.1)


@njit
def stiffening(parameters, state, u):
    """A play beside a cubic spring."""
    state[1] = min(max(state[1], u - parameters[1]), u + parameters[1])
    state[0] = u
    return parameters[0] * u + 0.1 * u**3 + 0.4 * state[1]


LAWS = {
    "BoucWen": hs.BoucWen(beta=0.6, gamma=0.3, feedthrough=1.0, gain=0.4, offset=-0.1, z0=0.2),
    "BoucWen, n = 2": hs.BoucWen(n=2.0, feedthrough=1.0, gain=-0.4),
    "BoucWen, n = 1.6": hs.BoucWen(n=1.6, feedthrough=-1.0, gain=0.4),
    "PolynomialBoucWen": hs.PolynomialBoucWen(beta=0.4, gamma=0.4, gain=0.3, input_coefficients=(0.6, 0.1, 0.02)),
    "ZhuWangBoucWen": hs.ZhuWangBoucWen(delta=0.1, n=1.5, input_coefficients=(2.0, 0.1)),
    "GeneralizedBoucWen": hs.GeneralizedBoucWen(n=1.5, gain=-0.3, input_coefficients=(1.0,)),
    "BoucWenBaberNoori": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1, input_coefficients=(1.0,)),
    "Duhem": hs.Duhem.from_terms({"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}, feedthrough=2.0),
    "Dahl": hs.Dahl(stiffness=2.0, coulomb=4.0),
    "ColemanHodgdon": hs.ColemanHodgdon(alpha=0.8, c=1.0, B=0.7),
    "VaianaRosati": hs.VaianaRosati(k_b=1.0, f_0=0.3, alpha=(3.0, 2.0), beta_1=0.1, beta_2=1.0, gamma_1=0.2),
    "MenegottoPinto": hs.MenegottoPinto(hardening=0.2, a1=0.05, offset=0.1, z0=0.2),
    "Bilinear": hs.Bilinear(hardening=0.2, yield_input=0.3, isotropic=0.1, offset=0.1, z0=0.2),
    "FlagShape": hs.FlagShape(hardening=0.5),
    "Slack": hs.Slack(opposite_stiffness=2.0, slack=-9.0, yield_input=5.0, hardening_ratio=0.2),
    "OriginOriented": hs.OriginOriented(hardening=0.5),
    "PeakOriented": hs.PeakOriented(hardening_ratio=0.5),
    "IbarraMedinaKrawinkler": hs.IbarraMedinaKrawinkler(
        hardening_ratio=0.5, pinch_force=0.5, **dict.fromkeys(("Lambda_s", "Lambda_c", "Lambda_k", "Lambda_a"), 9.0)
    ),
    "FolzFiliatrault": hs.FolzFiliatrault(r_1=0.5, r_4=0.2),
    "JilesAtherton": hs.JilesAtherton(Ms=1.0, a=0.4, alpha=0.5, k=0.3, gain=1.0, feedthrough=0.2, offset=0.1),
    "Line": hs.Line(offset=0.2, slope=-0.7),
    "PrandtlIshlinskii": PLAYS,
    "ModifiedPrandtlIshlinskii": hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), dead_zones=(-0.4, 0.0, 0.3), dead_zone_weights=(0.2, 1.0, 0.4)
    ),
    "GeneralizedPrandtlIshlinskii": hs.GeneralizedPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), left=(1.0, 1.0, 0.0, 0.0, 0.5)
    ),
    "RateDependentPrandtlIshlinskii": hs.RateDependentPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), beta=0.1
    ),
    "ParametricPrandtlIshlinskii": hs.ParametricPrandtlIshlinskii(
        exponent=-0.5, decay=0.3, weight=0.4, weight_slope=0.1, input_coefficients=(1.0, 0.05, 0.05), reach=2.0
    ),
    "MaxwellSlip": hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(9.0, 0.4)),
    "Stop": hs.Stop(threshold=9.0),
    "Play": hs.Play(threshold=0.0, gain=2.0),
    "Preisach": hs.Preisach.from_density(np.linspace(-3.0, 3.0, 8), lambda a, b: 1.0 + 0.1 * (a - b)),
    "Preisach, falling": hs.Preisach.from_density(np.linspace(-3.0, 3.0, 8), lambda a, b: -1.0 + 0.0 * a),
    "Tellinen": hs.Tellinen(saturation=2.0, coercivity=0.4, squareness=0.6, feedthrough=0.5, offset=0.1, z0=0.3),
    "TellinenTable": hs.TellinenTable(
        inputs=(-2.0, -1.0, 0.0, 1.0, 2.0),
        lower=(-1.0, -0.9, -0.5, 0.6, 1.0),
        upper=(-1.0, -0.6, 0.5, 0.9, 1.0),
        feedthrough=0.3,
    ),
    "TabulatedDahl": hs.TabulatedDahl(
        inputs=(-2.0, 0.0, 2.0), centre=(-2.0, 0.0, 2.0), amplitude=(0.1, 0.2, 0.1), rate=2.0
    ),
    "Chan": hs.Chan(saturation=2.0, coercivity=0.4, squareness=0.6, feedthrough=0.5, offset=0.1, z0=0.3),
    "Chan, behind a gap": hs.Chan(saturation=9.0, coercivity=0.4, squareness=0.6, feedthrough=0.5, gap=0.4),
    "EnergyPlays": hs.EnergyPlays(thresholds=(0.0, 0.2), weights=(2.0, 3.0), field=0.8, feedthrough=0.2),
    "Sum": hs.Dahl(coulomb=0.5) + PLAYS + LINE,
    "Cascade": hs.BoucWen(n=1.6, feedthrough=1.0, gain=0.4) >> PLAYS,
    "CustomLaw": hs.CustomLaw(step=stiffening, parameters={"slope": 1.0, "r": 0.2}, state={"z": 0.0}),
}
REFUSED = {
    "ReversalFilter": (hs.ReversalFilter(threshold=0.2), ValueError, "does not rise or fall"),
    "Play": (hs.Play(threshold=0.2), ValueError, "does not rise or fall"),
    "PreisachRelays": (hs.PreisachRelays(levels=(-1.0, 0.5, 1.0), weights=(1.0, 0.5, 1.0)), ValueError, "does not"),
    "SingleValued": (hs.SingleValued(u=[0.0, 1.0], y=[0.0, 2.0]), TypeError, "that a loop can step"),
    "Dashpot": (hs.Dashpot(), TypeError, "that a loop can step"),
    "ExcessLoss": (hs.ExcessLoss(), TypeError, "that a loop can step"),
    "a dashpot in a sum": (hs.Dashpot() + LINE, TypeError, "loop can step"),
    "PrandtlIshlinskii": (hs.PrandtlIshlinskii(thresholds=(0.2,), weights=(1.0,)), ValueError, "no inverse"),
    "ModifiedPrandtlIshlinskii": (
        hs.ModifiedPrandtlIshlinskii(
            thresholds=(0.0,), weights=(1.0,), dead_zones=(-0.3, 0.3), dead_zone_weights=(1.0, 1.0)
        ),
        ValueError,
        "no inverse",
    ),
    "GeneralizedPrandtlIshlinskii": (
        hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0, 1.0), weights=(1.0, -2.0)), ValueError, "one sign",
    ),
    "Preisach": (hs.Preisach(levels=(0.0, 1.0, 2.0), weights=(1.0, -2.0, 1.0)), ValueError, "one sign"),
    "an even law": (hs.PolynomialBoucWen(gain=0.0, input_coefficients=(0.0, 1.0)), ValueError, "slope is zero"),
}  # fmt: skip
families = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


def reversing(law, u0, n=240):
    """A reference inside the reach of the law, with reversals of all sizes, and the input that has it."""
    s = np.linspace(0.0, 6.0 * np.pi, n)
    u = u0 + 0.8 * np.sin(s) * np.cos(0.13 * s) + 0.3 * np.sin(3.1 * s) - 0.02 * s
    start = {"sample_time": H} if isinstance(law, hs.RateDependentPrandtlIshlinskii) else {}
    return law.response(np.append(u0, u), **start)[1:], u


def test_every_family_has_its_case():
    laws = {name for name, each in every_family().items() if is_law(each) and each.__module__.startswith("hysim.")}
    assert laws <= {name.split(",")[0] for name in (*LAWS, *REFUSED)}


@families
@pytest.mark.parametrize("u0", [0.0, 0.3])
def test_the_response_is_the_reference_a_sample_later(law, u0):
    reference, u = reversing(law, u0)
    run = hs.close_loop(law, hs.InverseFeedforward(law=law), H * np.arange(u.size), reference, u0=u0)
    assert np.abs(run.y[1:] - reference[:-1]).max() <= CLOSE * np.ptp(reference)
    assert np.abs(run.u - u).max() <= 1e-9 * np.ptp(u)  # slopes are above 0.1
    assert run.conditions["limited_samples"] == 0


@families
def test_after_a_limit_it_continues_rightly(law):
    """The copy of the law in the inverse is limited with the law."""
    reference, u = reversing(law, 0.0)
    low, high = -0.7, 0.6
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=(low, high))
    run = hs.close_loop(law, controller, H * np.arange(u.size), reference)
    free = (run.u > low) & (run.u < high)
    assert 0.2 < free.mean() < 0.9
    assert (run.u[~free] == np.clip(run.command, low, high)[~free]).all()
    assert np.abs(run.y[1:] - reference[:-1])[free[:-1]].max() <= CLOSE * np.ptp(reference)


@families
def test_with_creep_and_an_amplifier(law):
    plant = hs.Actuator(amplifier=hs.Amplifier(gain=-2.0, offset=0.1), hysteresis=law, creep=hs.Creep.per_decade(1.0))
    reference, u = reversing(law, 0.1)
    run = hs.close_loop(plant, hs.InverseFeedforward.of(plant), H * np.arange(u.size), reference)
    assert np.abs(run.y[1:] - reference[:-1]).max() <= CLOSE * np.ptp(reference)


@pytest.mark.parametrize(("law", "error", "message"), REFUSED.values(), ids=REFUSED)
def test_what_has_no_inverse_is_refused(law, error, message):
    assert_refused(message, hs.InverseFeedforward, error=error, law=law)


def test_a_rate_too_high_for_an_inverse_is_refused():
    law = LAWS["RateDependentPrandtlIshlinskii"]
    t = 1e-3 * np.arange(5)
    assert_refused(r"no stable inverse at this sample time", hs.close_loop, law, hs.InverseFeedforward(law=law), t, t)


@pytest.mark.parametrize("name", ["BoucWen", "Dahl", "Preisach", "Sum", "Stop"])
def test_an_output_without_an_input_is_nan_and_the_copy_stays_or_waits_at_its_limit(name):
    law = {**LAWS, "Sum": hs.Dahl(coulomb=0.5) + hs.Stop(threshold=9.0), "BoucWen": hs.BoucWen(gain=2.0)}[name]
    for limits, place in (((-np.inf, np.inf), 0.25), ((-0.5, 0.5), 0.5)):
        step, parameters, state = inverse_step(law, 0.25, limits)
        y0 = state[1]
        assert np.isnan(step(parameters, state, 1e9))
        assert state[0] == place
        assert step(parameters, state, state[1]) == place
        assert step(parameters, state, y0 + 0.01) < 0.5


# --------------------------------------------------- what a searched inverse copies: the memory alone, to the same bits


rng = np.random.default_rng(3)
U = np.concatenate([np.sin(np.linspace(0.0, 9.0, 90)), np.cumsum(0.1 * rng.normal(size=60)), [0.0, 2.0, -2.0]])
SLIPS = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(1.0, 0.5, 0.3))
GENERAL = hs.GeneralizedBoucWen(n=1.5, b2=0.05, b4=0.1, b6=-0.1, gain=-0.3, input_coefficients=(1.0,))
SURE = {
    "generalised": GENERAL,
    "generalised, n = 1": hs.GeneralizedBoucWen(b3=0.1, gain=0.3, input_coefficients=(1.0,)),
    "plain Baber and Noori": hs.BoucWenBaberNoori(n=1.5, input_coefficients=(1.0,)),
    "sum": hs.BoucWen(n=1.5, gain=-0.4) + SLIPS + hs.Line(slope=0.5),
    "falling sum": hs.Dahl(coulomb=0.5) + hs.Line(slope=-3.0),
    "cascade": hs.BoucWen(n=1.6, feedthrough=1.0, gain=0.4) >> SLIPS >> GENERAL,
    "nested": (hs.BoucWen(n=2.5) + hs.Line(slope=1.0)) >> (SLIPS + hs.ColemanHodgdon(alpha=0.8, c=1.0, B=0.7)),
}
UNSURE = {
    "Zhu and Wang": hs.ZhuWangBoucWen(n=1.5, delta=0.1, input_coefficients=(2.0, 0.1)),
    "worn": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1, input_coefficients=(1.0,)),
    "stops": hs.BoucWen(n=1.5, feedthrough=0.2) + hs.Stop(threshold=0.2, gain=-0.3),
    "growing": hs.GeneralizedBoucWen(beta=0.2, gamma=-0.4, input_coefficients=(3.0,)),
    "cubic": hs.PolynomialBoucWen(input_coefficients=(1.0, 0.0, 0.1)) + hs.Line(slope=0.1),
}


def is_sure(inverse):
    return bool(inverse.parameters[2])


@pytest.mark.parametrize("name", [*SURE, *UNSURE])
def test_it_has_the_bits_of_a_search_that_copies_everything_and_trusts_nothing(name):
    law = {**SURE, **UNSURE}[name]
    y = law.response(U)
    cheap, dear = searched_inverse(law, law.compiled(U[0])), searched_inverse(None, law.compiled(U[0]))
    assert (is_sure(cheap), is_sure(dear)) == (name in SURE, False)
    assert cheap.state.size <= dear.state.size
    ours, theirs = np.empty(U.size), np.empty(U.size)
    assert drive(cheap.step, cheap.parameters, cheap.state, y, ours) == -1
    assert drive(dear.step, dear.parameters, dear.state, y, theirs) == -1
    np.testing.assert_array_equal(ours, theirs)
    assert ours == pytest.approx(U, abs=1e-10)


@pytest.mark.parametrize("name", SURE)
def test_no_input_has_another_slope_than_the_known_ones(name):
    law = SURE[name]
    low, high = law.known_slopes
    for scale in (0.01, 1.0, 30.0):
        u = scale * np.cumsum(np.random.default_rng(8).normal(size=2000))
        slopes = np.diff(law.response(u)) / np.diff(u)
        assert low - 1e-9 <= slopes.min()
        assert slopes.max() <= high + 1e-9


@pytest.mark.parametrize("seed", range(40))
def test_known_slopes_of_generalised_laws_bound_those_of_random_inputs(seed):
    draw = np.random.default_rng(seed)
    sectors = dict(zip(("b2", "b3", "b4", "b5", "b6"), draw.uniform(-0.4, 0.4, 5).tolist(), strict=True))
    shape = {"A": draw.uniform(0.2, 2.0), "beta": draw.uniform(-0.2, 1.0), "gamma": draw.uniform(-0.5, 1.0)}
    law = hs.GeneralizedBoucWen(**sectors, **shape, n=draw.uniform(0.6, 3.0), z0=draw.uniform(-2.0, 2.0))
    low, high = law.known_slopes
    u = np.cumsum(draw.normal(size=3000) * draw.choice([0.05, 1.0], 3000))
    if np.isfinite([low, high]).all():
        slopes = np.diff(law.response(u)) / np.diff(u)
        assert low - 1e-9 <= slopes.min()
        assert slopes.max() <= high + 1e-9


def test_most_generalised_laws_near_a_bouc_wen_law_know_their_slopes():
    known = [hs.GeneralizedBoucWen(beta=0.6, gamma=0.3, b2=b, b6=-b).known_slopes for b in np.linspace(-0.2, 0.2, 9)]
    assert np.isfinite(known).all()


@checked
class Counting(hs.Law):
    """A line that counts its evaluations in its workspace."""

    slope: float = 1.0
    known: float = 0.0

    initial = ()
    workspace = 1

    @staticmethod
    def step(parameters, state, u):
        state[0] = u
        state[1] += 1.0
        return parameters[0] * u + 0.01 * u**3

    @property
    def known_slopes(self):
        return (self.slope, 2.0 * self.slope) if self.known else super().known_slopes


def test_a_law_that_knows_its_slopes_is_evaluated_half_as_often():
    counts = []
    for law in (Counting(), Counting(known=1.0)):
        inverse = law.compiled_inverse(0.0)
        before, y = inverse.state[5], law.response(U)
        u = np.array([inverse.step(inverse.parameters, inverse.state, each) for each in y])
        assert u == pytest.approx(U, abs=1e-12)
        counts.append((inverse.state[5] - before) / U.size)
    assert counts[1] < 13.0 < 2.0 * counts[1] < counts[0]
