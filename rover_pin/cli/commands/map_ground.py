"""`rover-pin map`: what becomes of a rover all over its ground."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import ParameterError
from rover_pin.base.trust import Trust
from rover_pin.cli.completing import scenario_names
from rover_pin.cli.options import Add, AsJson, Effects, Gravity, ModelFile, Scheduler, Set, SoilName, Trusted
from rover_pin.cli.terminal import drive_settings, report, stoppable


def map_ground(
    scenario: Annotated[
        str, typer.Argument(autocompletion=scenario_names, help="hills, grid (with --set terrain.path=dem.tif) ...")
    ],
    control: Annotated[str, typer.Option(help="As of drive; it drives straight on: none, cmd-vel, eq9 ...")] = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006 - typer wants a list
    set_: Set = [],  # noqa: B006
    spacing: Annotated[str, typer.Option(help="Between places [m]; the rover's length, or 200 places.")] = "0",
    headings: Annotated[int, typer.Option(help="Evenly around each place; the worst counts.")] = 8,
    box: Annotated[str, typer.Option(help="X_FROM,X_TO,Y_FROM,Y_TO of the places [m]; else all of the ground.")] = "",
    workers: Annotated[int, typer.Option(help="Processes; 0 for all cores.")] = 0,
    scheduler: Scheduler = "",
    effects: Effects = None,
    trust: Trusted = False,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")] = Path("out/map"),
    as_json: AsJson = False,
) -> None:
    """Map slip, energy per metre and P(stuck) over the ground. P(stuck) takes a folder of models; it resumes."""
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.comparison.ground_map import ground_map
    from rover_pin.simulation.model.toml_file import models_of

    settings = drive_settings(control, gravity, soil, None, [], set_) | ({"add": " ".join(add)} if add else {})
    ends = tuple(parse_quantity(end, "m", "--box") for end in box.split(",") if box)
    if len(ends) not in (0, 4):
        raise ParameterError(f"--box {box} is not allowed: give four ends, X_FROM,X_TO,Y_FROM,Y_TO, as 0,5,-2,2.")
    places = {"spacing": parse_quantity(spacing, "m", "--spacing"), "headings": headings} | (
        {"box": ends} if ends else {}
    )
    files, allowed = models_of(model) if model else (), Trust.of(effects, trust)
    with stoppable():
        _, summary = ground_map(scenario, settings, files, out, places, allowed, workers or None, scheduler or None)
    report({"scenario": scenario, **summary}, as_json)
