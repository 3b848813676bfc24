"""`rover-pin list`: what there is to choose from, with unit, bounds, default and source."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rover_pin.base.errors import ParameterError, closest
from rover_pin.cli.completing import listed_names, settings_to_set
from rover_pin.cli.terminal import assignments, fact, json_text, numbers_table, report

if TYPE_CHECKING:
    from rover_pin.base.settings import Setting
    from rover_pin.scenarios.catalogue import Entry


class What(StrEnum):
    """What can be listed."""

    SCENARIOS = "scenarios"
    SOILS = "soils"
    ROVERS = "rovers"
    EFFECTS = "effects"
    SAMPLES = "samples"
    SETTINGS = "settings"


def list_(
    what: Annotated[What | None, typer.Argument(help="What to list; the names of all without it.")] = None,
    name: Annotated[
        str,
        typer.Argument(autocompletion=listed_names, help="One of them, with its numbers; of settings: the scenario."),
    ] = "",
    set_: Annotated[
        list[str],
        typer.Option(
            "--set", metavar="NAME=VALUE", autocompletion=settings_to_set, help="Settings as driven, as control=eq9."
        ),
    ] = [],  # noqa: B006 - typer wants a list
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List scenarios, soils, rovers, effects, samples or settings. Each number has unit, default, bounds and source."""
    from rover_pin.scenarios import catalogue

    if what is None:
        names = {kind.value: [entry.name for entry in getattr(catalogue, kind)()] for kind in What}
        summary = {name: ", ".join(kind_names) for name, kind_names in names.items()}
        report(
            names if as_json else {**summary, "next": "rover-pin list soils, rover-pin list soils dry-sand"}, as_json
        )
        return
    if what is What.SETTINGS:
        _say_settings(catalogue.settings(name or "ditch", **assignments(set_)), as_json)
        return
    entries: list[Entry] = getattr(catalogue, what.value)()
    if name:
        entries = [entry for entry in entries if entry.name == name] or _refuse_name(what, name, entries)
    if as_json:
        print(json_text({what.value: [entry.as_dict() for entry in entries]}))
    elif name:
        _say_one(entries[0])
    else:
        _say_all(entries)


def _refuse_name(what: What, name: str, entries: list["Entry"]) -> Any:
    raise ParameterError(f"There is no {what.removesuffix('s')} '{name}': {closest(name, (e.name for e in entries))}")


def _say_settings(settings: list["Setting"], as_json: bool) -> None:
    from rover_pin.scenarios.catalogue import plain

    if as_json:
        print(json_text({"settings": [plain(setting) for setting in settings]}))
        return
    numbers_table(settings)
    print("\nGive them as --set NAME=VALUE, with a unit if you like: soil.k=5mm, terrain.wall_angle=40deg.")


def _say_all(entries: list["Entry"]) -> None:
    width = max(len(entry.name) for entry in entries)
    group = ""
    for entry in entries:
        if entry.facts.get("acts", group) != group:
            group = entry.facts["acts"]
            print(f"{group}:")
        print(f"{entry.name:{width}}  {entry.summary}")


def _say_one(entry: "Entry") -> None:
    print(f"{entry.name}: {entry.summary}")
    for name, value in entry.facts.items():
        if value or value == 0:
            print(fact(name, value))
    if entry.numbers:
        print()
        numbers_table(entry.numbers)
