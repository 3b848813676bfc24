"""The run that would distinguish two candidates: the load and slip at which they differ most beyond their own doubt."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.exact import SPREAD
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.experiment import ROWS, RigExperiment, own_name
from rover_pin.experiments.wheel_rig.model import conditions, predictor
from rover_pin.soil.slip import speed_ratio

SLIPS = (-0.3, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
LOADS = (0.5, 1.0, 2.0)
"""Loads of the candidate runs, as multiples of the mean load."""
TELLS = 9.0
"""Expected chi2 from which a run tells two candidates apart: 3 standard deviations."""


class SeparatingRun(NamedTuple):
    """One more run, and by how much of chi2 it is expected to tell two candidates apart."""

    first: str
    second: str
    load: float
    slip: float
    channel: str
    expected: float

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        return (
            f"to tell {self.first} from {self.second}: one run at S = {self.slip:g} under {self.load:.3g} N; "
            f"{self.channel} shows it most (expected chi2 {self.expected:.3g})"
        )


Named = tuple[str, Fit]


def separating_run(data: RigSet, first: Named, second: Named) -> SeparatingRun | None:
    """Return the candidate run with the greatest expected information, or None where none distinguishes the two.

    d^T (Sigma + J_1 C_1 J_1^T + J_2 C_2 J_2^T)^-1 d, with d the difference of the two predictions, Sigma the noise and
    C the covariance of each fit.
    """
    mean = float(np.mean(data.rig.load))
    candidate_runs = np.array([(share * mean, slip) for share, slip in itertools.product(LOADS, SLIPS)])
    noise = RigExperiment(data).sd
    sides = [_predicted(data, fit, candidate_runs, noise) for _, fit in (first, second)]
    best: SeparatingRun | None = None
    for at, (load, slip) in enumerate(candidate_runs):
        difference = (sides[0][0][:, at] - sides[1][0][:, at]) / noise
        if not np.isfinite(difference).all():
            continue
        covariance = sum((cov[at] for _, cov in sides), np.eye(len(noise)))
        expected = float(difference @ np.linalg.solve(covariance, difference))
        if best is None or expected > best.expected:
            shows = np.abs(difference) / np.sqrt(np.diag(covariance))
            channel = data.rig.channels[int(shows.argmax())].name
            best = SeparatingRun(first[0], second[0], float(load), float(slip), channel, expected)
    return best if best is not None and best.expected >= TELLS else None


def _predicted(data: RigSet, fit: Fit, candidate_runs: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return predictions [channels, runs] and their covariance [runs, channels, channels] in units of the noise."""
    runs = conditions(candidate_runs[:, 0], candidate_runs[:, 1], _speeds(data, candidate_runs[:, 1]))
    free = [own_name(parameter.name) for parameter in fit.parameters]
    values, jacobian, _ = predictor(fit.model, free, runs)(fit.model.vector())
    rows = [ROWS.index(type(channel)) for channel in data.rig.channels]
    along = np.array([parameter.slope(u) for parameter, u in zip(fit.parameters, fit.u, strict=True)])
    slopes = jacobian[rows].transpose(1, 0, 2) * along / noise[:, None]
    return values[rows], slopes @ _covariance(fit) @ slopes.transpose(0, 2, 1)


def _covariance(fit: Fit) -> np.ndarray:
    """Return the covariance of u, no wider than the starts of a fit where the data tell nothing."""
    jacobian = fit.columns
    return np.asarray(np.linalg.inv(jacobian.T @ jacobian / max(1.0, fit.misfit) + np.eye(len(fit.u)) / SPREAD**2))


def _speeds(data: RigSet, slip: np.ndarray) -> np.ndarray | None:
    """Return travel and rim speeds at the tried slips, Eq (1), the rig's travel speed kept; None where it has none."""
    if data.speeds is None:
        return None
    travel = float(np.median(data.speeds[:, 0]))
    return np.array([(travel, travel / float(speed_ratio(S))) for S in slip])
