"""Where the rover may have been and headed: every pair of columns, frame, unit and way of counting an angle."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from rover_pin.base.formula import quote
from rover_pin.logs.importing import column_names as called
from rover_pin.logs.importing.column_names import Word
from rover_pin.logs.importing.recording import Choice, Entry, column

LENGTHS = {"m": 0.75, "mm": 0.2, "cm": 0.05}
"""How often a length without a unit is in these."""
FRAMES = {
    "z up": (0.9, "x", "y", "z"),
    "z down": (0.05, "x", "-y", "-z"),
    "y up": (0.04, "x", "-z", "y"),
    "y up, left-handed": (0.01, "x", "z", "y"),
}
"""How often axes of letters lie so, and what they are seen with x ahead, y to the left, z up."""
TURNS = {
    "{}": (0.8, "as it is"),
    "pi / 2 - {}": (0.1, "counted clockwise from the y axis"),
    "-{}": (0.04, "counted clockwise from the x axis"),
    "{} + pi / 2": (0.02, "a quarter of a turn behind the course"),
    "{} - pi / 2": (0.02, "a quarter of a turn ahead of the course"),
    "{} + pi": (0.02, "half a turn off the course"),
}
"""Ways to count a heading, and how often; where x is north and y east, clockwise is usual."""
COURSE = "course(body_x, body_y, t_s)"
"""What stands for a heading that is not recorded."""
ANGLES = {"rad": 0.5, "deg": 0.5}


def places(words: Sequence[Word], declared: Mapping[str, Entry]) -> list[list[Choice]]:
    """Return what body_x, body_y and body_z may be: first what may be measured, then what is odometry."""
    xs, ys, zs = ([word for word in words if _axis(word, axis)] for axis in (called.X, called.Y, called.Z))
    declared_axes = {name: entry for name, entry in declared.items() if name in ("body_x", "body_y", "body_z")}
    tiers: list[list[Choice]] = [list(_geographic(words)), []]
    for x, y in itertools.product(xs, ys):
        stem = set(x.tokens) - called.X
        if set(y.tokens) - called.Y == stem:
            heights = [z for z in zs if set(z.tokens) - called.Z in (stem, stem - {"utm"})]
            heights += [z for z in zs if z.has(called.UP)]
            into = tiers[x.has(called.ODOMETRY) and not x.has(called.MEASURED)]
            into += _framed_choices(x, y, heights[0] if heights else None)
    present = {word.name: {"column": word.name} for word in words if word.name in ("body_x", "body_y")}
    if declared_axes and not any(tiers) and {"body_x", "body_y"} <= {**present, **declared_axes}.keys():
        tiers[0] = [Choice(present, 0.0, "as given", True)]
    return [[choice._replace(entries={**choice.entries, **declared_axes}) for choice in tier] for tier in tiers]


def _axis(word: Word, letters: set[str]) -> bool:
    elsewhere = word.has(called.NO_PLACE | called.COMMAND)
    return word.has(letters) and not elsewhere and word.unit in ("", "m", "mm", "cm", "km", "in")


def _framed_choices(x: Word, y: Word, z: Word | None) -> Iterator[Choice]:
    exact = x.name == "body_x"
    frames = FRAMES if x.has(called.AXES) and not exact else {"z up": FRAMES["z up"]}
    units = {x.unit: 1.0} if x.unit or exact else LENGTHS
    by_letter = {"x": x, "y": y, "z": z}
    for (frame, (share, *axes)), (unit, often) in itertools.product(frames.items(), units.items()):
        if z is None and "z" in "".join(axes[:2]):
            continue
        entries = {}
        for name, axis in zip("xyz", axes, strict=True):
            word = by_letter[axis[-1]]
            if word is not None:
                down = axis[0] == "-" and not (word.has(called.UP) and name == "z")
                axis_unit = "m" if word.has(called.UP) and not exact else unit
                entries[f"body_{name}"] = column(word, axis_unit, **({"scale": -1.0} if down else {}))
        more = "" if x.unit or exact else f"; taken as {unit}"
        more += "" if frame == "z up" else f"; {frame}, as wheels and heading have it"
        more += "; its name says odometry, which knows no slip" if x.has(called.ODOMETRY) else ""
        weight = math.log(share * often) + x.has(called.MEASURED)
        yield Choice(entries, weight, f"its name{' and unit' * bool(x.unit)}{more}", not more, frame == "z down")


def _geographic(words: Sequence[Word]) -> Iterator[Choice]:
    lat, lon = ([word for word in words if word.has(names)] for names in (called.LATITUDE, called.LONGITUDE))
    if not lat or not lon:
        return
    pair = f"({quote(lat[0].name)}, {quote(lon[0].name)})"
    entries: dict[str, Entry] = {"body_x": {"formula": f"east{pair}"}, "body_y": {"formula": f"north{pair}"}}
    up = [word for word in words if word.has(called.UP) and not word.has(called.NO_PLACE)]
    entries |= {"body_z": column(up[0], "m")} if up else {}
    yield Choice(entries, 0.5, "metres from the first place, from latitude and longitude [deg]")


def headings(words: Sequence[Word], declared: Mapping[str, Entry]) -> list[Choice]:
    """Return what body_yaw may be: an angle, a quaternion, each counted in every way, or the course."""
    if "body_yaw" in declared:
        return [Choice({"body_yaw": declared["body_yaw"]}, 0.0, "as given", True)]
    angles = list(_angles(words))
    choices = []
    for angle, weight, why, sure in angles:
        for turn, (share, way) in TURNS.items():
            formula, more = (angle, "") if turn == "{}" else (turn.format(angle), f"; it follows the course if {way}")
            entry, log_prior = {"body_yaw": {"formula": formula}}, weight + math.log(share)
            choices.append(Choice(entry, log_prior, why + more, sure and not more, turn[0] == "-"))
    why = "no heading is recorded, so the course stands for it: wrong by the angle of any crabbing"
    choices.append(Choice({"body_yaw": {"formula": COURSE}}, math.log(0.002) if angles else 0.0, why))
    return choices


def _angles(words: Sequence[Word]) -> Iterator[tuple[str, float, str, bool]]:
    """Yield formulas of the yaw as recorded [rad], the logarithm of a prior, why, and whether that is certain."""
    for word in words:
        if word.name == "body_yaw":
            yield f"unwrapped({quote(word.name)})", 3.0, "its name", True
        elif word.has(called.YAW) and not word.has(called.NO_ANGLE | {"q", "quat"}) and word.unit in ("", "rad", "deg"):
            if word.tokens[-1] in ("x", "y", "z", "w") or word.tokens[-1].isdigit():
                continue
            least = -0.7 * word.has(called.ODOMETRY) - 0.2 * word.has(called.COMPASS)
            for unit, share in ({word.unit: 1.0} if word.unit else ANGLES).items():
                inner = quote(word.name)
                text = f"unwrapped(radians({inner}))" if unit == "deg" else f"unwrapped({inner})"
                more = "" if word.unit else f"; taken as {unit}"
                yield text, least + math.log(share), f"its name{more}", bool(word.unit)
    for four, share, why in quaternions(words):
        yield f"yaw({', '.join(map(quote, four))})", math.log(share), f"a quaternion, {why}, world z-y-x", share == 1.0


def quaternions(words: Sequence[Word]) -> Iterator[tuple[tuple[str, ...], float, str]]:
    """Yield the columns x, y, z, w of a quaternion, how likely they are in that order, and what that order is."""
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
