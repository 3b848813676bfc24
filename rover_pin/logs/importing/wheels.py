"""What the wheels may have done: families of columns that are called alike but for the wheel."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from rover_pin.base.formula import quote
from rover_pin.base.units import UNITS
from rover_pin.logs.importing import column_names as called
from rover_pin.logs.importing.column_names import Word, corner
from rover_pin.logs.importing.recording import Choice, Entry, column
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places

Family = dict[str, Word]
"""Column of each wheel."""
RATES = {"rad/s": 0.45, "rpm": 0.25, "deg/s": 0.05, "rev/s": 0.02}
SPEEDS = {"m/s": 0.12, "mm/s": 0.03}
"""How often rates of wheels without a unit are in these; the rest is behind a gear, or in units of their own."""
STATED, UNKNOWN = 0.97, 0.2
"""How often a stated unit is that of the wheel itself, and one that is not stated is unknown."""
SIGNS = {(1, 1): 0.9, (1, -1): 0.05, (-1, 1): 0.03, (-1, -1): 0.02}
"""How often left and right wheels count forward (1) or are mounted the other way."""


def families(words: Sequence[Word], rover: Rover) -> Iterator[tuple[frozenset[str], str, list[tuple[Family, float]]]]:
    """Yield words and unit that columns share, and which wheel each may be of, with how likely that is.

    Wheels are known by the joint's name, by the wheel's, by a corner, by a side, or by numbers in some order.
    """
    groups: dict[tuple[frozenset[str], str], dict[tuple[str, ...] | str, Word]] = {}
    for word in words:
        wheels, other_words = _owners(word, rover)
        if wheels:
            groups.setdefault((frozenset(other_words), word.unit), {}).setdefault(wheels, word)
    for (stem, unit), group in groups.items():
        mapped = {name: word for wheels, word in group.items() if not isinstance(wheels, str) for name in wheels}
        numbers = {int(number): word for number, word in group.items() if isinstance(number, str)}
        if len(mapped) == len(rover.wheels):
            yield stem, unit, [(mapped, 1.0)]
        elif len(numbers) == len(rover.wheels):
            ordered = [numbers[at] for at in sorted(numbers)]
            yield stem, unit, [(dict(zip(order, ordered, strict=True)), share) for order, share in _orders(rover)]


def _owners(word: Word, rover: Rover) -> tuple[tuple[str, ...] | str, tuple[str, ...]]:
    """Return the wheels that a column is of, or its number, and the other words of its name."""
    present = [(mount.name, rover.model.names[mount.joint]) for mount in rover.wheels]
    for wheel, name in (*present, *((wheel, wheel) for wheel, _ in present)):
        tokens = called.word(name).tokens
        for at in range(len(word.tokens) - len(tokens) + 1):
            if word.tokens[at : at + len(tokens)] == tokens:
                return (wheel,), word.tokens[:at] + word.tokens[at + len(tokens) :]
    axle, side, other_words = corner(word.tokens)
    mounts = [mount for mount in rover.wheels if side in ("", mount.side)]
    if axle.isdigit() and not side:
        return axle, other_words
    last = max(mount.axle for mount in rover.wheels)
    axles = {"front": [0], "rear": [last], "mid": list(range(1, last)), "": list(range(last + 1))}
    on = axles.get(axle) or ([int(axle) - 1] if axle.isdigit() else [])
    return tuple(mount.name for mount in mounts if side and mount.axle in on), other_words


def _orders(rover: Rover) -> Iterator[tuple[list[str], float]]:
    """Yield the orders in which wheels are numbered, and how often: by axles, by sides, around, by quadrants."""
    left, right = ([mount.name for mount in rover.wheels if mount.side == side] for side in "lr")
    yield [name for pair in zip(left, right, strict=False) for name in pair], 0.6
    yield left + right, 0.17
    yield left[:1] + right + left[:0:-1], 0.13
    yield right[:1] + left + right[:0:-1], 0.1


def wheel_choices(words: Sequence[Word], rover: Rover, declared: Mapping[str, Entry]) -> list[list[Choice]]:
    """Return what the wheels' rates may be: measured ones, by side, by speed and turn, and what was commanded."""
    names = [f"wheel_rate_{mount.name}" for mount in rover.wheels]
    declared_rates = {name: declared[name] for name in names if name in declared}
    if len(declared_rates) == len(names):
        return [[Choice(declared_rates, 0.0, "as given", True)]]
    measured: list[Choice] = []
    sides: list[Choice] = []
    commanded: list[Choice] = []
    for stem, unit, maps in families(words, rover):
        count = bool(stem & called.COUNT) and not stem & (called.RATE - {"v", "w"}) and unit in ("", "rad", "deg")
        rate = count or stem & called.RATE or unit in (*RATES, *SPEEDS)
        if not rate or stem & (called.NO_WHEEL | called.CURRENT | called.DUTY | called.STEER - {"corner"}):
            continue
        of_sides = len({word.name for word in maps[0][0].values()}) < len(names)
        into = commanded if stem & called.COMMAND else sides if of_sides else measured
        for family, share in maps:
            into += _rates(family, unit, math.log(share), count, rover)
    present = {name: {"column": name} for name in names if name in {word.name for word in words}}
    if declared_rates and not measured + sides and len({**present, **declared_rates}) == len(names):
        measured = [Choice(present, 0.0, "as given", True)]
    tiers = [measured, sides, list(_of_twist(words, rover)), commanded]
    return [[choice._replace(entries={**choice.entries, **declared_rates}) for choice in tier] for tier in tiers]


def _rates(family: Family, unit: str, weight: float, count: bool, rover: Rover) -> Iterator[Choice]:
    """Yield a family's rates in every unit and sense, and behind a gear of unknown ratio."""
    exact = all(word.name == f"wheel_rate_{wheel}" for wheel, word in family.items())
    unit_shares = {unit: STATED} if unit else {"rad/s": STATED} if exact else RATES | SPEEDS
    if count:
        unit_shares = {unit or "rad": STATED if unit else 0.3}
    units = [(name, math.log(share), False) for name, share in unit_shares.items()]
    units.append((next(iter(unit_shares)), math.log(1.0 - STATED if unit or exact else UNKNOWN), True))
    for (name, often, free), ((left, right), mounted) in itertools.product(units, SIGNS.items()):
        entries, turned = {}, (left, right) != (1, 1)
        for mount in rover.wheels:
            sense = left if mount.side == "l" else right
            entries[f"wheel_rate_{mount.name}"] = _entry(family[mount.name], name, float(mount.wheel.r), sense, count)
        why = "its name" + ("" if unit or exact else f"; taken as {name} by the speed of the rover")
        why += "; turned round, as it runs against the travel" if turned else ""
        log_prior = weight + often + math.log(mounted)
        yield Choice(entries, log_prior, why, (bool(unit) or exact) and not turned, free=free)


def _entry(word: Word, unit: str, radius: float, sense: int, count: bool) -> Entry:
    sign = "-" if sense < 0 else ""
    if count:
        inner = f"radians({quote(word.name)})" if unit == "deg" else quote(word.name)
        return {"formula": f"{sign}rate({inner}, t_s)"}
    if unit not in RATES:
        factor = UNITS[unit][1]
        return {"formula": f"{sign}{'' if factor == 1.0 else f'{factor:.6g} * '}{quote(word.name)} / {radius:.6g}"}
    exact = word.name.startswith("wheel_rate_") and not word.unit
    return column(word, "" if exact and unit == "rad/s" else unit, **({"scale": -1.0} if sense < 0 else {}))


def _of_twist(words: Sequence[Word], rover: Rover) -> Iterator[Choice]:
    """Yield side rates of a speed and a turn that are commanded or reported: v -+ omega b / 2."""
    moves = [word for word in words if word.has(called.ODOMETRY | called.COMMAND | {"twist"})]
    ahead = [word for word in moves if word.has(called.AHEAD) and word.tokens[-1] not in ("y", "z")]
    turns = [word for word in moves if word.has(called.TURN) or (word.has({"angular"}) and word.tokens[-1] == "z")]
    places = wheel_places(rover)
    for v, omega in itertools.product(ahead, turns):
        paired = all(v.has(names) == omega.has(names) for names in (called.COMMAND, called.ODOMETRY))
        if not paired or v.unit not in ("", "m/s") or omega.unit not in ("", "rad/s"):
            continue
        entries = {}
        for mount in rover.wheels:
            half, sign = abs(float(places[mount.name][1])), "-" if mount.side == "l" else "+"
            formula = f"({quote(v.name)} {sign} {half:.6g} * {quote(omega.name)}) / {float(mount.wheel.r):.6g}"
            entries[f"wheel_rate_{mount.name}"] = {"formula": formula}
        why = "the wheels' own rates are not recorded; v -+ omega b / 2 of a speed and a turn, as a driver has it"
        yield Choice(entries, 0.0 if v.has(called.ODOMETRY) else -1.0, why)
