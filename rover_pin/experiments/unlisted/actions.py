"""What an unknown effect may act on: how a unit of torque, voltage, force or grip moves a replay's channels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect, SensorEffect
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of_log
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, LEVELS, PATH, blocks, leaky, pose_increments
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.logged_inputs import fill_gaps
from rover_pin.simulation.replay import Perturbation, Replay
from rover_pin.simulation.trace.channels import unit_of

TORQUE_SHARE, FORCE_SHARE, GRIP_SHARE = 0.03, 0.01, 0.05
"""Sizes of the perturbations: of the stall torque, of the rover's weight, of tan phi."""
TORQUE, VOLTAGE, FORCE, LEAN, GRIP, READING = "torque", "voltage", "force", "lean", "grip", "reading"
"""Kinds of what is acted on; a force is against the motion, a lean along the x of the world."""


MAY_MISREAD = (
    "wheel_rate_", "current_", "rocker_", "bogie_", "body_roll", "body_pitch", "battery_", "gyro_", "accel"
)  # fmt: skip
"""Channels of which an error of their own sensor is looked for."""


@dataclass(frozen=True)
class AxleGrip(Effect):
    """tan phi -> (1 + share) tan phi under the wheels that `axle` others of their side have passed before.

    Source: none; a perturbation that shows what grip does. Differs from the paper: its soil is the same everywhere.
    """

    share: Scalar = quantity(GRIP_SHARE, "", "assumed: a perturbation", -0.9, 10.0, "s")
    axle: Scalar = quantity(0.0, "", "which of the wheels, in the order of passing", 0.0, 100.0, "a")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil with its grip changed."""
        share = ca.if_else(ca.fabs(contact.axle - self.axle) < 0.5, self.share, 0.0)
        phi = ca.atan((1.0 + share) * ca.tan(contact.soil.phi))
        return contact._replace(soil=contact.soil.replace(phi=phi))


class Part(NamedTuple):
    """One place where something acts: a wheel, an axle or the base, and how a unit there moves each run's channels."""

    wheels: tuple[str, ...]
    "whose rates, slips and places the modulation reads: one wheel, an axle's, or all"
    axle: int | None
    "in the order of passing; None where the part is no axle"
    responses: tuple[np.ndarray, ...]
    "by run: change of the features' rows (channels, T) for one unit"


class Act(NamedTuple):
    """What is acted on, as the parts that the same function of each part's own signals multiplies."""

    kind: str
    where: str
    unit: str
    parts: tuple[Part, ...]

    @property
    def description(self) -> str:
        """What it acts as, in words."""
        wheel = f"wheel {self.where}" if self.where else "every wheel"
        return {
            TORQUE: f"a torque on {wheel}",
            VOLTAGE: f"a change of the duty of {wheel}",
            FORCE: "a force against the motion",
            LEAN: "a force along x of the ground",
            GRIP: "a change of the soil's grip",
            READING: f"an error of the reading {self.where}",
        }[self.kind]


@dataclass(frozen=True, eq=False)
class Scene:
    """A fitted model on its runs, with the signals that modulate: measured ones where the log has them."""

    fit: Fit = field(repr=False)

    @property
    def experiment(self) -> DriveExperiment:
        """The runs."""
        return experiment_of_log(self.fit)

    @cached_property
    def replays(self) -> tuple[Replay, ...]:
        """What the fitted model does."""
        return self.experiment.replays(self.fit.model)

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Names of the wheels."""
        return tuple(wheel.name for wheel in self.fit.model.rover.wheels)

    @cached_property
    def tacho(self) -> dict[str, float]:
        """Fitted gain of the tachogenerator of each wheel."""
        gains = [sensor for sensor in self.fit.model.sensor_effects if isinstance(sensor, TachoScale)]
        shared = math.prod(1.0 + float(sensor.e) for sensor in gains if not sensor.wheel)
        wheel_gains = {sensor.wheel: 1.0 + float(sensor.e) for sensor in gains if sensor.wheel}
        return {wheel: shared * wheel_gains.get(wheel, 1.0) for wheel in self.wheels}

    @cached_property
    def gains(self) -> tuple[dict[str, float], ...]:
        """How much each run's sensors report of a small change of a channel; what they delay is let be."""
        sensors = self.fit.model.sensor_effects
        return tuple(_gains(sensors, replay.channels) for replay in self.replays)

    @cached_property
    def ahead(self) -> dict[str, float]:
        """How far each wheel's centre is ahead of the base's origin [m], the suspension at rest."""
        return {name: float(place[0]) for name, place in wheel_places(self.fit.model.rover).items()}

    def logged_row(self, run: int, name: str) -> np.ndarray:
        """Return a channel (T,) as measured, gaps bridged, or as replayed where it is not logged."""
        measured = self.experiment.runs[run].measured.get(name)
        return self.replayed_row(run, name) if measured is None else fill_gaps(measured)

    def replayed_row(self, run: int, name: str) -> np.ndarray:
        """Return a channel (T,) of the fitted model."""
        return self.replays[run].channels.get(name, np.zeros(len(self.experiment.runs[run].commands.t)))

    def rate(self, run: int, wheels: Sequence[str]) -> np.ndarray:
        """Return the mean rate (T,) of these wheels [rad/s], as measured, the tachogenerators' gains taken out."""
        return np.mean([self.logged_row(run, f"wheel_rate_{wheel}") / self.tacho[wheel] for wheel in wheels], axis=0)

    def sense(self, run: int) -> np.ndarray:
        """Return +1 (T,) where the rover drives forwards and -1 where backwards."""
        return np.where(self.rate(run, self.wheels) < 0, -1.0, 1.0)

    def place(self, run: int, part: Part) -> np.ndarray:
        """Return the x (T,) of the part's wheels [m], of the base's origin where it stands for all wheels."""
        commands = self.experiment.runs[run].commands
        x, heading = fill_gaps(commands.place[:, 0]), self.experiment.runs[run].heading
        if len(part.wheels) == len(self.wheels):
            return x
        ahead = np.full(len(x), float(np.mean([self.ahead[wheel] for wheel in part.wheels])))
        if part.axle is not None:
            axles = sorted({round(distance, 3) for distance in self.ahead.values()}, reverse=True)
            ahead = np.where(self.sense(run) > 0, axles[part.axle], axles[len(axles) - 1 - part.axle])
        return np.asarray(x + ahead * np.cos(heading))


def _gains(sensors: Sequence[SensorEffect], channels: Mapping[str, np.ndarray]) -> dict[str, float]:
    larger = {name: row if name == "t_s" else 1.001 * row for name, row in channels.items()}
    reads = []
    for case in (channels, larger):
        read = dict(case)
        for sensor in sensors:
            read |= sensor.read(read["t_s"], read)
        reads.append(read)
    power = {name: float(row @ row) for name, row in channels.items()}
    return {k: float((reads[1][k] - reads[0][k]) @ channels[k]) / (1e-3 * p) for k, p in power.items() if p > 0}


def acts(scene: Scene) -> tuple[Act, ...]:
    """Return everything that an unknown effect may act on, from one perturbed replay of the runs each."""
    possible_acts: list[Act] = []
    if not scene.experiment.rate_driven:
        torques, duties = zip(*(_torque_and_duty(scene, at) for at, _ in enumerate(scene.wheels)), strict=True)
        possible_acts += _of_wheels(scene, TORQUE, "N m", torques)
    if possible_acts and any(name.startswith("current_") for name in scene.experiment.channels):
        possible_acts += _of_wheels(scene, VOLTAGE, "", duties)
    possible_acts += _forces(scene)
    possible_acts.append(Act(GRIP, "", "", tuple(_axle_grip(scene, axle) for axle in range(len(_axles(scene))))))
    misread = [name for name in scene.experiment.channels if name.startswith(MAY_MISREAD)]
    return (*possible_acts, *(_reading(scene, name) for name in misread))


def _of_wheels(scene: Scene, kind: str, unit: str, parts: tuple[Part, ...]) -> list[Act]:
    """Return the act on each wheel, and on all alike."""
    single_acts = [Act(kind, name, unit, (part,)) for name, part in zip(scene.wheels, parts, strict=True)]
    return [*single_acts, Act(kind, "", unit, parts)]


def _axles(scene: Scene) -> list[tuple[str, ...]]:
    """Return the names of the wheels of each axle, front first."""
    mounts = scene.fit.model.rover.wheels
    return [
        tuple(mount.name for mount in mounts if mount.axle == axle) for axle in sorted({mount.axle for mount in mounts})
    ]


def _difference(scene: Scene, replays: Sequence[Replay], size: float) -> list[dict[str, np.ndarray]]:
    """Return the change of each run's channels (T,) for one unit."""
    pairs = zip(replays, scene.replays, strict=True)
    return [{k: (replay.channels.get(k, v) - v) / size for k, v in base.channels.items()} for replay, base in pairs]


def _rows(scene: Scene, changes: Sequence[Mapping[str, np.ndarray]]) -> tuple[np.ndarray, ...]:
    """Return the changes of each run's channels as the features (channels, T) that they make before these add up."""
    return tuple(_row(scene, run, change) for run, change in enumerate(changes))


def _row(scene: Scene, run: int, change: Mapping[str, np.ndarray]) -> np.ndarray:
    heading, gains = scene.experiment.runs[run].heading, scene.gains[run]
    rows, still = pose_increments(change, heading), np.zeros(len(heading))
    return np.array([rows.get(k, gains.get(k, 1.0) * change.get(k, still)) for k in scene.experiment.channels])


def _torque_and_duty(scene: Scene, wheel: int) -> tuple[Part, Part]:
    """Return a torque of 1 N m on a wheel and a change of 1 of its duty, which moves the motor's current too."""
    model, name = scene.fit.model, scene.wheels[wheel]
    stall, channel = float(model.motor.stall_torque), f"current_{name}_A"
    added = np.eye(len(scene.wheels))[wheel] * TORQUE_SHARE * stall
    perturbations = [Perturbation(torque=np.tile(added, (len(run.commands.t), 1))) for run in scene.experiment.runs]
    changes = _difference(scene, scene.experiment.replays(model, perturbations), TORQUE_SHARE)
    duty = Part((name,), None, _rows(scene, changes))
    for run in changes:
        run[channel] = run[channel] - stall / float(model.motor.constant)
    return Part((name,), None, tuple(row / stall for row in _rows(scene, changes))), duty


def _forces(scene: Scene) -> list[Act]:
    """Return a force against the motion and one along x of the world, from one along the heading."""
    model = scene.fit.model
    size = FORCE_SHARE * model.built.mass * abs(model.gravity)
    perturbations = [Perturbation(force=np.full(len(run.commands.t), size)) for run in scene.experiment.runs]
    along = _rows(scene, _difference(scene, scene.experiment.replays(model, perturbations), size))
    against = tuple(-scene.sense(run) * rows for run, rows in enumerate(along))
    leaning = tuple(np.cos(scene.experiment.runs[run].heading) * rows for run, rows in enumerate(along))
    return [Act(kind, "", "N", (Part(scene.wheels, None, rows),)) for kind, rows in ((FORCE, against), (LEAN, leaning))]


def _axle_grip(scene: Scene, axle: int) -> Part:
    model = scene.fit.model.having(AxleGrip(axle=float(axle)))
    responses = _rows(scene, _difference(scene, scene.experiment.replays(model), GRIP_SHARE))
    return Part(_axles(scene)[axle], axle, responses)


def _reading(scene: Scene, name: str) -> Act:
    wheel = next(
        (candidate for candidate in scene.wheels if name in (f"wheel_rate_{candidate}", f"current_{candidate}_A")), None
    )
    only = np.array([channel == name for channel in scene.experiment.channels], dtype=float)[:, None]
    responses = tuple(only * np.ones(len(run.commands.t)) for run in scene.experiment.runs)
    return Act(READING, name, unit_of(name), (Part((wheel,) if wheel else scene.wheels, None, responses),))


def moved_features(scene: Scene, act: Act, run: int, shares: np.ndarray) -> np.ndarray:
    """Return how the features (k, channels, blocks) of a run move where the parts act by shares (k, parts, T)."""
    logged_run, responses = scene.experiment.runs[run], np.array([part.responses[run] for part in act.parts])
    touched = np.flatnonzero(np.any(responses != 0.0, axis=(0, 2)))  # NaN counts: it is not 0
    names = [scene.experiment.channels[at] for at in touched]
    rows = np.einsum("kpt,pct->kct", shares, responses[:, touched])
    period = logged_run.commands.period
    for at, name in enumerate(names):
        if name in (PATH, DRIFT, HEADING):
            rows[:, at] = leaky(logged_run.summed_rows * rows[:, at], period)
    block = blocks(rows, period)
    for at, name in enumerate(names):
        if name in LEVELS and logged_run.usable.any():
            block[:, at] -= block[:, at, logged_run.usable].mean(axis=-1, keepdims=True)
    features = np.zeros((len(shares), responses.shape[1], block.shape[-1]))
    features[:, touched] = block
    return features
