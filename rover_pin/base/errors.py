"""The family of errors that public functions raise.

A message says what is wrong (name, value with unit), where it comes from, what is allowed, and what to do.
"""

from collections.abc import Collection, Iterable
from typing import Any

LONGEST, TAIL = 1200, 250
"""Characters of a message; of a longer one the beginning and this much of its end are kept."""
NO_ROOM = "failed to map segment"
"""What the system says of a library for which there is no memory."""


class RoverPinError(Exception):
    """Anything this package refuses or cannot finish; whatever it quotes, its message is one printable line.

    Examples
    --------
    >>> from rover_pin import RoverPinError, Soil
    >>> try:
    ...     Soil(phi=30.0)
    ... except RoverPinError as error:
    ...     print(str(error).split(". ")[0])
    Soil.phi = 30 rad is not allowed: it must lie in [0, 1.0472] rad
    """

    def __init__(self, message: str):
        super().__init__(one_line(message))


class ParameterError(RoverPinError):
    """A quantity outside what is allowed, an unknown field or an unknown unit."""


class UrdfError(RoverPinError):
    """A rover description (URDF or TOML) that does not make a rover."""


class DataError(RoverPinError):
    """A measured or declared file that cannot be read as what it should be."""


class MissingExtraError(RoverPinError):
    """An optional dependency is needed and not installed."""


class CacheError(RoverPinError):
    """Code that is compiled on first use has no private folder to be kept in."""


class SimulationError(RoverPinError):
    """A drive that could not start or go on; `trace` keeps what was driven, or is None."""

    def __init__(self, message: str, trace: Any = None):
        super().__init__(message)
        self.trace = trace


class OptimisationError(RoverPinError):
    """A fit or tuning that failed; `status` keeps what the solver reported."""

    def __init__(self, message: str, status: Any = None):
        super().__init__(message)
        self.status = status


def one_line(text: str) -> str:
    """Return text as one line: breaks as spaces, what cannot be printed escaped, the middle of a long one left out."""
    line = " ".join(text.splitlines()).strip()
    line = "".join(character if character.isprintable() else ascii(character)[1:-1] for character in line)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - TAIL - 5]} ... {line[-TAIL:]}"


MOST_NAMES = 20
"""How many names an error lists; of more, the nearest."""


def closest(name: Any, names: Iterable[Any]) -> str:
    """Return the end of an unknown-name message: `did you mean 'x'? Known: ..`, or `known are ...` if none is close."""
    name, names = str(name), sorted(map(str, names))
    if not names:
        return "there is none."
    import difflib

    hits = difflib.get_close_matches(name, names, n=8, cutoff=0.5)
    is_close = bool(hits) and difflib.SequenceMatcher(None, name, hits[0]).ratio() > 0.6
    if len(names) <= MOST_NAMES:
        listed = f"{', '.join(names)}."
        return f"did you mean '{hits[0]}'? Known: {listed}" if is_close else f"known are {listed}"
    if is_close:
        return f"did you mean '{hits[0]}'? Known and alike: {', '.join(hits)}; {len(names)} in all."
    nearer = [*hits, *(word for word in names if word not in hits)][:8]  # one that is hardly alike says nothing alone
    return f"known are {', '.join(nearer)}; {len(names)} in all."


def one_of(name: str, word: Any, choices: Collection[str]) -> str:
    """Return a setting's word, which must be one of the known.

    Raises ParameterError: it is not, with the close ones.
    """
    if not isinstance(word, str) or word not in choices:
        raise ParameterError(f"{name} = {word!r} is not known: {closest(word, choices)}")
    return word
