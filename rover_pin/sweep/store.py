"""The folder of a sweep: rows appended atomically to Parquet, so that a killed study goes on where it stopped."""

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from textwrap import shorten
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import content, text
from rover_pin.base.files.results_folder import LOCK
from rover_pin.sweep.case import LEADING, Row

STUDY_FILE, PARTS, RESULTS, CSV = "study.json", "parts", "results.parquet", "results.csv"
MOST_LETTERS = 60
"""Letters of a value of another study that are printed."""
MOST_PARTS = 256
"""This many small files are merged into one, lest a folder of many cases become slow to list."""


class Store:
    """The rows of one study in one folder; one sweep at a time writes to it (`alone_in`).

    Parameters
    ----------
    folder : Path
        Created when missing.
    study : dict
        What the study is, as plain data; a folder that holds another one is refused.

    Raises
    ------
    DataError
        The folder holds another study, is not empty, or cannot be written to.
    """

    def __init__(self, folder: Path, study: dict[str, Any]):
        self.folder = folder
        self.study = study
        self.parts = folder / PARTS
        self._merged_at = 0
        try:
            self._claim()
        except OSError as error:
            raise DataError(f"{folder}: the folder cannot be used for results: {error.strerror}.") from error

    def _claim(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        if (self.folder / STUDY_FILE).exists():
            _refuse_change(self.folder, known_study(self.folder), self.study)
        elif any(entry.name != LOCK and entry.suffix != ".tmp" for entry in self.folder.iterdir()):
            raise DataError(f"{self.folder}: the folder is not empty and holds no sweep; name a new folder.")
        else:
            text = json.dumps(self.study, indent=2, ensure_ascii=False) + "\n"
            _replace(self.folder / STUDY_FILE, lambda path: path.write_text(text, encoding="utf-8"))
        self.parts.mkdir(exist_ok=True)

    def append(self, row: Row) -> None:
        """Write the row of a finished case; after this it survives the process."""
        _write([row], self.study, self.parts / f"{row['key']}.parquet")
        self._merged_at += 1
        if self._merged_at >= MOST_PARTS:
            self._merge()

    def _merge(self) -> None:
        small = [path for path in self.parts.glob("*.parquet") if not path.name.startswith("merged-")]
        rows = _read(small)
        # A kill between the two leaves rows twice; they are equal and count once by their key.
        _write(rows, self.study, self.parts / f"merged-{rows[0]['key']}.parquet")
        _remove(small)
        self._merged_at = 0

    def keys(self) -> set[str]:
        """Return the keys of the cases that are finished."""
        return {row["key"] for row in _rows(self.folder)}

    def finish(self) -> Any:
        """Write all rows, sorted by case, to one Parquet file and one CSV; drop the parts; return the table."""
        rows = _rows(self.folder)
        _write(rows, self.study, self.folder / RESULTS)
        frame = _table(rows, self.study).to_pandas()
        _replace(self.folder / CSV, lambda path: frame.to_csv(path, index=False, lineterminator="\n"))
        _remove(self.parts.iterdir())
        return frame


def collect(folder: str | Path) -> Any:
    """Return what a sweep has finished so far as a pandas DataFrame, sorted by case.

    Columns: `case`, `repeat`, `seed`, `key`, the parameters, the outcomes, and `error` (missing where none).

    Raises DataError: `folder` holds no sweep, or a file of it cannot be read.
    """
    folder = Path(folder)
    study = known_study(folder)
    return _table(_rows(folder), study).to_pandas()


def known_study(folder: Path) -> dict[str, Any]:
    """Return the study that the folder's results belong to, as plain data."""
    try:
        study = json.loads(text(folder / STUDY_FILE))
    except OSError as error:
        raise DataError(f"{folder}: no sweep lies here: {STUDY_FILE} cannot be read; name its folder.") from error
    except (ValueError, RecursionError) as error:
        raise DataError(f"{folder / STUDY_FILE}: not valid JSON; start the study again in a new folder.") from error
    if not isinstance(study, dict) or not isinstance(study.get("parameters"), dict):
        raise DataError(f"{folder / STUDY_FILE}: it describes no study; start the study again in a new folder.")
    return study


def _refuse_change(folder: Path, old: dict[str, Any], new: dict[str, Any]) -> None:
    before, now = _by_name(old), _by_name(new)
    changed = [name for name in dict.fromkeys((*before, *now)) if before.get(name) != now.get(name)]
    orders = [list(study["parameters"]) for study in (old, new)]
    if orders[0] != orders[1] and set(orders[0]) == set(orders[1]):
        before["parameters"], now["parameters"] = orders
        changed.append("parameters")  # their order decides which case is the first
    if changed:
        changes = "; ".join(f"{name} was {_brief(before, name)}, is {_brief(now, name)}" for name in changed)
        raise DataError(f"{folder}: the folder holds another study ({changes}); name a new folder or undo the change.")


def _by_name(study: dict[str, Any]) -> dict[str, Any]:
    """Return what a study is, entries of its tables by names of their own."""
    tables = {name: value for name, value in study.items() if isinstance(value, dict)}
    entries = {f"{name}: {key}": value for name, table in tables.items() for key, value in table.items()}
    return {name: value for name, value in study.items() if name not in tables} | entries


def _brief(entries: dict[str, Any], name: str) -> str:
    return shorten(json.dumps(entries[name]), MOST_LETTERS, placeholder=" ...") if name in entries else "none"


def _rows(folder: Path) -> list[Row]:
    paths = [path for path in (folder / RESULTS,) if path.exists()] + sorted((folder / PARTS).glob("*.parquet"))
    rows = {row["key"]: row for row in _read(paths)}
    return sorted(rows.values(), key=lambda row: row["case"])


def _read(paths: Iterable[Path]) -> list[Row]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows: list[Row] = []
    for path in paths:
        try:
            table = pq.ParquetFile(pa.BufferReader(content(path))).read()
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{path}: the file cannot be read; remove it and sweep again.") from error
        if not {*LEADING} <= {*table.column_names}:
            raise DataError(f"{path}: the file has no rows of a sweep; remove it and sweep again.")
        rows += table.to_pylist()
    return rows


def _write(rows: list[Row], study: dict[str, Any], path: Path) -> None:
    import pyarrow.parquet as pq

    table = _table(rows, study)
    _replace(path, lambda temporary: pq.write_table(table, temporary))


def _table(rows: list[Row], study: dict[str, Any]) -> Any:
    import pyarrow as pa

    fixed = {*LEADING, *study["parameters"], "error"}
    outcomes = sorted({name for row in rows for name in row} - fixed)
    names = [*LEADING, *study["parameters"], *outcomes, "error"]
    return pa.table({name: _column([row.get(name) for row in rows], name) for name in names})


def _column(values: list[Any], name: str) -> Any:
    import pyarrow as pa

    types = {"case": pa.int64(), "repeat": pa.int64(), "seed": pa.int64(), "key": pa.string(), "error": pa.string()}
    if len({type(value) for value in values if value is not None}) > 1:
        # An outcome that is a number here and a text there becomes text: a finished study must not be lost to it.
        values = [None if value is None else str(value) for value in values]
    return pa.array(values, types.get(name), from_pandas=False)


def _replace(path: Path, write: Callable[[Path], Any]) -> None:
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        write(temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def _remove(paths: Iterable[Path]) -> None:
    for path in list(paths):
        path.unlink(missing_ok=True)
