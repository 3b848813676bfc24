"""A tuning study as a TOML file."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import record_from, to_si
from rover_pin.base.trust import Trust
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import HOLE_GAINS, Gains
from rover_pin.tuning.drive_score import Cost
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy

NUMBERS = ("estimate", "seed", "noise_seeds")


def read_tuning(path: str | Path, trust: Trust = Trust()) -> TuningStudy:
    """Return the study in a TOML file, as in::

        name = "ditch"
        estimate = "true"              # the true slip; eq9, onboard, camera or tracked
        noise_seeds = 2                # of each drive, where sensors are read
        seed = 0
        [free]                         # gains to find, with their bounds
        k_p = [0.01, 10.0]
        S_d = [0.05, 0.9]
        [before]                       # the other gains, and where the free ones come from
        delta_max = 0.55
        [before.hole]                  # where S_d falls with each wheel's hole; free as "hole.deep"
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
        scenario = "incline"

    Raises DataError: a file that is missing or not TOML, or names another outside its folder that `trust` does not
    allow.
    Raises ParameterError: an unknown key or name, with the close ones; anything that TuningStudy refuses.
    """
    table = read_toml(path)
    trust.refuse_elsewhere(table, Path(path))
    try:
        return _study(table, Path(path).stem)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error


def _study(table: dict[str, Any], stem: str) -> TuningStudy:
    keys = [entry.name for entry in dataclasses.fields(TuningStudy) if entry.name != "hole"]
    for key in table:
        if key not in keys:
            raise ParameterError(f"the study has no key '{key}': {closest(key, keys)}")
    fields = {key: value for key, value in table.items() if key in NUMBERS}
    name = _name("the study", "name", table.get("name", stem))
    if "free" in table:
        free = _flat(table_in(table, "free", stem))
        fields["free"] = {number: _pair(number, bounds) for number, bounds in free}
    before = dict(table_in(table, "before", stem))
    hole = record_from(HoleLaw, before.pop("hole"), "[before.hole]") if "hole" in before else None
    usual = HOLE_GAINS.values() if hole else {}
    effort = table_in(table, "effort", stem)
    efforts = [entry.name for entry in dataclasses.fields(Effort)]
    for key in effort:
        if key not in efforts:
            raise ParameterError(f"[effort] has no key '{key}': {closest(key, efforts)}")
    return TuningStudy(
        name,
        **fields,
        training=_cases("training", table.get("training", [])),
        held_out=_cases("held_out", table.get("held_out", [])),
        before=record_from(Gains, {**usual, **before}, "[before]"),
        hole=hole,
        cost=record_from(Cost, table.get("cost", {}), "[cost]"),
        effort=Effort(**effort),
    )


def _pair(name: str, bounds: Any) -> Any:
    """Return bounds as two numbers; what is none is left for `TuningStudy` to refuse."""
    if not isinstance(bounds, tuple):
        return bounds
    return tuple(to_si(bound, "", "", f"the bounds of {name}") for bound in bounds)


def _cases(where: str, entries: Any) -> tuple[DriveCase, ...]:
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ParameterError(f"'{where}' must be a list of drives: write each under its own [[{where}]].")
    return tuple(_case(f"{where} {i + 1}", dict(entry)) for i, entry in enumerate(entries))


def _case(where: str, entry: dict[str, Any]) -> DriveCase:
    if "scenario" not in entry:
        raise ParameterError(f'{where} names no scenario: add scenario = "ditch", say.')
    scenario, name = (_name(where, key, entry.pop(key, where)) for key in ("scenario", "name"))
    post_peak = to_si(entry.pop("post_peak", 0.0), "", "", f"{where}: post_peak")
    return DriveCase(name, scenario, tuple(sorted(_flat(entry))), post_peak)


def _name(where: str, key: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ParameterError(f"{where}: {key} = {value!r} is not allowed: it is one name, in quotes.")
    return value


def _flat(entry: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted name -> value: in TOML `soil.k = 1` is a table in a table."""
    flat: list[tuple[str, Any]] = []
    for name, value in entry.items():
        # a list, as of effects to add, must be fit for a key
        plain = tuple(value) if isinstance(value, list) else value
        flat += _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", plain)]
    return flat
