"""`rover-pin import-log`: a drive log out of somebody's recordings."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.commands.options import AsJson
from rover_pin.errors import DataError, ParameterError
from rover_pin.terminal import report


def import_log(
    files: Annotated[list[Path], typer.Argument(help="Recordings: CSV, Parquet, .mat, ROS 1 or 2 bags, MCAP.")],
    rover: Annotated[str, typer.Option(help="The rover that was driven: its name, or its TOML.")] = "nexus6",
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the log; the first file's name.")] = None,
    column: Annotated[
        list[str], typer.Option(metavar="NAME=FORMULA", help="What a column is, as wheel_rate_fl='v_l / 0.16'.")
    ] = [],  # noqa: B006 - typer wants a list
    most: Annotated[int, typer.Option(help="Runs to keep: of more, those that tell most.", min=1)] = 12,
    as_json: AsJson = False,
) -> None:
    """Make a drive log of recordings, and check it.

    Columns are guessed, runs are cut at stops and gaps, what is missing is said.
    """
    from rover_pin.importing.import_log import import_log as imported
    from rover_pin.loop.data_check import check_data

    told: dict[str, str] = {}
    for each in column:
        name, equals, formula = each.partition("=")
        if not equals or name in told:
            raise ParameterError(f"--column {each}: give NAME=FORMULA, as body_x='x / 1000', once a name.")
        told[name] = formula
    made = imported(files, rover, out, told, most)
    folder = made.files[-1].parent
    said: dict[str, Any] = {
        "written": str(made.files[-1]),
        "columns": list(made.columns),
        "runs": list(made.runs),
        "lacks": list(made.lacks),
        "notes": list(made.notes),
    }
    try:
        found = check_data(folder)
    except DataError:
        report(said, as_json)
        raise
    said |= {"holds": found.holds, "findings": list(map(str, found.findings))}
    said["next"] = f"too poor: {found.too_poor}" if found.too_poor else f"rover-pin close-loop {folder}"
    report(said, as_json)
