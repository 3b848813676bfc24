"""Completion in the shell: names of scenarios, soils, rovers and effects, and the settings of the command in the
line.
"""

from typing import TYPE_CHECKING

import typer

from rover_pin.base.errors import RoverPinError

if TYPE_CHECKING:
    from rover_pin.base.settings import Setting
    from rover_pin.scenarios.catalogue import Entry

SOIL = "soil."
"""Prefix of the names of the soil's settings. The command `identify` also accepts the names without this prefix."""
SETTING_OPTIONS = ("rover", "control", "gravity", "soil", "model", "add")
"""Options of the command `drive` that can also be given by --set."""


def scenario_names(begun: str) -> list[str]:
    """Return the names of the scenarios that begin with the letters typed so far."""
    from rover_pin.scenarios.scenes import SCENES

    return [name for name in SCENES if name.startswith(begun)]


def engine_names(begun: str) -> list[str]:
    """Return the names of the engines that begin with the letters typed so far."""
    from rover_pin.simulation.engines import ENGINES

    return [name for name in ENGINES if name.startswith(begun)]


def soil_names(begun: str) -> list[str]:
    """Return the names of the soils that begin with the letters typed so far."""
    from rover_pin.parameters import SOILS

    return [name for name in SOILS if name.startswith(begun)]


def rover_names(begun: str) -> list[str]:
    """Return the names of the package's rovers that begin with the letters typed so far."""
    from rover_pin.rover.description.layout import rover_folder

    return [name for name in sorted(file.stem for file in rover_folder().glob("*.toml")) if name.startswith(begun)]


def listed_entries(what: str) -> "list[Entry]":
    """Return the entries that `rover-pin list KIND` shows. `what` is the kind, such as "soils".

    For the kind "settings", the entries are the settings of the scenario `ditch`.
    """
    if what == "experiments":
        from rover_pin.loop.own_code import experiments

        return experiments()
    from rover_pin.scenarios import catalogue

    entries: list[Entry] = getattr(catalogue, what)()
    return entries


def listed_names(ctx: typer.Context, begun: str) -> list[tuple[str, str]]:
    """Return the names that may follow `rover-pin list KIND`, each with its description.

    For the kind `settings`, these are the names of scenarios. `begun` are the letters typed so far.
    """
    what = str(ctx.params.get("what") or "scenarios")
    entries = listed_entries("scenarios" if what == "settings" else what)
    return [(entry.name, entry.summary) for entry in entries if entry.name.startswith(begun)]


def effects_to_add(begun: str) -> list[tuple[str, str]]:
    """Return the completions of a value of `--add`, each with its description.

    Without a dot, these are the effects whose names begin with the letters typed so far. After `EFFECT.`, these are the
    numbers of this effect.
    """
    from rover_pin.scenarios.catalogue import effects

    # The user types the effect before the dot, and the name of one of its numbers after the dot.
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
    """Return the completions of a value of `--set`, each with the default, unit and source of the setting.

    Before the `=`, the completions are the names of settings that begin with the letters typed so far. After the `=`,
    they are the allowed words. The settings belong to the scenario in the command line, with its `--add`, `--model` and
    earlier `--set`; for `identify` they are the settings of the soil. A command line with an error gets no completion,
    because the command will report the error.
    """
    name, equals, value = begun.partition("=")
    try:
        settings = _settings(ctx)
    except (RoverPinError, typer.BadParameter):
        return []
    # After the `=`, only settings with a list of allowed words have completions.
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
    """Return the settings that exist for the command line that the user has typed so far."""
    from rover_pin.cli.terminal import assignments
    from rover_pin.scenarios import catalogue
    from rover_pin.scenarios.drive_file import is_drive_file
    from rover_pin.scenarios.scenes import SCENES

    options = {
        **{option: ctx.params.get(option) for option in SETTING_OPTIONS},
        **assignments(ctx.params.get("set_") or []),
    }
    overrides = {option: value if option == "add" else str(value) for option, value in options.items() if value}
    # `identify` has no scenario, and it accepts the names of the soil with and without their prefix.
    if ctx.info_name == "identify":
        soil = [setting for setting in catalogue.settings("flat") if setting.name.startswith(SOIL)]
        return [*soil, *(setting._replace(name=setting.name.removeprefix(SOIL)) for setting in soil)]
    # While the user types the value of an option, typer has not parsed the words before it, so they are still in args.
    words = (ctx.params.get("scenario"), ctx.params.get("name"), *ctx.args)
    scenario = next((word for word in words if word and (word in SCENES or is_drive_file(word))), "ditch")
    return catalogue.settings(scenario, **overrides)


def _setting_help(setting: "Setting") -> str:
    """Return the description of a setting in one line: its default, its unit and its source."""
    from rover_pin.base.settings import format_setting

    value = "" if setting.value in (None, "", ()) else f"{format_setting(setting.value)} {setting.unit}".strip()
    return ": ".join(part for part in (value, setting.source) if part)
