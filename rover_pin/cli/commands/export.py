"""`rover-pin export`, `export-c`, `export-fmu`, `export-mjcf`: write drives, controls and rovers for other programs."""

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.encode import shell_line
from rover_pin.base.errors import MissingExtraError
from rover_pin.base.extras import install_command
from rover_pin.base.files.results_folder import alone_in, say_what_is_replaced
from rover_pin.base.files.whole_file import replace_file
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
    Run,
    Set,
    SoilName,
    Trusted,
)
from rover_pin.cli.terminal import drive_settings, report

Scene = Annotated[
    str,
    typer.Argument(autocompletion=scenario_names, help="Scenario that gives the rover and its ground, such as ditch."),
]


class Kind(StrEnum):
    """The file formats that `rover-pin export` can write."""

    CSV = "csv"
    PARQUET = "parquet"
    MCAP = "mcap"
    RERUN = "rerun"


def export(
    path: Annotated[
        Path, typer.Argument(help="Folder of a drive log, a trace in .parquet, or the TOML file of a drive.")
    ],
    to: Annotated[
        Kind, typer.Option(help="Format: csv, parquet (for pandas), mcap (for Foxglove) or rerun.")
    ] = Kind.CSV,
    run: Run = "",
    trust: Trusted = False,
    out: Out = Path("out/export"),
    as_json: AsJson = False,
) -> None:
    """Write a drive as a table (CSV or Parquet), or as a recording for the viewers Foxglove (MCAP) or Rerun."""
    if to in (Kind.MCAP, Kind.RERUN) and find_spec(to.value) is None:
        # The package is needed last, but its absence is reported first, because to read the drive may take long.
        need = {Kind.MCAP: "MCAP needs the package mcap", Kind.RERUN: "Rerun needs the package rerun-sdk"}[to]
        raise MissingExtraError(f"An export to {need}, which is not installed. Run `{install_command(to.value)}`.")
    from rover_pin.cli.commands.view import read_subject
    from rover_pin.view import export as writing

    subject = read_subject(path, run, Trust(everything=trust))
    # The name of a format is the last part of the name of its writer, such as `write_mcap`.
    write = getattr(writing, f"write_{to.value}")
    file = out / f"{subject.trace.attrs.get('scenario', 'drive')}{'.rrd' if to is Kind.RERUN else f'.{to.value}'}"
    say_what_is_replaced(out, (file.name,))
    report({"exported": subject.name, "files": [str(write(file, subject))]}, as_json)


def export_c(
    scenario: Annotated[
        str,
        typer.Argument(
            autocompletion=scenario_names, help="Scenario that gives the rover and the soil to control, such as ditch."
        ),
    ],
    rover: RoverName = "",
    control: Control = "onboard",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006 - typer wants a list
    set_: Set = [],  # noqa: B006
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/control"),
    as_json: AsJson = False,
) -> None:
    """Write a controller as C code for an onboard computer, together with test vectors.

    The option --control can be eq9, onboard (the default), camera, true (your program provides the slip) or cmd-vel.
    """
    from rover_pin.onboard.embedded.folder import control_export, write_control
    from rover_pin.scenarios.scenario import scenario as ready

    settings = drive_settings(set_, rover=rover, control=control, gravity=gravity, soil=soil, model=model, add=add)
    settings["trust"] = Trust.of(effects, trust)
    chosen = ready(scenario, **settings)
    # The C code contains the numbers of this rover and this soil, so the scenario is made first.
    export = control_export(chosen.controller, chosen.model)
    say_what_is_replaced(out, ("rover_control.c",))
    with alone_in(out):
        files = write_control(export, out)
    # Without -ffp-contract=off, fused operations would round differently from the test vectors.
    build = "cc -std=c11 -O2 -ffp-contract=off rover_control.c test_vectors.c -lm -o test_vectors"
    result = {"control": control, "rover": export.rover.name, "build": build, "files": list(map(str, files))}
    report_assuming(result, chosen.assumptions, as_json, out)


def export_fmu(
    scenario: Scene,
    rover: RoverName = "",
    control: Control = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006
    set_: Set = [],  # noqa: B006
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/fmu"),
    as_json: AsJson = False,
) -> None:
    """Write a rover, and optionally its controller, as units of FMI 3.0 for co-simulation.

    If --control is given (eq9, onboard, camera, true or cmd-vel), the controller becomes a second unit.
    """
    from rover_pin.onboard.fmi.controller import unit_of
    from rover_pin.onboard.fmi.plant import plant
    from rover_pin.onboard.fmi.unit import write_unit
    from rover_pin.scenarios.scenario import scenario as ready

    settings = drive_settings(set_, rover=rover, control=control, gravity=gravity, soil=soil, model=model, add=add)
    settings["trust"] = Trust.of(effects, trust)
    chosen = ready(scenario, **settings)
    units = [plant(chosen.model, chosen.start, chosen.timing)]
    # The rover is the first unit; the control is a second unit, so that a user can replace it.
    units += [unit_of(chosen.controller, chosen.model)] if control else []
    say_what_is_replaced(out, tuple(f"{unit.name}.fmu" for unit in units))
    with alone_in(out):
        paths = [str(write_unit(unit, out / f"{unit.name}.fmu")) for unit in units]
    variables = {unit.name: unit.by_causality for unit in units}
    result = {"rover": chosen.model.rover.name, "step [s]": units[0].period, **variables, "files": paths}
    report_assuming(result, chosen.assumptions, as_json, out)


def export_mjcf(
    scenario: Scene,
    rover: RoverName = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006
    set_: Set = [],  # noqa: B006
    effects: Effects = None,
    trust: Trusted = False,
    out: Out = Path("out/mjcf"),
    as_json: AsJson = False,
) -> None:
    """Write a rover as a model for MuJoCo, and a Python program that drives the rover on its soil there."""
    from rover_pin.onboard.mujoco.mjcf import TIMESTEP, drive_text, mjcf
    from rover_pin.scenarios.scenario import scenario as ready

    settings = drive_settings(set_, rover=rover, gravity=gravity, soil=soil, model=model, add=add)
    settings["trust"] = Trust.of(effects, trust)
    chosen = ready(scenario, **settings)
    # The program contains the settings as text, and a path is not a plain value.
    settings = {name: str(value) if isinstance(value, Path) else value for name, value in chosen.settings.items()}
    texts = {
        out / "rover.xml": mjcf(chosen.model, chosen.start, min(TIMESTEP, chosen.timing.dt)),
        out / "drive.py": drive_text(chosen.name, settings, len(chosen.model.rover.wheels)),
    }
    say_what_is_replaced(out, tuple(file.name for file in texts))
    with alone_in(out):
        files = [str(replace_file(file, content)) for file, content in texts.items()]
    result = {"rover": chosen.model.rover.name, "files": files, "next": shell_line(["python", Path(files[1])])}
    report_assuming(result, chosen.assumptions, as_json, out)
