"""The options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.completing import effects_to_add, settings_to_set, soil_names

Out = Annotated[Path, typer.Option("--out", help="Folder for the results.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines instead of the table.")]
Set = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        autocompletion=settings_to_set,
        help="Change anything of rover-pin list settings.",
    ),
]
Add = Annotated[
    list[str],
    typer.Option(
        "--add",
        metavar="EFFECT[.name=value]",
        autocompletion=effects_to_add,
        help="Add an effect, as DiggingMemory.c_d=0.1.",
    ),
]
SoilName = Annotated[str, typer.Option("--soil", autocompletion=soil_names, help="A soil: rover-pin list soils.")]
Gravity = Annotated[str, typer.Option("--gravity", help="earth, moon, mars, or m/s^2; else the model's, else Earth's.")]
Effects = Annotated[
    Path | None, typer.Option("--effects", help="Your own effect's .py file, or a folder of them: its code may run.")
]
Trusted = Annotated[
    bool, typer.Option("--trust", help="Let a model or data run all code, and read all files, that they name.")
]
ModelFile = Annotated[Path | None, typer.Option("--model", help="A model file: rover, soils, motor, all effects.")]
Scheduler = Annotated[
    str,
    typer.Option("--scheduler", help="Address of a Dask scheduler, as tcp://127.0.0.1:8786: its workers do the work."),
]
FailOn = Annotated[
    str,
    typer.Option(
        "--fail-on",
        metavar="ANSWERS",
        help="End with exit code 3 at these answers, for CI: named, set, like, inadequate, none-needed, none-fits, "
        "cannot-tell, separated by commas.",
    ),
]
FAILED = 3
"""Exit code where the answer is one of `--fail-on`; 0 is any other, 1 a failed run, 2 what was refused."""
