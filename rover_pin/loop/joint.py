"""The loop on several rig sets in one sand: one soil and one answer, with the errors of each set beside it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import concluded
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline, curves
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.joint_rig.diagnostics import JointExtra, SetError
from rover_pin.experiments.joint_rig.experiment import JointRig
from rover_pin.experiments.wheel_rig.candidates import rig_kinds
from rover_pin.experiments.wheel_rig.checks import findings
from rover_pin.experiments.wheel_rig.data import as_rig_set
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.known_elsewhere import flags
from rover_pin.experiments.wheel_rig.model_file import write_model
from rover_pin.experiments.wheel_rig.next_runs import runs_ahead
from rover_pin.experiments.wheel_rig.presets import describe_declared
from rover_pin.inference.next_measurement import Offer
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.loop.verdict_file import written_last
from rover_pin.measurements.finding import Finding
from rover_pin.measurements.rig_physics import refuse_impossible
from rover_pin.report.joint.report import write_report
from rover_pin.report.rig.cautions import of_parameters


def close_joint_loop(joint: JointRig, request: LoopRequest, progress: Progress) -> Verdict:
    """Return what one model of several sets lacks; see `close_the_loop`.

    Raises
    ------
    DataError
        A set that no wheel on any soil gives.
    OptimisationError
        The base model cannot be fitted at all.
    """
    begun = time.monotonic()
    for data in joint.sets.values():
        refuse_impossible(data.rig)
    say_what_is_replaced(request.out, OF_A_LOOP)
    verdict = on_sets(joint, rig_kinds(request.effects), progress, request.seed)
    verdict.provenance.update(provenance(request, time.monotonic() - begun))
    if request.out is None:
        return verdict
    out = Path(request.out)
    files = [write_model(verdict.model.of(name), out / f"model-{name}.toml", verdict.sentence) for name in joint.sets]
    return written_last(verdict, (*files, *write_report(verdict, joint, out)), out)


def on_sets(joint: JointRig, kinds: Sequence[type], progress: Progress, seed: int = 0) -> Verdict:
    """Return the verdict on sets that were read and checked."""
    model, poor = joint.base_model(), joint.insufficient()
    data_findings = tuple(_findings(joint))
    if poor:
        return Verdict("wheel-rig", Answer.CANNOT_TELL, joint.name, poor, model, findings=data_findings)
    verdict = concluded(question_of(joint, kinds), progress, seed)
    tried = [candidate.effect for candidate in joint.candidates(model, kinds)]
    assert verdict.before is not None
    extra = JointExtra(tuple(_errors(joint, verdict)), describe_declared(joint.declared, tried, model.effects))
    fitted = verdict.after.numbers if verdict.after else ()
    reference_flags = flags(as_rig_set(joint.declared), verdict.model.soil, float(joint.declared.wheel.b), fitted)
    against = (*of_parameters((), reference_flags), *verdict.cautions, *_losses(extra.sets))
    return dataclasses.replace(verdict, extra=extra, findings=data_findings, cautions=against)


def question_of(joint: JointRig, kinds: Sequence[type]) -> Question:
    """Return what is asked of several sets: which of these kinds of effects one model of all lacks."""
    model = joint.base_model()
    numbers = joint.uncertain(model)
    return Question(
        "wheel-rig",
        joint.name,
        joint,
        model,
        numbers,
        lambda base: joint.candidates(base.model, kinds),
        offers=lambda leading: (_next_runs(joint),),
    )


def _next_runs(joint: JointRig) -> Offer:
    """Return what could be measured next with any of the sets."""
    ahead = JointRig({name: runs_ahead(data) for name, data in joint.sets.items()})
    return Offer(ahead, ahead.noise())


def _findings(joint: JointRig) -> list[Finding]:
    """Return what the check of each set found, the set's name before its place."""
    set_findings = [(name, finding) for name, data in joint.sets.items() for finding in findings(data)]
    return [*joint.twice, *(finding._replace(where=f"{name}, {finding.where}") for name, finding in set_findings)]


def _errors(joint: JointRig, verdict: Verdict) -> list[SetError]:
    """Return the held-out errors of every channel of every set, and of the best curve through that set alone."""
    rows = []
    for name, data in joint.sets.items():
        experiment, folds = RigExperiment(data.rolled), joint.of_set(name)
        channels = [(channel_name, experiment.unit(channel_name)) for channel_name in experiment.channels]
        best = _best(curves(experiment.observed, experiment.inputs, channels))
        for (channel, unit), noise in zip(channels, experiment.sd, strict=True):
            count = np.isfinite(joint.observed[folds, joint.channels.index(channel)]).sum(axis=1)
            score = next(channel_score for channel_score in verdict.scores if channel_score.name == channel)
            levels = np.array([(level_error.before, level_error.after) for level_error in score.levels])[folds]
            squares = np.where(count[:, None] > 0, levels, 0.0) ** 2  # a lost level stays NaN, one not measured is none
            was, now = np.sqrt(count @ squares / count.sum()).tolist()
            rows.append(SetError(name, channel, unit, was, now, float(noise), best[channel].curve, best[channel].error))
    return rows


def _best(baselines: Sequence[Baseline]) -> dict[str, Baseline]:
    """Return the best curve of each channel."""
    channels = {baseline.channel for baseline in baselines}
    return {
        name: min((baseline for baseline in baselines if baseline.channel == name), key=lambda baseline: baseline.error)
        for name in channels
    }


def _losses(sets: Sequence[SetError]) -> list[str]:
    """Return where a curve through a set's own points predicts its levels better than the joint model."""
    return [
        f"held out, {error.channel} of {error.set} is predicted better by a {error.curve} of that set alone "
        f"({format_value(error.curve_error, error.unit)} against {format_value(error.after, error.unit)})"
        for error in sets
        if error.curve_error < error.after
    ]
