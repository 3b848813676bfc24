"""Effects in a word, as a command line names them: `DiggingMemory.c_d=0.1,length=0.05`, `WeakMotor.wheel=ml,g=0.3`."""

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import check, parse_quantity, quantities, written_unit
from rover_pin.base.trust import Trust
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.effect_files import (
    BASES,
    AnyEffect,
    effect_among,
    effect_entry,
    package_effects,
    reading_traction,
    trusted_effects,
)
from rover_pin.simulation.model.model import OWNERS, Model, same_place

FORM = "write it as EFFECT or EFFECT.name=value,name=value, as DiggingMemory.c_d=0.1"


def having(model: Model, effects: AnyEffect | str | Iterable[AnyEffect | str], trust: Trust = Trust()) -> Model:
    """Return the model with effects added in turn, each an effect or a word for one; a text may hold several words.

    A class that is not of the package is sought in the files that `trust` names.

    A word changes what it names of the effect of its class and wheel or channel that the model has, else of the
    class's defaults; an effect that reads the traction law reads the model's. A wheel goes by name or number, an angle
    with `_deg` behind its name is in degrees.

    Raises ParameterError: a word or value that cannot be read, an unknown effect or field, with the close ones, a value
    out of bounds.
    """
    entries = _flatten_effects(effects)
    kinds = kinds_for([entry for entry in entries if isinstance(entry, str)], trust)
    for entry in entries:
        model = model.having(effect_of(entry, model, kinds) if isinstance(entry, str) else entry)
    return model


def kinds_for(effect_words: Iterable[str], trust: Trust = Trust()) -> dict[str, type[AnyEffect]]:
    """Return the effects of the package by name; where a word names another, those of trusted files too."""
    kinds = {kind.__name__: kind for kind in package_effects()}
    if all(word.partition(".")[0] in kinds for word in effect_words):
        return kinds
    return kinds | {kind.__name__: kind for kind in trusted_effects(trust)}


def words_of(effects: AnyEffect | str | Iterable[AnyEffect | str]) -> list[str]:
    """Return the words for effects: read again they give the same ones, if the package knows their classes."""
    return [entry if isinstance(entry, str) else word_of(entry) for entry in _flatten_effects(effects)]


def word_of(effect: AnyEffect) -> str:
    """Return the word for an effect, every field in it."""
    entry = effect_entry(effect)
    fields = {name: value["value"] if isinstance(value, dict) else value for name, value in entry.items()}
    settings = ",".join(
        f"{name}={value}" for name, value in fields.items() if name not in ("name", "file") and value != ""
    )
    return f"{entry['name']}.{settings}" if settings else entry["name"]


def _flatten_effects(effects: Any) -> list[AnyEffect | str]:
    """Return the effects and the single words."""
    if isinstance(effects, str):
        return list(effects.split())
    if isinstance(effects, BASES):
        return [effects]
    if not isinstance(effects, Iterable):
        raise ParameterError(f"{effects!r} is no effect that could be added: {FORM}, or give an effect.")
    return [word for entry in effects for word in _flatten_effects(entry)]


def effect_of(word: str, model: Model, kinds: Mapping[str, type[AnyEffect]] | None = None) -> AnyEffect:
    """Return the effect that a word stands for on this model, of the package unless other `kinds` are given."""
    name, dot, settings = word.partition(".")
    kinds = kinds_for(()) if kinds is None else kinds
    if name not in kinds:
        raise ParameterError(
            f"There is no effect '{name}' to add: {closest(name, kinds)} One of your own needs --effects FILE."
        )
    if dot and not settings:
        raise ParameterError(f"{word}: {FORM}.")
    texts = dict(_pair(word, part) for part in settings.split(",")) if dot else {}
    effect = reading_traction(kinds[name](), model.all_effects)
    owners = [field for field in OWNERS if field in texts and hasattr(effect, field)]
    for field in owners:
        effect = effect.replace(**{field: _owner(word, texts.pop(field), getattr(effect, field), model.rover)})
    effect = next((present for present in model.all_effects if same_place(present, effect)), effect)
    values = dict(_value(word, effect, field, text) for field, text in texts.items())
    try:
        return effect_among(kinds, {**effect_entry(effect), **values}, "effect")
    except DataError as error:
        raise ParameterError(str(error)) from error


def _pair(word: str, part: str) -> tuple[str, str]:
    field, sign, text = part.partition("=")
    if not (field and sign and text):
        raise ParameterError(f"{word}: '{part}' sets nothing: {FORM}.")
    return field, text


def _owner(word: str, text: str, default: Any, rover: Rover) -> Any:
    """Return a wheel or channel as the effect's field has it: by name, or by number in the rover's order."""
    names = [wheel.name for wheel in rover.wheels]
    if isinstance(default, str):
        return names[int(text)] if text.isdigit() and int(text) < len(names) else text
    if text in names:
        return names.index(text)
    if not text.isdigit():
        raise ParameterError(f"{word}: the rover has no wheel '{text}': {closest(text, names)}")
    return int(text)


def _value(word: str, effect: AnyEffect, field: str, text: str) -> tuple[str, Any]:
    """Return a field's name and value; quantities are numbers, the rest are words."""
    name = field.removesuffix("_deg")
    angle = name != field and name in quantities(effect) and quantities(effect)[name].unit == "rad"
    name = name if angle else field
    if name not in quantities(effect):
        names = [entry.name for entry in dataclasses.fields(effect)]
        if name not in names:
            raise ParameterError(f"{word}: {type(effect).__name__} has no field '{field}': {closest(field, names)}")
        return name, text
    spec, bare = quantities(effect)[name], "deg" if angle else ""
    value = parse_quantity(text, spec.unit, f"{word}: {field}", bare or None)
    check(f"effect {type(effect).__name__}: {type(effect).__name__}", name, value, spec, written_unit(text) or bare)
    return name, value
