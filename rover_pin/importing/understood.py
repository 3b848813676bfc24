"""A recording understood: every guess in turn, what a drive log still lacks, and what that leaves unanswered."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.errors import DataError
from rover_pin.formula import change, names_in, quoted
from rover_pin.importing.attitude import BY_COURSE, backwards, headings, tilts
from rover_pin.importing.guess import Guess, Recording
from rover_pin.importing.pose import places
from rover_pin.importing.splitting import Drive
from rover_pin.importing.wheels import joint_guesses, wheel_guesses

NEEDED = {
    "body_x": "where the rover was (x and y, or latitude and longitude)",
    "body_y": "where the rover was (x and y, or latitude and longitude)",
    "body_yaw": "where it headed (yaw, a quaternion, or a course)",
}
LACKS = {
    "duty_": "no duties: the wheels are held to their measured rates, and what motors and gears do does not show",
    "current_": "no motor currents: the wheels' torques are not told, nor the soil's k apart from its phi",
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
        return {each.target: each.entry for each in self.guesses}


def understood(seen: Recording, told: Sequence[Guess], where: str) -> Understood:
    """Return what the columns of a recording are; what the user has `told` comes before any guess.

    Raises
    ------
    DataError
        No place, or no rates of all wheels, can be found.
    """
    found = {each.target: each for each in told}
    values: dict[str, np.ndarray] = {}
    _take(found, values, seen, found.values())
    _take(found, values, seen, places(seen))
    x, y = values.get("body_x"), values.get("body_y")
    _take(found, values, seen, headings(seen, x, y))
    _refuse_without(values, NEEDED, seen, where)
    _take(found, values, seen, tilts(seen))
    _take(found, values, seen, wheel_guesses(seen, along(seen.t, values)))
    rates = {f"wheel_rate_{mount.name}": f"the rate of wheel {mount.name}" for mount in seen.rover.wheels}
    _refuse_without(values, rates, seen, where)
    ahead = backwards({name: values[name] for name in rates})
    if ahead is not None and found["body_yaw"].entry.get("formula") == BY_COURSE:
        del found["body_yaw"], values["body_yaw"]
        _take(found, values, seen, [ahead])
    _take(found, values, seen, joint_guesses(seen))
    guesses = tuple(each for each in found.values() if each.target in values)
    lacks = tuple(said for part, said in LACKS.items() if not any(part in name for name in values))
    used = {name for each in guesses for name in _sources(each, where)}
    unused = tuple(each.name for each in seen.words if each.name not in used)
    return Understood(guesses, values, lacks, unused)


def _sources(each: Guess, where: str) -> tuple[str, ...]:
    """Return the columns that a guess is made of."""
    return (each.entry["column"],) if "column" in each.entry else names_in(each.entry["formula"], where)


def _take(found: dict[str, Guess], values: dict[str, np.ndarray], seen: Recording, further: Any) -> None:
    for each in list(further):
        if each.target in values or (each.target in found and found[each.target] is not each):
            continue
        found[each.target] = each
        values[each.target] = seen.values(each.entry, each.target, values)


def _refuse_without(values: Mapping[str, np.ndarray], needed: Mapping[str, str], seen: Recording, where: str) -> None:
    for name, what in needed.items():
        if name not in values or not np.isfinite(values[name]).any():
            raise DataError(
                f"{where}: no column is known as {what}: say --column {name}='FORMULA' of its columns, which are "
                f"{', '.join(map(quoted, (each.name for each in seen.words)))}."
            )


def along(t: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the speed along the heading [m/s], over the second around each row."""
    x, y, yaw = (values[f"body_{name}"] for name in ("x", "y", "yaw"))
    known = np.isfinite(x + y)
    dx, dy, lasts = (change(each, t, known) for each in (x, y, t))
    return np.asarray((np.cos(yaw) * dx + np.sin(yaw) * dy) / np.maximum(lasts, 1e-6))


def drive_of(seen: Recording, found: Understood) -> Drive:
    """Return what the recording shows of the drive."""
    values, t = found.values, seen.t
    rates = np.array([values[f"wheel_rate_{mount.name}"] for mount in seen.rover.wheels])
    rim = np.nanmean(rates * seen.rover.radii[:, None], axis=0)
    pitch = values.get("body_pitch", np.zeros(len(t)))
    turn = np.gradient(values["body_yaw"], t)
    return Drive(t, np.nanmean(np.abs(rates), axis=0), along(t, values), rim, pitch, turn)


def lines(found: Understood) -> Iterator[str]:
    """Yield one line a guess, for a reader."""
    for each in found.guesses:
        made = each.entry.get("column") or each.entry.get("formula")
        unit = f" [{each.entry['unit']}]" if "unit" in each.entry else ""
        yield f"{each.target} = {made}{unit}" + ("" if each.sure else f"  GUESSED: {each.why}")
