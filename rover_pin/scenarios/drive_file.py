"""A drive as a TOML file: the name of a scenario, and settings of the drive.

kind = "drive"                            # optional
scenario = "ditch"                        # a name of rover-pin list scenarios
rover = "nexus6"                          # or the path of a rover's TOML
soil = "slope-sand"
"soil.k" = "5mm"                          # every setting of rover-pin list settings, as in --set
"terrain.wall_angle_deg" = 40
add = ["DiggingMemory.c_d=0.1"]           # effects, as in --add
control = "camera"
"control.seed" = 1
duration = 30.0                           # s

In TOML a key can be a value or a table, but not both. If a file has `soil` and `soil.k`, the dotted key must therefore
be in quotes. Without such a pair, `soil.k` without quotes and a table `[soil]` mean the same.

A path in the file refers to the folder of the file, so that a folder with a drive, its rover and its ground can be
moved. Reading a file runs no code, and a file cannot give consent (see `Trust`).
"""

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import named_from
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.trust import Trust
from rover_pin.version import __version__

KIND = "drive"
"""Value of the key `kind` of a drive file. The key may be missing."""
SUFFIX = ".toml"
"""Suffix by which the path of a drive file is distinguished from the name of a scenario."""
PATHS = ("model", "terrain.path", "control.gains")
"""Settings whose value is always the path of a file."""
NAMES_OR_PATHS = ("rover", "control")
"""Settings whose value is a word, or the path of a file. A value with a suffix, such as `my_rover.toml`, is a path."""
BELIEF = "control.believes"
"""Setting whose value is a word, or the path of a file or folder. A value with a suffix or a slash is a path."""
ROUTE = "control.route"
"""Setting whose value is the path of a file, or way-points. A value with a comma has way-points."""


class DriveFile(NamedTuple):
    """The content of a drive file."""

    scenario: str
    "name of the scenario"
    settings: dict[str, Any]
    """name of a setting, such as `soil.k` -> its value: a number, a text, True or False"""


def is_drive_file(name: str | Path) -> bool:
    """Return whether `name` is the path of a drive file, and not the name of a scenario. Its suffix decides."""
    return Path(name).suffix.lower() == SUFFIX


def read_drive(path: str | Path, trust: Trust = Trust()) -> DriveFile:
    """Return the scenario and the settings in a drive file. Their names and values are checked by `scenario`.

    Paths in the settings are returned as paths from the working directory. A list becomes a text, as the command line
    has it: effects are separated by spaces, and numbers by commas.

    Raises DataError: the file is missing, is not TOML, is of another kind, names no scenario, or names a file that lies
    neither in its folder nor in the working directory, and that `trust` does not allow.
    """
    path = Path(path)
    try:
        table = read_toml(path)
    except DataError as error:
        if "Cannot overwrite a value" not in str(error):
            raise
        raise DataError(
            f'{error} If a setting such as soil has a value of its own, put dotted keys in quotes: "soil.k" = "5mm".'
        ) from error
    kind = table.pop("kind", KIND)
    if kind != KIND:
        raise DataError(
            f"{path}: kind = {kind!r}, but the file of a drive has kind = '{KIND}' or no kind. To show a drive log, "
            "name its folder: rover-pin view FOLDER."
        )
    if "scenario" not in table:
        # A misspelt key is the likely cause if the file has a similar one.
        similar = get_close_matches("scenario", table, 1)
        hint = f"; the file has the key '{similar[0]}'" if similar else ""
        raise DataError(f"{path}: the key 'scenario' is missing{hint}: write for example scenario = 'ditch'.")
    scenario = table.pop("scenario")
    if not isinstance(scenario, str):
        raise DataError(f"{path}: scenario = {scenario!r} is not allowed: give the name of one scenario in quotes.")
    if "trust" in table:
        raise DataError(f"{path}: trust cannot be stated in a file: remove it, and use --effects FILE or --trust.")
    # Paths in the file count from its folder, and those in the settings from the working directory.
    settings = {
        name: str(path.parent / value) if _is_path(name, value) else value for name, value in _flat(table, path).items()
    }
    trust.refuse_elsewhere(settings, path)
    return DriveFile(scenario, settings)


def write_drive(path: str | Path, scenario: str, settings: Mapping[str, Any]) -> Path:
    """Write a drive file, from which `read_drive` returns equal settings, and return its path.

    Parameters
    ----------
    path : path
        The file, with the suffix .toml. Paths in the settings are written relative to its folder.
    scenario : str
        Name of the scenario.
    settings : mapping
        Settings of the scenario. Numbers are written with all digits.

    Raises
    ------
    DataError
        The path has another suffix, the file cannot be written, or a setting is an object that a file cannot hold.
    """
    path = Path(path)
    if not is_drive_file(path):
        raise DataError(f"{path}: the file of a drive needs the suffix {SUFFIX}, as in my-drive{SUFFIX}.")
    values = {name: str(value) if isinstance(value, Path) else value for name, value in settings.items()}
    values = {
        name: named_from(path.parent, value) if _is_path(name, value) else value for name, value in values.items()
    }
    head = f"# A drive of rover_pin {__version__}. `rover-pin list settings` with this file shows all settings.\n"
    return replace_file(path, head + toml_text({"kind": KIND, "scenario": scenario, **values}))


def with_drive_file(name: str | Path, settings: Mapping[str, Any], trust: Trust) -> tuple[str, dict[str, Any]]:
    """Return the name of a scenario, and its settings.

    If `name` is the path of a drive file, both come from the file, and `settings` replace settings of the file.
    Otherwise `name` and `settings` are returned unchanged. See `read_drive` for `trust` and for errors.
    """
    if not is_drive_file(name):
        return str(name), dict(settings)
    drive = read_drive(name, trust)
    # A setting of the file is replaced under the same name, as the same angle in another unit (`terrain.angle` and
    # `terrain.angle_deg`), or as a whole object in memory (soil=Soil() replaces `soil.k`).
    kept = {}
    for key, value in drive.settings.items():
        whole = key.partition(".")[0]
        is_object = whole in settings and not isinstance(settings[whole], (str, Path))
        if not is_object and not {key, key.removesuffix("_deg"), f"{key}_deg"} & settings.keys():
            kept[key] = value
    return drive.scenario, {**kept, **settings}


def _flat(table: Mapping[str, Any], path: Path, prefix: str = "") -> dict[str, Any]:
    """Return the values in a table by their dotted names.

    TOML reads `soil.k = 1` as a table `soil` inside a table, and `"soil.k" = 1` as one name; both give 'soil.k'. A
    table with a value and a unit, as other files of the package have it, becomes a text such as "5 mm".

    Raises DataError: a name occurs in both forms, or a value is neither a number, a text, True or False, nor a list.
    """
    flat: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and not set(value) <= {"value", "unit"}:
            entries = _flat(value, path, f"{name}.")
        elif isinstance(value, Mapping) and "value" in value:
            entries = {name: f"{value['value']!r} {value.get('unit', '')}".rstrip()}
        elif isinstance(value, list) and all(isinstance(entry, (str, int, float)) for entry in value):
            # Effects are separated by spaces and numbers by commas, as on the command line.
            entries = {name: (" " if name == "add" else ",").join(map(str, value))}
        elif isinstance(value, (bool, int, float, str)):
            entries = {name: value}
        else:
            raise DataError(f"{path}: {name} = {value!r} is not allowed: give a number, a text, or true or false.")
        if twice := set(flat) & set(entries):
            raise DataError(f"{path}: the key '{sorted(twice)[0]}' occurs twice, with and without quotes: remove one.")
        flat |= entries
    return flat


def _is_path(name: str, value: Any) -> bool:
    """Return whether the value of a setting is the path of a file; a name such as `nexus6` is not."""
    if not isinstance(value, str):
        return False
    has_suffix, has_comma = Path(value).suffix != "", "," in value
    is_belief = name == BELIEF and (has_suffix or len(Path(value).parts) > 1)
    return name in PATHS or is_belief or (name in NAMES_OR_PATHS and has_suffix) or (name == ROUTE and not has_comma)
