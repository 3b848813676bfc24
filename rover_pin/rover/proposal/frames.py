"""Search for the axes of a rover's base link that point forward and up, from the positions of the wheels and their
names.

The geometry of the wheels shows the direction of the axles and the upper side, but not the front end. The names of the
wheels (front_left, wheel_rr, port) state the end and the side. A choice of axes (a frame) is accepted if no name
contradicts the position of its wheel in the frame. If there is no such frame, the names and the geometry contradict
each other, and the user must decide which of them is right.
"""

import itertools
import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.rover.description.tree import turn

Rpy = tuple[float, float, float]
"""Type of a rotation that is given by roll, pitch and yaw [rad]."""
AXES = {f"{sign}{name}": value * np.eye(3)[i] for sign, value in (("+", 1.0), ("-", -1.0))
        for i, name in enumerate("xyz")}  # fmt: skip
"""Name of an axis of the base link, such as "-x" (the values of the option `--front`) -> its unit vector [3]."""


def rotation(rpy: Rpy) -> np.ndarray:
    """Return the rotation matrix [3, 3] for roll, pitch and yaw [rad], which turn about the fixed axes x, then y, then
    z.
    """
    return np.asarray(turn("z", rpy[2]) @ turn("y", rpy[1]) @ turn("x", rpy[0]))


class Frame(NamedTuple):
    """A possible choice of the rover's axes: the axis of the base link that points forward, and the axis that points
    up.
    """

    forward: str
    up: str

    @property
    def rpy(self) -> Rpy:
        """The value of base_rpy [rad] for this frame: the rotation that turns the base link's axes to x forward, y
        left, z up.
        """
        return BASE_RPY[self]

    @property
    def words(self) -> str:
        """The frame in words for a comment in a TOML, for example "x right, y forward, z up"."""
        wanted = rotation(self.rpy)
        names = (("forward", "left", "up"), ("back", "right", "down"))
        words = []
        for i, name in enumerate("xyz"):
            along = wanted[:, i]
            nearest = int(np.argmax(np.abs(along)))
            words.append(f"{name} {names[int(along[nearest] < 0.0)][nearest]}")
        return ", ".join(words)


def _base_rpy() -> dict[Frame, Rpy]:
    """Return, for each of the 24 possible frames of a base link, the value of base_rpy [rad] that turns the base link's
    axes to x forward, y left, z up.

    If several rotations give one frame, the rotation with the most zero angles is taken.
    """
    quarter = math.pi / 2
    turns = (0.0, -quarter, quarter, 2 * quarter)
    angles = itertools.product((0.0, 2 * quarter, quarter, -quarter), (0.0, quarter, -quarter), turns)
    by_frame: dict[Frame, Rpy] = {}
    # Rotations with few angles other than zero come first, and each frame keeps the first rotation that gives it.
    for rpy in sorted(angles, key=lambda rpy: sum(angle != 0.0 for angle in rpy)):
        rows = rotation(rpy)
        forward, up = (next(name for name, axis in AXES.items() if rows[i] @ axis > 0.9) for i in (0, 2))
        by_frame.setdefault(Frame(forward, up), rpy)
    return by_frame


BASE_RPY = _base_rpy()
"""Frame -> the rotation base_rpy [rad] that turns the base link's axes to x forward, y left, z up, for all 24
frames."""
FRAMES = [
    Frame(forward, up)
    for up in ("+z", "-z", "+y", "-y", "+x", "-x")
    for forward in ("+x", "+y", "+z", "-x", "-y", "-z")
    if Frame(forward, up) in BASE_RPY
]
"""All 24 possible frames of a base link, the most usual ones first: z up before z down, and the positive direction of
an axis before the negative direction."""

ENDS = {
    **dict.fromkeys(("front", "fore", "fwd", "bow", "f"), 2),
    **dict.fromkeys(("middle", "mid", "center", "centre", "m", "c"), 1),
    **dict.fromkeys(("rear", "back", "hind", "aft", "stern", "b"), 0),
}
"""Word in a wheel's name -> number of the end of the rover that it states: 2 front, 1 middle, 0 rear."""
SIDES = {**dict.fromkeys(("left", "port", "l"), "left"), **dict.fromkeys(("right", "starboard", "stbd", "r"), "right")}
"""Word in a wheel's name -> side of the rover that it states."""
LONG_WORDS = "|".join(
    sorted((word for word in (*ENDS, *SIDES) if len(word) > 3 or word == "mid"), key=len, reverse=True)
)
"""Pattern of the words for an end or a side that are also recognised inside a longer word, such as frontleftwheel."""
NEUTRAL = "wheel|tyre|tire|hub|joint|link|drive|motor"
"""Pattern of the words in a wheel's name that state neither an end nor a side."""
COMPOUND = re.compile(f"(?:{LONG_WORDS}|{NEUTRAL})+")
"""Pattern of the names that consist of several words without separators, for example frontleftwheel."""
LETTERS: dict[str, tuple[int, str]] = {}
"""Two letters in a wheel's name -> end and side that they state. One letter states the end, and the other letter states
the side, in any order. Both rl and lr mean rear left, because l can only be a side."""
for _end, _value in (("f", 2), ("m", 1), ("c", 1), ("b", 0), ("r", 0)):
    for _side in "lr":
        LETTERS |= {_end + _side: (_value, SIDES[_side]), _side + _end: (_value, SIDES[_side])}
END_WORDS = {2: "front", 1: "middle", 0: "rear"}
"""Number of the rover's end (2, 1, 0) -> word for this end."""


class NamedPlace(NamedTuple):
    """The end (2 front, 1 middle, 0 rear) and the side of the rover that a wheel's name states.

    `end` is None if the name does not state the end, and `side` is None if the name does not state the side.
    """

    end: int | None
    side: str | None

    def __str__(self) -> str:
        end = "" if self.end is None else END_WORDS[self.end]
        return f"{end} {self.side or ''}".strip()


def named_places(names: Sequence[str]) -> list[NamedPlace]:
    """Return the end and the side of the rover that the name of each wheel states.

    Words (front_left, RearRight, frontleftwheel) and letters (fl, lf, rr, f_l) are recognised. A single letter r means
    right if another name has a single l, and rear if another name has a single f. A single letter without such a
    counterpart is ignored.
    """
    tokens = []
    for name in names:
        # Blanks separate words in camel case, and a compound such as frontleftwheel is divided into its known words.
        # Two neighbouring single letters, as in f_l, become one word.
        spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
        words = re.findall("[a-z]+", spaced.lower())
        parts = [re.findall(f"{LONG_WORDS}|{NEUTRAL}", word) if COMPOUND.fullmatch(word) else [word] for word in words]
        line = " ".join(part for word_parts in parts for part in word_parts)
        tokens.append(re.sub(r"(?<![a-z])([fmcbrl]) ([rl])(?![a-z])", r"\1\2", line).split())
    single = {token for words in tokens for token in words if len(token) == 1}
    return [_place(words, single) for words in tokens]


def _place(tokens: Iterable[str], single: set[str]) -> NamedPlace:
    """Return the end and the side that the words (`tokens`) of a wheel's name state.

    `single` contains the single letters that occur in the names of all wheels. They decide the meaning of a single r.
    """
    end: int | None = None
    side: str | None = None
    # A word states both end and side, or one of them; single letters count only if all names together explain them.
    for token in tokens:
        if token in LETTERS:
            end, side = LETTERS[token]
        elif len(token) > 1:
            end, side = ENDS.get(token, end), SIDES.get(token, side)
        elif token in "lr" and {"l", "r"} <= single:
            side = SIDES[token]
        elif token in "fmbr" and "f" in single and ("r" in single) != ("b" in single):
            end = 0 if token == "r" else ENDS[token]
    return NamedPlace(end, side)


def contradictions(places: Sequence[NamedPlace], centres: np.ndarray) -> list[int]:
    """Return the indices of the wheels whose names contradict their positions.

    A front wheel must be ahead of every middle and rear wheel, and a left wheel must lie on the left of the mean of all
    wheels. If the names state only one end, front or rear, its wheels must lie ahead of or behind the mean.

    Parameters
    ----------
    places : sequence of NamedPlace
        The ends and sides that the names of the wheels state.
    centres : array [n, 3]
        Centres of the wheels in axes x forward, y left, z up [m].
    """
    x, y = centres[:, 0] - np.mean(centres[:, 0]), centres[:, 1] - np.mean(centres[:, 1])
    ends = {place.end for place in places} - {None}
    wrong = set()
    for i, place in enumerate(places):
        if place.side is not None and (y[i] > 0.0) != (place.side == "left"):
            wrong.add(i)
        if place.end is None:
            continue
        # If only front wheels or only rear wheels are named, the other wheels must lie on the other side of the middle.
        alone = len(ends) == 1 and any(other.end is None for other in places)
        if alone and ((place.end == 2 and x[i] <= 0.0) or (place.end == 0 and x[i] >= 0.0)):
            wrong.add(i)
        for k, other in enumerate(places):
            if other.end is not None and other.end < place.end and x[k] >= x[i]:
                wrong |= {i, k}
    return sorted(wrong)


def place_words(centre: np.ndarray, middle: np.ndarray) -> str:
    """Return the position of a wheel in words, for example "rear right".

    `centre` is the centre of the wheel and `middle` the mean of all wheels, in axes x forward, y left, z up [3] (m).
    """
    ahead, left = centre[0] - middle[0], centre[1] - middle[1]
    end = "middle" if abs(ahead) < 1e-9 else "front" if ahead > 0.0 else "rear"
    return f"{end} {'left' if left > 0.0 else 'right'}"
