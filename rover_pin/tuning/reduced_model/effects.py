"""What a model's effects come to on the reduced rover: at an axle's contacts, in its motors, on the body."""

import itertools
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Body, BodyEffect
from rover_pin.simulation.compiled.laws import amend_subject, load_and_rates, torque_and_rates
from rover_pin.simulation.compiled.suspension import suspension_dofs
from rover_pin.simulation.model.model import Model


class AxleMotors(NamedTuple):
    """The motors of an axle's wheels, which turn at one rate: means over the wheels."""

    torque: Scalar
    "at the wheel [N m]"
    power: Scalar
    "electric [W]"
    drawn: Scalar
    "current from the supply, the duty times the motor's [A]"
    rate: tuple[Scalar, ...]
    "of the effects' own states"


class Along(NamedTuple):
    """Where the reduced rover is; expressions."""

    x: Scalar
    "m"
    v: Scalar
    "m/s"
    height: Scalar
    "mean of the wheels' centres [m]"
    pitch: Scalar
    "nose down positive [rad]"


def through_contacts(model: Model, contact: Contact, states: list[Scalar]) -> tuple[Contact, Load, tuple[Scalar, ...]]:
    """Return contact, load and rates of the own states after all of a model's contact effects."""
    parts = _split_states(states, [len(effect.states) for effect in model.contact_effects])
    contact = amend_subject(model.contact_effects, contact, parts)
    load, rates = load_and_rates(model.contact_effects, contact, parts)
    return contact, load, tuple(component for rate in rates for component in rate)


def through_motors(
    model: Model, axle: int, duty: Scalar, omega: Scalar, states: list[Scalar], bus: Scalar
) -> AxleMotors:
    """Return what all of a model's motor effects make of an axle's motors, the means of its wheels.

    The wheels share the own states: an effect of one wheel alone acts by its share on both, and the yaw that it
    makes is left out.
    """
    wheels = [index for index, mount in enumerate(model.rover.wheels) if mount.axle == axle]
    motors = [_motor(model, index, duty, omega, states, bus) for index in wheels]
    rates = zip(*(motor.rate for motor in motors), strict=True)
    torque, power, drawn = (sum(values) / len(wheels) for values in itertools.islice(zip(*motors, strict=True), 3))
    return AxleMotors(torque, power, drawn, tuple(sum(values) / len(wheels) for values in rates))


def _motor(model: Model, wheel: int, duty: Scalar, omega: Scalar, states: list[Scalar], bus: Scalar) -> AxleMotors:
    parts = _split_states(states, [len(effect.states) for effect in model.motor_effects])
    drive = model.motor.drive(duty, omega)._replace(wheel=wheel, bus_current=bus)
    drive = amend_subject(model.motor_effects, drive, parts)
    current = drive.current
    torque, rates = torque_and_rates(model.motor_effects, drive, drive.constant * current, parts)
    drawn = duty * current
    return AxleMotors(torque, drawn * drive.supply, drawn, tuple(component for rate in rates for component in rate))


def pull_along(model: Model, at: Along) -> Scalar:
    """Return what body effects and a leaning gravity push the rover forwards with [N]."""
    built = model.built
    body = _body(at, *(ca.SX.zeros(number) for number in _joints(model)))
    return sum((effect.push(body).f_x for effect in model.body_effects), built.mass * built.model.gravity.linear[0])


def omitted_effects(model: Model) -> tuple[str, ...]:
    """Return the names of the body effects that do more than the reduced model holds: weight and a push along x."""
    return tuple(type(effect).__name__ for effect in model.body_effects if _acts_elsewhere(model, effect))


def _acts_elsewhere(model: Model, effect: BodyEffect) -> bool:
    at = Along(*(ca.SX.sym(name) for name in Along._fields))
    push = effect.push(_body(at, *(ca.SX.sym("joint", number) for number in _joints(model))))
    others = (push.f_y, push.f_z, push.m_x, push.m_y, push.m_z, *push.joints, push.differential)
    return effect.rise()[1] != 0.0 or any(not ca.SX(component).is_zero() for component in others)


def _joints(model: Model) -> tuple[int, int, int]:
    """Return the numbers of the suspension's angles, of their rates, and of what the differential sees."""
    number = len(suspension_dofs(model.rover))
    return number, number, 2


def _body(at: Along, angles: ca.SX, rates: ca.SX, twist: ca.SX) -> Body:
    """Return the body as the reduced model knows it."""
    places, speeds = (tuple(ca.vertsplit(column)) if column.numel() else () for column in (angles, rates))
    base = {**dict.fromkeys(Body._fields, 0.0), "x": at.x, "z": at.height, "pitch": at.pitch, "v_x": at.v}
    joint_values = {"angles": places, "rates": speeds, "known_rates": speeds, "twist": twist[0], "twist_rate": twist[1]}
    return Body(**{**base, **joint_values, "names": ()})


def _split_states(values: list[Scalar], lengths: list[int]) -> list[tuple[Scalar, ...]]:
    ends = np.cumsum([0, *lengths])
    return [tuple(values[start:end]) for start, end in itertools.pairwise(ends)]
