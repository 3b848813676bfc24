"""What sensors and a tracker make of a drive: noise, steps, and the effects on sensors; the truth is dropped."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.control import Commands, Noise, commands_of
from rover_pin.simulation.trace.trace import Trace

TRUTH = ("slip_", "sinkage_", "normal_", "tangential_", "lateral_", "torque_", "travel_", "energy_", "differential_")
"""Starts of the channels that no sensor of the test bed has."""


@dataclass(frozen=True)
class Sensors(Record):
    """Standard deviations of white noise and quantisation steps, by kind of channel; 0 is exact.

    Source: the test bed's kinds of sensors (section 2: tachogenerators, potentiometers, 3D video tracking); their
    sizes are assumed.
    """

    rate_sd: Scalar = quantity(0.01, "rad/s", "assumed: 1 % of the cruising rate", 0.0, 10.0, "sd")
    rate_step: Scalar = quantity(0.005, "rad/s", "assumed: 10-bit converter over +-2.5 rad/s", 0.0, 1.0, "step")
    angle_sd: Scalar = quantity(0.003, "rad", "assumed: potentiometer, 0.2 deg", 0.0, 1.0, "sd")
    angle_step: Scalar = quantity(0.005, "rad", "assumed: 10-bit converter over 300 deg", 0.0, 1.0, "step")
    current_sd: Scalar = quantity(0.002, "A", "assumed", 0.0, 10.0, "sd")
    position_sd: Scalar = quantity(0.0015, "m", "assumed: video tracking", 0.0, 1.0, "sd")
    attitude_sd: Scalar = quantity(0.005, "rad", "assumed: video tracking, 0.3 deg", 0.0, 1.0, "sd")
    velocity_sd: Scalar = quantity(0.004, "m/s", "assumed: video tracking, differenced and smoothed", 0.0, 1.0, "sd")
    voltage_sd: Scalar = quantity(0.01, "V", "assumed", 0.0, 10.0, "sd")

    def kind(self, name: str) -> tuple[float, float]:
        """Return the noise's SD and the quantisation step of a channel; commands and the clock are exact."""
        if name.startswith("wheel_rate_"):
            return self.rate_sd, self.rate_step
        if name.startswith(("rocker_", "bogie_", "steer_")):
            return self.angle_sd, self.angle_step
        if name.startswith("current_"):
            return self.current_sd, 0.0
        if name.startswith("body_v"):
            return self.velocity_sd, 0.0
        if name in ("body_roll", "body_pitch", "body_yaw"):
            return self.attitude_sd, 0.0
        if name.startswith("body_"):
            return self.position_sd, 0.0
        return (self.voltage_sd, 0.0) if name == "battery_V" else (0.0, 0.0)


class Sensed:
    """A controller that reads what sensors make of the rover: noise and quantisation of rates, currents and angles.

    The truth beside the reading is passed on as it is. `reset` starts the noise of the seed again.
    """

    def __init__(self, controller: Controller, sensors: Sensors, seed: int):
        self.controller, self.sensors, self.seed = controller, sensors, seed
        self.reset()

    def reset(self) -> None:
        """Begin the noise again, and the controller."""
        self.random = np.random.default_rng(self.seed)
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command | np.ndarray | float:
        """Return what the controller commands."""
        roll, pitch, yaw = self._read("body_roll", np.array(reading.attitude)).tolist()
        return self.controller(
            reading.replace(
                wheel_rate=self._read("wheel_rate_", reading.wheel_rate),
                current=self._read("current_", reading.current),
                suspension=self._read("rocker_", reading.suspension),
                attitude=(roll, pitch, yaw),
            )
        )

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop; None where the controller must be asked."""
        commands = commands_of(self.controller, wheels)
        if commands is None or commands.noise is not None:
            return None
        kinds = [self.sensors.kind(name) for name in ("body_roll", "wheel_rate_", "current_", "rocker_")]
        sds, steps = np.array(kinds, dtype=float).T.copy()
        return dataclasses.replace(commands, noise=Noise(sds, steps, self.random))

    def _read(self, kind: str, values: np.ndarray) -> np.ndarray:
        sd, step = self.sensors.kind(kind)
        noisy = values + sd * self.random.standard_normal(values.shape)
        return step * np.round(noisy / step) if step else noisy


def measure(
    trace: Trace, sensors: Sensors, seed: int, effects: Sequence[SensorEffect] = (), with_current: bool = True
) -> Trace:
    """Return the drive as it would be logged: sensor effects in turn, then noise, then quantisation; no truth.

    The noise of a channel depends on the seed and the channel's place alone, so two logs of one seed share it.
    """
    hidden = TRUTH if with_current else (*TRUTH, "current_")
    channels = {name: np.array(values) for name, values in trace.channels.items() if not name.startswith(hidden)}
    for effect in effects:
        channels |= effect.read(channels["t_s"], channels)
    random = np.random.default_rng(seed)
    for name, values in channels.items():
        noise = random.standard_normal(values.shape)
        sd, step = sensors.kind(name)
        noisy = values + sd * noise if sd else values
        channels[name] = step * np.round(noisy / step) if step else noisy
    units = {name: trace.unit(name) for name in channels}
    return Trace(channels, units, {**trace.attrs, "seed": seed, "sensors": dict(sensors.values())})
