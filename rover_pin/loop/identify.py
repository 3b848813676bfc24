"""What data say of a model's numbers: the loop's own fit with nothing missing, and what each number depends on."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.quantity import check, quantities
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.discrepancy.conclude import fits_of, proper, side_of
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.standalone import Standalone
from rover_pin.discrepancy.standalone import question_of as question_of_bench
from rover_pin.discrepancy.verdict import Side
from rover_pin.estimation.identification import ChannelFit, Estimate, Identification, variance_shares
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.parameter import Parameter, Prior
from rover_pin.experiments.wheel_rig.diagnostics import Flag, flags
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.loop.data_check import Measured, measured_in
from rover_pin.loop.rig import question_of as question_of_rig
from rover_pin.measurements.rig_set import RigSet

BY_HAND = "--prior"
"""Source of what the user says of a number."""
REMEDIES = {
    "r": "a ruler tells it",
    "b": "a ruler tells it",
    "c": "drawbar pull and torque at two loads or more, one at least 1.5 times the other, tell it",
    "phi": "a direct shear test, or drawbar pull and torque at two loads or more with slips up to 1, tell it",
    "k": "a direct shear test, or drawbar pull of a wheel whose radius is many k at slips from 0.02 to 1, tells it",
    "k_1": "sinkage under a known load tells k_1 + k_2 b, and wheels or plates of two widths part the two",
    "k_2": "sinkage under a known load tells k_1 + k_2 b, and wheels or plates of two widths part the two",
    "n": "sinkage under two loads or more tells it",
    "theta_1": "a sinkage measurement tells it, by Eq (5)",
    "theta_2": "stress sensors in the rim, or drawbar pull and torque near slip 0, tell it",
    "pressing_scale": "sinkage at slips about 0 under a known load, beside the pressing, tells it",
    "exit_ratio": "drawbar pull, torque and sinkage at three loads tell it",
}
"""Which measurement would tell a constant."""


def identify(
    data: Measured | str | Path | tuple[str | Path, ...],
    priors: Mapping[str, Prior] = {},
    fixed: Mapping[str, float] = {},
    trust: bool = False,
    progress: Progress = lambda message: None,
) -> Identification:
    """Fit the numbers of the base model to data, as `close_the_loop` does before it looks for what is missing.

    Every number that the loop takes to be uncertain is free, with what is declared or assumed of it as its prior.
    Intervals are of the posterior, with a smooth discrepancy beside noise as the data have it. Each number's variance
    is parted by `variance_shares`: what depends on an assumption says so.

    Parameters
    ----------
    data : path, tuple of paths, or data in memory
        As `measured_in` reads them: a wheel-rig set, several in one sand, a drive log or a CSV file as traction factors
        by slip, or an experiment.
    priors : mapping of str to Prior
        What is known of numbers, in place of what is declared or assumed: `phi`, `soil.phi`, `wheel.r`.
    fixed : mapping of str to float
        Numbers that are held at a value [SI].
    trust : bool
        Whether the data may name files outside their folder.

    Raises
    ------
    ParameterError, DataError
        An unknown number, a value out of its bounds, or data that cannot be read or used: one sentence.
    OptimisationError
        The base model cannot be fitted at all.

    Examples
    --------
    >>> identification = identify("cmu-smooth-wheel")
    >>> identification["phi"].depends_on
    ('soil.exit_ratio',)

    Source: section 4.1, "a theoretical curve that makes a best fit". Differs from the paper: it prints no uncertainty.
    """
    measured = measured_in(data, Trust(everything=trust)).data if isinstance(data, (str, Path, tuple)) else data
    experiment = RigExperiment((measured,)) if isinstance(measured, RigSet) else measured
    question = _with_numbers(_question_of(experiment), priors, fixed)
    beliefs = fits_of(question, progress).beliefs()
    best = beliefs.best(())
    side = side_of(beliefs, best)
    covariance = best.posterior.covariance[: len(side.numbers), : len(side.numbers)]
    size = np.sqrt(np.diag(covariance))
    return Identification(
        question.name,
        side.model,
        tuple(_estimates(side.numbers, covariance)),
        side.misfit,
        tuple(_channel_fits(side)),
        _held_constants(question, side.model),
        _elsewhere(side),
        covariance / np.outer(size, size),
    )


def _question_of(experiment: RigExperiment | Standalone) -> Question:
    """Return the base model's question: its numbers are asked for, and nothing is missing."""
    if isinstance(experiment, RigExperiment):
        question = question_of_rig(experiment, experiment.base_model(), ())
    else:
        question = question_of_bench(experiment, ())
    return dataclasses.replace(question, candidates=lambda base: ())


def _with_numbers(question: Question, priors: Mapping[str, Prior], fixed: Mapping[str, float]) -> Question:
    """Return a question with the numbers that the user knows, or holds."""
    experiment = question.experiment
    values = {_full_name(name): value for name, value in fixed.items()}
    for name, value in values.items():
        check("the value of", name, value, experiment.quantity(question.model, name))
    model = experiment.with_values(question.model, values)
    numbers = {number.name: number for number in question.numbers if number.name not in values}
    for name, prior in priors.items():
        full = _full_name(name)
        number = numbers.get(full) or experiment.parameter(model, full, prior.sd)
        numbers[full] = _apply_prior(number, prior, experiment.quantity(model, full))
    return dataclasses.replace(question, model=model, numbers=tuple(map(proper, numbers.values())))


def _apply_prior(number: Parameter, prior: Prior, spec: Any) -> Parameter:
    check("prior", number.name, prior.mean, spec)
    is_log = number.log and prior.mean > 0
    sd = prior.sd / prior.mean if is_log else prior.sd
    return dataclasses.replace(
        number, origin=prior.mean, scale=sd, log=is_log, prior=True, declared=True, source=BY_HAND
    )


def _full_name(name: str) -> str:
    """Return `soil.k` of `k`, `wheel.r` of `r`; a name with its owner as it is."""
    if "." in name:
        return name
    return f"wheel.{name}" if name in quantities(Wheel) else f"soil.{name}"


def _estimates(numbers: Sequence[Number], covariance: np.ndarray) -> list[Estimate]:
    estimates = []
    for number, shares in zip(numbers, variance_shares(covariance), strict=True):
        rows = sorted(zip(numbers, shares.tolist(), strict=True), key=lambda row: -row[1])
        data_share, prior_shares = 1.0 - float(sum(shares)), {other.name: share for other, share in rows}
        estimates.append(Estimate(number, data_share, prior_shares, _remedy(number.name)))
    return estimates


def _remedy(name: str) -> str:
    quantity = name.rpartition(".")[2]
    return (
        f"{quantity}: {REMEDIES[quantity]}" if quantity in REMEDIES else f"measure {name}, and declare it with its sd"
    )


def _channel_fits(side: Side) -> list[ChannelFit]:
    experiment = side.fit.task.experiment
    counts = side.fit.task.noise.good.sum(axis=(0, 2)).tolist()
    rows = zip(experiment.channels, counts, side.fit.rms.tolist(), strict=True)
    return [ChannelFit(name, experiment.unit(name), count, rms) for name, count, rms in rows]


def _held_constants(question: Question, model: Any) -> dict[str, float]:
    """Return the constants of wheel and soil that were not free."""
    free = {number.name for number in question.numbers}
    records = question.experiment.records(model)
    names = [
        f"{owner}.{name}"
        for owner, record in records.items()
        if isinstance(record, (Wheel, Soil))
        for name in quantities(record)
    ]
    return {name: question.experiment.value(model, name) for name in names if name not in free}


def _elsewhere(side: Side) -> tuple[Flag, ...]:
    """Return the fitted constants of a rig against what was measured of them apart from the runs."""
    experiment = side.fit.task.experiment
    if not isinstance(experiment, RigExperiment):
        return ()
    rig = experiment.declared
    return flags(rig, side.model.soil, float(rig.wheel.b), side.numbers)
