"""Laws of cores and measures of their loops: equations as they are written, closed forms, and what follows."""

from dataclasses import replace
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import beta
from strategies import COMPILED, assert_refused, needs_compiled, refused

import hysim as hs
from hysim.metrics import magnetic_metrics

COILS = [
    hs.Chan(saturation=2.0, coercivity=0.4, squareness=0.3, feedthrough=0.1, offset=0.2, z0=-0.4),
    hs.Chan(saturation=2.0, coercivity=0.4, squareness=0.9, gap=0.5, z0=1.0),
    hs.Chan(saturation=1e3, coercivity=1e-3, squareness=0.01, feedthrough=50.0, gap=3.0),
]
CORES = [
    hs.Tellinen(saturation=2.0, coercivity=0.4, squareness=0.3, feedthrough=0.1, offset=0.2, z0=-0.4),
    hs.Tellinen(saturation=-2.0, coercivity=0.6, squareness=0.95, z0=1.0),
    hs.Tellinen(saturation=3.0, coercivity=0.1, squareness=0.02, feedthrough=0.5),
]
CELLS = hs.EnergyPlays(
    thresholds=(0.0, 0.1, 0.4), weights=(0.3, 1.0, 0.5), field=0.2, feedthrough=0.1, offset=-0.2, z0=(0.1, 0.2, -0.1)
)


def walk(seed, n=60, reach=1.0):
    """Strokes of all lengths."""
    rng = np.random.default_rng(seed)
    return reach * np.cumsum(rng.normal(size=n) * 10.0 ** rng.uniform(-3.0, 0.0, n)) - 0.1


def branches_of(law):
    """Upper and lower branch in units of the saturation."""
    if isinstance(law, hs.Tellinen):
        scale = law.coercivity / np.arctanh(law.squareness)
        return tuple(lambda h, c=c: np.tanh((h + c) / scale) for c in (law.coercivity, -law.coercivity))
    knee = law.coercivity * (1.0 / law.squareness - 1.0)
    return tuple(lambda h, c=c: (h + c) / (abs(h + c) + knee) for c in (law.coercivity, -law.coercivity))


def translated(branch, shift):
    """A branch that is moved up."""
    return lambda h: branch(h) + shift


# ---------------------------------------------------------------------------------- equations as they are written


@pytest.mark.parametrize("law", CORES, ids=["flat", "square", "narrow"])
def test_tellinen_obeys_its_differential_equation(law):
    upper, lower = branches_of(law)
    u = walk(1, n=12)

    def slope(h, m, direction):
        apart = upper(h) - lower(h)
        along, distance = (lower, upper(h) - m) if direction > 0 else (upper, m - lower(h))
        return distance / apart * (along(h + 1e-6) - along(h - 1e-6)) / 2e-6

    m = [0.5 * (1.0 + law.z0) * upper(u[0]) + 0.5 * (1.0 - law.z0) * lower(u[0])]
    for before, after in pairwise(u):
        run = solve_ivp(slope, (before, after), [m[-1]], "DOP853", args=(after - before,), rtol=1e-10, atol=1e-11)
        m.append(run.y[0, -1])
    expected = law.offset + law.feedthrough * u + law.saturation * np.array(m)
    # 1e-9: the slope of a branch by differences, and the tolerance of the solver
    np.testing.assert_allclose(law.response(u), expected, atol=1e-9 * abs(law.saturation))


def test_a_fine_table_is_the_law_of_its_branches():
    law = hs.Tellinen(coercivity=0.3, squareness=0.6, z0=0.3, offset=0.2, feedthrough=0.1)
    upper, lower = branches_of(law)
    errors = []
    for nodes in (501, 1001):
        h = np.linspace(-6.0, 6.0, nodes)
        table = hs.TellinenTable(inputs=h, lower=lower(h), upper=upper(h), z0=0.3, offset=0.2, feedthrough=0.1)
        errors.append(np.sqrt(np.mean((table.response(walk(9)) - law.response(walk(9))) ** 2)))
    assert errors[0] < 1e-3
    assert 3.0 < errors[0] / errors[1] < 5.0  # of chords of half the length: 4, but for where they begin


def test_a_table_goes_through_its_loop_and_back_from_where_the_loop_is_closed():
    h, lower, upper = np.arange(5.0), np.array([0.0, 0.0, 1.0, 3.0, 4.0]), np.array([0.0, 2.0, 3.0, 4.0, 4.0])
    table = hs.TellinenTable(inputs=h, lower=lower, upper=upper)
    around = np.concatenate([[9.0], h[::-1], [-9.0], h, [9.0]])
    np.testing.assert_array_equal(table.response(around), [4.0, *upper[::-1], 0.0, *lower, 4.0])


def test_the_table_of_a_measured_loop_has_this_loop():
    law = hs.Tellinen(coercivity=0.3, squareness=0.6, feedthrough=0.1)
    u = hs.signals.triangle(-3.0, 3.0, cycles=2, samples_per_cycle=600)
    record = hs.Record(u=u, y=law.response(u) + 1e-4 * np.random.default_rng(1).normal(size=u.size))
    table = hs.TellinenTable.from_loop(record, nodes=120, feedthrough=0.1)
    assert np.abs(table.response(u) - law.response(u))[600:].max() < 2e-3  # chords and noise
    path = np.concatenate([u, hs.signals.triangle(-0.5, 0.5, cycles=1, samples_per_cycle=80)])
    assert np.abs(table.response(path) - law.response(path))[-80:].max() < 1e-2
    assert_refused("nodes must be at least 3", hs.TellinenTable.from_loop, record, nodes=2)


@pytest.mark.parametrize("law", COILS, ids=["plain", "gap", "steep behind a gap"])
def test_chan_translates_its_branches(law):
    """The field in the core by a search for the root, and the bound by the limiting loop at many places of a stroke."""
    upper, lower = branches_of(law)
    u = walk(2, n=25)

    def field(magnetisation, v):
        def excess(h):
            return h + law.gap * (law.feedthrough * h + law.saturation * magnetisation(h)) - v

        reach = abs(v) + law.gap * law.saturation + 1.0
        return brentq(excess, -reach, reach, xtol=1e-300, rtol=1e-15)

    def between(h):
        return 0.5 * (1.0 + law.z0) * upper(h) + 0.5 * (1.0 - law.z0) * lower(h)

    h = field(between, u[0])
    m, fields, initial = between(h), [h], True
    found = [m]
    for before, after in pairwise(u):
        side = np.sign(after - before)
        along, other = (lower, upper) if side > 0 else (upper, lower)
        initial = initial and side * h >= 0.0 and side == np.sign(u[1] - u[0])
        shift = m - along(h)
        for v in np.linspace(before, after, 9)[1:]:
            path = [field(between, v)] if initial else [field(translated(along, shift), v), field(other, v)]
            ends = [between(path[0])] if initial else [along(path[0]) + shift, other(path[1])]
            kept = 0 if initial or side * (ends[0] - other(path[0])) <= 0.0 else 1
            h, m = path[kept], ends[kept]
            shift = m - along(h)
        found.append(m)
        fields.append(h)
    expected = law.offset + law.feedthrough * np.array(fields) + law.saturation * np.array(found)
    # 1e-12 of the saturation: roundings of 25 strokes of 8 pieces, and the root's
    np.testing.assert_allclose(law.response(u), expected, atol=1e-12 * law.saturation, rtol=1e-12)
    np.testing.assert_allclose(u - law.gap * (law.response(u) - law.offset), fields, atol=1e-12 * law.gap * 1e3 + 1e-12)


@pytest.mark.parametrize(("squareness", "gap"), [(0.99996, 2.9), (1.0 - 1e-9, 3e-3), (0.7, 40.0)])
def test_a_steep_branch_behind_a_gap_has_all_digits(squareness, gap):
    law = hs.Chan(saturation=3.4, coercivity=0.146, squareness=squareness, gap=gap, z0=1.0)
    u = np.array([-8.3e-7, -7.1e-7, 8.6e-7, 1e-3])  # the first is left along the lower branch, moved up
    expected = []
    with mpmath.workdps(60):
        saturation, coercivity, knee = (mpmath.mpf(each) for each in (law.saturation, law.coercivity, law.bend))
        drop, distance = mpmath.mpf(gap) * saturation, None
        for value in map(mpmath.mpf, u):
            if distance is None:
                x = root(value + coercivity, drop, knee)
                below = x - 2 * coercivity
                distance = x / (abs(x) + knee) - below / (abs(below) + knee)
                expected.append(float(saturation * x / (abs(x) + knee)))
            else:
                x = root(value - coercivity - drop * distance, drop, knee)
                expected.append(float(saturation * (x / (abs(x) + knee) + distance)))
    # roundings of the saturation; the field's own rounding times the slope of the branch is up to 1e-7 of it
    np.testing.assert_allclose(law.response(u), expected, rtol=0.0, atol=2e-15 * law.saturation)


def root(v, drop, knee):
    """Solution x of x + drop x / (|x| + knee) = v."""
    half = (abs(v) - knee - drop) / 2
    return mpmath.sign(v) * (half + mpmath.sqrt(half**2 + knee * abs(v)))


def test_energy_plays_are_plays_behind_langevins_curve():
    u = walk(3)
    r, w, z = np.array(CELLS.thresholds), np.array(CELLS.weights), np.array(CELLS.z0)
    expected = []
    for value in u:
        z = np.minimum(np.maximum(z, value - r), value + r)
        x = z / CELLS.field
        expected.append(CELLS.offset + CELLS.feedthrough * value + w @ (1.0 / np.tanh(x) - 1.0 / x))
    # coth x - 1 / x cancels where x is small, here to 1e-13
    np.testing.assert_allclose(CELLS.response(u), expected, atol=1e-12)


@pytest.mark.parametrize("x", [1e-300, 1e-9, 1e-3, 0.5, 0.999999, 1.000001, 3.0, 40.0, 1e9])
def test_langevins_curve_has_all_digits(x):
    with mpmath.workdps(700 if x < 1e-20 else 50):
        expected = float(mpmath.coth(x) - 1 / mpmath.mpf(x))
    law = hs.EnergyPlays(thresholds=(0.0,), weights=(1.0,))
    assert law.response([x])[0] == pytest.approx(expected, rel=1e-15)  # some roundings of coth x beside 1 / x
    assert law.response([-x])[0] == -law.response([x])[0]


def test_cells_of_a_wide_field_are_plays():
    wide = replace(CELLS, field=1e7, weights=tuple(3e7 * w for w in CELLS.weights), feedthrough=0.0)
    plays = hs.PrandtlIshlinskii(thresholds=CELLS.thresholds, weights=CELLS.weights, offset=CELLS.offset, z0=CELLS.z0)
    np.testing.assert_allclose(wide.response(walk(4)), plays.response(walk(4)), atol=1e-12)  # x^2 / 15 of it less


# ---------------------------------------------------------------------------------- invariants


@pytest.mark.parametrize("law", [*CORES, *COILS])
def test_the_loop_stays_between_its_branches_and_rises(law):
    u = walk(5, n=400 if COMPILED else 40)
    upper, lower = branches_of(law)
    y, z = law.response(u), law.memory(u)
    assert np.abs(z).max() <= 1.0
    h = u - law.gap * (y - law.offset) if isinstance(law, hs.Chan) else u
    m = (y - law.offset - law.feedthrough * h) / law.saturation
    tight = 1e-9 * np.maximum(1.0, np.abs(law.feedthrough * h / law.saturation))
    assert (m <= upper(h) + tight).all()
    assert (m >= lower(h) - tight).all()
    slopes = np.diff(y) / np.diff(u)
    low, high = law.known_slopes
    moved = np.abs(np.diff(u)) > 1e-6  # else roundings of the outputs are slopes
    assert (slopes[moved] >= low - 1e-6 * (high - low)).all()
    assert (slopes[moved] <= high + 1e-6 * (high - low)).all()


@pytest.mark.parametrize("law", [CORES[0], COILS[0]])
def test_the_first_place_is_that_between_the_branches(law):
    upper, lower = branches_of(law)
    for z0 in (-1.0, 0.25, 1.0):
        begun = replace(law, z0=z0)
        m = 0.5 * (1.0 + z0) * upper(0.3) + 0.5 * (1.0 - z0) * lower(0.3)
        assert begun.response([0.3])[0] == pytest.approx(0.2 + 0.03 + 2.0 * m, rel=1e-15)
        assert begun.memory([0.3]).tolist() == [z0]


def test_symmetric_loops_of_chan_are_closed_from_the_initial_curve_on():
    law = replace(COILS[0], z0=0.0, offset=0.0)
    upper, lower = branches_of(law)
    y = law.response([0.0, 0.7, -0.7, 0.7, -0.7])
    initial = 0.1 * 0.7 + 2.0 * 0.5 * (upper(0.7) + lower(0.7))
    np.testing.assert_allclose(y, [0.0, initial, -initial, initial, -initial], atol=1e-15)


def test_a_biased_loop_of_chan_creeps_to_the_limiting_loop_and_has_no_area_there():
    law = hs.Chan(coercivity=0.2, squareness=0.4)
    upper, _ = branches_of(law)
    u = np.concatenate([[0.0], hs.signals.triangle(0.3, 0.8, cycles=40, samples_per_cycle=40)])
    y = law.response(u)
    assert (np.diff(y[np.isclose(u, 0.8)]) >= 0.0).all()
    np.testing.assert_allclose(y[-40:], upper(u[-40:]), atol=1e-15)


def test_cells_turn_the_area_of_their_loops_into_heat_and_never_yield_any():
    u = np.concatenate([walk(6), hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=4000)])
    heat = CELLS.dissipated(u)
    assert (np.diff(heat) >= 0.0).all()
    area = hs.magnetic_metrics(u[-4001:], CELLS.response(u)[-4001:]).energy
    assert heat[-1] - heat[-4001] == pytest.approx(area, rel=1e-5)  # the area by 4000 trapezoids


# ---------------------------------------------------------------------------------- spellings of others


def test_an_inductor_of_ltspice_comes_back():
    core = {"Hc": 16.0, "Bs": 0.44, "Br": 0.1, "A": 25.1e-6, "Lm": 19.8e-3, "Lg": 0.6858e-3, "N": 1000.0}
    coil = hs.Chan.from_ltspice(**core)
    back = coil.to_ltspice(A=core["A"], Lm=core["Lm"], N=core["N"])
    assert back == pytest.approx(core, rel=1e-14)
    current = 0.3 * walk(7)
    flux = coil.response(current)
    H = (core["N"] * current - flux / (core["N"] * core["A"]) / 1.25663706212e-6 * core["Lg"]) / core["Lm"]
    ungapped = hs.Chan.from_ltspice(**{name: core[name] for name in ("Hc", "Bs", "Br")})
    np.testing.assert_allclose(ungapped.response(H), flux / (core["N"] * core["A"]), rtol=1e-9, atol=1e-12)


def test_a_core_of_modelica_comes_back():
    core = {"Js": 1.8, "Br": 0.9, "Hc": 120.0, "K": 2.0}
    assert hs.Tellinen.from_modelica(**core).to_modelica() == pytest.approx(core, rel=1e-15)


test_what_is_no_core_is_refused = refused(
    (lambda: hs.Tellinen(coercivity=0.0), "coercivity must be positive, got 0.0"),
    (lambda: hs.Chan(squareness=1.0), "squareness must be below 1, got 1.0"),
    (lambda: hs.Tellinen(z0=-1.5), "z0 must be of a size of at most 1"),
    (lambda: hs.Chan(gap=-0.1), "gap must not be negative"),
    (lambda: hs.identify(hs.Chan, noisy(CORES[0]), bounds={"gap": (0.0, 1.0)}), "gap of a Chan cannot be searched"),
    (lambda: hs.Chan(gap=0.1, saturation=-1.0), "saturation must not be negative with a gap"),
    (lambda: hs.Chan.from_ltspice(Hc=1.0, Bs=0.4, Br=0.1, A=0.0), "A must be positive"),
    (lambda: hs.Chan(feedthrough=1.0).to_ltspice(), "slope of vacuum at saturation"),
    (lambda: hs.Chan(offset=1.0).to_ltspice(), "no offset and no z0"),
    (lambda: hs.Tellinen(offset=1.0).to_modelica(), "has no offset"),
    (lambda: hs.TellinenTable(inputs=(1.0, 0.0)), "inputs must increase"),
    (lambda: hs.TellinenTable(lower=(1.0, -1.0)), "branch lower must not fall"),
    (lambda: hs.TellinenTable(upper=(-2.0, 1.0)), "upper must not lie below"),
    (lambda: hs.TellinenTable(inputs=(0.0,)), "equally long and hold two points"),
    (lambda: hs.TellinenTable(z0=2.0), "z0 must be of a size of at most 1"),
    (lambda: hs.EnergyPlays(field=0.0), "field must be positive"),
    (lambda: hs.EnergyPlays(thresholds=(0.5, 0.1), weights=(1.0, 1.0)), "thresholds must increase"),
    (lambda: hs.Dashpot.eddy_currents(conductivity=-1.0, thickness=1.0), "conductivity must not be negative"),
    (lambda: hs.ExcessLoss.from_bertotti(conductivity=1.0, cross_section=1.0, V0=-1.0), "V0 must not be negative"),
)


# ---------------------------------------------------------------------------------- identification


LOOPS = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=120)
LOOPS = np.concatenate([[0.0], np.linspace(0, -1, 20), LOOPS, np.linspace(-1.0, 0.6, 30), np.linspace(0.6, -0.3, 20)])


def noisy(law, seed=8):
    y = law.response(LOOPS)
    return hs.Record(u=LOOPS, y=y + 1e-3 * np.ptp(y) * np.random.default_rng(seed).normal(size=y.size))


@needs_compiled
@pytest.mark.parametrize(
    "law",
    [
        hs.Tellinen(saturation=2.0, coercivity=0.15, squareness=0.4, feedthrough=0.1, offset=0.2),
        hs.Chan(saturation=2.0, coercivity=0.15, squareness=0.4, feedthrough=0.1),
        hs.Chan(saturation=2.0, coercivity=0.15, squareness=0.4, feedthrough=0.1, gap=0.1),
    ],
    ids=["Tellinen", "Chan", "Chan behind a gap"],
)
def test_the_core_is_found_within_its_intervals(law):
    start = hs.Chan(gap=law.gap) if isinstance(law, hs.Chan) else hs.Tellinen
    fit = hs.identify(start, noisy(law), initial="rest")
    for name in ("saturation", "coercivity", "squareness", "feedthrough"):
        assert abs(fit.estimates[name] - getattr(law, name)) < 4.0 * fit.stderr[name], name
        assert fit.stderr[name] < 0.2 * max(abs(getattr(law, name)), 0.1), name


@needs_compiled
def test_cells_are_found_with_their_field():
    true = hs.EnergyPlays(thresholds=(0.0, 0.1, 0.3), weights=(0.2, 1.0, 0.4), field=0.15)
    fit = hs.identify(hs.EnergyPlays.structure(thresholds=true.thresholds), noisy(true), initial="rest")
    assert abs(fit.estimates["field"] - 0.15) < 4.0 * fit.stderr["field"]
    np.testing.assert_allclose(fit.model.weights, true.weights, atol=0.05)
    again = hs.identify(fit.model, noisy(true), initial="rest")
    assert again.rmse == pytest.approx(fit.rmse, rel=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_cells_that_are_identified_on_a_core_driven_by_its_flux_have_an_inverse(sign):
    """Weights of both signs fit the corners of the noisy loop a little better."""
    core, flux = hs.JilesAtherton(), 0.3 * np.sin(np.linspace(0.0, 6.0 * np.pi, 151))
    field = core.inverse_response(flux)
    u = field + 1e-3 * np.ptp(field) * np.random.default_rng(0).standard_normal(field.size)
    cells = hs.identify(hs.EnergyPlays.structure(plays=8), hs.Record(u=u, y=sign * flux)).model
    assert min(sign * weight for weight in (*cells.weights, cells.feedthrough)) >= 0.0
    for wanted in (sign * flux, 0.7 * sign * flux):
        np.testing.assert_allclose(cells.response(cells.inverse_response(wanted)), wanted, atol=1e-12)


# ---------------------------------------------------------------- measures of magnetic loops and the parts of core loss


MU0 = 1.25663706212e-6


def parallelogram(Hc=2.0, slope=3.0, peak=10.0, n=200):
    """A play: H and B = slope (H -+ Hc), flat after each turn."""
    H = hs.signals.triangle(-peak, peak, cycles=2, samples_per_cycle=n)
    return H, slope * hs.Play(threshold=Hc, z0=-(peak - Hc)).response(H)


def test_measures_of_a_parallelogram():
    loop = magnetic_metrics(*parallelogram())
    assert loop.energy == pytest.approx(4.0 * 3.0 * 2.0 * (10.0 - 2.0), rel=1e-13)
    assert loop.coercivity == pytest.approx(2.0, rel=1e-13)
    assert loop.remanence == pytest.approx(6.0, rel=1e-13)
    assert loop.peak_field == pytest.approx(10.0, rel=1e-13)
    assert loop.peak_induction == pytest.approx(24.0, rel=1e-13)
    assert loop.amplitude_permeability * MU0 == pytest.approx(2.4, rel=1e-13)
    assert loop.largest_permeability * MU0 == pytest.approx(3.0, rel=1e-12)
    assert np.isnan([loop.initial_permeability, loop.maximum_permeability]).all()


@pytest.mark.parametrize(
    ("reach", "drift", "noise", "closure"),
    [(10.0, 0.0, 1e-3, "closed"), (10.0, 0.05, 1e-3, "drift"), (10.0, 0.05, 0.03, "closed"), (1.5, 0.0, 1e-3, "open")],
)
def test_a_loop_is_closed_drifts_or_is_open(reach, drift, noise, closure):
    """Two branches of a hyperbolic tangent, at fields of ten coercivities and of 1.5, with a line of slope 0.02."""
    H = hs.signals.triangle(-reach, reach, cycles=1, samples_per_cycle=800)
    B = np.tanh(H - np.sign(np.gradient(H))) + 0.02 * H + drift * np.arange(H.size) / H.size
    loop = magnetic_metrics(H, B + noise * np.random.default_rng(0).standard_normal(H.size))
    assert loop.closure == closure
    assert f"closure        {closure}: " in str(loop)
    if reach == 10.0:
        assert loop.noise == pytest.approx(noise, rel=0.2)
        assert loop.saturated_slope == pytest.approx(0.02, abs=3.0 * noise)


def test_a_clockwise_loop_has_a_negative_energy_and_remanence():
    H, B = parallelogram()
    assert magnetic_metrics(H, -B).energy == pytest.approx(-192.0, rel=1e-13)
    assert magnetic_metrics(H, -B).remanence == pytest.approx(-6.0, rel=1e-13)


@pytest.mark.parametrize("family", [hs.Tellinen, hs.Chan])
def test_the_limiting_loop_has_four_times_saturation_times_coercivity(family):
    law = family(saturation=1.5, coercivity=40.0, squareness=0.6)
    H = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=4000)
    H = 400.0 * np.sinh(8.0 * H) / np.sinh(1.0)  # dense about zero, and far out
    loop = magnetic_metrics(H, law.response(H), cycles=1)
    # Chan's branches close like 1 / H, and the chords of 2 000 samples cut their bends
    assert loop.energy == pytest.approx(4.0 * 1.5 * 40.0, rel=1e-3)
    assert loop.remanence == pytest.approx(law.remanence, rel=1e-3)
    assert loop.coercivity == pytest.approx(40.0, rel=1e-3)


def test_measures_of_the_initial_curve():
    law = hs.Chan(coercivity=1.0, squareness=0.5)
    H = np.concatenate([np.linspace(0.0, 5.0, 501), -hs.signals.triangle(-5.0, 5.0, cycles=1, samples_per_cycle=40)])
    loop = magnetic_metrics(H, law.response(H), mu0=1.0)
    ratios = law.response(H[1:501]) / H[1:501]
    assert loop.initial_permeability == pytest.approx(0.25, rel=1e-2)  # knee / (coercivity + knee)^2 at H = 0
    assert loop.maximum_permeability > loop.initial_permeability
    assert loop.maximum_permeability == pytest.approx(ratios.max(), rel=1e-15)
    assert "initial curve" in str(loop)
    assert set(loop.to_dict()) >= {"energy", "coercivity", "maximum_permeability"}


def test_what_does_not_cross_an_axis_has_no_measure_there():
    H, B = parallelogram()
    away = magnetic_metrics(H + 100.0, B + 100.0)
    assert np.isnan([away.remanence, away.coercivity]).all()
    assert away.energy == pytest.approx(192.0, rel=1e-11)


@pytest.mark.parametrize(("arguments", "message"), [({"mu0": 0.0}, "mu0 must be positive"), ({"cycles": 9}, "cycle")])
def test_a_loop_that_cannot_be_measured_is_refused(arguments, message):
    assert_refused(message, magnetic_metrics, *parallelogram(), **arguments)


# ---------------------------------------------------------------------------------- losses


def loss(part, B, sample_time):
    """Energy per cycle of a part along a periodic flux density: the rate is constant between samples."""
    H = part.response(np.append(B, B[1]), sample_time)[1:]
    return float(H @ np.diff(np.append(B, B[1])))


@pytest.mark.parametrize("frequency", [1.0, 50.0])
def test_losses_of_a_triangular_flux(frequency):
    B = 1.5 * hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
    rate, path, sample_time = 4.0 * 1.5 * frequency, 4.0 * 1.5, 1.0 / (40 * frequency)

    def per_cycle(part):
        return float(part.response(B, sample_time)[1:] @ np.diff(B))

    assert per_cycle(hs.Dashpot(c=0.02)) == pytest.approx(0.02 * rate * path, rel=1e-12)
    assert per_cycle(hs.ExcessLoss(c=0.5)) == pytest.approx(0.5 * np.sqrt(rate) * path, rel=1e-12)


def test_excess_loss_of_a_sinusoidal_flux_is_bertottis():
    """W = 4 c B^(3/2) (2 pi f)^(1/2) times the integral of cos^(3/2) over a quarter, 8.76 c B^(3/2) f^(1/2)."""
    n, frequency = 4000, 50.0
    B = 1.2 * np.sin(2.0 * np.pi * np.arange(n + 1) / n)
    H = hs.ExcessLoss(c=0.5).response(B, 1.0 / (n * frequency))
    quarter = 0.5 * beta(1.25, 0.5)
    expected = 0.5 * 4.0 * quarter * 1.2**1.5 * np.sqrt(2.0 * np.pi * frequency)
    assert 4.0 * quarter * np.sqrt(2.0 * np.pi) == pytest.approx(8.76, abs=5e-3)
    assert float(H[1:] @ np.diff(B)) == pytest.approx(expected, rel=1e-5)  # velocities by 4 000 chords
    assert hs.ExcessLoss(c=0.5).response(-B, 1.0 / (n * frequency)).tolist() == (-H).tolist()


def test_the_parts_beside_a_line_are_identified_together():
    t = np.linspace(0.0, 0.1, 200)
    B = np.sin(2.0 * np.pi * 50.0 * t) + 0.2 * np.sin(2.0 * np.pi * 230.0 * t)
    parts = hs.Dashpot(c=0.01), hs.ExcessLoss(c=0.4)
    record = hs.Record(u=B, y=3.0 * B + sum(part.response(B, t[1]) for part in parts), t=t)
    fit = hs.identify(hs.Sum.structure(hs.Line, hs.Dashpot, hs.ExcessLoss), record)
    assert fit.estimates["dashpot.c"] == pytest.approx(0.01, rel=1e-6)
    assert fit.estimates["excess_loss.c"] == pytest.approx(0.4, rel=1e-6)


# ---------------------------------------------------------------------------------- driven by B


SATURATED = [
    hs.Tellinen(saturation=-0.45, coercivity=15.0, squareness=0.33, offset=0.1),
    hs.TellinenTable(inputs=(-50.0, 0.0, 50.0), lower=(-0.45, -0.1, 0.45), upper=(-0.45, 0.1, 0.45), offset=0.1),
    hs.EnergyPlays(thresholds=(0.0, 20.0), weights=(0.25, 0.2), field=15.0, offset=0.1),
    hs.JilesAtherton(Ms=0.9, a=35.0, k=22.0, alpha=70.0, c=0.3, gain=0.5, feedthrough=0.0, offset=0.1),
]


@pytest.mark.parametrize("law", SATURATED)
def test_an_output_beyond_saturation_is_named_with_what_is_reached(law):
    reached = law.response([0.0, 90.0, -400.0, 5.0])
    assert law.response(law.inverse_response(reached)) == pytest.approx(reached, abs=1e-12)
    message = r"sample 1 \(y = 0.56\): its outputs lie between -0.35 and 0.55, and 2 of 4 samples lie beyond"
    assert_refused(message, law.inverse_response, [0.1, 0.56, 0.0, -0.36], error=hs.SimulationError)


def test_cells_that_stand_still_at_first_move_by_twice_the_smallest_force_after_a_turn():
    law = hs.EnergyPlays(thresholds=(5.0, 20.0), weights=(0.2, 0.25), field=15.0)
    u = law.inverse_response(y := [0.0, 0.2, 0.3, 0.3 - 1e-9, 0.1])
    assert law.response(u) == pytest.approx(y, abs=1e-15)
    assert u[2] - u[3] == pytest.approx(10.0, abs=1e-5)


@pytest.mark.parametrize("law", [CORES[0], hs.Chan(coercivity=0.4, offset=0.3, z0=0.2)])
def test_columns_by_one_run_are_those_by_one_run_each(law):
    record, z0 = hs.Record(u=walk(5), y=walk(6)), {"z0": np.array([-0.4, 0.8])}
    np.testing.assert_allclose(law.regressors(z0, record), hs.Law.regressors(law, z0, record), atol=1e-12)
