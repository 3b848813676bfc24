"""The linear model dx/dt = A x + B u, y = C x + D u of a rover at a trim point, for the design of controllers. The
deviations from the trim point are x for the states, u for the duties, and y for the outputs.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import expm

from rover_pin.base.errors import MissingExtraError, SimulationError
from rover_pin.base.extras import install_command
from rover_pin.base.public import public
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start import Start
from rover_pin.simulation.state import DriveState

RATE_STEP = 2e-5
"""Time step of the simulation [s]. One such step gives the time derivatives of the states. It damps modes that are
faster than 1 / RATE_STEP."""
DIFFERENCE = 1e-6
"""Change of a state or duty in each direction for central differences, in the unit of the state or duty. It is near the
cube root of the machine's round-off (6e-6), at which such a difference is most exact."""
MAX_ACCELERATION = 0.02
"""Maximum acceleration of the base at a trim point [m/s^2, rad/s^2]. A state with a larger acceleration is no trim
point and is refused."""
OUTPUT_COLUMNS = {"slip": RECORD.index("slip"), "current": RECORD.index("current")}
"""Name of an output that each wheel has (slip, motor current) -> its column in the simulation's record of a step."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """The linear model dx/dt = A x + B u, y = C x + D u for deviations of a rover from a trim point.

    The states x are the displacement and the speed of each degree of freedom, and the states of the model's effects for
    each wheel. Their names are the channels of a drive log where such a channel exists: `body_x` and `body_vx` [m, m/s]
    and `body_pitch` with `body_pitch_rate` [rad, rad/s] for the base, in the axes of the base; `rocker_l` and
    `rocker_l_rate` for a joint; `wheel_angle_fl` and `wheel_rate_fl` for a wheel; and `S_fl` for the slip state of a
    wheel. The inputs u are the duties of the wheels. The outputs y are the forward speed of the base, and the slip, the
    current and the rate of each wheel.
    """

    A: np.ndarray
    """matrix A (states, states): derivatives of dx/dt with respect to the states x"""
    B: np.ndarray
    """matrix B (states, inputs): derivatives of dx/dt with respect to the duties u"""
    C: np.ndarray
    """matrix C (outputs, states): derivatives of the outputs y with respect to the states x"""
    D: np.ndarray
    """matrix D (outputs, inputs): derivatives of the outputs y with respect to the duties u"""
    states: tuple[str, ...]
    """names of the states x"""
    inputs: tuple[str, ...]
    """names of the duties u"""
    outputs: tuple[str, ...]
    """names of the outputs y"""

    def response(self, omega: float) -> np.ndarray:
        """Return the frequency response of the outputs to the duties, a complex matrix (outputs, inputs), at the
        angular frequency `omega` [rad/s].

        The response is C (i omega I - A)^-1 B + D.
        """
        return np.asarray(self.C @ np.linalg.solve(1j * omega * np.eye(len(self.A)) - self.A, self.B) + self.D)

    def to_ss(self) -> Any:
        """Return the linear model as a `control.StateSpace` of python-control, with the names of states, inputs and
        outputs.

        Raises MissingExtraError if the package `control` is not installed.

        Examples
        --------
        >>> from rover_pin import linear_model, scenario, trim_state
        >>> flat = scenario("flat").model
        >>> system = linear_model(flat, trim_state(flat, 0.5), 0.5).to_ss()  # doctest: +SKIP
        >>> control.bode_plot(system["speed", "duty_fl"])  # doctest: +SKIP
        """
        try:
            import control
        except ImportError as error:
            raise MissingExtraError(
                f"to_ss needs the package control (python-control). Run `{install_command('control')}`, or use the "
                "arrays A, B, C, D."
            ) from error
        names = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        return control.ss(self.A, self.B, self.C, self.D, **{key: list(value) for key, value in names.items()})

    def step_response(self, t: np.ndarray) -> np.ndarray:
        """Return the outputs (times, outputs) at the times t [s] after all duties have increased by 1 at t = 0.

        The times must be evenly spaced. The response is linear in the increase of the duties, so that it can be scaled
        to another increase. It is computed by the matrix exponential for one interval of t, with the states x and the
        duties u in one vector.
        """
        states, inputs = self.B.shape
        # d/dt (x, u) = [[A, B], [0, 0]] (x, u): with the constant duties as states, one exponential serves for both.
        system = np.zeros((states + inputs, states + inputs))
        system[:states] = np.hstack([self.A, self.B])
        transition, state = expm(system * (t[1] - t[0])), np.repeat([0.0, 1.0], [states, inputs])
        rows = []
        for _ in t:
            # The outputs belong to the state at the beginning of the interval.
            rows.append(self.C @ state[:states] + self.D @ state[states:])
            state = transition @ state
        return np.array(rows)


@public
def trim_state(model: Model, duty: float, duration: float = 10.0, start: Start = Start()) -> DriveState:
    """Return a trim point of a model: the state that the rover has reached after a drive at a constant duty, when it no
    longer accelerates.

    Parameters
    ----------
    model : Model
        The rover on its ground.
    duty : float
        Duty of all wheels [-], from -1 to 1.
    duration : float
        Duration of the drive [s].
    start : Start
        Pose and state from which the rover starts.

    Returns
    -------
    DriveState
        Configuration, velocities and effects' states at the end of the drive.

    Raises
    ------
    SimulationError
        The drive ends earlier, or the base still accelerates by more than `MAX_ACCELERATION`.

    Examples
    --------
    >>> from rover_pin import scenario, trim_state
    >>> state = trim_state(scenario("flat").model, duty=0.5)
    >>> bool(0.03 < state.v[0] < 0.06)  # forward speed [m/s]
    True
    """
    # The rover settles by itself: the end of a long drive at a constant duty is a steady motion.
    trace = simulate(model, ConstantDuty(duty), duration, start, measure_error=False)
    if trace.end is None:
        raise SimulationError(
            f"There is no trim point, because the drive ends before {duration:g} s ({trace.attrs['stop']}). Choose "
            "gentler ground."
        )
    state = trace.end.state
    # The rates of the speeds follow the rates of the displacements; the first six belong to the base.
    acceleration = float(np.max(np.abs(_Rates(model, state, duty).at(state, duty).x[model.rover.model.nv :][:6])))
    if acceleration > MAX_ACCELERATION:
        raise SimulationError(
            f"There is no trim point after {duration:g} s at a duty of {duty:g}: the base still accelerates by "
            f"{acceleration:.2g} m/s^2 or rad/s^2, and the limit is {MAX_ACCELERATION:g}. "
            "Drive longer, or on even ground."
        )
    return state


@public
def linear_model(model: Model, state: DriveState, duty: float) -> LinearModel:
    """Return the linear model dx/dt = A x + B u, y = C x + D u of a rover at a state.

    The matrices follow from central differences of the compiled step of the simulation. The state should be a trim
    point (`trim_state`), because the linear model describes deviations from a steady motion. A force that changes its
    sign at the state, such as dry friction at rest, has no linear model.

    Parameters
    ----------
    model : Model
        The rover on its ground.
    state : DriveState
        The trim point.
    duty : float
        Duty of all wheels [-] at the trim point.

    Returns
    -------
    LinearModel
        The matrices, and the names of states, inputs and outputs. `to_ss()` returns it for python-control.

    Raises
    ------
    SimulationError
        The step fails at the state.

    Source: none.

    Examples
    --------
    >>> from rover_pin import linear_model, scenario, trim_state
    >>> flat = scenario("flat").model
    >>> linear = linear_model(flat, trim_state(flat, 0.5), 0.5)
    >>> bool(abs(linear.response(0.01)[0].sum()) > abs(linear.response(100.0)[0].sum()))
    True
    """
    # One column of slopes for each state, then one for each duty, by central differences.
    rates, wheels = _Rates(model, state, duty), len(model.rover.wheels)
    size, duties = rates.size, np.full(wheels, float(duty))
    columns = [rates.slope(state, duties, np.eye(size)[i], np.zeros(wheels)) for i in range(size)]
    columns += [rates.slope(state, duties, np.zeros(size), np.eye(wheels)[i]) for i in range(wheels)]
    x_slopes, y_slopes = (np.array(part).T for part in zip(*columns, strict=True))
    # The columns of the states give A and C, and the columns of the duties give B and D.
    # The names of inputs and outputs contain the wheel, in the order of the columns.
    names = [wheel.name for wheel in model.rover.wheels]
    outputs = ("speed", *(f"{kind}_{name}" for kind in (*OUTPUT_COLUMNS, "rate") for name in names))
    inputs = tuple(f"duty_{name}" for name in names)
    A, B, C, D = (*np.split(x_slopes, [size], axis=1), *np.split(y_slopes, [size], axis=1))
    return LinearModel(A, B, C, D, rates.names(), inputs, outputs)


class _Point(NamedTuple):
    """The time derivatives of a model's states and its outputs at one state; or the derivatives of both along a
    direction.
    """

    x: np.ndarray
    """time derivatives of the states (states,)"""
    y: np.ndarray
    """outputs (outputs,)"""


class _Rates:
    """The time derivatives of a model's states, and its outputs, at every given state. They are computed by one short
    step of the simulation.
    """

    def __init__(self, model: Model, state: DriveState, duty: float):
        self.model, self.pin_model = model, model.rover.model
        self.state = state.copy()
        self.kernel = Kernel(
            model.begin_at(float(state.q[0]), float(state.q[1])), self.state, RATE_STEP, symmetric=False
        )
        # One step fills the kernel's memory. Every rate starts from this memory, so that the rates are comparable.
        self.kernel.disable_energy_balance()
        self.kernel.duty[:] = duty
        self.kernel.step()
        self.memory = self.kernel.saved_arrays()
        self.size = 2 * self.pin_model.nv + state.contact.size + state.motor.size

    def at(self, state: DriveState, duty: np.ndarray | float) -> _Point:
        """Return the time derivatives of the states, and the outputs, at a state with the duty `duty`: one number for
        each wheel, or one number for all wheels.

        Raises SimulationError: the step of the simulation fails in this state.
        """
        # The kernel works on `self.state`, so the state is copied into it, and changes by the step.
        self.kernel.restore(self.memory)
        now = self.state
        now.q[:], now.v[:], now.contact[:], now.motor[:] = state.q, state.v, state.contact, state.motor
        self.kernel.duty[:] = duty
        if self.kernel.step():
            raise SimulationError("The step of the simulation fails at the trim point. Choose another state.")
        # The changes over the step, divided by its length, are the rates. The configuration changes on its manifold.
        displacement = pin.difference(self.pin_model, state.q, now.q)
        parts = [
            displacement,
            now.v - state.v,
            (now.contact - state.contact).ravel(),
            (now.motor - state.motor).ravel(),
        ]
        # Outputs: forward speed, slips and currents of the wheels by the record of the step, and wheel rates.
        wheels = [mount.dof for mount in self.model.rover.wheels]
        read = [self.kernel.record[:, column] for column in OUTPUT_COLUMNS.values()]
        return _Point(np.concatenate(parts) / RATE_STEP, np.concatenate([[state.v[0]], *read, state.v[wheels]]))

    def slope(self, state: DriveState, duty: np.ndarray, x: np.ndarray, u: np.ndarray) -> _Point:
        """Return the derivatives of the states' rates and of the outputs along a direction, by central differences. The
        direction has the components x for the states and u for the duties.
        """
        nv = self.pin_model.nv
        points = []
        for change in (DIFFERENCE, -DIFFERENCE):
            # The configuration q is displaced on its manifold by Pinocchio, and the rest of the state by addition.
            moved = state.copy()
            displacement, speed, contact, motor = np.split(change * x, [nv, 2 * nv, 2 * nv + state.contact.size])
            moved.q[:] = pin.integrate(self.pin_model, state.q, displacement)
            moved.v += speed
            moved.contact += contact.reshape(state.contact.shape)
            moved.motor += motor.reshape(state.motor.shape)
            points.append(self.at(moved, duty + change * u))
        forward, backward = points
        return _Point(*((after - before) / (2.0 * DIFFERENCE) for after, before in zip(forward, backward, strict=True)))

    def names(self) -> tuple[str, ...]:
        """Return the names of the states x: displacements, speeds, and the effects' states of each wheel."""
        # The names follow the order of `at`: displacements, speeds, states of contact effects and of motor effects.
        displacements = ["body_x", "body_y", "body_z", "body_roll", "body_pitch", "body_yaw"]
        speeds = ["body_vx", "body_vy", "body_vz", "body_roll_rate", "body_pitch_rate", "body_yaw_rate"]
        # The first two joints of Pinocchio's model are the world and the free base.
        joints = list(self.pin_model.names)[2:]
        displacements += joints
        speeds += [f"{joint}_rate" for joint in joints]
        # A wheel is named as in a drive log, whatever the rover's description calls its joint.
        for mount in self.model.rover.wheels:
            displacements[mount.dof], speeds[mount.dof] = f"wheel_angle_{mount.name}", f"wheel_rate_{mount.name}"
        effect_states = [
            f"{state.name}_{mount.name}"
            for effects in (self.model.contact_effects, self.model.motor_effects)
            for mount in self.model.rover.wheels
            for effect in effects
            for state in effect.states
        ]
        return (*displacements, *speeds, *effect_states)
