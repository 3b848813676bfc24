"""The loop on wheel rigs, one set or several in one sand: checked, searched, held out level by level, written down."""

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path

from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.effect import Effect
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.wheel_rig.candidates import candidates, numbers_of, rig_kinds
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, too_poor
from rover_pin.experiments.wheel_rig.diagnostics import JointExtra, RigExtra, diagnose, flags, set_errors
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import RigModel, write_model
from rover_pin.experiments.wheel_rig.next_runs import next_runs
from rover_pin.experiments.wheel_rig.presets import describe_declared
from rover_pin.experiments.wheel_rig.residual import draft_curve
from rover_pin.experiments.wheel_rig.runs import RigRuns
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.loop.verdict_file import draft_written, posterior_written, written_last
from rover_pin.report.rig.report import cautions, of_parameters, write_report


def close_rig_loop(
    experiment: RigExperiment,
    model: RigModel | JointModel,
    request: LoopRequest,
    progress: Progress = lambda message: None,
) -> Verdict:
    """Return what a model of wheel-rig sets lacks, with the error before and after; see `close_the_loop`.

    Raises DataError: data that cannot answer: one sentence each.
    Raises OptimisationError: the base model cannot be fitted at all.
    """
    begun = time.monotonic()
    refuse_unfit(experiment)
    say_what_is_replaced(request.out, OF_A_LOOP)
    verdict = on_rig(experiment, model, rig_kinds(request.effects), progress, request.seed)
    verdict.provenance.update(provenance(request, time.monotonic() - begun))
    return verdict if request.out is None else _write_files(verdict, experiment, request, progress)


def question_of(
    experiment: RigExperiment, model: RigModel | JointModel, kinds: Sequence[type[Effect]] | None = None
) -> Question:
    """Return what is asked of rig sets: which effect their model lacks, soil constants and own sizes free."""
    tried = rig_kinds() if kinds is None else kinds
    return Question(
        "wheel-rig",
        experiment.name,
        experiment,
        model,
        numbers_of(experiment, model),
        lambda base: candidates(experiment, base.model, tried),
        lambda base: draft_curve(experiment, base),
        offers=lambda leading: (next_runs(experiment.sets),),
    )


def on_rig(
    experiment: RigExperiment,
    model: RigModel | JointModel,
    kinds: Sequence[type[Effect]] | None,
    progress: Progress,
    seed: int = 0,
) -> Verdict:
    """Return the verdict on sets that were read and checked."""
    question, data_findings = question_of(experiment, model, kinds), tuple(findings(experiment))
    if poor := too_poor(experiment, len(question.numbers)):
        return Verdict("wheel-rig", Answer.CANNOT_TELL, experiment.name, poor, model, findings=data_findings)
    verdict = dataclasses.replace(conclude(question, progress, seed), findings=data_findings)
    assert verdict.before is not None
    tried = [candidate.effect for candidate in question.candidates(verdict.before.fit)]
    declared = describe_declared(experiment.declared, tried, model.effects)
    if len(experiment.sets) > 1:
        return _of_sets(verdict, experiment, declared)
    progress("errors of what a user would otherwise take")
    return _of_one_set(verdict, experiment, declared, seed)


def _of_one_set(verdict: Verdict, experiment: RigExperiment, declared: tuple[str, ...], seed: int) -> Verdict:
    """Return the verdict on one set with what its models leave, beside curves through its points."""
    (data,) = experiment.sets
    assert verdict.before is not None
    assert verdict.after is not None
    before, after = (
        diagnose(data, side.model, side.numbers, experiment.in_sds(side.fit.residual), seed)
        for side in (verdict.before, verdict.after)
    )
    rolled = RigRuns(data.rolled)
    channels = [(name, experiment.unit(name)) for name in rolled.channels]
    verdict = dataclasses.replace(
        verdict,
        extra=RigExtra(before, after, declared),
        cautions=cautions(verdict, after),
        profiles=profiles(verdict.after.fit, tuple(number.name for number in verdict.after.numbers)),
    )
    return against_rivals(verdict, curves(rolled.observed, rolled.inputs, channels))


def _of_sets(verdict: Verdict, experiment: RigExperiment, declared: tuple[str, ...]) -> Verdict:
    """Return the verdict on several sets with the errors of each, beside curves through that set alone."""
    errors, rig = set_errors(experiment, verdict), experiment.declared
    fitted = verdict.after.numbers if verdict.after else ()
    against = of_parameters((), flags(rig, verdict.model.soil, float(rig.wheel.b), fitted))
    losses = [error.loss for error in errors if error.is_lost]
    return dataclasses.replace(
        verdict, extra=JointExtra(errors, declared), cautions=(*against, *verdict.cautions, *losses)
    )


def _write_files(verdict: Verdict, experiment: RigExperiment, request: LoopRequest, progress: Progress) -> Verdict:
    """Write the files and return the verdict with their paths."""
    progress("writing the report")
    out = Path(str(request.out))
    if len(experiment.sets) > 1:
        models = {f"model-{name}.toml": verdict.model.of(name) for name in experiment.runs}
        files = [write_model(model, out / file, verdict.sentence) for file, model in models.items()]
    else:
        files = [write_model(verdict.model, out / "model.toml", verdict.sentence)]
        files += posterior_written(verdict, write_model, out, request.seed)
    verdict, draft = draft_written(verdict, request, out)
    return written_last(verdict, (*files, *draft, *write_report(verdict, experiment, out)), out)
