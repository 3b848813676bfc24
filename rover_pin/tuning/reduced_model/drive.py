"""A longitudinal model of the driving rover, small enough to be driven many times.

Unknowns: x and v of the rover; of each axle the wheel rate, the sinkage h, the effects' own states, the duty and the
control's integral. The axles follow the path of a wheel's centre over the terrain. Seen from the body, which climbs by
a, with p the path's slope, F = f_t / f_n, and X, W the forces on an axle along and across the body,

    m dv/dt = sum (X_i cos a - W_i sin a) + f_x,   X_i = W_i (F_i - p_i) / (1 + F_i p_i),   W = rest cos a + shift X,
    J domega_i/dt = motor torque - M_i N_i,   N = W sqrt(1 + p^2) / (1 + F p),   M = soil torque / f_n,
    dh_i/dt = (N_i / 2 - f_n) / (df_n/dv_n + SETTLES df_n/dh): the wheel sinks until the soil carries its load.

F, M and f_n are the model's own effects at that sinkage, motors and supply too: the same expressions as in the
simulator. Of body effects there are their weight and their push f_x along the path. Left out: the suspension's motion
and angles, what acts on it (`omitted_effects`), that a wheel which sinks leaves the path of the others, yaw, the two
patches of a lip, ground other than the first soil, and the mirrored view of a wheel that runs backwards. An effect that
amends a motor by the supply's current of now sees the current without it.
"""

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Contact, Scalar
from rover_pin.control.slip_control import Gains
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.tuning.reduced_model.effects import Along, AxleMotors, pull_along, through_contacts, through_motors
from rover_pin.tuning.reduced_model.load_transfer import AxleLoads, axle_loads
from rover_pin.tuning.reduced_model.loop import Loop
from rover_pin.tuning.reduced_model.wheel_path import WheelPath, wheel_path

LIGHTEST = 0.05
"""Load of an axle that is about to lift, as a share of its load at rest: the shear model has no wheel in the air."""
SHALLOWEST = 1e-4
"""Sinkage [m] below which a wheel is taken to sink by this: without contact there is no traction factor."""
SINKING_TIME = 0.02
"""Time [s] in which a wheel comes down on undamped soil: the root of its mass over the soil's stiffness."""
FASTEST = 3.0
"""How far the path is laid out, over cruise speed times duration."""
TOLERANCES = {"abstol": 1e-6, "reltol": 1e-5, "max_num_steps": 8000}
"""Of CVODES: the cost is then right to 1e-5, at half the time of ten times finer ones."""
GAIN_NAMES = tuple(quantities(Gains))


class Outcome(NamedTuple):
    """What a drive of the reduced model comes to."""

    x_end: Scalar
    "m"
    speed_end: Scalar
    "mean speed over the last part of the drive [m/s]"
    slip: Scalar
    "mean over time and wheels of S^2 [-]"
    energy: Scalar
    "electric energy [J]"
    sinkage: Scalar
    "mean over time and wheels of h / r [-]"
    deepest: Scalar
    "greatest h / r of a wheel at the end [-]"


class Axle(NamedTuple):
    """One axle's soil at an instant."""

    F: Scalar
    M: Scalar
    S: Scalar
    rate: tuple[Scalar, ...]
    f_n: Scalar
    "of one wheel that moves neither up nor down [N]"
    yielding: Scalar
    "df_n/dv_n + SETTLES df_n/dh [N s/m]"


@dataclass(frozen=True)
class Reduced:
    """A model's reduced drive under a loop, for gains still open.

    Parameters
    ----------
    model : Model
        With a rover of two or more axles of two wheels, the front one on rockers where there are three.
    loop : Loop
        The control with its estimate and limits.
    duration : float
        s.
    start : float
        x of the base at the start [m].
    """

    model: Model
    loop: Loop
    duration: float
    start: float = 0.0
    tail: float = 3.0
    "the last part of the drive, over which the end speed is taken; a shorter drive stands still before [s]"

    @cached_property
    def rover(self) -> Rover:
        """The rover with what it carries."""
        return self.model.built

    @cached_property
    def loads(self) -> AxleLoads:
        """The axles' loads."""
        return axle_loads(self.rover, self.model.gravity)

    @property
    def axles(self) -> int:
        """How many axles the rover has."""
        return len(self.loads.at_rest)

    @cached_property
    def sunk(self) -> float:
        """Sinkage of a wheel under a sixth of the weight [m]."""
        wheel, soil = self.model.rover.wheel, self.model.soils[0]
        load = float(np.sum(self.loads.at_rest)) / len(self.model.rover.wheels)
        return float(sinkage(entry_angle(load, 0.1, wheel, soil), wheel))

    @cached_property
    def path(self) -> WheelPath:
        """The path of the wheels' centres."""
        rover = self.model.rover
        reach = FASTEST * CRUISE_SPEED * self.duration
        low, high = self.start - 1.0, self.start + 1.0 + reach
        radius = float(rover.wheel.r) - self.sunk
        return wheel_path(self.model.ground, radius, self.loads.half_track, low, high)

    @cached_property
    def ode(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """States, gains, their rates, those of the quadratures (S^2, power, h / r), the outputs (v, S, omega, h)."""
        model, effects = self.model, self.model.contact_effects
        nx = sum(len(effect.states) for effect in effects)
        nm = sum(len(effect.states) for effect in model.motor_effects)
        x, v = ca.SX.sym("x"), ca.SX.sym("v")
        axle_states = [ca.SX.sym(f"axle_{i}", 4 + nx + nm) for i in range(self.axles)]
        p = ca.SX.sym("gains", len(GAIN_NAMES))
        gains = Gains(**dict(zip(GAIN_NAMES, ca.vertsplit(p), strict=True)))
        places = [x + float(place) for place in self.loads.place]
        slopes = [self.path.slope_at(place) for place in places]
        heights = [self.path.height_at(place) for place in places]
        pitch = (_mean(heights[1:]) - heights[0]) / (self.loads.place[0] - _mean(self.loads.place[1:]))
        axles = [self._axle(i, places[i], slopes[i], v, axle_states[i][: 4 + nx]) for i in range(self.axles)]
        motors = self._motors(axle_states, nx)
        normal, push = self._balance(slopes, -pitch, [axle.F for axle in axles])
        pull = pull_along(model.begin_at(self.start, 0.0), Along(x, v, _mean(heights), pitch))
        rates: list[Scalar] = [v, (sum(push) + pull) / self.rover.mass]
        for i, axle in enumerate(axles):
            omega, duty, integral = axle_states[i][0], axle_states[i][1], axle_states[i][2]
            sinking = (normal[i] / 2 - axle.f_n) / axle.yielding
            S_hat = self.loop.estimated_slip(axle.S, duty, model.rover.wheel.r * omega)
            highest = self.loop.highest(i, pitch, omega)
            d_integral, d_duty = self.loop.rates(gains, S_hat, highest, integral, duty)
            spin = (motors[i].torque - axle.M * normal[i] / 2) / self._inertia
            rates += [spin, d_duty, d_integral, sinking, *axle.rate, *motors[i].rate]
        slip = sum(axle.S**2 for axle in axles) / self.axles
        power = sum(motor.power for motor in motors) * 2
        sunk = sum(state[3] for state in axle_states) / (self.axles * model.rover.wheel.r)
        outputs = ca.vertcat(
            v, *(axle.S for axle in axles), *(state[0] for state in axle_states), *(state[3] for state in axle_states)
        )
        return ca.vertcat(x, v, *axle_states), p, ca.vertcat(*rates), ca.vertcat(slip, power, sunk), outputs

    @cached_property
    def _inertia(self) -> float:
        """Spin inertia of a wheel with its rotor [kg m^2]."""
        rover = self.model.rover
        axis = np.array([0.0, 1.0, 0.0])
        wheel = rover.model.inertias[rover.wheels[0].joint].inertia
        return float(axis @ wheel @ axis) + float(self.model.motor.armature)

    def _axle(self, i: int, x: Scalar, p: Scalar, v: Scalar, axle_state: ca.SX) -> Axle:
        """Return what the soil does at axle `i` at the place `x` on slope `p`."""
        wheel, speed = self.model.rover.wheel, v * ca.sqrt(1 + p**2)
        h, v_n = ca.fmax(axle_state[3], SHALLOWEST), ca.SX.sym("v_n")
        # S, S_y, h, v_x, v_y, v_n, rim, x, axle
        contact = Contact(
            0.0, 0.0, h, speed, 0.0, v_n, wheel.r * axle_state[0], x, float(i), wheel, self.model.soils[0]
        )
        contact, load, rate = through_contacts(self.model, contact, ca.vertsplit(axle_state)[4:])
        yielding = ca.jacobian(load.f_n, v_n) + SINKING_TIME * ca.jacobian(load.f_n, axle_state)[3]
        outputs = ca.vertcat(load.f_t / load.f_n, load.torque / load.f_n, contact.S, load.f_n, yielding, *rate)
        F, M, S, f_n, stiff, *rates = ca.vertsplit(ca.substitute(outputs, v_n, 0.0))
        return Axle(F, M, S, tuple(rates), f_n, stiff)

    def _motors(self, axle_states: list[ca.SX], nx: int) -> list[AxleMotors]:
        """Return what the motors of each axle do; what all draw comes from a first pass that does not know it."""
        bus: Scalar = 0.0
        for _ in range(2):
            motors = [
                through_motors(self.model, i, state[1], state[0], ca.vertsplit(state)[4 + nx :], bus)
                for i, state in enumerate(axle_states)
            ]
            bus = sum(motor.drawn for motor in motors) * 2
        return motors

    def _balance(self, slopes: list[Scalar], s: Scalar, factors: list[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
        """Return the normal force and the horizontal push of each axle [N]; `s` is the tangent of the climb."""
        level = 1 / ca.sqrt(1 + s * s)
        against = [(p - s) / (1 + p * s) for p in slopes]
        ease = [(F - p) / (1 + F * p) for F, p in zip(factors, against, strict=True)]
        shift, level_loads = ca.SX(self.loads.shift), level * ca.SX(self.loads.at_rest)
        across = ca.solve(ca.SX.eye(self.axles) - shift @ ca.diag(ca.vertcat(*ease)), level_loads)
        W = [ca.fmax(across[i], LIGHTEST * float(self.loads.at_rest[i])) for i in range(self.axles)]
        # a wheel presses the slope by the share of its load that neither pull nor chassis carries
        normal = [w * ca.sqrt(1 + p**2) / (1 + F * p) for w, p, F in zip(W, against, factors, strict=True)]
        return normal, [w * level * (tangent - s) for w, tangent in zip(W, ease, strict=True)]

    @cached_property
    def initial(self) -> np.ndarray:
        """States at rest at the start."""
        state = self.ode[0]
        names = [symbol.name() for symbol in ca.vertsplit(state)]
        return np.array([self.start, *(self.sunk if name.endswith("_3") else 0.0 for name in names[1:])])

    def outcome(self) -> ca.Function:
        """Return the function gains (GAIN_NAMES) -> Outcome."""
        state, p, rate, quad, _ = self.ode
        grid = [max(0.0, self.duration - self.tail), self.duration]
        dae = {"x": state, "p": p, "ode": rate, "quad": quad}
        options = {**TOLERANCES, "show_eval_warnings": False, "disable_internal_warnings": True}
        integrator = ca.integrator("drive", "cvodes", dae, 0.0, grid, options)
        gains = ca.MX.sym("gains", len(GAIN_NAMES))
        end = integrator(x0=self.initial, p=gains)
        x = end["xf"][0, :]
        slip, energy, sunk = ca.vertsplit(end["qf"][:, 1])
        sinkages = ca.Function("sinkages", [state], [self.ode[4][-self.axles :]])
        deepest = ca.mmax(sinkages(end["xf"][:, 1])) / self.model.rover.wheel.r
        means = (slip / self.duration, energy, sunk / self.duration)
        out = ca.vertcat(x[1], (x[1] - x[0]) / self.tail, *means, deepest)
        return ca.Function("outcome", [gains], [out])

    def drive(self, gains: Gains, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return x [m], v [m/s] (T,), slip [-], wheel rate [rad/s], sinkage [m] (T, axles) at increasing `times` [s].

        Raises OptimisationError: the integrator gives up.
        """
        state, p, rate, _, outputs = self.ode
        options = {**TOLERANCES, "show_eval_warnings": False, "disable_internal_warnings": True}
        integrator = ca.integrator("trace", "cvodes", {"x": state, "p": p, "ode": rate}, 0.0, list(times), options)
        try:
            # CasADi prints the inputs of a call that fails.
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                path = integrator(x0=self.initial, p=as_column(gains))["xf"]
        except RuntimeError as error:
            raise OptimisationError(f"The reduced model cannot be driven with {gains}: {error}") from error
        output_values = np.array(ca.Function("seen", [state], [outputs]).map(len(times))(path))
        slip, wheel_rate, sinkage = (channel.T for channel in np.split(output_values[1:], 3))
        per_axle = {"slip": slip, "wheel_rate": wheel_rate, "sinkage": sinkage}
        return {"x": np.array(path[0, :]).ravel(), "v": output_values[0], **per_axle}


def as_column(gains: Gains) -> np.ndarray:
    """Return the gains as a vector, in the order of GAIN_NAMES."""
    return np.array([float(value) for value in gains.values().values()])


def _mean(values: Sequence[Scalar] | np.ndarray) -> Scalar:
    return sum(values) / len(values)
