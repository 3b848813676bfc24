"""What a fitted drive model leaves: how large, where, and as what an effect that nobody has listed would act."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.draft import Draft, draft_of
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.signature import signatures
from rover_pin.estimation.fit import Fit, table_of
from rover_pin.estimation.noise import correlation
from rover_pin.estimation.wording import AT_FLOOR
from rover_pin.experiments.drive_log.candidates import candidate_of, variants
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.features import blocks
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.draft import can_draft, draft
from rover_pin.experiments.unlisted.term import Term
from rover_pin.experiments.unlisted.terms import terms
from rover_pin.simulation.logged_inputs import fill_gaps
from rover_pin.simulation.model.effect_files import effects_of_text

UNLISTED = 20.0
"""Net gain of a term from which the residual is not noise. Why: complete models of five sets showed 6 at most."""


class DriveChannelResidual(NamedTuple):
    """What one channel leaves, in whitened units, where 1 is the noise."""

    name: str
    rms: float
    memory: float
    "correlation of successive blocks"
    correlations: dict[str, float]
    "with duty, slip, pitch, place and time"
    worst_run: str
    worst_time: float
    "middle of the worst two seconds of that run [s]"
    worst_place: float
    "x of the base there [m]"

    @property
    def is_noise(self) -> bool:
        """Whether nothing is left to describe."""
        return self.rms < AT_FLOOR

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        if self.is_noise:
            return f"{self.name}: {self.rms:.2f} times the noise"
        name, value = max(self.correlations.items(), key=lambda pair: abs(pair[1]))
        return (
            f"{self.name}: {self.rms:.2f} times the noise, most in {self.worst_run} at t = {self.worst_time:.1f} s, "
            f"x = {self.worst_place:.2f} m; goes most with {name} (correlation {value:+.2f})"
        )


@dataclass(frozen=True, eq=False)
class DriveResidual:
    """What a fitted model leaves; `terms` are sorted, the one that describes it best first."""

    terms: tuple[Term, ...] = field(repr=False)
    channels: tuple[DriveChannelResidual, ...]
    wheels: tuple[str, ...]

    @property
    def best(self) -> Term:
        """The term that describes it best."""
        return self.terms[0]

    @property
    def second(self) -> Term:
        """The best term that acts otherwise or depends on something else: what it may be instead."""
        return self.terms[1]

    @property
    def is_noise(self) -> bool:
        """Whether no term takes more than those of a complete model do."""
        return self.best.strength < UNLISTED

    @property
    def description(self) -> str:
        """What is left, in a few sentences."""
        if self.is_noise:
            return f"Nothing is left that any term describes (net gain {self.best.strength:.0f})."
        sand_note = ", no more than sand that is prepared anew" if self.best.is_raking else ""
        return (
            f"What is left {self.best.description}{sand_note} (net gain {self.best.strength:.0f}). The next best: "
            f"it {self.second.description} (net gain {self.second.strength:.0f})."
        )


def describe(fit: Fit, progress: Callable[[str], None] = lambda line: None) -> DriveResidual:
    """Return what a fitted model leaves, by channel and as terms.

    A few perturbed replays show how a unit of torque, force and grip moves the features; each times a function of
    measured signals is a term, and the one that takes most chi2 beyond its number of columns describes the residual.
    """
    scene = Scene(fit)
    progress("Nudging the replays")
    return DriveResidual(terms(scene), channel_residuals(scene), scene.wheels)


def draft_effect(residual: DriveResidual, name: str) -> str:
    """Return the text of an effect file with the effect `name`: the best term that an effect can imitate.

    Raises ParameterError: no term can be drafted.
    """
    able = (term for term in residual.terms if can_draft(term))
    return draft(next(able, residual.best), name, residual.wheels)


def channel_residuals(scene: Scene) -> tuple[DriveChannelResidual, ...]:
    """Return what each channel leaves."""
    rows = table_of(scene.fit)
    table = signals(scene)
    return tuple(_channel(scene, name, rows[:, at], table) for at, name in enumerate(scene.experiment.channels))


def signals(scene: Scene) -> dict[str, np.ndarray]:
    """Return the block means (runs, blocks) of what a residual may go with."""
    signal_by_name: dict[str, Callable[[int], np.ndarray]] = {
        "duty": lambda run: scene.experiment.runs[run].commands.duty.mean(axis=1),
        "slip": lambda run: np.mean([scene.replayed_row(run, f"slip_{wheel}") for wheel in scene.wheels], axis=0),
        "pitch": lambda run: scene.logged_row(run, "body_pitch"),
        "place": lambda run: fill_gaps(scene.experiment.runs[run].commands.place[:, 0]),
        "time": lambda run: scene.experiment.runs[run].commands.t,
    }
    means = {name: np.full((len(scene.experiment.runs), scene.experiment.length), np.nan) for name in signal_by_name}
    for name, of in signal_by_name.items():
        for run, logged_run in enumerate(scene.experiment.runs):
            block = blocks(of(run), logged_run.commands.period)
            means[name][run, : len(block)] = block
    return means


def _channel(scene: Scene, name: str, rows: np.ndarray, signals: dict[str, np.ndarray]) -> DriveChannelResidual:
    finite = np.isfinite(rows)
    values = rows[finite]
    run, block = _worst(rows)
    return DriveChannelResidual(
        name,
        float(np.sqrt(np.mean(values**2))) if values.size else 0.0,
        correlation(rows[:, 1:].ravel(), rows[:, :-1].ravel()),
        {signal: correlation(values, table[finite]) for signal, table in signals.items()},
        scene.experiment.runs[run].name,
        float(signals["time"][run, block]),
        float(signals["place"][run, block]),
    )


def _worst(rows: np.ndarray, width: int = 4) -> tuple[int, int]:
    """Return run and block in the middle of the blocks with the greatest sum of squares."""
    power = np.nan_to_num(rows) ** 2
    sums = np.array([np.convolve(row, np.ones(width), "same") for row in power])
    run, block = np.unravel_index(int(np.argmax(np.where(np.isfinite(rows), sums, -1.0))), sums.shape)
    return int(run), int(block)


def draft_term(fit: Fit, residual: DriveResidual, name: str, progress: Progress) -> Draft | None:
    """Return the draft of what a fit leaves, tried on it; None where no effect can imitate any term."""
    if not any(can_draft(term) for term in residual.terms):
        return None
    progress("trying the draft of what is left")
    text = draft_effect(residual, name)
    (kind,) = effects_of_text(text)
    search = Search(fit, progress)
    search.run(signatures(fit, [candidate_of(effect) for effect in variants(kind, fit.model, experiment_of_log(fit))]))
    rows = [row for (row, *_) in search.fitted.values() if row.causes]
    if not rows:
        return draft_of(text, fit, None, -1.0)
    best, without = max(rows, key=lambda row: row.log_evidence), search.fitted[frozenset()][0]
    return draft_of(text, fit, best.fit, best.log_evidence - without.log_evidence)
