"""`rover-pin compare`: two verdicts, models or drives as one sentence and one table."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Trusted
from rover_pin.cli.terminal import json_text

if TYPE_CHECKING:
    from rover_pin.comparison.side import Comparison

WIDEST = 44
"""Letters of a column; what is longer sticks out, and is never cut."""


def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="A close-loop's folder, a model.toml, a drive log.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another one of the same kind.")],
    run: Annotated[str, typer.Option(help="Which run of drive logs; the first, if not said.")] = "",
    all_: Annotated[bool, typer.Option("--all", help="Print also what does not differ.")] = False,
    trust: Trusted = False,
    as_json: AsJson = False,
) -> None:
    """Compare two verdicts, two models or two drives. One sentence, and a table of what differs."""
    from rover_pin.comparison.compare import compare as compared

    comparison = compared(first, second, run, Trust(everything=trust))
    print(json_text(comparison.as_dict()) if as_json else table(comparison, all_))


def table(comparison: "Comparison", include_equal: bool = False) -> str:
    """Return the sentence and the table of what differs, or of everything."""
    rows = [row for row in comparison.rows if include_equal or row.differs]
    lines = [comparison.sentence, "", f"A  {comparison.first}", f"B  {comparison.second}"]
    if rows:
        cells = [("", "A", "B", "B - A", ""), *(row[:5] for row in rows)]
        widths = [min(max(len(row[i]) for row in cells), WIDEST) for i in range(4)]
        pairs = ((*(f"{cell:{width}}" for cell, width in zip(row, widths, strict=False)), row[4]) for row in cells)
        lines += ["", *("  ".join(row).rstrip() for row in pairs)]
    equal_count = len(comparison.rows) - len(rows)
    return "\n".join(
        [*lines, *([f"\n{equal_count} more rows are the same; --all prints them."] if equal_count else [])]
    )
