"""Identification of soil parameters: weighted nonlinear least squares from several starts, and a judgement of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2 as chi2_law

from rover_pin.base.errors import DataError, OptimisationError, ParameterError
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil
from rover_pin.estimation.covariance import correlation, covariance, singular_values
from rover_pin.estimation.descent import descend
from rover_pin.estimation.problem import Prior, Problem
from rover_pin.estimation.profile import Best, Interval, LowerMinimum, interval, rise
from rover_pin.identification.identifiability import refuse_untold
from rover_pin.identification.one_sand import sets_of
from rover_pin.identification.parameter_verdict import judge
from rover_pin.identification.result import ChannelFit, Estimate, Identification, Starts
from rover_pin.identification.soil_space import space
from rover_pin.measurements.channel import FIELDS, Evidence

SAME_CHI2 = 0.01
"""Starts within this of the lowest chi2 ended at the same fit."""

SURPRISE = 1e-3
"""A chi2 less probable than this means that the model, not the noise, misses the data."""

POLISHES = 5


@dataclass(frozen=True)
class Search:
    """How widely a fit looks: the soil as given, then `starts` - 1 points scattered around it by `seed`."""

    starts: int = 5
    seed: int = 0


class StartResult(NamedTuple):
    """Where one start ended; `u` is None where the solver failed."""

    u: np.ndarray | None
    chi2: float
    status: str


SEARCH = Search()


def identify(
    data: Evidence | Sequence[Evidence],
    soil: Soil,
    free: Sequence[str] = ("k", "phi"),
    priors: Mapping[str, Prior] | None = None,
    search: Search = SEARCH,
) -> Identification:
    """Fit parameters to measured data and say which of them the data tell.

    Minimises chi2 = sum ((measured - predicted) / sd)^2, plus the priors, inside the parameters' bounds. Intervals are
    profile likelihoods: chi2 may rise by 1.96^2 with all other parameters refitted.

    Parameters
    ----------
    data : Evidence or sequence of Evidence
        `TractionPoints`, `WheelRig`, ..., fitted together.
    soil : Soil
        Where to start, and the values of all that is not free.
    free : sequence of str
        Fields of `Soil`, or r and b of the wheel.
    priors : mapping of str to Prior
        What is known of free parameters from elsewhere.

    Returns
    -------
    Identification
        Estimates with intervals and verdicts. A parameter that the data do not close is not reported as found.

    Raises
    ------
    ParameterError
        An unknown parameter, or one that these channels cannot tell whatever their noise, with what would tell it.
    DataError
        No data, or fewer than free parameters.
    OptimisationError
        No start converged; `status` holds the solver's messages.

    Source: section 4.1, "a theoretical curve that makes a best fit". Differs from the paper: it prints no uncertainty.
    """
    problem = build(data, soil, free, priors or {})
    starts = scatter(problem, search)
    refuse_untold(problem, starts)
    results = list(telling((_solve(problem, u) for u in starts), len(starts), "starts fitted"))
    best = _lowest(problem, results)
    widen = misfit(best.chi2, problem.freedom)
    widened = problem.widened(widen)
    best, intervals = _intervals(widened, _refine_fit(widened, best.u))
    estimates = tuple(
        judge(widened, best, index, profile_interval, widen) for index, profile_interval in enumerate(intervals)
    )
    return _identification(problem, best, estimates, results, soil)


def profile(
    data: Evidence | Sequence[Evidence],
    soil: Soil,
    free: Sequence[str],
    name: str,
    values: np.ndarray,
    priors: Mapping[str, Prior] | None = None,
) -> np.ndarray:
    """Return chi2 with the parameter `name` held at each of `values` [SI] and the other `free` ones refitted.

    Raises
    ------
    ParameterError, DataError, OptimisationError
        As `identify`; a value outside the bounds is a ParameterError.
    """
    problem = build(data, soil, free, priors or {})
    index = problem.space.names.index(name) if name in problem.space.names else -1
    if index < 0:
        raise ParameterError(f"the profile of '{name}' needs it among the free parameters {', '.join(free)}.")
    axis = problem.space.axes[index]
    if not all(axis.quantity.low <= value <= axis.quantity.high for value in values):
        raise ParameterError(
            f"the profile of {name} leaves [{axis.quantity.low:g}, {axis.quantity.high:g}] {axis.quantity.unit}."
        )
    best = _lowest(problem, [_solve(problem, u) for u in scatter(problem, SEARCH)])
    wanted = np.clip([axis.coordinate.u(float(value)) for value in values], axis.low, axis.high)
    chi2 = np.empty(len(wanted))
    for side in (wanted >= best.u[index], wanted < best.u[index]):
        guess = best.u
        for at in sorted(np.flatnonzero(side), key=lambda i: abs(wanted[i] - best.u[index])):
            root, guess = rise(problem, best, index, wanted[at], guess)
            chi2[at] = best.chi2 + root**2
    return chi2


def build(data: Evidence | Sequence[Evidence], soil: Soil, free: Sequence[str], priors: Mapping[str, Prior]) -> Problem:
    """Return the least-squares problem of a fit; raises as `identify`."""
    sets = sets_of(data)
    if not sets:
        raise DataError("there are no data to identify from; give one data set or more.")
    widths = {(float(evidence.wheel.r), float(evidence.wheel.b)) for evidence in sets}
    if len(widths) > 1 and {"r", "b"} & set(free):
        raise ParameterError("r and b cannot be free for data of different wheels; hold them at each wheel's own.")
    narrowest = min((evidence.wheel for evidence in sets), key=lambda wheel: float(wheel.b))
    return Problem(sets, space(tuple(free), narrowest, soil), priors)


def scatter(problem: Problem, search: Search) -> list[np.ndarray]:
    """Return the starts in u: the given soil, then points drawn around it inside the bounds."""
    if search.starts < 1:
        raise ParameterError(f"starts = {search.starts} is not allowed: a fit needs one start or more.")
    low, high, centre = problem.space.low, problem.space.high, problem.space.start()
    spread = np.array([axis.coordinate.spread for axis in problem.space.axes])
    draws = np.random.default_rng(search.seed).uniform(-1, 1, (search.starts - 1, len(centre)))
    return [centre, *np.clip(centre + draws * spread, low, high)]


def misfit(chi2: float, freedom: int) -> float:
    """Return sqrt(chi2 / freedom) where chi2 is improbably large for the stated noise, else 1."""
    if freedom < 1 or chi2 <= chi2_law.isf(SURPRISE, freedom):
        return 1.0
    return float(np.sqrt(chi2 / freedom))


def _solve(problem: Problem, start: np.ndarray) -> StartResult:
    low, high = problem.space.low, problem.space.high
    margin = 1e-6 * np.minimum(high - low, 1.0)
    try:
        return StartResult(*descend(problem, np.clip(start, low + margin, high - margin)), status="settled")
    except (ValueError, np.linalg.LinAlgError, OptimisationError) as error:
        return StartResult(None, np.inf, str(error))


def _lowest(problem: Problem, results: Sequence[StartResult]) -> Best:
    lowest = min(results, key=lambda end: end.chi2)
    if lowest.u is None:
        lost = problem.unpredicted(problem.space.start())
        messages = "; ".join(dict.fromkeys(end.status.rstrip(".") for end in results)) + lost
        raise OptimisationError(
            f"none of {len(results)} starts converged ({messages}); start from a soil nearer to the data, free fewer "
            "parameters.",
            status=[end.status for end in results],
        )
    return Best(lowest.u, lowest.chi2, covariance(problem, lowest.u))


def _refine_fit(problem: Problem, u: np.ndarray) -> Best:
    u, chi2 = descend(problem, u)
    return Best(u, chi2, covariance(problem, u))


def _intervals(problem: Problem, best: Best) -> tuple[Best, list[Interval]]:
    """Return the intervals of all parameters; a lower minimum found on the way becomes the fit."""
    for _ in range(POLISHES):
        try:
            return best, [interval(problem, best, index) for index in range(len(best.u))]
        except LowerMinimum as lower:
            best = _refine_fit(problem, lower.u)
    raise OptimisationError(
        f"chi2 still falls after {POLISHES} profiles; give more starts or free fewer parameters.", status=best.chi2
    )


def _agreement(problem: Problem, results: Sequence[StartResult]) -> Starts:
    converged = [(end.u, end.chi2) for end in results if end.u is not None]
    lowest = min(chi2 for _, chi2 in converged)
    others: dict[float, dict[str, float]] = {}
    for u, chi2 in converged:
        if chi2 > lowest + SAME_CHI2 and all(abs(chi2 - other_chi2) > SAME_CHI2 for other_chi2 in others):
            others[chi2] = dict(zip(problem.space.names, problem.space.values(u).tolist(), strict=True))
    agreed = sum(chi2 <= lowest + SAME_CHI2 for _, chi2 in converged)
    return Starts(len(results), len(converged), agreed, tuple(sorted(others.items())))


def _identification(
    problem: Problem, best: Best, estimates: tuple[Estimate, ...], results: Sequence[StartResult], soil: Soil
) -> Identification:
    """Return the result, with chi2 and singular values by the noise as stated."""
    chi2 = problem.chi2(best.u)
    values, directions = singular_values(problem, best.u)
    fitted = dict(zip(FIELDS, problem.space.fields(best.u).tolist(), strict=True))
    return Identification(
        estimates=estimates,
        correlation=correlation(best.covariance),
        singular_values=values,
        directions=directions,
        channels=_channel_fits(problem, best.u),
        chi2=chi2,
        freedom=problem.freedom,
        misfit=misfit(chi2, problem.freedom),
        starts=_agreement(problem, results),
        soil=soil.replace(**{name: fitted[name] for name in problem.space.names if name in quantities(soil)}),
    )


def _channel_fits(problem: Problem, u: np.ndarray) -> tuple[ChannelFit, ...]:
    residual, at, fits = problem.evaluate(u)[0], 0, []
    for channel in (channel for evidence in problem.data for channel in evidence.channels):
        sd = channel.sd[np.isfinite(channel.measured)]
        part = residual[at : at + sd.size]
        at += sd.size
        rmse = float(np.sqrt(np.mean((part * sd) ** 2)))
        fits.append(ChannelFit(channel.name, channel.unit, part.size, rmse, float(part @ part)))
    return tuple(fits)
