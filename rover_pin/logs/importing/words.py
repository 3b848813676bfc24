"""What columns are called: words of English, German, French and Spanish for quantities, places, sides and units."""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

UNITS = {
    "s": "s", "sec": "s", "secs": "s", "seconds": "s", "sekunden": "s", "ms": "ms", "msec": "ms", "us": "us",
    "ns": "ns",
    "nsec": "ns", "nanosec": "ns", "m": "m", "mm": "mm", "cm": "cm", "km": "km", "rad": "rad", "deg": "deg",
    "degree": "deg", "degrees": "deg", "grad": "deg", "rad/s": "rad/s", "rads": "rad/s", "radps": "rad/s",
    "1/s": "rad/s",
    "deg/s": "deg/s", "degs": "deg/s", "degps": "deg/s", "dps": "deg/s", "grad/s": "deg/s", "rpm": "rpm",
    "u/min": "rpm",
    "umin": "rpm", "1/min": "rpm", "tr/min": "rpm", "rev/s": "rev/s", "rps": "rev/s", "u/s": "rev/s", "m/s": "m/s",
    "mps": "m/s", "cm/s": "cm/s", "mm/s": "mm/s", "mmps": "mm/s", "km/h": "km/h", "kmh": "km/h", "kph": "km/h",
    "a": "A", "amp": "A", "amps": "A", "ma": "mA", "v": "V", "volt": "V", "volts": "V", "mv": "mV",
}  # fmt: skip
"""Units as they are written, in small letters without blanks."""

FRONT = {"f", "front", "forward", "fwd", "v", "vorn", "vorne", "vorder", "avant", "av", "delante", "delantera"}
REAR = {"rear", "back", "b", "aft", "h", "hinten", "hinter", "arriere", "ar", "trasera", "atras"}
MIDDLE = {"m", "mid", "middle", "mitte", "mittel", "center", "centre", "c", "milieu"}
LEFT = {"l", "left", "lh", "port", "links", "linke", "linkes", "gauche", "izquierda", "izq"}
RIGHT = {"r", "right", "rh", "starboard", "stbd", "rechts", "rechte", "rechtes", "droite", "derecha"}
CORNERS = {
    "fl": ("front", "l"), "fr": ("front", "r"), "lf": ("front", "l"), "rf": ("front", "r"), "rl": ("rear", "l"),
    "rr": ("rear", "r"), "lr": ("rear", "l"), "bl": ("rear", "l"), "br": ("rear", "r"), "lb": ("rear", "l"),
    "rb": ("rear", "r"), "ml": ("mid", "l"), "mr": ("mid", "r"), "lm": ("mid", "l"), "rm": ("mid", "r"),
    "cl": ("mid", "l"), "cr": ("mid", "r"), "vl": ("front", "l"), "vr": ("front", "r"), "hl": ("rear", "l"),
    "hr": ("rear", "r"), "avg": ("front", "l"), "avd": ("front", "r"), "arg": ("rear", "l"), "ard": ("rear", "r"),
}  # fmt: skip
"""Two letters of a corner; v and h are German, vorne and hinten, av and ar French."""

RATE = {"rate", "speed", "vel", "velocity", "omega", "rpm", "drehzahl", "raddrehzahl", "geschwindigkeit", "vitesse",
        "winkelgeschwindigkeit", "angvel", "angspeed", "w", "rot", "rotation", "spin", "velocidad", "v",
        "qd"}  # fmt: skip
WHEEL = {
    "wheel",
    "wheels",
    "rad",
    "roue",
    "rueda",
    "motor",
    "mot",
    "drive",
    "joint",
    "axle",
    "side",
    "seite",
    "antrieb",
}
CURRENT = {"current", "currents", "strom", "motorstrom", "courant", "corriente", "amps", "i"}
DUTY = {"duty", "pwm", "dutycycle", "tastgrad", "tastverhaeltnis"}
STEER = {"steer", "steering", "lenk", "lenkung", "lenkwinkel", "braquage", "direction", "corner"}
COMMAND = {"cmd", "command", "commanded", "soll", "setpoint", "desired", "des", "target", "ref", "reference", "goal",
           "request", "requested", "consigne"}  # fmt: skip
ODOMETRY = {"odom", "odometry", "odo", "odometrie", "wheelodom"}
MEASURED = {"gt", "truth", "tracker", "mocap", "vicon", "optitrack", "qualisys", "leica", "station", "gps",
            "gnss", "rtk",
            "camera", "slam", "vo", "vio", "utm", "reference"}  # fmt: skip
"""Words of a pose that was measured from outside, which comes before one without, and that before odometry."""
TIME = {"t", "time", "zeit", "zeitstempel", "timestamp", "stamp", "temps", "tiempo", "epoch", "clock", "elapsed", "sec"}
X = {"x", "easting", "east", "ost", "rechtswert", "px", "xpos", "posx"}
Y = {"y", "northing", "north", "nord", "hochwert", "py", "ypos", "posy"}
Z = {"z", "height", "hoehe", "altitude", "alt", "elevation", "hauteur", "pz", "zpos", "posz", "up"}
NO_PLACE = {"vel", "velocity", "speed", "acc", "accel", "acceleration", "beschleunigung", "gyro", "gyr", "imu", "ang",
            "angular", "mag", "magnetic", "magnetometer", "q", "quat", "quaternion", "orientation", "force", "kraft",
            "torque", "cov", "covariance", "std", "sigma", "error", "err", "linear", "twist",
            "geschwindigkeit", "wheel",
            "rate", "sd", "rpy", "euler"}  # fmt: skip
ROLL = {"roll", "rollwinkel", "wanken", "wankwinkel", "roulis", "phi", "alabeo", "rollen"}
PITCH = {"pitch", "nick", "nicken", "nickwinkel", "tangage", "cabeceo", "tilt"}
YAW = {"yaw", "heading", "hdg", "gier", "gieren", "gierwinkel", "kurs", "azimuth", "azimut", "psi", "theta", "course",
       "cog", "bearing", "lacet", "rumbo", "cap", "orientation"}  # fmt: skip
COMPASS = {"heading", "hdg", "kurs", "azimuth", "azimut", "course", "cog", "bearing", "rumbo", "cap"}
"""Words of angles that are often counted clockwise from north."""
COURSE = {"course", "cog", "track"}
NO_ANGLE = {"rate", "gyro", "vel", "velocity", "speed", "dot", "omega", "angular", "std", "cov", "cmd", "error", "acc"}
LATITUDE = {"lat", "latitude", "breite", "breitengrad", "latitud"}
LONGITUDE = {"lon", "lng", "long", "longitude", "laenge", "laengengrad", "longitud"}
TURN = {"yawrate", "gierrate", "omega", "wz", "turn", "drehrate"}
AHEAD = {"v", "vx", "speed", "velocity", "geschwindigkeit", "vitesse", "linear"}
BATTERY = {"battery", "batterie", "akku", "vbat", "ubat", "bus", "supply"}
ONE_LETTER = {"m": X | Y | Z | {"pos", "position"}, "s": TIME, "v": BATTERY | {"voltage", "spannung"}, "a": CURRENT}
"""Units of one letter, and the words after which they are one."""
SMALL = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "°": " deg ", "µ": "u", "ω": " omega ", "θ": " theta "}
)


class Word(NamedTuple):
    """A column's name taken apart."""

    name: str
    tokens: tuple[str, ...]
    unit: str
    "as UNITS spells it; empty where the name tells none"

    def has(self, words: set[str]) -> bool:
        """Return whether one of these words is in it."""
        return bool(words.intersection(self.tokens))


def word(name: str) -> Word:
    """Return a column's name taken apart: small letters, camelCase and digits split, its unit read."""
    bracket = re.search(r"[\[(]\s*([^\])]{1,12})\s*[\])]\s*$", name)
    unit = _unit(bracket[1]) if bracket else ""
    stem = name[: bracket.start()] if bracket and unit else name
    tokens = _tokens(stem)
    if not unit and len(tokens) > 1 and tokens[-1] in UNITS and _ends_in_unit(tokens):
        unit, tokens = UNITS[tokens[-1]], tokens[:-1]
    if not unit and "rpm" in tokens:
        unit = "rpm"
    return Word(name, tuple(tokens), unit)


def _tokens(text: str) -> list[str]:
    spaced = re.sub(r"(?<=[a-zäöüß0-9])(?=[A-ZÄÖÜ])", " ", text)
    plain = unicodedata.normalize("NFKD", spaced.lower().translate(SMALL))
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return re.findall(r"[^\W\d_]+|\d+", plain) or [text]


def _unit(text: str) -> str:
    plain = (
        text.strip().lower().replace(" ", "").replace("°", "deg").replace("µ", "u").replace("·", "").replace("^-1", "")
    )
    plain = {"s-1": "1/s", "min-1": "1/min", "ms-1": "m/s", "rads-1": "rad/s"}.get(plain, plain)
    return UNITS.get(plain, "")


def _ends_in_unit(tokens: list[str]) -> bool:
    """Whether the last word of a name is its unit: one letter only after a word that it can be the unit of."""
    return len(tokens[-1]) > 1 or bool(ONE_LETTER.get(tokens[-1], set()) & set(tokens[:-1]))


def corner(tokens: tuple[str, ...]) -> tuple[str, str]:
    """Return where a column's wheel is: ('front' | 'mid' | 'rear' | a number | '', 'l' | 'r' | '')."""
    for token in reversed(tokens):
        if token in CORNERS:
            return CORNERS[token]
    token_set = set(tokens)
    side = "l" if token_set & LEFT else "r" if token_set & (RIGHT - {"r"}) else ""
    axle = "front" if token_set & FRONT else "rear" if token_set & REAR else "mid" if token_set & MIDDLE else ""
    if "r" in token_set:
        side, axle = (side or "r", axle) if axle or not side else (side, "rear")
    number = next((token for token in reversed(tokens) if token.isdigit() and len(token) < 3), "")
    return axle or number, side
