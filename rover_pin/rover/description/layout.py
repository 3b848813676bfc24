"""Read a rover's TOML, which states the role of each joint of the URDF, the wheel sizes, springs, motor and soil.

`read_layout` reads the TOML and the URDF that it names; `Layout` is the result.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from rover_pin.base.encode import printable
from rover_pin.base.errors import DataError, ParameterError, UrdfError, closest
from rover_pin.base.files.bounded import text
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.quantity import Record, as_float, quantity, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Scalar, Wheel
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.description.joint_forms import JointForms, normalise_urdf
from rover_pin.rover.description.tree import urdf_text

KEYS = (
    *("name", "urdf", "base", "base_rpy", "cut", "tied_sides", "wheels", "wheel", "steering", "suspension"),
    *("differential", "coupled", "held", "springs", "motor", "soil"),
)
"""All keys that a rover's TOML may have. Any other key is refused."""
NEEDED = ("name", "urdf", "base", "wheels", "wheel")
"""The keys that a rover's TOML must have. A TOML without one of them is refused."""


UNSTATED = "the data sheet of the motor: see [motor] in the rover's TOML"
"""Source that is shown for the two numbers of a motor that have no default, because every data sheet states them."""


@dataclass(frozen=True)
class MotorSheet(Record):
    """The data sheet of a wheel's motor: torque and speed of the shaft at full voltage, and the gear to the wheel.

    The stall torque at the wheel is efficiency * gear * stall_torque, and the no-load speed of the wheel is
    no_load_speed / gear. The data sheet of a gear motor states the values at its output, so that gear = 1.

    Source: the straight line of a DC motor between stall torque and no-load speed, which every data sheet has.
    Simplified: the gear's losses are proportional to the torque, also when the wheel drives the motor.

    Examples
    --------
    >>> MotorSheet(stall_torque=12.0, no_load_speed="20rpm").gear
    1.0
    """

    stall_torque: Scalar = quantity(1.0, "N m", UNSTATED, 1e-6, 1e5)
    no_load_speed: Scalar = quantity(2.0, "rad/s", UNSTATED, 1e-3, 1e5)
    voltage: Scalar = quantity(12.0, "V", "assumed: only currents depend on it", 0.1, 1e3)
    gear: Scalar = quantity(1.0, "", "assumed: the data sheet describes the output of a gear motor", 1e-2, 1e5)
    efficiency: Scalar = quantity(1.0, "", "assumed: the data sheet describes the output of a gear motor", 0.05, 1.0)
    rotor_inertia: Scalar = quantity(0.0, "kg m^2", "assumed: none", 0.0, 10.0)


@dataclass(frozen=True)
class Axle:
    """One axle of a rover: the joints of its two wheels, the joints that steer them, and the size of the wheels."""

    name: str
    wheels: tuple[str, str]
    "joints of the left and the right wheel"
    steering: tuple[str | None, str | None]
    """joints that steer the left and the right wheel; None for a wheel that is not steered"""
    wheel: Wheel


@dataclass(frozen=True)
class Layout:
    """The content of a rover's TOML, which names joints, and the text of its URDF."""

    name: str
    file: str
    """name of the URDF file, for error messages"""
    text: str
    """text of the URDF, rewritten by `normalise_urdf`"""
    base: str
    """link whose frame is the base frame of the rover"""
    axles: tuple[Axle, ...]
    """axles in the order from front to rear"""
    suspension: Mapping[str, tuple[str, ...]]
    """name of a suspension angle -> its joints (left, right), or its only joint in the middle"""
    differential: tuple[str, str] | None
    """the two rockers that a differential joins, left and right; None: there is no differential"""
    coupled: tuple[str, ...] = ()
    """joints that only the table [coupled] of the TOML names"""
    springs: tuple[SpringDamper, ...] = ()
    motor: MotorSheet | str | None = None
    soil: Mapping[str, Any] = field(default_factory=dict)
    """table [soil] of the TOML, for drives without another soil from the user"""
    changes: tuple[str, ...] = ()
    """changes of the URDF that `normalise_urdf` made, one sentence for each"""

    @property
    def wheel_joints(self) -> list[str]:
        """Return the names of the wheels' joints, in the order from front to rear, left before right."""
        return [joint for axle in self.axles for joint in axle.wheels]

    @property
    def angles(self) -> dict[str, str]:
        """Return, for every angle of suspension and steering, the name of its column in a trace -> the name of its
        joint.
        """
        return dict(self.channels)

    @property
    def channels(self) -> list[tuple[str, str]]:
        """Return (name of the column in a trace, name of the joint) for every angle of suspension and steering.

        The result is a list and not a mapping, because two tables of a faulty TOML may give one name to two angles;
        `read_layout` refuses such a TOML.
        """
        channels = []
        for name, joints in self.suspension.items():
            ends = [""] if len(joints) == 1 else ["_l", "_r"]
            channels += [(name + end, joint) for end, joint in zip(ends, joints, strict=True)]
        for axle in self.axles:
            sides = zip("lr", axle.steering, strict=True)
            channels += [(f"steer_{axle.name[0]}{side}", joint) for side, joint in sides if joint is not None]
        return channels + [(joint, joint) for joint in self.coupled]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Return the pairs of joints (left, right) that are mirror images of each other. A joint in the middle of the
        rover is paired with itself.
        """
        pairs = [axle.wheels for axle in self.axles]
        pairs += [(a, b) for axle in self.axles for a, b in [axle.steering] if a is not None and b is not None]
        pairs += [(joints[0], joints[-1]) for joints in self.suspension.values()]
        return pairs + [(joint, joint) for joint in self.coupled]


def shipped_toml(name: str) -> Path:
    """Return the path of the TOML of a rover that comes with the package.

    Raises UrdfError: the package has no rover with this name.
    """
    rovers = {file.stem: file for file in rover_folder().glob("*.toml")}
    if name not in rovers:
        raise UrdfError(
            f"There is no rover '{name}': {closest(name, rovers)} For your own rover give the path of its .toml."
        )
    return rovers[name]


def rover_folder() -> Path:
    """Return the folder of the rovers that come with the package: inside the package, or next to it in a checkout."""
    package = Path(str(files("rover_pin")))
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent / "urdf"


def read_layout(path: Path, trust: Trust = Trust()) -> Layout:
    """Return the content of a rover's TOML, with the text of the URDF that it names.

    Parameters
    ----------
    path : path
        The TOML file.
    trust : Trust
        Whether the URDF may lie outside the TOML's folder.

    Raises
    ------
    UrdfError
        A file is missing or lies outside the folder; a key is missing, unknown or has a wrong form; or a joint of the
        URDF cannot take the form that the TOML states.

    Examples
    --------
    >>> layout = read_layout(shipped_toml("cart"))
    >>> [axle.name for axle in layout.axles], len(layout.wheel_joints)
    (['front', 'back'], 4)
    """
    where = path.name
    if path.suffix == ".urdf":
        raise UrdfError(f"{where}: give the .toml that states which joints are wheels, not the URDF itself.")
    table = _table(path)
    # Unknown and missing keys are reported first, because later messages name single entries.
    for key in table:
        if key not in KEYS:
            raise UrdfError(f"{where}: unknown key '{key}': {closest(key, KEYS)}")
    for key in NEEDED:
        if key not in table:
            raise UrdfError(f"{where}: '{key}' is missing; a rover's TOML needs {', '.join(NEEDED)}.")

    # The roles of the joints are read first, because the forms of the joints depend on them.
    axles = _axles(table, where)
    suspension = {
        name: _joints(joints, f"{where}: suspension.{name}", (1, 2))
        for name, joints in part_of(table, "suspension", where).items()
    }
    differential = None
    if "differential" in table:
        pair = str(part_of(table, "differential", where).get("pair", ""))
        if len(suspension.get(pair, ())) != 2:
            pairs = [name for name, members in suspension.items() if len(members) == 2]
            raise UrdfError(
                f"{where}: differential.pair = '{pair}' is no pair of the suspension: {closest(pair, pairs)}"
            )
        differential = (suspension[pair][0], suspension[pair][1])
    forms = read_forms(table, where, axles, suspension, differential)
    named = {*forms.wheels, *forms.steering, *(joint for joints in suspension.values() for joint in joints)}

    # The URDF, which lies next to the TOML, is rewritten into the form that the equation of motion needs.
    urdf = _urdf(path, table["urdf"], trust)
    if not is_file(urdf):
        raise UrdfError(f"{where}: there is no file '{urdf.name}' next to the TOML; correct 'urdf'.")
    normalised = normalise_urdf(urdf_text(urdf), urdf.name, forms)
    layout = Layout(
        name=printable(str(table["name"])),
        file=urdf.name,
        text=normalised.text,
        base=str(table["base"]),
        axles=axles,
        suspension=suspension,
        differential=differential,
        coupled=tuple(joint for joint in forms.pivots if joint not in named),
        springs=read_springs(table, where),
        motor=read_motor(table, where),
        soil=read_soil(table, where),
        changes=normalised.changes,
    )
    # Two angles with one name would be one column of a trace.
    channels = [channel for channel, _ in layout.channels]
    if twice := [channel for channel in channels if channels.count(channel) > 1]:
        raise UrdfError(
            f"{where}: two angles would be called '{twice[0]}': the angles of a pair in [suspension] are called by the "
            "pair's name and _l or _r, and a joint of [coupled] by the joint's name. Rename the pair, or name the "
            "joint in [suspension]."
        )
    return layout


def urdf_folder(path: Path) -> Path:
    """Return the folder of the URDF that a rover's TOML names."""
    return path.parent.joinpath(str(_table(path).get("urdf", ""))).parent


def layout_texts(path: Path, trust: Trust = Trust()) -> tuple[str, ...]:
    """Return the texts of a rover's TOML and of its URDF.

    A rover in the cache is used again only if these texts have not changed. If a file cannot be read, the result is
    empty; `read_layout` then raises an error with the reason.
    """
    try:
        table = _table(path)
        return text(path), text(_urdf(path, table.get("urdf"), trust))
    except (UrdfError, OSError, UnicodeDecodeError):
        return ()


def _urdf(path: Path, name: Any, trust: Trust) -> Path:
    """Return the path of the URDF that a TOML names.

    Raises UrdfError: the URDF lies in a folder that `trust` does not allow.
    """
    try:
        return trust.within(path.parent, name, f"{path.name}: urdf")
    except DataError as error:
        raise UrdfError(str(error)) from error


def _table(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file; raise UrdfError if it is missing or no TOML."""
    if not is_file(path):
        raise UrdfError(f"There is no rover file '{path}'; give the path of a .toml.")
    try:
        return read_toml(path)
    except DataError as error:
        raise UrdfError(str(error)) from error


def _axles(table: Mapping[str, Any], where: str) -> tuple[Axle, ...]:
    """Return the axles of a rover from the tables [wheels], [steering] and [wheel] of its TOML."""
    wheels, steering = part_of(table, "wheels", where), part_of(table, "steering", where)
    # A rover has two axles or more, whose names give the short names of the wheels.
    if len(wheels) < 2:
        raise UrdfError(f"{where}: [wheels] names {len(wheels)} axles; a rover needs two or more, from front to rear.")
    if "" in wheels:
        raise UrdfError(
            f"{where}: an axle of [wheels] has no name; give it a name such as front, because wheels are called by its "
            "first letter."
        )
    for name in wheels:
        if not (name[0].isascii() and name[0].isalnum()):
            raise UrdfError(
                f"{where}: the axle {name!r} of [wheels] must begin with a letter or a digit from a to z or 0 to 9, "
                "because the names of its wheels begin with this character."
            )
    # A wheel is called by the first letter of its axle and its side, for instance fl.
    if len({name[:1] for name in wheels}) < len(wheels):
        raise UrdfError(
            f"{where}: the axles {', '.join(wheels)} must begin with different letters: rename an axle, because wheels "
            "are called by the first letter of their axle."
        )
    for name in steering:
        if name not in wheels:
            raise UrdfError(f"{where}: [steering] has no axle '{name}' to steer: {closest(name, wheels)}")
    # Each axle has a wheel on the left and a wheel on the right, in this order.
    axles = []
    for name, joints in wheels.items():
        single = [joints] if isinstance(joints, str) else joints
        if isinstance(single, list) and len(single) == 1:
            raise UrdfError(
                f"{where}: wheels.{name} = {single[0]!r} has no partner, but the wheels of a rover must be in pairs of "
                "joint names [left, right]. A single wheel or castor that carries little load may be held (in [held]) "
                "or cut; its load then goes to the other wheels."
            )
        pair = _joints(joints, f"{where}: wheels.{name}", (2,))
        steer = _joints(steering[name], f"{where}: steering.{name}", (2,)) if name in steering else (None, None)
        axles.append(Axle(name, (pair[0], pair[1]), (steer[0], steer[1]), _wheel(table, name, where)))
    return tuple(axles)


def _wheel(table: Mapping[str, Any], axle: str, where: str) -> Wheel:
    """Return the size of an axle's wheels from the table [wheel] of the TOML. Numbers in [wheel.AXLE] replace those in
    [wheel] for this axle.
    """
    part = part_of(table, "wheel", where)
    axle_table = part_of(part, axle, f"{where}: wheel")
    dimensions = {**{name: value for name, value in part.items() if name not in table["wheels"]}, **axle_table}
    wheel: Wheel = record_of(Wheel, dimensions, f"{where}: wheel")
    for name in ("r", "b"):
        if name not in dimensions:
            raise UrdfError(f"{where}: [wheel] does not state '{name}' of axle '{axle}'; give both r and b in metres.")
    return wheel


def _joints(value: Any, where: str, counts: tuple[int, ...]) -> tuple[str, ...]:
    """Return the joint names in an entry of the TOML. An error is raised if their number is not among `counts`."""
    joints = (value,) if isinstance(value, str) else value
    if (
        not isinstance(joints, (list, tuple))
        or len(joints) not in counts
        or not all(isinstance(joint, str) for joint in joints)
    ):
        either = "a pair of joint names [left, right]" + (", or one name" if 1 in counts else "")
        raise UrdfError(f"{where} = {value!r} must be {either}.")
    return tuple(joints)


def part_of(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """Return the table with this key in a TOML, or an empty table if the key is missing.

    Raises UrdfError: the value of the key is no table.
    """
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
) -> JointForms:
    """Return the statements of a rover's TOML on the joints of the URDF: roles, held, coupled and removed joints.

    Parameters
    ----------
    table, where : mapping, str
        The content of the TOML, and the name of its file for errors.
    axles : sequence of Axle
        The axles of the rover.
    suspension : mapping
        Name of a suspension angle -> joints (left, right), or the one joint in the middle.
    differential : pair of str or None
        The two rockers, left and right.

    Raises
    ------
    UrdfError
        A table or a number has a wrong form.
    """
    tied = table.get("tied_sides", False)
    if not isinstance(tied, bool):
        raise UrdfError(f"{where}: tied_sides = {tied!r} must be true (the wheels of a side turn together) or false.")
    # Each coupled joint follows another joint, with the ratio of their angles.
    coupled: dict[str, tuple[str, float]] = {}
    for name, entry in part_of(table, "coupled", where).items():
        place = f"{where}: coupled.{name}"
        link = entry if isinstance(entry, Mapping) else {"joint": entry}
        for key in link:
            if key not in ("joint", "ratio"):
                raise UrdfError(f"{place} has no key '{key}': {closest(key, ('joint', 'ratio'))}")
        joint, ratio = link.get("joint"), link.get("ratio", 1.0)
        number = not isinstance(ratio, bool) and isinstance(ratio, (int, float))
        if not isinstance(joint, str) or not number or not 1e-6 <= abs(as_float(ratio)) <= 1e6:
            raise UrdfError(
                f'{place} = {entry!r} must name the joint that it follows: {{ joint = "rocker_l", ratio = -0.5 }}.'
            )
        coupled[name] = joint, float(ratio)
    wheels = tuple(joint for axle in axles for joint in axle.wheels)
    steering = tuple(joint for axle in axles for joint in axle.steering if joint is not None)
    # A coupled joint that is neither wheel nor steering moves with the suspension, so that it is a pivot.
    pivots = [joint for joints in suspension.values() for joint in joints]
    linked = [joint for follower, (leader, _) in coupled.items() for joint in (follower, leader)]
    pivots += [joint for joint in linked if joint not in (*wheels, *steering)]
    cut = table.get("cut", [])
    if not isinstance(cut, (list, tuple)) or not all(isinstance(name, str) for name in cut):
        raise UrdfError(f"{where}: cut = {cut!r} must be a list of joint names.")
    # Roll, pitch and yaw of the base link. An angle beyond a full turn is probably in degrees.
    given, place = table.get("base_rpy", (0.0, 0.0, 0.0)), f"{where}: base_rpy"
    angles = given if isinstance(given, (list, tuple)) else ()
    if len(angles) != 3 or any(isinstance(angle, bool) or not isinstance(angle, (int, float)) for angle in angles):
        raise UrdfError(f"{place} = {given!r} must be roll, pitch and yaw in radians, for example [3.14159, 0.0, 0.0].")
    roll, pitch, yaw = (as_float(angle) for angle in angles)
    if not max(abs(roll), abs(pitch), abs(yaw)) <= 2.0 * math.pi:
        raise UrdfError(
            f"{place} = {given!r} must be angles within a full turn, in radians, for example [3.14159, 0, 0]."
        )
    return JointForms(
        base=str(table["base"]),
        wheels=wheels,
        steering=steering,
        pivots=tuple(dict.fromkeys(pivots)),
        differential=differential,
        sides=tuple(tuple(axle.wheels[side] for axle in axles) for side in (0, 1)) if tied else (),
        held_joints=dict(part_of(table, "held", where)),
        coupled=coupled,
        cut=tuple(cut),
        base_rpy=(roll, pitch, yaw),
    )


def read_springs(table: Mapping[str, Any], where: str) -> tuple[SpringDamper, ...]:
    """Return the springs and dampers of the table [springs] in a rover's TOML. Each has the name of the suspension
    angle on which it acts.

    Raises UrdfError: an entry does not describe a spring, or the table [suspension] does not have its name.
    """
    suspension = part_of(table, "suspension", where)
    # A spring acts on a pair of the suspension, or on one joint of it.
    names = [*suspension, *(f"{name}_{side}" for name in suspension for side in "lr")]
    springs = []
    for name, entry in part_of(table, "springs", where).items():
        if name not in names:
            raise UrdfError(
                f"{where}: [springs] names '{name}', which [suspension] does not have: {closest(name, names)}"
            )
        if not isinstance(entry, Mapping):
            raise UrdfError(f"{where}: springs.{name} = {entry!r} must be a table such as {{ k_s = 50.0, d = 2.0 }}.")
        spring = record_of(SpringDamper, {"k_s": 0.0, "d": 0.0, **entry}, f"{where}: springs.{name}")
        springs.append(spring.replace(joint=name))
    return tuple(springs)


def read_soil(table: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """Return the table [soil] of a rover's TOML. The short form soil = "fjs-1" is returned as a table with this
    name.
    """
    soil = table.get("soil", {})
    return {"name": soil} if isinstance(soil, str) else part_of(table, "soil", where)


def read_motor(table: Mapping[str, Any], where: str) -> MotorSheet | str | None:
    """Return the motor that a rover's TOML states.

    The result is the data sheet in [motor], the name in motor = "speed-like", or None if the TOML states no motor.

    Raises UrdfError: a number is out of bounds, or the stall torque or no-load speed is missing.
    """
    # The motor is missing, a name of a ready-made motor, or a table with the numbers of a data sheet.
    if "motor" not in table:
        return None
    if isinstance(table["motor"], str):
        return table["motor"]
    part = part_of(table, "motor", where)
    for key in ("stall_torque", "no_load_speed"):
        if key not in part:
            raise UrdfError(
                f"{where}: [motor] needs '{key}', which data sheets state; if it is unknown, delete the table."
            )
    sheet: MotorSheet = record_of(MotorSheet, part, f"{where}: motor")
    return sheet


def record_of(kind: Any, entry: Mapping[str, Any], where: str) -> Any:
    """Return an object of the class `kind` (for example a data sheet or a spring), whose fields a table of the TOML
    states.

    Raises UrdfError: the table has an unknown field, or a wrong unit or value.
    """
    try:
        return record_from(kind, entry, where)
    except ParameterError as error:
        raise UrdfError(str(error)) from error
