"""Which joint of a URDF plays which part of a rover: the small TOML beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from rover_pin.bounded import text
from rover_pin.contact import Wheel
from rover_pin.errors import DataError, ParameterError, UrdfError, closest
from rover_pin.paths import is_file
from rover_pin.quantity import record_from
from rover_pin.toml_file import read_toml
from rover_pin.trust import Trust

KEYS = ("name", "urdf", "base", "wheels", "wheel", "steering", "suspension", "differential")
NEEDED = ("name", "urdf", "base", "wheels", "wheel")


@dataclass(frozen=True)
class Axle:
    """The joints of an axle's left and right wheel, and those that steer them."""

    name: str
    wheels: tuple[str, str]
    steering: tuple[str | None, str | None]


@dataclass(frozen=True)
class Layout:
    """A rover's TOML, read: names of joints only; `text` is the URDF's and `file` its name for messages."""

    name: str
    file: str
    text: str
    base: str
    axles: tuple[Axle, ...]
    wheel: Wheel
    suspension: Mapping[str, tuple[str, ...]]
    "channel -> joints (left, right), or the one joint in the middle"
    differential: tuple[str, str] | None

    @property
    def wheel_joints(self) -> list[str]:
        """The wheels' joints, from front to rear, left before right."""
        return [joint for axle in self.axles for joint in axle.wheels]

    @property
    def angles(self) -> dict[str, str]:
        """Channel -> joint of every suspension and steering angle."""
        made = {}
        for name, joints in self.suspension.items():
            ends = [""] if len(joints) == 1 else ["_l", "_r"]
            made.update({name + end: joint for end, joint in zip(ends, joints, strict=True)})
        for axle in self.axles:
            for side, joint in zip("lr", axle.steering, strict=True):
                if joint is not None:
                    made[f"steer_{axle.name[0]}{side}"] = joint
        return made

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """The joints (left, right) that are each other's mirror image; one in the middle is its own."""
        made = [axle.wheels for axle in self.axles]
        made += [(a, b) for axle in self.axles for a, b in [axle.steering] if a is not None and b is not None]
        return made + [(joints[0], joints[-1]) for joints in self.suspension.values()]


def shipped(name: str) -> Path:
    """Return the TOML of a rover that comes with the package.

    Raises
    ------
    UrdfError
        There is none of this name.
    """
    folder = rover_folder()
    path = folder / f"{name}.toml"
    if not is_file(path):
        known = [each.stem for each in folder.glob("*.toml")]
        raise UrdfError(
            f"There is no rover '{name}': {closest(name, known)} For one of your own give the path of its .toml."
        )
    return path


def rover_folder() -> Path:
    """Return the folder of the rovers that come with the package: inside it, or beside it in a checkout."""
    package = Path(str(files("rover_pin")))
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent / "urdf"


def read_layout(path: Path, trust: Trust = Trust()) -> Layout:
    """Return the layout in a TOML, with the text of its URDF, which lies in its folder unless `trust` allows more.

    Raises
    ------
    UrdfError
        A missing file, one elsewhere, a key that is missing, unknown or of the wrong form.
    """
    where = path.name
    if path.suffix == ".urdf":
        raise UrdfError(f"{where}: give the .toml that says which of its joints are wheels, not the URDF itself.")
    table = _table(path)
    _check_keys(table, where)
    axles, suspension = _axles(table, where), _suspension(table, where)
    urdf = _urdf(path, table["urdf"], trust)
    return Layout(
        name=str(table["name"]),
        file=urdf.name,
        text=_urdf_text(urdf, where),
        base=str(table["base"]),
        axles=axles,
        wheel=_wheel(table, where),
        suspension=suspension,
        differential=_differential(table, suspension, where),
    )


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


def _urdf_text(urdf: Path, where: str) -> str:
    if not is_file(urdf):
        raise UrdfError(f"{where}: there is no file '{urdf.name}' beside it; mend 'urdf'.")
    try:
        return text(urdf)
    except UnicodeDecodeError as error:
        raise UrdfError(f"{urdf.name}: not a text file in UTF-8 ({error}).") from error
    except OSError as error:
        raise UrdfError(f"{urdf.name}: the file cannot be read: {error.strerror}.") from error


def _wheel(table: Mapping[str, Any], where: str) -> Wheel:
    try:
        return record_from(Wheel, _part(table, "wheel", where), f"{where}: wheel")
    except ParameterError as error:
        raise UrdfError(str(error)) from error


def _table(path: Path) -> dict[str, Any]:
    if not is_file(path):
        raise UrdfError(f"There is no rover file '{path}'; give the path of a .toml.")
    try:
        return read_toml(path)
    except DataError as error:
        raise UrdfError(str(error)) from error


def _part(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    part = table.get(key, {})
    if not isinstance(part, Mapping):
        raise UrdfError(f"{where}: '{key}' must be a table, written [{key}] on a line of its own.")
    return part


def _axles(table: Mapping[str, Any], where: str) -> tuple[Axle, ...]:
    wheels, steering = _part(table, "wheels", where), _part(table, "steering", where)
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
    made = []
    for name, joints in wheels.items():
        pair = _joints(joints, f"{where}: wheels.{name}", (2,))
        steer = _joints(steering[name], f"{where}: steering.{name}", (2,)) if name in steering else (None, None)
        made.append(Axle(name, (pair[0], pair[1]), (steer[0], steer[1])))
    return tuple(made)


def _suspension(table: Mapping[str, Any], where: str) -> dict[str, tuple[str, ...]]:
    part = _part(table, "suspension", where)
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
    pair = str(_part(table, "differential", where).get("pair", ""))
    joints = suspension.get(pair, ())
    if len(joints) != 2:
        known = [name for name, each in suspension.items() if len(each) == 2]
        raise UrdfError(f"{where}: differential.pair = '{pair}' is no pair of the suspension: {closest(pair, known)}")
    return joints[0], joints[1]
