"""Everything that `reproduce` computes, before any of it is written."""

from collections.abc import Mapping
from typing import Any

from hysim._basics.frozen import frozen
from hysim._basics.parallel import awaited, forked
from hysim.paper.camera import (
    CameraLoop,
    hysteresis_cameras,
    learned_steps,
    learned_triangles,
    period_rows,
    vibration_cameras,
)
from hysim.paper.claims import Claim, claims, evidence
from hysim.paper.equations import Approximation, Characteristics, printed_characteristics
from hysim.paper.loops import Case, Loops, control_measures, law_plant, on_equations, with_law
from hysim.paper.reidentification import Reidentification, reidentify
from hysim.paper.search import Found, stored_starts
from hysim.paper.study import Progress, Study, bouc_wen, dwell_rows, study


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
    cameras, learned : tuple of CameraLoop
        Those that a camera closes, and those whose reference is learned from its readings.
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
    learned: tuple[CameraLoop, ...]
    periods: list[dict[str, float]]
    dwell: list[dict[str, float]]
    claims: tuple[Claim, ...]
    approximations: tuple[Approximation, ...]
    equations: Mapping[str, Characteristics]

    @property
    def searches(self) -> list[Found]:
        """The search of every controller; some controllers run in several loops."""
        cases: tuple[Case[Any], ...] = (*self.loops.hysteresis, *self.loops.steps, *self.loops.squares)
        return [*(case.found for case in cases), *(camera.found for camera in self.cameras if camera.found)]


def find(*, quick: bool = False, thorough: bool = False, progress: Progress | None = None) -> Findings:
    """Compute everything.

    Parameters
    ----------
    quick : bool
        Leave the cross-validation out.
    thorough : bool
        Search all controllers without their stored optima.
    progress : callable, optional
        Called as ``progress(done, total, what)`` before each step.
    """
    say, last = progress or (lambda done, total, what: None), 9
    starts = {} if thorough else stored_starts()
    with forked(1) as beside:
        laws = {name: beside.submit(bouc_wen, name, quick) for name in ("bouc-wen-asymmetric", "bouc-wen")}
        equations = beside.submit(on_equations, starts)
        say(0, last, "cameras")
        on_vibration = vibration_cameras(starts)
        models = study(
            quick=quick,
            progress=lambda done, total, what: say(done, last, what),
            law=lambda name, _: awaited(laws[name]),
        )
        again = beside.submit(reidentify, models.fits["tf-identified"])
        say(last - 1, last, "closed loops")
        asymmetric_model = models.fits["bouc-wen-asymmetric"].model
        triangles = beside.submit(learned_triangles, asymmetric_model)
        cameras = (*hysteresis_cameras(asymmetric_model, starts), *on_vibration)
        closed = with_law(awaited(equations), asymmetric_model, starts)
        steps = learned_steps()
        periods = period_rows(asymmetric_model, closed.hysteresis[0], cameras)
        reidentification, learned = awaited(again), (*awaited(triangles), *steps)
    say(last, last, "claims")
    law, of = models.fits["bouc-wen"].model, evidence(models, reidentification, control_measures(closed))
    return Findings(
        study=models,
        reidentification=reidentification,
        loops=closed,
        cameras=cameras,
        learned=learned,
        periods=periods,
        dwell=dwell_rows(law, law_plant(law)),
        claims=claims(of),
        approximations=tuple(of.approximations.values()),
        equations=printed_characteristics(),
    )
