"""A verdict on wheel rigs as a page: the sections that any has, where its error lives, and errors set by set."""

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import Against, format_value
from rover_pin.experiments.wheel_rig.diagnostics import FitDiagnostics, Flag, JointExtra, ResidualTest, RigExtra
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.residual import RigChannelResidual
from rover_pin.measurements.rig_set import RigSet
from rover_pin.report.page import AWAY, Picture, Row, Section, Table, before_and_after
from rover_pin.report.rig.figures import Look, channel_panels, load_caption, looks, residual_panels
from rover_pin.report.standalone.report import points_picture
from rover_pin.report.verdict_page import write_verdict
from rover_pin.report.words import Labels, capital, kinds_of, listing

UNSEEN = Labels("on slips it never saw", "levels of slip")


def labels_of(data: RigSet) -> Labels:
    """Return what a rig set calls its parts."""
    descriptions = meanings(data)
    return UNSEEN._replace(fold=lambda name: descriptions.get(name, name))


def write_report(verdict: Verdict, experiment: RigExperiment, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    if len(experiment.sets) > 1:
        count = int(np.isfinite(experiment.observed).any(axis=1).sum())
        kicker = f"{len(experiment.sets)} sets in one sand: {count} runs at {len(experiment.folds)} levels of slip"
        own = (set_by_set_section(verdict),)
        caption = f"Each run once, {', then '.join(experiment.runs)}; a level begins at each line."
        picture = ("points", points_picture(verdict, experiment, caption))
        return write_verdict(verdict, UNSEEN, out, experiment.name, kicker, picture, own, model_file=False)
    (data,) = experiment.sets
    kicker = f"{data.slip.size} runs at {len(data.level_names)} levels of slip"
    return write_verdict(
        verdict,
        labels_of(data),
        out,
        data.name,
        kicker,
        ("effect", _picture(verdict, data)),
        where_wrong=where_wrong_section(verdict, data),
        beside_numbers=elsewhere_section(verdict),
        source=data.source,
    )


def _added_names(verdict: Verdict) -> str:
    return listing(display_name(name, kinds_of(verdict)) for name in verdict.named)


def _looks(verdict: Verdict) -> list[Look]:
    if verdict.before is None:
        return []
    return looks(verdict.before.model, verdict.model if verdict.named else None, _added_names(verdict))


def _picture(verdict: Verdict, data: RigSet) -> Picture:
    """Return the channel where what was added shows most, and what is left of it; all channels of nothing fitted."""
    curves = _looks(verdict)
    channels = channel_panels(data, curves)
    if not curves or not isinstance(verdict.extra, RigExtra):
        return Picture(channels, f"Measured {listing(channel.name for channel in data.channels)} against slip.")
    names = [channel.name for channel in data.channels]
    score = max((score for score in verdict.scores if score.name in names), key=_chi2_fall)
    row = names.index(score.name)
    residuals = residual_panels(data, verdict.extra.before, verdict.extra.after if verdict.named else None)
    alt = f"{score.name} against slip, measured, with the base model" + f" and with {_added_names(verdict)}" * bool(
        verdict.named
    )
    before, after = (format_value(error, score.unit) for error in (score.before, score.after))
    missed = f"missed by {before} before and {after} after" if verdict.named else f"missed by {before}"
    return Picture((channels[row], residuals[row]), f"{capital(alt)}: {missed}.", load_caption(data))


def _chi2_fall(score: ChannelScore) -> float:
    """Return by how much the held-out chi2 of a channel falls; how large it is where nothing was added."""
    before, after = score.times(score.before) ** 2, score.times(score.after) ** 2
    return before - after if before != after else before


def where_wrong_section(verdict: Verdict, data: RigSet) -> Section | None:
    """Return what each model leaves at each level, and what that goes with; None where nothing was fitted."""
    sides, added = verdict.extra, bool(verdict.named)
    if not isinstance(sides, RigExtra):
        return None
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
        "channels": Picture(channel_panels(data, _looks(verdict)), "Channels against slip.", load_caption(data)),
        "residuals": Picture(panels, f"Measured minus model at each level of slip; left is {listing(errors)}."),
    }
    return Section("Where the error lives", "rig/where_it_lives.html", content, pictures)


def test_table(sides: RigExtra, added: bool) -> Table:
    """Return what the residuals go with, before and after: the sign is that of measured - model, as in the picture."""
    heads = ("channel", "goes with", *before_and_after(added))
    rows = [
        Row((was.channel, was.against, _test(was), *((_test(now),) if added else ())), AWAY * now.is_significant)
        for was, now in zip(sides.before.tests, sides.after.tests, strict=True)
    ]
    return Table(heads, tuple(rows), "What measured - model goes with")


def _test(test: ResidualTest) -> str:
    return f"{test.correlation:+.2f} (p = {test.p:.2g})" + (" *" if test.is_significant else "")


def elsewhere_section(verdict: Verdict) -> Section | None:
    """Return fitted constants against other measurements of them; None where none is known from elsewhere."""
    extra = verdict.extra
    if not isinstance(extra, RigExtra) or not extra.before.flags:
        return None
    sides = [("before", extra.before), *([("after", extra.after)] if verdict.named else [])]
    rows = [
        Row((when, flag.sentence), AWAY if flag.says is Against.AWAY else "")
        for when, side in sides
        for flag in side.flags
    ]
    table = Table(("model", "constant, its 95 % interval, and what is known of it"), tuple(rows))
    return Section("Against other measurements", "rig/elsewhere.html", {"table": table})


def set_by_set_section(verdict: Verdict) -> Section | None:
    """Return the held-out errors of each set, and of a curve through that set alone; None where nothing was fitted."""
    if not isinstance(verdict.extra, JointExtra):
        return None
    added, rows = bool(verdict.named), []
    for row in verdict.extra.sets:
        values = (row.before, row.after, row.noise) if added else (row.before, row.noise)
        errors = [format_value(value, row.unit) for value in values]
        curve = f"{format_value(row.curve_error, row.unit)} ({row.curve})"
        rows.append(Row((f"{row.set}: {row.channel}", *errors, curve), AWAY * row.is_lost))
    heads = ("set and channel, not fitted", *before_and_after(added), "noise", "a curve of that set alone")
    table = Table(heads, tuple(rows), "Held-out errors of each set")
    return Section("Set by set", "rig/set_by_set.html", {"table": table})


LEVEL = 0.005
"""Half of the last digit of a slip as it is said: what lies within is one level."""


def meanings(data: RigSet) -> dict[str, str]:
    """Return the meaning of every level by its name: 'S = 0.5', with slip angle and load where they differ."""
    angled = bool(np.ptp(data.slip_angle) > 1e-3)
    loaded = data.loads_vary
    descriptions = {}
    for number, name in enumerate(data.level_names):
        at = data.level == number
        parts = [f"S = {_slip(float(np.mean(data.slip[at])))}"]
        parts += [f"{math.degrees(float(np.mean(data.slip_angle[at]))):.3g} deg"] if angled else []
        parts += [f"{float(np.mean(data.load[at])):.3g} N"] if loaded else []
        descriptions[name] = ", ".join(parts)
    twice = {words for words, times in Counter(descriptions.values()).items() if times > 1}
    return {name: f"{words} ({name})" if words in twice else words for name, words in descriptions.items()}


def _slip(slip: float) -> str:
    return f"{0.0 if abs(slip) < LEVEL else slip:.2g}"


STABLE = 0.8
"""Least share of folds that choose the same effect without a word of caution."""

FEW_LEVELS = 6
"""Levels below which a bootstrap over levels is coarse."""


def cautions(verdict: Verdict, diagnostics: FitDiagnostics) -> tuple[str, ...]:
    """Return the cautions of a rig's verdict, given what its last model leaves."""
    numbers = verdict.after.numbers if verdict.after else ()
    of_fit = (*of_parameters(numbers, diagnostics.flags), *of_residuals(diagnostics.residuals, diagnostics.tests))
    return (*of_fit, *of_choice(verdict), *verdict.cautions)


def of_parameters(fitted: Sequence[Number], flags: Sequence[Flag]) -> list[str]:
    """Return the cautions of fitted values: at a bound, open, away from what is known elsewhere."""
    sentences = [
        f"{number.name} lies at its bound: the form of the model is strained" for number in fitted if number.at_bound
    ]
    sentences += [
        f"{number.name} is not closed by the data" for number in fitted if not number.closed and not number.at_bound
    ]
    nothing = "is not identified: its interval covers what is allowed of it, and says nothing of its independent value"
    sentences += [flag.sentence for flag in flags if flag.says is Against.AWAY]
    sentences += [f"{flag.name} {nothing}" for flag in flags if flag.says is Against.NOTHING]
    return sentences


def of_residuals(residuals: Sequence[RigChannelResidual], tests: Sequence[ResidualTest]) -> list[str]:
    """Return the cautions of what is left: more than noise, or hanging together with something."""
    sentences = [
        f"{residual.name} is left with {residual.rms:.1f} times its noise"
        for residual in residuals
        if not residual.is_noise
    ]
    sentences += [
        f"the residual of {test.channel} hangs together with {test.against} (r = {test.correlation:+.2f}, "
        f"p = {test.p:.2g}, one of {test.of} tests)"
        for test in tests
        if test.is_significant
    ]
    return sentences


def of_choice(verdict: Verdict) -> list[str]:
    """Return the cautions of the choice: what could not be fitted, folds that choose otherwise, few levels."""
    sentences = []
    untried = verdict.beliefs.untried if verdict.beliefs is not None else ()
    sentences += [f"{name} was not tried: with it, however small, no sinkage carries a run" for name in untried]
    chosen, levels = list(verdict.chosen.values()), len(verdict.chosen)
    times = verdict.agreeing_folds
    if times < STABLE * levels:
        others = sorted({name or "no effect" for name in chosen} - {" + ".join(verdict.named) or "no effect"})
        names = " + ".join(verdict.named) or "no effect"
        sentences.append(f"only {times} of {levels} folds choose {names}; the others {', '.join(others)}")
    if levels < FEW_LEVELS:
        sentences.append(f"{levels} levels are few: the intervals of held-out errors resample {levels} numbers")
    return sentences
