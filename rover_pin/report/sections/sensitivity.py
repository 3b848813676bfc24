"""What the data could not tell, and from what size they would have: so that 'nothing found' has a number."""

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR
from rover_pin.estimation.wording import format_value
from rover_pin.inference.beliefs import Beliefs, Hypothesis
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.report.page import Row, Section, Table
from rover_pin.report.words import Labels, full, kinds_of, model_with, two_digits

OPEN = 0.9
"""SD of a size over that beforehand from which the data say nothing of it."""
NOTHING = "the data say nothing of its size"
NO_FIT = "with it, however small, no fit ended"


class Sensitivity(NamedTuple):
    """From about which size one cause would show, beside what most probably acts."""

    name: str
    share: float
    "of its usual size"
    size: str
    "the same in numbers"
    why: str
    "why the data cannot tell it; empty where they can"


def sensitivity_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return what could not be told and from what size the rest would show; None where nothing else was weighed."""
    results = sensitivities(verdict.beliefs, verdict.named) if verdict.beliefs else {}
    if not results:
        return None
    kinds, undetectable, detectable = kinds_of(verdict), [], []
    for best, places in results.values():
        name = full(best.name, kinds, labels) + (f", best of {places} places" if places > 1 else "")
        if best.why:
            undetectable.append(Row((name, best.why, best.size)))
        else:
            detectable.append(Row((name, best.size, two_digits(best.share))))
    content = {
        "undetectable": Table(("candidate", "why not", "would show from about"), tuple(undetectable)),
        "detectable": Table(("candidate", "would show from about", "of its usual size"), tuple(detectable)),
    }
    return Section("What could not be told", "sections/sensitivity.html", content)


def sensitivities(beliefs: Beliefs, named: tuple[str, ...]) -> dict[str, tuple[Sensitivity, int]]:
    """Return, for each kind of cause that was not named, where it would show best, and at how many places it was
    weighed; what the data tell least stands last."""
    kinds: dict[str, list[Sensitivity]] = {}
    for name in sorted({*beliefs.included, *beliefs.untried} - set(named)):
        kinds.setdefault(re.split(r"[\[@]", name)[0], []).extend(_of(beliefs, name))
    best = {kind: (min(rows, key=lambda row: row.share), len(rows)) for kind, rows in kinds.items() if rows}
    return dict(sorted(best.items(), key=lambda pair: pair[1][0].share))


def _of(beliefs: Beliefs, name: str) -> Iterator[Sensitivity]:
    """Yield what the most probable hypothesis with a cause says of the amplitude that it tells best, if it has any."""
    if name in beliefs.untried:
        yield Sensitivity(name, math.inf, "none", NO_FIT)
        return
    rows = zip(beliefs.scores, beliefs.hypotheses, strict=True)
    _, hypothesis = max((row for row in rows if name in row[1].names), key=lambda row: row[0])
    cause = next(cause for cause in hypothesis.causes if cause.name == name)
    linear = [number for number in cause.parameters if number.name in cause.amplitudes and not is_threshold(number)]
    if linear:
        sd, parameter = min(
            ((hypothesis.moments(number.name)[1], number) for number in linear), key=lambda pair: pair[0]
        )
        yield _sensitivity(hypothesis, cause, parameter, sd)


def _sensitivity(hypothesis: Hypothesis, cause: Cause, parameter: Parameter, sd: float) -> Sensitivity:
    share = CLEAR * sd * (SIZE_SD if cause.owner else 1.0)  # an error of the measuring has its prior SD as usual size
    if sd > OPEN:
        return Sensitivity(cause.name, share, "none", NOTHING)
    unit = unit_of(hypothesis, cause, parameter)
    step, short = CLEAR * sd * parameter.scale, parameter.name.rpartition(".")[2]
    from_none = f"{short} = {format_value(step, unit)}"
    size = f"{short} off {format_value(parameter.origin, unit)} by {format_value(abs(step), unit)}"
    why = f"would show from {two_digits(share)} times its usual size only" if share > 1 else ""
    beyond = "" if parameter.low <= parameter.origin + step <= parameter.high else ", beyond its bounds"
    return Sensitivity(cause.name, share, (size if parameter.origin else from_none) + beyond, why)


def unit_of(hypothesis: Hypothesis, cause: Cause, parameter: Parameter) -> str:
    """Return the unit of a cause's number."""
    return hypothesis.experiment.quantity(model_with(hypothesis, cause), parameter.name).unit


def is_threshold(parameter: Parameter) -> bool:
    """Return whether a cause acts from an amplitude on, in a fit or an estimate: a share of it means nothing."""
    return parameter.log or (math.isinf(parameter.low) and parameter.origin != 0)
