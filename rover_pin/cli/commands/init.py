"""`rover-pin init`: makes a wheel-rig set from a user's table of measurements."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rover_pin.base.encode import shell_word
from rover_pin.base.errors import ParameterError, RoverPinError
from rover_pin.cli.options import AsJson, Column, Gravity, NamedOut, Radius, Width
from rover_pin.cli.terminal import assignments, formulas, report


def init(
    table: Annotated[
        Path,
        typer.Argument(help="CSV or Parquet file with one row for each run: slip, load and the measured channels."),
    ],
    radius: Radius,
    width: Width,
    noise: Annotated[
        list[str],
        typer.Option(
            metavar="CHANNEL=SD",
            help="SD of a channel in one run, as drawbar_pull=0.5N; by default estimated from repeats.",
        ),
    ] = [],  # noqa: B006 - typer wants a list
    column: Column = [],  # noqa: B006
    slip_definition: Annotated[
        str, typer.Option(help="What the slips are divided by: eq-1 (the faster), over-travel-speed, over-rim-speed.")
    ] = "eq-1",
    gravity: Gravity = "",
    out: NamedOut = None,
    as_json: AsJson = False,
) -> None:
    """Make a wheel-rig set out of a table of your own, and check it; close-loop and identify read the set.

    Columns are recognised by name and unit. The noise of a channel is taken from repeated runs, from a column of its
    SD, or from --noise. How every column was read is printed, also where the table is refused.
    """
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.contact import Wheel
    from rover_pin.loop.data_check import check_data
    from rover_pin.measurements.checks import SLIP_DEFINITIONS
    from rover_pin.measurements.foreign_rig import RigTable, channel_unit, gravity_note, write_rig_set
    from rover_pin.parameters.gravity import gravity_named

    stated = {
        name: parse_quantity(sd, channel_unit(name), f"--noise {name}")
        for name, sd in assignments(noise, "--noise").items()
    }
    columns = formulas(column)
    if slip_definition not in SLIP_DEFINITIONS:
        raise ParameterError(f"--slip-definition {slip_definition}: choose one of {', '.join(SLIP_DEFINITIONS)}.")
    # Gravity at the test converts masses to weights.
    at_test = gravity_named(gravity) if gravity else None
    wheel = Wheel(r=parse_quantity(radius, "m", "--r"), b=parse_quantity(width, "m", "--b"))
    # The data set lies next to the table, in a folder with the name of the table, unless --out names another.
    folder = table.with_suffix("") if out is None else out
    if folder == table:
        raise ParameterError(f"{table}: the data set needs a folder of its own: name the folder with --out FOLDER.")

    read = RigTable(table, columns)
    files: list[Path] = []
    try:
        points = read.points(wheel, slip_definition)
        read.notes += filter(None, [gravity_note(points, at_test)])
        # The stated noise is used for its channels; the noise of the others comes from repeated runs or a column of
        # SDs.
        sds = read.noise(points, stated, slip_definition)
        is_new = not folder.exists()
        files = write_rig_set(folder, table.stem, points, wheel, sds, at_test, slip_definition)
        # The new set is read back and checked as close-loop would check it.
        data_check = check_data(folder)
    except RoverPinError:
        # A set that cannot be used is removed. The printed reading of the columns helps the user to correct the table.
        for file in files:
            file.unlink(missing_ok=True)
        if files and is_new:
            folder.rmdir()
        report({"columns": read.notes}, as_json)
        raise
    result: dict[str, Any] = {"files": list(map(str, files)), "columns": read.notes, "holds": data_check.holds}
    result["findings"] = list(map(str, data_check.findings))
    result["next"] = f"rover-pin close-loop {shell_word(folder)}"
    report(result, as_json)
