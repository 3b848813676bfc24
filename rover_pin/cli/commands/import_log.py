"""`rover-pin import-log`: makes a drive log from recordings of other programs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import DataError
from rover_pin.cli.options import AsJson, Column, NamedOut, RoverName
from rover_pin.cli.terminal import formulas, report


def import_log(
    files: Annotated[list[Path], typer.Argument(help="Recordings: CSV, Parquet, .mat, ROS 1 or 2 bags, MCAP.")],
    rover: RoverName = "",
    out: NamedOut = None,
    column: Column = [],  # noqa: B006 - typer wants a list
    most: Annotated[
        int, typer.Option(help="Maximum number of runs; if there are more, the most informative runs are kept.", min=1)
    ] = 12,
    as_json: AsJson = False,
) -> None:
    """Make a drive log of recordings, and check it. The folder has the first file's name by default.

    Columns are recognised by name, unit and values; runs are cut at stops and gaps; missing channels are listed.
    """
    from rover_pin.importing.import_log import import_log as imported
    from rover_pin.loop.data_check import check_data

    drive_log = imported(files, rover or "nexus6", out, formulas(column), most)
    folder = drive_log.files[-1].parent
    result: dict[str, Any] = {
        "written": str(drive_log.files[-1]),
        "columns": list(drive_log.columns),
        "runs": list(drive_log.runs),
        "lacks": list(drive_log.lacks),
        "notes": list(drive_log.notes),
    }
    # The new log is checked as close-loop would check it, so that the user sees its faults now.
    try:
        data_check = check_data(folder)
    # Also if the check refuses the new log, the user sees how its columns were read.
    except DataError:
        report(result, as_json)
        raise
    result |= {"holds": data_check.holds, "findings": list(map(str, data_check.findings))}
    result["next"] = (
        f"too poor: {data_check.too_poor}" if data_check.too_poor else f"rover-pin close-loop {shell_word(folder)}"
    )
    report(result, as_json)
