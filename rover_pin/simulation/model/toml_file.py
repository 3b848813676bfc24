"""A model of a driving rover as a TOML file, written with units and read back to equal numbers.

kind = "drive-model"
note = "where the model comes from"
rover = "nexus6"                          # or the path of a rover's TOML, relative to this file
gravity = { value = 9.81, unit = "m/s^2" }
[motor]
supply = { value = 7.2, unit = "V" }      # ...
[slip]
name = "RelaxedSlip"
[terrain]                                 # optional, as in a drive log; its files lie in the same folder
polyline = "terrain.csv"
[[soil]]                                  # the usual ground, then one for each further ground index
phi = { value = 30.0, unit = "deg" }
[[effect]]                                # effects of all kinds, in the order of their action
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
from rover_pin.rover.rover import load_named
from rover_pin.simulation.model.effect_files import AnyEffect, effect_entry, effect_from, file_of, offered_effects
from rover_pin.simulation.model.model import BURIED, Model
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.files import terrain_from, write_terrain
from rover_pin.terrain.terrain import Terrain

KIND, RIG_KIND = "drive-model", "rig-model"
"""Values of the key `kind` in a model file: KIND for the model of a driving rover, RIG_KIND for the model of a wheel on
a test rig. The soil and the contact effects of a rig's model can be used for a rover."""
TABLES = ("motor", "slip", "terrain")
LISTS = ("soil", "effect")
KEYS = ("kind", "note", "rover", "gravity", "buried", *TABLES, *LISTS)
"""Keys that a model file may have. The values of the keys in TABLES are tables, the values of the keys in LISTS are
lists of tables."""


def write_model(model: Model, path: str | Path, note: str = "", rover: str = "", with_terrain: bool = False) -> Path:
    """Write a model to a TOML file, and return the file's path. `read_model` reads a model with equal numbers from it.

    Parameters
    ----------
    model : Model
        The model to write.
    path : str or Path
        The file.
    note : str
        A remark on the origin of the model.
    rover : str
        Path of the rover's TOML; needed if the rover does not come with the package.
    with_terrain : bool
        Also write the terrain, to files in the folder of the model. Without it, the reader of the file has to give a
        terrain.

    Raises
    ------
    DataError
        The rover's path is missing, or a file cannot be written.
    ParameterError
        A quantity is a CasADi expression, which has no number to write.

    Examples
    --------
    >>> import tempfile
    >>> from rover_pin import scenario
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_model(scenario("flat").model, f"{folder}/model.toml", note="my rover").name
    'model.toml'
    """
    path, name = Path(path), rover or model.rover.name
    if not rover and not (rover_folder() / f"{name}.toml").is_file():
        raise DataError(f"{path}: rover '{name}' does not come with the package: give the path of its TOML as `rover`.")
    effects: list[AnyEffect] = [*model.effects, *model.motor_effects, *model.body_effects, *model.sensor_effects]
    # Keys without a value are not written.
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
        "effect": [effect_entry(effect) for effect in effects],
    }
    return replace_file(path, toml_text(table))


def models_of(path: str | Path) -> tuple[Path, ...]:
    """Return the paths of model files. If `path` is a file, the result is this path alone. If `path` is a folder, for
    example the folder `posterior` that `close-loop` writes, the result contains all model files in it.

    Raises DataError: the folder has no .toml file.
    """
    path = Path(path)
    if not path.is_dir():
        return (path,)
    files = tuple(sorted(path.glob("*.toml")))
    if not files:
        raise DataError(
            f"{path}: the folder contains no model file (.toml): give the path of a model file, or the folder "
            "`posterior` that `close-loop` has written."
        )
    return files


def read_model(path: str | Path, terrain: Terrain | None = None, trust: Trust = Trust()) -> Model:
    """Return the model of a driving rover that a TOML file describes.

    Parameters
    ----------
    path : str or Path
        The file.
    terrain : Terrain, optional
        The ground to drive on; if missing, the terrain that the file declares.
    trust : Trust
        The files of users' effects whose code may run, and the terrain files outside the model's folder that may be
        read.

    Raises
    ------
    DataError
        The file is no model file, has an unknown key or effect or no terrain, or names a file that is not trusted or
        cannot be read or run.
    ParameterError
        A field, unit or value is unknown or beyond its limits.
    UrdfError
        The rover cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from rover_pin import scenario
    >>> flat = scenario("flat").model
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = read_model(write_model(flat, f"{folder}/model.toml"), flat.terrain)
    >>> again.motor == flat.motor and again.effects == flat.effects
    True
    """
    path = Path(path)
    table = _check_table(path, read_toml(path))
    if terrain is None and "terrain" not in table:
        raise DataError(f"{path}: the file has no [terrain]: add one, or give a terrain to drive on.")
    # Rover and effects first: an effect may name a wheel of the rover.
    rover = load_named(str(table.get("rover", "nexus6")), path, trust)
    effects = [effect_from(entry, f"{path} [[effect]]", path.parent, trust) for entry in table.get("effect", [])]
    for effect in effects:
        # An effect on a wheel that the rover does not have would do nothing.
        wheel, names = getattr(effect, "wheel", None), [mount.name for mount in rover.wheels]
        where = f"{path} [[effect]] {type(effect).__name__}: wheel = {wheel!r}"
        if isinstance(wheel, int) and not 0 <= wheel < len(names):
            raise ParameterError(
                f"{where}, but rover '{rover.name}' has the wheels 0 to {len(names) - 1}: give one of these numbers."
            )
        if isinstance(wheel, str) and wheel and wheel not in names:
            raise ParameterError(f"{where} is no wheel of rover '{rover.name}': {closest(wheel, names)}")
    # The law of slip is an effect too, with a table of its own.
    slip_entry = table.get("slip", {"name": "RelaxedSlip"})
    slip = effect_from(slip_entry, f"{path} [slip]", path.parent, trust)
    if not isinstance(slip, (AlgebraicSlip, RelaxedSlip)):
        raise DataError(
            f"{path} [slip]: {slip_entry.get('name')} is no law of slip: give AlgebraicSlip or RelaxedSlip."
        )
    # TOML has numbers and truth values; only numbers are allowed here.
    buried = table.get("buried", BURIED)
    if isinstance(buried, bool) or not isinstance(buried, (int, float)):
        raise DataError(
            f"{path}: buried = {buried!r} is not a number; give the sinkage divided by the wheel radius at which a "
            "drive ends, such as 0.5."
        )
    return Model(
        rover,
        terrain_from(table["terrain"], path, trust) if terrain is None else terrain,
        tuple(record_from(Soil, soil, f"{path} [[soil]]") for soil in table.get("soil", [{}])),
        record_from(Motor, table.get("motor", {}), f"{path} [motor]"),
        slip,
        tuple(effect for effect in effects if isinstance(effect, Effect)),
        tuple(effect for effect in effects if isinstance(effect, MotorEffect)),
        gravity_from(table.get("gravity", EARTH), str(path)),
        tuple(effect for effect in effects if isinstance(effect, BodyEffect)),
        tuple(effect for effect in effects if isinstance(effect, SensorEffect)),
        buried=float(buried),
    )


def model_files(path: str | Path) -> tuple[Path, ...]:
    """Return the paths of all files that belong to a model: the model file, the rover's TOML and URDF if the model file
    names their path, and the files of users' effects.

    Raises DataError, UrdfError: the file is no model file, or the rover's files cannot be read.
    """
    path = Path(path)
    table = read_toml(path)
    # The model of a rig has no rover.
    if table.get("kind") == RIG_KIND:
        return (path, *_effect_files(path, table))
    _check_table(path, table)
    rover = path.parent / str(table.get("rover", "nexus6"))
    files = [path, *((rover, rover.parent / read_layout(rover, Trust(everything=True)).file) if is_file(rover) else ())]
    return (*files, *_effect_files(path, table))


def is_rig_model(path: str | Path) -> bool:
    """Return whether a model file describes a wheel on a test rig instead of a driving rover."""
    return read_toml(Path(path)).get("kind") == RIG_KIND


def _effect_files(path: Path, table: dict[str, Any]) -> list[Path]:
    """Return the paths of the Python files with effects from outside the package that a model file names."""
    files: list[Path] = []
    entries = [table.get("slip", {}), *table.get("effect", [])]
    if names := {entry.get("name") for entry in entries if "package" in entry}:
        files += [file_of(kind) for kind in offered_effects() if kind.__name__ in names]
    for file in (path.parent / str(entry["file"]) for entry in entries if "file" in entry):
        files += sorted(file.glob("*.py")) if file.is_dir() else [file]
    return files


def _check_table(path: Path, table: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a model file after a check. An error is raised if the file does not describe a driving
    rover, has an unknown key, or has a value of a wrong form.
    """
    if table.get("kind") != KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a driving rover's model; write kind = '{KIND}'.")
    for key, value in table.items():
        if key not in KEYS:
            raise DataError(f"{path}: there is no key '{key}' in a model: {closest(key, KEYS)}")
        if key in TABLES and not isinstance(value, dict):
            raise DataError(f"{path}: {key} = {value!r} must be a table, which begins with the line [{key}].")
        if key in LISTS and not (isinstance(value, list) and all(isinstance(entry, dict) for entry in value)):
            raise DataError(
                f"{path}: {key} = {value!r} must be a list of tables, each of which begins with the line [[{key}]]."
            )
    return table
