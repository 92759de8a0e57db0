"""The numbers of a structure are identified from what its sensors measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from strategies import refused

import hysim as hs
from hysim.models.model import candidates
from hysim.models.search_space import Freedom

SAMPLE_TIME = 0.02
BOUC_WEN = hs.BoucWen(beta=60.0, gamma=40.0, n=1.0, feedthrough=20.0, gain=180.0)
OF_LAW = ("elements.0.gain", "elements.0.beta", "elements.0.gamma", "elements.0.feedthrough")


def ground(seed, duration=6.0):
    return hs.signals.ground_motion(3.0, duration=duration, sample_time=SAMPLE_TIME, seed=seed)


def frame(n_storeys=1, damping=hs.ModalDamping(ratio=0.05), **options):  # noqa: B008  # frozen
    """With the substeps of the search, so that records without noise are met exactly."""
    laws = [hs.BoucWen(**{**BOUC_WEN.scalars, "gain": 180.0 - 40.0 * k}) for k in range(n_storeys)]
    return hs.shear_frame([1.0] * n_storeys, laws=laws, damping=damping, substeps=2, **options)


def record(structure, seed=0, *, noise=0.0, without=(), signals=("acceleration",)):
    u = ground(seed)
    exact = structure.signals(u, SAMPLE_TIME)
    rng = np.random.default_rng(seed)
    measured = {}
    for name in signals:
        values = exact[name] + noise * np.abs(exact[name]).max(axis=0) * rng.standard_normal(exact[name].shape)
        values[:, [k for signal, k in without if signal == name]] = np.nan
        measured[name] = values
    return hs.StructureRecord(t=SAMPLE_TIME * np.arange(u.size), u=u, **measured)


def begun(structure, free, share=0.5):
    """Half of each number too much, or too little, in turns; of those with a star, of the first element's."""
    numbers = structure.scalars
    own = {name: numbers[name.replace("*", "0")] for name in free}
    return structure.assemble(
        {name: value * (1.0 + share * (-1.0) ** k) for k, (name, value) in enumerate(own.items())}
    )


def check_recovered(fit, structure, tolerance=1e-6):
    assert fit.success
    for name in fit.free_names:
        assert fit.estimates[name] == pytest.approx(structure.scalars[name.replace("*", "0")], rel=tolerance), name


def test_one_storey_is_recovered_from_its_own_output():
    structure, free = frame(output="acceleration"), ("damping", *OF_LAW)
    u = ground(0)
    rec = hs.Record(t=SAMPLE_TIME * np.arange(u.size), u=u, y=structure.response(u, SAMPLE_TIME))
    fit = hs.identify(begun(structure, free), rec, free=free)
    check_recovered(fit, structure)
    assert fit.model.damping.ratio == fit.estimates["damping"]
    assert fit.model.substeps == 2
    assert fit.estimates["elements.0.n"] == 1.0  # held


def test_two_storeys_are_recovered_from_two_records_with_different_sensors():
    structure = frame(2)
    free = ("damping", "elements.0.gain", "elements.1.gain", "elements.*.beta")
    records = [
        record(structure, 1, without=[("acceleration", 0)]),
        record(structure, 2, signals=("drift", "acceleration"), without=[("drift", 1), ("acceleration", 1)]),
    ]
    fit = hs.identify(begun(structure, free), records, free=free)
    check_recovered(fit, structure)
    assert fit.residual.size == sum(len(each) * len(each.sensors) for each in records)
    assert [element.law.beta for element in fit.model.elements] == [fit.estimates["elements.*.beta"]] * 2
    assert "elements.0.beta" not in fit.estimates


@pytest.mark.parametrize(
    ("damping", "name"),
    [
        (hs.Rayleigh.at(0.05, periods=(0.7, 0.3)), "damping"),
        (hs.Rayleigh.at(0.05, periods=(0.7, 0.3)), "damping.stiffness"),
        (hs.ModalDamping(ratio=(0.05, 0.02)), "damping[1]"),
        (0.3, "damping"),
    ],
)
def test_every_kind_of_damping_is_recovered(damping, name):
    structure = frame(2, damping)
    fit = hs.identify(begun(structure, (name,)), record(structure), free=[name])
    expected = structure.scalars[name] / (1.5 if structure.scalars[name] == 1.0 else 1.0)  # a factor of the start's
    assert fit.estimates[name] == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(fit.model.damping_matrix, structure.damping_matrix, rtol=1e-6)


def test_sensors_weigh_by_their_noise_and_standard_errors_are_honest():
    """Drifts with a hundredth of the noise of the accelerations, whose residuals are in units of each."""
    structure, free = frame(), ("damping", "elements.0.gain", "elements.0.beta")
    u = ground(3)
    exact = structure.signals(u, SAMPLE_TIME)
    rng = np.random.default_rng(5)
    levels = {"acceleration": 0.2, "drift": 1e-4}
    measured = {name: exact[name] + level * rng.standard_normal(exact[name].shape) for name, level in levels.items()}
    rec = hs.StructureRecord(t=SAMPLE_TIME * np.arange(u.size), u=u, **measured)
    fit = hs.identify(begun(structure, free, 0.2), rec, free=free)
    assert "acceleration.1" in fit.message
    assert "drift.0" in fit.message
    for residual in np.split(fit.residual, 2):
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(1.0, rel=0.05)  # the second weighing changes little
    for name in free:
        assert abs(fit.estimates[name] - structure.scalars[name]) < 4.0 * fit.stderr[name]
    parted = hs.identify(structure, rec, free=["damping"], weights=np.where(rec.t < rec.t[80], 1.0, 0.0))
    assert [np.count_nonzero(each) for each in np.split(parted.weights, 2)] == [80, 80]  # for both sensors
    alone = hs.identify(begun(structure, free, 0.2), replace(rec, drift=None), free=free)
    assert fit.stderr["elements.0.gain"] < alone.stderr["elements.0.gain"]


def test_fixed_numbers_and_bounds_are_kept():
    structure = frame()
    fit = hs.identify(
        structure,
        record(structure),
        free=["elements.0.gain"],
        fixed={"damping": 0.06, "elements.*.beta": 61.0},
        bounds={"elements.0.gain": (100.0, 170.0)},
    )
    assert fit.model.damping.ratio == 0.06
    assert fit.model.elements[0].law.beta == 61.0
    assert fit.estimates["elements.0.gain"] == pytest.approx(170.0, rel=1e-12)  # the bound, by its logarithm
    assert "elements.0.gain is at its given bound 170" in fit.message


def test_a_number_stays_positive_whose_negative_would_make_energy():
    structure = frame()
    names = ("beta", "gamma", "gain")
    freedom = Freedom(free=tuple(f"elements.0.{name}" for name in names))
    space = structure.search_space(structure.as_records(record(structure))[0], freedom)
    ends = [space.parameters(side[np.newaxis]) for side in (space.lower, space.upper)]
    lower, upper = ({name: ends[k][f"elements.0.{name}"].item() for name in names} for k in (0, 1))
    law = structure.elements[0].law
    assert lower["beta"] == pytest.approx(0.1 * law.beta)
    assert lower["gain"] == pytest.approx(0.1 * law.gain)
    assert (lower["gamma"], upper["gamma"]) == pytest.approx((-10.0 * law.gamma, 10.0 * law.gamma))


test_a_mistaken_call_says_what_to_do = refused(
    ({}, "say which numbers of the structure are free"),
    ({"free": ["damping", "elements.0.bta"]}, r"no parameter 'elements.0.bta'.*elements.0.beta"),
    ({"free": ["elements.*.bta"]}, r"no parameter 'elements.\*.bta'"),
    ({"free": ["elements.0.offset"]}, "begins at zero: give bounds"),
    ({"free": ["damping"], "fixed": {"damping": 0.1}}, "both fixed and free"),
    ({"free": ["damping"], "bounds": {"mass": (1.0, 2.0)}}, "not free"),
    ({"free": ["damping"], "initial": "free"}, "initial_state"),
    call=lambda arguments: hs.identify(frame(), record(frame()), **arguments),
)


FREE = {"free": ["damping"]}
test_a_record_must_fit_the_structure = refused(
    (frame(), lambda two: two, FREE, "a column for each of the 1 masses, got 2"),
    (hs.BoucWen, lambda two: two, {}, TypeError, "takes a Record or several"),
    (frame(), lambda two: hs.Record(u=two.u, y=two.u), FREE, "no time"),
    (frame(2), lambda two: replace(two, u=0.0 * two.u), FREE, "constant"),
    call=lambda model, of, options: hs.identify(model, of(record(frame(2))), **options),
)


test_a_record_is_checked = refused(
    ({"acceleration": None}, "needs one of"),
    ({"acceleration": np.ones(300)}, "number of columns"),
    ({"acceleration": np.full((301, 1), np.nan)}, "needs one of"),
    ({"acceleration": np.append(np.ones((300, 1)), [[np.nan]], axis=0)}, "nan as a whole"),
    ({"u": np.ones(300)}, "u must have the shape"),
    ({"t": SAMPLE_TIME * np.arange(301.0) ** 2}, "even"),
    call=lambda changes: replace(record(frame()), **changes),
)


def test_a_loop_of_sensors_in_units_of_their_noise_has_no_width():
    structure = frame()
    fit = hs.identify(structure, record(structure, noise=1e-3), free=("damping",))
    assert fit.loop_width is None


def test_blocks_leave_the_beginning_of_each_sensor_in():
    structure = frame()
    several = record(structure, noise=1e-3, signals=("acceleration", "drift"))
    errors = hs.identify(structure, several, free=("damping",), cross_validate=3).cv_residual
    for each in np.split(errors, 2 * structure.n_nodes):
        assert np.flatnonzero(np.isnan(each)).tolist() == [*range(math.ceil(each.size / 3))]


def test_a_structure_is_no_candidate_of_its_own():
    assert "Structure" not in candidates()
