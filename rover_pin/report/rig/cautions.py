"""What a reader of a verdict should be wary of, one sentence each."""

from collections.abc import Sequence

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import Against
from rover_pin.experiments.wheel_rig.channel_residual import RigChannelResidual
from rover_pin.experiments.wheel_rig.diagnostics import FitDiagnostics
from rover_pin.experiments.wheel_rig.known_elsewhere import Flag
from rover_pin.experiments.wheel_rig.residual_tests import SIGNIFICANCE_LEVEL, ResidualTest

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
        f"p = {test.p:.2g} < {SIGNIFICANCE_LEVEL:g})"
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
    times = sum(set(name.split(" + ")) == set(verdict.named or [""]) for name in chosen)
    if times < STABLE * levels:
        others = sorted({name or "no effect" for name in chosen} - {" + ".join(verdict.named) or "no effect"})
        names = " + ".join(verdict.named) or "no effect"
        sentences.append(f"only {times} of {levels} folds choose {names}; the others {', '.join(others)}")
    if levels < FEW_LEVELS:
        sentences.append(f"{levels} levels are few: the intervals of held-out errors resample {levels} numbers")
    return sentences
