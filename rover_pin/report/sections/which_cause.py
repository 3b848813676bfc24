"""How probable each cause is, what size it would have, and which sets the data leave."""

import numpy as np
from matplotlib.figure import Figure

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.wording import MAX_NAMED, format_value, interval
from rover_pin.inference.beliefs import LEAST, Beliefs
from rover_pin.report.page import CHOSEN, Picture, Row, Section, Table
from rover_pin.report.sections.sensitivity import is_threshold, unit_of
from rover_pin.report.svg import AFTER, GREY
from rover_pin.report.words import Labels, as_text, capital, full, human, kinds_of, listing

MAX_CAUSES = 20
"""Causes, and sets of them, that are listed."""
ESTIMATED = "estimated, not fitted"
"""What is said of a set that was weighed by a linear estimate alone."""


def which_cause_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return the probabilities of causes and of sets; None where nothing was weighed."""
    beliefs = verdict.beliefs
    if beliefs is None:
        return None
    rows = [Row((name, f"{probability:.3f}")) for name, probability in beliefs.families.items()]
    content = {
        "families": Table(("family", "probability that one of it acts"), tuple(rows), "Families of causes"),
        "count": beliefs.choice,
        "estimated": not all(hypothesis.is_fitted for hypothesis in beliefs.hypotheses),
        "causes": _causes(beliefs, verdict, labels),
        "sets": _sets(beliefs, verdict, labels),
        "anew": _anew(verdict, labels),
    }
    return Section("Which cause", "sections/which_cause.html", content, {"causes": _picture(beliefs, verdict, labels)})


def _picture(beliefs: Beliefs, verdict: Verdict, labels: Labels) -> Picture:
    """Return the probabilities of the leading causes."""
    kinds = kinds_of(verdict)
    probabilities = list(beliefs.included.items())[:MAX_CAUSES]
    figure = Figure(figsize=(6.2, 0.26 * len(probabilities) + 1.0), layout="constrained")
    axis = figure.subplots()
    colours = [AFTER if name in verdict.named else GREY for name, _ in probabilities]
    axis.barh(range(len(probabilities)), [probability for _, probability in probabilities], color=colours, height=0.7)
    names = [as_text(display_name(labels.placed(name), kinds)) for name, _ in probabilities]
    axis.set_yticks(range(len(probabilities)), names, fontsize=8.5)
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.0)
    axis.set_xlabel("probability that it acts")
    axis.grid(alpha=0.25, axis="x")
    leading = [f"{full(name, kinds, labels)} {probability:.2f}" for name, probability in probabilities[:3]]
    return Picture((figure,), f"Probability that a cause acts: {listing(leading)}.")


def _causes(beliefs: Beliefs, verdict: Verdict, labels: Labels) -> Table:
    kinds, rows = kinds_of(verdict), []
    for name, probability in list(beliefs.included.items())[:MAX_CAUSES]:
        cells = full(name, kinds, labels), f"{probability:.3f}", _size(beliefs, name)
        rows.append(Row(cells, CHOSEN * (name in verdict.named)))
    return Table(("cause", "probability", "its size, if it acts"), tuple(rows), "Causes")


def _sets(beliefs: Beliefs, verdict: Verdict, labels: Labels) -> Table:
    kinds, rows = kinds_of(verdict), []
    for names, probability in list(beliefs.sets.items())[:MAX_CAUSES]:
        if probability > LEAST:
            causes = listing(full(name, kinds, labels) for name in sorted(names)) or "nothing"
            is_fitted = beliefs.best(tuple(names)).is_fitted
            cells = causes, f"{probability:.3f}", f"{beliefs.leaves_more(names):.2f}" if is_fitted else ESTIMATED
            rows.append(Row(cells, CHOSEN * (names == frozenset(verdict.named))))
    return Table(("all that is missing", "probability", "leaves more than noise"), tuple(rows), "Sets")


def _anew(verdict: Verdict, labels: Labels) -> str:
    again = capital(human(f"{verdict.chosen_again}.", kinds_of(verdict)))
    units = {score.name: score.unit for score in verdict.scores}
    if len(units) > MAX_NAMED:
        return again
    errors = [
        f"{labels.channel(name)} {format_value(error, units[name])}" for name, error in verdict.errors_anew.items()
    ]
    return f"{again} All hypotheses together miss {labels.folds} left out by {listing(errors)}."


def _size(beliefs: Beliefs, name: str) -> str:
    """Return the amplitudes of a cause with their 95 % intervals, by all fitted hypotheses that have it.

    Where none was fitted, by the most probable estimate.
    """
    rows = [row for row in zip(beliefs.scores, beliefs.hypotheses, strict=True) if name in row[1].names]
    _, of = max(rows, key=lambda row: (row[1].is_fitted, -len(row[1].names) * row[1].is_fitted, row[0]))
    cause = next(cause for cause in of.causes if cause.name == name)
    texts = [] if of.is_fitted else [ESTIMATED]
    for parameter in cause.parameters:
        if parameter.name in cause.amplitudes and (of.is_fitted or not is_threshold(parameter)):
            mean, sd = beliefs.moments(of, parameter.name) if of.is_fitted else of.moments(parameter.name)
            ends = np.clip([mean - NORMAL_95 * sd, mean, mean + NORMAL_95 * sd], *parameter.bounds)
            low, middle, high = (parameter.value(float(u)) for u in ends)
            unit = unit_of(of, cause, parameter)
            name = parameter.name.rpartition(".")[2]
            within = interval(middle, min(low, high), max(low, high), unit)
            texts.append(f"{name} = {within}" if low != high else f"{name} at its bound")
    return "; ".join(texts)
