"""List the columns that may hold the position and the heading of a recording, with the frame, the unit and the sense of
angles.

Each possible interpretation is a `Choice` with its prior probability. `joint_choice` compares the choices with the
motion of the wheels.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from rover_pin.base.files import column_names as called
from rover_pin.base.files.column_names import Word
from rover_pin.base.formula import quote
from rover_pin.base.units import factor_to
from rover_pin.importing.recording import Choice, Entry, column

LENGTHS = {"m": 0.75, "mm": 0.2, "cm": 0.05}
"""Unit of length -> prior probability that a coordinate without a stated unit has this unit."""
FRAMES = {
    "z up": (0.9, "x", "y", "z"),
    "z down": (0.05, "x", "-y", "-z"),
    "y up": (0.04, "x", "-z", "y"),
    "y up, left-handed": (0.01, "x", "z", "y"),
}
"""Name of a frame -> its prior probability, and the recorded axes that point ahead (x), left (y) and up (z). These
frames are possible for coordinates whose columns are named by letters."""
TURNS = {
    "{}": (0.8, "as it is"),
    "pi / 2 - {}": (0.1, "counted clockwise from the y axis"),
    "-{}": (0.04, "counted clockwise from the x axis"),
    "{} + pi / 2": (0.02, "a quarter of a turn behind the course"),
    "{} - pi / 2": (0.02, "a quarter of a turn ahead of the course"),
    "{} + pi": (0.02, "half a turn off the course"),
}
"""Formula -> its prior probability, and its meaning in words. Each formula converts a recorded angle to the heading,
for one possible convention of the recording. In frames with x north and y east, for example, the heading is counted
clockwise."""
COURSE = "course(body_x, body_y, t_s)"
"""Formula of the course (direction of travel). The course replaces the heading if no heading is recorded."""
ANGLES = {"rad": 0.5, "deg": 0.5}
"""Unit of angle -> prior probability that an angle without a stated unit has this unit."""


def places(words: Sequence[Word], declared: Mapping[str, Entry]) -> list[list[Choice]]:
    """Return the possible sources of body_x, body_y and body_z in two lists: measured positions, then wheel odometry.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recording. Each name is split into its words and its unit.
    declared : mapping
        Channel -> entry of [columns] that the user gave. These entries replace the sources of these channels in every
        choice.

    Returns
    -------
    list of list of Choice
        Measured positions, and wheel odometry. The second list is considered only if no choice of the first list fits
        the wheels.
    """
    xs, ys, zs = ([word for word in words if _axis(word, axis)] for axis in (called.X, called.Y, called.Z))
    declared_axes = {name: entry for name, entry in declared.items() if name in ("body_x", "body_y", "body_z")}
    tiers: list[list[Choice]] = [[], []]
    # If latitude and longitude are recorded, the position is given in metres east and north of the first position.
    # Degrees are converted here, because a drive log has its positions in metres.
    lat, lon = ([word for word in words if word.has(names)] for names in (called.LATITUDE, called.LONGITUDE))
    if lat and lon:
        pair = f"({quote(lat[0].name)}, {quote(lon[0].name)})"
        entries: dict[str, Entry] = {"body_x": {"formula": f"east{pair}"}, "body_y": {"formula": f"north{pair}"}}
        up = [word for word in words if word.has(called.UP) and not word.has(called.NO_PLACE)]
        entries |= {"body_z": column(up[0], "m")} if up else {}
        why = "metres from the first position, computed from latitude and longitude [deg]"
        tiers[0].append(Choice(entries, 0.5, why))
    for x, y in itertools.product(xs, ys):
        # x and y belong together if their names are equal apart from the letter. A height may lack the word "utm", or
        # be named altitude.
        stem = set(x.tokens) - called.X
        if set(y.tokens) - called.Y == stem:
            heights = [z for z in zs if set(z.tokens) - called.Z in (stem, stem - {"utm"})]
            heights += [z for z in zs if z.has(called.UP)]
            into = tiers[x.has(called.ODOMETRY) and not x.has(called.MEASURED)]
            into += _framed_choices(x, y, heights[0] if heights else None)
    # If the user gave some of the coordinates and the file names the rest like a drive log, no guess is needed.
    present = {word.name: {"column": word.name} for word in words if word.name in ("body_x", "body_y")}
    if declared_axes and not any(tiers) and {"body_x", "body_y"} <= {**present, **declared_axes}.keys():
        tiers[0] = [Choice(present, 0.0, "given by the user", True)]
    return [[choice._replace(entries={**choice.entries, **declared_axes}) for choice in tier] for tier in tiers]


def _axis(word: Word, letters: set[str]) -> bool:
    """Return whether a column may be a coordinate named by one of the letters: a length, and neither a velocity nor a
    command.
    """
    elsewhere = word.has(called.NO_PLACE | called.COMMAND)
    return word.has(letters) and not elsewhere and (not word.unit or math.isfinite(factor_to(word.unit, "m")))


def _framed_choices(x: Word, y: Word, z: Word | None) -> Iterator[Choice]:
    """Yield the possible interpretations of the columns x, y and (if present) z as a position: one for each frame and
    unit.
    """
    exact = x.name == "body_x"
    frames = FRAMES if x.has(called.AXES) and not exact else {"z up": FRAMES["z up"]}
    units = {x.unit: 1.0} if x.unit or exact else LENGTHS
    by_letter = {"x": x, "y": y, "z": z}
    for (frame, (share, *axes)), (unit, often) in itertools.product(frames.items(), units.items()):
        # Frames with y up need the z column for their horizontal axes.
        if z is None and "z" in "".join(axes[:2]):
            continue
        entries = {}
        for name, axis in zip("xyz", axes, strict=True):
            word = by_letter[axis[-1]]
            if word is not None:
                # An altitude counts upwards in every frame, so its sign is never turned.
                down = axis[0] == "-" and not (word.has(called.UP) and name == "z")
                axis_unit = "m" if word.has(called.UP) and not exact else unit
                entries[f"body_{name}"] = column(word, axis_unit, **({"scale": -1.0} if down else {}))
        more = "" if x.unit or exact else f"; taken as {unit}"
        more += "" if frame == "z up" else f"; {frame}, because this agrees with wheels and heading"
        more += "; by its name it is odometry, which does not see slip" if x.has(called.ODOMETRY) else ""
        weight = math.log(share * often) + x.has(called.MEASURED)
        yield Choice(entries, weight, f"its name{' and unit' * bool(x.unit)}{more}", not more, frame == "z down")


def headings(words: Sequence[Word], declared: Mapping[str, Entry]) -> list[Choice]:
    """Return the possible sources of the heading body_yaw: recorded angles, quaternions, and the course.

    An angle is one possible source for each possible convention (TURNS). The course is the direction of travel.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recording.
    declared : mapping
        Channel -> entry of [columns] that the user gave. An entry of body_yaw is the only source that is returned.
    """
    if "body_yaw" in declared:
        return [Choice({"body_yaw": declared["body_yaw"]}, 0.0, "given by the user", True)]
    angles = list(_angles(words))
    choices = []
    for angle, weight, why, sure in angles:
        for turn, (share, way) in TURNS.items():
            formula, more = (angle, "") if turn == "{}" else (turn.format(angle), f"; agrees with the course if {way}")
            entry, log_prior = {"body_yaw": {"formula": formula}}, weight + math.log(share)
            choices.append(Choice(entry, log_prior, why + more, sure and not more, turn[0] == "-"))
    # The course is no heading if the rover moves sideways, so that it is improbable if an angle is recorded.
    why = "no heading is recorded, so the direction of travel replaces it, which is wrong if the rover moves sideways"
    choices.append(Choice({"body_yaw": {"formula": COURSE}}, math.log(0.002) if angles else 0.0, why))
    return choices


def _angles(words: Sequence[Word]) -> Iterator[tuple[str, float, str, bool]]:
    """Yield the recorded angles that may be the heading: formula of the angle [rad], log prior, reason, and a flag.

    The flag states whether the file itself states the unit of the angle.
    """
    for word in words:
        if word.name == "body_yaw":
            yield f"unwrapped({quote(word.name)})", 3.0, "its name", True
        elif word.has(called.YAW) and not word.has(called.NO_ANGLE | {"q", "quat"}) and is_angle(word.unit):
            # A component of a quaternion or of a vector is no angle.
            if word.tokens[-1] in ("x", "y", "z", "w") or word.tokens[-1].isdigit():
                continue
            least = -0.7 * word.has(called.ODOMETRY) - 0.2 * word.has(called.COMPASS)
            for unit, share in ({word.unit: 1.0} if word.unit else ANGLES).items():
                inner = quote(word.name)
                inner = {"rad": inner, "deg": f"radians({inner})"}.get(unit, f"{factor_to(unit, 'rad'):.9g} * {inner}")
                text = f"unwrapped({inner})"
                more = "" if word.unit else f"; taken as {unit}"
                yield text, least + math.log(share), f"its name{more}", bool(word.unit)
    for four, share, why in quaternions(words):
        yield f"yaw({', '.join(map(quote, four))})", math.log(share), f"a quaternion, {why}, world z-y-x", share == 1.0


def is_angle(unit: str) -> bool:
    """Return whether a unit is a unit of angle, or no unit is stated."""
    return not unit or math.isfinite(factor_to(unit, "rad"))


def quaternions(words: Sequence[Word]) -> Iterator[tuple[tuple[str, ...], float, str]]:
    """Yield the quaternions among the columns: four columns in the order x, y, z, w, the prior of this order, and its
    reason.

    Components named by letters have one possible order. Numbered components have two: the real part w may be the first
    or the last.
    """
    # The four components have the same name apart from a last letter or number.
    by_stem: dict[tuple[str, ...], dict[str, str]] = {}
    for word in words:
        token = word.tokens[-1] if word.tokens else ""
        last = token.removeprefix("q")
        named = word.has({"q", "quat", "quaternion", "orientation", "rot", "rotation"}) or token.startswith("q")
        if named and (last in "xyzw" or last in "01234") and last:
            by_stem.setdefault(word.tokens[:-1], {})[last] = word.name
    for names in sorted(by_stem.values(), key=len, reverse=True):
        if set("xyzw") <= names.keys():
            yield tuple(names[letter] for letter in "xyzw"), 1.0, "by its letters"
        elif len(names) == 4:
            first, *others = (names[number] for number in sorted(names))
            yield (*others, first), 0.6, "the real part first"
            yield (first, *others), 0.4, "the real part last"
