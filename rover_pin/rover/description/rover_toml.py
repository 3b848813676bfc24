"""The tables of a rover's TOML that say in which form joints are taken, and what rover-wide numbers are."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rover_pin.base.errors import ParameterError, UrdfError, closest
from rover_pin.base.quantity import as_float, record_from
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.description.as_driven import Forms
from rover_pin.rover.description.motor_sheet import MotorSheet


def part_of(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """Return the table under a key, an empty one where there is none; anything else is a `UrdfError`."""
    part = table.get(key, {})
    if not isinstance(part, Mapping):
        raise UrdfError(f"{where}: '{key}' must be a table, written [{key}] on a separate line.")
    return part


def read_forms(
    table: Mapping[str, Any],
    where: str,
    axles: Sequence[Any],
    suspension: Mapping[str, tuple[str, ...]],
    differential: tuple[str, str] | None,
) -> Forms:
    """Return the forms of the joints of a rover's TOML.

    Raises UrdfError: a table or number of the wrong form.
    """
    tied = table.get("tied_sides", False)
    if not isinstance(tied, bool):
        raise UrdfError(f"{where}: tied_sides = {tied!r} must be true, where a side's wheels turn together, or false.")
    coupled = {name: _leader(entry, f"{where}: coupled.{name}") for name, entry in _part(table, "coupled", where)}
    wheels = tuple(joint for axle in axles for joint in axle.wheels)
    pivots = [joint for joints in suspension.values() for joint in joints]
    steering = tuple(joint for axle in axles for joint in axle.steering if joint is not None)
    linked = [joint for follower, (leader, _) in coupled.items() for joint in (follower, leader)]
    pivots += [joint for joint in linked if joint not in (*wheels, *steering)]
    return Forms(
        base=str(table["base"]),
        wheels=wheels,
        steering=steering,
        pivots=tuple(dict.fromkeys(pivots)),
        differential=differential,
        sides=tuple(tuple(axle.wheels[side] for axle in axles) for side in (0, 1)) if tied else (),
        held_joints=dict(_part(table, "held", where)),
        coupled=coupled,
        cut=_names(table.get("cut", []), f"{where}: cut"),
        base_rpy=_rpy(table.get("base_rpy", (0.0, 0.0, 0.0)), f"{where}: base_rpy"),
    )


def read_springs(table: Mapping[str, Any], where: str) -> tuple[SpringDamper, ...]:
    """Return the springs and dampers of [springs], each of the suspension's joint or pair that it is named by.

    Raises UrdfError: something that is no spring, or of no joint.
    """
    suspension = part_of(table, "suspension", where)
    names = [*suspension, *(f"{name}_{side}" for name in suspension for side in "lr")]
    springs = []
    for name, entry in _part(table, "springs", where):
        if name not in names:
            raise UrdfError(f"{where}: [springs] names '{name}', which [suspension] has not: {closest(name, names)}")
        values = {"k_s": 0.0, "d": 0.0, **_table(entry, name, where)}
        springs.append(_record(SpringDamper, values, f"{where}: springs.{name}").replace(joint=name))
    return tuple(springs)


def read_soil(table: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """Return the table [soil]; soil = "fjs-1" stands for one that only has a name."""
    soil = table.get("soil", {})
    return {"name": soil} if isinstance(soil, str) else part_of(table, "soil", where)


def read_motor(table: Mapping[str, Any], where: str) -> MotorSheet | str | None:
    """Return the motor of [motor], or the name in motor = "speed-like", or None where the TOML has none.

    Raises UrdfError: a number that no motor has, or one of the two that every data sheet has is missing.
    """
    if "motor" not in table:
        return None
    if isinstance(table["motor"], str):
        return table["motor"]
    part = part_of(table, "motor", where)
    for key in ("stall_torque", "no_load_speed"):
        if key not in part:
            raise UrdfError(f"{where}: [motor] needs '{key}', as data sheets have it; leave the table out if unknown.")
    sheet: MotorSheet = _record(MotorSheet, part, f"{where}: motor")
    return sheet


def _part(table: Mapping[str, Any], key: str, where: str) -> list[tuple[str, Any]]:
    return list(part_of(table, key, where).items())


def _table(entry: Any, name: str, where: str) -> Mapping[str, Any]:
    if not isinstance(entry, Mapping):
        raise UrdfError(f"{where}: springs.{name} = {entry!r} must be a table, as {{ k_s = 50.0, d = 2.0 }}.")
    return entry


def _record(kind: Any, entry: Mapping[str, Any], where: str) -> Any:
    try:
        return record_from(kind, entry, where)
    except ParameterError as error:
        raise UrdfError(str(error)) from error


def _leader(entry: Any, where: str) -> tuple[str, float]:
    table = entry if isinstance(entry, Mapping) else {"joint": entry}
    for key in table:
        if key not in ("joint", "ratio"):
            raise UrdfError(f"{where} has no key '{key}': {closest(key, ('joint', 'ratio'))}")
    joint, ratio = table.get("joint"), table.get("ratio", 1.0)
    number = not isinstance(ratio, bool) and isinstance(ratio, (int, float))
    if not isinstance(joint, str) or not number or not 1e-6 <= abs(as_float(ratio)) <= 1e6:
        raise UrdfError(f'{where} = {entry!r} must name whom it follows, as {{ joint = "rocker_l", ratio = -0.5 }}.')
    return joint, float(ratio)


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(name, str) for name in value):
        raise UrdfError(f"{where} = {value!r} must be a list of joint names.")
    return tuple(value)


def _rpy(value: Any, where: str) -> tuple[float, float, float]:
    numbers = value if isinstance(value, (list, tuple)) else ()
    if len(numbers) != 3 or any(isinstance(number, bool) or not isinstance(number, (int, float)) for number in numbers):
        raise UrdfError(f"{where} = {value!r} must be roll, pitch and yaw in radians, as [3.14159, 0.0, 0.0].")
    roll, pitch, yaw = (as_float(number) for number in numbers)
    if not max(abs(roll), abs(pitch), abs(yaw)) <= 2.0 * math.pi:
        raise UrdfError(f"{where} = {value!r} must be angles within a full turn, in radians, as [3.14159, 0.0, 0.0].")
    return roll, pitch, yaw
