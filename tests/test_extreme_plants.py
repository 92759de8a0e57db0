"""Masses, stiffnesses, dampings and times at the ends of the floating-point range: a result, or one clear error."""

import itertools

import numpy as np
import pytest

import hysim as hs

ENDS = (1e300, 1e-300, 0.0)
NUMBERS = [each for each in itertools.product((*ENDS, 1.0), repeat=3) if 1.0 in each]
U = np.array([0.0, 1.0, 0.5, -1.0, 0.0])
SYSTEMS = {
    "structure": lambda m, c, k: hs.Structure(mass=m, damping=c, stiffness=k),
    "pushed": lambda m, c, k: hs.Structure(mass=m, damping=c, stiffness=k, excitation="force"),
    "oscillator": lambda m, c, k: hs.BoucWenOscillator(mass=m, damping=c, stiffness=k, law=hs.BoucWen()),
    "transfer function": lambda m, c, k: hs.TransferFunction(num=(1.0,), den=(m, c, k)),
    "actuator": lambda m, c, k: hs.Actuator(
        hysteresis=hs.BoucWen(), vibration=hs.TransferFunction(num=(1.0,), den=(m, c, k))
    ),
}


def told(call):
    """Nothing but a result or an error of hysim's own."""
    message = "must"
    try:
        call()
    except np.linalg.LinAlgError:
        raise
    except hs.SimulationError:
        pass
    except ValueError as error:
        message = str(error)
    assert any(word in message for word in ("must", "check", "too long", "cannot")), message


@pytest.mark.parametrize("kind", SYSTEMS)
@pytest.mark.parametrize("sample_time", [0.01, 1e-300, 1e300])
def test_extreme_numbers_end_in_a_result_or_one_clear_error(kind, sample_time):
    t = sample_time * np.arange(U.size)
    for numbers in NUMBERS:
        told(lambda numbers=numbers: hs.simulate(SYSTEMS[kind](*numbers), t, U))


@pytest.mark.parametrize("sample_time", [0.01, 1e-300, 1e300])
def test_extreme_loops_end_in_a_result_or_one_clear_error(sample_time):
    t = sample_time * np.arange(U.size)
    for kp, ki, kd in NUMBERS:
        pid = hs.PID(kp=kp, ki=ki, kd=kd)
        told(lambda pid=pid: pid.advance(U, U, sample_time))
        for plant in ("pushed", "transfer function"):
            told(lambda plant=plant, pid=pid: hs.close_loop(SYSTEMS[plant](1.0, 1.0, 1.0), pid, t, U))
            told(lambda n=(kp, ki, kd), p=plant: hs.close_loop(SYSTEMS[p](*n), hs.PID(kp=1.0, ki=1.0), t, U))


def test_the_cause_is_named():
    with pytest.raises(ValueError, match=r"a sample would take .* sub-steps: it is too long for the stiffness"):
        hs.simulate(hs.Structure(mass=1e-300, stiffness=1.0), 0.01 * np.arange(5), U)
    with pytest.raises(ValueError, match="stiffness or damping over mass is beyond the largest number"):
        hs.simulate(hs.Structure(mass=1e-300, stiffness=1e300), 0.01 * np.arange(5), U)
    with pytest.raises(ValueError, match="num and den over the first of den must be finite"):
        hs.TransferFunction(num=(1.0,), den=(1e-300, 1e300))
