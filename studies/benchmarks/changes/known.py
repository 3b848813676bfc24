"""What became of a change, and what is known of a test."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from changes.python import Mutant


class Tried(NamedTuple):
    """One change in a file and what became of it: the test that failed, or nothing."""

    path: Path
    mutant: Mutant
    killer: str


class Known(NamedTuple):
    """A test on the code as it is: how long it takes [s of CPU], and the lines that it runs, by file."""

    taken: float
    lines: dict[str, list[int]]
