"""`simulate` gives a plant's output with every signal by its name."""

import numpy as np
from strategies import refused

import hysim as hs


def test_a_law_needs_no_time_and_shows_its_memory():
    law = hs.BoucWen(beta=0.4, gamma=0.1, gain=2.0)
    u = np.sin(np.linspace(0, 7, 50))
    sim = hs.simulate(law, None, u, units={"u": "V"})
    assert np.array_equal(sim.y, law.response(u))
    assert np.array_equal(sim.z, law.memory(u))
    assert sim.t is None
    assert sim.units["u"] == "V"
    assert set(sim.signals) == {"u", "y", "z"}


def test_the_time_does_not_matter_to_a_law():
    law, u = hs.BoucWen(), np.sin(np.linspace(0, 7, 50))
    slow, fast = (hs.simulate(law, rate * np.linspace(0, 7, 50) ** 2, u) for rate in (0.1, 10.0))
    assert np.array_equal(slow.y, fast.y)
    assert set(slow.signals) == {"t", "u", "y", "z"}


def test_a_static_model_has_no_memory():
    assert hs.simulate(hs.Line(slope=2.0), None, [0.0, 1.0]).z is None


test_wrong_arguments_are_named = refused(
    ((hs.BoucWen(), [0.0, 1.0], [0.0, 1.0, 2.0]), "equal lengths"),
    ((hs.BoucWen(), [0.0, 0.0], [0.0, 1.0]), "increase"),
    ((hs.BoucWen(), None, [0.0, float("nan")]), "u must be finite, got nan at index 1"),
    (("bouc-wen", None, [0.0, 1.0]), TypeError, "takes a model"),
    ((hs.BoucWen(beta=-3.0, gamma=0.0, n=2.0), None, [0.0, 9.0]), hs.SimulationError, "sample 1"),
    call=lambda arguments: hs.simulate(*arguments),
)
