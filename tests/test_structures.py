"""Invariants of structures: the same tests for every family that an element takes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from frame_laws import FAMILIES, JUMPING, LAWS, SMOOTH, bouc_wen
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import eigvals, expm
from strategies import COMPILED, assert_refused, refused

import hysim as hs
from hysim.laws.friction.rated_law import RatedLaw
from hysim.models.model import every_family
from hysim.models.protocols import Stepwise, needs_time

H = 0.02
T = H * np.arange(241 if COMPILED else 41)
QUAKE = hs.signals.ground_motion(6.0, duration=8.0, sample_time=H, seed=3)[: T.size]
NAMES = list(LAWS) if COMPILED else ["BoucWen", "Dahl", "Stop", "MaxwellSlip", "SquareDahl", "CustomLaw"]
MIXED = ["BoucWen of n = 2", "BoucWenBaberNoori", "MaxwellSlip"]
BALANCE = {"Play": 2e-6, "PrandtlIshlinskii": 1e-7, "PreisachRelays": 1e-7}
"""Imbalance over the input where it is above 1e-8: laws whose slope jumps, some from nothing, and relays."""


def frame_of(law, **options):
    """Three storeys on one law, or on three."""
    laws = law if isinstance(law, list) else [law] * 3
    return hs.shear_frame([1.0, 0.8, 0.6], laws=laws, **{"damping": 0.3, **options})


def off(run, expected, name="drift"):
    """The largest difference of a signal, as a share of its largest size."""
    return np.abs(run.signals[name] - expected.signals[name]).max() / np.abs(expected.signals[name]).max()


MIX = frame_of([LAWS[name] for name in MIXED])


# ---------------------------------------------------------------------------------- every family


def test_every_law_that_an_element_takes_is_tried():
    laws = {
        "TransferFunction",
        "Creep",
        "Amplifier",
        "Actuator",
        "StateSpace",
        "Modes",
        "ExcessLoss",
        "CoreField",
        "BoucWenOscillator",
    }  # which take time
    for name, family in every_family().items():
        if name in laws or not issubclass(family, Stepwise) or not family.__module__.startswith("hysim."):
            continue
        if issubclass(family, RatedLaw):  # test_friction_in_structures.py has them
            continue
        if issubclass(family, hs.ReversalFilter):  # which is no force
            continue
        assert name in FAMILIES | {"RateDependentPrandtlIshlinskii"}, name
    assert needs_time(hs.RateDependentPrandtlIshlinskii(thresholds=(0.1,), weights=(1.0,)))
    assert "SquareDahl" in FAMILIES  # a user's own


@pytest.mark.parametrize("name", NAMES)
def test_energies_balance_and_tolerances_agree(name):
    frame = frame_of(LAWS[name])
    run, loose, tight = (hs.simulate(replace(frame, tolerance=tol), T, QUAKE) for tol in (1e-8, 1e-7, 1e-10))
    imbalance = np.abs(run.signals["imbalance"]).max() / run.signals["input_work"].max()
    assert imbalance < BALANCE.get(name, 1e-8)
    assert off(loose, tight) < (1e-6 if name in SMOOTH else 2e-5)
    assert off(run, tight) < (1e-7 if name in SMOOTH else 2e-5)
    fixed = hs.simulate(replace(frame, substeps=16), T, QUAKE)
    assert off(fixed, tight) < (1e-7 if name in SMOOTH else 3e-6)


@pytest.mark.parametrize("name", NAMES)
def test_an_element_follows_its_law_along_its_own_drift(name):
    """The law at the drifts of twenty times as many samples ends each sample where the element is."""
    law = LAWS[name]
    many, quake = 20, QUAKE[:200]
    fine = np.interp(np.arange(many * (quake.size - 1) + 1) / many, np.arange(quake.size), quake)
    run = hs.simulate(frame_of(law, tolerance=1e-9), np.arange(fine.size) * H / many, fine)
    viscosity = sum(part.c for part in law.parts if isinstance(part, hs.Dashpot)) if isinstance(law, hs.Sum) else 0.0
    alone = hs.Sum(parts=tuple(p for p in law.parts if not isinstance(p, hs.Dashpot))) if viscosity else law
    rates = run.signals["velocity"] @ (np.eye(3) - np.eye(3, k=-1)).T
    for k in range(3):
        expected = alone.response(run.signals["drift"][:, k]) + viscosity * rates[:, k]
        between = 3e-5 if name in SMOOTH else 2e-2 if name in JUMPING else 2e-4  # a reversal between these samples
        assert np.abs(run.signals["force"][:, k] - expected).max() < between * np.abs(expected).max()


@pytest.mark.parametrize("name", NAMES)
def test_a_cut_input_gives_the_same_bits_and_no_input_no_motion(name):
    frame = frame_of(LAWS[name])
    whole, cut = frame.signals(QUAKE[:60], H), []
    state = None
    for k in (slice(0, 1), slice(1, 17), slice(17, 60)):
        signals, state = frame.advance(QUAKE[:60][k], state, sample_time=H)
        cut.append(signals)
    for each, values in whole.items():
        assert np.array_equal(np.concatenate([part[each] for part in cut]), values), each
    if not np.any(frame.start().motion.carry[0]):
        rest = frame.signals(np.zeros(20), H)
        assert all(not values.any() for values in rest.values())


ODD = [name for name in NAMES if name not in ("Preisach", "PreisachRelays", "GeneralizedBoucWen", "ZhuWangBoucWen",
                                             "PolynomialBoucWen", "ModifiedPrandtlIshlinskii")]  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_a_mirrored_input_gives_the_mirrored_motion(name):
    frame = frame_of(LAWS[name])
    one, other = frame.signals(QUAKE[:100], H), frame.signals(-QUAKE[:100], H)
    scale = np.abs(one["drift"]).max()
    assert other["drift"] == pytest.approx(-one["drift"], abs=1e-9 * scale)
    assert other["element_work"] == pytest.approx(one["element_work"], rel=1e-7, abs=1e-9 * one["input_work"].max())


@pytest.mark.parametrize("seed", range(12 if COMPILED else 1))
def test_random_structures_balance_their_energy_and_their_tolerances_agree(seed):
    """Full matrices, elements in any direction, smooth laws of any family, hard inputs and long samples."""
    rng = np.random.default_rng(seed)
    n, n_elements = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    root, spring = rng.normal(size=(2, n, n))
    elements = [
        hs.Element(LAWS[str(rng.choice(list(SMOOTH)))], direction=tuple(rng.normal(size=n))) for _ in range(n_elements)
    ]
    frame = hs.Structure(
        mass=root @ root.T + 0.3 * np.eye(n),
        damping=hs.Rayleigh(mass=0.1, stiffness=float(rng.choice([0.0, 1e-3]))),
        stiffness=spring @ spring.T * 10.0 ** rng.uniform(-1.0, 3.0),
        elements=elements,
        excitation=str(rng.choice(["base", "force"])),
        influence=tuple(rng.normal(size=n)),
        initial_state=tuple(0.02 * rng.normal(size=2 * n)),
    )
    t, u = T[:101] * 10.0 ** rng.uniform(-1.0, 0.5), QUAKE[:101] * 10.0 ** rng.uniform(-1.0, 1.0)
    run, tight = (hs.simulate(replace(frame, tolerance=tolerance), t, u) for tolerance in (1e-8, 1e-10))
    energies = run.signals["kinetic"] + run.signals["elastic"] + np.abs(run.signals["input_work"])
    assert np.abs(run.signals["imbalance"]).max() < 5e-8 * energies.max()  # errors of many steps of 1e-8
    assert off(run, tight) < 2e-7


# ---------------------------------------------------------------------------------- dashpots

CURVE = {"coulomb": 0.8, "breakaway": 1.2}
DAMPED = {
    "a dashpot": hs.Dashpot(c=2.0),
    "a sum": bouc_wen(2.0) + hs.Dashpot(c=2.0),
    "LuGre": hs.LuGre(sigma0=2000.0, sigma1=5.0, sigma2=0.5, stribeck_velocity=0.05, **CURVE),
    "StribeckFriction": hs.StribeckFriction(breakaway_velocity=0.05, viscous=0.5, **CURVE),
}


@pytest.mark.parametrize("law", DAMPED.values(), ids=DAMPED)
def test_peaks_and_energies_of_an_element_contain_its_dashpots(law):
    """Against the integrals of the powers by the trapezoidal rule, and in an ensemble."""
    many = 40
    quake = np.interp(np.arange(many * (T.size - 1) + 1) / many, np.arange(T.size), QUAKE)
    frame = hs.shear_frame([1.0, 0.8, 0.6], [60.0, 50.0, 40.0], [law, bouc_wen(2.0), law], damping=0.3)
    signals = frame.signals(quake, H / many)
    speed, force, unit = signals["velocity"], signals["force"], signals["input_work"].max()
    of_elements = force * (speed @ (np.eye(3) - np.eye(3, k=-1)).T)
    of_damping = 0.3 * (speed**2).sum(axis=1)
    for name, power in (("element_work", of_elements), ("damping_loss", of_damping)):
        work = cumulative_trapezoid(power, dx=H / many, axis=0, initial=0.0)
        assert np.abs(signals[name] - work).max() < 1e-4 * unit, name
    assert np.abs(signals["imbalance"]).max() < 1e-6 * unit
    assert (signals["dissipated"][-1] > 0.0).all()
    largest = np.maximum.accumulate(np.abs(force), axis=0)
    assert (signals["peak_force"] >= (1.0 - 1e-12) * largest).all()
    assert signals["peak_force"] == pytest.approx(largest, rel=1e-3)  # it may be between two samples
    for reduce, name in (("peak_force", "peak_force"), ("energy", "element_work")):
        row = frame.responses([1.0], quake, sample_time=H / many, reduce=reduce)[0]
        assert np.array_equal(row, signals[name][-1]), name


# ---------------------------------------------------------------------------------- known motions


def test_a_linear_structure_is_its_matrix_exponential():
    rng = np.random.default_rng(1)
    root, spring, damper = rng.normal(size=(3, 4, 4))
    M, K, C = root @ root.T + np.eye(4), 30.0 * spring @ spring.T, 0.3 * damper @ damper.T
    law = hs.Line(slope=40.0) + hs.Dashpot(c=0.7)
    b, r, x = np.array([0.5, -1.0, 0.0, 2.0]), rng.normal(size=4), rng.normal(size=8)
    structure = hs.Structure(
        mass=M, damping=C, stiffness=K, elements=[hs.Element(law, direction=tuple(b))], influence=tuple(r),
        initial_state=tuple(x),
    )  # fmt: skip
    K, C, b = K + 40.0 * np.outer(b, b), C + 0.7 * np.outer(b, b), M @ r
    joint = np.zeros((10, 10))
    joint[:4, 4:8], joint[8, 9] = np.eye(4), 1.0
    joint[4:8, :4], joint[4:8, 4:8], joint[4:8, 8] = (-np.linalg.solve(M, part) for part in (K, C, b))
    flow, run = expm(H * joint), hs.simulate(structure, T, QUAKE)
    for k in range(T.size - 1):
        x = (flow @ [*x, QUAKE[k], (QUAKE[k + 1] - QUAKE[k]) / H])[:8]
        assert run.signals["displacement"][k + 1] == pytest.approx(x[:4], abs=1e-10)
        assert run.signals["velocity"][k + 1] == pytest.approx(x[4:], abs=1e-9)
    absolute = -(run.signals["displacement"] @ K + run.signals["velocity"] @ C) @ np.linalg.inv(M)
    assert run.signals["acceleration"] == pytest.approx(absolute, abs=1e-8)
    assert np.abs(run.signals["imbalance"]).max() < 1e-9 * np.ptp(run.signals["input_work"])


@pytest.mark.parametrize("n", [1.0, 2.0, 1.5])
@pytest.mark.parametrize("excitation", ["base", "force"])
def test_one_mass_is_the_oscillator_with_its_own_scheme(n, excitation):
    numbers = {"mass": 1.3, "damping": 0.4, "stiffness": 20.0, "excitation": excitation}
    oscillator = hs.BoucWenOscillator(**numbers, law=bouc_wen(n), substeps=32, initial_state=(0.02, -0.3))
    frame = hs.Structure(
        **numbers, elements=[hs.Element(bouc_wen(n), between=(0, 1))], initial_state=(0.02, -0.3), tolerance=1e-10
    )
    ours, theirs = hs.simulate(frame, T, QUAKE), hs.simulate(oscillator, T, QUAKE)
    assert ours.y == pytest.approx(theirs.y, abs=3e-8 * np.abs(theirs.y).max())
    assert ours.signals["input_work"] == pytest.approx(theirs.signals["input_work"], abs=1e-7)
    assert ours.signals["damping_loss"] == pytest.approx(theirs.signals["damping_loss"], abs=1e-7)


def test_a_free_vibration_swings_in_its_period_and_decays_by_its_ratio():
    frame = hs.shear_frame([1.0, 0.8], [100.0, 60.0], damping=hs.ModalDamping(ratio=(0.02, 0.05)))
    shapes, periods = frame.modes(), frame.periods()
    for k, ratio in enumerate((0.02, 0.05)):
        begun = replace(frame, initial_state=(*shapes[:, k], 0.0, 0.0))
        t = np.linspace(0.0, 3.0 * periods[k] / np.sqrt(1.0 - ratio**2), 61)
        run = hs.simulate(begun, t, np.zeros(t.size))
        decay = np.exp(-6.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2))
        assert run.signals["displacement"][-1] == pytest.approx(decay * shapes[:, k], abs=1e-9)
        assert run.signals["input_work"].tolist() == [0.0] * t.size


# ---------------------------------------------------------------------------------- other coordinates


def test_the_order_of_the_elements_and_their_directions_do_not_matter():
    expected = hs.simulate(MIX, T, QUAKE)
    turned = replace(MIX, elements=MIX.elements[::-1])
    assert hs.simulate(turned, T, QUAKE).signals["drift"][:, ::-1] == pytest.approx(expected.signals["drift"], abs=1e-6)
    rows = MIX.drift_matrix
    told = [hs.Element(each.law, direction=tuple(row)) for each, row in zip(MIX.elements, rows, strict=True)]
    assert np.array_equal(
        hs.simulate(replace(MIX, elements=told), T, QUAKE).signals["drift"], expected.signals["drift"]
    )


def test_other_numbers_for_the_nodes_and_a_full_mass_matrix_are_the_same_structure():
    """Coordinates q with x = S q: the mass S'MS is full, the elements have directions, and so has the base."""
    S = np.array([[1.0, 0.3, 0.0], [0.2, 1.0, -0.4], [0.0, 0.5, 1.0]])
    smooth = frame_of(bouc_wen(2.0), damping=0.0)
    mass = S.T @ smooth.mass_matrix @ S
    elements = [
        hs.Element(each.law, direction=tuple(row @ S))
        for each, row in zip(smooth.elements, smooth.drift_matrix, strict=True)
    ]
    other = hs.Structure(
        mass=mass, damping=0.3 * S.T @ S, elements=elements, influence=tuple(np.linalg.solve(S, np.ones(3)))
    )
    expected, run = hs.simulate(replace(smooth, damping=0.3), T, QUAKE), hs.simulate(other, T, QUAKE)
    assert off(run, expected) < 1e-6
    assert run.signals["displacement"] @ S.T == pytest.approx(expected.signals["displacement"], abs=1e-7)
    assert run.signals["input_work"] == pytest.approx(expected.signals["input_work"], abs=1e-6)


@pytest.mark.parametrize(("length", "force", "time"), [(1e3, 1.0, 1.0), (1.0, 1e6, 1e-3), (1e-3, 1e3, 1e-6)])
def test_other_units_give_the_same_motion(length, force, time):
    law = bouc_wen(2.0)
    shape = {"A": law.A, "beta": law.beta / length**2, "gamma": law.gamma / length**2, "n": 2.0}
    slopes = {"gain": law.gain * force / length, "feedthrough": law.feedthrough * force / length}
    there = hs.shear_frame(
        np.array([1.0, 0.8, 0.6]) * force * time**2 / length,
        laws=hs.BoucWen(**shape, **slopes),
        damping=0.3 * force * time / length,
    )
    here = hs.simulate(frame_of(law), T, QUAKE)
    run = hs.simulate(there, T * time, QUAKE * length / time**2)
    for name, unit in (("drift", length), ("force", force), ("input_work", force * length)):
        values = here.signals[name]
        assert run.signals[name] / unit == pytest.approx(values, abs=1e-6 * np.abs(values).max())


def test_a_base_that_moves_is_a_force_on_every_mass():
    force = replace(MIX, excitation="force", influence=(-1.0, -0.8, -0.6))
    assert np.array_equal(hs.simulate(force, T, QUAKE).signals["drift"], hs.simulate(MIX, T, QUAKE).signals["drift"])


# ---------------------------------------------------------------------------------- peaks, memories


def test_peaks_are_those_between_the_samples():
    run = hs.simulate(MIX, T, QUAKE)
    many = 20
    fine = np.interp(np.arange(many * (T.size - 1) + 1) / many, np.arange(T.size), QUAKE)
    dense = hs.simulate(MIX, np.arange(fine.size) * H / many, fine)
    for name in ("drift", "displacement"):
        at_samples, between = (np.abs(each.signals[name]).max(axis=0) for each in (run, dense))
        assert (run.peaks[name] >= at_samples).all()
        assert run.peaks[name] == pytest.approx(between, rel=2e-5)
        assert (np.diff(run.signals[f"peak_{name}"], axis=0) >= 0.0).all()


def test_memories_are_those_of_the_laws():
    memories = MIX.memories(QUAKE, H)
    assert [each.shape[0] for each in memories] == [T.size] * 3
    drift = MIX.signals(QUAKE, H)["drift"]
    for k, memory in enumerate(memories):
        assert memory[:, 0] == pytest.approx(drift[:, k], abs=1e-15)


# ---------------------------------------------------------------------------------- small motions


def test_damping_has_the_ratios_that_it_was_told():
    law = bouc_wen()
    for damping, expected in (
        (hs.ModalDamping(ratio=0.04), [0.04] * 3),
        (hs.ModalDamping(ratio=(0.01, 0.02, 0.05)), [0.01, 0.02, 0.05]),
        (hs.Rayleigh.at(0.03, tuple(frame_of(law).periods()[[0, 2]])), [0.03, None, 0.03]),
    ):
        frame = frame_of(law, damping=damping)
        M, C, K = frame.mass_matrix, frame.damping_matrix, frame.initial_stiffness
        A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
        roots = eigvals(A)
        roots = sorted(roots[roots.imag > 0.0], key=abs)
        assert 2.0 * np.pi / np.abs(roots) == pytest.approx(frame.periods(), rel=1e-10)
        for root, ratio in zip(roots, expected, strict=True):
            if ratio is not None:
                assert -root.real / abs(root) == pytest.approx(ratio, rel=1e-9)


def test_modes_are_orthogonal_and_as_the_periods():
    frame = frame_of(bouc_wen())
    shapes, periods = frame.modes(), frame.periods()
    assert shapes.T @ frame.mass_matrix @ shapes == pytest.approx(np.eye(3), abs=1e-12)
    stiffness = shapes.T @ frame.initial_stiffness @ shapes
    assert stiffness == pytest.approx(np.diag((2.0 * np.pi / periods) ** 2), abs=1e-8)
    assert (np.diff(periods) < 0.0).all()
    assert (shapes[np.abs(shapes).argmax(axis=0), range(3)] > 0.0).all()
    assert hs.Structure(mass=(1.0, 2.0), stiffness=[[1.0, -1.0], [-1.0, 1.0]]).periods()[0] > 1e6


def test_elements_that_fall_in_both_directions_count_in_the_modes_and_their_damping():
    def leaning(*laws):
        elements = [hs.Element(law, between=(0, 1)) for law in laws]
        return hs.Structure(mass=1.0, elements=elements, damping=hs.ModalDamping(ratio=0.05))

    apart, together = leaning(hs.Line(slope=100.0), hs.Line(slope=-64.0)), leaning(hs.Line(slope=36.0))
    assert apart.periods() == pytest.approx(together.periods(), rel=1e-9)
    assert apart.damping_matrix == pytest.approx(together.damping_matrix, rel=1e-9)
    t = 0.01 * np.arange(400)
    swung = hs.simulate(leaning(hs.Line(slope=100.0), hs.Line(slope=-64.0)), t, np.sin(3.0 * t)).signals
    assert np.abs(swung["dissipated"]).max() < 1e-10 * np.abs(swung["element_work"]).max()
    softening = hs.BoucWen(A=-0.5, beta=0.5, gamma=0.2, gain=128.0)
    assert leaning(hs.Line(slope=100.0), softening).periods() == pytest.approx(together.periods(), rel=1e-6)
    for z0 in (0.0, 0.5, 0.9):
        assert leaning(hs.Line(slope=100.0), hs.BoucWen(gain=-10.0, z0=z0)).elastic_slopes[1] == pytest.approx(-10.0)
    saturated = leaning(hs.Line(slope=36.0), hs.BoucWen(beta=0.5, gamma=0.2, z0=3.0))  # rises where it turns back
    assert saturated.elastic_slopes.tolist() == [36.0, 0.0]
    assert_refused("stiffness at the start is negative", leaning, hs.Line(slope=-1.0))
    driven = hs.Rayleigh(mass=0.0, stiffness=0.05)
    assert_refused("Rayleigh damping would drive", hs.Structure, mass=1.0, stiffness=-1.0, damping=driven)


def test_a_free_vibration_without_damping_keeps_its_energy():
    spring = hs.Structure(mass=1.0, stiffness=10.0, initial_state=(0.1, 0.0))
    t = 0.01 * np.arange(1001)
    for u in (0.0 * t, 1e-9 * np.sin(t)):
        assert hs.simulate(spring, t, u).y == pytest.approx(0.1 * np.cos(np.sqrt(10.0) * t), abs=1e-7)


def test_a_shear_frame_is_its_storeys():
    frame = hs.shear_frame([1.0, 2.0, 3.0], [30.0, 20.0, 10.0], laws=[bouc_wen(), None, hs.Dahl()])
    assert frame.stiffness_matrix.tolist() == [[50.0, -20.0, 0.0], [-20.0, 30.0, -10.0], [0.0, -10.0, 10.0]]
    assert [each.between for each in frame.elements] == [(0, 1), (2, 3)]
    assert hs.shear_frame([1.0, 2.0], laws=bouc_wen()).drift_matrix.tolist() == [[1.0, 0.0], [-1.0, 1.0]]


# ---------------------------------------------------------------------------------- values


@pytest.mark.parametrize(
    "damping", [0.3, hs.Rayleigh(mass=0.1, stiffness=0.02), hs.ModalDamping(ratio=(0.1, 0.2, 0.3))]
)
def test_a_structure_is_a_value(tmp_path, damping):
    frame = frame_of([LAWS[name] for name in MIXED], damping=damping, output="drift.1", initial_state=(0.01,) * 6)
    hs.save(frame, tmp_path / "frame.json")
    read, copied = hs.load_model(tmp_path / "frame.json"), pickle.loads(pickle.dumps(frame))
    for other in (read, copied):
        assert other == frame
        assert np.array_equal(other.response(QUAKE[:50], H), frame.response(QUAKE[:50], H))
    assert replace(frame, tolerance=1e-6) != frame
    assert "Structure" in str(frame)


test_errors_of_structures = refused(
    ({"mass": -1.0}, "the mass matrix must be positive definite"),
    ({"mass": [[1.0, 2.0], [2.0, 1.0]]}, "the mass matrix must be positive definite"),
    ({"mass": (1.0, 2.0), "stiffness": (1.0, 2.0, 3.0)}, "must hold one number for each of 3 masses"),
    ({"mass": (1.0, 1.0), "stiffness": [[1.0, 2.0], [0.0, 1.0]]}, "must be a symmetric matrix"),
    ({"mass": np.nan}, "mass must be finite"),
    ({"mass": 1.0, "excitation": "wind"}, "excitation must be"),
    ({"mass": 1.0, "influence": (1.0, 2.0)}, "influence must hold one number for each of 1 masses"),
    ({"mass": 1.0, "initial_state": (1.0,)}, "must hold 1 displacements and 1 velocities, got 1"),
    ({"mass": 1.0, "output": "drift"}, "names none of the 0 elements"),
    ({"mass": 1.0, "output": "speed"}, "output must be a name"),
    ({"mass": 1.0, "tolerance": 0.1}, "tolerance must be between"),
    ({"mass": 1.0, "substeps": 0}, "substeps must be at least 1"),
    ({"mass": 1.0, "elements": [hs.Dahl()]}, TypeError, "elements must hold Elements, got Dahl"),
    ({"mass": (1.0, 1.0), "damping": hs.ModalDamping(ratio=(0.1,))}, "ratio must hold one number"),
    call=lambda arguments: hs.Structure(**arguments),
)


test_errors_of_elements = refused(
    ({"law": hs.Dahl()}, "either between"),
    ({"law": hs.Dahl(), "between": (0, 1), "direction": (1.0,)}, "either between"),
    ({"law": hs.Dahl(), "between": (1, 1)}, "two different nodes"),
    ({"law": hs.Dahl(), "between": (0, -1)}, "between must not be negative"),
    ({"law": hs.Dahl(), "between": (0, 0.5)}, TypeError, "between must be a whole number"),
    ({"law": hs.Dahl(), "direction": (0.0, 0.0)}, "direction must not be zero"),
    ({"law": hs.mode(1.0, 0.1), "between": (0, 1)}, TypeError, "takes friction and dashpots only"),
    ({"law": hs.Dahl, "between": (0, 1)}, TypeError, "got the class Dahl"),
    ({"law": hs.SingleValued(u=[0.0, 1.0], y=[0.0, 1.0]), "between": (0, 1)}, TypeError, "that can be stepped"),
    (
        {"law": hs.RateDependentPrandtlIshlinskii(thresholds=(0.1,), weights=(1.0,)), "between": (0, 1)},
        TypeError,
        "must not depend on the sample time",
    ),
    call=lambda arguments: hs.Element(**arguments),
)


def test_errors_of_runs():
    assert_refused("sample_time must be positive", MIX.response, QUAKE, 0.0)
    assert_refused("u must be finite", MIX.response, [0.0, np.nan], H)
    unstable = hs.Structure(mass=1.0, stiffness=-1e4)
    with pytest.raises(hs.SimulationError, match="the motion diverges at t = "):
        hs.simulate(unstable, np.arange(2000) * 0.01, np.ones(2000))
