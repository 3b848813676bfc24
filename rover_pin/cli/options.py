"""The options that several commands share. An option has one meaning, one type and one help text in all commands.

A command may choose its own default, which its help shows. `tests/cli/test_options.py` checks that everything else is
equal.
"""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.completing import effects_to_add, rover_names, settings_to_set, soil_names

OUT = typer.Option("--out", help="Folder for the results; for new-rover, the TOML file to write.")
Out = Annotated[Path, OUT]
NamedOut = Annotated[Path | None, OUT]
"""The option --out of commands that name the folder of results after their input if the option is not given."""
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object, for programs, instead of a table.")]
Set = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        autocompletion=settings_to_set,
        help="Change a setting, such as soil.k=5mm; `rover-pin list settings` prints all settings; can be repeated.",
    ),
]
Add = Annotated[
    list[str],
    typer.Option(
        "--add",
        metavar="EFFECT[.name=value]",
        autocompletion=effects_to_add,
        help="Add an effect to the model, such as DiggingMemory.c_d=0.1; can be repeated.",
    ),
]
RoverName = Annotated[
    str,
    typer.Option(
        "--rover",
        autocompletion=rover_names,
        help="Name from `rover-pin list rovers`, or your rover's TOML file; nexus6 by default.",
    ),
]
SoilName = Annotated[
    str,
    typer.Option(
        "--soil", autocompletion=soil_names, help="Name from `rover-pin list soils`; the rover's soil by default."
    ),
]
Gravity = Annotated[
    str,
    typer.Option(
        "--gravity", help="earth, moon, mars, or a number [m/s^2]; by default from the model, or Earth's without one."
    ),
]
Control = Annotated[
    str,
    typer.Option(
        "--control",
        help="The controller: none (constant duty), limit (of the torque), eq9 (the paper's slip control), onboard, "
        "camera, tracked, true, turn, point-turn, crab, cmd-vel (speed and yaw rate), rates, route; or your .py file.",
    ),
]
Effects = Annotated[
    Path | None,
    typer.Option("--effects", help="File of your own effect (.py), or a folder of such files; their code will run."),
]
Trusted = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run all code and read all files that the given files name. Read the given files before you use this.",
    ),
]
ModelFile = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="Model file, which states rover, soils, motor and effects. drive, bounds, map and tune also take a folder "
        "of equally probable models, such as the folder posterior that close-loop writes.",
    ),
]
Scheduler = Annotated[
    str,
    typer.Option(
        "--scheduler", help="Address of a Dask scheduler, such as tcp://127.0.0.1:8786; its workers run the jobs."
    ),
]
Workers = Annotated[int, typer.Option("--workers", help="Number of processes; 0 means one for each core.")]
Run = Annotated[str, typer.Option("--run", help="Name of the run of a drive log; the first run by default.")]
Gif = Annotated[bool, typer.Option("--gif", help="Write drive.gif, a moving picture.")]
Mp4 = Annotated[bool, typer.Option("--mp4", help="Write drive.mp4, a film; needs ffmpeg.")]
Open = Annotated[
    bool, typer.Option("--open", help="Write the page that shows the result, and open it in your browser.")
]
Radius = Annotated[str, typer.Option("--r", help="Radius of the wheels, such as 45mm.")]
Width = Annotated[str, typer.Option("--b", help="Width of the wheels, such as 50mm.")]
Column = Annotated[
    list[str],
    typer.Option(
        "--column",
        metavar="NAME=FORMULA",
        help="A column and the formula that gives it from the columns of your file, such as load_N='9.81 * m' or "
        "wheel_rate_fl='v_l / 0.16'; can be repeated.",
    ),
]
FailOn = Annotated[
    str,
    typer.Option(
        "--fail-on",
        metavar="ANSWERS",
        help="Answers, separated by commas, at which the command ends with exit code 3, so that a CI job fails: named, "
        "set, like, inadequate, none-needed, none-fits, cannot-tell.",
    ),
]
FAILED = 3
"""Exit code of close-loop if the option `--fail-on` lists its answer. The codes 0, 1 and 2 have other meanings: any
other answer (0), a failed run (1), and refused data or options (2)."""
