"""Dotted settings, as `terrain.wall_angle_deg`: taken one by one, what is left over refused."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from rover_pin.errors import ParameterError, closest
from rover_pin.quantity import as_float


class Settings:
    """Dotted settings that are taken one by one; what is left at the end was not understood."""

    def __init__(self, values: Mapping[str, Any]):
        self.values = dict(values)
        self.known: list[str] = []

    def take(self, name: str, default: Any) -> Any:
        """Return a setting, or its default."""
        self.known.append(name)
        return self.values.pop(name, default)

    def number(self, name: str, default: float) -> float:
        """Return a setting that is a number, or its default."""
        return number(name, self.take(name, default))

    def choice(self, name: str, default: str, choices: Mapping[str, Any]) -> Any:
        """Return what a setting's word stands for."""
        word = self.take(name, default)
        if not isinstance(word, str) or word not in choices:
            raise ParameterError(f"{name} = {word!r} is not known: {closest(word, choices)}")
        return choices[word]

    def group(self, prefix: str, names: tuple[str, ...]) -> dict[str, Any]:
        """Return the settings `prefix.NAME` for these names, angles with `_deg` in radians."""
        found = {}
        for name in names:
            self.known.append(f"{prefix}.{name}")
            if f"{prefix}.{name}" in self.values:
                found[name] = self.values.pop(f"{prefix}.{name}")
            if f"{prefix}.{name}_deg" in self.values:
                found[name] = math.radians(number(f"{prefix}.{name}_deg", self.values.pop(f"{prefix}.{name}_deg")))
        return found

    def numbers(self, prefix: str, names: tuple[str, ...]) -> dict[str, float]:
        """Return the settings of a group that are all numbers."""
        return {name: number(f"{prefix}.{name}", value) for name, value in self.group(prefix, names).items()}

    def finish(self) -> None:
        """Refuse what nothing has taken."""
        for name in self.values:
            raise ParameterError(f"There is no setting '{name}' here: {closest(name, set(self.known))}")


def number(name: str, value: Any) -> float:
    """Return a setting's value as a float."""
    try:
        return as_float(value)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} = {value!r} is not a number.") from None


def fields_of(record: Any) -> tuple[str, ...]:
    """Return the names of a record's fields."""
    return tuple(each.name for each in dataclasses.fields(record))
