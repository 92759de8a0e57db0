"""Laws, plants, sums and cascades run sample by sample as they respond, from any first input."""

import numpy as np
import pytest

import hysim as hs
from hysim._frozen import checked
from hysim.models.compiled_step import startable

TIME = 0.05


def stepped(model, u, sample_time=None):
    """Outputs by the step, from the first sample of `u` on."""
    step, parameters, state = startable(model, sample_time).started(u[0])
    return np.array([step(parameters, state, value) for value in u])


def walk(seed=0, n=60, scale=1.0):
    """A random input that stands still now and then, and does not begin at zero."""
    rng = np.random.default_rng(seed)
    return np.repeat(scale * rng.normal(size=n), rng.integers(1, 3, n))[:n] + 0.3


DUHEM = hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -1.0, "|u'| |z| z": -0.1}, feedthrough=0.5, offset=0.2, y0=0.7)
LAWS = {
    "line": hs.Line(offset=0.2, slope=-2.0),
    "Bouc-Wen": hs.BoucWen(feedthrough=0.3, gain=-0.7, z0=0.2),
    "Bouc-Wen, any exponent": hs.BoucWen(n=1.5, z0=-0.1),
    "Dahl": hs.Dahl(),
    "Duhem": DUHEM,
    "generalised": hs.GeneralizedBoucWen(b4=0.1, n=1.3, z0=0.1),
    "Baber-Noori": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1),
    "plays": hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 2.0), z0=0.1),
    "relays": hs.Preisach(levels=(-1.0, 0.0, 1.0), weights=(1.0, 0.5, 1.0), z0=(0.7, -0.2)),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_law_is_its_response_to_the_bit(law):
    u = walk()
    assert stepped(law, u).tolist() == law.response(u).tolist()


@pytest.mark.parametrize(
    "model",
    [
        DUHEM + LAWS["relays"] + LAWS["Bouc-Wen"],
        LAWS["Bouc-Wen"] >> DUHEM >> LAWS["plays"],
        LAWS["line"] >> (DUHEM + LAWS["Bouc-Wen, any exponent"]),
        (LAWS["plays"] >> DUHEM) + (LAWS["line"] >> LAWS["Bouc-Wen, any exponent"] >> LAWS["line"]),
    ],
    ids=["sum", "cascade", "sum in a cascade", "cascades in a sum"],
)
def test_sums_and_cascades_start_all_their_laws(model):
    u = walk(1)
    assert stepped(model, u).tolist() == model.response(u).tolist()
    assert stepped(model, u[:1]).tolist() == model.response(u[:1]).tolist()


def test_a_law_of_the_users_own_may_say_how_it_starts():
    @checked
    class Since(hs.Law):
        """Distance from the first input."""

        gain: float = 2.0
        initial = ()
        workspace = 1

        @staticmethod
        def step(parameters, state, u):
            state[0] = u
            return parameters[0] * (u - state[1])

        @staticmethod
        def start(parameters, state, u0):
            state[0] = state[1] = u0

    u = walk()
    assert Since().response(u).tolist() == (2.0 * (u - u[0])).tolist()
    assert stepped(Since() + hs.Line(slope=1.0), u).tolist() == (2.0 * (u - u[0]) + u).tolist()
