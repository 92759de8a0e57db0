"""No result depends on what was called before on the same object."""

import dataclasses
import functools
import inspect
import re

import numpy as np
import pytest
from test_inverse_of_every_law import LAWS
from test_missing_samples import EVERY

import hysim as hs
from hysim.models.model import every_family

H = 5e-5  # s
U = np.concatenate([np.linspace(0.0, 0.6, 7), np.linspace(0.5, -0.4, 7)])
OTHERS = {
    "ReversalFilter": hs.ReversalFilter(threshold=0.2),
    "Actuator": hs.Actuator(hysteresis=LAWS["BoucWen"], creep=hs.Creep.per_decade(1.5)),
    "TransferFunction": hs.TransferFunction(num=(1.0,), den=(1e-4, 1.0)),
    "Modes": hs.Modes(natural_frequencies=(3e3,), damping_ratios=(0.05,), gains=(0.9,)),
    "Creep": hs.Creep.per_decade(1.5),
    "Amplifier": hs.Amplifier(gain=2.0, slew_rate=1e5),
    "Sensor": hs.Sensor(noise=1e-3, quantum=1e-3),
    "BoucWenOscillator": hs.BoucWenOscillator(mass=1.0, damping=0.1, stiffness=1.0, law=hs.BoucWen()),
    "Structure": hs.Structure(mass=1.0, stiffness=4.0, damping=0.1),
    "Dashpot": hs.Dashpot(),
    "ExcessLoss": hs.ExcessLoss(),
    "CoreField": hs.CoreField(),
    "SingleValued": hs.SingleValued(u=[-1.0, 0.0, 1.0], y=[-1.5, 0.0, 2.0]),
    "PreisachRelays": hs.PreisachRelays(levels=(-1.0, 0.5, 1.0), weights=(1.0, 0.5, 1.0)),
    "ElasticBacklash": hs.ElasticBacklash(half_gap=0.1),
    "GeneralizedMaxwellSlip": hs.GeneralizedMaxwellSlip(),
    "LuGre": hs.LuGre(sigma0=100.0),
    "StribeckFriction": hs.StribeckFriction(),
    "StateSpace": hs.StateSpace(A=[[-1e3]], B=[1e3], C=[1.0]),
    "Dependent": hs.Dependent(
        law=LAWS["Dahl"],
        polynomials=(hs.ChannelPolynomial(parameter="coulomb", channel="T", at=(0.0, 1.0), values=(4.0, 5.0)),),
    ),
    "MultiInputActuator": hs.MultiInputActuator(
        inputs=("u", "b"), actuators=(hs.Actuator(hysteresis=LAWS["BoucWen"]), hs.Actuator(hysteresis=LAWS["Dahl"]))
    ),
    "Element": hs.Element(LAWS["Dahl"], between=(0, 1)),
    "ModalDamping": hs.ModalDamping(ratio=0.02),
    "Rayleigh": hs.Rayleigh(mass=0.1, stiffness=0.01),
    "Notch": hs.Notch(natural_frequency=1e3, damping_ratio=0.1),
    "DampingLoop": hs.DampingLoop(gain=1.0, frequency=1e3),
    "Shaper": hs.Shaper.zv(3e3, 0.01),
    "ModeInverse": hs.ModeInverse(natural_frequency=3e3, damping_ratio=0.01),
}
OBJECTS = LAWS | OTHERS | {name: EVERY[name] for name in ("pid", "everything", "adaptive", "inverse_alone")}
ARGUMENTS = {
    "u": U, "y": 0.3 * U, "y_wanted": 0.3 * U, "sample_time": H, "u0": 0.1, "y0": 0.0, "reference": U,
    "measurement": 0.5 * U, "frequency": np.array([1.0, 50.0]), "rng": 3, "values": {}, "language": "python",
}  # fmt: skip


def verbs(thing, folder):
    """Public functions that take a model or a controller, by name."""

    def saved():
        hs.save(thing, folder / "it.json")
        return (folder / "it.json").read_bytes()

    return {
        "to_c": lambda: hs.to_c(thing, H), "to_page": lambda: hs.to_page(thing, folder / "it.html").read_bytes(),
        "simulate": lambda: hs.simulate(thing, H * np.arange(U.size), U).y, "save": saved, "str": lambda: str(thing),
        "repr": lambda: repr(thing), "hash": lambda: hash(thing) == hash(dataclasses.replace(thing)),
        "equal": lambda: thing == dataclasses.replace(thing), "to_control": lambda: str(hs.to_control(thing, H)),
        "loop": lambda: hs.close_loop(OTHERS["TransferFunction"], thing, H * np.arange(U.size), U).u,
    }  # fmt: skip


def methods(thing):
    """Public methods whose arguments are known here, and properties, by name."""
    calls = {}
    for name in dir(type(thing)):
        member = inspect.getattr_static(type(thing), name)
        if name.startswith("_") or isinstance(member, type):
            continue
        if isinstance(member, property | functools.cached_property) or not callable(getattr(thing, name)):
            calls[name] = lambda name=name: plainly(getattr(thing, name))
            continue
        wanted = inspect.signature(getattr(thing, name)).parameters.values()
        given = {each.name: ARGUMENTS[each.name] for each in wanted if each.name in ARGUMENTS}
        needed = {each.name for each in wanted if each.default is each.empty and each.kind is not each.VAR_KEYWORD}
        if needed <= set(given) and not any(each.kind is each.POSITIONAL_ONLY for each in wanted):
            calls[name] = lambda name=name, given=given: getattr(thing, name)(**given)
    return calls


def plainly(value):
    """A result in a form that compares by value."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, (tuple, list)):
        return [plainly(each) for each in value]
    if isinstance(value, dict):
        return {str(name): plainly(each) for name, each in value.items()}
    return re.sub(r"0x[0-9a-f]+|system\w*\[\d+\]|sys\[\d+\]", "", repr(value))


def outcome(call):
    with np.errstate(all="ignore"):
        try:
            return plainly(call())
        except (TypeError, ValueError, ImportError, AttributeError, hs.SimulationError) as error:
            return "refused", type(error).__name__, plainly(str(error))


@pytest.mark.parametrize("name", OBJECTS)
def test_a_second_call_in_another_order_has_the_same_result(name, tmp_path):
    """Everything public is called in one order, and again in another one, on one object."""
    made = OBJECTS[name]
    thing = made() if callable(made) and not dataclasses.is_dataclass(made) else dataclasses.replace(made)
    calls = methods(thing) | verbs(thing, tmp_path)
    assert len(calls) > 10
    rng, results = np.random.default_rng(sum(map(ord, name))), []
    for _ in range(2):
        results.append({each: outcome(calls[each]) for each in rng.permutation(list(calls))})
    first, second = results
    assert {each for each in first if first[each] != second[each]} == set()
    assert sum(each[:1] != ("refused",) for each in first.values() if isinstance(each, tuple | str | list)) > 5


def test_a_page_is_written_after_everything_else(tmp_path):
    """What a law has computed for C stood among its fields."""
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, 0.5))
    before = hs.to_page(law, tmp_path / "a.html").read_bytes()
    hs.to_c(law)
    assert hs.to_page(law, tmp_path / "a.html").read_bytes() == before


def test_every_family_is_called_twice():
    families = {name for name, each in every_family().items() if each.__module__.startswith("hysim.")}
    covered = {type(each).__name__ for each in OBJECTS.values()} | {type(EVERY[name]()).__name__ for name in EVERY}
    covered.add("ChannelPolynomial")  # inside `Dependent`
    assert sorted(families - covered) == []
