"""A law that hysim does not have, as a user would write it."""

import hysim as hs


@hs.family
class SquareDahl(hs.Law):
    """Dahl friction of exponent 2 beside a spring, ``F' = k (1 - sgn(u') F / coulomb)^2 u'``, ``y = offset + c u + F``.

    Along a stroke w = 1 - sgn(u') F / coulomb decays as w_0 / (1 + w_0 k |u - u_0| / coulomb).
    """

    k: float = 2.0
    coulomb: float = 0.5
    c: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    searched = (
        hs.Parameter("k", 1e-2, 1e3, unit="y/u", log=True),
        hs.Parameter("coulomb", 1e-2, 1e1, unit="y", log=True),
        hs.Parameter("c", affine=True),
        hs.Parameter("offset", affine=True),
    )

    @staticmethod
    def step(parameters, state, u):
        """Output after a stroke to `u`; the state is (last u, F)."""
        k, coulomb, c, offset = parameters
        if u != state[0]:
            direction = 1.0 if u > state[0] else -1.0
            w = 1.0 - direction * state[1] / coulomb
            w = w / (1.0 + w * k * abs(u - state[0]) / coulomb)
            state[1] = direction * coulomb * (1.0 - w)
        state[0] = u
        return offset + c * u + state[1]
