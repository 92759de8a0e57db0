"""`hysim reproduce`: the paper's 52 points, every model side by side, as a report."""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from hysim.cli import outputs, records

if TYPE_CHECKING:
    from hysim.paper.claims import Claim
    from hysim.paper.study import Study

SUCCESS, NOT_CONVERGED = 0, 1


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "reproduce",
        help="rebuild the paper's results and write a report",
        description="Identify, discover and compare models on the 52 voltage-displacement points of the paper, "
        "and write report.html, summary.json, figures and tables.",
    )
    parser.add_argument(
        "--out", metavar="DIR", default="reproduction", help="folder to write into (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="leave the cross-validation out")
    parser.add_argument("--json", action="store_true", help="print summary.json in place of the short table")
    parser.set_defaults(command=run)


def run(options: argparse.Namespace) -> int:
    """Reproduce, and print the short table."""
    from hysim.paper import reproduce

    done = reproduce(options.out, quick=options.quick, progress=_progress if sys.stderr.isatty() else None)
    if options.json:
        outputs.write({records.STANDARD: (done.folder / "summary.json").read_text(encoding="utf-8")})
        return _code(done.findings.study)
    study = done.findings.study
    comparison, loop = study.comparison, study.comparison.loop
    print(
        f"Table 1: {len(comparison.record)} points, stroke {loop.stroke:.3f} um; the loop is {loop.max_width:.3f} um "
        f"wide at {loop.max_width_at:g} V, {loop.mean_width:.4f} um on average, area {loop.area:.2f} um V"
    )
    print(comparison.to_text())
    for name, fit in study.fits.items():
        for region, best in fit.regions.items():
            print(f"{name}: the best {region} law fits {best.fit_percent:.2f} %")
    print(f"sindy: {study.discovery.equation}  ({study.discovery.verdict})")
    for line in _verdicts(done.findings.claims):
        print(line)
    print(f"report: {done.folder / 'report.html'}")
    return _code(study)


def _code(study: "Study") -> int:
    return SUCCESS if all(fit.success for fit in study.fits.values()) else NOT_CONVERGED


def _verdicts(claims: "Sequence[Claim]") -> Iterator[str]:
    """How many claims have each verdict, and what became of the two headline figures."""
    counts = Counter(claim.verdict for claim in claims)
    yield f"{len(claims)} claims: " + ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    for claim in claims:
        if claim.id.startswith(("hysteresis-90", "vibration-97")):
            yield f"{claim.id}: {claim.recomputed:.1f} % where the paper says {claim.printed:g} %, {claim.verdict}"


def _progress(done: int, total: int, what: str) -> None:
    print(f"[{done + 1}/{total + 1}] {what}", file=sys.stderr, flush=True)
