"""Convert recordings of any program to one drive log: read them, match their columns to channels, cut them into runs,
write.

`import_log` is the function behind `rover-pin import-log`.
"""

import itertools
import logging
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.encode import comment, toml_string
from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.paths import data_path, exists, is_file, named_from
from rover_pin.base.files.table import columns_text
from rover_pin.base.files.toml_file import toml_key, toml_value
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.importing.clock import clock_words, restarts, times, whole_stamps, wrapped_clock
from rover_pin.importing.column_matching import Matching, Source, match_columns
from rover_pin.importing.files.raw import read_raw
from rover_pin.importing.lost_values import drop_lost_values
from rover_pin.importing.own_clocks import on_common_clock
from rover_pin.importing.recording import Guess
from rover_pin.importing.splitting import DriveSignals, Part, choose_parts, drive_of, parts
from rover_pin.logs.drive_log import FILE
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.trace.channels import WHOLE, is_column

log = logging.getLogger(__name__)
MAX_RUNS = 12
"""Maximum number of runs of an imported log, unless the user asks for more. Runs are costly, because the search for
missing effects simulates each of them hundreds of times."""

INTERPRETED = (
    "body_x", "body_y", "body_z", "body_roll", "body_pitch", "body_yaw", "wheel_rate_", "current_", "raw_current_",
    "duty_", "steer_", "rocker_", "bogie_", "gyro_", "accelerometer_",
)  # fmt: skip
"""Beginnings of the names of the channels whose columns, units and signs the importer chooses. All other channels, such
as `battery_V`, are read from a column with their own name."""

LARGE = 5_000_000
"""Maximum size of a file [bytes] that is read without an announcement. Reading a larger file takes long, so the program
announces it."""


@dataclass(frozen=True)
class ImportResult:
    """The result of `import_log`: the files of the drive log that was written, and sentences for the user on its
    content.
    """

    files: tuple[Path, ...]
    columns: tuple[str, ...]
    """one line for each channel: its source, marked GUESSED if the recording does not state the source"""
    runs: tuple[str, ...]
    lacks: tuple[str, ...]
    notes: tuple[str, ...]


class Run(NamedTuple):
    """One run that will be written: its file name, a text on its origin, and its columns (rows,)."""

    name: str
    purpose: str
    columns: Mapping[str, np.ndarray]


class Sheet(NamedTuple):
    """The content of the drive.toml of an imported drive log. `drive_toml` converts it to text."""

    name: str
    source: str
    rover: str
    wheels: Sequence[str]
    guesses: Sequence[Guess]
    runs: Sequence[Run]
    notes: Sequence[str]
    is_ground_estimated: bool
    """whether pitch or height is recorded, so that the terrain is estimated from them"""
    is_rate_driven: bool
    """whether some wheels have a duty and others have none, so that a simulation takes the wheel rates as its input"""
    base_sd: tuple[float, float]
    """SD of the unknown position of the tracked point on the rover, along and across the rover [m]. The point may be
    anywhere between the wheels."""


def import_log(
    recordings: Sequence[str | Path],
    rover: str | Path = "nexus6",
    out: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    most: int = MAX_RUNS,
) -> ImportResult:
    """Convert recordings of any layout to a drive log in a new folder, and return its files and sentences on its
    content.

    Parameters
    ----------
    recordings : sequence of paths
        Files with equal columns: CSV and other text, Parquet, .mat, ROS bags, MCAP, lines of JSON. A file may hold
        several recordings.
    rover : str or path
        The rover that was driven: a name, or a TOML file as `rover-pin new-rover` writes it.
    out : path, optional
        Folder of the log. By default, the folder has the name of the first recording and lies next to it; for a shipped
        sample it is in the current folder.
    columns : mapping, optional
        Channel of a drive log -> column or formula of the recording that is its source. A channel that is not given is
        guessed. A formula of `t_s` may use `row`, the row number from 0.
    most : int
        Maximum number of runs. If the recordings hold more, the most informative ones are kept.

    Returns
    -------
    ImportResult
        The written files, the source of each channel, and the missing channels with their consequences.

    Raises
    ------
    DataError
        No recording is given; a recording cannot be read, is ambiguous, or has no clock, position or wheel rates; or
        the output folder is not empty.

    Examples
    --------
    >>> import_log(["drive.csv"], "nexus6", "mine", {"t_s": "row / 50"}).columns  # doctest: +SKIP
    """
    paths = [data_path(file) for file in recordings]
    if not paths:
        raise DataError(
            "import-log: no recording was given: give at least one file: CSV, Parquet, .mat, .bag, .db3 or .mcap."
        )
    # By default the log lies next to its first recording; a shipped sample is not in the user's folders.
    first = Path(recordings[0])
    folder = Path(out) if out is not None else (first if exists(first) else Path(first.name)).with_suffix("")
    if exists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder} already exists, and nothing is overwritten: give another folder with --out.")
    loaded_rover = load_rover(str(rover))
    declared = {name: {"formula": text} for name, text in (columns or {}).items()}
    # A declared name that is neither a channel of this rover nor used by another formula is refused: a misspelt channel
    # would otherwise be read as a helper column that nothing uses, and be ignored silently.
    wheels = [mount.name for mount in loaded_rover.wheels]
    used = {word for entry in declared.values() for word in re.findall(r"\w+", entry["formula"])}
    for name in declared:
        if not is_column(name, wheels) and name not in used:
            kinds = ("wheel_rate_{}", "duty_{}", "current_{}_A", "raw_current_{}")
            there = (*WHOLE, *loaded_rover.angles, *(kind.format(wheel) for kind in kinds for wheel in wheels))
            raise DataError(
                f"--column {name}: a drive log of {loaded_rover.name} has no channel '{name}', and no formula of "
                f"another --column uses this name: {closest(name, there)}"
            )
    clock = declared.get("t_s", {}).get("formula", "")
    read = showing_progress((_read(path, clock) for path in paths), len(paths), "recordings read")
    # A recording that repeats all rows of another one is left out, with a note. If it were counted twice, its noise
    # would look like a reproducible effect.
    sources: list[Source] = []
    for source in itertools.chain.from_iterable(read):
        at = next((at for at, other in enumerate(sources) if other.table.equals(source.table)), None)
        if at is None:
            sources.append(source)
        else:
            twin = sources[at]
            note = f"{source.path.name}: left out, because it has the same rows as {twin.path.name}"
            sources[at] = twin._replace(notes=(*twin.notes, *source.notes, note))
    mapping = match_columns(sources, loaded_rover, declared)
    return _write_log(folder, sources, rover, loaded_rover, mapping, most)


def _read(path: Path, clock: str) -> list[Source]:
    """Return the recordings in a file, each without lost values and with all of its columns on one clock.

    A file holds several recordings if its clock decreases and then increases again from there. `clock` is the column
    that the user stated as the clock, or ''.
    """
    size = path.stat().st_size if is_file(path) else 0
    if size > LARGE:
        log.info("reading %s: %.0f MB", path.name, size / 1e6)
    raw = read_raw(path)
    notes = [f"{path.name}: {note}" for note in raw.notes]
    # A clock falls back if its counter overflows or if it begins again each day. Such a clock is continued past each
    # overflow before the file is cut at falls of the clock, because an overflow is no new recording.
    table = whole_stamps(raw.table)
    for item in clock_words(table):
        values = times(table[item.name])
        if item.name == (clock or item.name) and (begins := restarts(values)):
            continued = wrapped_clock(values, begins)
            if continued is not None:
                notes.append(
                    f"{path.name}: the clock '{item.name}' overflows and begins again at row {begins[0] + 1}. Its "
                    "times are continued there"
                )
                table = table.assign(**{item.name: continued + float(table[item.name].iloc[0])})
                break
    # If the clock still falls back, the file holds several recordings one after the other. Each of them gets a name of
    # its own, and one note states the rows at which the clock falls back.
    tables = {path: table}
    for item in clock_words(table):
        values = times(table[item.name])
        begins = restarts(values) if item.name == (clock or item.name) else []
        if begins:
            falls = [f"row {row + 1} (from {_cell(table, item.name, values, row)})" for row in begins[:5]]
            notes.append(
                f"{path.name}: the clock '{item.name}' decreases at {', '.join(falls)}"
                f"{' ...' if len(begins) > 5 else ''}, so the file is read as {len(begins) + 1} recordings"
            )
            edges = [0, *begins, len(table)]
            pieces = [table.iloc[a:b].reset_index(drop=True) for a, b in itertools.pairwise(edges)]
            tables = {path.with_name(f"{path.name}, recording {at}"): piece for at, piece in enumerate(pieces, 1)}
            break
    sources = []
    for part, rows in tables.items():
        cleaned, lost = drop_lost_values(part, rows, raw.dates)
        joined, clocks = on_common_clock(part, cleaned, raw.dates, clock)
        # A resampled table has a clock in seconds, so no column of it holds dates any more.
        dates = raw.dates if joined is cleaned else ()
        sources.append(Source(part, joined, (*notes, *lost, *clocks), dates, raw.texts))
    return sources


def _cell(table: pd.DataFrame, name: str, values: np.ndarray, row: int) -> str:
    """Return the text "TIME to TIME" with the clock's times before and at a row where the clock decreases, as the file
    has them.
    """
    before = int(np.flatnonzero(np.isfinite(values[:row]))[-1])
    return f"{table[name].iloc[before]:.10g} to {table[name].iloc[row]:.10g}"


class _Piece(NamedTuple):
    """One run before it is written: the path of its recording, the signals of the recording, and the rows of the
    run.
    """

    path: Path
    drive: DriveSignals
    part: Part


def _write_log(
    folder: Path, sources: Sequence[Source], rover: str | Path, loaded_rover: Rover, mapping: Matching, most: int
) -> ImportResult:
    """Write the CSV file of each run and then drive.toml, and return the list of files with sentences on the log."""
    # All recordings are cut into runs, and at most `most` runs are kept.
    drives = {path: drive_of(file.t, mapping.values[path], loaded_rover) for path, file in mapping.recordings.items()}
    pieces = [_Piece(path, drive, part) for path, drive in drives.items() for part in parts(drive)]
    empty = [path.name for path in drives if path not in {piece.path for piece in pieces}]
    if not pieces:
        raise DataError(
            f"{next(iter(drives))}: the wheels never turn for 8 s without a stop, so there is no drive to compare with "
            "a simulation: give a recording with a longer drive."
        )
    remarks = [f"{name}: left out, because the wheels never turn for 8 s without a stop" for name in empty]
    indices = choose_parts([(piece.drive, piece.part) for piece in pieces], most)
    picks = [pieces[at] for at in indices]
    if len(picks) < len(pieces):
        times = sum(float(piece.drive.t[piece.part.last - 1] - piece.drive.t[piece.part.first]) for piece in picks)
        total = sum(float(drive.t[-1]) for drive in drives.values())
        remarks.append(
            f"{len(picks)} of {len(pieces)} runs are kept, {times:.0f} s of {total:.0f} s. These runs are the most "
            "informative on slip, slope, turns and wheel rates. The option --most keeps more runs"
        )
    wheels = [mount.name for mount in loaded_rover.wheels]
    written = _written_columns(sources[0].table, mapping, wheels)
    guesses = tuple(_renamed(guess, written) for guess in mapping.guesses)
    runs, base = list(_runs(picks, mapping, written)), base_of(loaded_rover)
    # A channel that the importer does not interpret is read by its own name, so that it is used.
    idle = [name for name in mapping.unused if name not in written or not is_column(name, wheels)]
    unused = f"{sources[0].path.name}: columns not used: {', '.join(idle[:30])}" if idle else ""
    of_files = (note for source in sources for note in source.notes)
    notes = tuple(dict.fromkeys(filter(None, (*of_files, *mapping.notes, *remarks, unused))))
    names = {*next(iter(mapping.values.values())), *written}
    duties = [mount for mount in loaded_rover.wheels if f"duty_{mount.name}" in names]
    sheet = Sheet(
        folder.name,
        f"imported from {', '.join(source.path.name for source in sources)}",
        named_from(folder, rover),
        wheels,
        guesses,
        runs,
        [*notes, *(f"Lacks {lack}." for lack in mapping.lacks)],
        any(guess.target in ("body_pitch", "body_z") for guess in mapping.guesses),
        0 < len(duties) < len(loaded_rover.wheels),
        (base.length / math.sqrt(12.0), base.track / math.sqrt(12.0)),
    )
    csv_files = (replace_file(folder / f"{run.name}.csv", columns_text(dict(run.columns))) for run in runs)
    files = list(showing_progress(csv_files, len(runs), "runs written"))
    files.append(replace_file(folder / FILE, drive_toml(sheet)))
    purposes = tuple(f"{run.name}: {run.purpose}" for run in runs)
    return ImportResult(tuple(files), tuple(guess_lines(mapping.guesses)), purposes, mapping.lacks, notes)


def _written_columns(table: pd.DataFrame, mapping: Matching, wheels: Sequence[str]) -> dict[str, str]:
    """Return the recorded columns that the files of the log hold: name in the recording -> name in the log.

    The reader of a log takes each column with a channel's name for that channel, whatever its unit and sign are. For
    channels that the importer interprets (INTERPRETED), such a column is therefore left out if no channel uses it, and
    gets another name if it is the source of another channel, as `bogie_l_deg` is for `bogie_l`.
    """
    own = {guess.target for guess in mapping.guesses if guess.entry.get("column") == guess.target}
    formulas = " ".join(str(guess.entry.get("formula", "")) for guess in mapping.guesses)
    written = {}
    for name in map(str, table.columns):
        is_channel = is_column(name, wheels) and name.startswith(INTERPRETED) and name not in own
        if name == "t_s" or (is_channel and name in mapping.unused):
            continue
        # A formula names its columns in its text, which stays as it is.
        written[name] = f"recorded {name}" if is_channel and name not in formulas else name
    return written


def _renamed(guess: Guess, written: Mapping[str, str]) -> Guess:
    """Return a guess whose source is the column under its name in the log, of `written`."""
    source = guess.entry.get("column")
    return guess if source is None else guess._replace(entry={**guess.entry, "column": written.get(source, source)})


def _runs(pieces: Sequence[_Piece], mapping: Matching, written: Mapping[str, str]) -> Iterator[Run]:
    """Yield the runs of the imported log with their names. A run has the name of its recording, and a number if there
    are several.

    `written` maps the recorded columns of a run's file to their names in it.
    """
    taken: set[str] = set()
    for path, recording in mapping.recordings.items():
        mine = [piece.part for piece in pieces if piece.path == path]
        plain = re.sub(r"\W+", "-", path.stem).strip("-") or "run"
        stem = next(name for at in itertools.count(1) if (name := plain if at == 1 else f"{plain}-{at}") not in taken)
        taken.add(stem)
        for at, part in enumerate(mine, 1):
            t, table = recording.t[part.first : part.last], recording.table.iloc[part.first : part.last]
            columns = {name: table[source].to_numpy(dtype=float) for source, name in written.items()}
            name = f"{stem}-{at:02d}" if len(mapping.recordings) > 1 or len(mine) > 1 else stem
            purpose = f"{t[-1] - t[0]:.0f} s from {t[0]:.1f} s of {path.name}"
            yield Run(name, purpose, {"t_s": np.asarray(t - t[0]), **columns})


def drive_toml(sheet: Sheet) -> str:
    """Return the text of the drive.toml of an imported log. A comment marks each source of a channel that is
    guessed.
    """
    ground = (
        "estimated = true  # GUESSED: the recording states no terrain, so it is estimated from pitch, roll and height"
        if sheet.is_ground_estimated
        else 'slope = { value = 0.0, unit = "deg" }  # ASSUMED flat: neither pitch nor height is recorded'
    )
    lines = [
        "# Written by `rover-pin import-log`. The recording does not state the values marked GUESSED: check them.",
        *(f"# {comment(note)}" for note in sheet.notes),
        "",
        'kind = "drive-log"',
        f"name = {toml_string(sheet.name)}",
        f"source = {toml_string(sheet.source)}",
        f"rover = {toml_string(sheet.rover)}",
        "gravity = 9.81  # ASSUMED: Earth",
        f"wheels = [{', '.join(map(toml_string, sheet.wheels))}]",
    ]
    if sheet.is_rate_driven:
        lines.append('input = "rates"  # a duty is not recorded, so all wheels are held to their measured rates')
    lines += [
        "\n[terrain]",
        ground,
        '# or: slope = { value = 12, unit = "deg" }, positive uphill along the heading at the start of each run;',
        '# or in a [[run]]: terrain = { slope = { value = 5, unit = "deg" } }; or polyline = "ground.csv"',
        "\n[tracker]  # the point of the rover at body_x and body_y, ASSUMED to be anywhere between the wheels",
    ]
    lines += [f'{x} = {{ value = 0.0, unit = "m", sd = {sd:.3g} }}' for x, sd in zip("xy", sheet.base_sd, strict=True)]
    lines += [
        "\n# Known constants of the soil, each with its sd. Without them, sand that carries the rover is assumed:",
        "# [soil]",
        '# phi = { value = 32.0, unit = "deg", sd = 2.0 }',
        "\n[columns]  # source of each channel: a column or a formula of columns; units are converted to SI",
    ]
    for guess in sheet.guesses:
        # A column that already has the channel's name needs no line.
        if guess.entry != {"column": guess.target}:
            mark = "" if guess.sure else f"  # GUESSED (P = {guess.share:.2f}): {comment(guess.why)}"
            lines.append(f"{toml_key(guess.target)} = {toml_value(guess.target, guess.entry)}{mark}")
    for run in sheet.runs:
        lines += ["\n[[run]]", f"file = {toml_string(run.name + '.csv')}", f"purpose = {toml_string(run.purpose)}"]
    return "\n".join(lines) + "\n"


def guess_lines(guesses: Sequence[Guess]) -> Iterator[str]:
    """Yield one line for each channel, as the command prints it: "channel = source", with the reason if the source is
    guessed.
    """
    for guess in guesses:
        source = guess.entry.get("column") or guess.entry.get("formula")
        unit = f" [{guess.entry['unit']}]" if "unit" in guess.entry else ""
        offset = f" {guess.entry['offset']:+.6g}" if "offset" in guess.entry else ""
        scale = {1.0: "", -1.0: "-"}.get(factor := guess.entry.get("scale", 1.0), f"{factor:.6g} * ")
        yield f"{guess.target} = {scale}{source}{offset}{unit}" + (
            "" if guess.sure else f"  GUESSED (P = {guess.share:.2f}): {guess.why}"
        )
