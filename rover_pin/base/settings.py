"""Settings with dotted names, such as `terrain.wall_angle`. A setting that no part of the code uses is refused.

The code that uses a setting states its default and its unit. Therefore a user may give a value with a unit
(`soil.k=5mm`, `soil.phi=30deg`), and the settings that the code has asked for are the list of all existing settings.
"""

import inspect
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, NamedTuple, Self

from rover_pin.base.arguments import arguments_of
from rover_pin.base.errors import ParameterError, UnknownNameError, closest, one_of
from rover_pin.base.quantity import Quantity, Record, check, is_symbolic, parse_quantity, quantities, written_unit
from rover_pin.base.units import factor_to

NOT_THE_DEFAULT = "given or read from a file; default"
"""Beginning of the source of a number that differs from the default of its record; the default and its source
follow."""


class Setting(NamedTuple):
    """One setting: its name, value, unit, bounds or choices, and the source of its default.

    The value is the default until the user's value replaces it.
    """

    name: str
    value: Any
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    source: str = ""
    choices: Collection[str] = ()

    @classmethod
    def of(cls, name: str, value: Any, spec: Quantity) -> Self:
        """Return the setting for a number. Unit, bounds and source come from the `Quantity` of the number."""
        return cls(name, value, spec.unit, spec.low, spec.high, spec.source)


def numbers_of(record: Record, owner: str = "") -> tuple[Setting, ...]:
    """Return a setting for each quantity of a record. The value of the setting is the value in the record.

    The setting has the name of the quantity, such as `phi`, or `owner.phi` if an owner is given. If the value differs
    from the default of the record's class, the setting's source also states this default.
    """
    default_record = type(record)()
    settings = []
    for name, spec in quantities(record).items():
        value, default = getattr(record, name), getattr(default_record, name)
        is_default = is_symbolic(value) or value == default
        source = spec.source if is_default else f"{NOT_THE_DEFAULT} {default:.6g}: {spec.source}"
        settings.append(Setting.of(f"{owner}.{name}" if owner else name, value, spec._replace(source=source)))
    return tuple(settings)


class Settings:
    """The settings that a user gave, by dotted name. The code asks for them one by one, and `finish` refuses the
    others.

    Each method that returns a setting also lists it in `known`, with its default, unit and bounds. After the code has
    asked for all settings of a scenario, `known` is the complete list of the settings that exist.

    >>> settings = Settings({"gravity": "3.7 m/s^2"})
    >>> settings.number("gravity", 9.81, Quantity("m/s^2", "assumed", 0.0, 100.0, "g"))
    3.7
    >>> settings.finish()
    """

    def __init__(self, values: Mapping[str, Any]):
        self.values = dict(values)
        self.known: dict[str, Setting] = {}

    def take(self, name: str, default: Any, choices: Collection[str] = (), source: str = "") -> Any:
        """Return the user's value of a setting, or the default if the user did not give the setting."""
        # The choices are not listed here, because listing them may take time: soils of other packages are looked up.
        return self._take_value(Setting(name, default, source=source, choices=choices))

    def number(self, name: str, default: float, spec: Quantity) -> float:
        """Return the value of a numeric setting in SI, or the default if the user did not give the setting.

        `spec` states the unit and the bounds.

        Raises ParameterError: the value is not a number, has a unit of another kind of quantity, or is out of bounds.
        """
        setting = Setting.of(name, default, spec)
        given = self._take_value(setting)
        value = parse_quantity(given, spec.unit, name)
        _check(setting, value, written_unit(given))
        self._in_force(name, value)
        return value

    def choice(self, name: str, default: str, choices: Mapping[str, Any], source: str) -> Any:
        """Return the object that the user chose by a word. `choices` maps each allowed word to its object.

        `default` is the word that applies if the user did not give the setting.

        Raises ParameterError: the word is not one of the choices.
        """
        return choices[one_of(name, self.take(name, default, choices, source), choices)]

    def word(self, name: str, default: str, choices: Collection[str], source: str) -> str:
        """Return the word that the user gave for a setting; an empty text if the user did not give the setting.

        `default` is the word that has the same effect as leaving the setting out. It appears in the list of settings,
        but it is never returned unless the user gave it.

        Raises ParameterError: the word is not one of `choices`.
        """
        value = self.values.get(name)
        word = self.take(name, default, choices, source)
        return "" if value is None else one_of(name, word, choices)

    def record(self, prefix: str, record: Record | type[Record]) -> dict[str, float]:
        """Return the user's values of the settings `prefix.FIELD`, where FIELD is a quantity of a record: field ->
        value (SI).

        The dict omits fields that the user did not give.

        Raises ParameterError: a value is not a number, has a unit of another kind of quantity, or is out of bounds.
        """
        base = record if isinstance(record, Record) else record()
        return self._given_values(numbers_of(base, prefix))

    def arguments(
        self, prefix: str, function: Callable[..., Any], overrides: Mapping[str, Any] = {}, names: Iterable[str] = ()
    ) -> dict[str, Any]:
        """Return the user's values of the settings `prefix.NAME`, where NAME is an argument of a function: name ->
        value (SI).

        The unit, bounds and source of an argument come from its annotation (see `spec`). The dict omits arguments that
        the user did not give.

        Parameters
        ----------
        prefix : str
            First part of the dotted names, such as "terrain".
        function : callable
            The function whose arguments can be set.
        overrides : mapping of str to Any
            Argument name -> the default that the list of settings shows instead of the function's own default.
        names : iterable of str
            If given, only the arguments with these names can be set.

        Raises ParameterError: a value is not of the argument's type, has a unit of another kind, or is out of bounds.
        """
        # The list of settings shows the defaults of the function, unless `overrides` replaces them.
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
        """Check that the code has asked for every setting that the user gave.

        Raises UnknownNameError: the code did not ask for a setting, so its name is unknown. The message lists similar
        names.
        """
        for name, value in self.values.items():
            hint = closest(name, self.known)
            # A unit at the end of the name is the most frequent mistake: `soil.k_mm=5` was meant as `soil.k=5mm`.
            stem, _, unit = name.rpartition("_")
            if stem in self.known and not math.isnan(factor_to(unit, self.known[stem].unit)):
                hint = f"did you mean {stem}={format_setting(value)}{unit}?"
            raise UnknownNameError(f"There is no setting '{name}' here: {hint}")

    def _given_values(self, settings: Iterable[Setting]) -> dict[str, Any]:
        """Return the user's values (SI) of some settings in a dict from the last part of the setting's name to the
        value.

        An angle may also be given in degrees, under its name followed by `_deg`. The dict omits settings that the user
        did not give, but they are listed as known.
        """
        values: dict[str, Any] = {}
        for setting in settings:
            written = written_unit(self.values.get(setting.name))
            key = setting.name.rpartition(".")[2]
            degrees = f"{setting.name}_deg" if setting.unit.startswith("rad") else ""
            # A plain value may state its own unit, for example `soil.k=5mm`.
            if setting.name in self.values:
                values[key] = _read(setting, self._take_value(setting))
            self._take_value(setting)
            # The name with `_deg` states the unit, so a number under this name is in degrees.
            if degrees in self.values:
                written = setting.unit.replace("rad", "deg")
                values[key] = parse_quantity(self.values.pop(degrees), setting.unit, degrees, written)
            # The bounds are checked in the unit that the user wrote, so that the error speaks of this number.
            if key in values:
                _check(setting, values[key], written)
                self._in_force(setting.name, values[key])
        return values

    def _in_force(self, name: str, value: Any) -> None:
        """Enter the user's value of a setting, in SI, into the list of known settings (`known`)."""
        self.known[name] = self.known[name]._replace(value=value)

    def _take_value(self, setting: Setting) -> Any:
        """Remove a setting from the user's values, list it as known, and return its value or its default."""
        value = self.values.pop(setting.name, setting.value)
        self.known[setting.name] = setting._replace(value=value)
        return value


SWITCHES = {"true": True, "1": True, "false": False, "0": False}
"""Words that a user may write for a setting that is True or False."""


def _read(setting: Setting, value: Any) -> Any:
    """Return a user's value of a setting, converted to the type of the setting's default.

    The default is a text, True or False, a number, or several numbers. Numbers are returned in SI, and several numbers
    are written as `50mm,100mm`.

    Raises ParameterError: the value cannot be converted.
    """
    # The type of the default decides how the text is read, from the simplest type to a tuple of numbers.
    if isinstance(setting.value, str):
        return str(value)
    if isinstance(setting.value, bool):
        word = str(value).lower().removesuffix(".0")
        return SWITCHES[one_of(setting.name, word, SWITCHES)]
    # A number; the unit of the setting applies if the text states none.
    if not isinstance(setting.value, tuple):
        return parse_quantity(value, setting.unit, setting.name)
    several = value.split(",") if isinstance(value, str) else value
    if not isinstance(several, (list, tuple)) or len(several) != len(setting.value):
        raise ParameterError(
            f"{setting.name} = {value!r} must be {len(setting.value)} numbers with commas between them, such as "
            "0.05,0.1."
        )
    return tuple(parse_quantity(part, setting.unit, setting.name) for part in several)


def _check(setting: Setting, value: Any, written: str) -> None:
    """Check that a number is within the bounds of its setting. `written` is the unit that the user wrote.

    Raises ParameterError: the number is out of bounds.
    """
    if isinstance(value, float) and math.isfinite(setting.low):
        check("", setting.name, value, Quantity(setting.unit, setting.source, setting.low, setting.high, ""), written)


def format_setting(value: Any) -> str:
    """Return a value as a user would write it on the command line after `--set NAME=`."""
    return f"{value:g}" if isinstance(value, float) else str(value)
