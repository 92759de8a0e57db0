"""The oscillator route: a memory found from an oscillator's input and output alone.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

1. A rival without memory, a mass on a linear spring, is identified. About it all terms of the library are tried: if
   none is worth its parameter (BIC), there is no structure.
2. Along the measured motion, with z from the equation of motion and m, c and k projected out, the laws of Bouc and Wen
   with n = 1, 2 and 3 and a linear relaxation are regressed (`_hidden_memory`): the nearest one begins.
3. It is refined by simulation error (`hysim.identify`).
4. About the refined law the whole library is regressed, the law's own terms like all others: PySINDy's STLSQ and plain
   elimination from dense to sparse, one structure by BIC, inclusion by bagging (`_oscillator_response`). Terms that are
   not chosen leave the law, which is refined again. If terms come in, the Bouc-Wen law is refined with n free and with
   n at the nearest whole number, and where terms come in about the best of these too, the law of these terms. All this
   is done for each way in which the records may have been made.
5. Of all refined laws that do not diverge, the linear spring among them, the one of the lowest BIC is taken:

       BIC = N ln(V + floor^2) + d ln N

   with the same N samples and the same floor for each, V the mean squared residual of its free run, and d the number
   of its fitted parameters.
"""

from collections.abc import Sequence
from dataclasses import replace

from hysim._parallel import Progress
from hysim.discovery._memory_terms import memory_terms
from hysim.discovery._oscillator_records import checked, known_plant
from hysim.discovery._oscillator_response import Response
from hysim.discovery._oscillator_result import FoundOscillator
from hysim.discovery._oscillator_search import Search
from hysim.models.oscillator_structure import OscillatorStructure
from hysim.records import Record


def oscillator(
    records: Sequence[Record],
    *,
    structure: OscillatorStructure | None = None,
    mass: float | None = None,
    damping: float | None = None,
    stiffness: float | None = None,
    degree: int = 3,
    symmetry: str = "none",
    seed: int = 0,
    progress: Progress | None = None,
) -> FoundOscillator:
    """Find the hidden memory of ``m y'' + c y' + k y + z = u`` from u and y.

    Parameters
    ----------
    records : sequence of Record
        Force, displacement and time, evenly spaced; all of one plant. They must be long enough to hold several
        swings, and large enough for the memory to be curved: only that tells A from k.
    structure : OscillatorStructure, optional
        How the records were made, from ``BoucWenOscillator.structure(...)``. By default a record whose input
        repeats itself and whose periods are alike is taken as steady, its input as band-limited or as linear between
        samples, whichever fits better; any other record as beginning at rest, its input as linear between samples.
    mass, damping, stiffness : float, optional
        Known parts of the plant.
    degree : {1, 2, 3}
        Highest power of z in the library.
    symmetry : {"none", "odd"}
        Whether terms are left out that do not change their sign with u and z.
    seed : int
        Of the resampling behind `FoundOscillator.inclusion`.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    FoundOscillator

    Raises
    ------
    ValueError
        If a record has no even time, is too short, has a constant signal or is not that of a mass on springs, or an
        option is unknown.
    TypeError
        If an argument is not a record, or `structure` is not one.

    Examples
    --------
    >>> import numpy as np
    >>> import hysim as hs
    >>> from hysim.discovery._oscillator import oscillator
    >>> law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
    >>> plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    >>> t = np.arange(300) / 750
    >>> u = 60 * np.sin(2 * np.pi * (20 + 40 * t) * t)
    >>> found = oscillator([hs.Record(u=u, y=hs.simulate(plant, t, u).y, t=t)])
    >>> found.equation
    "z' = 50000 u' - 800 |u'| z + 300 u' |z|"
    """
    known = known_plant({"mass": mass, "damping": damping, "stiffness": stiffness})
    chosen, given = checked(records, structure, degree, symmetry), tuple(records)
    response = Response(chosen, given, known)
    library = memory_terms(degree, symmetry)
    others = () if structure is not None or chosen.period is None else (replace(chosen, hold="foh"),)
    return Search(chosen, others, given, response, library, seed, progress or (lambda done, total: None)).found()
