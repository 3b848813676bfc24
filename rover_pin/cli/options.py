"""The options that several commands share. An option has one meaning, one type and one help text in all commands.

A command may choose its own default, which its help shows. `tests/cli/test_options.py` checks that everything else is
equal.
"""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.cli.completing import effects_to_add, rover_names, settings_to_set, soil_names

OUT = typer.Option("--out", help="Where the results are written: a folder; for new-rover the TOML.")
Out = Annotated[Path, OUT]
NamedOut = Annotated[Path | None, OUT]
"""The option --out of commands that name the folder of results after their input if the option is not given."""
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for programs instead of the table.")]
Set = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        autocompletion=settings_to_set,
        help="Change a setting that `rover-pin list settings` shows, as soil.k=5mm; can be repeated.",
    ),
]
Add = Annotated[
    list[str],
    typer.Option(
        "--add",
        metavar="EFFECT[.name=value]",
        autocompletion=effects_to_add,
        help="Add an effect to the model, as DiggingMemory.c_d=0.1; can be repeated.",
    ),
]
RoverName = Annotated[
    str,
    typer.Option(
        "--rover", autocompletion=rover_names, help="A rover of `rover-pin list rovers`, or your rover's TOML; nexus6."
    ),
]
SoilName = Annotated[
    str, typer.Option("--soil", autocompletion=soil_names, help="A soil of `rover-pin list soils`; the rover's own.")
]
Gravity = Annotated[
    str, typer.Option("--gravity", help="earth, moon, mars, or a number in m/s^2; the model's, else that of the Earth.")
]
Control = Annotated[
    str,
    typer.Option(
        "--control",
        help="How the wheels are driven: none, limit (of the torque), eq9 (the paper's slip control), onboard, camera, "
        "tracked, true, turn, point-turn, crab, cmd-vel (speed and yaw rate), rates, route; or your own .py file.",
    ),
]
Effects = Annotated[
    Path | None, typer.Option("--effects", help="Your own effect's .py file, or a folder of them, whose code may run.")
]
Trusted = Annotated[
    bool,
    typer.Option(
        "--trust", help="Let the given files run all code and read all files that they name: check them first."
    ),
]
ModelFile = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="A model file: rover, soils, motor, all effects. drive, bounds, map and tune also take a folder of "
        "equally probable models, such as a close-loop's posterior.",
    ),
]
Scheduler = Annotated[
    str,
    typer.Option(
        "--scheduler", help="Address of a Dask scheduler, as tcp://127.0.0.1:8786, whose workers do the work."
    ),
]
Workers = Annotated[int, typer.Option("--workers", help="Number of processes; 0 takes all cores.")]
Run = Annotated[str, typer.Option("--run", help="Which run of a drive log; the first if not given.")]
Gif = Annotated[bool, typer.Option("--gif", help="Write drive.gif, a moving picture.")]
Mp4 = Annotated[bool, typer.Option("--mp4", help="Write drive.mp4, a film; needs ffmpeg.")]
Open = Annotated[
    bool, typer.Option("--open", help="Write the page that shows the result, and open it in your browser.")
]
Radius = Annotated[str, typer.Option("--r", help="Radius of the wheels, as 45mm.")]
Width = Annotated[str, typer.Option("--b", help="Width of the wheels, as 50mm.")]
Column = Annotated[
    list[str],
    typer.Option(
        "--column",
        metavar="NAME=FORMULA",
        help="What a column is, as load_N='9.81 * m' or wheel_rate_fl='v_l / 0.16'; can be repeated.",
    ),
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
"""Exit code of close-loop if its answer is one of those in `--fail-on`. Exit code 0 means another answer, 1 a failed
run, and 2 that the data or the options were refused."""
