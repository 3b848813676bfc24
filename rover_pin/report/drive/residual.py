"""What a drive model leaves: how it acts, and what the residuals go with."""

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.unlisted.residual import DriveResidual
from rover_pin.experiments.unlisted.term import Term
from rover_pin.report.drive.runs import words_of
from rover_pin.report.drive.terms import term_panels
from rover_pin.report.section import AWAY, Picture, Row, Section, Table

TERMS = 3
"""Terms whose curves are drawn."""
MAX_RESIDUAL_CHANNELS = 12
"""Channels whose residual is listed."""


def residual_section(verdict: Verdict) -> Section | None:
    """Return what is left: the terms that describe it best, and the channels with what they go with."""
    residual = extra_of(verdict).residual
    if residual is None:
        return None
    terms = tuple(Row((f"it {term.description}", *_gains(term))) for term in residual.terms[:TERMS])
    heads = ("what is left", "gain in chi2", "chance", "on runs left out", "net gain")
    content = {
        "left": residual.description,
        "terms": Table(heads, terms) if not residual.is_noise else None,
        "channels": channel_table(residual),
        "draft": verdict.draft,
    }
    pictures = {} if residual.is_noise or not residual.terms else {"terms": _picture(residual)}
    return Section("What is left", "drive/residual.html", content, pictures)


def _picture(residual: DriveResidual) -> Picture:
    """Return the estimated functions."""
    alt = f"Estimated functions of the terms that describe what is left best: it {residual.best.description}."
    caption = (
        "What acts, times a function of what it depends on, as estimated from measured - model; shaded: one SD. "
        "Net gain: what it takes beyond chance, no more than on runs on which it was not fitted."
    )
    return Picture(term_panels(residual.terms[:TERMS]), alt, caption)


def _gains(term: Term) -> tuple[str, ...]:
    held_out_gain = "" if term.held_out is None else f"{term.held_out:+.1f}"
    return (f"{term.gain:.1f}", f"{term.detection_threshold:.1f}", held_out_gain, f"{term.strength:+.1f}")


def channel_table(residual: DriveResidual) -> Table:
    """Return what the channels leave, the most first, with what it goes with."""
    ranked = sorted(residual.channels, key=lambda channel: -channel.rms)[:MAX_RESIDUAL_CHANNELS]
    signals = tuple(residual.channels[0].correlations) if residual.channels else ()
    rows = [
        Row(
            (
                words_of(channel.name),
                f"{channel.rms:.2f}",
                f"{channel.memory:+.2f}",
                *(f"{value:+.2f}" for value in channel.correlations.values()),
                "noise"
                if channel.is_noise
                else f"{channel.worst_run}, {channel.worst_time:.1f} s, x = {channel.worst_place:.2f} m",
            ),
            "" if channel.is_noise else AWAY,
        )
        for channel in ranked
    ]
    heads = ("channel", "times the noise", "one block with the next", *signals, "most of it")
    return Table(heads, tuple(rows), "What measured - model goes with")
