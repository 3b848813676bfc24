"""What the shell completes: scenarios, soils, effects, and the settings of the very drive that is being typed."""

from typing import TYPE_CHECKING

import typer

from rover_pin.base.errors import RoverPinError

if TYPE_CHECKING:
    from rover_pin.base.settings import Setting
    from rover_pin.scenarios.catalogue import Entry

SOIL = "soil."
"""Start of the settings that `identify` takes, with or without it."""
ITS_OWN = ("control", "gravity", "soil", "model", "add")
"""Options of a drive that are settings too."""


def scenario_names(begun: str) -> list[str]:
    """Return the scenarios that begin so."""
    from rover_pin.scenarios.scenes import SCENES

    return [name for name in SCENES if name.startswith(begun)]


def soil_names(begun: str) -> list[str]:
    """Return the soils that begin so."""
    from rover_pin.parameters import SOILS

    return [name for name in SOILS if name.startswith(begun)]


def listed_names(ctx: typer.Context, begun: str) -> list[tuple[str, str]]:
    """Return what `list` can tell alone, by what it lists: of settings, the scenarios; each with what it is."""
    from rover_pin.scenarios import catalogue

    what = str(ctx.params.get("what") or "scenarios")
    entries: list[Entry] = getattr(catalogue, "scenarios" if what == "settings" else what)()
    return [(entry.name, entry.summary) for entry in entries if entry.name.startswith(begun)]


def effects_to_add(begun: str) -> list[tuple[str, str]]:
    """Return the effects that begin so, or after `EFFECT.` its numbers: as `--add` takes them."""
    from rover_pin.scenarios.catalogue import effects

    kind, dot, number = begun.partition(".")
    if not dot:
        return [(entry.name, entry.summary) for entry in effects() if entry.name.startswith(kind)]
    chosen = [entry for entry in effects() if entry.name == kind]
    return [
        (f"{kind}.{setting.name}=", _setting_help(setting))
        for entry in chosen
        for setting in entry.numbers
        if setting.name.startswith(number)
    ]


def settings_to_set(ctx: typer.Context, begun: str) -> list[tuple[str, str]]:
    """Return the settings that begin so, each with its `=`, default and unit; after the `=`, the words it may be.

    They are those of the scenario that was typed before, with its `--add`, `--model` and earlier `--set`; of `identify`
    the soil's. What is refused there has nothing to complete: the command itself will say so.
    """
    name, equals, value = begun.partition("=")
    try:
        settings = _settings(ctx)
    except (RoverPinError, typer.BadParameter):
        return []
    if equals:
        return [
            (f"{name}={word}", "")
            for setting in settings
            if setting.name == name
            for word in setting.choices
            if word.startswith(value)
        ]
    return [(f"{setting.name}=", _setting_help(setting)) for setting in settings if setting.name.startswith(name)]


def _settings(ctx: typer.Context) -> "list[Setting]":
    from rover_pin.cli.terminal import assignments
    from rover_pin.scenarios import catalogue
    from rover_pin.scenarios.scenes import SCENES

    options = {**{option: ctx.params.get(option) for option in ITS_OWN}, **assignments(ctx.params.get("set_") or [])}
    overrides = {option: value if option == "add" else str(value) for option, value in options.items() if value}
    if ctx.info_name == "identify":
        soil = [setting for setting in catalogue.settings("flat") if setting.name.startswith(SOIL)]
        return [*soil, *(setting._replace(name=setting.name.removeprefix(SOIL)) for setting in soil)]
    # The option whose value is being typed keeps words before it from being taken: they are still in args.
    words = (ctx.params.get("scenario"), ctx.params.get("name"), *ctx.args)
    scenario = next((word for word in words if word in SCENES), "ditch")
    return catalogue.settings(scenario, **overrides)


def _setting_help(setting: "Setting") -> str:
    """Return a setting's default with its unit and source, in a line."""
    from rover_pin.base.settings import format_setting

    value = "" if setting.value in (None, "", ()) else f"{format_setting(setting.value)} {setting.unit}".strip()
    return ": ".join(part for part in (value, setting.source) if part)
