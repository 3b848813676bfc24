"""Match the columns of a recording to the channels of a drive log, so that clock, positions and wheels agree on one
motion.

An interpretation of the columns (class `Reading`) states which columns are the clock, the position, the heading and the
wheel rates. `match_columns` lists the possible interpretations and takes the most probable interpretation if its
probability is large enough. Otherwise it refuses the recording and asks the user a question. The remaining channels are
read afterwards.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.column_names import Word
from rover_pin.base.formula import names_in, quote
from rover_pin.base.quantity import to_si
from rover_pin.importing.clock import SECONDS, Clock, clocks
from rover_pin.importing.evidence import is_settled, mean_known
from rover_pin.importing.joint_choice import PARTS, SAME, Options, Selection, Signals, choose, log_likelihood, signals
from rover_pin.importing.other_channels import channels
from rover_pin.importing.places import COURSE, headings, places
from rover_pin.importing.recording import Choice, Entry, Guess, Recording, formula_of, words_of
from rover_pin.importing.rover_checks import measured_numbers
from rover_pin.importing.wheels import wheel_choices
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.channels import is_column
from rover_pin.terrain.files import LARGEST

LACKS = {
    "duty_": "no duties: simulated wheels turn at the measured rates, so motors and gears cannot be identified",
    "current_": "no motor currents: the torques of the wheels are unknown, so the soil parameters k and phi cannot be "
    "separated",
    "body_pitch": "no pitch: slopes are computed from the height. Without a height, the terrain is taken as flat, and "
    "slopes look like slip",
    "body_z": "no height: slopes are computed from the pitch alone",
    "body_roll": "no roll: the loads of the left and right wheels are taken as equal",
}
"""Text in a channel name -> sentence on the limits of the search for missing effects if no channel name contains this
text. A raw current counts as a current."""
BOTH_WAYS_SHARE = 0.05
"""Minimum fraction of the driven rows that must go forwards, and also backwards, if a rover counts as driving in both
directions."""
TURNING_SHARE = 0.1
"""A wheel counts as turning if its rate exceeds this fraction of its fastest rate. A lower rate counts as the noise of
a wheel at rest."""
NOT_DRIVEN = (
    "the wheels never turn for 8 s without a stop, so there is no drive to compare with a simulation: give a recording "
    "with a longer drive."
)
"""Text of the error or note about a recording that cannot be used because the rover hardly drives in it."""


class Source(NamedTuple):
    """One recording after reading from a file, before its columns are matched to channels."""

    path: Path
    table: pd.DataFrame
    notes: tuple[str, ...]
    dates: tuple[str, ...] = ()
    """names of the columns that were read from dates and hold nanoseconds"""
    texts: Mapping[str, str] = MappingProxyType({})
    """name of each column without numbers -> its first cell that is not a number"""


class Reading(NamedTuple):
    """One interpretation of the columns of a recording: the chosen columns of its clock, position, heading and wheel
    rates.
    """

    clock: Clock
    place: Choice
    heading: Choice
    wheels: Choice


class Matching(NamedTuple):
    """The result of `match_columns`: the source of each channel, the recordings on their clocks, and the values of the
    channels.
    """

    guesses: tuple[Guess, ...]
    recordings: Mapping[Path, Recording]
    values: Mapping[Path, Mapping[str, np.ndarray]]
    """for each recording: channel name -> values (rows,) in SI"""
    lacks: tuple[str, ...]
    """one sentence for each missing channel: its name, and the limits of the search for missing effects without it"""
    unused: tuple[str, ...]
    """names of the recorded columns that no channel uses"""
    notes: tuple[str, ...]


def match_columns(sources: Sequence[Source], rover: Rover, declared: Mapping[str, Entry]) -> Matching:
    """Return which column or formula of some recordings is the source of each channel of a drive log, and the channels.

    A column that the user declared is used instead of any guess.

    Parameters
    ----------
    sources : sequence of Source
        Recordings with equal columns. A recording that lacks a column of the first recording is skipped.
    rover : Rover
        The rover that was driven.
    declared : mapping
        Channel of a drive log (or name of a helper column) -> its entry of [columns].

    Raises
    ------
    DataError
        No clock, position or wheel rates are found, or the columns have several possible interpretations. The message
        states the most probable interpretations and the option --column that decides between them.
    """
    tables = {item.path: item.table for item in sources}
    first = sources[0].path
    clock_given = declared.get("t_s", {}).get("formula", "")
    times = clocks(tables[first], clock_given, first, sources[0].dates, sources[0].texts)
    wheels = [mount.name for mount in rover.wheels]
    declared = {name: {"column": entry["formula"]} if entry["formula"] in tables[first] else entry
                for name, entry in declared.items()}  # fmt: skip
    # Declared names that are no channels of a drive log are helper columns for the user's other formulas.
    helpers = {name: entry for name, entry in declared.items() if not is_column(name, wheels)}
    declared_here = {name: entry for name, entry in declared.items() if name != "t_s" and name not in helpers}
    words = tuple(word for word in words_of(tables[first]) if word.name not in {clock.column for clock in times})
    names = set(map(str, tables[first].columns))
    lacking = {path: sorted(names - set(map(str, table.columns))) for path, table in tables.items()}
    excluded = {
        path: f"it has no column '{miss[0]}', but {first.name} has one" for path, miss in lacking.items() if miss
    }
    tables = {path: table for path, table in tables.items() if path not in excluded}

    # The motion is read first, and files that contradict the common reading are left out.
    reading, selection, options, files = _reading(tables, times, words, rover, declared_here, helpers, first)
    excluded |= _disagreeing(files, selection, options)
    recordings = {path: reading.clock.recording(table, helpers) for path, table in tables.items()
                  if path not in excluded}  # fmt: skip
    if not recordings:
        raise DataError(f"{first}: {NOT_DRIVEN}")
    guesses = {name: Guess(name, entry, "given by the user", True) for name, entry in helpers.items()}
    guesses |= {guess.target: guess for guess in _guesses(reading, selection, recordings)}
    values = {path: _values(recording, guesses.values()) for path, recording in recordings.items()}
    # Tilts, currents and the other channels are read last, because the motion shows their units and signs.
    more_guesses, questions = channels(
        words, list(recordings.values()), list(values.values()), rover, declared_here, reading.heading, reading.wheels
    )
    guesses |= {guess.target: guess for guess in more_guesses}
    # Terrain files do not allow coordinates as large as those of a map grid, so positions far from 0 get an offset, a
    # multiple of 10 m. The offset is in the unit of the column, because it is added before the conversion.
    positions = _values(next(iter(recordings.values())), guesses.values())
    for name in ("body_x", "body_y"):
        entry, place = guesses[name].entry, positions[name][np.isfinite(positions[name])][0]
        if abs(place) > LARGEST:
            unit = to_si(1.0, entry["unit"], "m", name) if entry.get("unit") else 1.0
            offset = entry.get("offset", 0.0) - round(float(place), -1) / unit
            guesses[name] = guesses[name]._replace(entry={**entry, "offset": offset})
    values = {path: _values(recording, guesses.values()) for path, recording in recordings.items()}
    used = {
        name
        for guess in guesses.values()
        for name in ([guess.entry["column"]] if "column" in guess.entry
                     else names_in(guess.entry["formula"], guess.target))
    }  # fmt: skip
    some = next(iter(values.values()))
    notes = [f"{path.name}: clock {reading.clock.description(table)}" for path, table in tables.items()
             if path in recordings]  # fmt: skip
    notes += [f"{path.name}: left out: {why}" for path, why in excluded.items()] + questions
    notes += measured_numbers(list(recordings.values()), list(values.values()), rover)
    lacks = [lack for part, lack in LACKS.items() if not any(part in name for name in some)]
    unused = tuple(word.name for word in words if word.name not in used)
    return Matching(
        tuple(guesses.values()), recordings, values, (*lacks, *_lacks_of_wheels(some, wheels)), unused, tuple(notes)
    )


def _lacks_of_wheels(names: Collection[str], wheels: Sequence[str]) -> Iterator[str]:
    """Yield one sentence for each quantity (rate, motor current) that some wheels have and others lack; the sentence
    states how the wheels without the quantity are treated.
    """
    # Without duties, the simulated wheels take the measured rates, so each of them needs a rate.
    held = not any(name.startswith("duty_") for name in names)
    for quantity, forms, rest in (
        (
            "rate",
            ("wheel_rate_{}",),
            "each takes the mean rate of the other wheels on its side" if held else "their rates are not compared",
        ),
        ("motor current", ("current_{}_A", "raw_current_{}"), "their currents are not compared"),
    ):
        missing = [wheel for wheel in wheels if not any(form.format(wheel) in names for form in forms)]
        if missing and len(missing) < len(wheels):
            there = f"{len(wheels) - len(missing)} of {len(wheels)} wheels have one"
            yield f"no {quantity} of {', '.join(missing)} ({there}): {rest}"


def _reading(
    tables: Mapping[Path, pd.DataFrame],
    times: Sequence[Clock],
    words: Sequence[Word],
    rover: Rover,
    declared: Mapping[str, Entry],
    helpers: Mapping[str, Entry],
    first: Path,
) -> tuple[Reading, Selection, Options, dict[Path, Signals]]:
    """Return the most probable interpretation of the columns as clock, position, heading and wheel rates.

    Odometry and commanded wheel rates are considered only if no measured column fits.

    Parameters
    ----------
    tables : mapping
        File -> table of numbers.
    times : sequence of Clock
        The candidates for the clock.
    words : sequence of Word
        The columns that are no clocks.
    declared, helpers : mapping
        Entries of [columns] that the user gave for channels and for helper columns.
    first : Path
        The first file, for error messages.

    Returns
    -------
    tuple
        The interpretation; the selection with its probabilities; the possible columns that it was selected from; the
        signals of each file.

    Raises
    ------
    DataError
        The position or the wheel rates have no column, the interpretation is ambiguous, or the rover does not drive.
    """
    # Every candidate for the clock gives other speeds, so the signals are computed once for each of them.
    by_clock = [[clock.recording(table, helpers) for table in tables.values()] for clock in times]
    lasts = [float(files[0].t[-1]) for files in by_clock]
    place_tiers, wheel_tiers = places(words, declared), wheel_choices(words, rover, declared)
    heading = headings(words, declared)
    place = "the position of the rover (x and y, or latitude and longitude)"
    needed = {"body_x": (place_tiers, place)}
    needed[f"wheel_rate_{rover.wheels[0].name}"] = (wheel_tiers, "the rate of each wheel")
    for name, (tiers, meaning) in needed.items():
        if not any(tiers):
            raise DataError(
                f"{first}: no column is known as {meaning}: give --column {name}='FORMULA'. The formula may use the "
                f"columns of this file: {', '.join(quote(word.name) for word in words)}."
            )
    # Tiers are tried from the best to the worst until a reading is settled. If none is, the most probable one is
    # taken.
    tried = []
    for wheels, tier in ((wheels, tier) for wheels in filter(None, wheel_tiers) for tier in filter(None, place_tiers)):
        options = Options(tier, heading, wheels)
        blocks = [[signals(file, options, rover) for file in files] for files in by_clock]
        selection = choose(blocks, lasts, options, [clock.weight for clock in times])
        tried.append((selection, options, dict(zip(tables, blocks[selection.parts[0]], strict=True))))
        if is_settled(selection.fits):
            break
    selection, options, files = max(tried, key=lambda item: item[0].fits)
    if is_settled(tried[-1][0].fits):
        selection, options, files = tried[-1]
    if not any(np.any(item.rims) and np.any(item.places) for item in files.values()):
        raise DataError(f"{first}: {NOT_DRIVEN}")
    _refuse_open_parts(selection, times, options, first)
    return _of_parts(selection.parts, times, options), selection, options, files


def _of_parts(at: Sequence[int], times: Sequence[Clock], options: Options) -> Reading:
    """Return the clock, position, heading and wheel columns that four indices select from the lists of possible
    columns.
    """
    return Reading(times[at[0]], options.places[at[1]], options.headings[at[2]], options.wheels[at[3]])


def _refuse_open_parts(selection: Selection, times: Sequence[Clock], options: Options, first: Path) -> None:
    """Raise an error if clock, position, heading or wheel rates are ambiguous in the most probable interpretation of
    the columns.

    The message states the two most probable interpretations and the option --column that decides. If the user gave all
    columns, nothing is ambiguous.

    Raises
    ------
    DataError
        The clock counts rows and the time between rows is unknown; the columns do not agree on one motion; two
        interpretations of a column are probable; or the scale of the wheel rates is unknown.
    """
    if all(len(choices) == 1 for choices in (times, *options)):
        return
    best = _of_parts(selection.parts, times, options)
    if not best.clock.unit and not best.clock.formula:
        raise DataError(
            f"{first}: '{best.clock.column}' counts rows, and the number of rows per second is not recorded: give "
            f"--column t_s='{quote(best.clock.column)} / RATE' with this number as RATE."
        )
    # The least certain part is named first, because settling it often settles the others.
    part = min(PARTS, key=lambda item: selection.share[item])
    if not is_settled(selection.fits):
        raise DataError(
            f"{first}: clock, position, heading and wheels do not agree on one motion. The most probable choice of "
            f"columns is {_options_of(best, PARTS)}, but its probability is only {selection.fits:.2f}: correct the "
            "wrong column by --column NAME='FORMULA'."
        )
    if not is_settled(selection.share[part]):
        rival = _of_parts(selection.rival[part], times, options)
        raise DataError(
            f"{first}: two interpretations of the {part} are probable: {_options_of(best, [part])} "
            f"(P = {selection.share[part]:.2f}), or {_options_of(rival, [part])}: choose one by --column."
        )
    if best.wheels.free:
        name, entry = next(iter(best.wheels.entries.items()))
        text = formula_of(name, entry)
        raise DataError(
            f"{first}: {name} = {text} is no rate of the wheel, because the rim speed that it gives does not match the "
            "ground speed. The column holds encoder counts, or the rate of the motor before a gear. The gear ratio is "
            f"not recorded; it is about {selection.gear:.3g} if the slip is usual: give --column {name}='{text} / "
            "GEAR', and the same for each other wheel."
        )


def _options_of(reading: Reading, parts: Iterable[str]) -> str:
    """Return the columns of an interpretation as options --column NAME='FORMULA', for an error message.

    `parts` states which of clock, place, heading and wheels are written. Each is written with two columns at most.
    """
    texts = []
    for part in parts:
        # A clock is one column or formula; each other part has an entry for each channel.
        choice = reading[PARTS.index(part)]
        if isinstance(choice, Clock):
            factor = SECONDS.get(choice.unit, 1.0)
            text = quote(choice.column) if factor == 1.0 else f"{factor:g} * {quote(choice.column)}"
            texts.append(f"t_s='{choice.formula or text}'")
        else:
            texts += [f"{name}='{formula_of(name, entry)}'" for name, entry in list(choice.entries.items())[:2]]
    return " ".join(texts)


def _disagreeing(files: Mapping[Path, Signals], selection: Selection, options: Options) -> dict[Path, str]:
    """Return the files to leave out, each with the reason: its columns contradict the common interpretation, or the
    rover does not move.

    The common interpretation of the columns fits all files together.
    """
    _, place, heading, wheel = selection.parts
    travelled = {path: float(np.mean(np.abs(blocks.places[place]))) for path, blocks in files.items()}
    reasons = {}
    for path, blocks in files.items():
        # The likelihood of one file alone under the chosen reading: the signals are cut down to the chosen choices.
        single = Options([options.places[place]], [options.headings[heading]], [options.wheels[wheel]])
        chosen = dict.fromkeys(("places", "climbs"), place) | dict.fromkeys(("headings", "turns"), heading)
        chosen |= dict.fromkeys(("rims", "spins", "rates", "fastest"), wheel)
        alone = blocks._replace(**{name: getattr(blocks, name)[[at]] for name, at in chosen.items()})
        if not travelled[path] > SAME * max(travelled.values()):
            reasons[path] = "the rover does not move in it"
        elif len(files) > 1 and float(log_likelihood(alone, single)[0, 0, 0]) < 0.0:
            reasons[path] = (
                "its position, heading and wheels contradict the choice of columns that fits the other files"
            )
    return reasons


def _guesses(reading: Reading, selection: Selection, recordings: Mapping[Path, Recording]) -> Iterator[Guess]:
    """Yield the source of each channel of position, wheel rates and heading, with the probability that the source is
    right.

    If no heading is recorded, the course (direction of travel) replaces it. If the wheels run both forwards and
    backwards, the course is reversed while they run backwards.
    """
    for part, choice in (("place", reading.place), ("wheels", reading.wheels), ("heading", reading.heading)):
        for name, entry in choice.entries.items():
            guess = Guess(name, entry, choice.why, choice.sure, selection.share[part])
            if entry.get("formula") == COURSE:
                rates = reading.wheels.entries
                series = [mean_known([recording.values(item, name) for name, item in rates.items()])
                          for recording in recordings.values()]  # fmt: skip
                if BOTH_WAYS_SHARE < share_back(np.concatenate(series)) < 1.0 - BOTH_WAYS_SHARE:
                    text = f"heading(body_x, body_y, t_s, {' + '.join(rates)})"
                    why = (
                        "no heading is recorded, so the direction of travel replaces it, reversed while the wheels run "
                        "backwards"
                    )
                    guess = guess._replace(entry={"formula": text}, why=why)
            yield guess


def share_back(rates: np.ndarray) -> float:
    """Return the fraction of backward rotation among the rows with a turning wheel.

    `rates` are the rates of one wheel [rad/s] (rows,).
    """
    size = np.abs(np.nan_to_num(rates))
    turning = rates[size > TURNING_SHARE * np.max(size, initial=0.0)]
    return float(np.mean(turning < 0.0)) if turning.size else 0.0


def _values(recording: Recording, guesses: Iterable[Guess]) -> dict[str, np.ndarray]:
    """Return the values of all channels of a recording in SI (channel name -> array (rows,)), computed from their
    sources.

    A formula may use channels whose sources precede it.
    """
    values: dict[str, np.ndarray] = {}
    for guess in guesses:
        values[guess.target] = recording.values(guess.entry, guess.target, values)
    return values
