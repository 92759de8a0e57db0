"""Laws and plants in extreme units: the same results, or one line that names the cause."""

import itertools

import mpmath
import numpy as np
import pytest

import hysim as hs

# ---------------------------------------------------------------------------------- laws


EXPONENTS = (0.5, 1.0, 1.5, 2.0, 3.0, 8.0, 20.0)
ORDERS = (-300, -120, 0, 120, 300)
U = np.array([0.0, 1.5, -1.0, 2.0, -2.5, -0.5, 0.0, 3.0])
WEAR = {"delta_a": 0.02, "delta_nu": 0.1, "delta_eta": 0.05}
PINCHING = {"zeta_s": 0.7, "q": 0.1, "p": 0.8, "psi": 0.3, "delta_psi": 0.02}
LAWS = {
    "forced": (hs.ZhuWangBoucWen, {"delta": 0.3}),
    "plain": (hs.BoucWenBaberNoori, {}),
    "worn": (hs.BoucWenBaberNoori, WEAR),
    "pinched": (hs.BoucWenBaberNoori, WEAR | PINCHING),
}


def in_units(law, j, i):
    """Parameters of a law with memory in units of 2^-j and input in units of 2^-i: both numbers grow."""
    n = law["n"]
    powers = {
        **{"A": j - i, "beta": j - i - n * j, "gamma": j - i - n * j, "delta": j - 2 * i, "z0": j},
        **{"delta_a": -2 * i, "delta_nu": -i - j, "delta_eta": -i - j, "p": -i - j, "psi": j, "delta_psi": -i},
        "q": (j - i) / n,  # its place is q (1 / (beta + gamma))^(1/n)
    }
    return {name: value * 2.0 ** powers.get(name, 0.0) for name, value in law.items()}


def are_numbers(j, i, law):
    """Whether all parameters, and the energy, have all of their digits."""
    n = law["n"]
    of_q = (j - i) / n if "q" in law else 0.0
    return max(map(abs, (j - i, j - i - n * j, j - 2 * i, 2 * i, i + j, of_q))) < 1000


@pytest.mark.parametrize("n", EXPONENTS)
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("start", [{"A": 1.0, "z0": 0.2}, {"A": 0.0, "z0": 1.5}])
def test_units_change_nothing(name, n, start):
    family, own = LAWS[name]
    if name == "forced" and start["A"] == 0.0 and n < 1.0:
        pytest.skip("too stiff near zero in any units, as in tests/test_asymmetric.py")
    law = {**start, "beta": 0.6, "gamma": 0.3, "n": n, **own}
    units = [(j, i) for j in ORDERS for i in ORDERS if are_numbers(j, i, law)]
    assert len(units) >= 5
    parameters = [in_units(law, j, i) for j, i in units]
    memory_of, input_of = (2.0 ** np.array(orders, float)[:, None] for orders in zip(*units, strict=True))
    sets = {each: np.array([values[each] for values in parameters]) for each in law}
    found = family.responses(sets, input_of * U, workers=1) / memory_of
    expected = family(**law).memory(U)
    assert np.abs(found - expected).max() < 1e-9 * np.ptp(expected)


@pytest.mark.parametrize("n", [1.0, 3.0, 8.0])
def test_the_energy_has_its_own_unit(n):
    law = {"beta": 0.6, "gamma": 0.3, "n": n, **WEAR}
    expected = hs.BoucWenBaberNoori(**law).energy(U)
    for j, i in ((-120, 120), (120, -120), (-60, -200), (60, 200)):
        found = hs.BoucWenBaberNoori(**in_units({"A": 1.0, **law}, j, i)).energy(2.0**i * U) / 2.0 ** (i + j)
        assert np.abs(found - expected).max() < 1e-9 * np.ptp(expected)


@pytest.mark.parametrize(("n", "unit"), [(3.0, 1e-90), (8.0, 1e-36), (12.0, 1e24), (20.0, 1e-15), (2.3, 1e120)])
def test_a_memory_of_extreme_size_saturates_as_the_closed_form(n, unit):
    """w' = 1 - w^n from zero has the inverse L = w 2F1(1, 1/n; 1 + 1/n; w^n)."""
    end = 0.9
    with mpmath.workdps(30):
        length = float(end * mpmath.hyp2f1(1, 1 / mpmath.mpf(n), 1 + 1 / mpmath.mpf(n), mpmath.mpf(end) ** n))
        c = float(mpmath.mpf(unit) ** (-mpmath.mpf(n)))  # balance at the unit, A = 1
    shape = {"A": 1.0, "beta": 0.5 * c, "gamma": 0.5 * c, "n": n}
    for family, nothing in ((hs.ZhuWangBoucWen, {}), (hs.BoucWenBaberNoori, {"delta_nu": 1e-30 / unit**2})):
        z = family(**shape, **nothing).memory([0.0, 0.3 * length * unit, length * unit])
        assert z[-1] == pytest.approx(end * unit, rel=1e-10, abs=0.0)


def test_a_large_memory_that_saturates_has_not_diverged():
    A, balance, n = 2e11, 4e8, 24.0
    c = A / balance**n
    model = hs.BoucWenBaberNoori(A=A, beta=0.5 * c, gamma=0.5 * c, n=n, delta_nu=1e-12)
    energy = balance * 0.01
    expected = balance * (1.0 + 1e-12 * energy) ** (-1.0 / n)  # it follows the worn balance
    assert model.memory(np.linspace(0.0, 0.01, 11))[-1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("n", [0.5, 1.5, 2.0, 8.0])
@pytest.mark.parametrize("step", [3e-310, -1e-320, 5e-324])
def test_from_zero_the_smallest_steps_go_along_the_line(n, step):
    for model, state in (
        (hs.ZhuWangBoucWen(n=n, delta=0.3), (0.0, 0.0)),
        (hs.BoucWenBaberNoori(n=n, delta_nu=0.1), (0.0, 0.0, 0.0)),
    ):
        assert model.advance([step], state)[0].tolist() == [step]


@pytest.mark.parametrize("family", [hs.ZhuWangBoucWen, hs.BoucWenBaberNoori])
def test_a_law_of_a_batch_has_the_units_that_it_has_alone(family):
    rng = np.random.default_rng(3)
    n = rng.uniform(0.3, 20.0, 40)
    balance, length = 2.0 ** rng.uniform(-40.0, 40.0, 40), 2.0 ** rng.uniform(-80.0, 80.0, 40)
    A = balance / length
    sets = {"A": A, "beta": 0.7 * A / balance**n, "gamma": 0.2 * A / balance**n, "n": n}
    u = length[:, None] * U
    rows = family.responses(sets, u, workers=1)
    alone = [family(**{name: values[k] for name, values in sets.items()}).response(u[k]) for k in range(40)]
    assert np.array_equal(rows, alone)
    assert np.isfinite(rows).all()


# ---------------------------------------------------------------------------------- plants


ENDS = (1e300, 1e-300, 0.0)
NUMBERS = [each for each in itertools.product((*ENDS, 1.0), repeat=3) if 1.0 in each]
INPUT = np.array([0.0, 1.0, 0.5, -1.0, 0.0])
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
    t = sample_time * np.arange(INPUT.size)
    for numbers in NUMBERS:
        told(lambda numbers=numbers: hs.simulate(SYSTEMS[kind](*numbers), t, INPUT))


@pytest.mark.parametrize("sample_time", [0.01, 1e-300, 1e300])
def test_extreme_loops_end_in_a_result_or_one_clear_error(sample_time):
    t = sample_time * np.arange(INPUT.size)
    for kp, ki, kd in NUMBERS:
        pid = hs.PID(kp=kp, ki=ki, kd=kd)
        told(lambda pid=pid: pid.advance(INPUT, INPUT, sample_time))
        for plant in ("pushed", "transfer function"):
            told(lambda plant=plant, pid=pid: hs.close_loop(SYSTEMS[plant](1.0, 1.0, 1.0), pid, t, INPUT))
            told(lambda n=(kp, ki, kd), p=plant: hs.close_loop(SYSTEMS[p](*n), hs.PID(kp=1.0, ki=1.0), t, INPUT))


def test_the_cause_is_named():
    for light in (SYSTEMS["structure"](1e-300, 0.0, 1.0), SYSTEMS["oscillator"](1e-9, 1.0, 1.0)):
        with pytest.raises(ValueError, match=r"a sample would take .* sub-steps: it is too long for the stiffness"):
            hs.simulate(light, 0.01 * np.arange(5), INPUT)
    with pytest.raises(ValueError, match="stiffness or damping over mass is beyond the largest number"):
        hs.simulate(hs.Structure(mass=1e-300, stiffness=1e300), 0.01 * np.arange(5), INPUT)
    with pytest.raises(ValueError, match="num and den over the first of den must be finite"):
        hs.TransferFunction(num=(1.0,), den=(1e-300, 1e300))
