"""Fit the numbers of the base model to data, and state on which priors each number depends.

Unlike `close_the_loop`, this module does not search for missing effects.
"""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rover_pin.base.quantity import check, quantities
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.discrepancy.conclude import fits_of, proper, side_of
from rover_pin.discrepancy.question import LoopData, Progress, Question, quiet
from rover_pin.estimation.identification import ChannelFit, Estimate, Identification, variance_shares
from rover_pin.estimation.parameter import Prior
from rover_pin.experiments.drive_log.loop_data import DriveLogData
from rover_pin.experiments.wheel_rig.diagnostics import Flag, flags
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.logs.drive_log import DriveLog
from rover_pin.loop.data_check import Measured, measured_in
from rover_pin.measurements.rig_set import RigSet

USER_PRIOR = "--prior"
"""Source that results state for a number if the user gave its prior."""
REMEDIES = {
    "r": "measure it with a ruler",
    "b": "measure it with a ruler",
    "c": "measure drawbar pull and torque at two or more loads, one at least 1.5 times the other",
    "phi": "make a direct shear test, or measure drawbar pull and torque at two or more loads with slips up to 1",
    "k": "make a direct shear test, or measure the drawbar pull of a wheel with a radius of many k at slips from 0.02 "
    "to 1",
    "k_1": "measure the sinkage under a known load, which gives k_1 + k_2 b; wheels or plates of two widths separate "
    "the two",
    "k_2": "measure the sinkage under a known load, which gives k_1 + k_2 b; wheels or plates of two widths separate "
    "the two",
    "n": "measure the sinkage under two or more loads",
    "theta_1": "measure the sinkage, from which it follows by Eq (5)",
    "theta_2": "use stress sensors in the rim, or measure drawbar pull and torque near slip 0",
    "pressing_scale": "measure the sinkage at slips near 0 under a known load, in addition to the pressing",
    "exit_ratio": "measure drawbar pull, torque and sinkage at three loads",
}
"""Name of a number of the soil or the wheel -> advice: the measurement that would determine this number."""


def identify(
    data: Measured | str | Path | tuple[str | Path, ...],
    priors: Mapping[str, Prior] = {},
    fixed: Mapping[str, float] = {},
    trust: bool = False,
    progress: Progress = quiet,
) -> Identification:
    """Fit the numbers of the base model to data, as `close_the_loop` does before it looks for a missing effect.

    Every number that the loop treats as uncertain is fitted, and its declared or assumed value is the mean of its
    prior. The stated intervals are intervals of the posterior distribution. If the residuals vary smoothly instead of
    like noise, the model has a discrepancy, and the intervals become wider by it. `variance_shares` divides the
    posterior variance of each number into a part from the data and parts from the priors. These parts show whether a
    number depends on an assumption.

    Parameters
    ----------
    data : path, tuple of paths, or data in memory
        As for `measured_in`: a wheel-rig set, several wheel-rig sets in one sand, a drive log, a CSV file of traction
        factors, or an experiment. A drive log that declares its motor gives traction factors against slip; any other
        drive log is replayed as in `close_the_loop`.
    priors : mapping of str to Prior
        Name of a number, such as `phi`, `soil.phi` or `wheel.r` -> your own prior, which replaces the declared or
        assumed prior.
    fixed : mapping of str to float
        Numbers that are not fitted, with their values [SI].
    trust : bool
        Whether the data may name files outside their folder.
    progress : callable
        Called with one line of text before each step.

    Returns
    -------
    Identification
        The estimate of each number, with its interval and with the priors that it depends on; `report()` returns the
        text that the command prints.

    Raises
    ------
    ParameterError, DataError
        If a number is unknown, if a value is out of its bounds, or if data cannot be read or used.
    OptimisationError
        If the base model cannot be fitted at all.

    Examples
    --------
    >>> identification = identify("cmu-smooth-wheel")
    >>> identification["phi"].depends_on
    ('soil.exit_ratio',)

    Source: section 4.1, "a theoretical curve that makes a best fit". Differs from the paper: it prints no uncertainty.
    """
    measured = measured_in(data, Trust(everything=trust)).data if isinstance(data, (str, Path, tuple)) else data
    experiment = RigExperiment((measured,)) if isinstance(measured, RigSet) else measured
    source: LoopData
    if isinstance(experiment, RigExperiment):
        source = RigData(experiment)
    elif isinstance(experiment, DriveLog):
        source = DriveLogData.starting_from(experiment, None, os.cpu_count() or 1, Trust(everything=trust))
    else:
        source = experiment
    # Without candidates for a missing effect, the search only fits the numbers of the base model.
    question = dataclasses.replace(source.question(()), candidates=lambda base: ())
    question = _apply_priors(question, priors, fixed)
    beliefs = fits_of(question, progress).beliefs()
    best = beliefs.best(())
    side = side_of(beliefs, best)

    # The first rows of the posterior covariance belong to the numbers, and the other rows to the discrepancy.
    covariance = best.posterior.covariance[: len(side.numbers), : len(side.numbers)]
    estimates = []
    # The variance of each number is divided into the fractions that come from the data and from each prior.
    for number, shares in zip(side.numbers, variance_shares(covariance), strict=True):
        largest_first = sorted(zip(side.numbers, shares.tolist(), strict=True), key=lambda row: -row[1])
        prior_shares = {other.name: share for other, share in largest_first}
        quantity = number.name.rpartition(".")[2]
        remedy = (
            f"{quantity}: {REMEDIES[quantity]}"
            if quantity in REMEDIES
            else f"measure {number.name}, and declare it with its sd"
        )
        estimates.append(Estimate(number, 1.0 - float(sum(shares)), prior_shares, remedy))
    # Number of compared values and RMS residual of each channel.
    counts = side.fit.task.noise.good.sum(axis=(0, 2)).tolist()
    rows = zip(best.experiment.channels, counts, side.fit.rms.tolist(), strict=True)
    channels = tuple(ChannelFit(name, best.experiment.unit(name), count, rms) for name, count, rms in rows)
    independent: tuple[Flag, ...] = ()
    if isinstance(experiment, RigExperiment):
        # A rig can declare constants that were measured in separate tests; the fit is compared with them.
        rig = experiment.declared
        independent = flags(rig, side.model.soil, float(rig.wheel.b), side.numbers)
    # The constants of wheel and soil that were not fitted, with their values [SI].
    fitted = {number.name for number in question.numbers}
    constants = [
        f"{owner}.{name}"
        for owner, record in question.experiment.records(side.model).items()
        if isinstance(record, (Wheel, Soil))
        for name in quantities(record)
    ]
    held = {name: question.experiment.value(side.model, name) for name in constants if name not in fitted}
    # Divided by both standard deviations, the covariance becomes the correlation.
    size = np.sqrt(np.diag(covariance))
    return Identification(
        question.name,
        side.model,
        tuple(estimates),
        side.misfit,
        channels,
        held,
        independent,
        covariance / np.outer(size, size),
    )


def _apply_priors(question: Question, priors: Mapping[str, Prior], fixed: Mapping[str, float]) -> Question:
    """Return the fit's input (data, base model and free numbers) with the user's priors and with the fixed numbers.

    `priors` maps the name of a number to the user's prior, and `fixed` maps the name of a number to its value [SI].

    Raises ParameterError: a value or the mean of a prior is out of bounds.
    """
    experiment = question.experiment
    # Fixed numbers are written into the model and are no longer free.
    values = {_full_name(name): value for name, value in fixed.items()}
    for name, value in values.items():
        check("the value of", name, value, experiment.quantity(question.model, name))
    model = experiment.with_values(question.model, values)
    numbers = {number.name: number for number in question.numbers if number.name not in values}
    for name, prior in priors.items():
        full = _full_name(name)
        # A number with a prior of the user is fitted, even if the loop would keep it constant.
        number = numbers.get(full) or experiment.parameter(model, full, prior.sd)
        check("prior", full, prior.mean, experiment.quantity(model, full))
        # On a logarithmic scale, the SD is relative to the mean. A mean of zero or below needs a linear scale.
        is_log = number.log and prior.mean > 0
        scale = prior.sd / prior.mean if is_log else prior.sd
        numbers[full] = dataclasses.replace(
            number, origin=prior.mean, scale=scale, log=is_log, prior=True, declared=True, source=USER_PRIOR
        )
    return dataclasses.replace(question, model=model, numbers=tuple(map(proper, numbers.values())))


def _full_name(name: str) -> str:
    """Return the full name of a number, which begins with wheel or soil: `soil.k` for `k`, `wheel.r` for `r`.

    A name that already has a dot, such as `soil.phi`, is returned unchanged.
    """
    if "." in name:
        return name
    return f"wheel.{name}" if name in quantities(Wheel) else f"soil.{name}"
