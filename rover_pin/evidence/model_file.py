"""A rig model as a TOML file: written with units, read back to the same numbers."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path
from typing import Any

from rover_pin.columns import replace_file
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.errors import DataError, closest
from rover_pin.evidence.candidates import effect_kinds
from rover_pin.evidence.rig_model import RigModel
from rover_pin.quantity import Record, quantities, record_from
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.traction import form_named
from rover_pin.toml_file import read_toml, toml_text

ANGLES = {kind.__name__: kind() for kind in (FixedAngles, SinkageAngles)}
KIND = "rig-model"


def write_model(model: RigModel, path: str | Path, note: str = "") -> Path:
    """Write the model; an effect from outside the package keeps the path of its file."""
    table = {
        "kind": KIND,
        "note": note,
        "wheel": _values(model.wheel),
        "soil": _values(model.soil),
        "effect": [_entry(effect) for effect in model.effects],
    }
    return replace_file(path, toml_text(table))


def _values(record: Record) -> dict[str, Any]:
    about = quantities(record)
    return {name: {"value": float(value), "unit": about[name].unit} for name, value in record.values().items()}


def _entry(effect: Effect) -> dict[str, Any]:
    kind = type(effect)
    entry: dict[str, Any] = {"name": kind.__name__}
    if not kind.__module__.startswith("rover_pin.effects."):
        entry["file"] = inspect.getfile(kind)
    for field in dataclasses.fields(effect):
        value = getattr(effect, field.name)
        if field.name == "form":
            entry["form"] = value.name
        elif field.name == "angles":
            entry["angles"] = type(value).__name__
    return entry | _values(effect)


def read_model(path: str | Path) -> RigModel:
    """Return the model of a file.

    Raises
    ------
    DataError
        Not a model file, an effect that is not known, or a file of a user's effect that cannot be run.
    ParameterError
        An unknown field, unit or value.
    """
    path = Path(path)
    table = read_toml(path)
    if table.get("kind") != KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a rig model; write kind = '{KIND}'.")
    return RigModel(
        record_from(Wheel, table.get("wheel", {}), f"{path} [wheel]"),
        record_from(Soil, table.get("soil", {}), f"{path} [soil]"),
        tuple(_effect(dict(entry), path) for entry in table.get("effect", [])),
    )


def _effect(entry: dict[str, Any], path: Path) -> Effect:
    name = str(entry.pop("name", ""))
    known = {kind.__name__: kind for kind in effect_kinds(entry.pop("file", None))} | {"SoilTraction": SoilTraction}
    if name not in known:
        raise DataError(f"{path}: there is no effect '{name}': {closest(name, known)}")
    choices: dict[str, Any] = {}
    if "form" in entry:
        choices["form"] = form_named(str(entry.pop("form")))
    if "angles" in entry:
        asked = str(entry.pop("angles"))
        if asked not in ANGLES:
            raise DataError(f"{path}: there are no angles '{asked}': {closest(asked, ANGLES)}")
        choices["angles"] = ANGLES[asked]
    effect: Effect = record_from(known[name], entry, f"{path} [[effect]] {name}")
    return effect.replace(**choices)
