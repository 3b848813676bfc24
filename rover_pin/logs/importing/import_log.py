"""Recordings of others made into one drive log: read, understood, cut into runs, written; nothing is asked."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.columns import columns_text, replace_file
from rover_pin.base.files.paths import exists, is_file, named_from
from rover_pin.base.files.samples import data_path
from rover_pin.base.jobs.time_left import telling
from rover_pin.logs.drive_log import FILE
from rover_pin.logs.importing.clock import find_clock
from rover_pin.logs.importing.guess_columns import Understood, drive_of, lines, understood
from rover_pin.logs.importing.guess_record import Guess, Recording, recording
from rover_pin.logs.importing.raw import read_raw
from rover_pin.logs.importing.splitting import Part, chosen, parts
from rover_pin.logs.importing.written import Run, Sheet, toml_of
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.simulation.trace.channels import WHOLE, is_column

log = logging.getLogger(__name__)
MOST_RUNS = 12
"""Runs that a log gets at most, unless more are asked for: each is replayed hundreds of times."""

LARGE = 5_000_000
"""A file of more bytes takes long enough to be announced."""


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
    columns: Mapping[str, str] | None = None,
    most: int = MOST_RUNS,
) -> Imported:
    """Return what recordings were understood to hold, written as a drive log in a folder.

    Parameters
    ----------
    rover : str or path
        The rover that was driven: a name, or a TOML as `new-rover` writes it.
    out : path, optional
        Folder of the log; by the first recording's name, beside it or, of a sample, here, if not given.
    columns : mapping, optional
        Column of a drive log -> column or formula of the recording, where the guess is wrong.
    most : int
        Runs that are kept; of more parts those that tell most are.

    Raises
    ------
    DataError
        No recording, one that cannot be read, has no clock, no place or no wheel rates, or a log that is there.
    """
    paths = [data_path(file) for file in recordings]
    if not paths:
        raise DataError("import-log: give at least one recording: CSV, Parquet, .mat, .bag, .db3 or .mcap.")
    folder = _beside(Path(recordings[0])) if out is None else Path(out)
    if exists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(
            f"{folder}: is already there; give another folder with --out, nothing of yours is written over."
        )
    loaded_rover = load_rover(str(rover))
    declared = [Guess(name, {"formula": text}, "as given", True) for name, text in (columns or {}).items()]
    _refuse_unread(declared, loaded_rover)
    pending = (_read(path, loaded_rover, declared, most) for path in paths)
    readings = list(telling(pending, len(paths), "recordings read"))
    return _written(folder, paths, rover, loaded_rover, readings)


def _beside(first: Path) -> Path:
    """Return the folder of a log by its first recording: beside it, of a sample where one stands."""
    return (first if exists(first) else Path(first.name)).with_suffix("")


def _refuse_unread(declared: Sequence[Guess], rover: Rover) -> None:
    """Refuse a column that is none of a drive log of this rover, and that no other declared column uses."""
    wheels = [mount.name for mount in rover.wheels]
    used = {word for guess in declared for word in re.findall(r"\w+", str(guess.entry["formula"]))}
    for name in (guess.target for guess in declared):
        if not is_column(name, wheels) and name not in used:
            kinds = ("wheel_rate_{}", "duty_{}", "current_{}_A", "raw_current_{}")
            there = (*WHOLE, *rover.angles, *(kind.format(wheel) for kind in kinds for wheel in wheels))
            raise DataError(
                f"--column {name}: a drive log of {rover.name} has no column '{name}', and no other --column "
                f"uses it: {closest(name, there)}"
            )


@dataclass(frozen=True)
class _Reading:
    path: Path
    recording: Recording
    mapping: Understood
    parts: list[Part]
    notes: tuple[str, ...]


def _read(path: Path, rover: Rover, declared: Sequence[Guess], most: int) -> _Reading:
    size = path.stat().st_size if is_file(path) else 0
    if size > LARGE:
        log.info("reading %s: %.0f MB", path.name, size / 1e6)
    raw = read_raw(path)
    clock = find_clock(raw.table, path)
    log_recording = recording(clock.t, clock.table, clock.column, rover)
    exact = [Guess(guess.target, _entry(guess, log_recording), guess.why, True) for guess in declared]
    mapping = understood(log_recording, exact, str(path))
    drive = drive_of(log_recording, mapping)
    spans = parts(drive)
    if not spans:
        raise DataError(f"{path}: the wheels never turn for 8 s on end: nothing was driven that could be compared.")
    picks = chosen(drive, spans, most)
    notes = [f"{path.name}: clock {clock.description}", *(f"{path.name}: {note}" for note in raw.notes)]
    if len(picks) < len(spans):
        times = sum(float(log_recording.t[part.last - 1] - log_recording.t[part.first]) for part in picks)
        notes.append(
            f"{path.name}: {len(picks)} of {len(spans)} parts are kept, those that tell most of slip, slope, turns and "
            f"rates: {times:.0f} s of {log_recording.t[-1]:.0f} s; --most gives more"
        )
    if mapping.unused:
        notes.append(f"{path.name}: not used: {', '.join(mapping.unused[:30])}")
    return _Reading(path, log_recording, mapping, picks, tuple(notes))


def _entry(guess: Guess, recording: Recording) -> dict[str, str]:
    text = str(guess.entry["formula"])
    return {"column": text} if text in recording.table else {"formula": text}


def _written(
    folder: Path, paths: Sequence[Path], rover: str | Path, loaded_rover: Rover, readings: Sequence[_Reading]
) -> Imported:
    _refuse_unlike(readings)
    runs = [run for reading in readings for run in _runs(reading, several=len(readings) > 1)]
    first = readings[0].mapping
    notes = tuple(dict.fromkeys(note for reading in readings for note in reading.notes))
    lacks = first.lacks
    sheet = Sheet(
        folder.name,
        f"imported from {', '.join(path.name for path in paths)}",
        named_from(folder, rover),
        [mount.name for mount in loaded_rover.wheels],
        first.guesses,
        runs,
        [*notes, *(f"Lacks {lack}." for lack in lacks)],
        any(name in first.values for name in ("body_pitch", "body_z")),
    )
    csv_files = (replace_file(folder / f"{run.name}.csv", columns_text(dict(run.columns))) for run in runs)
    files = list(telling(csv_files, len(runs), "runs written"))
    files.append(replace_file(folder / FILE, toml_of(sheet)))
    return Imported(
        tuple(files), tuple(lines(first)), tuple(f"{run.name}: {run.purpose}" for run in runs), lacks, notes
    )


def _refuse_unlike(readings: Sequence[_Reading]) -> None:
    first = readings[0]
    for later in readings[1:]:
        if later.mapping.entries != first.mapping.entries:
            at = next(
                name
                for name in {**first.mapping.entries, **later.mapping.entries}
                if first.mapping.entries.get(name) != later.mapping.entries.get(name)
            )
            raise DataError(
                f"{later.path.name}: {at} is not made of the same columns as in {first.path.name}: import them one by "
                "one, or say --column for both."
            )


def _runs(reading: _Reading, several: bool) -> list[Run]:
    stem = re.sub(r"\W+", "-", reading.path.stem).strip("-") or "run"
    runs = []
    for at, part in enumerate(reading.parts, 1):
        t = reading.recording.t[part.first : part.last]
        table = reading.recording.table.iloc[part.first : part.last]
        columns = {str(name): table[name].to_numpy(dtype=float) for name in table if name != "t_s"}
        name = f"{stem}-{at:02d}" if several or len(reading.parts) > 1 else stem
        purpose = f"{t[-1] - t[0]:.0f} s from {t[0]:.1f} s of {reading.path.name}"
        runs.append(Run(name, purpose, {"t_s": np.asarray(t - t[0]), **columns}))
    return runs
