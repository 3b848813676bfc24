"""`rover-pin init`: a wheel-rig set out of a CSV of one's own."""

from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import ParameterError
from rover_pin.cli.options import AsJson
from rover_pin.cli.terminal import assignments, report


def init(
    table: Annotated[Path, typer.Argument(help="CSV or Parquet: a row a run, slip, load, what was measured.")],
    radius: Annotated[str, typer.Option("--r", help="Radius of the wheel, as 45mm.")],
    width: Annotated[str, typer.Option("--b", help="Width of the wheel, as 50mm.")],
    noise: Annotated[
        list[str], typer.Option(metavar="CHANNEL=SD", help="Scatter of a channel, as drawbar_pull=0.5N, repeatable.")
    ] = [],  # noqa: B006 - typer wants a list
    out: Annotated[Path | None, typer.Option(help="Folder for the set; the table's name, if not said.")] = None,
    as_json: AsJson = False,
) -> None:
    """Make a wheel-rig set out of a table of your own. It is checked; close-loop and identify read it."""
    from rover_pin.base.quantity import parse_quantity
    from rover_pin.contact import Wheel
    from rover_pin.loop.data_check import check_data
    from rover_pin.measurements.foreign_rig import channel_unit, read_foreign, write_rig_set

    scatter = assignments(noise, "--noise")
    sds = {
        name: (parse_quantity(sd, channel_unit(name), f"--noise {name}"), channel_unit(name))
        for name, sd in scatter.items()
    }
    wheel = Wheel(r=parse_quantity(radius, "m", "--r"), b=parse_quantity(width, "m", "--b"))
    folder = table.with_suffix("") if out is None else out
    if folder == table:
        raise ParameterError(f"{table}: give a folder for the set: --out FOLDER.")
    read = read_foreign(table)
    read.refuse_without_noise(table, sds)
    files = write_rig_set(folder, table.stem, read, wheel, sds)
    data_check = check_data(folder)
    facts = {"columns": list(read.notes), "holds": data_check.holds, "findings": list(map(str, data_check.findings))}
    report({"files": list(map(str, files)), **facts, "next": f"rover-pin close-loop {folder}"}, as_json)
