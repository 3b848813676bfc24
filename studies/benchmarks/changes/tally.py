"""The table of the last run of each room: how many changes there are, were tried, noticed, survived, left untried."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path
from typing import NamedTuple


class Row(NamedTuple):
    """What is known of one room."""

    room: str
    tried: int
    noticed: int
    excused: int
    "changes that change no result, each with its reason in changes/equivalent.py: they are not tried"
    left: int
    "changes that were not tried"
    untried: str
    "the files in which they are, with how many of each"
    longest: str
    "tests that took more CPU [s] were not asked; nothing where all were"
    commit: str

    @property
    def survived(self) -> int:
        """Changes that no test notices."""
        return self.tried - self.noticed


HEAD = ("room", "tried", "noticed", "survived", "excused", "left", "untried", "longest", "commit")


def put(file: Path, row: Row) -> None:
    """Put a room's row in the place of what it had, rooms in the order of their names."""
    rows = {each["room"]: each for each in read(file)} if file.exists() else {}
    rows[row.room] = {name: str(getattr(row, name)) for name in HEAD}
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, HEAD, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[room] for room in sorted(rows))


def read(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def commit(folder: Path) -> str:
    """Return what is checked out in a folder, with a + where files have changed since."""

    def said(*words: str) -> str:
        return subprocess.run(["git", "-C", folder, *words], capture_output=True, text=True, check=True).stdout.strip()

    return said("rev-parse", "--short", "HEAD") + "+" * bool(said("status", "--porcelain", "rover_pin", "tests"))
