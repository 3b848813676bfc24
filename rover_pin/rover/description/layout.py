"""Which joint of a URDF plays which part of a rover: the small TOML beside it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, UrdfError, closest
from rover_pin.base.files.bounded import text
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.quantity import record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Wheel
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.description.as_driven import as_driven
from rover_pin.rover.description.motor_sheet import MotorSheet
from rover_pin.rover.description.rover_toml import part_of, read_forms, read_motor, read_soil, read_springs
from rover_pin.rover.description.tree import urdf_text

KEYS = (
    *("name", "urdf", "base", "base_rpy", "cut", "tied_sides", "wheels", "wheel", "steering", "suspension"),
    *("differential", "coupled", "held", "springs", "motor", "soil"),
)
NEEDED = ("name", "urdf", "base", "wheels", "wheel")


@dataclass(frozen=True)
class Axle:
    """The joints of an axle's left and right wheel, and those that steer them; the wheels' size."""

    name: str
    wheels: tuple[str, str]
    steering: tuple[str | None, str | None]
    wheel: Wheel


@dataclass(frozen=True)
class Layout:
    """A rover's TOML, read: names of joints only; `file` is the URDF's name for messages."""

    name: str
    file: str
    text: str
    "the URDF's, as it is driven: see `as_driven`"
    base: str
    axles: tuple[Axle, ...]
    suspension: Mapping[str, tuple[str, ...]]
    "channel -> joints (left, right), or the one joint in the middle"
    differential: tuple[str, str] | None
    coupled: tuple[str, ...] = ()
    "joints that the TOML lets follow others and that are in no table besides"
    springs: tuple[SpringDamper, ...] = ()
    motor: MotorSheet | str | None = None
    soil: Mapping[str, Any] = field(default_factory=dict)
    "[soil] as it is written: the ground to drive on where nothing else is said"
    changes: tuple[str, ...] = ()
    "what was changed in the URDF, a sentence each"

    @property
    def wheel_joints(self) -> list[str]:
        """The wheels' joints, from front to rear, left before right."""
        return [joint for axle in self.axles for joint in axle.wheels]

    @property
    def angles(self) -> dict[str, str]:
        """Channel -> joint of every suspension and steering angle."""
        return dict(self.channels)

    @property
    def channels(self) -> list[tuple[str, str]]:
        """Channel and joint of every suspension and steering angle; no channel may be there twice."""
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
        """The joints (left, right) that are each other's mirror image; one in the middle is its own."""
        pairs = [axle.wheels for axle in self.axles]
        pairs += [(a, b) for axle in self.axles for a, b in [axle.steering] if a is not None and b is not None]
        pairs += [(joints[0], joints[-1]) for joints in self.suspension.values()]
        return pairs + [(joint, joint) for joint in self.coupled]


def shipped_toml(name: str) -> Path:
    """Return the TOML of a rover that comes with the package.

    Raises UrdfError: there is none of this name.
    """
    rovers = {file.stem: file for file in rover_folder().glob("*.toml")}
    if name not in rovers:
        raise UrdfError(
            f"There is no rover '{name}': {closest(name, rovers)} For one of your own give the path of its .toml."
        )
    return rovers[name]


def rover_folder() -> Path:
    """Return the folder of the rovers that come with the package: inside it, or beside it in a checkout."""
    package = Path(str(files("rover_pin")))
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent / "urdf"


def read_layout(path: Path, trust: Trust = Trust()) -> Layout:
    """Return the layout in a TOML, with the text of its URDF, which lies in its folder unless `trust` allows more.

    Raises UrdfError: a missing file, one elsewhere, a key that is missing, unknown or of the wrong form.
    """
    where = path.name
    if path.suffix == ".urdf":
        raise UrdfError(f"{where}: give the .toml that says which of its joints are wheels, not the URDF itself.")
    table = _table(path)
    _check_keys(table, where)
    axles, suspension = _axles(table, where), _suspension(table, where)
    differential = _differential(table, suspension, where)
    forms = read_forms(table, where, axles, suspension, differential)
    named = {*forms.wheels, *forms.steering, *(joint for joints in suspension.values() for joint in joints)}
    urdf = _urdf(path, table["urdf"], trust)
    if not is_file(urdf):
        raise UrdfError(f"{where}: there is no file '{urdf.name}' beside it; mend 'urdf'.")
    driven = as_driven(urdf_text(urdf), urdf.name, forms)
    layout = Layout(
        name=str(table["name"]),
        file=urdf.name,
        text=driven.text,
        base=str(table["base"]),
        axles=axles,
        suspension=suspension,
        differential=differential,
        coupled=tuple(joint for joint in forms.pivots if joint not in named),
        springs=read_springs(table, where),
        motor=read_motor(table, where),
        soil=read_soil(table, where),
        changes=driven.changes,
    )
    channels = [channel for channel, _ in layout.channels]
    if twice := [channel for channel in channels if channels.count(channel) > 1]:
        raise UrdfError(
            f"{where}: two angles would be called '{twice[0]}'; a pair of [suspension] is called by its name and _l or "
            "_r, a joint of [coupled] by its own: rename the pair, or name the joint in [suspension]."
        )
    return layout


def urdf_folder(path: Path) -> Path:
    """Return the folder of the URDF that a rover's TOML names."""
    return path.parent.joinpath(str(_table(path).get("urdf", ""))).parent


def layout_texts(path: Path, trust: Trust = Trust()) -> tuple[str, ...]:
    """Return the texts of a TOML and its URDF; nothing where they cannot be read, of which `read_layout` says why."""
    try:
        table = _table(path)
        return text(path), text(_urdf(path, table.get("urdf"), trust))
    except (UrdfError, OSError, UnicodeDecodeError):
        return ()


def _check_keys(table: Mapping[str, Any], where: str) -> None:
    for key in table:
        if key not in KEYS:
            raise UrdfError(f"{where}: unknown key '{key}': {closest(key, KEYS)}")
    for key in NEEDED:
        if key not in table:
            raise UrdfError(f"{where}: '{key}' is missing; a rover's TOML needs {', '.join(NEEDED)}.")


def _urdf(path: Path, name: Any, trust: Trust) -> Path:
    try:
        return trust.within(path.parent, name, f"{path.name}: urdf")
    except DataError as error:
        raise UrdfError(str(error)) from error


def _wheel(table: Mapping[str, Any], axle: str, where: str) -> Wheel:
    """Return the size of an axle's wheels: what [wheel] says, and what [wheel.AXLE] says otherwise."""
    part = part_of(table, "wheel", where)
    axle_table = part_of(part, axle, f"{where}: wheel")
    dimensions = {**{name: value for name, value in part.items() if name not in table["wheels"]}, **axle_table}
    try:
        wheel: Wheel = record_from(Wheel, dimensions, f"{where}: wheel")
    except ParameterError as error:
        raise UrdfError(str(error)) from error
    for name in ("r", "b"):
        if name not in dimensions:
            raise UrdfError(f"{where}: [wheel] does not say '{name}' of axle '{axle}'; write both r and b in metres.")
    return wheel


def _table(path: Path) -> dict[str, Any]:
    if not is_file(path):
        raise UrdfError(f"There is no rover file '{path}'; give the path of a .toml.")
    try:
        return read_toml(path)
    except DataError as error:
        raise UrdfError(str(error)) from error


def _axles(table: Mapping[str, Any], where: str) -> tuple[Axle, ...]:
    wheels, steering = part_of(table, "wheels", where), part_of(table, "steering", where)
    if len(wheels) < 2:
        raise UrdfError(f"{where}: [wheels] names {len(wheels)} axles; a rover needs two or more, from front to rear.")
    if "" in wheels:
        raise UrdfError(f"{where}: an axle of [wheels] has no name; give it one, as front: wheels go by its letter.")
    if len({name[:1] for name in wheels}) < len(wheels):
        raise UrdfError(
            f"{where}: the axles {', '.join(wheels)} begin with the same letter; rename one, wheels go by it."
        )
    for name in steering:
        if name not in wheels:
            raise UrdfError(f"{where}: [steering] has no axle '{name}' to steer: {closest(name, wheels)}")
    axles = []
    for name, joints in wheels.items():
        _refuse_single(name, joints, where)
        pair = _joints(joints, f"{where}: wheels.{name}", (2,))
        steer = _joints(steering[name], f"{where}: steering.{name}", (2,)) if name in steering else (None, None)
        axles.append(Axle(name, (pair[0], pair[1]), (steer[0], steer[1]), _wheel(table, name, where)))
    return tuple(axles)


def _refuse_single(name: str, joints: Any, where: str) -> None:
    single = [joints] if isinstance(joints, str) else joints
    if isinstance(single, list) and len(single) == 1:
        raise UrdfError(
            f"{where}: wheels.{name} = {single[0]!r} has no partner, it must be a pair of joint names [left, right]: "
            "rovers here have their wheels in pairs; a single wheel or castor that carries little may be held, in "
            "[held], or cut, with what it would carry left to the others."
        )


def _suspension(table: Mapping[str, Any], where: str) -> dict[str, tuple[str, ...]]:
    part = part_of(table, "suspension", where)
    return {name: _joints(joints, f"{where}: suspension.{name}", (1, 2)) for name, joints in part.items()}


def _joints(value: Any, where: str, counts: tuple[int, ...]) -> tuple[str, ...]:
    joints = (value,) if isinstance(value, str) else value
    if (
        not isinstance(joints, (list, tuple))
        or len(joints) not in counts
        or not all(isinstance(j, str) for j in joints)
    ):
        either = "a pair of joint names [left, right]" + (", or one name" if 1 in counts else "")
        raise UrdfError(f"{where} = {value!r} must be {either}.")
    return tuple(joints)


def _differential(
    table: Mapping[str, Any], suspension: Mapping[str, tuple[str, ...]], where: str
) -> tuple[str, str] | None:
    if "differential" not in table:
        return None
    pair = str(part_of(table, "differential", where).get("pair", ""))
    joints = suspension.get(pair, ())
    if len(joints) != 2:
        pairs = [name for name, members in suspension.items() if len(members) == 2]
        raise UrdfError(f"{where}: differential.pair = '{pair}' is no pair of the suspension: {closest(pair, pairs)}")
    return joints[0], joints[1]
