"""The linear model of a rover under way, at a trim point: dx/dt = A x + B u, y = C x + D u, as control theory asks."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import expm

from rover_pin.base.errors import SimulationError
from rover_pin.control.constant import ConstantDuty
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.state import DriveState

STEP = 2e-5
"""Time [s] over which rates are taken: modes faster than 1/STEP are damped by the step itself."""
CHANGE = 1e-6
"""By how much a state or a duty is changed to either side, in its own unit."""
STEADY = 0.02
"""Most acceleration of the base at a trim point [m/s^2, rad/s^2]."""
READ = {"slip": RECORD.index("slip"), "current": RECORD.index("current")}


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Deviations from a trim point: states x, duties u of the wheels, outputs y, with their names.

    States are the way of every degree of freedom (the base's in its own axes), its speed, and the effects' own states,
    wheel by wheel; outputs are the base's forward speed, and slip, rate and current of each wheel.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def response(self, omega: float) -> np.ndarray:
        """Return C (i omega - A)^-1 B + D [outputs, inputs] at an angular frequency [rad/s]."""
        return np.asarray(self.C @ np.linalg.solve(1j * omega * np.eye(len(self.A)) - self.A, self.B) + self.D)

    def step_response(self, t: np.ndarray) -> np.ndarray:
        """Return what the outputs have become [times, outputs] after all duties rose by 1 at t = 0; t is evenly spaced.

        By the matrix exponential of x and u together over the time between two of t [s]; linear, so for any rise.
        """
        states, inputs = self.B.shape
        both = np.zeros((states + inputs, states + inputs))
        both[:states] = np.hstack([self.A, self.B])
        over_time, at = expm(both * (t[1] - t[0])), np.repeat([0.0, 1.0], [states, inputs])
        rows = []
        for _ in t:
            rows.append(self.C @ at[:states] + self.D @ at[states:])
            at = over_time @ at
        return np.array(rows)


def trim_state(model: Model, duty: float, duration: float = 10.0, start: Start = Start()) -> DriveState:
    """Return the state in which a `model` drives steadily, `duration` [s] after its `start` at a constant `duty`.

    Raises SimulationError: the drive ends before, or is not steady then.
    """
    trace = simulate(model, ConstantDuty(duty), duration, start, measure_error=False)
    if trace.end is None:
        raise SimulationError(f"There is no trim point: the drive ends ({trace.attrs['stop']}); take gentler ground.")
    state = trace.end.state
    acceleration = float(np.max(np.abs(_Rates(model, state, duty).at(state, duty).x[model.rover.model.nv :][:6])))
    if acceleration > STEADY:
        raise SimulationError(
            f"There is no trim point after {duration:g} s at a duty of {duty:g}: the base still accelerates by "
            f"{acceleration:.2g} m/s^2 or rad/s^2, allowed is {STEADY:g}; drive longer, or on even ground."
        )
    return state


def linear_model(model: Model, state: DriveState, duty: float) -> LinearModel:
    """Return the linear model of `model` at a `state` under a `duty` of all wheels, by differences of its step.

    Limits: what turns its sense there, as dry friction at rest, has no linear model. Source: none; numerical.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> flat = scenario("flat").model
    >>> linear = linear_model(flat, trim_state(flat, 0.5), 0.5)
    >>> bool(abs(linear.response(0.01)[0].sum()) > abs(linear.response(100.0)[0].sum()))
    True
    """
    rates, wheels = _Rates(model, state, duty), len(model.rover.wheels)
    size, duties = rates.size, np.full(wheels, float(duty))
    columns = [rates.slope(state, duties, np.eye(size)[i], np.zeros(wheels)) for i in range(size)]
    columns += [rates.slope(state, duties, np.zeros(size), np.eye(wheels)[i]) for i in range(wheels)]
    x_slopes, y_slopes = (np.array(part).T for part in zip(*columns, strict=True))
    names = [wheel.name for wheel in model.rover.wheels]
    outputs = ("speed", *(f"{kind}_{name}" for kind in (*READ, "rate") for name in names))
    inputs = tuple(f"duty_{name}" for name in names)
    A, B, C, D = (*np.split(x_slopes, [size], axis=1), *np.split(y_slopes, [size], axis=1))
    return LinearModel(A, B, C, D, rates.names(), inputs, outputs)


class _Point(NamedTuple):
    """Rates of the states, and the outputs."""

    x: np.ndarray
    y: np.ndarray


class _Rates:
    """How the states of a model move from any of them, by one short step."""

    def __init__(self, model: Model, state: DriveState, duty: float):
        self.model, self.pin_model = model, model.rover.model
        self.state = state.copy()
        self.kernel = Kernel(model.begin_at(float(state.q[0]), float(state.q[1])), self.state, STEP, symmetric=False)
        self.kernel.disable_energy_balance()
        self.kernel.duty[:] = duty
        self.kernel.step()
        self.memory = self.kernel.saved_arrays()
        self.size = 2 * self.pin_model.nv + state.contact.size + state.motor.size

    def at(self, state: DriveState, duty: np.ndarray | float) -> _Point:
        """Return rates and outputs at a state under duties."""
        self.kernel.restore(self.memory)
        now = self.state
        now.q[:], now.v[:], now.contact[:], now.motor[:] = state.q, state.v, state.contact, state.motor
        self.kernel.duty[:] = duty
        if self.kernel.step():
            raise SimulationError("The step fails at the trim point: take another state.")
        way = pin.difference(self.pin_model, state.q, now.q)
        parts = [way, now.v - state.v, (now.contact - state.contact).ravel(), (now.motor - state.motor).ravel()]
        wheels = [mount.dof for mount in self.model.rover.wheels]
        read = [self.kernel.record[:, place] for place in READ.values()]
        return _Point(np.concatenate(parts) / STEP, np.concatenate([[state.v[0]], *read, state.v[wheels]]))

    def slope(self, state: DriveState, duty: np.ndarray, x: np.ndarray, u: np.ndarray) -> _Point:
        """Return the slopes of rates and outputs along a direction of states and duties."""
        forward, backward = (
            self.at(self._move_state(state, sign * CHANGE * x), duty + sign * CHANGE * u) for sign in (1.0, -1.0)
        )
        return _Point(*((after - before) / (2.0 * CHANGE) for after, before in zip(forward, backward, strict=True)))

    def _move_state(self, state: DriveState, x: np.ndarray) -> DriveState:
        nv, moved = self.pin_model.nv, state.copy()
        way, speed, contact, motor = np.split(x, [nv, 2 * nv, 2 * nv + state.contact.size])
        moved.q[:] = pin.integrate(self.pin_model, state.q, way)
        moved.v += speed
        moved.contact += contact.reshape(state.contact.shape)
        moved.motor += motor.reshape(state.motor.shape)
        return moved

    def names(self) -> tuple[str, ...]:
        """Return the states' names."""
        base = ["x", "y", "z", "roll", "pitch", "yaw"]
        joints = list(self.pin_model.names)[2:]
        ways = [f"way of {name}" for name in [*base, *joints]]
        own = [
            f"{state.name} of {mount.name}"
            for effects in (self.model.contact_effects, self.model.motor_effects)
            for mount in self.model.rover.wheels
            for effect in effects
            for state in effect.states
        ]
        return (*ways, *(name.replace("way", "speed") for name in ways), *own)
