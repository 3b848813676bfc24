"""The results folder of a sweep. The row of each finished case is saved at once, so that a study that was stopped can
be continued.

`rows.jsonl` holds the rows while the study runs and afterwards. When the study ends, `results.csv` is written from it,
and `results.parquet` if pyarrow is installed.
"""

import json
from importlib.util import find_spec
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import text
from rover_pin.base.files.journal import Journal
from rover_pin.base.files.results_folder import LOCK
from rover_pin.base.files.whole_file import write_whole
from rover_pin.sweep.case import LEADING, Row

STUDY_FILE, ROWS, RESULTS, CSV = "study.json", "rows.jsonl", "results.parquet", "results.csv"
"""Names of the files in a results folder: the description of the study, the rows of the finished cases, and the table
of results as Parquet and as CSV."""
MAX_PRINTED_LETTERS = 60
"""Largest number of characters of a setting's value in an error message. A longer value, such as a list of many
numbers, is shortened, so that the message stays readable."""


class Store:
    """The rows of one study in one results folder. Only one sweep at a time may write to the folder (see `alone_in`).

    Parameters
    ----------
    folder : Path
        The results folder. It is created if it does not exist.
    study : dict
        Description of the study as plain data (`fingerprint`).

    Raises
    ------
    DataError
        If the folder holds another study, if it is not empty and holds no study, or if it cannot be written to.
    """

    def __init__(self, folder: Path, study: dict[str, Any]):
        self.folder = folder
        self.study = study
        self.rows = Journal(folder / ROWS)
        try:
            # If the folder already holds the description of a study, it must equal the description of this study. The
            # error names each entry that differs, in the order in which the studies list them.
            folder.mkdir(parents=True, exist_ok=True)
            if (folder / STUDY_FILE).exists():
                old = known_study(folder)
                before, now = _flat(old), _flat(study)
                changed = [name for name in dict.fromkeys((*before, *now)) if before.get(name) != now.get(name)]
                # Another order of the parameters is a difference too, because the order decides the number of a case.
                orders = [list(description["parameters"]) for description in (old, study)]
                if orders[0] != orders[1] and set(orders[0]) == set(orders[1]):
                    before["parameters"], now["parameters"] = orders
                    changed.append("parameters")
                if changed:
                    changes = "; ".join(
                        f"{name} was {_shown(before, name)}, is {_shown(now, name)}" for name in changed
                    )
                    raise DataError(
                        f"{folder}: the folder holds another study ({changes}); name a new folder or undo the change."
                    )
            elif any(entry.name != LOCK and entry.suffix != ".tmp" for entry in folder.iterdir()):
                raise DataError(f"{folder}: the folder is not empty and holds no sweep; name a new folder.")
            else:
                write_whole(folder / STUDY_FILE, json.dumps(study, indent=2, ensure_ascii=False) + "\n")
            self.rows.repair()
        except OSError as error:
            raise DataError(f"{folder}: the folder cannot be used for results: {error.strerror}.") from error

    def append(self, row: Row) -> None:
        """Write the row of a finished case to the disk, so that it is kept if the process stops."""
        self.rows.append({name: _plain(value) for name, value in row.items()})

    def keys(self) -> set[str]:
        """Return the keys of the cases that are finished."""
        return {row["key"] for row in _rows(self.folder)}

    def finish(self) -> Any:
        """Write all rows, sorted by case, to the files of results, and return them as a pandas DataFrame.

        Cases on several cores end in random order. Therefore the rows are written again in the order of the cases, and
        two runs of a study leave equal files.
        """
        rows = _rows(self.folder)
        lines = "".join(f"{json.dumps(row)}\n" for row in rows)
        write_whole(self.rows.file, lines)
        frame = _table(rows, self.study)
        write_whole(self.folder / CSV, frame.to_csv(index=False, lineterminator="\n"))
        if find_spec("pyarrow"):
            write_whole(self.folder / RESULTS, frame.to_parquet(index=False))
        return frame


def collect(folder: str | Path) -> Any:
    """Return the finished cases of a sweep as a pandas DataFrame, sorted by case; the sweep may still be running.

    The columns are `case`, `repeat`, `seed`, `key`, the parameters, the outcomes, and `error` (missing if the case
    succeeded).

    Raises DataError if `folder` holds no sweep, or if a file in it cannot be read.

    Example: `collect("out/ditch")["error"].notna().sum()` is the number of failed cases so far.
    """
    folder = Path(folder)
    study = known_study(folder)
    return _table(_rows(folder), study)


def known_study(folder: Path) -> dict[str, Any]:
    """Return the description of the study whose results are in the folder.

    Raises DataError if there is no such description, or if it is damaged.
    """
    # A missing file and a damaged file have different remedies.
    try:
        study = json.loads(text(folder / STUDY_FILE))
    except OSError as error:
        raise DataError(
            f"{folder}: this folder holds no sweep ({STUDY_FILE} cannot be read); name the folder of a sweep."
        ) from error
    except (ValueError, RecursionError) as error:
        raise DataError(f"{folder / STUDY_FILE}: not valid JSON; start the study again in a new folder.") from error
    if not isinstance(study, dict) or not isinstance(study.get("parameters"), dict):
        raise DataError(f"{folder / STUDY_FILE}: it describes no study; start the study again in a new folder.")
    return study


def _flat(study: dict[str, Any]) -> dict[str, Any]:
    """Return the description of a study without nested tables: the entry `key` of a table `name` gets the name 'name:
    key'.
    """
    tables = {name: value for name, value in study.items() if isinstance(value, dict)}
    entries = {f"{name}: {key}": value for name, table in tables.items() for key, value in table.items()}
    return {name: value for name, value in study.items() if name not in tables} | entries


def _shown(entries: dict[str, Any], name: str) -> str:
    """Return the value of an entry as short text for an error message; "none" if there is no such entry."""
    return shorten(json.dumps(entries[name]), MAX_PRINTED_LETTERS, placeholder=" ...") if name in entries else "none"


def _rows(folder: Path) -> list[Row]:
    """Return the rows of the finished cases from the file `rows.jsonl`, sorted by case. If a case has several rows, the
    last one is returned.
    """
    file = folder / ROWS
    rows: dict[str, Row] = {}
    for number, row in enumerate(Journal(file).entries(), start=1):
        if not isinstance(row, dict) or not {*LEADING} <= {*row}:
            raise DataError(
                f"{file}, line {number}: this line is not a row of a sweep; remove the file and run the sweep again."
            )
        rows[row["key"]] = row
    return sorted(rows.values(), key=lambda row: row["case"])


def _table(rows: list[Row], study: dict[str, Any]) -> Any:
    """Return the rows of cases as a pandas DataFrame.

    The columns are the columns of LEADING, the parameters, the outcomes in alphabetical order, and `error`.
    """
    import pandas as pd

    # Outcomes are all columns of the rows that are not fixed by the study.
    fixed = {*LEADING, *study["parameters"], "error"}
    outcomes = sorted({name for row in rows for name in row} - fixed)
    columns = {}
    for name in (*LEADING, *study["parameters"], *outcomes, "error"):
        values = [row.get(name) for row in rows]
        # An outcome can be a number in one row and a text in another. A column of both cannot be written to Parquet, so
        # the whole column becomes text.
        if len({type(value) for value in values if value is not None}) > 1:
            values = [None if value is None else str(value) for value in values]
        columns[name] = values
    return pd.DataFrame(columns)


def _plain(value: Any) -> Any:
    """Return a NumPy scalar as a Python value, which JSON can store, and every other value unchanged."""
    return value.item() if isinstance(value, np.generic) else value
