"""List the columns that may hold the wheel rates of a recording: groups of columns whose names differ only by the
wheel.

Each possible interpretation is a `Choice` with its prior probability. It states the unit, the sign of each side, the
order of numbered wheels, and whether the columns hold encoder counts or rates. `joint_choice` compares the choices with
the motion of the rover.
"""

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence

from rover_pin.base.files import column_names as called
from rover_pin.base.files.column_names import Word, corner
from rover_pin.base.formula import quote
from rover_pin.base.units import factor_to
from rover_pin.importing.recording import Choice, Entry, column
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places

Family = dict[str, Word]
"""Wheel name -> the column of this wheel. The names of all columns in a family differ only by the wheel."""
RATES = {"rad/s": 0.45, "rpm": 0.25, "deg/s": 0.05, "rev/s": 0.02}
"""Unit of an angular rate -> prior probability that wheel columns without a stated unit have this unit."""
SPEEDS = {"m/s": 0.12, "mm/s": 0.03}
"""Unit of a rim speed -> prior probability that wheel columns without a stated unit have this unit. The probability
that remains next to RATES and SPEEDS belongs to encoder counts or to rates before a gear."""
STATED_SHARE, UNKNOWN_SHARE = 0.97, 0.2
"""Prior probability that a stated unit applies to the wheel itself and not to a motor before a gear; and prior
probability that columns without a unit hold counts or rates before a gear."""
BARE_SHARE = 0.3
"""Prior probability that columns whose names consist of the wheel only (such as `fl`, `fr`) hold wheel rates."""
SIGNS = {(1, 1): 0.9, (1, -1): 0.05, (-1, 1): 0.03, (-1, -1): 0.02}
"""Signs of the left and the right wheels -> prior probability. A sign is 1 if the rate is positive forwards, and -1 if
the encoder is mounted in reverse."""


def families(words: Sequence[Word], rover: Rover) -> Iterator[tuple[frozenset[str], str, list[tuple[Family, float]]]]:
    """Yield the groups of columns whose names differ only by the wheel, such as `rate_fl [rad/s]`, `rate_fr [rad/s]`,
    ...

    Such a group is called a family. Each family is yielded as the words that its names share, its unit, and a list of
    possible assignments wheel -> column with their prior probabilities. The wheel of a column is recognised by the name
    of its joint, its own name, a corner ("front left"), a side, or a number. Numbers allow several orders of the
    wheels.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recording.
    rover : Rover
        The rover with its wheels. A family may lack some wheels if the others determine the rover's speed and turn
        rate.
    """
    groups: dict[tuple[frozenset[str], str], dict[tuple[str, ...] | str, Word]] = {}
    unnumbered: dict[tuple[frozenset[str], str], Word] = {}
    for word in words:
        wheels, other_words = _owners(word, rover)
        if not wheels:
            unnumbered.setdefault((frozenset(other_words), word.unit), word)
        else:
            groups.setdefault((frozenset(other_words), word.unit), {}).setdefault(wheels, word)
    # Programs that number repeated names often leave the first one without a number, so it is added to its group.
    for (stem, unit), group in groups.items():
        counted = sorted(int(wheels) for wheels in group if isinstance(wheels, str))
        if counted and (stem, unit) in unnumbered and len(group) == len(counted) == len(rover.wheels) - 1:
            group.setdefault(str(counted[0] - 1), unnumbered[stem, unit])
    # Columns without a unit join the family of the same name with a unit, if this family lacks just these wheels.
    for (stem, unit), group in [*groups.items()]:
        others = [key for key in groups if key[0] == stem and key[1] and not groups[key].keys() & group.keys()]
        if not unit and len(others) == 1 and len(group) < len(groups[others[0]]):
            groups[others[0]] |= groups.pop((stem, unit))
    # Programs usually number wheels axle by axle, side by side, or around the rover from the front left or from the
    # front right wheel. The number of each order is its prior probability.
    left, right = ([mount.name for mount in rover.wheels if mount.side == side] for side in "lr")
    orders = (
        ([name for pair in zip(left, right, strict=False) for name in pair], 0.6),
        (left + right, 0.17),
        (left[:1] + right + left[:0:-1], 0.13),
        (right[:1] + left + right[:0:-1], 0.1),
    )
    for (stem, unit), group in groups.items():
        mapped = {name: word for wheels, word in group.items() if not isinstance(wheels, str) for name in wheels}
        numbers = {int(number): word for number, word in group.items() if isinstance(number, str)}
        if are_enough(mapped, rover):
            yield stem, unit, [(mapped, 1.0)]
        elif numbers:
            # The lowest number of a complete set is the first wheel. In an incomplete set, 0 or 1 may be the first.
            count, low, high = len(rover.wheels), min(numbers), max(numbers)
            if len(numbers) == count:
                firsts = [low] if high - low == count - 1 else []
            else:
                firsts = [first for first in (1, 0) if low >= first and high < first + count]
            maps = []
            for first, (order, share) in itertools.product(firsts, orders):
                family = {wheel: numbers[at] for at, wheel in enumerate(order, first) if at in numbers}
                maps += [(family, share / len(firsts))] if are_enough(family, rover) else []
            if maps:
                yield stem, unit, maps


def are_enough(wheels: Collection[str], rover: Rover) -> bool:
    """Return whether these wheels determine the rover's speed and turn rate: at least half of its wheels, with some on
    each side.
    """
    sides = {mount.side for mount in rover.wheels if mount.name in wheels}
    return 2 * len(wheels) >= len(rover.wheels) and sides == {mount.side for mount in rover.wheels}


def _owners(word: Word, rover: Rover) -> tuple[tuple[str, ...] | str, tuple[str, ...]]:
    """Return the wheels that the name of a column refers to, and the words of the name that do not refer to a wheel.

    The wheels are a tuple of wheel names: one name for a single wheel, several for a side or axle, and none if the name
    refers to no wheel. For a name with only a number, the number is returned as text instead of the tuple.
    """
    present = [(mount.name, rover.model.names[mount.joint]) for mount in rover.wheels]
    for wheel, name in (*present, *((wheel, wheel) for wheel, _ in present)):
        tokens = called.word(name).tokens
        for at in range(len(word.tokens) - len(tokens) + 1):
            if word.tokens[at : at + len(tokens)] == tokens:
                return (wheel,), word.tokens[:at] + word.tokens[at + len(tokens) :]
    # Without a joint or wheel name, a corner of the rover may be named: "front left", "left", "l2" or a plain number.
    axle, side, other_words = corner(word.tokens)
    mounts = [mount for mount in rover.wheels if side in ("", mount.side)]
    if axle.isdigit() and not side:
        return axle, other_words
    last = max(mount.axle for mount in rover.wheels)
    axles = {"front": [0], "rear": [last], "mid": list(range(1, last)), "": list(range(last + 1))}
    on = axles.get(axle) or ([int(axle) - 1] if axle.isdigit() else [])
    return tuple(mount.name for mount in mounts if side and mount.axle in on), other_words


def wheel_choices(words: Sequence[Word], rover: Rover, declared: Mapping[str, Entry]) -> list[list[Choice]]:
    """Return the possible sources of the wheel rates in four lists. A later list is considered only if no earlier list
    fits.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recording.
    rover : Rover
        Names, sides and radii of the wheels.
    declared : mapping
        Channel -> entry of [columns] that the user gave. These entries replace the sources of these channels in every
        choice.

    Returns
    -------
    list of list of Choice
        Measured rates of each wheel; measured rates of each side; rates computed from speed and turn rate of the rover;
        commanded rates.
    """
    names = [f"wheel_rate_{mount.name}" for mount in rover.wheels]
    declared_rates = {name: declared[name] for name in names if name in declared}
    if len(declared_rates) == len(names):
        return [[Choice(declared_rates, 0.0, "given by the user", True)]]
    measured: list[Choice] = []
    sides: list[Choice] = []
    commanded: list[Choice] = []
    for stem, unit, maps in families(words, rover):
        # A family holds counts if its words mean an encoder's position, and rates if its words or its unit mean a
        # rate.
        count = bool(stem & called.COUNT) and not stem & (called.RATE - {"v", "w"}) and unit in ("", "rad", "deg")
        bare = stem <= called.WHEEL and not unit
        rate = count or bare or stem & called.RATE or unit in (*RATES, *SPEEDS)
        is_unit_of_rate = not unit or count or any(math.isfinite(factor_to(unit, si)) for si in ("rad/s", "m/s"))
        # Torques, currents, duties and steering angles of wheels are families too, but no rates.
        is_other_quantity = stem & (called.NO_WHEEL | called.CURRENT | called.DUTY | called.STEER - {"corner"})
        if not rate or not is_unit_of_rate or is_other_quantity:
            continue
        of_sides = len({word.name for word in maps[0][0].values()}) < len(maps[0][0])
        into = commanded if stem & called.COMMAND else sides if of_sides else measured
        for family, share in maps:
            into += _rates(family, unit, math.log(share * (BARE_SHARE if bare else 1.0)), count, rover)
    # A family with more wheels precedes families that lack some.
    most = max((len(choice.entries) for choice in measured), default=0)
    measured = [choice for choice in measured if len(choice.entries) == most]
    present = {name: {"column": name} for name in names if name in {word.name for word in words}}
    there = [name.removeprefix("wheel_rate_") for name in {**present, **declared_rates}]
    if declared_rates and not measured + sides and are_enough(there, rover):
        measured = [Choice(present, 0.0, "given by the user", True)]
    # Rates may also follow from columns of the rover's speed v and turn rate omega, commanded or reported by odometry.
    # The rate of a wheel is (v -+ omega b / 2) / r, where b / 2 is the distance of the wheel from the centre line and r
    # its radius. The sign is - for a left wheel.
    from_twist: list[Choice] = []
    moves = [word for word in words if word.has(called.ODOMETRY | called.COMMAND | {"twist"})]
    ahead = [word for word in moves if word.has(called.AHEAD) and word.tokens[-1] not in ("y", "z")]
    turns = [word for word in moves if word.has(called.TURN) or (word.has({"angular"}) and word.tokens[-1] == "z")]
    places = wheel_places(rover)
    for v, omega in itertools.product(ahead, turns):
        # A commanded speed does not belong to a measured turn rate.
        paired = all(v.has(kind) == omega.has(kind) for kind in (called.COMMAND, called.ODOMETRY))
        if not paired or v.unit not in ("", "m/s") or omega.unit not in ("", "rad/s"):
            continue
        entries: dict[str, Entry] = {}
        for mount in rover.wheels:
            half, sign = abs(float(places[mount.name][1])), "-" if mount.side == "l" else "+"
            formula = f"({quote(v.name)} {sign} {half:.6g} * {quote(omega.name)}) / {float(mount.wheel.r):.6g}"
            entries[f"wheel_rate_{mount.name}"] = {"formula": formula}
        why = (
            "the wheel rates are not recorded, so they are computed from the rover's speed v and turn rate omega as "
            "(v -+ omega b / 2) / r"
        )
        from_twist.append(Choice(entries, 0.0 if v.has(called.ODOMETRY) else -1.0, why))
    tiers = [measured, sides, from_twist, commanded]
    return [[choice._replace(entries={**choice.entries, **declared_rates}) for choice in tier] for tier in tiers]


def _rates(family: Family, unit: str, weight: float, count: bool, rover: Rover) -> Iterator[Choice]:
    """Yield the possible interpretations of one group of columns as wheel rates: every unit, every sign, and rates
    before a gear.

    Parameters
    ----------
    family : mapping
        Wheel name -> column.
    unit : str
        The unit that the column names state; '' if they state none.
    weight : float
        Log prior that this group of columns holds the wheel rates.
    count : bool
        Whether the columns hold an angle or encoder counts. The rate is then their derivative.
    rover : Rover
        Sides and radii of the wheels.
    """
    exact = all(word.name == f"wheel_rate_{wheel}" for wheel, word in family.items())
    unit_shares = {unit: STATED_SHARE} if unit else {"rad/s": STATED_SHARE} if exact else RATES | SPEEDS
    if count:
        unit_shares = {unit or "rad": STATED_SHARE if unit else 0.3}
    units = [(name, math.log(share), False) for name, share in unit_shares.items()]
    # With a small probability, the rates are those of the motor before a gear, so that their scale is unknown.
    units.append((next(iter(unit_shares)), math.log(1.0 - STATED_SHARE if unit or exact else UNKNOWN_SHARE), True))
    for (name, often, free), ((left, right), mounted) in itertools.product(units, SIGNS.items()):
        entries, turned = {}, (left, right) != (1, 1)
        for mount in (mount for mount in rover.wheels if mount.name in family):
            sense = left if mount.side == "l" else right
            entries[f"wheel_rate_{mount.name}"] = _entry(family[mount.name], name, float(mount.wheel.r), sense, count)
        why = "its name" + ("" if unit or exact else f"; taken as {name}, because this agrees with the rover's speed")
        why += "; sign reversed, because the rate opposes the travel" if turned else ""
        log_prior = weight + often + math.log(mounted)
        yield Choice(entries, log_prior, why, (bool(unit) or exact) and not turned, free=free)


def _entry(word: Word, unit: str, radius: float, sense: int, count: bool) -> Entry:
    """Return the source of the rate of one wheel, as an entry of the table [columns] in drive.toml.

    The source is the derivative of a count, a rim speed divided by the radius, or a column of rates with its unit.

    `sense` is 1, or -1 if the wheel counts backwards.
    """
    # A rate must be positive forwards in a drive log, so a wheel that counts backwards gets a minus sign.
    sign = "-" if sense < 0 else ""
    if count:
        inner = f"radians({quote(word.name)})" if unit == "deg" else quote(word.name)
        return {"formula": f"{sign}rate({inner}, t_s)"}
    factor = factor_to(unit, "m/s")
    if math.isfinite(factor):
        return {"formula": f"{sign}{'' if factor == 1.0 else f'{factor:.6g} * '}{quote(word.name)} / {radius:.6g}"}
    exact = word.name.startswith("wheel_rate_") and not word.unit
    return column(word, "" if exact and unit == "rad/s" else unit, **({"scale": -1.0} if sense < 0 else {}))
