"""A rig model as a TOML file: written with units, read back to the same numbers."""

from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files.columns import replace_file
from rover_pin.base.files.toml_file import read_toml, tables_in, toml_text
from rover_pin.base.quantity import declared, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.simulation.model.effect_files import effect_entry, effect_from
from rover_pin.simulation.model.toml_file import RIG_KIND


def write_model(model: RigModel, path: str | Path, note: str = "") -> Path:
    """Write the model; an effect from outside the package keeps the path of its file."""
    table = {
        "kind": RIG_KIND,
        "note": note,
        "wheel": declared(model.wheel),
        "soil": declared(model.soil),
        **({"rig": declared(model.errors)} if model.errors != RigErrors() else {}),
        "effect": [effect_entry(effect) for effect in model.effects],
    }
    return replace_file(path, toml_text(table))


def read_model(path: str | Path, trust: Trust = Trust()) -> RigModel:
    """Return the model of a file; the code of a user's effect runs only if `trust` allows it.

    Raises DataError: not a model file, an effect that is not known, or the file of one that is not trusted or cannot be
    run.
    Raises ParameterError: an unknown field, unit or value.
    """
    path = Path(path)
    table = read_toml(path)
    effects = tables_in(table, "effect", path)
    if table.get("kind") != RIG_KIND:
        raise DataError(f"{path}: kind = {table.get('kind')!r} is not a rig model; write kind = '{RIG_KIND}'.")
    return RigModel(
        record_from(Wheel, table.get("wheel", {}), f"{path} [wheel]"),
        record_from(Soil, table.get("soil", {}), f"{path} [soil]"),
        tuple(_effect(entry, path, trust) for entry in effects),
        record_from(RigErrors, table.get("rig", {}), f"{path} [rig]"),
    )


def _effect(entry: dict[str, Any], path: Path, trust: Trust) -> Effect:
    effect = effect_from(entry, f"{path} [[effect]]", path.parent, trust)
    if not isinstance(effect, Effect):
        raise DataError(f"{path}: {entry['name']} does not act at the wheel's contact: a rig has no place for it.")
    return effect
