"""Draws from a posterior by emcee: an ensemble of walkers, all evaluated at once.

Most moves are independent draws from a proposal close to the posterior (`hysim.posterior._proposal`), which go from one
optimum to another; the others are moves of differential evolution along the difference of two other walkers
(C. ter Braak, Stat. Comput. 16 (2006) 239; B. Nelson, E. Ford and M. Payne, Astrophys. J. Suppl. 210 (2014) 11).

The walkers begin in the proposal. Runs that double their length warm the ensemble up, until one is ten times as long as
its correlation; after each, the proposal may be shaped anew by their paths. It is not changed any more then.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim._versions import optional
from hysim.posterior._chains import effective_samples, split_rhat
from hysim.posterior._mixture import Proposal, mixture
from hysim.posterior._optima import around_optima
from hysim.posterior._proposal import EARLY_SHARE, GOOD, POOR, proposal_for
from hysim.posterior._target import Target

_MANY = 5000  # samples from which on a good proposal saves more time than it takes to grow
_FIRST = 100  # steps of the first run
_SHAPING = 4096  # points of the walkers' paths that shape a proposal
_LONG = 10.0  # correlation times of a run, from which on the ensemble counts as warm
_DRAWS_PER_TIME = 2.0  # that are kept in a correlation time
_SLACK = 1.05  # draws more than needed, as the estimate of the correlation has an error
_PORTION, _LAST = 0.5, 0.1  # of the missing draws, and of all: what is drawn before the correlation is looked at again
_AT_LEAST = 8  # steps of a run
_TRIED = 20  # points of the proposal for each walker that begins


@dataclass(frozen=True)
class Chains:
    """Points (n_draws, n_walkers, n_dim), the user's parameters and sigma there, and ln p (n_draws, n_walkers).

    `acceptance` is the share of the moves that were accepted, and `proposal` one that does not depend on these draws.
    """

    q: FloatArray
    parameters: FloatArray
    log_density: FloatArray
    acceptance: float
    proposal: Proposal

    @property
    def flat(self) -> FloatArray:
        """Points (n_draws n_walkers, n_dim)."""
        return self.q.reshape(-1, self.q.shape[2])


def worst(chains: FloatArray) -> tuple[float, float]:
    """Fewest effective samples and largest R-hat of the numbers in chains (n_draws, n_walkers, n_dim)."""
    every = [chains[..., k] for k in range(chains.shape[2])]
    return min(map(effective_samples, every)), max(map(split_rhat, every))


def sampled(
    target: Target,
    *,
    walkers: int,
    samples: int,
    seed: int,
    most_steps: int,
    progress: Callable[[int, int], None] | None = None,
) -> Chains:
    """Chains with so many effective samples of each parameter, or with `most_steps` steps if these come first."""
    emcee = optional("emcee", "sampling a posterior", "bayes")
    rng = np.random.default_rng(seed)
    least = GOOD if samples >= _MANY else POOR
    proposal, reaching = proposal_for(target, around_optima(target, rng), rng, least)
    sampler = _Ensemble(emcee, target, walkers, proposal, reaching)
    state = emcee.State(
        _first(target, proposal, walkers, rng),
        random_state=np.random.RandomState(rng.integers(2**31)).get_state(),
    )
    state, tau, spent = sampler.warmed(state, most_steps, rng)
    thin = max(1, int(tau / _DRAWS_PER_TIME))
    parts: list[Any] = []
    parameters = np.empty((0, walkers, len(target.names)))
    effective = 0.0
    while True:
        portion = max(_PORTION * (samples - effective), _LAST * samples)  # tau is known badly at first
        missing = _SLACK * portion * tau / walkers
        draws = max(_AT_LEAST, min(int(missing / thin) + 1, (most_steps - spent) // thin))
        state, q, log_density = sampler.run(state, draws, thin)
        spent += draws * thin
        parts.append((q, log_density))
        q, log_density = (np.concatenate(each) for each in zip(*parts, strict=True))
        effective = worst(q)[0]
        if is_enough := effective >= samples or spent >= most_steps:  # in these coordinates
            further = target.parameters(q[len(parameters) :].reshape(-1, target.n_dim))
            parameters = np.concatenate([parameters, further.reshape(-1, *parameters.shape[1:])])
            effective = worst(parameters)[0]
        tau = max(len(q) * thin * walkers / effective, 1.0)
        if progress is not None:
            progress(min(int(effective), samples), samples)
        if is_enough and (effective >= samples or spent >= most_steps):
            return Chains(q, parameters, log_density, sampler.acceptance, sampler.proposal)


class _Ensemble:
    """Walkers of emcee on a target, with a proposal close to it."""

    def __init__(self, emcee: Any, target: Target, walkers: int, proposal: Proposal, reaching: Proposal) -> None:
        self.target, self.proposal, self.reaching = target, proposal, reaching
        self.walkers, self.acceptance = walkers, float("nan")
        moves = emcee.moves
        self.sampler = emcee.EnsembleSampler(
            walkers,
            target.n_dim,
            target.log_posterior,
            vectorize=True,
            moves=[
                (moves.MHMove(self._independent), 0.7),
                (moves.DEMove(), 0.15),
                (moves.DEMove(gamma0=0.1), 0.15),
            ],
        )

    def _independent(self, q: FloatArray, random: Any) -> tuple[FloatArray, FloatArray]:
        """Draws from the proposal for all walkers, and ln of the ratio of its densities at q and at the draws."""
        drawn = self.proposal.draw(len(q), np.random.default_rng(random.randint(2**31)))
        return drawn, self.proposal.log_density(q) - self.proposal.log_density(drawn)

    def run(self, state: Any, draws: int, thin: int = 1) -> tuple[Any, FloatArray, FloatArray]:
        """The state after the run, points (draws, n_walkers, n_dim), and ln p (draws, n_walkers)."""
        self.sampler.reset()
        state = self.sampler.run_mcmc(state, draws, thin_by=thin)
        self.acceptance = float(self.sampler.backend.accepted.mean()) / draws  # the backend counts kept moves alone
        return state, self.sampler.get_chain(), self.sampler.get_log_prob()

    def warmed(self, state: Any, most_steps: int, rng: np.random.Generator) -> tuple[Any, float, int]:
        """A state of the warm ensemble, its correlation time in steps, and the steps that were spent."""
        steps, spent = _FIRST, 0
        while True:
            state, q, _ = self.run(state, steps)
            spent += steps
            tau = steps * self.walkers / worst(q)[0]
            self._shape(q[steps // 4 :], rng)
            if steps >= _LONG * tau or 2 * spent + 2 * steps > most_steps:
                return state, tau, spent
            steps *= 2

    def _shape(self, q: FloatArray, rng: np.random.Generator) -> None:
        """Shape the proposal by one half of these paths, if that has the larger density on the other half."""
        half = len(q) // 2
        first, second = (_some(part.reshape(-1, q.shape[2]), rng) for part in (q[:half], q[half:]))
        v = self.target.without_linear(first)
        trial = mixture(v, np.ones(len(v)), self.target.n_linear, rng).beside(self.reaching, EARLY_SHARE)
        if trial.log_density(second).mean() > self.proposal.log_density(second).mean():
            self.proposal = trial


def _some(q: FloatArray, rng: np.random.Generator) -> FloatArray:
    return q[rng.choice(len(q), min(_SHAPING, len(q)), replace=False)]


def _first(target: Target, proposal: Proposal, walkers: int, rng: np.random.Generator) -> FloatArray:
    """Points of finite density from the proposal, the better of many."""
    drawn = proposal.draw(_TRIED * walkers, rng)
    weight = target.log_posterior(drawn) - proposal.log_density(drawn)
    finite = np.flatnonzero(np.isfinite(weight))
    if finite.size < walkers:
        raise ValueError("no parameters near the fit have a probability: check that the priors hold the estimates")
    gumbel = weight[finite] + rng.gumbel(size=finite.size)
    return np.asarray(drawn[finite[np.argsort(-gumbel)[:walkers]]])
