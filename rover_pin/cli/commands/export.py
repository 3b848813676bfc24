"""`rover-pin export`: a drive for other tools."""

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from rover_pin.base.errors import MissingExtraError
from rover_pin.base.files.results_folder import say_what_is_replaced
from rover_pin.base.trust import Trust
from rover_pin.cli.commands.options import AsJson, Trusted
from rover_pin.cli.terminal import report


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
    from rover_pin.cli.commands.subject import read_subject
    from rover_pin.view import export as writing

    subject = read_subject(path, run, Trust(everything=trust))
    write = getattr(writing, f"write_{to.value}")
    file = out / f"{subject.trace.attrs.get('scenario', 'drive')}{'.rrd' if to is Kind.RERUN else f'.{to.value}'}"
    say_what_is_replaced(out, (file.name,))
    report({"exported": subject.name, "files": [str(write(file, subject))]}, as_json)
