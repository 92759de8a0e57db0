"""`hysim reproduce`: the paper's 52 points, every model side by side, as a report."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from hysim.cli.options import Command

if TYPE_CHECKING:
    from hysim.paper.claims import Claim
    from hysim.paper.study import Study

SUCCESS, NOT_CONVERGED = 0, 1


def run(options: argparse.Namespace) -> int:
    """Reproduce, and print the short table."""
    from hysim.paper import reproduce

    result = reproduce(options.out, quick=options.quick, page=options.page)
    study = result.findings.study
    if options.json:
        print((result.folder / "summary.json").read_text(encoding="utf-8"), end="")
    else:
        print(*_lines(study), *_verdicts(result.findings.claims), f"report: {result.folder / 'report.html'}", sep="\n")
    return SUCCESS if all(fit.success for fit in study.fits.values()) else NOT_CONVERGED


def _lines(study: "Study") -> Iterator[str]:
    comparison, loop = study.comparison, study.comparison.loop
    yield (
        f"Table 1: {len(comparison.record)} points, stroke {loop.stroke:.3f} um; the loop is {loop.max_width:.3f} um "
        f"wide at {loop.max_width_at:g} V, {loop.mean_width:.4f} um on average, area {loop.area:.2f} um V"
    )
    yield comparison.to_text()
    for name, fit in study.fits.items():
        for region, best in fit.regions.items():
            yield f"{name}: the best {region} law fits {best.fit_percent:.2f} %"
    yield f"sindy: {study.discovery.equation}  ({study.discovery.verdict})"


def _verdicts(claims: "Sequence[Claim]") -> Iterator[str]:
    """The number of claims with each verdict, and the verdicts on the two headline figures."""
    counts = Counter(claim.verdict for claim in claims)
    yield f"{len(claims)} claims: " + ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    for claim in claims:
        if claim.id.startswith(("hysteresis-90", "vibration-97")):
            yield f"{claim.id}: {claim.recomputed:.1f} % where the paper says {claim.printed:g} %, {claim.verdict}"


COMMAND = Command(
    "reproduce",
    "rebuild the paper's results and write a report",
    "Identify, discover and compare models on the 52 voltage-displacement points of the paper, and write report.html, "
    "summary.json, figures and tables.",
    """
--out DIR  folder to write into [default: reproduction]
--quick  skip the cross-validation
--page  also write table1.html, a page for a browser: the identified Bouc-Wen law with sliders over the 52 points
--json  print summary.json instead of the short table
""",
    run,
    """
hysim reproduce --quick
hysim reproduce --out report --page
""",
)
