"""Fixtures for the tests of reports: a simulated drive log, the fits of a model to it, and the verdict on it."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import verdict_of
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.question import Question
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.signature import signatures
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.fit import fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.noise import first_noise, noise_of
from rover_pin.experiments.drive_log.candidates import candidate_of
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.free_runs import DriveExtra, free_runs
from rover_pin.experiments.drive_log.model import parameter
from rover_pin.experiments.unlisted.actions import FORCE, Act
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial
from rover_pin.experiments.unlisted.residual import DriveChannelResidual, DriveResidual
from rover_pin.experiments.unlisted.terms import Term
from rover_pin.inference.beliefs import Beliefs
from rover_pin.logs.drive_log import DriveLog, LogMetadata
from rover_pin.measurements.checks import Finding
from rover_pin.simulation.replay import PERIOD, ReplayCommands, replay
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.start import Start
from rover_pin.simulation.trace.trace import Trace
from tests.experiments.drive_log.linear_drive import MODEL

SECONDS = 5.0


def log_of(truth, seed):
    t = PERIOD * np.arange(round(SECONDS / PERIOD))
    duty = np.random.default_rng(seed).uniform(0.45, 0.85, 2)[np.arange(len(t)) * 2 // len(t)]
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in truth.rover.wheels)))
    commands = ReplayCommands(t, np.repeat(duty[:, None], 6, axis=1), steer, np.full((len(t), 3), np.nan), Start())
    duties = {f"duty_{wheel.name}": commands.duty[:, at] for at, wheel in enumerate(truth.rover.wheels)}
    attrs = {"start": dataclasses.asdict(commands.start), "file": f"run_{seed}.csv"}
    trace = measure(Trace({**replay(truth, commands).channels, **duties}), Sensors(), seed, truth.sensor_effects)
    return dataclasses.replace(trace, attrs=attrs)


@pytest.fixture(scope="session")
def searched():
    """Return two simulated runs of a rover whose supply voltage sags, the question about them, and the result of the
    search.
    """
    model, truth = MODEL, MODEL.having(SupplySag())
    traces = tuple(log_of(truth, seed) for seed in (1, 2))
    experiment = experiment_of([logged_run(trace, model.rover) for trace in traces], model)
    left_by_truth = experiment.observed - experiment.predict([truth])[0]
    least = np.full(len(experiment.channels), 1e-4)
    task = Task(experiment, noise_of(left_by_truth, first_noise(left_by_truth, least).good, least))
    phi = parameter(model, "soil.phi", math.radians(2.0), declared="declared in [soil]")
    search = Search(fit(task, model, (phi, parameter(model, "WeakMotor[0].g", 0.02))))
    tried = tuple(map(candidate_of, (SupplySag(), GearFriction(), TorqueSaturation(), WeakMotor(g=0.02, wheel=4))))
    search.run(signatures(search.base, tried))
    log = DriveLog(Path("nowhere"), LogMetadata("small", source="made here"), traces)
    return log, Question("drive-log", "small", experiment, model, search.base.parameters, lambda fit: tried), search


@pytest.fixture(scope="session")
def sag_fits(searched):
    """Return the drive log, and the fits without and with the effect of the sagging supply."""
    log, _, search = searched
    return log, search.base, search.beliefs().best(("SupplySag",)).fit


def term(argument, size, gain=200.0):
    size = np.array(size)
    return Term(
        Act(FORCE, "", "N", ()), argument, ("run_1", "run_2"), size, 0.01 * np.eye(len(size)), gain, 12.0,
        None if argument.per_run else 150.0,
    )  # fmt: skip


def left(gain=200.0):
    """Return a residual that is described by a force along the rover's heading."""
    place = Argument("place", "m", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 2))
    moment = Argument("moment", "s", lambda scene, run, part: 0, Hats((0.0, 2.5, 5.0)), per_run=True)
    run = Argument("run", "", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 0), per_run=True)
    channel = DriveChannelResidual("path", 2.0, 0.1, {"duty": 0.4, "slip": -0.1}, "run_1", 2.0, 0.3)
    terms = (term(place, [1.0, 0.2, 0.1], gain), term(moment, range(6), gain), term(run, [1.0, 2.0], gain))
    return DriveResidual(terms, (channel, channel._replace(name="drift", rms=1.0)), ("fl", "fr"))


@pytest.fixture(scope="session")
def verdict(searched):
    """Return the verdict of the search on the drive log, with an additional residual that was made for the tests."""
    _, question, search = searched
    loop_verdict = verdict_of(question, search.beliefs(), lambda message: None)
    assert loop_verdict.named == ("SupplySag",)
    experiment = search.base.task.experiment
    return dataclasses.replace(
        loop_verdict,
        extra=DriveExtra(free_runs(experiment, loop_verdict.before.model, loop_verdict.model), left()),
        findings=(Finding("no low duty", "small", "add one"),),
        provenance={"command": "rover-pin close-loop small", "seconds": 1.0, "seed": 0, "versions": {"numpy": "2"}},
    )


@pytest.fixture(scope="session")
def answered(verdict):
    """Return a copy of a verdict with another answer."""

    def made(answer):
        base = verdict.beliefs.best(())
        alone = Beliefs((base,), verdict.beliefs.choice)
        bare = {"named": (), "effects": (), "indistinguishable": (), "after": verdict.before, "beliefs": alone,
                "model": verdict.before.model, "chosen": {}}  # fmt: skip
        poor = {"before": None, "after": None, "scores": (), "runs": (), "extra": None, "beliefs": None}
        changes = {
            Answer.NAMED: {},
            Answer.LIKE: {"vetoes": ("R_b lies at its bound",)},
            Answer.SET: {"indistinguishable": ("SupplySag", "PeakStress + WeakMotor[4]")},
            Answer.NONE_NEEDED: bare,
            Answer.NONE_FITS: {
                **bare, "draft": Draft("text", verdict.after.fit, 3.0, 300.0, (), verdict.scores, "try --it")
            },
            Answer.INADEQUATE: bare,
            Answer.CANNOT_TELL: {**bare, **poor, "provenance": {}},
        }[answer]  # fmt: skip
        return dataclasses.replace(verdict, answer=answer, **changes)

    return made
