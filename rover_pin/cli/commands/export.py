"""`rover-pin export`, `export-c`, `export-fmu`, `export-mjcf`: a drive, a control, a rover for other tools."""

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import MissingExtraError
from rover_pin.base.files.results_folder import alone_in, say_what_is_replaced
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.trust import Trust
from rover_pin.cli.completing import scenario_names
from rover_pin.cli.options import Add, AsJson, Gravity, ModelFile, Set, SoilName, Trusted
from rover_pin.cli.terminal import drive_settings, report

Scene = Annotated[str, typer.Argument(autocompletion=scenario_names, help="The rover and its ground: ditch ...")]
Folder = Annotated[Path, typer.Option("--out", help="Folder for the files.")]


class Kind(StrEnum):
    """What a drive is exported to."""

    CSV = "csv"
    PARQUET = "parquet"
    MCAP = "mcap"
    RERUN = "rerun"


def export(
    path: Annotated[Path, typer.Argument(help="A drive log's folder, or a trace in .parquet.")],
    to: Annotated[Kind, typer.Option(help="csv, parquet (pandas), mcap (Foxglove), rerun.")] = Kind.CSV,
    run: Annotated[str, typer.Option(help="Which run of a log; its first, if not said.")] = "",
    trust: Trusted = False,
    out: Annotated[Path, typer.Option("--out", help="Folder for the file.")] = Path("out/export"),
    as_json: AsJson = False,
) -> None:
    """Write a drive as a table, for Foxglove (MCAP), or for Rerun."""
    if to in (Kind.MCAP, Kind.RERUN) and find_spec(to.value) is None:
        name = {Kind.MCAP: "MCAP needs the package mcap", Kind.RERUN: "Rerun needs the package rerun-sdk"}[to]
        raise MissingExtraError(f"Exporting to {name}: pip install 'rover-pin[{to.value}]'.")
    from rover_pin.cli.subject import read_subject
    from rover_pin.view import export as writing

    subject = read_subject(path, run, Trust(everything=trust))
    write = getattr(writing, f"write_{to.value}")
    file = out / f"{subject.trace.attrs.get('scenario', 'drive')}{'.rrd' if to is Kind.RERUN else f'.{to.value}'}"
    say_what_is_replaced(out, (file.name,))
    report({"exported": subject.name, "files": [str(write(file, subject))]}, as_json)


def export_c(
    scenario: Annotated[
        str, typer.Argument(autocompletion=scenario_names, help="The rover and soil to control: ditch, flat ...")
    ],
    control: Annotated[
        str, typer.Option(help="eq9 (the paper's), onboard, camera, true (slip is given), or cmd-vel.")
    ] = "onboard",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006 - typer wants a list
    set_: Set = [],  # noqa: B006
    out: Folder = Path("out/control"),
    as_json: AsJson = False,
) -> None:
    """Write a slip control, or cmd-vel, as C, with test vectors."""
    from rover_pin.control.embedded.folder import taken_away, write_control
    from rover_pin.scenarios.scenario import scenario as ready

    chosen = ready(scenario, **drive_settings(control, gravity, soil, model, add, set_))
    taken = taken_away(chosen.controller, chosen.model)
    say_what_is_replaced(out, ("rover_control.c",))
    with alone_in(out):
        files = write_control(taken, out)
    build = "cc -std=c11 -O2 -ffp-contract=off rover_control.c test_vectors.c -lm -o test_vectors"
    report({"control": control, "rover": taken.rover.name, "build": build, "files": list(map(str, files))}, as_json)


def export_fmu(
    scenario: Scene,
    control: Annotated[
        str, typer.Option(help="Of the second unit: eq9, onboard, camera, true (slip is given), or cmd-vel.")
    ] = "",
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006
    set_: Set = [],  # noqa: B006
    out: Folder = Path("out/fmu"),
    as_json: AsJson = False,
) -> None:
    """Write a rover, and a slip control, as FMI 3.0 units."""
    from rover_pin.control.fmi.controller import unit_of
    from rover_pin.control.fmi.plant import plant
    from rover_pin.control.fmi.unit import write_unit
    from rover_pin.scenarios.scenario import scenario as ready

    chosen = ready(scenario, **drive_settings(control, gravity, soil, model, add, set_))
    units = [plant(chosen.model, chosen.start, chosen.timing)]
    units += [unit_of(chosen.controller, chosen.model)] if control else []
    say_what_is_replaced(out, tuple(f"{unit.name}.fmu" for unit in units))
    with alone_in(out):
        paths = [str(write_unit(unit, out / f"{unit.name}.fmu")) for unit in units]
    variables = {unit.name: unit.by_causality for unit in units}
    report({"rover": chosen.model.rover.name, "step [s]": units[0].period, **variables, "files": paths}, as_json)


def export_mjcf(
    scenario: Scene,
    gravity: Gravity = "",
    soil: SoilName = "",
    model: ModelFile = None,
    add: Add = [],  # noqa: B006
    set_: Set = [],  # noqa: B006
    out: Folder = Path("out/mjcf"),
    as_json: AsJson = False,
) -> None:
    """Write a rover for MuJoCo, and how to drive it on its soil."""
    from rover_pin.control.mujoco.mjcf import TIMESTEP, drive_text, mjcf
    from rover_pin.scenarios.scenario import scenario as ready

    chosen = ready(scenario, **drive_settings("", gravity, soil, model, add, set_))
    settings = {name: str(value) if isinstance(value, Path) else value for name, value in chosen.settings.items()}
    texts = {
        out / "rover.xml": mjcf(chosen.model, chosen.start, min(TIMESTEP, chosen.timing.dt)),
        out / "drive.py": drive_text(scenario, settings, len(chosen.model.rover.wheels)),
    }
    say_what_is_replaced(out, tuple(file.name for file in texts))
    with alone_in(out):
        files = [str(replace_file(file, content)) for file, content in texts.items()]
    report({"rover": chosen.model.rover.name, "files": files, "next": f"python {files[1]}"}, as_json)
