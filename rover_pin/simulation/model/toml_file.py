"""A model of a driving rover as a TOML file: written with units, read back to the same numbers.

kind = "drive-model"
note = "what it came from"
rover = "nexus6"                          # or the path of a rover's TOML, from the file's folder
gravity = { value = 9.81, unit = "m/s^2" }
[motor]
supply = { value = 7.2, unit = "V" }      # ...
[slip]
name = "RelaxedSlip"
[terrain]                                 # optional, as in a drive log: its files stand beside
polyline = "terrain.csv"
[[soil]]                                  # the ground, then what the terrain's ground index names
phi = { value = 30.0, unit = "deg" }
[[effect]]                                # of any kind, in the order in which they act
name = "WeakMotor"
wheel = 2
g = 0.1
"""

from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import as_table, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.parameters.gravity import EARTH, gravity_from
from rover_pin.rover.description.layout import read_layout, rover_folder
from rover_pin.rover.rover import Rover, load_named
from rover_pin.simulation.model.effect_files import AnyEffect, effect_entry, effect_from
from rover_pin.simulation.model.model import BURIED, Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.terrain import Terrain
from rover_pin.terrain.toml_table import terrain_from, write_terrain

KIND, RIG_KIND = "drive-model", "rig-model"
"""A driving rover's model; a wheel's on a rig, which gives a rover its soil and contact effects."""
TABLES = ("motor", "slip", "terrain")
LISTS = ("soil", "effect")
KEYS = ("kind", "note", "rover", "gravity", "buried", *TABLES, *LISTS)


def write_model(model: Model, path: str | Path, note: str = "", rover: str = "", with_terrain: bool = False) -> Path:
    """Write a model; return the file's path.

    Parameters
    ----------
    rover : str
        Path of the rover's TOML, where it is not one that comes with the package.
    with_terrain : bool
        Write the terrain's files beside it as well; without, a reader gives the terrain.

    Raises
    ------
    DataError
        A rover of one's own without its path, a quantity that is an expression, or a file that cannot be written.
    """
    path, name = Path(path), rover or model.rover.name
    if not rover and not (rover_folder() / f"{name}.toml").is_file():
        raise DataError(f"{path}: rover '{name}' does not come with the package: give the path of its TOML as `rover`.")
    table = {
        "kind": KIND,
        "note": note,
        "rover": name,
        "gravity": {"value": float(model.gravity), "unit": "m/s^2"},
        "buried": float(model.buried),
        "motor": as_table(model.motor),
        "slip": effect_entry(model.slip),
        "terrain": write_terrain(path.parent, model.terrain) if with_terrain else None,
        "soil": [as_table(soil) for soil in model.soils],
        "effect": [effect_entry(effect) for effect in _effects(model)],
    }
    return replace_file(path, toml_text(table))


def _effects(model: Model) -> tuple[AnyEffect, ...]:
    return (*model.effects, *model.motor_effects, *model.body_effects, *model.sensor_effects)


def models_of(path: str | Path) -> tuple[Path, ...]:
    """Return a model file, or all those of a folder, as the loop's `posterior`.

    Raises DataError: a folder without a .toml file.
    """
    path = Path(path)
    if not path.is_dir():
        return (path,)
    files = tuple(sorted(path.glob("*.toml")))
    if not files:
        raise DataError(f"{path}: no model file (.toml) is here: name one, or the folder `posterior` of a loop.")
    return files


def read_model(path: str | Path, terrain: Terrain | None = None, trust: Trust = Trust()) -> Model:
    """Return the model of a file, on `terrain`, else on the one that the file declares.

    The code of a user's effect runs, and a terrain's file lies outside the model's folder, only as `trust` allows.

    Raises DataError: not a model file, an unknown key or effect, no terrain, or a file that is not trusted or cannot be
    read or run.
    Raises ParameterError: an unknown field, unit or value, or one out of bounds.
    Raises UrdfError: a rover that cannot be read.
    """
    path = Path(path)
    table = _check_table(path, read_toml(path))
    if terrain is None and "terrain" not in table:
        raise DataError(f"{path}: the file has no [terrain]: add one, or give a terrain to drive on.")
    rover = load_named(str(table.get("rover", "nexus6")), path, trust)
    effects = [effect_from(entry, f"{path} [[effect]]", path.parent, trust) for entry in table.get("effect", [])]
    for effect in effects:
        _refuse_other_wheel(effect, rover, path)
    return Model(
        rover,
        terrain_from(table["terrain"], path, trust) if terrain is None else terrain,
        tuple(record_from(Soil, soil, f"{path} [[soil]]") for soil in table.get("soil", [{}])),
        record_from(Motor, table.get("motor", {}), f"{path} [motor]"),
        _slip(table.get("slip", {"name": "RelaxedSlip"}), path, trust),
        tuple(effect for effect in effects if isinstance(effect, Effect)),
        tuple(effect for effect in effects if isinstance(effect, MotorEffect)),
        gravity_from(table.get("gravity", EARTH), str(path)),
        tuple(effect for effect in effects if isinstance(effect, BodyEffect)),
        tuple(effect for effect in effects if isinstance(effect, SensorEffect)),
        buried=_read_buried(table, path),
    )


def _read_buried(table: dict[str, Any], path: Path) -> float:
    value = table.get("buried", BURIED)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DataError(
            f"{path}: buried = {value!r} is not a number; give the sinkage over the wheel's radius, as 0.5."
        )
    return float(value)


def model_files(path: str | Path) -> tuple[Path, ...]:
    """Return every file that makes a model: its own, a rover's beside it, and those of a user's effects.

    Raises DataError, UrdfError: not a model file, or a rover's that cannot be read.
    """
    path = Path(path)
    table = read_toml(path)
    if table.get("kind") == RIG_KIND:
        return (path, *_effect_files(path, table))
    _check_table(path, table)
    rover = path.parent / str(table.get("rover", "nexus6"))
    files = [path, *((rover, rover.parent / read_layout(rover, Trust(everything=True)).file) if is_file(rover) else ())]
    return (*files, *_effect_files(path, table))


def is_rig_model(path: str | Path) -> bool:
    """Return whether a model file is a wheel's on a rig."""
    return read_toml(Path(path)).get("kind") == RIG_KIND


def _effect_files(path: Path, table: dict[str, Any]) -> list[Path]:
    files: list[Path] = []
    entries = [table.get("slip", {}), *table.get("effect", [])]
    for file in (path.parent / str(entry["file"]) for entry in entries if "file" in entry):
        files += sorted(file.glob("*.py")) if file.is_dir() else [file]
    return files


def _check_table(path: Path, table: dict[str, Any]) -> dict[str, Any]:
    if table.get("kind") != KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a driving rover's model; write kind = '{KIND}'.")
    for key, value in table.items():
        if key not in KEYS:
            raise DataError(f"{path}: there is no key '{key}' in a model: {closest(key, KEYS)}")
        if key in TABLES and not isinstance(value, dict):
            raise DataError(f"{path}: {key} = {value!r} must be a table, as [{key}].")
        if key in LISTS and not (isinstance(value, list) and all(isinstance(entry, dict) for entry in value)):
            raise DataError(f"{path}: {key} = {value!r} must be a list of tables, as [[{key}]].")
    return table


def _slip(entry: dict[str, Any], path: Path, trust: Trust) -> AlgebraicSlip | RelaxedSlip:
    slip = effect_from(entry, f"{path} [slip]", path.parent, trust)
    if not isinstance(slip, (AlgebraicSlip, RelaxedSlip)):
        raise DataError(f"{path} [slip]: {entry.get('name')} is no law of slip: give AlgebraicSlip or RelaxedSlip.")
    return slip


def _refuse_other_wheel(effect: AnyEffect, rover: Rover, path: Path) -> None:
    """Refuse an effect of a wheel that the rover has not: it would do nothing."""
    wheel, names = getattr(effect, "wheel", None), [mount.name for mount in rover.wheels]
    where = f"{path} [[effect]] {type(effect).__name__}: wheel = {wheel!r}"
    if isinstance(wheel, int) and not 0 <= wheel < len(names):
        raise ParameterError(f"{where}, but rover '{rover.name}' has the wheels 0 to {len(names) - 1}.")
    if isinstance(wheel, str) and wheel and wheel not in names:
        raise ParameterError(f"{where} is no wheel of rover '{rover.name}': {closest(wheel, names)}")
