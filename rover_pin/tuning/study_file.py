"""Read a tuning study from a TOML file."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_pin.base.errors import ParameterError, closest, one_of
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import record_from, to_si
from rover_pin.base.trust import Trust
from rover_pin.control.slip_control import HOLE_GAINS, Gains, HoleLaw
from rover_pin.scenarios.controllers import belief_words
from rover_pin.scenarios.drive_file import is_drive_file, with_drive_file
from rover_pin.scenarios.scenario import scenario as make_scenario
from rover_pin.tuning.drive_score import Cost
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy

PLAIN_KEYS = ("estimate", "seed", "noise_seeds", "believes")
"""Keys of a study file whose values become fields of `TuningStudy` without conversion."""


def read_tuning(path: str | Path, trust: Trust = Trust()) -> TuningStudy:
    """Return the tuning study in a TOML file such as::

        name = "ditch"
        estimate = "true"              # the true slip; eq9, onboard, camera or tracked
        noise_seeds = 2                # for each drive, if sensors are read
        believes = "unknown-sand"      # what onboard and camera know: also plant, or the name of a soil
        seed = 0
        [free]                         # gains to find, with their bounds
        k_p = [0.01, 10.0]
        S_d = [0.05, 0.9]
        [before]                       # the other gains, and the free ones before the tuning
        delta_max = 0.55
        [before.hole]                  # S_d decreases with the depth of each wheel's hole; free as "hole.deep"
        deep = 0.2
        [cost]
        slip = 0.3
        [effort]
        population = 12
        [[training]]
        scenario = "ditch"
        post_peak = 0.3
        soil.k = 0.01
        terrain.wall_angle_deg = 35
        [[held_out]]
        scenario = "my-drive.toml"     # a drive file in the folder of the study, without its control

    The fields are described at `TuningStudy`, `Cost` and `Effort`. `trust` states which files outside the folder of the
    study may be read.

    Raises DataError: the file is missing, is not TOML, or names a file outside its folder that `trust` does not allow.
    Raises ParameterError: a key or name is unknown (the message lists similar names), or `TuningStudy` refuses a value.
    """
    # Files that the study names are checked before any of them is opened.
    table = read_toml(path)
    trust.refuse_elsewhere(table, Path(path))
    try:
        return _study(table, Path(path), trust)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error


def _study(table: dict[str, Any], path: Path, trust: Trust) -> TuningStudy:
    """Return the tuning study in the table of the TOML file `path`. The name of the file without its suffix is also the
    name of a study that has no name.
    """
    stem = path.stem
    keys = [entry.name for entry in dataclasses.fields(TuningStudy) if entry.name != "hole"]
    # A misspelt key would otherwise be ignored, and its default would be used without a notice.
    for key in table:
        if key not in keys:
            raise ParameterError(f"the study has no key '{key}': {closest(key, keys)}")
    fields = {key: value for key, value in table.items() if key in PLAIN_KEYS}
    # A study states its belief by a word. Only the caller can name model files, because a study is given to others.
    if "believes" in fields:
        one_of("believes", str(fields["believes"]), belief_words())
    name = _name("the study", "name", table.get("name", stem))
    if "free" in table:
        free = _flat(table_in(table, "free", stem))
        fields["free"] = {number: _pair(number, bounds) for number, bounds in free}
    before = dict(table_in(table, "before", stem))
    hole = record_from(HoleLaw, before.pop("hole"), "[before.hole]") if "hole" in before else None
    # With a hole law, the gains that the file does not name are those that were tuned together with a hole law.
    usual = HOLE_GAINS.values() if hole else {}
    effort = table_in(table, "effort", stem)
    efforts = [entry.name for entry in dataclasses.fields(Effort)]
    for key in effort:
        if key not in efforts:
            raise ParameterError(f"[effort] has no key '{key}': {closest(key, efforts)}")
    return TuningStudy(
        name,
        **fields,
        training=_cases("training", table.get("training", []), path, trust),
        held_out=_cases("held_out", table.get("held_out", []), path, trust),
        before=record_from(Gains, {**usual, **before}, "[before]"),
        hole=hole,
        cost=record_from(Cost, table.get("cost", {}), "[cost]"),
        effort=Effort(**effort),
    )


def _pair(name: str, bounds: Any) -> Any:
    """Return the bounds of a free number in SI units. A value that is no pair is returned unchanged.

    `TuningStudy` refuses such a value, with one message for files and for Python.
    """
    if not isinstance(bounds, tuple):
        return bounds
    return tuple(to_si(bound, "", "", f"the bounds of {name}") for bound in bounds)


def _cases(where: str, entries: Any, path: Path, trust: Trust) -> tuple[DriveCase, ...]:
    """Return the drives in a list of tables of the study file `path`. `where` is the key of the list, training or
    held_out.

    Raises ParameterError: the value is no list of tables, or a drive has no scenario.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ParameterError(f"'{where}' must be a list of drives: write each drive below its own line [[{where}]].")
    cases = []
    for number, table in enumerate(entries, 1):
        entry, drive = dict(table), f"{where} {number}"
        if "scenario" not in entry:
            raise ParameterError(f'the drive {drive} names no scenario: add one, such as scenario = "ditch".')
        # A drive without a name gets the name "training 1", "training 2" and so on.
        scenario, name = (_name(drive, key, entry.pop(key, drive)) for key in ("scenario", "name"))
        post_peak = to_si(entry.pop("post_peak", 0.0), "", "", f"{drive}: post_peak")
        # All other keys are settings of the scenario.
        settings = dict(_flat(entry))
        if is_drive_file(scenario):
            file = trust.within(path.parent, scenario, f"{path}: {drive}")
            # The file is checked on its own first, so that an error in it names the file.
            make_scenario(file, trust=trust)
            scenario, all_settings = with_drive_file(file, settings, trust)
            # The control of the drive file is left out, because the tuning chooses the control.
            others = {name: value for name, value in all_settings.items() if name.partition(".")[0] != "control"}
            settings = {**others, **settings}
        cases.append(DriveCase(name, scenario, tuple(sorted(settings.items())), post_peak))
    return tuple(cases)


def _name(where: str, key: str, value: Any) -> str:
    """Return a value that must be a text. Raise ParameterError if it is no text; `where` and `key` name the value in
    the error.
    """
    if not isinstance(value, str):
        raise ParameterError(f"{where}: {key} = {value!r} is not allowed. Give a name as a text in quotes.")
    return value


def _flat(entry: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return the values in a table with their dotted names. TOML reads `soil.k = 1` as a table `soil` within a
    table.
    """
    flat: list[tuple[str, Any]] = []
    for name, value in entry.items():
        # A list, such as effects to add, becomes a tuple, because settings are part of the key of an evaluation.
        plain = tuple(value) if isinstance(value, list) else value
        flat += _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", plain)]
    return flat
