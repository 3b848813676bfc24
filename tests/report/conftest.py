"""A drive log made here, small enough for every test, with the fits before and after what was hidden was added."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.held_out import held_out
from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.screen import Scored, Signature, candidate_threshold
from rover_pin.discrepancy.search import Round, Search
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.effects.winding_heating import WindingHeating
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.gauss_newton import slopes_at
from rover_pin.estimation.noise import first_noise, noise_of
from rover_pin.estimation.numbers import numbers
from rover_pin.estimation.task import Task
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.extra import DriveExtra
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.free_runs import free_runs
from rover_pin.experiments.drive_log.model import DRIVEN_SAND
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.experiments.unlisted.actions import FORCE, Act
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial
from rover_pin.experiments.unlisted.residual import DriveChannelResidual, DriveResidual
from rover_pin.experiments.unlisted.term import Term
from rover_pin.logs.drive_log import DriveLog, LogMetadata
from rover_pin.measurements.finding import Finding
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motors import nexus6_motor
from rover_pin.simulation.replay import PERIOD, Commands, replay
from rover_pin.simulation.sensors import Sensors, measured
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.traction import TorqueTraction
from rover_pin.terrain.shapes import flat

SECONDS = 5.0


def base():
    rover = load_rover("nexus6")
    effects = base_effects(DRIVEN_SAND, rover, SoilTraction(TorqueTraction(), FixedAngles()))
    return Model(rover, flat(), (DRIVEN_SAND,), nexus6_motor(), effects=effects).having(WeakMotor(g=0.0, wheel=0))


def log_of(truth, seed):
    t = PERIOD * np.arange(round(SECONDS / PERIOD))
    duty = np.random.default_rng(seed).uniform(0.45, 0.85, 2)[np.arange(len(t)) * 2 // len(t)]
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in truth.rover.wheels)))
    told = Commands(t, np.repeat(duty[:, None], 6, axis=1), steer, np.full((len(t), 3), np.nan), Start())
    duties = {f"duty_{wheel.name}": told.duty[:, at] for at, wheel in enumerate(truth.rover.wheels)}
    attrs = {"start": dataclasses.asdict(told.start), "file": f"run_{seed}.csv"}
    trace = measured(Trace({**replay(truth, told).channels, **duties}), Sensors(), seed, truth.sensor_effects)
    return dataclasses.replace(trace, attrs=attrs)


def fitted(task, model, parameters):
    """A fit that is where it starts."""
    u = np.array([one.u(SupplySag().R_b) if one.name == "SupplySag.R_b" else 0.0 for one in parameters])
    predicted = task.experiment.predict([model])[0]
    return Fit(task, model, tuple(parameters), u, predicted, slopes_at(task, model, parameters, u))


@pytest.fixture(scope="session")
def made():
    """Two logged runs of a sagging supply, with the fits before and after it is added."""
    model, truth = base(), base().having(SupplySag())
    traces = tuple(log_of(truth, seed) for seed in (1, 2))
    experiment = experiment_of([logged_run(trace, model.rover) for trace in traces], model)
    left = experiment.observed - experiment.predict([truth])[0]
    least = np.full(len(experiment.channels), 1e-4)
    task = Task(experiment, noise_of(left, first_noise(left, least).good, least))
    phi = parameter(model, "soil.phi", math.radians(2.0), declared="declared in [soil]")
    free = [phi, parameter(model, "WeakMotor[0].g", 0.02)]
    before = fitted(task, model, free)
    after = fitted(task, truth, [*free, SAG.size("SupplySag.R_b")])
    return DriveLog(Path("nowhere"), LogMetadata("small", source="made here"), traces), before, after


SAG = Candidate("SupplySag", SupplySag(), ("SupplySag.R_b",), ("SupplySag.tau",))


def scored(candidate, base, sizes, gain, visible, absorbed):
    neutral = candidate.effect.neutral if candidate.effect else {"g": 0.0}
    own = {name: neutral[name.rpartition(".")[2]] for name in sizes}
    return Scored(candidate, Signature(candidate, sizes, base.predicted, own), gain, 1.0, visible, absorbed)


def looked(before, after):
    """One look that found the sag, and one that found no more."""
    friction = Candidate("GearFriction", GearFriction(), ("GearFriction.tau_c",))
    heating = Candidate("WindingHeating", WindingHeating(), ("WindingHeating.R_th",))
    saturation = Candidate("TorqueSaturation", TorqueSaturation(), ("TorqueSaturation.i_max",))
    motor = Candidate("WeakMotor", None, ("WeakMotor[0].g",), place="0")
    rows = (
        scored(SAG, before, {"SupplySag.R_b": 2.0}, 400.0, 2 * math.sqrt(candidate_threshold(SAG, 5)), 0.3),
        scored(saturation, before, {"TorqueSaturation.i_max": 0.03}, 9.0, 50.0, 0.2),
        scored(friction, before, {"GearFriction.tau_c": 0.02}, 5.0, 20.0, 0.99),
        scored(motor, before, {"WeakMotor[0].g": 0.02}, 3.0, 1.0, 0.5),
        scored(heating, before, {"WindingHeating.R_th": 100.0}, 0.0, 0.1, 0.5),
    )
    found = Refit(SAG, after, 390.0, 14.0, 300.0)
    chance = Refit(motor, before, 4.0, 14.0, 1.0)
    return Search(before, (Round(rows, (found, chance)), Round(rows[1:], (chance,))), ())


def term(argument, size, gain=200.0):
    size = np.array(size)
    return Term(
        Act(FORCE, "", "N", ()), argument, ("run_1", "run_2"), size, 0.01 * np.eye(len(size)), gain, 3, 12.0,
        None if argument.per_run else 150.0,
    )  # fmt: skip


def left(gain=200.0):
    """A remainder that a force along the way describes."""
    place = Argument("place", "m", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 2))
    moment = Argument("moment", "s", lambda scene, run, part: 0, Hats((0.0, 2.5, 5.0)), per_run=True)
    run = Argument("run", "", lambda scene, run, part: 0, Polynomial(0.0, 1.0, 0), per_run=True)
    channel = DriveChannelResidual("path", 2.0, 0.1, 1.0, {"duty": 0.4, "slip": -0.1}, "run_1", 2.0, 0.3)
    terms = (term(place, [1.0, 0.2, 0.1], gain), term(moment, range(6), gain), term(run, [1.0, 2.0], gain))
    return DriveResidual(terms, (channel, channel._replace(name="drift", rms=1.0)), ("run_1", "run_2"), ("fl", "fr"))


@pytest.fixture(scope="session")
def verdict(made):
    """What the loop would say of that log."""
    _, before, after = made
    held = held_out(before, after, before.task.noise, 0)
    return Verdict(
        kind="drive-log",
        answer=Answer.NAMED,
        name="small",
        sentence="the log is consistent with SupplySag, which takes 99% of it.",
        model=after.model,
        effects=(next(one for one in after.model.all_effects if isinstance(one, SupplySag)),),
        indistinguishable=("SupplySag",),
        named=("SupplySag",),
        share=0.99,
        before=Side(before.model, numbers(before), before.misfit, before),
        after=Side(after.model, numbers(after), after.misfit, after),
        scores=held.channels,
        runs=held.runs,
        extra=DriveExtra(free_runs(before.task.experiment, before.model, after.model), left()),
        findings=(Finding("no low duty", "small", "add one"),),
        search=looked(before, after),
        provenance={"command": "rover-pin close-loop small", "seconds": 1.0, "seed": 0, "versions": {"numpy": "2"}},
    )


@pytest.fixture(scope="session")
def answered(verdict):
    """Return the same with another answer."""

    def made(answer):
        search = verdict.search
        none = Search(search.base, (Round(search.rounds[0].scored, search.rounds[1].refits),), ())
        bare = {"named": (), "effects": (), "after": verdict.before, "model": search.base.model}
        empty = {
            "before": None,
            "after": None,
            "scores": (),
            "runs": (),
            "extra": None,
            "search": None,
            "indistinguishable": (),
        }
        changes = {
            Answer.NAMED: {},
            Answer.LIKE: {"vetoes": ("R_b lies at its bound",)},
            Answer.SET: {"indistinguishable": ("SupplySag", "PeakStress")},
            Answer.NONE_NEEDED: {**bare, "indistinguishable": (), "search": none},
            Answer.NONE_FITS: {**bare, "draft": Draft("text", search.rounds[0].refits[0], verdict.scores, "try --it")},
            Answer.INADEQUATE: bare,
            Answer.CANNOT_TELL: {**bare, **empty, "provenance": {}},
        }[answer]
        return dataclasses.replace(verdict, answer=answer, **changes)

    return made
