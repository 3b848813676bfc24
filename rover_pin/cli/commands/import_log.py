"""`rover-pin import-log`: a drive log out of somebody's recordings."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.cli.options import AsJson
from rover_pin.cli.terminal import report


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
    from rover_pin.logs.importing.import_log import import_log as imported
    from rover_pin.loop.data_check import check_data

    formulas: dict[str, str] = {}
    for assignment in column:
        name, equals, formula = assignment.partition("=")
        if not equals or name in formulas:
            raise ParameterError(f"--column {assignment}: give NAME=FORMULA, as body_x='x / 1000', once a name.")
        formulas[name] = formula
    drive_log = imported(files, rover, out, formulas, most)
    folder = drive_log.files[-1].parent
    result: dict[str, Any] = {
        "written": str(drive_log.files[-1]),
        "columns": list(drive_log.columns),
        "runs": list(drive_log.runs),
        "lacks": list(drive_log.lacks),
        "notes": list(drive_log.notes),
    }
    try:
        data_check = check_data(folder)
    except DataError:
        report(result, as_json)
        raise
    result |= {"holds": data_check.holds, "findings": list(map(str, data_check.findings))}
    result["next"] = f"too poor: {data_check.too_poor}" if data_check.too_poor else f"rover-pin close-loop {folder}"
    report(result, as_json)
