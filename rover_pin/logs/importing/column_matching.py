"""A recording understood: its files on one clock, and the reading on which everything in them agrees, or a question."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.formula import names_in, quote
from rover_pin.base.quantity import to_si
from rover_pin.logs.importing.clock import Clock, clocks, whole_stamps
from rover_pin.logs.importing.evidence import SURE, mean_known
from rover_pin.logs.importing.joint_choice import PARTS, SAME, Chosen, Options, Signals, choose, log_likelihood, signals
from rover_pin.logs.importing.measured import measured_numbers
from rover_pin.logs.importing.other_channels import channels
from rover_pin.logs.importing.places import COURSE, headings, places
from rover_pin.logs.importing.recording import Choice, Entry, Guess, Recording, formula_of, words_of
from rover_pin.logs.importing.wheels import wheel_choices
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.channels import is_column
from rover_pin.terrain.files import LARGEST

LACKS = {
    "duty_": "no duties: the wheels are held to their measured rates, and what motors and gears do does not show",
    "current_": "no motor currents: the wheels' torques are unknown, and the soil's k apart from its phi",
    "body_pitch": "no pitch: slopes come of the height, or are taken as flat, and then look like slip",
    "body_z": "no height: slopes come of the pitch alone",
    "body_roll": "no roll: loads of left and right wheels are taken as equal",
}
"""What is missed where no column has this in its name (a raw current is one too), and what cannot be answered then."""
BOTH_WAYS = 0.05
"""Share of rows at which the wheels run the other way, from which a rover drives both ways."""
TURNS_FROM = 0.1
"""Share of the fastest rate from which a wheel turns: less is noise of one that stands."""


class Source(NamedTuple):
    """A file of a recording as it was read."""

    path: Path
    table: pd.DataFrame
    notes: tuple[str, ...]


class Understood(NamedTuple):
    """What a recording's drive log is made of, its files, and what they show of the drive."""

    guesses: tuple[Guess, ...]
    recordings: Mapping[Path, Recording]
    values: Mapping[Path, Mapping[str, np.ndarray]]
    "of each channel of each file, in SI"
    lacks: tuple[str, ...]
    unused: tuple[str, ...]
    notes: tuple[str, ...]


def understand_columns(sources: Sequence[Source], rover: Rover, declared: Mapping[str, Entry]) -> Understood:
    """Return what the columns of a recording are; what the user has `declared` comes before any guess.

    Raises DataError: no clock, place, heading or rates of all wheels can be found, or what is found can be read in
    several ways.
    """
    tables = {item.path: whole_stamps(item.table) for item in sources}
    first = sources[0].path
    times = clocks(tables[first], declared.get("t_s", {}).get("formula", ""), first)
    wheels = [mount.name for mount in rover.wheels]
    declared = {name: {"column": entry["formula"]} if entry["formula"] in tables[first] else entry
                for name, entry in declared.items()}  # fmt: skip
    helpers = {name: entry for name, entry in declared.items() if not is_column(name, wheels)}
    declared_here = {name: entry for name, entry in declared.items() if name != "t_s" and name not in helpers}
    words = tuple(word for word in words_of(tables[first]) if word.name not in {clock.column for clock in times})
    tables, excluded = _of_one_layout(tables, first)
    choice, picked, options, files = _reading(tables, times, words, rover, declared_here, helpers, first)
    clock = times[picked.parts[0]]
    excluded |= {path: why for path, why in _against(files, picked, options).items()}
    recordings = {path: clock.recording(table, helpers) for path, table in tables.items() if path not in excluded}
    if not recordings:
        raise DataError(f"{first}: the wheels never turn for 8 s on end: nothing was driven that could be compared.")
    guesses = {name: Guess(name, entry, "as given", True) for name, entry in helpers.items()}
    guesses |= {guess.target: guess for guess in _guesses(choice, picked, recordings)}
    values = {path: _values(recording, guesses.values()) for path, recording in recordings.items()}
    more_guesses, questions = channels(
        words, list(recordings.values()), list(values.values()), rover, declared_here, choice
    )
    guesses |= {guess.target: guess for guess in more_guesses}
    guesses |= {guess.target: guess for guess in _from_an_origin(guesses, recordings)}
    values = {path: _values(recording, guesses.values()) for path, recording in recordings.items()}
    used = {name for guess in guesses.values() for name in _sources(guess)}
    some = next(iter(values.values()))
    notes = [f"{path.name}: clock {clock.description(table)}" for path, table in tables.items() if path in recordings]
    notes += [f"{path.name}: left out: {why}" for path, why in excluded.items()] + questions
    notes += measured_numbers(list(recordings.values()), list(values.values()), rover)
    return Understood(
        tuple(guesses.values()),
        recordings,
        values,
        tuple(lack for part, lack in LACKS.items() if not any(part in name for name in some)),
        tuple(word.name for word in words if word.name not in used),
        tuple(notes),
    )


def _of_one_layout(
    tables: Mapping[Path, pd.DataFrame], first: Path
) -> tuple[dict[Path, pd.DataFrame], dict[Path, str]]:
    """Return the files with the first one's columns, and why others are left out."""
    names = set(map(str, tables[first].columns))
    lacking = {path: sorted(names - set(map(str, table.columns))) for path, table in tables.items()}
    why = {
        path: f"it has no column '{missing[0]}', as {first.name} has" for path, missing in lacking.items() if missing
    }
    return {path: table for path, table in tables.items() if path not in why}, why


def _reading(
    tables: Mapping[Path, pd.DataFrame],
    times: Sequence[Clock],
    words: Any,
    rover: Rover,
    declared: Mapping[str, Entry],
    helpers: Mapping[str, Entry],
    first: Path,
) -> tuple[tuple[Clock, Choice, Choice, Choice], Chosen, Options, dict[Path, Signals]]:
    """Return the likeliest reading of what is measured, or, where nothing measured fits, of odometry and commands."""
    by_clock = [[clock.recording(table, helpers) for table in tables.values()] for clock in times]
    lasts = [float(files[0].t[-1]) for files in by_clock]
    where, which = places(words, declared), wheel_choices(words, rover, declared)
    heading = headings(words, declared)
    _refuse_without(where, which, words, rover, first)
    tried = []
    for wheels in filter(None, which):
        for place in filter(None, where):
            options = Options(place, heading, wheels)
            blocks = [[signals(file, options, rover) for file in files] for files in by_clock]
            picked = choose(blocks, lasts, options, [clock.weight for clock in times])
            tried.append((picked, options, dict(zip(tables, blocks[picked.parts[0]], strict=True))))
            if picked.fits > SURE:
                break
        else:
            continue
        break
    picked, options, files = tried[-1] if tried[-1][0].fits > SURE else max(tried, key=lambda item: item[0].fits)
    if not any(np.any(item.rims) and np.any(item.places) for item in files.values()):
        raise DataError(f"{first}: the wheels never turn for 8 s on end: nothing was driven that could be compared.")
    reading = _parts(picked.parts, times, options)
    _ask(picked, times, options, first)
    return reading, picked, options, files


def _parts(at: Sequence[int], times: Sequence[Clock], options: Options) -> tuple[Clock, Choice, Choice, Choice]:
    return times[at[0]], options.places[at[1]], options.headings[at[2]], options.wheels[at[3]]


def _ask(picked: Chosen, times: Sequence[Clock], options: Options, first: Path) -> None:
    """Refuse a reading of which a part is open: say the two likeliest, and what decides; what is given is not."""
    if all(len(choices) == 1 for choices in (times, *options)):
        return
    best = _parts(picked.parts, times, options)
    if not best[0].unit and not best[0].formula:
        raise DataError(
            f"{first}: '{best[0].column}' counts rows, and how many a second is not recorded: say "
            f"--column t_s='{quote(best[0].column)} / RATE'."
        )
    part = min(PARTS, key=lambda item: picked.share[item])
    if picked.fits <= SURE:
        raise DataError(
            f"{first}: clock, place, heading and wheels do not agree (P = {picked.fits:.2f} that "
            f"{_options_of(best, range(4))} is right): say what is wrong there by --column NAME='FORMULA'."
        )
    if picked.share[part] < SURE:
        at = [PARTS.index(part)]
        rival = _parts(picked.rival[part], times, options)
        raise DataError(
            f"{first}: the {part} can be read in two ways: {_options_of(best, at)} (P = {picked.share[part]:.2f}), or "
            f"{_options_of(rival, at)}: say which by --column."
        )
    if best[3].free:
        name, entry = next(iter(best[3].entries.items()))
        text = formula_of(name, entry)
        raise DataError(
            f"{first}: {name} = {text} is no rate of the wheel: its rim does not run with the ground. It is counts or "
            f"behind a gear, whose number (near {picked.gear:.3g}, by the usual slip) is not recorded: say --column "
            f"{name}='{text} / GEAR', and so for each wheel."
        )


def _options_of(reading: tuple[Clock, Choice, Choice, Choice], parts: Any) -> str:
    """Return some parts of a reading as options of the command."""
    texts = []
    for at in parts:
        part = reading[at]
        if isinstance(part, Clock):
            factor = {"s": "", "ms": "0.001 * ", "us": "1e-6 * ", "ns": "1e-9 * "}.get(part.unit, "")
            texts.append(f"t_s='{part.formula or factor + quote(part.column)}'")
        else:
            entries_shown = list(part.entries.items())[:2]
            texts += [f"{name}='{formula_of(name, entry)}'" for name, entry in entries_shown]
    return " ".join(texts)


def _refuse_without(where: Any, which: Any, words: Any, rover: Rover, first: Path) -> None:
    place = "where the rover was (x and y, or latitude and longitude)"
    needed = {"body_x": (where, place), f"wheel_rate_{rover.wheels[0].name}": (which, "the rate of each wheel")}
    for name, (tiers, what) in needed.items():
        if not any(tiers):
            raise DataError(
                f"{first}: no column is known as {what}: say --column {name}='FORMULA' of its columns, which are "
                f"{', '.join(quote(word.name) for word in words)}."
            )


def _against(files: Mapping[Path, Signals], picked: Chosen, options: Options) -> dict[Path, str]:
    """Return which files do not agree with the reading of all, or hold no drive."""
    _, place, heading, wheel = picked.parts
    ways = {path: float(np.mean(np.abs(blocks.places[place]))) for path, blocks in files.items()}
    why = {}
    for path, blocks in files.items():
        single = Options([options.places[place]], [options.headings[heading]], [options.wheels[wheel]])
        chosen_at = dict.fromkeys(("places", "climbs"), place) | dict.fromkeys(("headings", "turns"), heading)
        chosen_at |= dict.fromkeys(("rims", "spins", "rates", "fastest"), wheel)
        alone = blocks._replace(**{name: getattr(blocks, name)[[at]] for name, at in chosen_at.items()})
        if not ways[path] > SAME * max(ways.values()):
            why[path] = "nothing moves"
        elif len(files) > 1 and float(log_likelihood(alone, single)[0, 0, 0]) < 0.0:
            why[path] = "its place, heading and wheels do not go together as in the other files"
    return why


def _guesses(
    reading: tuple[Clock, Choice, Choice, Choice], picked: Chosen, recordings: Mapping[Path, Recording]
) -> Iterator[Guess]:
    """Yield what the reading makes of the columns; of a course, turned round where the wheels run backwards."""
    for part, choice in (("place", reading[1]), ("wheels", reading[3]), ("heading", reading[2])):
        for name, entry in choice.entries.items():
            guess = Guess(name, entry, choice.why, choice.sure, picked.share[part])
            if entry.get("formula") == COURSE:
                rates = reading[3].entries
                series = [mean_known([recording.values(item, name) for name, item in rates.items()])
                          for recording in recordings.values()]  # fmt: skip
                if BOTH_WAYS < share_back(np.concatenate(series)) < 1.0 - BOTH_WAYS:
                    text = f"heading(body_x, body_y, t_s, {' + '.join(rates)})"
                    why = "no heading is recorded, so the course stands for it, turned round where wheels run backwards"
                    guess = guess._replace(entry={"formula": text}, why=why)
            yield guess


def _from_an_origin(guesses: Mapping[str, Guess], recordings: Mapping[Path, Recording]) -> Iterator[Guess]:
    """Yield places on a map's grid as they lie from the first one, to 10 m: no ground is declared so far off."""
    values = _values(next(iter(recordings.values())), guesses.values())
    for name in ("body_x", "body_y"):
        entry, place = guesses[name].entry, values[name][np.isfinite(values[name])][0]
        if abs(place) > LARGEST:
            unit = to_si(1.0, entry["unit"], "m", name) if entry.get("unit") else 1.0
            offset = entry.get("offset", 0.0) - round(float(place), -1) / unit
            yield guesses[name]._replace(entry={**entry, "offset": offset})


def share_back(rates: np.ndarray) -> float:
    """Return the share of the rows at which a wheel turns backwards, of those at which it turns at all."""
    size = np.abs(np.nan_to_num(rates))
    turning = rates[size > TURNS_FROM * np.max(size, initial=0.0)]
    return float(np.mean(turning < 0.0)) if turning.size else 0.0


def _values(recording: Recording, guesses: Any) -> dict[str, np.ndarray]:
    values: dict[str, np.ndarray] = {}
    for guess in guesses:
        values[guess.target] = recording.values(guess.entry, guess.target, values)
    return values


def _sources(guess: Guess) -> tuple[str, ...]:
    """Return the columns that a guess is made of."""
    return (guess.entry["column"],) if "column" in guess.entry else names_in(guess.entry["formula"], guess.target)
