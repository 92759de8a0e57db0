"""Every verb that takes a model takes the result of a fit, and does with it what it does with its model."""

from dataclasses import replace

import numpy as np
import pytest

import hysim as hs

T = 0.01 * np.arange(121)
U = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=40)
LAW = hs.Dahl(stiffness=6.0, coulomb=0.3) + hs.Line(slope=1.0)
REC = hs.Record(u=U, y=LAW.response(U), t=T, units={"u": "V", "y": "um", "t": "s"})


@pytest.fixture(scope="module")
def fit():
    return hs.identify(hs.BoucWen, REC, fixed={"n": 1.0})


def with_model(fit, model):
    """The result, as if its model were another one."""
    return replace(fit, model=model, models=(model,))


def lines(draw):
    """What is drawn: names and points."""
    ax = hs.plot.figure().add_subplot()
    draw(ax)
    return [(line.get_label(), line.get_xydata().tolist()) for line in ax.lines]


def text_of(path):
    return path.read_bytes()


WANTED = 0.1 + 0.4 * T
SUBJECTS = {
    "simulate": lambda m, _: hs.simulate(m, REC.t, REC.u),
    "identify": lambda m, _: hs.identify(m, REC, free=(), fixed={"n": 1.0}, max_evaluations=50),
    "compare": lambda m, _: hs.compare({"fit": m}, REC).rows[0].fit_percent,
    "select": lambda m, _: hs.select({"fit": m}, REC, max_evaluations=50).best,
    "to_c": lambda m, _: hs.to_c(m),
    "to_fmu": lambda m, folder: text_of(hs.to_fmu(m, folder / "law.fmu", platforms=())),
    "to_page": lambda m, folder: text_of(hs.to_page(m, folder / "law.html", REC)),
    "save": lambda m, folder: hs.save(m, folder / "law.json") or hs.load_model(folder / "law.json"),
    "close_loop": lambda m, _: hs.close_loop(m, hs.PID(ki=10.0), T, WANTED).y,
    "tune": lambda m, _: hs.tune(m, T, WANTED).controller,
    "assess_step": lambda m, _: (
        hs.control.assess_step(m, hs.PID(ki=10.0), step=0.5, duration=1.0, sample_time=0.01).reduction.closed
    ),
    "to_control": lambda m, _: hs.to_control(m, 0.01).name is not None and hs.to_control(m, 0.01).nstates,
    "as_actuator": lambda m, _: hs.control.as_actuator(m),
    "InverseFeedforward.of": lambda m, _: hs.InverseFeedforward.of(m),
    "InverseFeedforward": lambda m, _: hs.InverseFeedforward(law=m),
    "AdaptiveInverse": lambda m, _: hs.AdaptiveInverse(law=m, free=("gain",), drift=(0.1,), noise=1e-3),
    "TrackingController": lambda m, _: hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=m), model=hs.Actuator(hysteresis=m)
    ),
    "Actuator": lambda m, _: hs.Actuator(hysteresis=m),
    "Sum": lambda m, _: hs.Sum(parts=(m, hs.Line())),
    "Cascade": lambda m, _: hs.Cascade(stages=[m, hs.Line()]),
    "+ behind": lambda m, _: m + hs.Line(),
    "+ before": lambda m, _: hs.Line() + m,
    ">> behind": lambda m, _: m >> hs.mode(60.0, 0.1),
    ">> before": lambda m, _: hs.Line() >> m,
    "Element": lambda m, _: hs.Element(m, between=(0, 1)),
    "shear_frame": lambda m, _: hs.shear_frame([1.0], laws=m),
    "Structure": lambda m, _: hs.Structure(mass=1.0, elements=[hs.Element(m, between=(0, 1))]),
    "BoucWenOscillator": lambda m, _: hs.BoucWenOscillator(mass=1.0, damping=1.0, stiffness=9.0, law=m),
    "MultiInputActuator": lambda m, _: hs.MultiInputActuator(inputs=("u", "v"), actuators=(m, m)),
    "Actuator.structure": lambda m, _: hs.Actuator.structure(m, creep=False, modes=0),
    "design_input": lambda m, _: (
        hs.design_input(
            m,
            limits=hs.InputLimits(amplitude=1.0, slew=4.0, duration=2.0, sample_time=0.05),
            free=("gain",),
            candidates=2,
            moves=2,
        ).u
    ),
    "track_parameters": lambda m, _: hs.track_parameters(m, REC, ["gain"], drift={"gain": 0.01}, noise=0.01)["gain"],
    "response_task": lambda m, _: hs.response_task(m, REC.u, REC.y)(gain=1.0),
    "describing_function": lambda m, _: hs.metrics.describing_function(m, [0.5, 1.0]).tolist(),
    "plot.loop": lambda m, _: lines(lambda ax: hs.plot.loop(REC, m, ax=ax)),
    "plot.width": lambda m, _: lines(lambda ax: hs.plot.width(REC, m, ax=ax)),
    "plot.residual_map": lambda m, _: (
        hs.plot.residual_map(REC, m, hs.plot.figure().subplots(1, 2))[0].collections[0].get_array().tolist()
    ),
    "plot.describing_function": lambda m, _: (
        hs.plot.describing_function(m, [0.5, 1.0], hs.plot.figure().subplots(2))[0].lines[0].get_xydata().tolist()
    ),
}


def same(one, other):
    assert type(one) is type(other)
    assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


@pytest.mark.parametrize("verb", SUBJECTS)
def test_a_verb_takes_a_fit_for_its_model(verb, fit, tmp_path):
    do = SUBJECTS[verb]
    same(do(fit, tmp_path), do(fit.model, tmp_path))


def test_a_task_of_a_structure_takes_a_fit(fit):
    frame = hs.shear_frame([1.0], laws=hs.BoucWen(beta=50.0, gamma=50.0, gain=180.0, feedthrough=20.0))
    ground = np.sin(T)
    assert hs.structure_task(with_model(fit, frame), ground, 0.02) == hs.structure_task(frame, ground, 0.02)


def test_a_channel_is_estimated_from_a_fit_that_depends_on_it(fit):
    gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
    stack = hs.Dependent(law=hs.BoucWen(beta=2.0), polynomials=(gain,))
    warm = hs.Record(u=U, y=stack.at(T=42.5).response(U), channels={"T": 42.5})
    warmed = with_model(fit, stack)
    assert hs.estimate_channel(warmed, warm, "T").estimates["T"] == pytest.approx(42.5, rel=1e-6)
    (drawn,) = lines(lambda ax: hs.plot.loop(warm, warmed, ax=ax))[1:]
    assert np.allclose(drawn[1], np.column_stack([U, warm.y]), rtol=0, atol=1e-12)  # the law at the record's channel


def test_a_discovery_is_taken_too():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)
    rec = hs.Record(u=u, y=hs.BoucWen(beta=1.0, gamma=0.5).response(u))
    result = hs.discover(rec)
    assert np.array_equal(hs.simulate(result, None, u).y, result.model.response(u))
    assert hs.compare({"law": result}, rec)["law"].fit_percent == pytest.approx(result.scores["fit_percent"], abs=1e-9)


def test_a_result_without_a_model_is_refused():
    class Empty:
        model, models, n_parameters = None, (), 3

    with pytest.raises(ValueError, match="this Empty has no model"):
        hs.simulate(Empty(), None, U)


def test_a_controller_with_a_model_is_no_result():
    """Its model is the plant that it follows; a plant would have one input."""
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(), model=hs.Actuator())
    assert "double reference, double measurement" in hs.to_c(controller, 0.01).header
    assert hs.to_control(controller, 0.01).ninputs == 2


@pytest.mark.parametrize("draw", ["loop", "width", "history", "cycles", "minor_loops", "animate"])
def test_a_model_alone_has_nothing_to_draw(draw, fit):
    for thing in (fit, fit.model):
        with pytest.raises(ValueError, match=f"plot.{draw} cannot draw a BoucWen without an input: .*hs.simulate"):
            vars(hs.plot)[draw](thing, ax=hs.plot.figure().add_subplot()) if draw != "history" else hs.plot.history(
                thing, hs.plot.figure().subplots(3)
            )


def test_an_actuator_of_several_inputs_is_drawn_and_compared_on_a_record_with_its_channels():
    stage = hs.MultiInputActuator(inputs=("u", "right"), actuators=(hs.Line(slope=1.0), hs.Line(slope=2.0)))
    rec = hs.Record(u=U, y=U + 2.0 * U**2, t=T, channels={"right": U**2})
    assert hs.compare({"stage": stage}, rec)["stage"].fit_percent == pytest.approx(100.0, abs=1e-9)
    (drawn,) = lines(lambda ax: hs.plot.loop(rec, stage, ax=ax))[1:]
    assert drawn[1] == np.column_stack([U, stage.response_of(rec)]).tolist()


def test_a_model_beside_a_record_is_read_by_its_sensor():
    """A sensor that is late reads what the displacement was."""
    lag = hs.Actuator(hysteresis=LAW, vibration=hs.mode(60.0, 0.5), sensor=hs.Sensor(delay=0.02))
    rec = hs.Record(u=U, y=lag.measured(U, 0.01), t=T)
    assert hs.compare({"stage": lag}, rec)["stage"].fit_percent == pytest.approx(100.0, abs=1e-9)
