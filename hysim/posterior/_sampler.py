"""Draws from a posterior by emcee: an ensemble of walkers, all evaluated at once.

Most moves are independent draws from a proposal close to the posterior (`hysim.posterior._proposal`), which go from one
optimum to another; the others are moves of differential evolution along the difference of two other walkers
(C. ter Braak, Stat. Comput. 16 (2006) 239; B. Nelson, E. Ford and M. Payne, Astrophys. J. Suppl. 210 (2014) 11).

The walkers begin in the proposal. Runs that double their length warm the ensemble up, until one is ten times as long as
its correlation; after each, the proposal may be shaped anew by their paths. It is not changed any more then.

**Diagnostics** are of chains, shape (n_draws, n_chains), of one number, replaced by the normal quantiles of its ranks,
Phi^-1((rank - 3/8) / (n m + 1/4)), so that a parameter, its logarithm and a distribution without variance are judged
alike. With W the mean variance within the chains, B/n the variance of their means and var = (n - 1)/n W + B/n,

    R-hat = sqrt(var / W),    each chain cut into halves, which count as chains,
    rho_t = 1 - (W - mean of the autocovariances at lag t) / var,    tau = 1 + 2 sum rho_t,    effective = m n / tau.

The sum ends before the first pair rho_2k + rho_2k+1 that is not positive, and pairs do not grow (Geyer). Sources: A.
Gelman and others, Bayesian Data Analysis, 3rd edition, 2013, sections 11.4 and 11.5; A. Vehtari, A. Gelman, D. Simpson,
B. Carpenter and P.-C. Buerkner, Bayesian Anal. 16 (2021) 667, for the ranks ("bulk" effective samples).

**Particles around the optima** that `identify` has found. A population from the prior may miss a narrow optimum, whose
share of the prior is small and whose share of the posterior is not. So a small population begins at distances of all
sizes from each optimum, the likely of these points survive, and moves of differential evolution spread them: they take
the shape of the population whatever its scales.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.libraries import optional
from hysim._basics.progress import Reports
from hysim.posterior._proposal import EARLY_SHARE, GOOD, POOR, Proposal, even_mixture, moved, proposal_for
from hysim.posterior._target import Target

_FEWEST = 8  # draws of a chain
_ROUNDING = 1e-14  # of a variance


def split_rhat(chains: FloatArray) -> float:
    """R-hat over the halves of the chains; nan for fewer than 8 draws, inf where chains stand at different values."""
    half = len(chains) // 2
    if len(chains) < _FEWEST:
        return float("nan")
    halves = _ranked(np.concatenate([chains[:half], chains[-half:]], axis=1))
    within, total = _variances(halves)
    if within <= _ROUNDING * total:
        return 1.0 if total == 0.0 else float("inf")
    return float(np.sqrt(total / within))


def effective_samples(chains: FloatArray) -> float:
    """Number of independent draws whose mean rank would be as sure; nan for fewer than 8 draws."""
    n, m = chains.shape
    if n < _FEWEST:
        return float("nan")
    chains = _ranked(chains)
    within, total = _variances(chains)
    if total == 0.0:
        return float(n * m)
    lags = _autocovariance(chains).mean(axis=1)
    rho = 1.0 - (within - lags * n / (n - 1.0)) / total
    rho[0] = 1.0
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    pairs = np.minimum.accumulate(pairs[: ends[0] if ends.size else None])
    tau = max(2.0 * float(pairs.sum()) - 1.0, 1.0 / np.log10(n * m))
    return float(n * m / tau)


def _ranked(chains: FloatArray) -> FloatArray:
    """Normal quantiles of the ranks among all draws; equal draws have their mean rank."""
    from scipy import special, stats

    ranks = stats.rankdata(chains, axis=None).reshape(chains.shape)
    return np.asarray(special.ndtri((ranks - 0.375) / (chains.size + 0.25)))


def _variances(chains: FloatArray) -> tuple[float, float]:
    n, m = chains.shape
    within = float(chains.var(axis=0, ddof=1).mean())
    between = float(chains.mean(axis=0).var(ddof=1)) if m > 1 else 0.0
    return within, (n - 1.0) / n * within + between


def _autocovariance(chains: FloatArray) -> FloatArray:
    """Autocovariance at the lags 0 to n - 1 of each chain, (n, n_chains)."""
    n = len(chains)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(chains - chains.mean(axis=0), size, axis=0)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[:n] / n)


_MOST = 3  # optima, the best first
_EACH = 48  # particles of a population
_SIZES = (1e-6, 0.1)  # of the distances
_BEGUN = 8  # points for each particle
_FARTHEST = 3.0  # from the centre of the box, in which an optimum at a side begins
_SPREADING, _KEPT, _APART = 80, 6, 8  # moves, populations that are kept, and moves between these


def around_optima(target: Target, rng: np.random.Generator) -> FloatArray:
    """Particles (n, n_v) around the best optima of the fit."""
    populations = [_spread(target, start, rng) for start in target.optima[:_MOST]]
    return np.concatenate([np.empty((0, target.n_x + 1)), *populations])


def _spread(target: Target, start: FloatArray, rng: np.random.Generator) -> FloatArray:
    shortest, longest = np.log(_SIZES).tolist()
    sizes = np.exp(rng.uniform(shortest, longest, (_BEGUN * _EACH, 1)))
    v = np.clip(start, -_FARTHEST, _FARTHEST) + sizes * rng.standard_normal((len(sizes), start.size))
    value, prior = target.marginal(v)
    likely = np.argsort(-(value + prior + rng.gumbel(size=len(v))))[:_EACH]
    v, value, prior = v[likely], value[likely], prior[likely]
    kept = []
    for k in range(_SPREADING + _KEPT * _APART):
        v, value, prior = moved(target, v, value, prior, 1.0, rng)
        if k >= _SPREADING and (k - _SPREADING) % _APART == 0:
            kept.append(v)
    return np.concatenate(kept)


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


def fewest_effective(chains: FloatArray) -> float:
    """Fewest effective samples of the numbers in chains (n_draws, n_walkers, n_dim)."""
    return min(effective_samples(chains[..., k]) for k in range(chains.shape[2]))


def sampled(
    target: Target,
    *,
    walkers: int,
    samples: int,
    seed: int,
    most_steps: int,
    progress: Reports = None,
) -> Chains:
    """Chains with so many effective samples of each parameter, or with `most_steps` steps if these come first."""
    emcee = optional("emcee", "sampling a posterior", "bayes")
    rng = np.random.default_rng(seed)
    least = GOOD if samples >= _MANY else POOR
    proposal, reaching = proposal_for(target, around_optima(target, rng), rng, least)
    sampler = _Ensemble(emcee, target, walkers, proposal, reaching)
    first = _first(target, proposal, walkers, rng)
    state = emcee.State(first, random_state=np.random.RandomState(rng.integers(2**31)).get_state())
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
        effective = fewest_effective(q)
        if is_enough := effective >= samples or spent >= most_steps:  # in these coordinates
            further = target.parameters(q[len(parameters) :].reshape(-1, target.n_dim))
            parameters = np.concatenate([parameters, further.reshape(-1, *parameters.shape[1:])])
            effective = fewest_effective(parameters)
        tau = max(len(q) * thin * walkers / effective, 1.0)
        if progress:
            progress(min(int(effective), samples), samples)
        if is_enough and (effective >= samples or spent >= most_steps):
            return Chains(q, parameters, log_density, sampler.acceptance, sampler.proposal)


class _Ensemble:
    def __init__(self, emcee: Any, target: Target, walkers: int, proposal: Proposal, reaching: Proposal) -> None:
        self.target, self.proposal, self.reaching = target, proposal, reaching
        self.walkers, self.acceptance = walkers, float("nan")
        evolution = emcee.moves.DEMove
        moves = [(emcee.moves.MHMove(self._independent), 0.7), (evolution(), 0.15), (evolution(gamma0=0.1), 0.15)]
        self.sampler = emcee.EnsembleSampler(walkers, target.n_dim, target.log_posterior, vectorize=True, moves=moves)

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
            tau = steps * self.walkers / fewest_effective(q)
            self._shape(q[steps // 4 :], rng)
            if steps >= _LONG * tau or 2 * spent + 2 * steps > most_steps:
                return state, tau, spent
            steps *= 2

    def _shape(self, q: FloatArray, rng: np.random.Generator) -> None:
        """Shape the proposal by one half of these paths, if that has the larger density on the other half."""
        half = len(q) // 2
        first, second = (_some(part.reshape(-1, q.shape[2]), rng) for part in (q[:half], q[half:]))
        trial = even_mixture(self.target.without_linear(first), self.target, rng).beside(self.reaching, EARLY_SHARE)
        if trial.log_density(second).mean() > self.proposal.log_density(second).mean():
            self.proposal = trial


def _some(q: FloatArray, rng: np.random.Generator) -> FloatArray:
    return q[rng.choice(len(q), min(_SHAPING, len(q)), replace=False)]


def _first(target: Target, proposal: Proposal, walkers: int, rng: np.random.Generator) -> FloatArray:
    drawn = proposal.draw(_TRIED * walkers, rng)
    weight = target.log_posterior(drawn) - proposal.log_density(drawn)
    finite = np.flatnonzero(np.isfinite(weight))
    if finite.size < walkers:
        raise ValueError("no parameters near the fit have a probability: check that the priors hold the estimates")
    gumbel = weight[finite] + rng.gumbel(size=finite.size)
    return np.asarray(drawn[finite[np.argsort(-gumbel)[:walkers]]])
