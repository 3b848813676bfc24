"""The verdict on a drive log whose features are linear: what is kept, runs driven freely, and what to drive next."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import plain_candidate
from rover_pin.discrepancy.conclude import conclude
from rover_pin.discrepancy.question import Question
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.viscous_friction import ViscousFriction
from rover_pin.experiments.drive_log import loop_data
from rover_pin.experiments.drive_log.free_runs import extra_of
from rover_pin.inference.next_measurement import Offer
from tests.experiments.drive_log import drive_channels as channels
from tests.experiments.drive_log import linear_drive as linear

KINDS = ExitAngle, ViscousFriction, DeadBand


def quiet(message):
    pass


def ahead_of(experiment):
    """A run in which each of the laws shows otherwise, though all show alike in the log."""
    random, names = np.random.default_rng(3), [f"{kind.__name__}.{next(iter(kind.neutral))}" for kind in KINDS]
    shape = (1, *linear.SHAPE[1:])
    second = {name: (experiment.slopes[name][0], 50.0 * random.normal(size=shape)) for name in names}
    slopes = {name: (zero, slope[:1]) for name, (zero, slope) in experiment.slopes.items()}
    blank = np.zeros(shape)
    ahead = linear.LinearExperiment(blank, slopes | second, folds=("with currents",))
    return Offer(ahead, linear.white(shape))


@pytest.fixture
def verdict_of(monkeypatch):
    """The verdict on a log that hides an exit angle of some size, beside others that may do the same."""
    left = SimpleNamespace(best=SimpleNamespace(description="acts as a force"), terms=(), wheels=())
    monkeypatch.setattr(loop_data, "describe", lambda fitted, progress: left)
    monkeypatch.setattr(loop_data, "odometry_baselines", lambda experiment, rover: ())
    monkeypatch.setattr(loop_data, "experiment_of_log", lambda fitted: fitted.task.experiment)
    monkeypatch.setattr(loop_data, "cautions", lambda verdict, free: ())

    def of(size, is_shared):
        random = np.random.default_rng(9)
        columns, noise = linear.slopes(random, linear.nuisances()), random.normal(size=linear.SHAPE)
        for kind in KINDS:
            (name,) = kind.neutral
            law = noise if is_shared else random.normal(size=linear.SHAPE)
            reach = float(getattr(kind(), name)) - kind.neutral[name]
            columns[f"{kind.__name__}.{name}"] = (kind.neutral[name], law / reach)
        observed = size * ExitAngle().e_1 * columns["ExitAngle.e_1"][1] + random.normal(size=linear.SHAPE)
        experiment = linear.LinearExperiment(observed, columns, linear.runs_of(linear.SHAPE))
        tried = [plain_candidate(kind()) for kind in KINDS]
        question = Question(
            "drive-log", "linear", experiment, linear.MODEL, linear.nuisances(), lambda base: tried,
            functions=lambda base: (), offers=lambda leading: [ahead_of(experiment)],
        )  # fmt: skip
        data = loop_data.DriveLogData(channels.log_of(*channels.GOOD))
        return data.extra(conclude(question, quiet), question)

    return of


def test_what_was_found_is_in_the_verdicts_model(verdict_of):
    verdict = verdict_of(1.5, is_shared=False)
    assert (verdict.answer, verdict.named) == (Answer.NAMED, ("ExitAngle",))
    assert verdict.model.effect(ExitAngle).e_1 == pytest.approx(1.5 * ExitAngle().e_1, rel=0.3)
    assert [number.name for number in verdict.after.numbers] == ["soil.phi", "WeakMotor[0].g", "ExitAngle.e_1"]
    assert [profile.name for profile in verdict.profiles] == ["ExitAngle.e_1"]
    assert [(score.before, score.after) for score in extra_of(verdict).free] == [
        pytest.approx((0.01, 0.009))
    ] * linear.RUNS
    assert verdict.experiments == ()


def test_a_run_that_tells_the_first_from_its_rivals_is_proposed(verdict_of):
    verdict = verdict_of(1.5, is_shared=True)
    assert verdict.answer is Answer.SET
    (proposed,) = verdict.experiments
    assert set(proposed.sets) >= set(verdict.indistinguishable)
    assert proposed.what == "with currents"
    assert 0.5 < proposed.nats / proposed.open_nats <= 1.0
