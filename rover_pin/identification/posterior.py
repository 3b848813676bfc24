"""The posterior distribution of soil parameters, sampled with emcee (extra `rover-pin[bayes]`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.base.errors import MissingExtraError, OptimisationError, ParameterError, closest
from rover_pin.contact import Soil
from rover_pin.estimation.covariance import covariance
from rover_pin.estimation.problem import Prior, Problem
from rover_pin.identification.identify import build, identify
from rover_pin.measurements.channel import Evidence


@dataclass(frozen=True)
class Chain:
    """How long and from which seed the posterior is sampled: walkers times (steps - burn_in) samples."""

    walkers: int = 24
    steps: int = 1000
    burn_in: int = 200
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples [n, p] of the free parameters in SI."""

    names: tuple[str, ...]
    samples: np.ndarray = field(repr=False)
    autocorrelation: float
    "integrated autocorrelation time [steps], the longest of the parameters"
    acceptance: float
    "share of accepted moves"

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the central interval of a parameter that holds `level` of the samples."""
        if name not in self.names:
            raise ParameterError(f"'{name}' was not free: {closest(name, self.names)}")
        column = self.samples[:, self.names.index(name)]
        low, high = np.quantile(column, [(1 - level) / 2, (1 + level) / 2])
        return float(low), float(high)


def posterior(
    data: Evidence | Sequence[Evidence],
    soil: Soil,
    free: Sequence[str] = ("k", "phi"),
    priors: Mapping[str, Prior] | None = None,
    chain: Chain = Chain(),
) -> Posterior:
    """Sample the posterior of the free parameters around the fit of `identify`.

    ln p = -chi2 / 2 inside the parameters' bounds, priors included. Where no prior is stated the density is flat in the
    coordinate of the fit: in the logarithm for k, n and k_1 + k_2 b, in the value for the others. Where the data do not
    close a parameter, the samples are as wide as its bounds: they show the bounds, not the soil.

    Raises
    ------
    MissingExtraError
        emcee is not installed.
    ParameterError, DataError, OptimisationError
        As `identify`; also an OptimisationError for a chain too short to tell its own length (`status` holds the time).
    """
    emcee = _emcee()
    best = identify(data, soil, free, priors).soil
    problem = build(data, best, free, priors or {})
    walkers = _walkers(problem, chain)
    sampler = emcee.EnsembleSampler(chain.walkers, len(problem.space.names), lambda u: log_density(problem, u))
    sampler.random_state = np.random.RandomState(chain.seed).get_state()
    sampler.run_mcmc(walkers, chain.steps)
    time = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
    if not time < (chain.steps - chain.burn_in) / 10:
        raise OptimisationError(
            f"the chain is too short: its memory is {time:.0f} of {chain.steps} steps; give at least {20 * time:.0f}.",
            status=time,
        )
    samples = sampler.get_chain(discard=chain.burn_in, flat=True)
    return Posterior(
        names=problem.space.names,
        samples=np.array([problem.space.values(u) for u in samples]),
        autocorrelation=time,
        acceptance=float(np.mean(sampler.acceptance_fraction)),
    )


def log_density(problem: Problem, u: np.ndarray) -> float:
    """Return ln of the posterior density in u, up to a constant; minus infinity outside the bounds."""
    if (u < problem.space.low).any() or (u > problem.space.high).any():
        return -np.inf
    return -problem.chi2(u) / 2


def _walkers(problem: Problem, chain: Chain) -> np.ndarray:
    """Return starts around the fit, spread as its covariance says but no wider than the starts of a fit."""
    u = problem.space.start()
    spread = np.array([axis.coordinate.spread for axis in problem.space.axes])
    sd = np.minimum(np.sqrt(np.diag(covariance(problem, u))), spread / 4)
    draws = np.random.default_rng(chain.seed).normal(size=(chain.walkers, len(u)))
    margin = 1e-3 * sd
    return np.clip(u + draws * sd, problem.space.low + margin, problem.space.high - margin)


def _emcee() -> Any:
    try:
        import emcee
    except ImportError:
        raise MissingExtraError(
            "sampling a posterior needs emcee; install it with: pip install 'rover-pin[bayes]'."
        ) from None
    return emcee
