"""Journals: a long calculation records each finished piece of work in such a file, so that a later run can resume."""

import json
import os
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import content
from rover_pin.base.files.whole_file import write_whole


class Journal:
    """A file that records each finished piece of a long calculation as one line of JSON.

    A later run reads the entries and skips the finished pieces. An entry is on the disk as soon as `append` returns. If
    the process is killed while it writes, the file ends with an incomplete line; call `repair` to remove this line
    before the next run appends.

    Parameters
    ----------
    file : Path
        Path of the journal. The first call of `append` creates the file; its folder must exist.

    Example: `Journal(Path("done.jsonl")).append({"case": 1})`.
    """

    def __init__(self, file: Path):
        self.file = file

    def append(self, entry: Any) -> None:
        """Add an entry at the end of the file. An entry is a value that JSON can represent; NaN and infinities are
        allowed.

        Raises OSError: the file cannot be written.
        """
        with self.file.open("ab") as file:
            # A single write: a process that is killed leaves complete lines and at most one incomplete line at the end.
            file.write(json.dumps(entry).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())

    def entries(self) -> list[Any]:
        """Return the entries of all complete lines, the oldest first. The file is not changed.

        If the file does not exist, the list is empty.

        Raises DataError: the file cannot be read, or a complete line is not JSON.
        """
        # A missing file is the journal of a calculation that has not finished any piece.
        try:
            raw = content(self.file) if self.file.exists() else b""
        except OSError as error:
            raise DataError(f"{self.file}: the file cannot be read: {error.strerror}.") from error
        entries = []
        # The part after the last newline is an entry that was not written to its end.
        for number, line in enumerate(raw[: raw.rfind(b"\n") + 1].splitlines(), start=1):
            try:
                entries.append(json.loads(line))
            except (ValueError, RecursionError) as error:
                raise DataError(
                    f"{self.file}, line {number}: the line is damaged ({error}); remove this line or the file, and run "
                    "the command again."
                ) from error
        return entries

    def repair(self) -> None:
        """Remove an incomplete line at the end of the file, so that the next entry begins on a new line.

        Raises OSError: the file cannot be read or replaced.
        """
        raw = content(self.file) if self.file.exists() else b""
        complete = raw[: raw.rfind(b"\n") + 1]
        if len(complete) < len(raw):
            write_whole(self.file, complete)
