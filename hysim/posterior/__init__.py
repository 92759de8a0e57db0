"""Distributions in place of optima: `sample_posterior`, and which model the data prefer, `compare_evidence`.

Both stand on the problem that `identify` solves, with its box, its noise and its batches.
"""

from hysim.posterior._evidence import FACTORS, Evidence, EvidenceRow, compare_evidence, log_evidence
from hysim.posterior._sample import Posterior, Prediction, sample_posterior

__all__ = [
    "FACTORS",
    "Evidence",
    "EvidenceRow",
    "Posterior",
    "Prediction",
    "compare_evidence",
    "log_evidence",
    "sample_posterior",
]
