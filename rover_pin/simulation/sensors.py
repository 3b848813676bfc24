"""Models of a rover's sensors: their noise and quantisation, the channels that have no sensor, and the readings of an
inertial measurement unit.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.control import CompiledController, SensorNoise, commands_of
from rover_pin.simulation.trace.trace import Trace

TRUTH = ("slip_", "sinkage_", "normal_", "tangential_", "lateral_", "torque_", "travel_", "energy_", "differential_")
"""Beginnings of the names of simulated channels, such as slip and sinkage, that no sensor of the paper's test bed
measures. A simulated log leaves these channels out."""
GYRO = tuple(f"gyro_{axis}" for axis in "xyz")
ACCELEROMETER = tuple(f"accelerometer_{axis}" for axis in "xyz")
"""GYRO and ACCELEROMETER: names of the channels of an inertial measurement unit. They hold turn rates [rad/s] and
specific force [m/s^2] along the body's axes."""
GRAVITY = tuple(f"gravity_{axis}" for axis in "xyz")
"""Names of the channels with the components of gravity along the world's axes [m/s^2]. The readings of an inertial
measurement unit are computed from these channels and from the motion."""


@dataclass(frozen=True)
class Sensors(Record):
    """Accuracy of the sensors: for each type of sensor, the standard deviation of its white noise and its quantisation
    step. A value of 0 means a sensor without this error.

    Source: the test bed has these types of sensors (section 2 of the paper: tachogenerators, potentiometers, 3D video
    tracking); the noise and the steps of the sensors are assumed.
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
        """Return the standard deviation of the noise and the quantisation step of the sensor that measures the channel
        with this name. The result is (0, 0) for commands and for the time, which have no sensor.
        """
        if name.startswith("wheel_rate_"):
            return self.rate_sd, self.rate_step
        if name.startswith(("rocker_", "bogie_", "steer_")):
            return self.angle_sd, self.angle_step
        if name.startswith("current_"):
            return self.current_sd, 0.0
        # Longer names first: body_v before body_.
        if name.startswith("body_v"):
            return self.velocity_sd, 0.0
        if name in ("body_roll", "body_pitch", "body_yaw"):
            return self.attitude_sd, 0.0
        if name.startswith("body_"):
            return self.position_sd, 0.0
        return (self.voltage_sd, 0.0) if name == "battery_V" else (0.0, 0.0)


class NoisyController:
    """A controller that gets readings with sensor noise: wheel rates, currents, joint angles and attitude have the
    noise and the quantisation of `Sensors`.

    The true values in the reading are passed on unchanged. `reset` restarts the noise from its seed.

    Parameters
    ----------
    controller : Controller
        The controller that gets the noisy readings and computes the command.
    sensors : Sensors
        Noise and quantisation of the sensors.
    seed : int
        Seed of the noise.
    """

    def __init__(self, controller: Controller, sensors: Sensors, seed: int):
        self.controller, self.sensors, self.seed = controller, sensors, seed
        self.reset()

    def reset(self) -> None:
        """Restart the noise from its seed, and reset the controller."""
        self.random = np.random.default_rng(self.seed)
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command | np.ndarray | float:
        """Add sensor noise to the reading, call the inner controller with it, and return its command."""
        # The order of the four calls fixes the noise of a seed; `native` and read_sensors in control.c keep it.
        roll, pitch, yaw = self._measure("body_roll", np.array(reading.attitude)).tolist()
        return self.controller(
            reading.replace(
                wheel_rate=self._measure("wheel_rate_", reading.wheel_rate),
                current=self._measure("current_", reading.current),
                suspension=self._measure("rocker_", reading.suspension),
                attitude=(roll, pitch, yaw),
            )
        )

    def native(self, wheels: int) -> CompiledController | None:
        """Return this controller, with its noise, in the form that the compiled loop can run; None if it has to be
        called from Python, because the controller inside it has no such form or adds noise itself.
        """
        # Noise cannot be added twice in the compiled loop.
        commands = commands_of(self.controller, wheels)
        if commands is None or commands.noise is not None:
            return None
        kinds = [self.sensors.kind(name) for name in ("body_roll", "wheel_rate_", "current_", "rocker_")]
        sds, steps = np.array(kinds, dtype=float).T.copy()
        return dataclasses.replace(commands, noise=SensorNoise(sds, steps, self.random))

    def _measure(self, kind: str, values: np.ndarray) -> np.ndarray:
        sd, step = self.sensors.kind(kind)
        noisy = values + sd * self.random.standard_normal(values.shape)
        return step * np.round(noisy / step) if step else noisy


def measure(
    trace: Trace, sensors: Sensors, seed: int, effects: Sequence[SensorEffect] = (), with_current: bool = True
) -> Trace:
    """Return the log that the rover's sensors would record of a simulated drive. The log has the errors of the sensors,
    and lacks the channels without a sensor (TRUTH).

    Parameters
    ----------
    trace : Trace
        A simulated drive.
    sensors : Sensors
        Noise and quantisation of the sensors.
    seed : int
        Seed of the noise. The noise of a channel depends only on the seed and on the position of the channel in the
        trace, so that two logs with equal seeds have equal noise.
    effects : sequence of SensorEffect
        Errors of the sensors such as a scale or a delay. They are applied one after the other, before the noise.
    with_current : bool
        Whether the log contains the motor currents.
    """
    # First the errors of the sensor effects, such as a scale, then noise and quantisation.
    hidden = TRUTH if with_current else (*TRUTH, "current_")
    channels = {name: np.array(values) for name, values in trace.channels.items() if not name.startswith(hidden)}
    for effect in effects:
        channels |= effect.read(channels["t_s"], channels)
    random = np.random.default_rng(seed)
    for name, values in channels.items():
        # Every channel draws its noise, also an exact one, so that no channel's noise depends on the settings.
        noise = random.standard_normal(values.shape)
        sd, step = sensors.kind(name)
        noisy = values + sd * noise if sd else values
        channels[name] = step * np.round(noisy / step) if step else noisy
    units = {name: trace.unit(name) for name in channels}
    return Trace(channels, units, {**trace.attrs, "seed": seed, "sensors": dict(sensors.values())})


def has_inertial(names: Iterable[str]) -> bool:
    """Return whether at least one of the channel names belongs to an inertial measurement unit (GYRO or
    ACCELEROMETER).
    """
    return not {*GYRO, *ACCELEROMETER}.isdisjoint(names)


def inertial(channels: Mapping[str, np.ndarray], period: float) -> dict[str, np.ndarray]:
    """Return the readings of an ideal inertial measurement unit on the rover, as channel -> values (T,): turn rates
    [rad/s] and specific force [m/s^2] along the body's axes (forward, left, up).

    omega_k = log(R_{k-1}^T R_{k+1}) / (2 dt) and f = R^T (dv/dt - g), so that f = (0, 0, 9.81) at rest on level ground.
    omega_k is the turn rate at row k, f the specific force, R_k the rotation matrix of the body at row k, from the
    z-y-x angles (nose down is positive), dt the time between rows, v the velocity of the body's origin in the world,
    and g gravity. The unit is assumed to be at this origin: the acceleration omega^2 d of a unit at the distance d is
    neglected.

    Parameters
    ----------
    channels : mapping of name -> array (T,)
        `body_roll`, `body_pitch`, `body_yaw` [rad], `body_vx`, `_vy`, `_vz` [m/s], `gravity_x`, `_y`, `_z` [m/s^2].
    period : float
        Time between rows [s].

    Source: strapdown kinematics (Titterton and Weston, 2004, ch. 3).
    """
    from scipy.spatial.transform import Rotation  # imported late: a drive does not need it

    # Arrays (T, 3): Euler angles in the order yaw, pitch, roll; velocity and gravity in the world.
    angles, velocity, gravity = (
        np.column_stack([channels[name] for name in names])
        for names in (("body_yaw", "body_pitch", "body_roll"), ("body_vx", "body_vy", "body_vz"), GRAVITY)
    )
    if len(angles) < 2:
        return {name: np.full(len(angles), np.nan) for name in (*GYRO, *ACCELEROMETER)}
    attitude = Rotation.from_euler("ZYX", angles)
    # Central differences; one-sided ones at both ends.
    row = np.arange(len(angles))
    before, after = np.maximum(row - 1, 0), np.minimum(row + 1, len(row) - 1)
    rate = (attitude[before].inv() * attitude[after]).as_rotvec() / ((after - before)[:, None] * period)
    force = attitude.inv().apply(np.gradient(velocity, period, axis=0) - gravity)
    return dict(zip((*GYRO, *ACCELEROMETER), (*rate.T, *force.T), strict=True))
