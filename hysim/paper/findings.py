"""Everything that `reproduce` computes, before any of it is written."""

from collections.abc import Mapping

from hysim._basics.frozen import frozen
from hysim._basics.parallel import awaited, second_process
from hysim.paper.camera import CameraLoop, hysteresis_cameras, period_rows, vibration_cameras
from hysim.paper.claims import Claim, claims, evidence
from hysim.paper.equations import Approximation, Characteristics, approximations, printed_characteristics
from hysim.paper.loops import Loops, control_measures, law_plant, loops, on_equations
from hysim.paper.reidentification import Reidentification, reidentify
from hysim.paper.study import Progress, Study, asymmetric_law, dwell_rows, study


@frozen
class Findings:
    """Results of the reproduction.

    Parameters
    ----------
    study : Study
        The models of Table 1.
    reidentification : Reidentification
        Equations (1) and (4) identified anew.
    loops : Loops
        The closed loops.
    cameras : tuple of CameraLoop
        Those that a camera closes.
    periods : list of dict
        Reduction of the hysteresis against the period of the triangle.
    dwell : list of dict
        Loop width against dwell, as `summary.json` has it.
    claims : tuple of Claim
        Every claim with its verdict.
    approximations : tuple of Approximation
        (7) as an estimate of (1), and (6) of (4).
    equations : mapping
        The transfer functions by their equations' numbers, and what they are like.
    """

    study: Study
    reidentification: Reidentification
    loops: Loops
    cameras: tuple[CameraLoop, ...]
    periods: list[dict[str, float]]
    dwell: list[dict[str, float]]
    claims: tuple[Claim, ...]
    approximations: tuple[Approximation, ...]
    equations: Mapping[str, Characteristics]


def find(*, quick: bool = False, progress: Progress | None = None) -> Findings:
    """Compute everything.

    Parameters
    ----------
    quick : bool
        Leave the cross-validation out.
    progress : callable, optional
        Called as ``progress(done, total, what)`` before each step.
    """
    say = progress or (lambda done, total, what: None)
    with second_process() as beside:
        asymmetric = beside.submit(asymmetric_law, quick)
        equations = beside.submit(on_equations)
        vibration = beside.submit(vibration_cameras)
        models = study(
            quick=quick,
            progress=lambda done, total, what: say(done, total + 2, what),
            asymmetric=lambda _: awaited(asymmetric),
        )
        again = beside.submit(reidentify, models.fits["tf-identified"])
        last = len(models.comparison.rows) + 2
        say(last - 1, last, "closed loops")
        asymmetric_model = models.fits["bouc-wen-asymmetric"].model
        on_hysteresis = hysteresis_cameras(asymmetric_model)
        closed = loops(asymmetric_model, lambda: awaited(equations))
        cameras = (*on_hysteresis, *awaited(vibration))
        reidentification = awaited(again)
    say(last, last, "claims")
    law = models.fits["bouc-wen"].model
    return Findings(
        study=models,
        reidentification=reidentification,
        loops=closed,
        cameras=cameras,
        periods=period_rows(asymmetric_model, closed.hysteresis[0], cameras),
        dwell=dwell_rows(law, law_plant(law)),
        claims=claims(evidence(models, reidentification, control_measures(closed))),
        approximations=approximations(),
        equations=printed_characteristics(),
    )
