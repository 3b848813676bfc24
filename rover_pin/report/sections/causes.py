"""The sections on the causes of a mismatch between model and data: their probabilities, and their detectable sizes.

A cause is a missing effect or an error of the measurement. A hypothesis is a combination of causes that act together,
with the sizes of these causes from a fit or from a linear estimate.
"""

import math
import re
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.discrepancy.equivalents import MAX_SD_RATIO
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR_SDS, NORMAL_95
from rover_pin.estimation.wording import MAX_NAMED, format_value, interval, spread
from rover_pin.inference.beliefs import MIN_WRITTEN, Beliefs, Hypothesis, held_out_gain
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.report.page import CHOSEN, Picture, ReportTable, Section, TableRow
from rover_pin.report.svg import AFTER, GREY
from rover_pin.report.words import Labels, capital, full, human, kinds_of, listing, model_with, two_digits

MAX_CAUSES = 20
"""Maximum number of rows in the table of causes, and in the table of combinations of causes. The tables list the most
probable ones; all others have small probabilities, and would make the page long."""
ESTIMATED = "estimated, not fitted"
"""Remark on a combination of causes without a fit: its probability and the sizes of its causes come from a linear
estimate."""
NO_INFORMATION = "the data contain no information on its size"
NO_FIT = "no fit with this cause converged, even if its size was small"


def causes_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return the section with the probabilities of causes and of their combinations; None if no probabilities were
    computed.
    """
    beliefs = verdict.beliefs
    if beliefs is None:
        return None
    kinds = kinds_of(verdict)
    families = [TableRow((name, f"{probability:.3f}")) for name, probability in beliefs.families.items()]
    leading = list(beliefs.included.items())[:MAX_CAUSES]
    causes = [
        TableRow(
            (full(name, kinds, labels), f"{probability:.3f}", _size_if_acting(beliefs, name)),
            CHOSEN * (name in verdict.named),
        )
        for name, probability in leading
    ]
    # Combinations of causes, down to the smallest probability that is worth a row.
    combinations = []
    for names, probability in list(beliefs.sets.items())[:MAX_CAUSES]:
        if probability > MIN_WRITTEN:
            words = listing(full(name, kinds, labels) for name in sorted(names)) or "nothing"
            is_fitted = beliefs.best(tuple(names)).is_fitted
            gain = held_out_gain(beliefs, names)
            scatter = spread(gain.scatter) if math.isfinite(gain.scatter) else ""
            held_out = f"{gain.total:.3g}{scatter}" if names else "0"
            more = f"{beliefs.leaves_more(names):.2f}" if is_fitted else ESTIMATED
            cells = words, f"{probability:.3f}", more, held_out
            combinations.append(TableRow(cells, CHOSEN * (names == frozenset(verdict.named))))
    # The choice when parts of the data are left out, and the errors of all hypotheses together on these parts.
    repeated = capital(human(f"{verdict.chosen_again}.", kinds))
    units = {score.name: score.unit for score in verdict.scores}
    if len(units) <= MAX_NAMED:
        errors = [
            f"{labels.channel(name)} {format_value(error, units[name])}" for name, error in verdict.errors_anew.items()
        ]
        repeated += f" The mean of all hypotheses predicts held-out {labels.folds} with the errors {listing(errors)}."
    content = {
        "families": ReportTable(
            ("family", "probability that one of its causes acts"), tuple(families), "Families of causes"
        ),
        "count": beliefs.choice,
        "estimated": not all(hypothesis.is_fitted for hypothesis in beliefs.hypotheses),
        "causes": ReportTable(("cause", "probability", "its size, if it acts"), tuple(causes), "Causes"),
        "sets": ReportTable(
            (
                "causes that act together",
                "probability",
                "probability that more than noise remains",
                f"rise of the log probability of held-out {labels.folds}",
            ),
            tuple(combinations),
            "Combinations of causes",
        ),
        "anew": repeated,
    }
    # The figure shows the probabilities of the leading causes as bars; added causes have the colour of the model after.
    figure = Figure(figsize=(6.2, 0.26 * len(leading) + 1.0), layout="constrained")
    axis = figure.subplots()
    colours = [AFTER if name in verdict.named else GREY for name, _ in leading]
    axis.barh(range(len(leading)), [probability for _, probability in leading], color=colours, height=0.7)
    bar_names = [figure_text(display_name(labels.placed(name), kinds)) for name, _ in leading]
    axis.set_yticks(range(len(leading)), bar_names, fontsize=8.5)
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.0)
    axis.set_xlabel("probability that it acts")
    axis.grid(alpha=0.25, axis="x")
    first = [f"{full(name, kinds, labels)} {probability:.2f}" for name, probability in leading[:3]]
    picture = Picture((figure,), f"Probability that a cause acts: {listing(first)}.")
    return Section("Probabilities of the causes", "sections/causes.html", content, {"causes": picture})


def _size_if_acting(beliefs: Beliefs, name: str) -> str:
    """Return the sizes (amplitudes) of a cause with 95 % intervals as text, under the condition that the cause acts.

    The sizes are averaged over all fitted hypotheses (combinations of causes) that contain the cause. If no such
    hypothesis was fitted, the sizes come from the most probable linear estimate.
    """
    rows = [row for row in zip(beliefs.scores, beliefs.hypotheses, strict=True) if name in row[1].names]
    # Among fitted hypotheses, the one with the fewest causes names the parameters of the cause.
    _, hypothesis = max(rows, key=lambda row: (row[1].is_fitted, -len(row[1].names) * row[1].is_fitted, row[0]))
    cause = next(cause for cause in hypothesis.causes if cause.name == name)
    texts = [] if hypothesis.is_fitted else [ESTIMATED]
    for parameter in cause.parameters:
        if parameter.name in cause.amplitudes and (hypothesis.is_fitted or not is_threshold(parameter)):
            mean, sd = (
                beliefs.moments(hypothesis, parameter.name)
                if hypothesis.is_fitted
                else hypothesis.moments(parameter.name)
            )
            # The interval is normal on the scale of the fit (u), and is cut at the bounds before it is converted to
            # values.
            ends = np.clip([mean - NORMAL_95 * sd, mean, mean + NORMAL_95 * sd], *parameter.bounds)
            low, middle, high = (parameter.value(float(u)) for u in ends)
            unit = unit_of(hypothesis, cause, parameter)
            symbol = parameter.name.rpartition(".")[2]
            within = interval(middle, min(low, high), max(low, high), unit)
            texts.append(f"{symbol} = {within}" if low != high else f"{symbol} at its bound")
    return "; ".join(texts)


class Sensitivity(NamedTuple):
    """Smallest size of one cause that the data would show (at 3 SD) if the most probable other causes act too."""

    name: str
    "name of the cause"
    share: float
    """smallest detectable size, divided by the usual size of the cause"""
    size: str
    "smallest detectable size in words, with its unit"
    why: str
    """reason why the data cannot show the cause if it has its usual size; empty if they can"""


def sensitivity_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return the section with the smallest detectable size of each cause that was not added; None if no such cause
    exists.

    The section makes the answer "no effect found" quantitative: smaller effects may act without being detected.
    """
    results = sensitivities(verdict.beliefs, verdict.named) if verdict.beliefs else {}
    if not results:
        return None
    kinds, undetectable, detectable = kinds_of(verdict), [], []
    # Causes that these data can hardly show are listed apart, with the reason.
    for best, places in results.values():
        name = full(best.name, kinds, labels) + (f", best of {places} places" if places > 1 else "")
        if best.why:
            undetectable.append(TableRow((name, best.why, best.size)))
        else:
            detectable.append(TableRow((name, best.size, two_digits(best.share))))
    content = {
        "undetectable": ReportTable(("candidate", "reason", "detectable from about"), tuple(undetectable)),
        "detectable": ReportTable(
            ("candidate", "detectable from about", "relative to its usual size"), tuple(detectable)
        ),
    }
    return Section("Detection limits", "sections/sensitivity.html", content)


def sensitivities(beliefs: Beliefs, named: tuple[str, ...]) -> dict[str, tuple[Sensitivity, int]]:
    """Return the smallest detectable size of each kind of cause that was not added; the best detectable kind comes
    first.

    A kind of cause, such as a weak motor, may act at several places (wheels, channels, positions). The dict maps each
    kind to a pair: the `Sensitivity` at the place where the detectable size, relative to the usual size, is smallest,
    and the number of places. `named` are the added causes.
    """
    kinds: dict[str, list[Sensitivity]] = {}
    # The part of a name before a bracket or an @ is the kind of cause, as WeakMotor in WeakMotor[2].
    for name in sorted({*beliefs.included, *beliefs.untried} - set(named)):
        rows = kinds.setdefault(re.split(r"[\[@]", name)[0], [])
        if name in beliefs.untried:
            rows.append(Sensitivity(name, math.inf, "none", NO_FIT))
            continue
        # The size is the most precisely known amplitude, in the most probable hypothesis (combination of causes) that
        # contains the cause. A cause whose amplitudes are all thresholds has no such size.
        scored = zip(beliefs.scores, beliefs.hypotheses, strict=True)
        _, hypothesis = max((row for row in scored if name in row[1].names), key=lambda row: row[0])
        cause = next(cause for cause in hypothesis.causes if cause.name == name)
        linear = [number for number in cause.parameters if number.name in cause.amplitudes and not is_threshold(number)]
        if not linear:
            continue
        pairs = [(hypothesis.moments(number.name)[1], number) for number in linear]
        sd, parameter = min(pairs, key=lambda pair: pair[0])
        # The prior SD of an effect is SIZE_SD usual sizes. The usual size of an error of the measurement is its prior
        # SD.
        share = CLEAR_SDS * sd * (SIZE_SD if cause.owner else 1.0)
        # `sd` is relative to the prior SD: near 1, the data have not narrowed the prior.
        if sd > MAX_SD_RATIO:
            rows.append(Sensitivity(cause.name, share, "none", NO_INFORMATION))
            continue
        unit = unit_of(hypothesis, cause, parameter)
        step, symbol = CLEAR_SDS * sd * parameter.scale, parameter.name.rpartition(".")[2]
        size = (
            f"{symbol} differs from {format_value(parameter.origin, unit)} by {format_value(abs(step), unit)}"
            if parameter.origin
            else f"{symbol} = {format_value(step, unit)}"
        )
        why = f"detectable only from {two_digits(share)} times its usual size" if share > 1 else ""
        beyond = "" if parameter.low <= parameter.origin + step <= parameter.high else ", beyond its bounds"
        rows.append(Sensitivity(cause.name, share, size + beyond, why))
    best = {kind: (min(rows, key=lambda row: row.share), len(rows)) for kind, rows in kinds.items() if rows}
    return dict(sorted(best.items(), key=lambda pair: pair[1][0].share))


def unit_of(hypothesis: Hypothesis, cause: Cause, parameter: Parameter) -> str:
    """Return the SI unit of a parameter of a cause, even if the model of the hypothesis does not contain the cause."""
    return hypothesis.experiment.quantity(model_with(hypothesis, cause), parameter.name).unit


def is_threshold(parameter: Parameter) -> bool:
    """Return whether a parameter of a cause is a threshold, above which the cause acts.

    The size of such a cause cannot be estimated by a linear model, because a fraction of a threshold has no meaning.
    """
    return parameter.log or (math.isinf(parameter.low) and parameter.origin != 0)
