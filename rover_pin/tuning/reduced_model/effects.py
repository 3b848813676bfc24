"""The effects of a model in the reduced model of a drive: effects in the contacts of an axle, in its motors, and on the
body.
"""

import itertools
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Body
from rover_pin.simulation.compiled.laws import amend_subject, load_and_rates, torque_and_rates
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import suspension_dofs


class AxleMotors(NamedTuple):
    """Torque, power and current of the motors of one axle, as means over its wheels, which turn at one common rate."""

    torque: Scalar
    """torque of the motor at the wheel [N m]"""
    power: Scalar
    "electric power [W]"
    drawn: Scalar
    "current from the supply, the duty times the motor's current [A]"
    rate: tuple[Scalar, ...]
    """time derivatives of the motor effects' states"""


class BodyPlace(NamedTuple):
    """Position, speed and pitch of the body in the reduced model, as CasADi expressions."""

    x: Scalar
    "x of the base [m]"
    v: Scalar
    "forward speed [m/s]"
    height: Scalar
    "mean height of the wheels' centres [m]"
    pitch: Scalar
    "pitch, positive with the nose down [rad]"


def through_contacts(model: Model, contact: Contact, states: list[Scalar]) -> tuple[Contact, Load, tuple[Scalar, ...]]:
    """Return the contact of a wheel, the soil's load on the wheel, and the rates of the effects' states, with all
    contact effects of a model.

    `contact` is the contact before the effects amend it. `states` has the states of all contact effects, one effect
    after another.
    """
    parts = _split_states(states, [len(effect.states) for effect in model.contact_effects])
    contact = amend_subject(model.contact_effects, contact, parts)
    load, rates = load_and_rates(model.contact_effects, contact, parts)
    return contact, load, tuple(component for rate in rates for component in rate)


def through_motors(
    model: Model, axle: int, duty: Scalar, omega: Scalar, states: list[Scalar], bus: Scalar
) -> AxleMotors:
    """Return torque, power, supply current and the effects' rates for the motors of an axle, with all motor effects of
    a model.

    The results are means over the wheels of the axle, which share one set of states. An effect on one wheel alone
    therefore acts with half its size on both wheels, and does not turn the rover.

    Parameters
    ----------
    model : Model
        The model with its motor and motor effects.
    axle : int
        Number of the axle from the front.
    duty, omega : Scalar
        Duty [-] and wheel rate [rad/s] of the axle.
    states : list of Scalar
        States of all motor effects, one effect after another.
    bus : Scalar
        Current that all motors draw from the supply [A].
    """
    wheels = [index for index, mount in enumerate(model.rover.wheels) if mount.axle == axle]
    motors = [_motor(model, index, duty, omega, states, bus) for index in wheels]
    rates = zip(*(motor.rate for motor in motors), strict=True)
    torque, power, drawn = (sum(values) / len(wheels) for values in itertools.islice(zip(*motors, strict=True), 3))
    return AxleMotors(torque, power, drawn, tuple(sum(values) / len(wheels) for values in rates))


def _motor(model: Model, wheel: int, duty: Scalar, omega: Scalar, states: list[Scalar], bus: Scalar) -> AxleMotors:
    """Return torque, power, supply current and the effects' rates for the motor of the wheel with the index `wheel`."""
    # Motor effects first amend the operating point of the motor, and then add torques.
    parts = _split_states(states, [len(effect.states) for effect in model.motor_effects])
    drive = model.motor.drive(duty, omega)._replace(wheel=wheel, bus_current=bus)
    drive = amend_subject(model.motor_effects, drive, parts)
    current = drive.current
    torque, rates = torque_and_rates(model.motor_effects, drive, drive.constant * current, parts)
    drawn = duty * current
    return AxleMotors(torque, drawn * drive.supply, drawn, tuple(component for rate in rates for component in rate))


def pull_along(model: Model, place: BodyPlace) -> Scalar:
    """Return the forward force on the body [N] that body effects and a gravity that is not vertical cause."""
    # All joint angles are 0, because the reduced model has no motion of the suspension.
    built = model.built
    body = _body(place, *(ca.SX.zeros(number) for number in _joints(model)))
    return sum((effect.push(body).f_x for effect in model.body_effects), built.mass * built.model.gravity.linear[0])


def omitted_effects(model: Model) -> tuple[str, ...]:
    """Return the names of the body effects of a model that the reduced model leaves out, in whole or in part.

    The reduced model contains the weight of a body effect and its push along x. It leaves out other forces, moments,
    forces on joints, and a raised centre of mass.
    """
    names = []
    place = BodyPlace(*(ca.SX.sym(name) for name in BodyPlace._fields))
    for effect in model.body_effects:
        # A component that is not identically zero as an expression is present.
        push = effect.push(_body(place, *(ca.SX.sym("joint", number) for number in _joints(model))))
        others = (push.f_y, push.f_z, push.m_x, push.m_y, push.m_z, *push.joints, push.differential)
        if effect.rise()[1] != 0.0 or any(not ca.SX(component).is_zero() for component in others):
            names.append(type(effect).__name__)
    return tuple(names)


def _joints(model: Model) -> tuple[int, int, int]:
    """Return the lengths of the columns `angles`, `rates` and `twist` that `_body` needs for the rover of a model."""
    number = len(suspension_dofs(model.rover))
    return number, number, 2


def _body(place: BodyPlace, angles: ca.SX, rates: ca.SX, twist: ca.SX) -> Body:
    """Return the state of the body on which body effects depend, as the reduced model knows it.

    Quantities that the reduced model does not have, such as y, roll and yaw, are 0. `angles` and `rates` are the
    suspension angles and their rates; `twist` is the angle of the differential and its rate.
    """
    # The reduced model knows x, z, pitch and forward speed of the base; all other quantities of the base are 0.
    positions, speeds = (tuple(ca.vertsplit(column)) if column.numel() else () for column in (angles, rates))
    base = {**dict.fromkeys(Body._fields, 0.0), "x": place.x, "z": place.height, "pitch": place.pitch, "v_x": place.v}
    joint_values = {
        "angles": positions,
        "rates": speeds,
        "known_rates": speeds,
        "twist": twist[0],
        "twist_rate": twist[1],
    }
    return Body(**{**base, **joint_values, "names": ()})


def _split_states(values: list[Scalar], lengths: list[int]) -> list[tuple[Scalar, ...]]:
    """Return one tuple of states for each effect, from the states of all effects one after another. `lengths` are the
    numbers of states of the effects.
    """
    ends = np.cumsum([0, *lengths])
    return [tuple(values[start:end]) for start, end in itertools.pairwise(ends)]
