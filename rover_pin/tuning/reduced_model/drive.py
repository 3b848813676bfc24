"""The reduced model of a driving rover: its motion along the path, fast enough for thousands of drives in a search.

The unknowns are position x and speed v of the rover, and for each axle the wheel rate omega, the sinkage h, the states
of the effects, the duty, and the integral of the slip control. The axles follow the path of a wheel's centre over the
terrain (`wheel_path`). The body climbs by the angle a. All following quantities of an axle are relative to the body: p
is the slope of the path at the axle, F = f_t / f_n its traction factor, M its soil torque divided by f_n, X and W are
the forces on the axle along and across the body, and N is its normal force. Then

    m dv/dt = sum (X_i cos a - W_i sin a) + f_x,   X_i = W_i (F_i - p_i) / (1 + F_i p_i),   W = rest cos a + shift X,
    J domega_i/dt = motor torque - M_i N_i,   N = W sqrt(1 + p^2) / (1 + F p),
    dh_i/dt = (N_i / 2 - f_n) / (df_n/dv_n + SINKING_TIME df_n/dh),

where m is the mass of the rover, and rest and shift are the loads at rest and the load transfer of `AxleLoads`. J is
the inertia about the axle; J and the motor torque are sums over both wheels of an axle. v_n is the speed of a wheel
into the ground. The last equation lets a wheel sink until the soil carries its load. F, M and f_n follow from the
model's contact effects at this sinkage. Motors, motor effects and supply are also taken from the model, by the
expressions of the simulation. Body effects act by their weight and by their push f_x along the path.

The reduced model leaves out the motion and the angles of the suspension, the body effects that need them
(`omitted_effects`), yaw, soils other than the first, a second patch of a wheel at a lip, and the different direction of
digging of a wheel that runs backwards. A wheel that sinks deeper than the other wheels still follows their path. A
motor effect that depends on the present supply current gets the current that flows without this effect.
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
from rover_pin.control.slip_control import Gains, pi_law
from rover_pin.control.slip_estimate import MIN_RIM_SPEED, TableEstimate, TrueSlip
from rover_pin.control.torque_check import PITCHES, NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.tuning.reduced_model.effects import AxleMotors, BodyPlace, pull_along, through_contacts, through_motors
from rover_pin.tuning.reduced_model.load_transfer import AxleLoads, axle_loads
from rover_pin.tuning.reduced_model.wheel_path import WheelPath, piecewise, wheel_path

MIN_AXLE_LOAD = 0.05
"""Minimum load of an axle in the reduced model, as a fraction of its load at rest. An axle that would be lighter, or
would lift, keeps this load, because the contact law has no wheel in the air."""
MIN_SINKAGE = 1e-4
"""Minimum sinkage of a wheel in the reduced model's contact law [m]. A smaller sinkage is replaced by this value,
because a wheel without contact has no traction factor."""
SINKING_TIME = 0.02
"""Time constant of a wheel that settles on soil without damping, in the reduced model [s]. It is about the square root
of the wheel's mass divided by the stiffness of the contact."""
MAX_PATH_RATIO = 3.0
"""Length of the path that is computed for a drive, divided by the distance at cruise speed. If a rover drives beyond
this path, the ground continues with the last slope."""
TOLERANCES = {"abstol": 1e-6, "reltol": 1e-5, "max_num_steps": 8000}
"""Tolerances and limits of the integrator CVODES, as its options."""
GAIN_NAMES = tuple(quantities(Gains))
"""Names of the gains of the slip control, in the order of the reduced model's input."""


class ReducedOutcome(NamedTuple):
    """The result of a drive of the reduced model. The score of the drive is computed from it."""

    x_end: Scalar
    "x of the base at the end [m]"
    speed_end: Scalar
    "mean speed over the last part of the drive [m/s]"
    slip: Scalar
    """mean of the squared slip S^2 over time and wheels [-]"""
    energy: Scalar
    """electric energy of all motors [J]"""
    sinkage: Scalar
    """mean of sinkage divided by wheel radius over time and wheels [-]"""
    deepest: Scalar
    """largest ratio of sinkage to wheel radius of a wheel at the end [-]"""


@dataclass(frozen=True)
class ContinuousControl:
    """The slip control of the paper's Fig 9 in continuous time, as CasADi expressions for the reduced model.

    `SlipControl` is this control evaluated at samples. The control in continuous time has derivatives, and the
    integrator need not stop at each sample.
    """

    estimate: TrueSlip | TableEstimate
    "slip estimate"
    limit: TorqueLimit | NoLimit
    """torque check, which limits the duty"""

    def estimated_slip(self, S: Scalar, duty: Scalar, rim: Scalar) -> Scalar:
        """Return the estimated slip of a wheel [-]: the true slip S, or the estimate of Eq (9) from the duty and the
        rim speed [m/s].
        """
        if isinstance(self.estimate, TrueSlip):
            return S
        table = self.estimate.table
        # A smooth sign of the rim speed, because the integrator needs derivatives.
        sense = ca.tanh(rim / MIN_RIM_SPEED)
        v_hat = piecewise(ca.fabs(duty), np.array(table.duty), np.array(table.speed)) * ca.sign(duty)
        speed = ca.fmax(ca.fabs(rim), MIN_RIM_SPEED)
        return ca.fmin(1.0, ca.fmax(-1.0, 1.0 - sense * v_hat / speed))

    def highest(self, axle: int, pitch: Scalar, omega: Scalar) -> Scalar:
        """Return the highest duty of an axle that the torque check allows [-], at a pitch [rad] and a wheel rate
        [rad/s].

        Both wheels of an axle have one common limit in the reduced model.
        """
        if isinstance(self.limit, NoLimit):
            return 1.0
        # The wheels are sorted by axle, with two wheels for each axle.
        motor = self.limit.motor
        torques = np.array(self.limit.torques)[:, 2 * axle]
        torque = piecewise(pitch, PITCHES, torques)
        duty = torque / motor.stall_torque + omega / motor.no_load_rate
        return ca.fmin(1.0, ca.fmax(0.0, duty))

    def rates(
        self, gains: Gains, S_hat: Scalar, highest: Scalar, integral: Scalar, duty: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Return the time derivatives of the integral and of the duty of a wheel by the PI law [1/s].

        The duty approaches the duty of the PI law with the control period as its time constant.
        """
        # The lag of one control period stands for the sampling, and smooths the limits of the duty.
        step = pi_law(gains, S_hat, integral, highest)
        return step.rate, (step.duty - duty) / CONTROL_PERIOD


class AxleSoil(NamedTuple):
    """The forces of the soil on one axle at one instant, as CasADi expressions."""

    F: Scalar
    """traction factor f_t / f_n [-], pull divided by normal force"""
    M: Scalar
    """torque of the soil on one wheel divided by its normal force f_n [m]"""
    S: Scalar
    "slip [-]"
    rate: tuple[Scalar, ...]
    """time derivatives of the contact effects' states"""
    f_n: Scalar
    "normal force of one wheel that moves neither up nor down [N]"
    yielding: Scalar
    """divisor of the sinking speed of one wheel, df_n/dv_n + SINKING_TIME df_n/dh [N s/m], with the speed v_n into the
    ground and the sinkage h"""


@dataclass(frozen=True)
class ReducedDrive:
    """The reduced model of a drive, whose result is a function of the gains of the slip control.

    Parameters
    ----------
    model : Model
        The model, whose rover has two or more axles of two wheels each. If there are three axles, the front axle is on
        the rockers.
    control : ContinuousControl
        Slip estimate and torque check.
    duration : float
        Duration of the drive [s].
    start : float
        x of the base at the start [m].
    tail : float
        Length of the last part of the drive, over which the end speed is averaged [s]. If the drive is shorter than
        this part, the rover counts as being at rest before the start of the drive.
    """

    model: Model
    control: ContinuousControl
    duration: float
    start: float = 0.0
    tail: float = 3.0

    @cached_property
    def rover(self) -> Rover:
        """The rover of the model, including the masses that its effects add."""
        return self.model.built

    @cached_property
    def loads(self) -> AxleLoads:
        """The loads of the axles at rest, and the change of these loads by the pulls of the axles."""
        return axle_loads(self.rover, self.model.gravity)

    @property
    def axles(self) -> int:
        """Number of axles of the rover."""
        return len(self.loads.at_rest)

    @cached_property
    def sunk(self) -> float:
        """Sinkage [m] of a wheel that carries an equal share of the rover's weight at a slip of 0.1."""
        wheel, soil = self.model.rover.wheel, self.model.soils[0]
        load = float(np.sum(self.loads.at_rest)) / len(self.model.rover.wheels)
        return float(sinkage(entry_angle(load, 0.1, wheel, soil), wheel))

    @cached_property
    def path(self) -> WheelPath:
        """The path of the wheels' centres over the terrain, common to all axles."""
        # The path reaches further than a cruise, and 1 m further at both ends, where axles may be.
        rover = self.model.rover
        reach = MAX_PATH_RATIO * CRUISE_SPEED * self.duration
        low, high = self.start - 1.0, self.start + 1.0 + reach
        radius = float(rover.wheel.r) - self.sunk
        return wheel_path(self.model.ground, radius, self.loads.half_track, low, high)

    @cached_property
    def ode(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """The differential equations of the drive as CasADi expressions.

        The five columns are the states, the gains, the time derivatives of the states, the quantities that are
        integrated over time (S^2, electric power, sinkage / radius), and the outputs (speed v, then the slip S, the
        wheel rate omega and the sinkage h of each axle). An axle has the states omega, duty, integral of the PI law and
        h, the states of the contact effects, and the states of the motor effects.
        """
        model, effects = self.model, self.model.contact_effects
        nx = sum(len(effect.states) for effect in effects)
        nm = sum(len(effect.states) for effect in model.motor_effects)
        # The unknowns of the differential equations: position, speed, and the states of each axle.
        x, v = ca.SX.sym("x"), ca.SX.sym("v")
        axle_states = [ca.SX.sym(f"axle_{i}", 4 + nx + nm) for i in range(self.axles)]
        p = ca.SX.sym("gains", len(GAIN_NAMES))
        gains = Gains(**dict(zip(GAIN_NAMES, ca.vertsplit(p), strict=True)))
        # Slope, height and pitch on the path. The body points from the mean of the rear axles to the front axle.
        places = [x + float(place) for place in self.loads.place]
        slopes = [self.path.slope_at(place) for place in places]
        heights = [self.path.height_at(place) for place in places]
        pitch = (_mean(heights[1:]) - heights[0]) / (self.loads.place[0] - _mean(self.loads.place[1:]))
        # The soil, the motors and the balance of forces are computed in this order, because each needs the one before.
        axles = [self._axle(i, places[i], slopes[i], v, axle_states[i][: 4 + nx]) for i in range(self.axles)]
        motors = self._motors(axle_states, nx)
        normal, push = self._balance(slopes, -pitch, [axle.F for axle in axles])
        pull = pull_along(model.begin_at(self.start, 0.0), BodyPlace(x, v, _mean(heights), pitch))
        # Inertia of a wheel with its rotor about its axle [kg m^2].
        axis = np.array([0.0, 1.0, 0.0])
        wheel_inertia = self.rover.model.inertias[self.rover.wheels[0].joint].inertia
        inertia = float(axis @ wheel_inertia @ axis) + float(self.model.motor.armature)
        # The rates of the states follow in the order of the states: the rover first, then one axle after another.
        rates: list[Scalar] = [v, (sum(push) + pull) / self.rover.mass]
        for i, axle in enumerate(axles):
            omega, duty, integral = axle_states[i][0], axle_states[i][1], axle_states[i][2]
            sinking = (normal[i] / 2 - axle.f_n) / axle.yielding
            S_hat = self.control.estimated_slip(axle.S, duty, model.rover.wheel.r * omega)
            highest = self.control.highest(i, pitch, omega)
            d_integral, d_duty = self.control.rates(gains, S_hat, highest, integral, duty)
            spin = (motors[i].torque - axle.M * normal[i] / 2) / inertia
            rates += [spin, d_duty, d_integral, sinking, *axle.rate, *motors[i].rate]
        # The integrands of the score; each motor stands for both wheels of its axle.
        slip = sum(axle.S**2 for axle in axles) / self.axles
        power = sum(motor.power for motor in motors) * 2
        sunk = sum(state[3] for state in axle_states) / (self.axles * model.rover.wheel.r)
        # The outputs are the channels that a drive of the full rover also records.
        outputs = ca.vertcat(
            v, *(axle.S for axle in axles), *(state[0] for state in axle_states), *(state[3] for state in axle_states)
        )
        return ca.vertcat(x, v, *axle_states), p, ca.vertcat(*rates), ca.vertcat(slip, power, sunk), outputs

    def _axle(self, i: int, x: Scalar, p: Scalar, v: Scalar, axle_state: ca.SX) -> AxleSoil:
        """Return the forces of the soil on axle `i`, which is at the position x on the slope p, at the speed v of the
        rover [m/s].

        `axle_state` has the wheel rate, the duty, the integral, the sinkage, and the states of the contact effects.
        """
        # The path climbs by the slope, so that the wheel's speed along it is larger than the horizontal speed.
        wheel, speed = self.model.rover.wheel, v * ca.sqrt(1 + p**2)
        h, v_n = ca.fmax(axle_state[3], MIN_SINKAGE), ca.SX.sym("v_n")
        # S and S_y are 0 here, because the slip effect of the model sets them from the speeds.
        contact = Contact(
            0.0, 0.0, h, speed, 0.0, v_n, wheel.r * axle_state[0], x, float(i), wheel, self.model.soils[0]
        )
        contact, load, rate = through_contacts(self.model, contact, ca.vertsplit(axle_state)[4:])
        # The derivative by h is taken through the state, so that it contains the effects that change the sinkage.
        yielding = ca.jacobian(load.f_n, v_n) + SINKING_TIME * ca.jacobian(load.f_n, axle_state)[3]
        outputs = ca.vertcat(load.f_t / load.f_n, load.torque / load.f_n, contact.S, load.f_n, yielding, *rate)
        F, M, S, f_n, stiff, *rates = ca.vertsplit(ca.substitute(outputs, v_n, 0.0))
        return AxleSoil(F, M, S, tuple(rates), f_n, stiff)

    def _motors(self, axle_states: list[ca.SX], nx: int) -> list[AxleMotors]:
        """Return torque, power and current of the motors of each axle. `nx` is the number of states of the contact
        effects, after which the states of the motor effects follow.
        """
        # Motor effects may depend on the current of all motors. The first pass has no supply current; the second has
        # the current of the first.
        bus: Scalar = 0.0
        for _ in range(2):
            motors = [
                through_motors(self.model, i, state[1], state[0], ca.vertsplit(state)[4 + nx :], bus)
                for i, state in enumerate(axle_states)
            ]
            bus = sum(motor.drawn for motor in motors) * 2
        return motors

    def _balance(self, slopes: list[Scalar], s: Scalar, factors: list[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
        """Return the normal force of each axle and the horizontal force of each axle on the rover [N].

        `slopes` are the slopes of the path at the axles, `s` is the slope of the body, and `factors` are the traction
        factors f_t / f_n of the axles. The pulls of the axles change their loads, and the loads change the pulls, so
        that both are the solution of a linear system.
        """
        # The weight acts vertically; its part across the body decreases with the slope of the body.
        level = 1 / ca.sqrt(1 + s * s)
        # Slope of the path relative to the body, and pull along the body divided by the load across it.
        against = [(p - s) / (1 + p * s) for p in slopes]
        ease = [(F - p) / (1 + F * p) for F, p in zip(factors, against, strict=True)]
        shift, level_loads = ca.SX(self.loads.shift), level * ca.SX(self.loads.at_rest)
        across = ca.solve(ca.SX.eye(self.axles) - shift @ ca.diag(ca.vertcat(*ease)), level_loads)
        W = [ca.fmax(across[i], MIN_AXLE_LOAD * float(self.loads.at_rest[i])) for i in range(self.axles)]
        # The soil's force on a wheel has the components N and F N; across the body they give the load W.
        normal = [w * ca.sqrt(1 + p**2) / (1 + F * p) for w, p, F in zip(W, against, factors, strict=True)]
        return normal, [w * level * (tangent - s) for w, tangent in zip(W, ease, strict=True)]

    @cached_property
    def initial(self) -> np.ndarray:
        """The states at the start: the rover is at rest at x = start, each wheel has its static sinkage, and all other
        states are 0.
        """
        state = self.ode[0]
        names = [symbol.name() for symbol in ca.vertsplit(state)]
        return np.array([self.start, *(self.sunk if name.endswith("_3") else 0.0 for name in names[1:])])

    def outcome(self) -> ca.Function:
        """Return the CasADi function that simulates the drive: from the gains, in the order of GAIN_NAMES, to the
        fields of `ReducedOutcome`.
        """
        state, p, rate, quad, _ = self.ode
        grid = [max(0.0, self.duration - self.tail), self.duration]
        dae = {"x": state, "p": p, "ode": rate, "quad": quad}
        options = {**TOLERANCES, "show_eval_warnings": False, "disable_internal_warnings": True}
        # The integrator returns the states and the integrals at both times of the grid: tail and end of the drive.
        integrator = ca.integrator("drive", "cvodes", dae, 0.0, grid, options)
        gains = ca.MX.sym("gains", len(GAIN_NAMES))
        end = integrator(x0=self.initial, p=gains)
        # The outputs of the integrator: states in columns for both times, and integrals at the end.
        x = end["xf"][0, :]
        slip, energy, sunk = ca.vertsplit(end["qf"][:, 1])
        sinkages = ca.Function("sinkages", [state], [self.ode[4][-self.axles :]])
        deepest = ca.mmax(sinkages(end["xf"][:, 1])) / self.model.rover.wheel.r
        means = (slip / self.duration, energy, sunk / self.duration)
        out = ca.vertcat(x[1], (x[1] - x[0]) / self.tail, *means, deepest)
        return ca.Function("outcome", [gains], [out])

    def drive(self, gains: Gains, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return the channels of the drive with these gains at increasing times [s], as a dict of arrays.

        The channels are x [m] and v [m/s] (times,), and slip [-], wheel_rate [rad/s] and sinkage [m] (times, axles).

        Raises OptimisationError: the integrator fails.
        """
        # The integrator works on a fixed grid of times, so that its channels can be compared with those of the full
        # rover.
        state, p, rate, _, outputs = self.ode
        options = {**TOLERANCES, "show_eval_warnings": False, "disable_internal_warnings": True}
        integrator = ca.integrator("trace", "cvodes", {"x": state, "p": p, "ode": rate}, 0.0, list(times), options)
        try:
            # CasADi prints all inputs of a call that fails; this is suppressed.
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                path = integrator(x0=self.initial, p=as_column(gains))["xf"]
        except RuntimeError as error:
            raise OptimisationError(
                f"The integration of the reduced model fails with {gains}: {error} Use other gains, or the full rover."
            ) from error
        output_values = np.array(ca.Function("seen", [state], [outputs]).map(len(times))(path))
        # The channels after the speed are three blocks with one row for each axle.
        slip, wheel_rate, sinkage = (channel.T for channel in np.split(output_values[1:], 3))
        per_axle = {"slip": slip, "wheel_rate": wheel_rate, "sinkage": sinkage}
        return {"x": np.array(path[0, :]).ravel(), "v": output_values[0], **per_axle}


def as_column(gains: Gains) -> np.ndarray:
    """Return the gains as an array (gains,) in the order of GAIN_NAMES."""
    return np.array([float(value) for value in gains.values().values()])


def _mean(values: Sequence[Scalar] | np.ndarray) -> Scalar:
    """Return the mean of numbers or CasADi expressions."""
    return sum(values) / len(values)
