"""Compare two models, number by number. Each is the model of a rover, or of a wheel on a test rig."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.base.trust import Trust
from rover_pin.comparison.side import ABSENT, Comparison, Side, Value, differences, number_rows, word_rows
from rover_pin.effects.names import title_of
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.wording import MAX_LISTED
from rover_pin.experiments.drive_log.model import owner_name
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import is_rig_model, read_model
from rover_pin.terrain.shapes import flat


def read_side(path: Path, trust: Trust) -> Side:
    """Read a model file, and return its effects in words and its numbers for a comparison.

    The terrain of a rover's model is not compared.
    """
    model: RigModel | Model = (
        read_rig_model(path, trust) if is_rig_model(path) else read_model(path, terrain=flat(), trust=trust)
    )
    effects = model.effects if isinstance(model, RigModel) else model.all_effects
    words = {"of": "a wheel on a rig" if isinstance(model, RigModel) else f"a rover, {model.rover.name}"}
    # The forms of traction and contact angle are words, not numbers, but change the prediction as much.
    for effect in effects:
        if isinstance(effect, SoilTraction):
            words["traction"] = f"{type(effect.form).__name__}, {type(effect.angles).__name__}"
    words |= {f"effect {owner_name(effect)}": title_of(type(effect)) for effect in effects}
    numbers = {}
    for owner, record in (*_records(model), *((owner_name(effect), effect) for effect in effects)):
        for name, quantity in quantities(record).items():
            numbers[f"{owner}.{name}"] = Value(float(getattr(record, name)), quantity.unit)
    return Side(str(path), words, numbers)


def _records(model: RigModel | Model) -> Iterator[tuple[str, Any]]:
    """Yield the wheels, soils and motor of a model, each with the first part of the names of its numbers."""
    if isinstance(model, RigModel):
        yield from (("wheel", model.wheel), ("soil", model.soil))
    else:
        yield from ((f"wheel {wheel.name}", wheel.wheel) for wheel in model.rover.wheels)
        yield from (("soil" if not n else f"soil {n}", soil) for n, soil in enumerate(model.soils))
        yield "motor", model.motor


def compare_models(first: Side, second: Side) -> Comparison:
    """Compare two models: list the effects that only one of them has, and every number that differs."""
    rows = (*word_rows(first, second), *number_rows(first, second))
    effects = [row for row in rows if row.name.startswith("effect ")]
    sentences = []
    # First the effects that only one of the two models has.
    for which, only_first in (("first", True), ("second", False)):
        titles = [row.first if only_first else row.second for row in effects]
        others = [row.second if only_first else row.first for row in effects]
        unshared = [title for title, other in zip(titles, others, strict=True) if other == ABSENT]
        if unshared:
            sentences.append(f"Only the {which} model has {', '.join(unshared)}.")
    if not sentences:
        sentences.append("Both models have equal effects.")
    # Then the numbers that both models have.
    shared = [row for row in rows if ABSENT not in (row.first, row.second) and not row.name.startswith("effect ")]
    changed = [row for row in rows if row.change]
    if changed:
        named = "; ".join(f"{row.name} {row.first} -> {row.second}" for row in changed[:MAX_LISTED])
        more = f" and {len(changed) - MAX_LISTED} more" if len(changed) > MAX_LISTED else ""
        sentences.append(f"{len(changed)} of the {len(shared)} common numbers differ: {named}{more}.")
    else:
        sentences.append(f"None of the {len(shared)} common numbers differs.")
    sentence = " ".join(sentences)
    return Comparison("models", first.label, second.label, sentence, rows, differences(first, second))
