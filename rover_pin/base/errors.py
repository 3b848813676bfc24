"""The errors that public functions raise.

A message states the fault (name, value with unit), its location (file, row, key), the allowed values, and the remedy.
"""

import logging
from collections.abc import Collection, Iterable
from typing import Any

from rover_pin.base.encode import printable

# A program that uses this package decides where its log goes; without this handler, warnings would go to stderr.
logging.getLogger("rover_pin").addHandler(logging.NullHandler())

MAX_MESSAGE, MESSAGE_TAIL = 1200, 250
"""Maximum number of characters of an error message (MAX_MESSAGE), and number of characters that are kept at the end of
a longer message (MESSAGE_TAIL). A longer message loses its middle part, because its end states the remedy. A message of
1200 characters fills about ten lines of a wide terminal, and a remedy usually fits into 250 characters."""
NO_ROOM = "failed to map segment"
"""Part of the operating system's error text if a library cannot be loaded for lack of memory. An ImportError with this
text is reported as a lack of memory; every other ImportError is a fault of the program."""


class RoverPinError(Exception):
    """The base class of all errors of this package.

    The message is one line: control characters in quoted names are escaped.

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
    """Raised for a number out of its bounds, an unknown field, setting or unit, or an argument of the wrong type."""


class UnknownNameError(ParameterError):
    """Raised for a scenario, or a setting of a scenario, that does not exist.

    A batch study stops at this error, because all of its cases would fail with this error.
    """


class UrdfError(RoverPinError):
    """Raised if no rover can be built from its description (URDF or TOML)."""


class DataError(RoverPinError):
    """Raised for a file of data, a model file or a file of code that cannot be read or used."""


class MissingExtraError(RoverPinError):
    """Raised if an optional package or program is needed but not installed."""


class CacheError(RoverPinError):
    """Raised if no private folder can be used to keep compiled code."""


class UnknownAttributeError(ParameterError, AttributeError):
    """Raised if an object has no attribute of a given name, such as `soil.cohesion`, because `Soil` has no such field.

    The text of the message is made only when it is read, because programs also probe objects for attributes and ignore
    the error.

    Parameters
    ----------
    owner : object
        The object that lacks the attribute.
    name : str
        The unknown name.
    names : collection of str
        The names of the existing attributes.
    hint : str
        The correct spelling, if it is known; otherwise the message lists similar names.
    """

    def __init__(self, owner: Any, name: str, names: Collection[str], hint: str = ""):
        super().__init__(name)
        self.owner, self.unknown, self.names, self.hint = type(owner).__name__, name, tuple(names), hint

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the constructor and the argument that rebuild the error in another process (Python's pickle protocol).

        The rebuilt error is a ParameterError with an equal message, so that the object itself need not be sent.
        """
        return ParameterError, (str(self),)

    def __str__(self) -> str:
        article = "an" if self.owner[:1] in "AEIOU" else "a"
        return one_line(
            f"{article} {self.owner} has no '{self.unknown}': {self.hint or closest(self.unknown, self.names)}"
        )


class SimulationError(RoverPinError):
    """Raised if a simulated drive cannot start or continue. `trace` is the recorded drive up to the failure, or
    None.
    """

    def __init__(self, message: str, trace: Any = None):
        super().__init__(message)
        self.trace = trace


class OptimisationError(RoverPinError):
    """Raised if a fit or a tuning fails. `status` is the report of the solver, or None."""

    def __init__(self, message: str, status: Any = None):
        super().__init__(message)
        self.status = status


def one_line(text: str) -> str:
    """Return a text as one line of at most MAX_MESSAGE characters, without control characters.

    Newlines become spaces. A longer text loses its middle part.
    """
    line = printable(" ".join(text.splitlines()).strip())
    if len(line) <= MAX_MESSAGE:
        return line
    return f"{line[: MAX_MESSAGE - MESSAGE_TAIL - 5]} ... {line[-MESSAGE_TAIL:]}"


SYNONYMS = {
    **dict.fromkeys(("friction_angle", "internal_friction", "internal_friction_angle", "phi_deg"), "phi"),
    **dict.fromkeys(("cohesion", "c_0"), "c"),
    **dict.fromkeys(("exponent", "sinkage_exponent", "deformation_exponent"), "n"),
    **dict.fromkeys(("shear_modulus", "shear_displacement", "shear_deformation_modulus"), "k"),
    **dict.fromkeys(("radius", "wheel_radius"), "r"),
    **dict.fromkeys(("width", "wheel_width"), "b"),
    **dict.fromkeys(("f_z", "normal_force", "wheel_load"), "f_n"),
    **dict.fromkeys(("f_x", "drawbar_pull", "traction"), "f_t"),
}
"""Common name of a quantity -> its symbol in this package. An error about such a name suggests the symbol; a file or a
call that uses the common name is still refused."""
BEKKER = (
    "it is a constant of Bekker's equation. Eq (4) uses k_1 = k_c b^(n-1) and k_2 = k_phi b^(n-1) instead, where b is "
    "the wheel's width in metres. The table [soil] in the TOML file of a rover or a rig takes k_c, k_phi and n."
)
"""The explanation that an error gives if a user wrote k_c or k_phi where the package expects k_1 or k_2. Eq (4) of the
paper is the pressure under a wheel as a function of the sinkage."""
MAX_LISTED_NAMES = 20
"""Maximum number of known names that an error about an unknown name lists in full. If more names are known, the error
lists at most eight names, the similar ones first. Twenty names fill about two lines of a terminal."""


def closest(name: Any, names: Iterable[Any]) -> str:
    """Return the end of an error message about an unknown name. It suggests a similar name, and lists the known names.

    `name` is the unknown name, and `names` are all known names. If no known name is similar, the text suggests none.

    Examples
    --------
    >>> closest("sol", ["soil", "rover"])
    "did you mean 'soil'? Known: rover, soil."
    """
    # An empty list cannot suggest anything.
    name, names = str(name), sorted(map(str, names))
    if not names:
        return "there is none."
    # The last part of a dotted name decides: `soil.cohesion` means `soil.c`.
    prefix, dot, last = name.rpartition(".")
    if last.lower() in ("k_c", "k_phi", "kc", "kphi") and f"{prefix}{dot}k_1" in names:
        return BEKKER
    meant = f"{prefix}{dot}{SYNONYMS.get(last.lower(), '')}"
    if meant in names:
        return f"did you mean '{meant}'?"
    import difflib

    # Similar spellings are suggested only above a ratio of 0.6; the ratio of equal words is 1.
    hits = difflib.get_close_matches(name, names, n=8, cutoff=0.5)
    is_close = bool(hits) and difflib.SequenceMatcher(None, name, hits[0]).ratio() > 0.6
    # A short list of names is printed in full, with the most similar name as a suggestion.
    if len(names) <= MAX_LISTED_NAMES:
        listed = f"{', '.join(names)}."
        return f"did you mean '{hits[0]}'? Known: {listed}" if is_close else f"known are {listed}"
    if is_close:
        return f"did you mean '{hits[0]}'? Known and alike: {', '.join(hits)}; {len(names)} in all."
    # One name that is hardly similar would mislead if it stood alone, so other names follow it.
    nearer = [*hits, *(word for word in names if word not in hits)][:8]
    return f"known are {', '.join(nearer)}; {len(names)} in all."


def one_of(name: str, word: Any, choices: Collection[str]) -> str:
    """Check that `word` is one of the allowed choices, and return it unchanged.

    Raises ParameterError: `word` is not one of the choices. The message calls the value `name` and lists similar
    choices.
    """
    if not isinstance(word, str) or word not in choices:
        raise ParameterError(f"{name} = {word!r} is not known: {closest(word, choices)}")
    return word
