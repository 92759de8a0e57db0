"""More samples on a monotone branch of the input change nothing: every law, forwards and backwards.

The laws, states and strides are those of `experiments/32_more_samples.py`, and so is what may differ; see
`experiments/more_samples.py` for the reason of each tolerance.
"""

import importlib

import numba
import numpy as np
import pytest
from component_rules import PATHS

import hysim as hs

experiment = importlib.import_module("32_more_samples")

N_CASES = 2 if numba.config.DISABLE_JIT else 12

NOT_RATE_INDEPENDENT = {
    *("TransferFunction", "Dashpot", "ExcessLoss", "Actuator", "MultiInputActuator", "BoucWenOscillator"),
    *("Structure", "Dependent"),
    *("LuGre", "StribeckFriction", "GeneralizedMaxwellSlip", "ElasticBacklash"),  # test_friction.py has them
    "CoreField",  # test_core_field.py has it
}
"""Between two samples the input of these, or a channel, is held, or goes on a line: with more it is another input."""
INVERSES = {"BoucWenInverse"}  # under the laws that it inverts
ELSEWHERE = {"MenegottoPinto", "TabulatedDahl", "VaianaRosati", *PATHS}  # drawn in the tests of these families
SEARCHED = {"Chan", "CustomLaw", "EnergyPlays", "Line", "MaxwellSlip", "ParametricPrandtlIshlinskii", "Play",
            "PreisachRelays", "Stop", "Tellinen", "TellinenTable"}  # fmt: skip
"""Laws whose only inverse is the search on their step, as a sum's is; `test_inverse_of_every_law.py` has them."""


def test_every_law_that_hysim_exports_is_among_the_families():
    """A new law is either drawn here, or it says why its samples matter."""
    classes = {name: each for name in hs.__all__ if isinstance(each := getattr(hs, name), type)}
    exported = {name for name, each in classes.items() if hasattr(each, "response")} - {"Law"}
    assert exported == {*experiment.DRAWS, *NOT_RATE_INDEPENDENT, *INVERSES, *ELSEWHERE}
    undone = {name for name in experiment.DRAWS if getattr(getattr(hs, name), "inverse_response", None)}
    assert undone - SEARCHED == set(experiment.INVERTED)


@pytest.mark.parametrize("family", experiment.DRAWS)
def test_more_samples_change_nothing(family):
    found = experiment.chunk(family, 0, N_CASES)
    assert found["wrong"] == []
    for path, ends in found["ends"].items():
        assert ends.get("compared", 0) > N_CASES // 2, (path, ends)  # most laws neither escape nor are refused


def test_the_check_sees_a_law_whose_step_ends_too_early():
    """The invariant of a first-order step, which every sample changes, is broken in most cases."""

    def euler(parameters, state, u):
        state[1] += (u - state[0]) * (1.0 - abs(state[1]))
        state[0] = u
        return state[1]

    law = hs.CustomLaw(step=euler, parameters={"unused": 0.0}, state={"z": 0.0})
    case = experiment.Case(law, np.zeros(1), np.linspace(0.1, 1.0, 10), np.array([4, 9]))
    assert experiment.judged(case, experiment.runs(case, experiment.response_run), None).ratio == np.inf


# ---------------------------------------------------------------------------------- what the experiment has found


@pytest.mark.parametrize("n", [2.5, 5.0, 11.575])
def test_a_memory_far_beyond_saturation_falls_the_same_way_in_one_piece_and_in_many(n):
    """The Taylor steps there were twice as long as their 31 terms could serve: 1e-12 of the memory was lost."""
    law = hs.BoucWen(n=n, z0=12.0)
    u = np.linspace(0.0, 12.0 / (12.0**n / n), 40)
    # ten roundings of the first state, from which each step falls
    assert law.memory(u[[0, -1]])[-1] == pytest.approx(law.memory(u)[-1], abs=10 * 2.0**-53 * 12.0)


@pytest.mark.parametrize("z0", [1e-300, 5e-200, 1e-60])
def test_a_memory_that_grows_from_next_to_nothing_keeps_its_digits(z0):
    n, c = 0.4, -2.0
    law = hs.BoucWen(A=0.0, beta=0.0, gamma=c, n=n, z0=z0)
    expected = (z0 ** (1.0 - n) + (1.0 - n) * -c * 0.3) ** (1.0 / (1.0 - n))
    assert law.memory([0.0, 0.3])[-1] == pytest.approx(expected, rel=1e-15)  # a few roundings of the closed form


def test_a_memory_that_escapes_before_the_input_changes_its_sign_has_escaped():
    law = hs.GeneralizedBoucWen(beta=-1.0, gamma=-1.0, n=2.0, b6=0.3)
    with pytest.raises(hs.SimulationError, match="diverges"):
        law.response([-50.0, 50.0])


RUNAWAYS = [
    hs.BoucWen(beta=0.5, gamma=-1.5, n=2.0),
    hs.BoucWen(beta=0.5, gamma=-1.5, n=3.0),
    hs.GeneralizedBoucWen(beta=0.5, gamma=-1.5, n=2.0, b6=0.3),
    hs.ZhuWangBoucWen(beta=0.5, gamma=-1.5, n=2.0, delta=0.1),
    hs.BoucWenBaberNoori(beta=0.5, gamma=-1.5, n=3.0, delta_nu=0.1),
    hs.Duhem.from_terms({"u'": 1.0, "|u'| |z| z": -1.0, "u' z^2": 2.0}),
    hs.BoucWen(beta=0.5, gamma=-1.5, n=2.0) + hs.Line(slope=1.0),
]


@pytest.mark.parametrize("law", RUNAWAYS, ids=lambda law: type(law).__name__)
def test_a_law_that_has_escaped_does_not_come_back_in_a_loop(law):
    """From infinity a strong decay is back at once: a compiled loop went on with finite outputs."""
    step, parameters, state = law.compiled(0.1)
    with np.errstate(all="ignore"):
        outputs = [step(parameters, state, u) for u in (0.1, 50.0, 49.0, -30.0, 0.0)]
    assert np.isfinite(outputs).tolist() == [True, False, False, False, False]


RUNAWAY = RUNAWAYS[0]
TO_ESCAPE = np.pi / 2.0


@pytest.mark.parametrize(("stride", "end"), [(0.5, "escaped"), (TO_ESCAPE, "edge"), (TO_ESCAPE - 1e-13, "escaped")])
def test_an_escape_in_one_sampling_alone_is_a_violation_unless_rounding_decides(stride, end):
    case = experiment.Case(RUNAWAY, np.zeros(1), np.linspace(0.0, stride, 5)[1:], np.array([3]))
    y, lost = np.ones(4), experiment.response_run(case._replace(u=np.array([50.0])), np.array([0]))
    other = type(lost)(y, (0.0, 0.0))
    errors = experiment.remembered(case)
    with np.errstate(all="ignore"):
        alone = experiment.judged(case, [lost, other, other], errors)
        beside = experiment.judged_beside(case, [other, other, other], [lost, lost, lost], errors)
    assert alone == beside == (0.0 if end == "edge" else np.inf, end)


def test_a_cascade_does_not_hide_that_its_first_law_escapes():
    law = hs.BoucWen(beta=-1.0, gamma=-1.0, n=2.0) >> hs.Preisach(levels=(0.0, 1.0), weights=(1.0,))
    compiled = law.compiled(0.0)
    assert not np.isfinite(compiled.step(compiled.parameters, compiled.state, 50.0))


@pytest.mark.parametrize(
    "law",
    [
        hs.GeneralizedBoucWen(n=1.5, gain=-0.3, input_coefficients=(1.0,)),
        hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -0.5}, feedthrough=2.0),
    ],
)
def test_the_next_output_but_a_rounding_has_an_input(law):
    _, state = law.advance([0.0, 0.7])
    y = law.advance([0.7], state)[0][0]
    u = law.inverse_response([np.nextafter(y, 9.0), np.nextafter(y, -9.0), y], state=state)
    assert u == pytest.approx(0.7, abs=1e-14)  # a few roundings of the output over a slope of more than 0.5


def test_the_smallest_number_is_an_output_that_has_an_input():
    law = hs.BoucWen(feedthrough=2.0, gain=-0.5)
    for each in (law, law >> hs.Line(slope=1.0)):
        assert abs(each.inverse_response([5e-324, 1.0], u0=0.0)[0]) < 1e-300  # the slope is 1.5


def test_the_inverse_of_a_cascade_comes_back_from_a_guess_that_is_far_too_long():
    """At first only the play of threshold zero moves: its slope takes the guess to where the first law has turned."""
    first = hs.BoucWen(beta=-0.05, gamma=-0.05, n=2.0, gain=-0.1, feedthrough=1.0)  # it turns at u = 3.95
    law = first >> hs.PrandtlIshlinskii(thresholds=(0.0, 0.1), weights=(0.02, 1.0))
    u = np.array([0.0, 3.0, 1.0])
    assert law.inverse_response(law.response(u), u0=0.0) == pytest.approx(u, abs=1e-12)  # 1e-16 of y over 0.02


def test_a_sum_of_short_laws_is_inverted():
    """1e-6 to either side of the input was taken to be near, whatever the unit."""
    law = hs.BoucWen(beta=-3e8, gamma=4e8, n=1.5, gain=1e3, feedthrough=1e4) + hs.Line(slope=1.0)
    u = 1e-9 * np.array([0.0, 1.0, -0.5])
    assert law.inverse_response(law.response(u), u0=0.0) == pytest.approx(u, abs=1e-23)  # roundings of u


def test_an_output_that_moves_by_less_than_a_rounding_tells_no_inverse():
    """Beside its offset this Duhem law stands still for longer than the stride, and then turns."""
    wanted = experiment.wanted_case("Duhem", experiment.generator("Duhem", 222))
    assert (wanted.y == wanted.y0).all()
    assert experiment.inverse_verdict(wanted, experiment.inputs_for).end == "edge"


def test_an_output_that_turns_where_it_begins_may_be_refused():
    """Its memory, nearly zero, grows both ways, and on one side by far more than the input's own slope takes back."""
    wanted = experiment.wanted_case("GeneralizedBoucWen", experiment.generator("GeneralizedBoucWen", 9980))
    for side in (1.0, -1.0):
        assert wanted.law.advance([wanted.u0 + side * 1e-8], wanted.law.advance([wanted.u0])[1])[0] > wanted.y0
    assert experiment.inverse_verdict(wanted, experiment.inputs_for) == (0.0, "refused")


def test_a_law_that_refuses_what_it_could_invert_is_wrong():
    wanted = experiment.wanted_case("Duhem", experiment.generator("Duhem", 1))
    assert (wanted.y != wanted.y0).any()

    def refuse(wanted, y):
        raise ValueError("the law has no inverse")

    assert experiment.inverse_verdict(wanted, refuse).ratio == np.inf


@pytest.mark.parametrize("seed", [3542, 3889])
def test_a_memory_of_next_to_nothing_may_grow_by_hundreds_of_decades(seed):
    """Without A, and with n < 1; the wear that goes with its energy is next to nothing all the way."""
    case = experiment.draw_case("BoucWenBaberNoori", experiment.generator("BoucWenBaberNoori", seed))
    law, u = case.law, np.concatenate([case.before, case.u])
    plain = hs.PolynomialBoucWen(**{name: law.arguments[name] for name in hs.PolynomialBoucWen.defaults()})
    np.testing.assert_allclose(law.response(u), plain.response(u), rtol=1e-12)
    for path, verdict, _ in experiment.forward_verdicts("BoucWenBaberNoori", range(seed, seed + 1)):
        assert verdict.end == "compared", path
        assert verdict.ratio <= 1.0, path


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_branches_that_touch_leave_no_memory(share):
    """How far they are apart just there was a rounding or nothing, as the sample before happened to lie."""
    inputs = (-0.4980768759266577, 0.3758447403404119, 0.5333721856568212)
    law = hs.TellinenTable(inputs=inputs, lower=(0.00173, 0.00195, 0.0112), upper=(0.00173, 0.003, 0.0112), z0=-share)
    for u in np.random.default_rng(0).uniform(*inputs[:2], 50):
        assert law.advance([u, inputs[0] - 1.0])[1][1] == 1.0
        assert law.advance([u, inputs[0]])[1][1] == 1.0
