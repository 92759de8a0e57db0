"""`simulate` gives every signal by its name; a long path is computed in stretches, of the same bits and errors."""

import numpy as np
import pytest
from strategies import refused

import hysim as hs
from hysim._basics import parallel as _parallel
from hysim.models.protocols import Remembering


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


# --------------------------------------------------------- stretches of a long path, so that an interrupt need not wait


U = np.concatenate([np.linspace(0.0, 1.0, 9), np.linspace(0.9, -0.8, 11), np.linspace(-0.7, 0.6, 12)])
LAWS = [
    hs.BoucWen(n=1.0, z0=0.1, feedthrough=1.0),
    hs.BoucWen(n=2.0, z0=0.1, feedthrough=1.0),
    hs.BoucWen(n=1.5, z0=0.1, feedthrough=1.0),
    hs.PolynomialBoucWen(n=1.3, input_coefficients=(1.0, 0.1)),
    hs.GeneralizedBoucWen(b2=0.1),
    hs.BoucWenBaberNoori(delta_nu=0.1, zeta_s=0.1),
    hs.ColemanHodgdon(alpha=1.0, c=0.1),
    hs.Dahl(stiffness=1.0, coulomb=0.5),
    hs.JilesAtherton(Ms=1.0, a=0.4, alpha=0.5, k=0.3),
    hs.Duhem.from_terms({"u'": 0.5, "|u'| z": -0.3}, y0=0.1),
    hs.PrandtlIshlinskii(thresholds=(0.0, 0.2), weights=(1.0, 0.5)),
    hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0, 0.2), weights=(1.0, 0.5), left=(1.0, 0.1, 0.0, 0.0, 0.0)),
    hs.ParametricPrandtlIshlinskii(exponent=-0.5, decay=0.3, weight=0.4, weight_slope=0.1, reach=2.0),
    hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(0.1, 0.2)),
    hs.Tellinen(coercivity=0.3),
    hs.Chan(coercivity=0.3, gap=0.1),
    hs.EnergyPlays(thresholds=(0.0, 0.2), weights=(1.0, 0.5), field=0.3),
    hs.Play(threshold=0.2),
    hs.Preisach(levels=(-1.0, 0.0, 1.0), weights=(0.1, 0.2, 0.3)),
    hs.CustomLaw(step=lambda p, x, u: p[0] * u + x[1], parameters={"a": 2.0}, state={"z": 0.5}),
]


def asked_for(law):
    """Everything that a law computes along a path."""
    y = law.response(U)
    values = {"response": y}
    if isinstance(law, Remembering):
        values["memory"] = law.memory(U)
    if isinstance(law, (hs.BoucWen, hs.PolynomialBoucWen, hs.PrandtlIshlinskii)):
        values["inverse"] = law.inverse_response(y)
    return values


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_the_stretches_make_no_difference(law, monkeypatch):
    in_one, stretches = asked_for(law), []

    def counted(*bounds):
        stretches.append(len(range(*bounds)))
        return range(*bounds)

    monkeypatch.setattr(_parallel, "_STRETCH", 5)
    monkeypatch.setattr(_parallel, "range", counted, raising=False)
    in_several = asked_for(law)
    assert stretches.count(7) >= len(in_one) - 1, "a path is computed in one call, however long it is"
    assert in_one.keys() == in_several.keys()
    for name, values in in_one.items():
        assert np.array_equal(values, in_several[name]), name


@pytest.mark.parametrize(
    "law",
    [
        hs.BoucWen(beta=-2.0, gamma=-2.0, n=2.0),
        hs.BoucWen(beta=-2.0, gamma=-2.0, n=1.5),
        hs.Duhem.from_terms({"u'": 1.0, "|u'| z^2": 9.0}),
        hs.CustomLaw(step=lambda p, x, u: 1.0 / (p[0] - u), parameters={"a": 7.0}, state={"z": 0.5}),
    ],
    ids=lambda law: type(law).__name__,
)
def test_the_sample_that_fails_is_counted_from_the_first(law, monkeypatch):
    u = np.linspace(0.0, 10.0, 11)
    with pytest.raises(hs.SimulationError, match="sample") as in_one:
        law.response(u)
    monkeypatch.setattr(_parallel, "_STRETCH", 1)
    with pytest.raises(hs.SimulationError) as in_several:
        law.response(u)
    assert str(in_one.value) == str(in_several.value)
