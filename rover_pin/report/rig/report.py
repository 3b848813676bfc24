"""The report of wheel-rig data: the sections of all kinds of data, residuals against slip, and errors of each data
set.
"""

import math
from collections import Counter
from pathlib import Path

import numpy as np

from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.wording import Against, format_value
from rover_pin.experiments.wheel_rig.diagnostics import JointExtra, ResidualTest, RigExtra
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.rig_set import RigSet
from rover_pin.report.cause_sets import best_held_out
from rover_pin.report.experiment import points_picture
from rover_pin.report.page import AWAY, Picture, ReportTable, Section, TableRow, before_and_after
from rover_pin.report.rig.figures import Look, channel_panels, load_caption, looks, residual_panels
from rover_pin.report.svg import GREY
from rover_pin.report.verdict_page import VerdictPage, write_verdict
from rover_pin.report.words import Labels, capital, key, kinds_of, listing

UNSEEN = Labels("at slips that were not fitted", "levels of slip")
"""Words that the report uses for wheel-rig data. Slip levels, which are held out one after another, have their names
here."""
WITH_PRESSINGS = UNSEEN._replace(folds="levels of slip or pressing trials")
"""Words for data that also have pressing trials, each of which is held out like a slip level."""


def labels_of(data: RigSet) -> Labels:
    """Return the words that the report uses for one set of wheel-rig data.

    A slip level is called by its slip, such as "S = 0.5", instead of its name.
    """
    descriptions = meanings(data)
    return (WITH_PRESSINGS if data.trials else UNSEEN)._replace(fold=lambda name: descriptions.get(name, name))


def write_report(verdict: Verdict, experiment: RigExperiment, out: Path) -> list[Path]:
    """Write the report of wheel-rig data, report.html, and its figures into the folder `out`, and return all paths.

    The page of several data sets shows all runs one after another, and the errors of each data set.
    """
    # A joint fit of several sets gets a picture of all points, and a section with the errors of each set.
    if len(experiment.sets) > 1:
        count = int(np.isfinite(experiment.observed).any(axis=1).sum())
        labels = WITH_PRESSINGS if any(data.trials for data in experiment.sets) else UNSEEN
        kicker = f"{len(experiment.sets)} sets in one sand: {count} runs at {len(experiment.folds)} {labels.folds}"
        sections = (set_by_set_section(verdict),)
        order = ", then ".join(experiment.runs)
        caption = f"Each run is drawn once: {order}. A vertical line marks the beginning of a level."
        picture = ("points", points_picture(verdict, experiment, caption))
        page = VerdictPage(labels, experiment.name, kicker, picture, sections, model_file=False)
        return write_verdict(verdict, page, out)
    (data,) = experiment.sets
    kicker = f"{data.slip.size} runs at {len(data.level_names)} levels of slip"
    page = VerdictPage(
        labels_of(data),
        data.name,
        kicker,
        ("effect", _picture(verdict, data)),
        where_wrong=where_wrong_section(verdict, data),
        after_numbers=elsewhere_section(verdict),
        source=data.source,
    )
    return write_verdict(verdict, page, out)


def _added_names(verdict: Verdict) -> str:
    """Return the titles of the added effects as a list in words, such as "digging and slip-sinkage"."""
    return listing(display_name(name, kinds_of(verdict)) for name in verdict.named)


def _looks(verdict: Verdict) -> list[Look]:
    """Return the models that the figures show, with their line styles; an empty list if no model was fitted."""
    if verdict.before is None:
        return []
    drawn_models = looks(verdict.before.model, verdict.model if verdict.named else None, _added_names(verdict))
    # The set of causes that predicts held-out data best is also shown if it is not the set that was added.
    best = best_held_out(verdict)
    if verdict.beliefs is not None and best is not None and best.names and best.names != verdict.named:
        words = key(listing(display_name(name, kinds_of(verdict)) for name in best.names))
        drawn_models.append(Look(verdict.beliefs.best(best.names).fit.model, GREY, "-.", words))
    return drawn_models


def _picture(verdict: Verdict, data: RigSet) -> Picture:
    """Return the first picture of the page: the channel that the added effects improve most, against slip.

    If no model was fitted, the picture shows the measured points of all channels.
    """
    curves = _looks(verdict)
    channels = channel_panels(data, curves)
    if not curves or not isinstance(verdict.extra, RigExtra):
        return Picture(channels, f"Measured {listing(channel.name for channel in data.channels)} against slip.")
    names = [channel.name for channel in data.channels]

    def chi2_decrease(score: ChannelScore) -> float:
        # Without an added effect, the channel with the largest held-out chi2 is shown.
        before, after = score.times(score.before) ** 2, score.times(score.after) ** 2
        return before - after if before != after else before

    # The channel that gains most is shown first.
    score = max((score for score in verdict.scores if score.name in names), key=chi2_decrease)
    alt = f"{score.name} against slip, measured, with the base model" + f" and with {_added_names(verdict)}" * bool(
        verdict.named
    )
    before, after = (format_value(error, score.unit) for error in (score.before, score.after))
    missed = f"held-out error {before} before and {after} after" if verdict.named else f"held-out error {before}"
    return Picture((channels[names.index(score.name)],), f"{capital(alt)}: {missed}.", load_caption(data))


def where_wrong_section(verdict: Verdict, data: RigSet) -> Section | None:
    """Return the section with the residuals of the models against slip, and the correlations of the residuals.

    The result is None if no model was fitted.
    """
    sides, added = verdict.extra, bool(verdict.named)
    if not isinstance(sides, RigExtra):
        return None
    # The residuals are described in words, in tests and in pictures.
    lines = [f"Before, {residual.sentence}." for residual in sides.before.residuals]
    lines += [f"After, {residual.sentence}." for residual in sides.after.residuals] if added else []
    tests = test_table(sides, added)
    content = {"lines": lines, "draft": verdict.draft, "tests": tests}
    panels = residual_panels(data, sides.before, sides.after if added else None)
    errors = [
        f"{was.name} {was.rms:.1f} times its noise" + (f" before and {now.rms:.1f} after" if added else "")
        for was, now in zip(sides.before.residuals, sides.after.residuals, strict=True)
    ]
    pictures = {
        "channels": Picture(
            channel_panels(data, _looks(verdict)), "Measured and predicted channels against slip.", load_caption(data)
        ),
        "residuals": Picture(panels, f"Measured minus model at each level of slip; residuals: {listing(errors)}."),
    }
    return Section("Residuals against slip", "rig/where_it_lives.html", content, pictures)


def test_table(sides: RigExtra, added: bool) -> ReportTable:
    """Return the table of correlations of the residuals (measured - model), without and with the added effects.

    `sides` holds the diagnostics of both models, and `added` is whether effects were added.
    """
    heads = ("channel", "correlation with", *before_and_after(added))
    rows = [
        TableRow((was.channel, was.against, _test(was), *((_test(now),) if added else ())), AWAY * now.is_significant)
        for was, now in zip(sides.before.tests, sides.after.tests, strict=True)
    ]
    return ReportTable(heads, tuple(rows), "Correlations of the residual (measured - model)")


def _test(test: ResidualTest) -> str:
    """Return a correlation of the residuals with its p-value as text. A star marks a correlation that chance hardly
    explains.
    """
    return f"{test.correlation:+.2f} (p = {test.p:.2g})" + (" *" if test.is_significant else "")


def elsewhere_section(verdict: Verdict) -> Section | None:
    """Return the section that compares fitted constants with other measurements; None if there are no other
    measurements.
    """
    extra = verdict.extra
    if not isinstance(extra, RigExtra) or not extra.before.flags:
        return None
    sides = [("before", extra.before), *([("after", extra.after)] if verdict.named else [])]
    rows = [
        TableRow((when, flag.sentence), AWAY if flag.says is Against.AWAY else "")
        for when, side in sides
        for flag in side.flags
    ]
    table = ReportTable(("model", "constant with its 95 % interval, and the other measurement"), tuple(rows))
    return Section("Comparison with other measurements", "rig/elsewhere.html", {"table": table})


def set_by_set_section(verdict: Verdict) -> Section | None:
    """Return the section with the held-out errors of the joint model and of a simple curve, for each data set.

    The curve goes through the points of one data set alone. The result is None if no model was fitted.
    """
    if not isinstance(verdict.extra, JointExtra):
        return None
    added, rows = bool(verdict.named), []
    for row in verdict.extra.sets:
        values = (row.before, row.after, row.noise) if added else (row.before, row.noise)
        errors = [format_value(value, row.unit) for value in values]
        curve = f"{format_value(row.curve_error, row.unit)} ({row.curve})"
        rows.append(TableRow((f"{row.set}: {row.channel}", *errors, curve), AWAY * row.is_lost))
    heads = ("set and channel", *before_and_after(added), "noise", "curve through that set alone")
    table = ReportTable(heads, tuple(rows), "Held-out errors of each set")
    return Section("Errors of each set", "rig/set_by_set.html", {"table": table})


MIN_SLIP = 0.005
"""Smallest absolute slip that is not written as 0 [-]. Slips are shown with two digits, so that a smaller slip is less
than half of the last digit of a slip such as 0.10."""


def meanings(data: RigSet) -> dict[str, str]:
    """Return a dict from the name of each slip level to its meaning, such as "S = 0.5".

    The meaning includes the slip angle and the load if the runs differ in them. If several levels have one meaning, the
    name follows in brackets.
    """
    angled = bool(np.ptp(data.slip_angle) > 1e-3)
    loaded = data.loads_vary
    descriptions = {}
    for number, name in enumerate(data.level_names):
        is_in_level = data.level == number
        slip = float(np.mean(data.slip[is_in_level]))
        parts = [f"S = {0.0 if abs(slip) < MIN_SLIP else slip:.2g}"]
        parts += [f"{math.degrees(float(np.mean(data.slip_angle[is_in_level]))):.3g} deg"] if angled else []
        parts += [f"{float(np.mean(data.load[is_in_level])):.3g} N"] if loaded else []
        descriptions[name] = ", ".join(parts)
    # Levels with equal descriptions are distinguished by their names.
    twice = {words for words, times in Counter(descriptions.values()).items() if times > 1}
    return {name: f"{words} ({name})" if words in twice else words for name, words in descriptions.items()}
