"""`rover-pin list`: prints what a user can choose, with unit, bounds, default and source of each number."""

from enum import StrEnum
from typing import Annotated

import typer

from rover_pin.base.console import say
from rover_pin.base.errors import ParameterError, closest
from rover_pin.cli.completing import listed_entries, listed_names
from rover_pin.cli.options import AsJson, Set
from rover_pin.cli.terminal import assignments, fact, json_text, numbers_table, report


class What(StrEnum):
    """The kinds of choices that `rover-pin list` can list."""

    SCENARIOS = "scenarios"
    SOILS = "soils"
    ROVERS = "rovers"
    EFFECTS = "effects"
    EXPERIMENTS = "experiments"
    SAMPLES = "samples"
    SETTINGS = "settings"


def list_(
    what: Annotated[
        What | None, typer.Argument(help="Kind of choice to list; by default the names of all kinds are listed.")
    ] = None,
    name: Annotated[
        str,
        typer.Argument(
            autocompletion=listed_names, help="Name of one entry, to print its numbers; for settings, a scenario."
        ),
    ] = "",
    set_: Set = [],  # noqa: B006 - typer wants a list
    as_json: AsJson = False,
) -> None:
    """List scenarios, soils, rovers, effects, experiments, samples or settings.

    Each number is listed with its unit, default, bounds and source. If another installed package offers an effect, a
    soil or an experiment, the name of this package is listed too.
    """
    from rover_pin.scenarios import catalogue

    # Without an argument, only the names of all kinds are listed, because all numbers would fill many screens.
    if what is None:
        names = {kind.value: [entry.name for entry in listed_entries(kind)] for kind in What}
        summary = {name: ", ".join(kind_names) for name, kind_names in names.items()}
        report(
            names if as_json else {**summary, "next": "rover-pin list soils, rover-pin list soils dry-sand"}, as_json
        )
        return
    # The settings depend on the scenario and on other settings, so a scenario is made to list them.
    if what is What.SETTINGS:
        settings = catalogue.settings(name or "ditch", **assignments(set_))
        if as_json:
            say(json_text({"settings": [catalogue.plain(setting) for setting in settings]}))
        else:
            numbers_table(settings)
            say("\nChange a setting by --set NAME=VALUE, such as --set soil.k=5mm or --set terrain.wall_angle=40deg.")
        return
    entries = listed_entries(what)
    if name:
        known = [entry.name for entry in entries]
        entries = [entry for entry in entries if entry.name == name]
        if not entries:
            raise ParameterError(f"There is no {what.removesuffix('s')} '{name}': {closest(name, known)}")
    if as_json:
        say(json_text({what.value: [entry.as_dict() for entry in entries]}))
    elif name:
        # One name: its facts and its numbers. An empty fact is not printed, but a zero is a fact.
        (entry,) = entries
        say(f"{entry.name}: {entry.summary}")
        for fact_name, value in entry.facts.items():
            if value or value == 0:
                say(fact(fact_name, value))
        if entry.numbers:
            say()
            numbers_table(entry.numbers)
    else:
        # All names, one line each; effects are sorted by the place where they act, which heads each group.
        width = max(len(entry.name) for entry in entries)
        group = ""
        for entry in entries:
            if entry.facts.get("acts", group) != group:
                group = entry.facts["acts"]
                say(f"{group}:")
            package = entry.facts.get("package", catalogue.OWN_PACKAGE)
            source = f" (from {package})" if package != catalogue.OWN_PACKAGE else ""
            say(f"{entry.name:{width}}  {entry.summary}{source}")
