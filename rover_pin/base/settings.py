"""Dotted settings, as `terrain.wall_angle_deg`: taken one by one, what is left over refused.

Who takes a setting says its default and unit. So a value may have a unit (`soil.k=5mm`, `soil.phi=30deg`), and what was
taken is the list of all settings that there are.
"""

import inspect
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, NamedTuple, Self

from rover_pin.base.arguments import arguments_of
from rover_pin.base.errors import ParameterError, closest, one_of
from rover_pin.base.quantity import Quantity, Record, check, is_symbolic, parse_quantity, quantities, written_unit
from rover_pin.base.units import factor_to


class Setting(NamedTuple):
    """What can be set: its name, default, unit, bounds, choices and where the default comes from."""

    name: str
    value: Any
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    source: str = ""
    choices: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, value: Any, spec: Quantity) -> Self:
        """Return the setting of a quantity."""
        return cls(name, value, spec.unit, spec.low, spec.high, spec.source)


def numbers_of(record: Record) -> tuple[Setting, ...]:
    """Return a record's quantities with its values; of one that is not the class's default, both sources are said."""
    default_record = type(record)()
    settings = []
    for name, spec in quantities(record).items():
        value, default = getattr(record, name), getattr(default_record, name)
        is_default = is_symbolic(value) or value == default
        source = spec.source if is_default else f"as given or read; usual {default:.6g}: {spec.source}"
        settings.append(Setting.of(name, value, spec._replace(source=source)))
    return tuple(settings)


class Settings:
    """Dotted settings that are taken one by one; what is left at the end was not understood."""

    def __init__(self, values: Mapping[str, Any]):
        self.values = dict(values)
        self.known: dict[str, Setting] = {}

    def take(self, name: str, default: Any, choices: Iterable[str] = (), source: str = "") -> Any:
        """Return a setting, or its default."""
        return self._take_value(Setting(name, default, source=source, choices=tuple(choices)))

    def number(self, name: str, default: float, spec: Quantity) -> float:
        """Return a setting that is a number, or its default."""
        setting = Setting.of(name, default, spec)
        given = self._take_value(setting)
        value = parse_quantity(given, spec.unit, name)
        _check(setting, value, written_unit(given))
        self._in_force(name, value)
        return value

    def choice(self, name: str, default: str, choices: Mapping[str, Any], source: str) -> Any:
        """Return what a setting's word stands for."""
        return choices[one_of(name, self.take(name, default, choices, source), choices)]

    def word(self, name: str, default: str, choices: Collection[str], source: str) -> str:
        """Return one of several words, or an empty one where none is given; `default` is what then holds, for lists."""
        value = self.values.get(name)
        word = self.take(name, default, choices, source)
        return "" if value is None else one_of(name, word, choices)

    def record(self, prefix: str, record: Record | type[Record]) -> dict[str, float]:
        """Return the settings `prefix.FIELD` that are given for the quantities of a record."""
        base = record if isinstance(record, Record) else record()
        return self._given_values(setting._replace(name=f"{prefix}.{setting.name}") for setting in numbers_of(base))

    def arguments(
        self, prefix: str, function: Callable[..., Any], overrides: Mapping[str, Any] = {}, names: Iterable[str] = ()
    ) -> dict[str, Any]:
        """Return the settings `prefix.NAME` that are given for a function's arguments, or for those of these names.

        Unit, bounds and source are those of their annotations; `overrides` are defaults in place of the function's own.
        """
        arguments = arguments_of(function)
        chosen = {
            name: parameter
            for name, parameter in inspect.signature(function).parameters.items()
            if not names or name in names
        }
        defaults = {
            name: None if parameter.default is parameter.empty else parameter.default
            for name, parameter in chosen.items()
        }
        return self._given_values(
            Setting.of(f"{prefix}.{name}", {**defaults, **overrides}[name], arguments[name].quantity) for name in chosen
        )

    def finish(self) -> None:
        """Refuse what nothing has taken."""
        for name, value in self.values.items():
            raise ParameterError(f"There is no setting '{name}' here: {self._in_unit(name, value)}")

    def _given_values(self, settings: Iterable[Setting]) -> dict[str, Any]:
        """Return the values by the last part of the name; `_deg` behind that of an angle reads degrees."""
        values: dict[str, Any] = {}
        for setting in settings:
            written = written_unit(self.values.get(setting.name))
            key = setting.name.rpartition(".")[2]
            degrees = f"{setting.name}_deg" if setting.unit.startswith("rad") else ""
            if setting.name in self.values:
                values[key] = _read(setting, self._take_value(setting))
            self._take_value(setting)
            if degrees in self.values:
                written = setting.unit.replace("rad", "deg")
                values[key] = parse_quantity(self.values.pop(degrees), setting.unit, degrees, written)
            if key in values:
                _check(setting, values[key], written)
                self._in_force(setting.name, values[key])
        return values

    def _in_force(self, name: str, value: Any) -> None:
        """Have a setting listed with its value instead of its default."""
        self.known[name] = self.known[name]._replace(value=value)

    def _take_value(self, setting: Setting) -> Any:
        value = self.values.pop(setting.name, setting.value)
        self.known[setting.name] = setting._replace(value=value)
        return value

    def _in_unit(self, name: str, value: Any) -> str:
        """Return how a setting is written whose name was given its unit, as `soil.k_mm`; else the names alike."""
        stem, _, unit = name.rpartition("_")
        if stem in self.known and not math.isnan(factor_to(unit, self.known[stem].unit)):
            return f"did you mean {stem}={format_setting(value)}{unit}?"
        return closest(name, self.known)


SWITCHES = {"true": True, "1": True, "false": False, "0": False}


def _read(setting: Setting, value: Any) -> Any:
    """Return a value as its default is: text, several numbers (`50mm,100mm`), or one."""
    if isinstance(setting.value, str):
        return str(value)
    if isinstance(setting.value, bool):
        word = str(value).lower().removesuffix(".0")
        return SWITCHES[one_of(setting.name, word, SWITCHES)]
    if not isinstance(setting.value, tuple):
        return parse_quantity(value, setting.unit, setting.name)
    several = value.split(",") if isinstance(value, str) else value
    if not isinstance(several, (list, tuple)) or len(several) != len(setting.value):
        raise ParameterError(f"{setting.name} = {value!r} must be {len(setting.value)} numbers, as in 0.05,0.1.")
    return tuple(parse_quantity(part, setting.unit, setting.name) for part in several)


def _check(setting: Setting, value: Any, written: str) -> None:
    """Refuse a number out of bounds by the setting's own name."""
    if isinstance(value, float) and math.isfinite(setting.low):
        check("", setting.name, value, Quantity(setting.unit, setting.source, setting.low, setting.high, ""), written)


def format_setting(value: Any) -> str:
    """Return a number or word as one writes it."""
    return f"{value:g}" if isinstance(value, float) else str(value)
