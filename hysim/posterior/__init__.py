"""Distributions in place of optima: `sample_posterior`, and `compare_evidence` of models on the same records."""

from hysim.posterior._evidence import FACTORS, Evidence, EvidenceRow, compare_evidence, log_evidence
from hysim.posterior._sample import Posterior, Prediction, sample_posterior

__all__ = ["FACTORS", "Evidence", "EvidenceRow", "Posterior", "Prediction", "compare_evidence", "log_evidence"]
__all__ += ["sample_posterior"]
