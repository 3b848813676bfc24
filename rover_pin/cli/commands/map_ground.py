"""`rover-pin map`: maps a rover's slip, energy and risk of getting stuck over the terrain of a scenario."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import ParameterError
from rover_pin.base.trust import Trust
from rover_pin.cli.assumed import report_assuming
from rover_pin.cli.completing import scenario_names
from rover_pin.cli.options import (
    Add,
    AsJson,
    Control,
    Effects,
    Gravity,
    ModelFile,
    Out,
    RoverName,
    Scheduler,
    Set,
    SoilName,
    Trusted,
    Workers,
)
from rover_pin.cli.terminal import drive_settings, stoppable


def map_ground(
    scenario: Annotated[
        str,
        typer.Argument(
            autocompletion=scenario_names,
            help="Scenario that gives the terrain, such as hills, or grid with --set terrain.path=dem.tif.",
        ),
    ],
    rover: RoverName = "",
    control: Control = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006 - typer wants a list
    set_: Set = [],  # noqa: B006
    spacing: Annotated[
        str,
        typer.Option(
            help="Distance between the places of the map [m]; by default the rover's length, or a longer distance that "
            "gives about 200 places."
        ),
    ] = "0",
    headings: Annotated[int, typer.Option(help="Number of headings at each place; the worst result counts.")] = 8,
    box: Annotated[
        str, typer.Option(help="Mapped area as X_FROM,X_TO,Y_FROM,Y_TO [m]; by default the whole terrain.")
    ] = "",
    workers: Workers = 0,
    scheduler: Scheduler = "",
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/map"),
    as_json: AsJson = False,
) -> None:
    """Map the slip, the energy per metre and the probability of getting stuck over a terrain.

    The probability needs a folder of models (--model); with one model, the map states only whether the rover gets
    stuck. The rover drives straight ahead, so --control must be a controller without turns, such as none, cmd-vel or
    eq9. If a map was stopped, the same command finishes it.
    """
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.comparison.ground_map import MapSettings, ground_map
    from rover_pin.simulation.model.toml_file import models_of

    settings = drive_settings(set_, rover=rover, control=control, gravity=gravity, soil=soil) | (
        {"add": " ".join(add)} if add else {}
    )
    # An empty --box means the whole terrain.
    ends = tuple(parse_quantity(end, "m", "--box") for end in box.split(",") if box)
    if len(ends) not in (0, 4):
        raise ParameterError(
            f"--box {box} is not allowed: give four limits X_FROM,X_TO,Y_FROM,Y_TO [m], such as 0,5,-2,2."
        )
    places = MapSettings(parse_quantity(spacing, "m", "--spacing"), headings)
    if ends:
        places = replace(places, box=(ends[0], ends[1], ends[2], ends[3]))
    # Without --model, the map is made for the model of the settings; for a folder, each of its models is driven.
    files, allowed = models_of(model) if model else (), Trust.of(effects, trust)
    with stoppable():
        _, summary = ground_map(scenario, settings, files, out, places, allowed, workers or None, scheduler or None)
    assumptions = summary.pop("assumptions")
    report_assuming({"scenario": scenario, **summary}, assumptions, as_json, out)
