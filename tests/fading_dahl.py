"""A law with two hidden states that hysim does not have, by its slope alone."""

import hysim as hs


@hs.family
class FadingDahl(hs.Law):
    """Dahl friction whose limit fades with the slip behind it, beside a spring.

    ``dF/du = k (1 - sgn(u') F (1 + fading q) / coulomb)``, ``dq/du = sgn(u') (|F| / coulomb - q) / way``,
    ``y = offset + c u + F``
    """

    k: float = 2.0
    coulomb: float = 0.5
    fading: float = 0.5
    way: float = 1.0
    c: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    searched = (
        hs.Parameter("k", 1e-1, 1e2, unit="y/u", log=True),
        hs.Parameter("coulomb", 1e-1, 1e1, unit="y", log=True),
        hs.Parameter("fading", 0.0, 2.0),
        hs.Parameter("c", affine=True),
        hs.Parameter("offset", affine=True),
    )

    @staticmethod
    def slope(p, z, q, u, s):
        """Of the friction force F and of the fading slip q, which begins at zero."""
        return p.k * (1.0 - s * z * (1.0 + p.fading * q) / p.coulomb), s * (abs(z) / p.coulomb - q) / p.way

    @staticmethod
    def output(p, z, u):
        """Force of spring and friction."""
        return p.offset + p.c * u + z
