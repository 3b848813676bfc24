"""A recording understood: every guess in turn, what a drive log still lacks, and what that leaves unanswered."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.formula import change, names_in, quoted
from rover_pin.logs.importing.attitude import BY_COURSE, backwards, headings, tilts
from rover_pin.logs.importing.guess_record import Guess, Recording
from rover_pin.logs.importing.pose import places
from rover_pin.logs.importing.splitting import Drive
from rover_pin.logs.importing.wheels import joint_guesses, wheel_guesses

NEEDED = {
    "body_x": "where the rover was (x and y, or latitude and longitude)",
    "body_y": "where the rover was (x and y, or latitude and longitude)",
    "body_yaw": "where it headed (yaw, a quaternion, or a course)",
}
LACKS = {
    "duty_": "no duties: the wheels are held to their measured rates, and what motors and gears do does not show",
    "current_": "no motor currents: the wheels' torques are unknown, and the soil's k apart from its phi",
    "body_pitch": "no pitch: slopes come of the height, or are taken as flat, and then look like slip",
    "body_z": "no height: slopes come of the pitch alone",
    "body_roll": "no roll: loads of left and right wheels are taken as equal",
}
"""What is missed where no column has this in its name (a raw current is one too), and what cannot be answered then."""


class Understood(NamedTuple):
    """The columns that a recording's drive log is made of, and what it shows of the drive."""

    guesses: tuple[Guess, ...]
    values: Mapping[str, np.ndarray]
    "of each of them, in SI"
    lacks: tuple[str, ...]
    unused: tuple[str, ...]

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """[columns] of the drive log."""
        return {guess.target: guess.entry for guess in self.guesses}


def understood(recording: Recording, declared: Sequence[Guess], where: str) -> Understood:
    """Return what the columns of a recording are; what the user has `declared` comes before any guess.

    Raises
    ------
    DataError
        No place, or no rates of all wheels, can be found.
    """
    accepted = {guess.target: guess for guess in declared}
    values: dict[str, np.ndarray] = {}
    _take(accepted, values, recording, accepted.values())
    _take(accepted, values, recording, places(recording))
    x, y = values.get("body_x"), values.get("body_y")
    _take(accepted, values, recording, headings(recording, x, y))
    _refuse_without(values, NEEDED, recording, where)
    _take(accepted, values, recording, tilts(recording))
    _take(accepted, values, recording, wheel_guesses(recording, along(recording.t, values)))
    rates = {f"wheel_rate_{mount.name}": f"the rate of wheel {mount.name}" for mount in recording.rover.wheels}
    _refuse_without(values, rates, recording, where)
    ahead = backwards({name: values[name] for name in rates})
    if ahead is not None and accepted["body_yaw"].entry.get("formula") == BY_COURSE:
        del accepted["body_yaw"], values["body_yaw"]
        _take(accepted, values, recording, [ahead])
    _take(accepted, values, recording, joint_guesses(recording))
    guesses = tuple(guess for guess in accepted.values() if guess.target in values)
    lacks = tuple(lack for part, lack in LACKS.items() if not any(part in name for name in values))
    used = {name for guess in guesses for name in _sources(guess, where)}
    unused = tuple(word.name for word in recording.words if word.name not in used)
    return Understood(guesses, values, lacks, unused)


def _sources(guess: Guess, where: str) -> tuple[str, ...]:
    """Return the columns that a guess is made of."""
    return (guess.entry["column"],) if "column" in guess.entry else names_in(guess.entry["formula"], where)


def _take(accepted: dict[str, Guess], values: dict[str, np.ndarray], recording: Recording, candidates: Any) -> None:
    for guess in list(candidates):
        if guess.target in values or (guess.target in accepted and accepted[guess.target] is not guess):
            continue
        accepted[guess.target] = guess
        values[guess.target] = recording.values(guess.entry, guess.target, values)


def _refuse_without(
    values: Mapping[str, np.ndarray], needed: Mapping[str, str], recording: Recording, where: str
) -> None:
    for name, what in needed.items():
        if name not in values or not np.isfinite(values[name]).any():
            raise DataError(
                f"{where}: no column is known as {what}: say --column {name}='FORMULA' of its columns, which are "
                f"{', '.join(map(quoted, (word.name for word in recording.words)))}."
            )


def along(t: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the speed along the heading [m/s], over the second around each row."""
    x, y, yaw = (values[f"body_{name}"] for name in ("x", "y", "yaw"))
    finite = np.isfinite(x + y)
    dx, dy, lasts = (change(series, t, finite) for series in (x, y, t))
    return np.asarray((np.cos(yaw) * dx + np.sin(yaw) * dy) / np.maximum(lasts, 1e-6))


def drive_of(recording: Recording, mapping: Understood) -> Drive:
    """Return what the recording shows of the drive."""
    values, t = mapping.values, recording.t
    rates = np.array([values[f"wheel_rate_{mount.name}"] for mount in recording.rover.wheels])
    rim = np.nanmean(rates * recording.rover.radii[:, None], axis=0)
    pitch = values.get("body_pitch", np.zeros(len(t)))
    turn = np.gradient(values["body_yaw"], t)
    return Drive(t, np.nanmean(np.abs(rates), axis=0), along(t, values), rim, pitch, turn)


def lines(mapping: Understood) -> Iterator[str]:
    """Yield one line a guess, for a reader."""
    for guess in mapping.guesses:
        source = guess.entry.get("column") or guess.entry.get("formula")
        unit = f" [{guess.entry['unit']}]" if "unit" in guess.entry else ""
        yield f"{guess.target} = {source}{unit}" + ("" if guess.sure else f"  GUESSED: {guess.why}")
