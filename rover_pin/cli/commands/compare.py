"""`rover-pin compare`: prints the differences between two verdicts, models or drives as one sentence and one table."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_pin.base.console import say
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Run, Trusted
from rover_pin.cli.terminal import json_text

if TYPE_CHECKING:
    from rover_pin.comparison.side import Comparison

MAX_COLUMN_WIDTH = 44
"""Maximum width of a column of the printed table, in letters. A longer cell is not cut; it shifts the rest of its row
to the right. A number with its unit and its interval has fewer than 44 letters."""


def compare(
    first: Annotated[
        Path,
        typer.Argument(metavar="A", help="Results folder of close-loop, a model.toml, or the folder of a drive log."),
    ],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another result of the same kind as A.")],
    run: Run = "",
    all_: Annotated[bool, typer.Option("--all", help="Also print the rows that do not differ.")] = False,
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Compare two verdicts, two models or two drives. Prints a sentence and a table of the differences."""
    from rover_pin.comparison.compare import compare as compared

    comparison = compared(first, second, run, Trust(everything=trust))
    say(json_text(comparison.as_dict()) if as_json else table(comparison, all_))


def table(comparison: "Comparison", include_equal: bool = False) -> str:
    """Return a comparison as text: one sentence, and a table of the rows that differ.

    With `include_equal`, the table has all rows.
    """
    rows = [row for row in comparison.rows if include_equal or row.differs]
    lines = [comparison.sentence, "", f"A  {comparison.first}", f"B  {comparison.second}"]
    if rows:
        cells = [("", "A", "B", "B - A", ""), *(row[:5] for row in rows)]
        # The fifth cell is a remark at the end of the row, so its width does not matter.
        widths = [min(max(len(row[i]) for row in cells), MAX_COLUMN_WIDTH) for i in range(4)]
        pairs = ((*(f"{cell:{width}}" for cell, width in zip(row, widths, strict=False)), row[4]) for row in cells)
        lines += ["", *("  ".join(row).rstrip() for row in pairs)]
    # The number of omitted rows is printed, so that a short table is not taken for the whole comparison.
    equal_count = len(comparison.rows) - len(rows)
    return "\n".join([*lines, *([f"\n{equal_count} more rows are equal; --all prints them."] if equal_count else [])])
