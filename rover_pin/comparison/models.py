"""Two models of rovers, or of wheels on a rig, number by number."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.base.trust import Trust
from rover_pin.comparison.side import ABSENT, Comparison, Row, Side, Value, differences, number_rows, word_rows
from rover_pin.effects.names import title_of
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.wording import MAX_LISTED
from rover_pin.experiments.drive_log.parameters import owner_name
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import is_rig_model, read_model
from rover_pin.terrain.shapes import flat


def read_side(path: Path, trust: Trust) -> Side:
    """Return a model file's effects and numbers; of a rover's, the ground is no part."""
    model: RigModel | Model = (
        read_rig_model(path, trust) if is_rig_model(path) else read_model(path, terrain=flat(), trust=trust)
    )
    numbers = {}
    for owner, record in _records(model):
        for name, quantity in quantities(record).items():
            numbers[f"{owner}.{name}"] = Value(float(getattr(record, name)), quantity.unit)
    return Side(str(path), dict(_words(model)), numbers)


def _effects(model: RigModel | Model) -> tuple[Any, ...]:
    return model.effects if isinstance(model, RigModel) else model.all_effects


def _records(model: RigModel | Model) -> Iterator[tuple[str, Any]]:
    if isinstance(model, RigModel):
        yield from (("wheel", model.wheel), ("soil", model.soil))
    else:
        yield from ((f"wheel {wheel.name}", wheel.wheel) for wheel in model.rover.wheels)
        yield from (("soil" if not n else f"soil {n}", soil) for n, soil in enumerate(model.soils))
        yield "motor", model.motor
    yield from ((owner_name(effect), effect) for effect in _effects(model))


def _words(model: RigModel | Model) -> Iterator[tuple[str, str]]:
    yield "of", "a wheel on a rig" if isinstance(model, RigModel) else f"a rover, {model.rover.name}"
    for effect in _effects(model):
        if isinstance(effect, SoilTraction):
            yield "traction", f"{type(effect.form).__name__}, {type(effect.angles).__name__}"
    for effect in _effects(model):
        yield f"effect {owner_name(effect)}", title_of(type(effect))


def compare_models(first: Side, second: Side) -> Comparison:
    """Return the two side by side: effects that only one has, and every number that differs."""
    rows = (*word_rows(first, second), *number_rows(first, second))
    sentence = " ".join((*_only(rows), _numbers(rows)))
    return Comparison("models", first.label, second.label, sentence, rows, differences(first, second))


def _only(rows: tuple[Row, ...]) -> Iterator[str]:
    effects = [row for row in rows if row.name.startswith("effect ")]
    for who, has, lacks in (("first", "first", "second"), ("second", "second", "first")):
        unshared = [getattr(row, has) for row in effects if getattr(row, lacks) == ABSENT]
        if unshared:
            yield f"Only the {who} has {', '.join(unshared)}."
    if all(ABSENT not in (row.first, row.second) for row in effects):
        yield "Both have the same effects."


def _numbers(rows: tuple[Row, ...]) -> str:
    both = [row for row in rows if row.change]
    shared = sum(ABSENT not in (row.first, row.second) and not row.name.startswith("effect ") for row in rows)
    if not both:
        return f"None of the {shared} numbers that both have differs."
    named = "; ".join(f"{row.name} {row.first} -> {row.second}" for row in both[:MAX_LISTED])
    more = f" and {len(both) - MAX_LISTED} more" if len(both) > MAX_LISTED else ""
    return f"Of {shared} numbers that both have {len(both)} differ: {named}{more}."
