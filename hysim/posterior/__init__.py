"""Distributions in place of optima: `sample_posterior`, and `compare_evidence` of models on the same records."""

from hysim.posterior._evidence import FACTORS as FACTORS
from hysim.posterior._evidence import Evidence as Evidence
from hysim.posterior._evidence import EvidenceRow as EvidenceRow
from hysim.posterior._evidence import compare_evidence as compare_evidence
from hysim.posterior._evidence import log_evidence as log_evidence
from hysim.posterior._sample import Posterior as Posterior
from hysim.posterior._sample import Prediction as Prediction
from hysim.posterior._sample import sample_posterior as sample_posterior
