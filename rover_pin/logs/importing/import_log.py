"""Recordings of others made into one drive log: read, understood together, cut into runs, written."""

import itertools
import logging
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.columns import columns_text
from rover_pin.base.files.paths import exists, is_file, named_from
from rover_pin.base.files.samples import data_path
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.jobs.time_left import telling
from rover_pin.logs.drive_log import FILE
from rover_pin.logs.importing.column_matching import Source, Understood, understand_columns
from rover_pin.logs.importing.files.raw import read_raw
from rover_pin.logs.importing.splitting import Drive, Part, choose_parts, drive_of, parts
from rover_pin.logs.importing.written import Run, Sheet, lines, toml_of
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.rover.wheel_base import base_of
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
    declared = {name: {"formula": text} for name, text in (columns or {}).items()}
    _refuse_unread(declared, loaded_rover)
    sources = list(telling((_read(path) for path in paths), len(paths), "recordings read"))
    mapping = understand_columns(sources, loaded_rover, declared)
    return _write_log(folder, sources, rover, loaded_rover, mapping, most)


def _beside(first: Path) -> Path:
    """Return the folder of a log by its first recording: beside it, of a sample where one stands."""
    return (first if exists(first) else Path(first.name)).with_suffix("")


def _refuse_unread(declared: Mapping[str, Mapping[str, str]], rover: Rover) -> None:
    """Refuse a column that is none of a drive log of this rover, and that no other declared column uses."""
    wheels = [mount.name for mount in rover.wheels]
    used = {word for entry in declared.values() for word in re.findall(r"\w+", entry["formula"])}
    for name in declared:
        if not is_column(name, wheels) and name not in used:
            kinds = ("wheel_rate_{}", "duty_{}", "current_{}_A", "raw_current_{}")
            there = (*WHOLE, *rover.angles, *(kind.format(wheel) for kind in kinds for wheel in wheels))
            raise DataError(
                f"--column {name}: a drive log of {rover.name} has no column '{name}', and no other --column "
                f"uses it: {closest(name, there)}"
            )


def _read(path: Path) -> Source:
    size = path.stat().st_size if is_file(path) else 0
    if size > LARGE:
        log.info("reading %s: %.0f MB", path.name, size / 1e6)
    raw = read_raw(path)
    return Source(path, raw.table, tuple(f"{path.name}: {note}" for note in raw.notes))


class _Piece(NamedTuple):
    path: Path
    drive: Drive
    part: Part


def _pieces(mapping: Understood, rover: Rover, most: int) -> tuple[list[_Piece], list[str]]:
    """Return the parts that are kept of all files, `most` at most, and what is said of them."""
    drives = {path: drive_of(file.t, mapping.values[path], rover) for path, file in mapping.recordings.items()}
    pieces = [_Piece(path, drive, part) for path, drive in drives.items() for part in parts(drive)]
    empty = [path.name for path in drives if path not in {piece.path for piece in pieces}]
    if not pieces:
        raise DataError(
            f"{next(iter(drives))}: the wheels never turn for 8 s on end: nothing was driven that could be compared."
        )
    notes = [f"{name}: left out: the wheels never turn for 8 s on end" for name in empty]
    indices = choose_parts([(piece.drive, piece.part) for piece in pieces], most)
    picks = [pieces[at] for at in indices]
    if len(picks) < len(pieces):
        times = sum(float(piece.drive.t[piece.part.last - 1] - piece.drive.t[piece.part.first]) for piece in picks)
        total = sum(float(drive.t[-1]) for drive in drives.values())
        notes.append(
            f"{len(picks)} of {len(pieces)} parts are kept, those that tell most of slip, slope, turns and rates: "
            f"{times:.0f} s of {total:.0f} s; --most gives more"
        )
    return picks, notes


def _write_log(
    folder: Path, sources: Sequence[Source], rover: str | Path, loaded_rover: Rover, mapping: Understood, most: int
) -> Imported:
    pieces, remarks = _pieces(mapping, loaded_rover, most)
    runs, base = list(_runs(pieces, mapping)), base_of(loaded_rover)
    unused = f"{sources[0].path.name}: not used: {', '.join(mapping.unused[:30])}" if mapping.unused else ""
    of_files = (note for source in sources for note in source.notes)
    notes = tuple(dict.fromkeys(filter(None, (*of_files, *mapping.notes, *remarks, unused))))
    sheet = Sheet(
        folder.name,
        f"imported from {', '.join(source.path.name for source in sources)}",
        named_from(folder, rover),
        [mount.name for mount in loaded_rover.wheels],
        mapping.guesses,
        runs,
        [*notes, *(f"Lacks {lack}." for lack in mapping.lacks)],
        any(guess.target in ("body_pitch", "body_z") for guess in mapping.guesses),
        (base.length / math.sqrt(12.0), base.track / math.sqrt(12.0)),
    )
    csv_files = (replace_file(folder / f"{run.name}.csv", columns_text(dict(run.columns))) for run in runs)
    files = list(telling(csv_files, len(runs), "runs written"))
    files.append(replace_file(folder / FILE, toml_of(sheet)))
    purposes = tuple(f"{run.name}: {run.purpose}" for run in runs)
    return Imported(tuple(files), tuple(lines(mapping.guesses)), purposes, mapping.lacks, notes)


def _runs(pieces: Sequence[_Piece], mapping: Understood) -> Iterator[Run]:
    taken: set[str] = set()
    for path, recording in mapping.recordings.items():
        mine = [piece.part for piece in pieces if piece.path == path]
        plain = re.sub(r"\W+", "-", path.stem).strip("-") or "run"
        stem = next(name for at in itertools.count(1) if (name := plain if at == 1 else f"{plain}-{at}") not in taken)
        taken.add(stem)
        for at, part in enumerate(mine, 1):
            t, table = recording.t[part.first : part.last], recording.table.iloc[part.first : part.last]
            columns = {str(name): table[name].to_numpy(dtype=float) for name in table if name != "t_s"}
            name = f"{stem}-{at:02d}" if len(mapping.recordings) > 1 or len(mine) > 1 else stem
            purpose = f"{t[-1] - t[0]:.0f} s from {t[0]:.1f} s of {path.name}"
            yield Run(name, purpose, {"t_s": np.asarray(t - t[0]), **columns})
