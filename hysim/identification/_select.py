"""The verb `select`: several candidates identified on the same records, and ranked by a criterion."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hysim._basics.frozen import check_choice
from hysim._basics.printing import aligned, frozen_result, summary_text
from hysim._basics.progress import Reports, announced_by, reports
from hysim.identification._identify import identify
from hysim.identification._result import Identification
from hysim.identification._search import sharing
from hysim.interop import frame
from hysim.records import Record

CRITERIA = ("bic", "aic", "fpe", "cv_rmse")


@frozen_result
class Selection:
    """Candidates identified on the same records, ranked by a criterion.

    Parameters
    ----------
    criterion : {"bic", "aic", "fpe", "cv_rmse"}
    name : str
        Name of the best candidate.
    fits : mapping
        Name to `Identification`, the best first.
    """

    criterion: str
    name: str
    fits: Mapping[str, Identification]

    @property
    def best(self) -> Identification:
        """Fit of the best candidate."""
        return self.fits[self.name]

    def __str__(self) -> str:
        return summary_text(
            [f"Selection: {self.name} is the best of {len(self.fits)} by {self.criterion}", self.to_text()]
        )

    def to_text(self) -> str:
        """The table for a terminal, the best first."""
        rows = [
            [
                name if fit.success else f"{name} ({'UNSAFE' if fit.unsafe else 'partial'})",
                str(fit.n_parameters),
                "-" if math.isnan(fit.fit_percent) else f"{fit.fit_percent:.2f}",
                f"{fit.rmse:.4g}",
                f"{vars(fit)[self.criterion]:.6g}",
            ]
            for name, fit in self.fits.items()
        ]
        header, *lines = aligned([["candidate", "parameters", "fit [%]", "rmse", self.criterion], *rows])
        return "\n".join([header, "-" * len(header), *lines])

    def to_frame(self) -> Any:
        """The candidates as a `pandas.DataFrame`, one row each, the best first; ImportError without pandas."""
        names = ("n_parameters", "fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic", "success", "message")
        return frame(
            {name: [vars(fit)[name] for fit in self.fits.values()] for name in names},
            index=("candidate", [*self.fits]),
            notes={"criterion": self.criterion},
        )


@reports
def select(
    candidates: Mapping[str, Any] | Sequence[Any],
    record_or_records: Record | Sequence[Record],
    *,
    criterion: str = "bic",
    initial: str | Sequence[str] | None = None,
    noise: str = "gaussian",
    cross_validate: str | int | None = None,
    max_evaluations: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Reports = None,
    announce: Callable[[str], None] | None = None,
) -> Selection:
    """Identify several candidates, and rank them.

    Parameters
    ----------
    candidates : mapping or sequence
        Name to what `identify` takes: class, model or structure. In a sequence a class has its name, others their text.
    record_or_records : Record or sequence of Record
        As in `identify`, the same for all.
    criterion : {"bic", "aic", "fpe", "cv_rmse"}
        Criterion of the ranking; the last needs `cross_validate`. Of data without noise the others mean nothing.
    initial, noise, cross_validate, max_evaluations, seed, workers
        As in `identify`, the same for all. A fit that ends by `max_evaluations` is marked as partial.
    progress : callable or False, optional
        Called as ``progress(done, total)`` after each candidate; see `hysim.simulate`.
    announce : callable, optional
        Called as ``announce(name)`` before each candidate.

    Returns
    -------
    Selection

    Raises
    ------
    ValueError
        If there is no candidate, two have one name, the criterion is unknown or not computed, or as `identify`.
    TypeError
        If a candidate is not something that can be identified.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1(dwell=1.0)
    >>> hs.select([hs.Line, hs.SingleValued], rec).name
    'SingleValued'
    """
    check_choice("criterion", criterion, CRITERIA)
    if criterion == "cv_rmse" and cross_validate is None:
        raise ValueError('criterion="cv_rmse" needs a cross-validation: cross_validate="loo", or a number of blocks')
    named, report = _named(candidates), progress or (lambda done, total: None)
    options: dict[str, Any] = {"initial": initial, "noise": noise, "cross_validate": cross_validate, "seed": seed}
    options |= {"max_evaluations": max_evaluations, "workers": workers}
    fits: dict[str, Identification] = {}
    announce = announce or announced_by(progress)
    with sharing():
        for name, candidate in named.items():
            if announce is not None:
                announce(name)
            fits[name] = identify(candidate, record_or_records, **options)
            report(len(fits), len(named))

    def score(name: str) -> float:
        value = float(vars(fits[name])[criterion])
        return math.inf if math.isnan(value) else value

    ranked = sorted(fits, key=score)
    return Selection(criterion=criterion, name=ranked[0], fits={name: fits[name] for name in ranked})


def _named(candidates: Mapping[str, Any] | Sequence[Any]) -> dict[str, Any]:
    if isinstance(candidates, str) or not isinstance(candidates, (Mapping, Sequence)):
        raise TypeError(f"select takes several candidates, got {type(candidates).__name__}: use identify for one")
    if isinstance(candidates, Mapping):
        named = dict(candidates)
    else:
        named = {each.__name__ if isinstance(each, type) else str(each): each for each in candidates}
    if len(named) < len(candidates):
        raise ValueError("two candidates have one name: give a mapping, name to candidate")
    if not named:
        raise ValueError("there is nothing to select from: give at least one candidate")
    return named
