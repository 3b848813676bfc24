"""Effects written as words of a command line, such as `DiggingMemory.c_d=0.1,length=0.05` or
`WeakMotor.wheel=ml,g=0.3`: the class of the effect, a point, and values of its fields.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import check, parse_quantity, quantities, written_unit
from rover_pin.base.trust import Trust
from rover_pin.simulation.model.effect_files import (
    BASES,
    NO_FIELDS,
    AnyEffect,
    effect_among,
    effect_entry,
    installed_effects,
    package_effects,
    reading_traction,
    trusted_effects,
)
from rover_pin.simulation.model.model import OWNERS, Model, same_place

FORM = "write it as EFFECT or EFFECT.name=value,name=value, for example DiggingMemory.c_d=0.1"
"""Advice in the errors for a word that does not have the form of an effect."""


def having(model: Model, effects: AnyEffect | str | Iterable[AnyEffect | str], trust: Trust = Trust()) -> Model:
    """Return the model with effects added one after the other. The effects may be given as objects or as words of a
    command line.

    If the model already has an effect of the class and owner (wheel, channel, joint) that a word names, this effect is
    changed: fields that the word does not name keep their values. Otherwise fields that the word does not name get the
    defaults of the class. An effect that uses a traction form and contact angles gets the form and the angles of the
    model's traction law.

    Parameters
    ----------
    model : Model
        The model.
    effects : effect, str, or iterable of both
        Effects, or words for effects. A text may contain several words, separated by spaces. In a word, a wheel is
        given by its name or number. An angle may be given in degrees: `_deg` is then added to the name of the field.
    trust : Trust
        Files with effects of the user, whose code may run. A class that is not part of the package is searched in these
        files.

    Raises
    ------
    ParameterError
        A word or value cannot be read, an effect or field is unknown, or a value lies beyond its limits.
    """
    entries = _flatten_effects(effects)
    kinds = kinds_for([entry for entry in entries if isinstance(entry, str)], trust)
    for entry in entries:
        model = model.having(effect_of(entry, model, kinds) if isinstance(entry, str) else entry)
    return model


def kinds_for(effect_words: Iterable[str], trust: Trust = Trust()) -> dict[str, type[AnyEffect]]:
    """Return name -> class of all effects that may be needed to read the words `effect_words`: the effects of the
    package, and, if a word names a class that the package does not have, also the effects of other installed packages
    and the effects in the trusted files.
    """
    kinds = {kind.__name__: kind for kind in package_effects()}
    if all(word.partition(".")[0] in kinds for word in effect_words):
        return kinds
    return {kind.__name__: kind for kind in (*installed_effects(), *trusted_effects(trust))}


def words_of(effects: AnyEffect | str | Iterable[AnyEffect | str]) -> list[str]:
    """Return the words for effects, in the order of the effects. `having` makes equal effects from these words, if the
    classes of the effects are known.
    """
    return [entry if isinstance(entry, str) else word_of(entry) for entry in _flatten_effects(effects)]


def word_of(effect: AnyEffect) -> str:
    """Return the word for an effect, such as `WeakMotor.wheel=2,g=0.3`. It states the value of every field, so that
    `effect_of` makes an equal effect from it.
    """
    # The TOML table of the effect holds the value of every field; units are left out, because a bare number is read in
    # the quantity's own unit.
    entry = effect_entry(effect)
    fields = {name: value["value"] if isinstance(value, dict) else value for name, value in entry.items()}
    settings = ",".join(f"{name}={value}" for name, value in fields.items() if name not in NO_FIELDS and value != "")
    return f"{entry['name']}.{settings}" if settings else entry["name"]


def _flatten_effects(effects: Any) -> list[AnyEffect | str]:
    """Return effects and words in one flat list. `effects` is an effect, a text with several words, or a nested list of
    both.
    """
    if isinstance(effects, str):
        return list(effects.split())
    if isinstance(effects, BASES):
        return [effects]
    if not isinstance(effects, Iterable):
        raise ParameterError(
            f"{effects!r} is neither an effect nor a text that describes effects: {FORM}, or give an effect object."
        )
    return [word for entry in effects for word in _flatten_effects(entry)]


def effect_of(word: str, model: Model, kinds: Mapping[str, type[AnyEffect]] | None = None) -> AnyEffect:
    """Return the effect that a word such as "WeakMotor.wheel=ml,g=0.3" describes for a model.

    Parameters
    ----------
    word : str
        The word: name of the class, a point, and values of fields.
    model : Model
        The model that gets the effect. If it already has an effect of this class and owner, the fields that the word
        does not name keep their values.
    kinds : mapping, optional
        Name -> class of the known effects; if missing, the effects of the package.

    Raises ParameterError: the word cannot be read, an effect or field is unknown, or a value lies beyond its limits.
    """
    # A word is the name of the class, then settings behind the first point.
    name, dot, settings = word.partition(".")
    kinds = kinds_for(()) if kinds is None else kinds
    if name not in kinds:
        raise ParameterError(
            f"There is no effect '{name}' to add: {closest(name, kinds)} To add an effect of your own, name the file "
            "that defines it, which needs --effects FILE."
        )
    if dot and not settings:
        raise ParameterError(f"{word}: no settings follow the point; {FORM}.")
    texts = dict(_pair(word, part) for part in settings.split(",")) if dot else {}
    effect = reading_traction(kinds[name](), model.all_effects)
    # The owner decides which effect of the model the word changes, so it is set first.
    owners = [field for field in OWNERS if field in texts and hasattr(effect, field)]
    names = [wheel.name for wheel in model.rover.wheels]
    for field in owners:
        # The owner is the wheel, the channel or the joint at which the effect acts. It has the type of the field's
        # default: a name, or the index of a wheel.
        text = texts.pop(field)
        owner: str | int
        if isinstance(getattr(effect, field), str):
            owner = names[int(text)] if text.isdigit() and int(text) < len(names) else text
        elif text in names:
            owner = names.index(text)
        elif text.isdigit():
            owner = int(text)
        else:
            raise ParameterError(f"{word}: the rover has no wheel '{text}': {closest(text, names)}")
        effect = effect.replace(**{field: owner})
    effect = next((present for present in model.all_effects if same_place(present, effect)), effect)
    values = dict(_value(word, effect, field, text) for field, text in texts.items())
    try:
        return effect_among(kinds, {**effect_entry(effect), **values}, "effect")
    except DataError as error:
        raise ParameterError(str(error)) from error


def _pair(word: str, part: str) -> tuple[str, str]:
    """Return the name of the field and the text of the value in `part`, one setting `field=value` of an effect's
    word.
    """
    field, sign, text = part.partition("=")
    if not (field and sign and text):
        raise ParameterError(f"{word}: '{part}' sets no field: {FORM}.")
    return field, text


def _value(word: str, effect: AnyEffect, field: str, text: str) -> tuple[str, Any]:
    """Return the name of an effect's field and its value, read from the text of a setting. The value is a number if the
    field is a quantity, otherwise the text itself.
    """
    name = field.removesuffix("_deg")
    angle = name != field and name in quantities(effect) and quantities(effect)[name].unit == "rad"
    name = name if angle else field
    if name not in quantities(effect):
        names = [entry.name for entry in dataclasses.fields(effect)]
        if name not in names:
            raise ParameterError(f"{word}: {type(effect).__name__} has no field '{field}': {closest(field, names)}")
        return name, text
    # A bare number is in degrees if the field's name ends with _deg, else in the quantity's own unit.
    spec, bare = quantities(effect)[name], "deg" if angle else ""
    value = parse_quantity(text, spec.unit, f"{word}: {field}", bare or None)
    check(f"effect {type(effect).__name__}: {type(effect).__name__}", name, value, spec, written_unit(text) or bare)
    return name, value
