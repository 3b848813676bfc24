"""Describe the residual of a fitted drive model: its size, where it is largest, and the unlisted effect that fits it
best.
"""

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
from rover_pin.estimation.wording import FLOOR_RATIO
from rover_pin.experiments.drive_log.candidates import candidate_of, variants
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.features import blocks
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.draft import can_draft, draft
from rover_pin.experiments.unlisted.terms import Term, terms
from rover_pin.simulation.logged_inputs import fill_gaps
from rover_pin.simulation.model.effect_source import DraftedEffect

MIN_NET_GAIN = 20.0
"""Minimum net decrease of chi2 by the best description of a residual. With a smaller net decrease, the residual counts
as noise. The net decrease is the decrease of chi2 by the description, minus the decrease that chance gives. For models
that lack nothing, the net decrease stays clearly below this value."""
WORST_BLOCKS = 4
"""Number of successive half-second blocks over which the residual is summed, to find where it is largest."""


class DriveChannelResidual(NamedTuple):
    """Size of one channel's residual (measured minus predicted), and where the residual is largest.

    The size is stated in SDs of the declared noise.
    """

    name: str
    rms: float
    """RMS of the residual divided by its noise; about 1 if the residual is only noise"""
    memory: float
    """correlation between the residuals of successive half-second blocks"""
    correlations: dict[str, float]
    """correlations of the residual with duty, slip, pitch, place and time"""
    worst_run: str
    """name of the run with the largest residual over two seconds"""
    worst_time: float
    """time in the middle of these two seconds [s]"""
    worst_place: float
    """x coordinate of the rover's base at this time [m]"""

    @property
    def is_noise(self) -> bool:
        """Whether the residual of the channel is not larger than its noise."""
        return self.rms < FLOOR_RATIO

    @property
    def sentence(self) -> str:
        """A sentence for the report on the size of the residual, where it is largest, and its strongest correlation."""
        if self.is_noise:
            return f"{self.name}: {self.rms:.2f} times the noise"
        name, value = max(self.correlations.items(), key=lambda pair: abs(pair[1]))
        return (
            f"{self.name}: {self.rms:.2f} times the noise, most in {self.worst_run} at t = {self.worst_time:.1f} s, "
            f"x = {self.worst_place:.2f} m; goes most with {name} (correlation {value:+.2f})"
        )


@dataclass(frozen=True, eq=False)
class DriveResidual:
    """Residual of a fitted drive model: the RMS residual of each channel, and the terms that describe the residual.

    A term is an action (such as a torque on one wheel) times a function of one signal.
    """

    terms: tuple[Term, ...] = field(repr=False)
    """terms (each an action times a function of a signal) that were fitted to the residual, the best one first"""
    channels: tuple[DriveChannelResidual, ...]
    wheels: tuple[str, ...]
    "names of the rover's wheels"

    @property
    def best(self) -> Term:
        """The term that describes the residual best: a torque, force, grip change or other action of an unknown effect,
        multiplied by a function of a signal.
        """
        return self.terms[0]

    @property
    def second(self) -> Term:
        """The second-best term, as an alternative explanation of the residual; `best` explains what a term is."""
        return self.terms[1]

    @property
    def is_noise(self) -> bool:
        """Whether the residual is noise: its best description decreases chi2 no more than the best description does for
        a model that lacks nothing.
        """
        return self.best.strength < MIN_NET_GAIN

    @property
    def description(self) -> str:
        """The two best terms with their net decreases of chi2, as sentences for the report."""
        if self.is_noise:
            return f"No term describes the remaining residual (net decrease of chi2: {self.best.strength:.0f})."
        sand_note = ", no more than newly prepared sand differs by" if self.best.is_raking else ""
        return (
            f"The remaining residual {self.best.description}{sand_note} (net decrease of chi2: "
            f"{self.best.strength:.0f}). By the second-best description, the residual {self.second.description} "
            f"(net decrease of chi2: {self.second.strength:.0f})."
        )


def describe(fit: Fit, progress: Callable[[str], None] = lambda line: None) -> DriveResidual:
    """Describe the unexplained part of the data of a fitted drive model: the residual of each channel, and terms that
    fit the residual.

    A term is an action, such as a torque on one wheel, times a function of a signal. A few simulations with a small
    additional torque, force or grip show how one unit of each action changes every channel. Every term is fitted to the
    residual. The terms are ranked by their decrease of chi2 minus the decrease that a term with an equal number of
    unknowns has by chance.

    Parameters
    ----------
    fit : Fit
        A drive model fitted to the runs of a log.
    progress : callable, optional
        Function that is called with a line of text before each long step.
    """
    scene = Scene(fit)
    progress("perturbing the replays")
    return DriveResidual(terms(scene), channel_residuals(scene), scene.wheels)


def draft_effect(residual: DriveResidual, name: str) -> DraftedEffect:
    """Return a new effect that imitates the residual, as the text of an effect file and as an object.

    `name` becomes the name of the effect's class.

    The effect acts as the best term does that can be drafted. A term is an action times a function of a signal.

    Raises ParameterError: no term of the residual can be drafted as an effect.
    """
    # The best term may need an action that no effect can perform; then the next one is drafted.
    term = next((term for term in residual.terms if can_draft(term)), residual.best)
    return draft(term, name, residual.wheels)


def channel_residuals(scene: Scene) -> tuple[DriveChannelResidual, ...]:
    """Return size and correlations of the residual for each channel, and where it is largest, for a fitted model with
    its runs.
    """
    # The table holds the whitened residuals as (runs, channels, blocks); NaN marks blocks that are not compared.
    table = table_of(scene.fit)
    signal_means = signals(scene)
    residuals = []
    for index, name in enumerate(scene.experiment.channels):
        rows = table[:, index]
        finite = np.isfinite(rows)
        values = rows[finite]
        # A moving sum over several blocks is less sensitive to a single outlier than the largest block is.
        power = np.nan_to_num(rows) ** 2
        sums = np.array([np.convolve(row, np.ones(WORST_BLOCKS), "same") for row in power])
        worst = int(np.argmax(np.where(np.isfinite(rows), sums, -1.0)))
        run, block = (int(position) for position in np.unravel_index(worst, sums.shape))
        residuals.append(
            DriveChannelResidual(
                name,
                float(np.sqrt(np.mean(values**2))) if values.size else 0.0,
                correlation(rows[:, 1:].ravel(), rows[:, :-1].ravel()),
                {signal: correlation(values, means[finite]) for signal, means in signal_means.items()},
                scene.experiment.runs[run].name,
                float(signal_means["time"][run, block]),
                float(signal_means["place"][run, block]),
            )
        )
    return tuple(residuals)


def signals(scene: Scene) -> dict[str, np.ndarray]:
    """Return the five signals that the report correlates with a residual: name -> half-second means (runs, blocks).

    Shorter runs are filled with NaN up to the length of the longest run.
    """
    # The slip is no channel of a log, so it is that of the replay. The pitch is measured if the log has it.
    signal_by_name: dict[str, Callable[[int], np.ndarray]] = {
        "duty": lambda run: scene.experiment.runs[run].commands.duty.mean(axis=1),
        "slip": lambda run: np.mean([scene.replayed_row(run, f"slip_{wheel}") for wheel in scene.wheels], axis=0),
        "pitch": lambda run: scene.logged_row(run, "body_pitch"),
        "place": lambda run: fill_gaps(scene.experiment.runs[run].commands.place[:, 0]),
        "time": lambda run: scene.experiment.runs[run].commands.t,
    }
    means = {name: np.full((len(scene.experiment.runs), scene.experiment.length), np.nan) for name in signal_by_name}
    for name, signal_of_run in signal_by_name.items():
        for run, logged_run in enumerate(scene.experiment.runs):
            block = blocks(signal_of_run(run), logged_run.commands.period)
            means[name][run, : len(block)] = block
    return means


def draft_term(fit: Fit, residual: DriveResidual, name: str, progress: Progress) -> Draft | None:
    """Draft an effect that imitates the residual of a fit, fit it together with the model, and return it with the
    improvement of the fit.

    The result is None if no description of the residual can become a drafted effect.

    Parameters
    ----------
    fit : Fit
        The fitted drive model.
    residual : DriveResidual
        Residual of that fit.
    name : str
        Name of the drafted effect.
    progress : callable
        Function that is called with a line of text before each long step.
    """
    if not any(can_draft(term) for term in residual.terms):
        return None
    progress("trying the draft of the residual")
    drafted = draft_effect(residual, name)
    # The draft competes as any candidate does, so that its gain includes the refitted parameters.
    search = Search(fit, progress)
    tried = variants(type(drafted.effect), fit.model, experiment_of_log(fit))
    search.run(signatures(fit, [candidate_of(variant) for variant in tried]))
    rows = [row for (row, *_) in search.fitted.values() if row.causes]
    if not rows:
        return draft_of(drafted.text, fit, None, -1.0)
    best, without = max(rows, key=lambda row: row.log_evidence), search.fitted[frozenset()][0]
    return draft_of(drafted.text, fit, best.fit, best.log_evidence - without.log_evidence)
