"""The loop on wheel rigs: checked, calibrated, searched, judged on levels left out, and written down."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import concluded
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.wheel_rig.candidates import candidates, numbers_of, rig_kinds
from rover_pin.experiments.wheel_rig.channel_residual import channel_residuals
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, too_poor
from rover_pin.experiments.wheel_rig.data import RigSet, as_rig_set, read_rig_set
from rover_pin.experiments.wheel_rig.diagnostics import FitDiagnostics, RigExtra
from rover_pin.experiments.wheel_rig.draft import drafted
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, as_declared
from rover_pin.experiments.wheel_rig.known_elsewhere import flags
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model_file import write_model
from rover_pin.experiments.wheel_rig.next_runs import next_runs
from rover_pin.experiments.wheel_rig.presets import describe_declared
from rover_pin.experiments.wheel_rig.residual_tests import residual_tests
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.loop.verdict_file import draft_written, posterior_written, written_last
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.report.rig.cautions import cautions
from rover_pin.report.rig.report import write_report


def close_rig_loop(
    data: RigSet, model: RigModel | Soil | None, request: LoopRequest, progress: Progress = lambda message: None
) -> Verdict:
    """Return what a model of a wheel-rig set lacks, with the error before and after; see `close_the_loop`.

    `model` is where it starts, read; None takes what the data declare.

    Raises
    ------
    DataError
        Data that cannot be read or cannot answer: one sentence each.
    OptimisationError
        The base model cannot be fitted at all.
    """
    begun = time.monotonic()
    refuse_unfit(data)
    start = model if isinstance(model, RigModel) else as_declared(data, model)
    say_what_is_replaced(request.out, OF_A_LOOP)
    verdict = on_rig(RigExperiment(data), start, request.effects, progress, request.seed)
    verdict.provenance.update(provenance(request, time.monotonic() - begun))
    if request.out is None:
        return verdict
    return _written(verdict, data, request, progress)


def rig_set_of(data: str | Path | WheelRig | RigSet, trust: Trust = Trust()) -> RigSet:
    """Return the data of a wheel rig as the loop takes them, read where they are a folder's."""
    if isinstance(data, RigSet):
        return data
    if isinstance(data, WheelRig):
        return as_rig_set(data)
    return read_rig_set(data, trust)


def question_of(experiment: RigExperiment, model: RigModel, effects: str | Path | None = None) -> Question:
    """Return what is asked of a rig set: which effect its model lacks, soil constants and own sizes free."""
    data, kinds = experiment.data, rig_kinds(effects)
    numbers = numbers_of(experiment, model)
    return Question(
        "wheel-rig",
        data.rig.name,
        experiment,
        model,
        numbers,
        lambda base: candidates(base.model, [(data, base.model)], data.rig, kinds),
        lambda base: drafted(experiment, base),
        offers=lambda leading: (next_runs(data),),
    )


def on_rig(
    experiment: RigExperiment, model: RigModel, effects: str | Path | None, progress: Progress, seed: int
) -> Verdict:
    """Return the verdict on a set that was read and checked."""
    data, question = experiment.data, question_of(experiment, model, effects)
    poor = too_poor(data, len(question.numbers))
    if poor:
        data_findings = tuple(findings(data))
        return Verdict("wheel-rig", Answer.CANNOT_TELL, data.rig.name, poor, model, findings=data_findings)
    verdict = concluded(question, progress, seed)
    assert verdict.before is not None
    assert verdict.after is not None
    tried = [candidate.effect for candidate in question.candidates(verdict.before.fit)]
    extra = RigExtra(
        _fit_diagnostics(data, verdict.before, seed),
        _fit_diagnostics(data, verdict.after, seed),
        describe_declared(data.rig, tried, model.effects),
    )
    progress("errors of what a user would otherwise take")
    rolled = RigExperiment(data.rolled)
    channels = [(name, rolled.unit(name)) for name in rolled.channels]
    verdict = dataclasses.replace(
        verdict,
        extra=extra,
        cautions=cautions(verdict, extra.after),
        findings=tuple(findings(data)),
        profiles=profiles(verdict.after.fit, tuple(number.name for number in verdict.after.numbers)),
    )
    return against_rivals(verdict, curves(rolled.observed, rolled.inputs, channels))


def _fit_diagnostics(data: RigSet, side: Side, seed: int) -> FitDiagnostics:
    """Return what a model leaves of a set, and how its constants agree with other measurements."""
    experiment, soil = side.fit.task.experiment, side.model.soil
    assert isinstance(experiment, RigExperiment)
    scaled = experiment.in_sds(side.fit.residual)
    reference_flags = flags(data, soil, float(side.model.wheel.b), side.numbers)
    return FitDiagnostics(reference_flags, channel_residuals(data, scaled), residual_tests(data, scaled, seed))


def _written(verdict: Verdict, data: RigSet, request: LoopRequest, progress: Progress) -> Verdict:
    """Write the files and return the verdict with their paths."""
    progress("writing the report")
    out = Path(str(request.out))
    files = [write_model(verdict.model, out / "model.toml", verdict.sentence)]
    files += posterior_written(verdict, write_model, out, request.seed)
    verdict, draft = draft_written(verdict, request, out)
    return written_last(verdict, (*files, *draft, *write_report(verdict, data, out)), out)
