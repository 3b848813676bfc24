"""Recordings of others made into one drive log: read, understood, cut into runs, written; nothing is asked."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_pin.body.rover import Rover, load_rover
from rover_pin.columns import columns_text, replace_file
from rover_pin.errors import DataError, closest
from rover_pin.importing.clock import find_clock
from rover_pin.importing.guess import Guess, Recording, recording
from rover_pin.importing.raw import read_raw
from rover_pin.importing.splitting import Part, chosen, parts
from rover_pin.importing.understood import Understood, drive_of, lines, understood
from rover_pin.importing.written import Run, Sheet, toml_of
from rover_pin.measurements.reading import data_path
from rover_pin.motion.channels import WHOLE, is_column
from rover_pin.motion.drive_log import FILE
from rover_pin.paths import exists, is_file, named_from
from rover_pin.time_left import telling

log = logging.getLogger(__name__)
MOST_RUNS = 12
"""Runs that a log gets at most, unless more are asked for: each is replayed hundreds of times."""

LARGE = 5_000_000
"""A file of more bytes takes long enough to be told of."""


@dataclass(frozen=True)
class Imported:
    """What was read and written."""

    files: tuple[Path, ...]
    columns: tuple[str, ...]
    "one line each: what it is made of, marked where it is guessed"
    runs: tuple[str, ...]
    lacks: tuple[str, ...]
    notes: tuple[str, ...]


def import_log(
    recordings: Sequence[str | Path],
    rover: str | Path = "nexus6",
    out: str | Path | None = None,
    told: Mapping[str, str] | None = None,
    most: int = MOST_RUNS,
) -> Imported:
    """Return what recordings were understood to hold, written as a drive log in a folder.

    Parameters
    ----------
    rover : str or path
        The rover that was driven: a name, or a TOML as `new-rover` writes it.
    out : path, optional
        Folder of the log; by the first recording's name, beside it or, of a sample, here, if not given.
    told : mapping, optional
        Column of a drive log -> column or formula of the recording, where the guess is wrong.
    most : int
        Runs that are kept; of more parts those that tell most are.

    Raises
    ------
    DataError
        No recording, one that cannot be read, has no clock, no place or no wheel rates, or a log that is there.
    """
    paths = [data_path(each) for each in recordings]
    if not paths:
        raise DataError("import-log: give at least one recording: CSV, Parquet, .mat, .bag, .db3 or .mcap.")
    folder = _beside(Path(recordings[0])) if out is None else Path(out)
    if exists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(
            f"{folder}: is already there; give another folder with --out, nothing of yours is written over."
        )
    own = load_rover(str(rover))
    given = [Guess(name, {"formula": text}, "told", True) for name, text in (told or {}).items()]
    _refuse_unread(given, own)
    each = (_read(path, own, given, most) for path in paths)
    readings = list(telling(each, len(paths), "recordings read"))
    return _written(folder, paths, rover, own, readings)


def _beside(first: Path) -> Path:
    """Return the folder of a log by its first recording: beside it, of a sample where one stands."""
    return (first if exists(first) else Path(first.name)).with_suffix("")


def _refuse_unread(told: Sequence[Guess], rover: Rover) -> None:
    """Refuse a column that is none of a drive log of this rover, and of which no other that was told is made."""
    wheels = [mount.name for mount in rover.wheels]
    used = {word for each in told for word in re.findall(r"\w+", str(each.entry["formula"]))}
    for name in (each.target for each in told):
        if not is_column(name, wheels) and name not in used:
            kinds = ("wheel_rate_{}", "duty_{}", "current_{}_A", "raw_current_{}")
            there = (*WHOLE, *rover.angles, *(kind.format(wheel) for kind in kinds for wheel in wheels))
            raise DataError(
                f"--column {name}: a drive log of {rover.name} has no column '{name}', and nothing else that is told "
                f"is made of it: {closest(name, there)}"
            )


@dataclass(frozen=True)
class _Reading:
    path: Path
    seen: Recording
    found: Understood
    parts: list[Part]
    notes: tuple[str, ...]


def _read(path: Path, rover: Rover, told: Sequence[Guess], most: int) -> _Reading:
    size = path.stat().st_size if is_file(path) else 0
    if size > LARGE:
        log.info("reading %s: %.0f MB", path.name, size / 1e6)
    raw = read_raw(path)
    clock = find_clock(raw.table, path)
    seen = recording(clock.t, clock.table, clock.column, rover)
    exact = [Guess(each.target, _entry(each, seen), each.why, True) for each in told]
    found = understood(seen, exact, str(path))
    drive = drive_of(seen, found)
    whole = parts(drive)
    if not whole:
        raise DataError(f"{path}: the wheels never turn for 8 s on end: nothing was driven that could be compared.")
    kept = chosen(drive, whole, most)
    notes = [f"{path.name}: clock {clock.said}", *(f"{path.name}: {note}" for note in raw.notes)]
    if len(kept) < len(whole):
        times = sum(float(seen.t[part.last - 1] - seen.t[part.first]) for part in kept)
        notes.append(
            f"{path.name}: {len(kept)} of {len(whole)} parts are kept, those that tell most of slip, slope, turns and "
            f"rates: {times:.0f} s of {seen.t[-1]:.0f} s; --most gives more"
        )
    if found.unused:
        notes.append(f"{path.name}: not used: {', '.join(found.unused[:30])}")
    return _Reading(path, seen, found, kept, tuple(notes))


def _entry(each: Guess, seen: Recording) -> dict[str, str]:
    text = str(each.entry["formula"])
    return {"column": text} if text in seen.table else {"formula": text}


def _written(
    folder: Path, paths: Sequence[Path], rover: str | Path, own: Rover, readings: Sequence[_Reading]
) -> Imported:
    _refuse_unlike(readings)
    runs = [run for reading in readings for run in _runs(reading, several=len(readings) > 1)]
    first = readings[0].found
    notes = tuple(dict.fromkeys(note for reading in readings for note in reading.notes))
    lacks = first.lacks
    sheet = Sheet(
        folder.name,
        f"imported from {', '.join(path.name for path in paths)}",
        named_from(folder, rover),
        [mount.name for mount in own.wheels],
        first.guesses,
        runs,
        [*notes, *(f"Lacks {said}." for said in lacks)],
        any(name in first.values for name in ("body_pitch", "body_z")),
    )
    made = (replace_file(folder / f"{run.name}.csv", columns_text(dict(run.columns))) for run in runs)
    files = list(telling(made, len(runs), "runs written"))
    files.append(replace_file(folder / FILE, toml_of(sheet)))
    return Imported(
        tuple(files), tuple(lines(first)), tuple(f"{run.name}: {run.purpose}" for run in runs), lacks, notes
    )


def _refuse_unlike(readings: Sequence[_Reading]) -> None:
    first = readings[0]
    for other in readings[1:]:
        if other.found.entries != first.found.entries:
            at = next(
                name
                for name in {**first.found.entries, **other.found.entries}
                if first.found.entries.get(name) != other.found.entries.get(name)
            )
            raise DataError(
                f"{other.path.name}: {at} is not made of the same columns as in {first.path.name}: import them one by "
                "one, or say --column for both."
            )


def _runs(reading: _Reading, several: bool) -> list[Run]:
    stem = re.sub(r"\W+", "-", reading.path.stem).strip("-") or "run"
    made = []
    for at, part in enumerate(reading.parts, 1):
        t = reading.seen.t[part.first : part.last]
        table = reading.seen.table.iloc[part.first : part.last]
        columns = {str(name): table[name].to_numpy(dtype=float) for name in table if name != "t_s"}
        name = f"{stem}-{at:02d}" if several or len(reading.parts) > 1 else stem
        purpose = f"{t[-1] - t[0]:.0f} s from {t[0]:.1f} s of {reading.path.name}"
        made.append(Run(name, purpose, {"t_s": np.asarray(t - t[0]), **columns}))
    return made
