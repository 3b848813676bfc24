"""Actions that an unknown effect may have, and how one unit of each action changes the channels of a drive.

The actions are a torque on a wheel, a change of a motor's duty, a force on the body, a change of the soil's grip, and
an error of a sensor's reading. The changes are computed by simulating the runs with a small perturbation, because the
simulated channels are nearly linear in the perturbation.
"""

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
"""Sizes of the perturbations: a wheel's torque as a fraction of the stall torque, a force as a fraction of the rover's
weight, and a change of tan phi as a fraction of tan phi."""
TORQUE, VOLTAGE, FORCE, LEAN, GRIP, READING = "torque", "voltage", "force", "lean", "grip", "reading"
"""Names of the actions. A "force" acts against the direction of motion, and a "lean" is a force along the x axis of the
world."""
MAY_MISREAD = (
    "wheel_rate_", "current_", "rocker_", "bogie_", "body_roll", "body_pitch", "battery_", "gyro_", "accel"
)  # fmt: skip
"""Beginnings of the names of channels whose sensor may show a wrong value."""


@dataclass(frozen=True)
class AxleGrip(Effect):
    """Effect that changes the friction angle phi of the soil under one axle: tan phi -> (1 + share) tan phi.

    The axle is counted by the number of wheels of its side that have passed before. A simulation with this effect shows
    how the grip under one axle influences all channels.

    Source: none, because the effect is a perturbation. Differs from the paper: its soil is uniform.
    """

    share: Scalar = quantity(GRIP_SHARE, "", "assumed: a perturbation", -0.9, 10.0, "s")
    axle: Scalar = quantity(0.0, "", "which of the wheels, in the order of passing", 0.0, 100.0, "a")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the changed friction angle, if its wheel belongs to the axle, and otherwise the
        unchanged contact.
        """
        share = ca.if_else(ca.fabs(contact.axle - self.axle) < 0.5, self.share, 0.0)
        phi = ca.atan((1.0 + share) * ca.tan(contact.soil.phi))
        return contact._replace(soil=contact.soil.replace(phi=phi))


class Part(NamedTuple):
    """The part of an action that acts at one wheel, under one axle or on the body, with its own change of the channels.

    An action on all wheels may have several parts. For example, a function of the place of a wheel has a different
    value for each axle.
    """

    wheels: tuple[str, ...]
    """names of the wheels whose signals are the argument of the function: one wheel, the wheels of an axle, or all
    wheels"""
    axle: int | None
    "number of the axle, counted from the front; None if the part does not act under an axle"
    responses: tuple[np.ndarray, ...]
    """for each run, the change of the channels by one unit of the action (channels, rows), before features are
    computed"""


class Act(NamedTuple):
    """One action that an unknown effect may have, such as a torque on one wheel.

    All parts of the action are multiplied by one function, which is evaluated with the signals of each part.
    """

    kind: str
    "TORQUE, VOLTAGE, FORCE, LEAN, GRIP or READING"
    where: str
    """name of the wheel or of the channel with the error; empty for all wheels and for the body"""
    unit: str
    "unit of the action; empty for a duty ratio and for a relative change of the grip"
    parts: tuple[Part, ...]

    @property
    def description(self) -> str:
        """The action as a noun phrase for reports, such as "a torque on wheel fl"."""
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
    """A fitted drive model together with its runs, and the signals on which an unknown effect may depend.

    A signal is the measured channel if the log has it, and otherwise the channel that the fitted model simulates.
    """

    fit: Fit = field(repr=False)

    @property
    def experiment(self) -> DriveExperiment:
        """The runs of the drive log that the model was fitted to."""
        return experiment_of_log(self.fit)

    @cached_property
    def replays(self) -> tuple[Replay, ...]:
        """Simulations of the runs by the fitted model with the logged commands, without a perturbation."""
        return self.experiment.replays(self.fit.model)

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Names of the rover's wheels, in the order of the model."""
        return tuple(wheel.name for wheel in self.fit.model.rover.wheels)

    @cached_property
    def tacho(self) -> dict[str, float]:
        """Name of each wheel -> fitted gain of its tachogenerator (reading / true rate)."""
        # A gain without a wheel applies to all tachogenerators and multiplies their own gains.
        gains = [sensor for sensor in self.fit.model.sensor_effects if isinstance(sensor, TachoScale)]
        shared = math.prod(1.0 + float(sensor.e) for sensor in gains if not sensor.wheel)
        wheel_gains = {sensor.wheel: 1.0 + float(sensor.e) for sensor in gains if sensor.wheel}
        return {wheel: shared * wheel_gains.get(wheel, 1.0) for wheel in self.wheels}

    @cached_property
    def gains(self) -> tuple[dict[str, float], ...]:
        """Change of each sensor's reading per change of the true channel, for each run. Delays of sensors are not
        proposed.
        """
        sensors = self.fit.model.sensor_effects
        return tuple(_gains(sensors, replay.channels) for replay in self.replays)

    @cached_property
    def ahead(self) -> dict[str, float]:
        """Name of each wheel -> distance of its centre ahead of the base's origin [m], with the suspension at rest."""
        return {name: float(place[0]) for name, place in wheel_places(self.fit.model.rover).items()}

    def logged_row(self, run: int, name: str) -> np.ndarray:
        """Return a measured channel of a run with filled gaps (rows,), or the simulated channel if the log does not
        have it.
        """
        measured = self.experiment.runs[run].measured.get(name)
        return self.replayed_row(run, name) if measured is None else fill_gaps(measured)

    def replayed_row(self, run: int, name: str) -> np.ndarray:
        """Return a channel of a run (rows,) as the fitted model simulates it; zeros if the model has no such
        channel.
        """
        return self.replays[run].channels.get(name, np.zeros(len(self.experiment.runs[run].commands.t)))

    def rate(self, run: int, wheels: Sequence[str]) -> np.ndarray:
        """Return the mean measured rate (rows,) of these wheels [rad/s], corrected for the tachogenerators' gains."""
        return np.mean([self.logged_row(run, f"wheel_rate_{wheel}") / self.tacho[wheel] for wheel in wheels], axis=0)

    def sense(self, run: int) -> np.ndarray:
        """Return the direction of driving in each row of a run (rows,): +1 for forwards and -1 for backwards."""
        return np.where(self.rate(run, self.wheels) < 0, -1.0, 1.0)

    def place(self, run: int, part: Part) -> np.ndarray:
        """Return the x coordinate of the wheels on which a part of an action acts, in each row of a run [m] (rows,).

        If the part belongs to all wheels, the result is the x coordinate of the origin of the rover's base.
        """
        commands = self.experiment.runs[run].commands
        x, heading = fill_gaps(commands.place[:, 0]), self.experiment.runs[run].heading
        if len(part.wheels) == len(self.wheels):
            return x
        # The front axle of a rover that drives backwards is the rear axle of its body.
        ahead = np.full(len(x), float(np.mean([self.ahead[wheel] for wheel in part.wheels])))
        if part.axle is not None:
            axles = sorted({round(distance, 3) for distance in self.ahead.values()}, reverse=True)
            ahead = np.where(self.sense(run) > 0, axles[part.axle], axles[len(axles) - 1 - part.axle])
        return np.asarray(x + ahead * np.cos(heading))


def _gains(sensors: Sequence[SensorEffect], channels: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the change of each channel's reading per change of the true channel, for all sensors together, by a change
    of 0.1 %.
    """
    # All sensors read the channels twice: as they are, and 0.1 % larger.
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
    """Return all actions that an unknown effect may have in these runs, with the changes of the channels that they
    cause.

    The changes are computed by simulating the runs with a small perturbation. Actions that cannot show in the runs are
    not proposed: torques if the wheels follow their measured rates, and changes of duties if no current is logged.
    """
    # A duty also changes the current directly. Without a logged current, it cannot be distinguished from a torque.
    model, runs = scene.fit.model, scene.experiment.runs
    possible_acts: list[Act] = []
    torques: list[Part] = []
    duties: list[Part] = []
    for wheel, name in enumerate(() if scene.experiment.rate_driven else scene.wheels):
        # The changes of the channels by a torque of 1 N m on the wheel, and by a duty of 1.
        stall, channel = float(model.motor.stall_torque), f"current_{name}_A"
        added = np.eye(len(scene.wheels))[wheel] * TORQUE_SHARE * stall
        perturbations = [Perturbation(torque=np.tile(added, (len(run.commands.t), 1))) for run in runs]
        changes = _difference(scene, scene.experiment.replays(model, perturbations), TORQUE_SHARE)
        duties.append(Part((name,), None, _rows(scene, changes)))
        # A torque on the wheel changes the current only through the wheel's rate. A duty raises the current directly as
        # well, by stall torque / torque constant, so this direct part is subtracted for the torque.
        for change in changes:
            change[channel] = change[channel] - stall / float(model.motor.constant)
        torques.append(Part((name,), None, tuple(row / stall for row in _rows(scene, changes))))
    if torques:
        possible_acts += _of_wheels(scene, TORQUE, "N m", tuple(torques))
    if possible_acts and any(name.startswith("current_") for name in scene.experiment.channels):
        possible_acts += _of_wheels(scene, VOLTAGE, "", tuple(duties))
    # A force of 1 N against the motion, and a force of 1 N along the x axis of the world. Both follow from one
    # perturbation along the heading, because the response is linear.
    size = FORCE_SHARE * model.built.mass * abs(model.gravity)
    perturbations = [Perturbation(force=np.full(len(run.commands.t), size)) for run in runs]
    along = _rows(scene, _difference(scene, scene.experiment.replays(model, perturbations), size))
    against = tuple(-scene.sense(run) * rows for run, rows in enumerate(along))
    leaning = tuple(np.cos(runs[run].heading) * rows for run, rows in enumerate(along))
    for kind, of_runs in ((FORCE, against), (LEAN, leaning)):
        possible_acts.append(Act(kind, "", "N", (Part(scene.wheels, None, of_runs),)))
    # Grip: one part for each axle, because the axles pass a place one after another.
    mounts = scene.fit.model.rover.wheels
    parts = []
    for index, axle in enumerate(sorted({mount.axle for mount in mounts})):
        gripping = model.having(AxleGrip(axle=float(index)))
        responses = _rows(scene, _difference(scene, scene.experiment.replays(gripping), GRIP_SHARE))
        parts.append(Part(tuple(mount.name for mount in mounts if mount.axle == axle), index, responses))
    possible_acts.append(Act(GRIP, "", "", tuple(parts)))
    # An error of a reading changes its own channel only, by the error itself.
    for name in scene.experiment.channels:
        if name.startswith(MAY_MISREAD):
            wheels_read = [wheel for wheel in scene.wheels if name in (f"wheel_rate_{wheel}", f"current_{wheel}_A")]
            only = np.array([channel == name for channel in scene.experiment.channels], dtype=float)[:, None]
            responses = tuple(only * np.ones(len(run.commands.t)) for run in scene.experiment.runs)
            part = Part(tuple(wheels_read) or scene.wheels, None, responses)
            possible_acts.append(Act(READING, name, unit_of(name), (part,)))
    return tuple(possible_acts)


def _of_wheels(scene: Scene, kind: str, unit: str, parts: tuple[Part, ...]) -> list[Act]:
    """Return an action, such as a torque, on each single wheel, and this action on all wheels together.

    `parts` are the parts of the action that act at one wheel, in the order of the wheels.
    """
    # All wheels together may have a common cause, such as the supply of the motors.
    single_acts = [Act(kind, name, unit, (part,)) for name, part in zip(scene.wheels, parts, strict=True)]
    return [*single_acts, Act(kind, "", unit, parts)]


def _difference(scene: Scene, replays: Sequence[Replay], size: float) -> list[dict[str, np.ndarray]]:
    """Return the change of each run's channels (rows,) by one unit of a perturbation: one mapping channel -> change for
    each run.

    `replays` are simulations with a perturbation of the given `size`. The change is assumed to be proportional to it.
    """
    # A replay that breaks off lacks channels, for which the change is 0.
    pairs = zip(replays, scene.replays, strict=True)
    return [{k: (replay.channels.get(k, v) - v) / size for k, v in base.channels.items()} for replay, base in pairs]


def _rows(scene: Scene, changes: Sequence[Mapping[str, np.ndarray]]) -> tuple[np.ndarray, ...]:
    """Return the changes of the channels of all runs as one table (channels, rows) for each run.

    The channels have the order of the experiment's features. For path, drift and heading, the table holds changes of
    the increments from row to row, which `moved_features` sums. For all other features, it holds changes of the
    sensor's reading.
    """
    tables = []
    for run, change in enumerate(changes):
        heading, gains = scene.experiment.runs[run].heading, scene.gains[run]
        # A sensor with a gain shows the change of its channel multiplied by this gain.
        increments, unchanged = pose_increments(change, heading), np.zeros(len(heading))
        tables.append(
            np.array(
                [
                    increments.get(name, gains.get(name, 1.0) * change.get(name, unchanged))
                    for name in scene.experiment.channels
                ]
            )
        )
    return tuple(tables)


def moved_features(scene: Scene, act: Act, run: int, shares: np.ndarray) -> np.ndarray:
    """Return how an action, multiplied by functions of time, changes the half-second means of a run that a fit
    compares.

    Each part of the action (for example each wheel) has functions of its own.

    Parameters
    ----------
    scene : Scene
        The fitted model with its runs.
    act : Act
        The action.
    run : int
        Index of the run.
    shares : array (k, parts, rows)
        Value of k functions over time, for each part, in units of the action.

    Returns
    -------
    array (k, channels, blocks)
        Change of the features by each of the k functions.
    """
    logged_run, responses = scene.experiment.runs[run], np.array([part.responses[run] for part in act.parts])
    touched = np.flatnonzero(np.any(responses != 0.0, axis=(0, 2)))  # NaN differs from 0 and counts as touched
    names = [scene.experiment.channels[index] for index in touched]
    rows = np.einsum("kpt,pct->kct", shares, responses[:, touched])
    period = logged_run.commands.period
    # Path, drift and heading are sums over the run that forget with a time constant; the others are half-second means.
    for index, name in enumerate(names):
        if name in (PATH, DRIFT, HEADING):
            rows[:, index] = leaky(logged_run.summed_rows * rows[:, index], period)
    block = blocks(rows, period)
    # Channels without a known zero are compared without their mean over the run.
    for index, name in enumerate(names):
        if name in LEVELS and logged_run.usable.any():
            block[:, index] -= block[:, index, logged_run.usable].mean(axis=-1, keepdims=True)
    features = np.zeros((len(shares), responses.shape[1], block.shape[-1]))
    features[:, touched] = block
    return features
