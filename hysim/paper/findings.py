"""Everything that `reproduce` computes, before any of it is written."""

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from hysim._frozen import frozen
from hysim._parallel import awaited, second_process
from hysim.paper.approximations import Approximation, approximations
from hysim.paper.camera import CameraLoop, hysteresis_cameras, vibration_cameras
from hysim.paper.claims import Claim, claims, evidence
from hysim.paper.dwell import DwellWidth, dwell_widths
from hysim.paper.equations import EQUATION_1, EQUATION_4, EQUATION_6, Characteristics, characteristics
from hysim.paper.loops import DYNAMICS_7, Loops, control_measures, loops, on_equations
from hysim.paper.periods import PeriodCurve, period_curves
from hysim.paper.reidentification import Reidentification, reidentify
from hysim.paper.state_space import EQUATIONS_7_8, EQUATIONS_13_14
from hysim.paper.study import Progress, Study, asymmetric_law, study
from hysim.plants.actuator import Actuator
from hysim.plants.transfer_function import TransferFunction


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
    periods : tuple of PeriodCurve
        Reduction of the hysteresis against the period of the triangle.
    dwell : tuple of DwellWidth
        Loop width against dwell.
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
    periods: tuple[PeriodCurve, ...]
    dwell: tuple[DwellWidth, ...]
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
    with second_process() as beside:
        asymmetric = beside.submit(asymmetric_law, quick)
        equations = beside.submit(on_equations)
        vibration = beside.submit(vibration_cameras)
        begun: dict[str, Future[Reidentification]] = {}

        def begin(name: str, fit: Any) -> None:
            if name == "tf-identified":
                begun[name] = beside.submit(reidentify, fit)

        steps = _Steps(progress)
        models = study(quick=quick, progress=steps.inner, finished=begin, asymmetric=lambda _: awaited(asymmetric))
        steps.next("closed loops")
        asymmetric_model = models.fits["bouc-wen-asymmetric"].model
        on_hysteresis = hysteresis_cameras(asymmetric_model)
        closed = loops(asymmetric_model, lambda: awaited(equations))
        cameras = (*on_hysteresis, *awaited(vibration))
        reidentification = awaited(begun["tf-identified"])
    steps.next("claims")
    law = models.fits["bouc-wen"].model
    return Findings(
        study=models,
        reidentification=reidentification,
        loops=closed,
        cameras=cameras,
        periods=period_curves(asymmetric_model, closed.hysteresis[0], cameras),
        dwell=dwell_widths(
            models.comparison.record.u,
            EQUATION_1,
            Actuator(hysteresis=law),
            Actuator(hysteresis=law, vibration=DYNAMICS_7),
        ),
        claims=claims(evidence(models, reidentification, control_measures(closed))),
        approximations=approximations(),
        equations={name: characteristics(model) for name, model in _transfer_functions().items()},
    )


def _transfer_functions() -> dict[str, TransferFunction]:
    return {
        "(1)": EQUATION_1,
        "(7), (8)": EQUATIONS_7_8.transfer_function,
        "(4)": EQUATION_4,
        "(6)": EQUATION_6,
        "(13), (14)": EQUATIONS_13_14.transfer_function,
    }


class _Steps:
    """Progress over the study's steps and those after it."""

    after = 2

    def __init__(self, progress: Progress | None) -> None:
        self.progress, self.done, self.total = progress, 0, 0

    def inner(self, done: int, total: int, what: str) -> None:
        self.done, self.total = done, total + self.after
        self.next(what, advance=0)

    def next(self, what: str, advance: int = 1) -> None:
        self.done += advance
        if self.progress is not None:
            self.progress(self.done, self.total, what)
