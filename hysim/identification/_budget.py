"""The number of parameter sets that a search may simulate."""

from dataclasses import dataclass

_LEAST = 64  # sets that are always compared
_SHARE = 0.5  # of what remains, for one stage of the search


@dataclass
class Budget:
    """So many samples may be simulated; `spent` of them have been, and `cut` says whether a stage was shortened."""

    samples: float
    spent: float = 0.0
    cut: bool = False

    def take(self, n_sets: int, n_samples: int) -> None:
        """Count sets that are simulated."""
        self.spent += float(n_sets) * n_samples

    def sets(self, wanted: int, n_samples: int) -> int:
        """As many of the `wanted` sets as a stage may simulate."""
        allowed = max(_LEAST, int(_SHARE * (self.samples - self.spent) / n_samples))
        self.cut = self.cut or allowed < wanted
        return min(wanted, allowed)

    def steps(self, wanted: int, sets_a_step: int, n_samples: int) -> int:
        """As many of the `wanted` steps of a descent as a stage may take."""
        return min(wanted, max(0, int(_SHARE * (self.samples - self.spent) / (sets_a_step * n_samples))))
