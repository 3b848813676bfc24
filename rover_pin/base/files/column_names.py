"""The words that column names of recordings use, in English, German, French and Spanish: quantities, axles, sides,
units.

The readers of drive logs and of rig tables use this module to split a column's name into words and a unit. The words
for quantities of a test rig are in `measurements.rig_columns`.
"""

import math
import re
import unicodedata
from typing import NamedTuple

from rover_pin.base.units import factor_to

WRITTEN = {
    "s-1": "1/s", "min-1": "1/min", "ms-1": "m/s", "rads-1": "rad/s", "degs-1": "deg/s", "r/min": "rpm", "hz": "rev/s",
    "revs-1": "rev/s", "us-1": "rev/s", "umin-1": "rpm", "meters": "m", "metres": "m", "meter": "m", "metre": "m",
}  # fmt: skip
"""Spelling of a unit in brackets that is no key of UNITS -> the key of UNITS, or the unit symbol, that has this
meaning."""
UNIT_WORDS = {"hours": "h", "hour": "h", "minutes": "min", "minute": "min", "feet": "ft", "foot": "ft", "inches": "in"}
"""Full word for a unit that is written in brackets -> the symbol of the unit in `base.units`."""
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
    "m/s^2": "m/s^2", "m/s2": "m/s^2", "m/s²": "m/s^2", "mps2": "m/s^2", "g": "g",
    "%": "%", "pct": "%", "percent": "%", "prozent": "%", "in": "in",
    "a": "A", "amp": "A", "amps": "A", "ma": "mA", "v": "V", "volt": "V", "volts": "V", "mv": "mV",
}  # fmt: skip
"""Spelling of a unit in recordings, in small letters without blanks -> the symbol of the unit in `base.units`."""

FRONT = {"f", "front", "forward", "fwd", "vorn", "vorne", "vorder", "avant", "av", "del", "delante", "delantera",
         "ant", "anteriore"}  # fmt: skip
REAR = {"rear", "back", "b", "aft", "hinten", "hinter", "arriere", "ar", "tras", "trasera", "atras", "post",
        "posteriore"}  # fmt: skip
MIDDLE = {"mid", "middle", "mitte", "mittel", "center", "centre", "milieu", "medio", "centrale"}
LEFT = {"l", "left", "lh", "port", "links", "linke", "linkes", "gauche", "izquierda", "izq", "sx", "sinistra"}
RIGHT = {"r", "right", "rh", "starboard", "stbd", "rechts", "rechte", "rechtes", "droite", "derecha", "der", "dx",
         "destra"}  # fmt: skip
CORNERS = {
    "fl": ("front", "l"), "fr": ("front", "r"), "lf": ("front", "l"), "rf": ("front", "r"), "rl": ("rear", "l"),
    "rr": ("rear", "r"), "lr": ("rear", "l"), "bl": ("rear", "l"), "br": ("rear", "r"), "lb": ("rear", "l"),
    "rb": ("rear", "r"), "ml": ("mid", "l"), "mr": ("mid", "r"), "lm": ("mid", "l"), "rm": ("mid", "r"),
    "cl": ("mid", "l"), "cr": ("mid", "r"), "vl": ("front", "l"), "vr": ("front", "r"), "hl": ("rear", "l"),
    "hr": ("rear", "r"), "avg": ("front", "l"), "avd": ("front", "r"), "arg": ("rear", "l"), "ard": ("rear", "r"),
}  # fmt: skip
"""Abbreviation of a wheel's position, such as "fl" -> its axle and its side (l or r). The letters v and h are German
(vorne: front, hinten: rear); av and ar are French (avant: front, arriere: rear)."""

RATE = {"rate", "speed", "vel", "velocity", "omega", "rpm", "drehzahl", "raddrehzahl", "geschwindigkeit", "vitesse",
        "winkelgeschwindigkeit", "angvel", "angspeed", "w", "rot", "rotation", "spin", "velocidad", "velocita", "v",
        "qd"}  # fmt: skip
WHEEL = {"wheel", "wheels", "rad", "raeder", "roue", "roues", "rueda", "ruedas", "ruota", "ruote"}
"""Words that mark a column as a measurement at a wheel, but do not state which quantity the column holds."""
COUNT = {"enc", "encoder", "tick", "ticks", "count", "counts", "impulse", "codeur", "position", "pulses"}
"""Words for the angle, or the number of encoder pulses, through which a wheel has turned since the recording began."""
CURRENT = {"current", "currents", "strom", "motorstrom", "courant", "corriente", "corrente", "amps", "i"}
DUTY = {"duty", "pwm", "dutycycle", "tastgrad", "tastverhaeltnis"}
STEER = {"steer", "steering", "lenk", "lenkung", "lenkwinkel", "braquage", "direction", "corner"}
NO_WHEEL = {"temp", "temperature", "temperatur", "voltage", "spannung", "torque", "effort", "force", "kraft", "power",
            "imu", "gyro", "angular", "gps", "body", "odom", "linear", "twist", "acc", "accel", "q", "quat", "slip",
            "quaternion", "orientation", "battery", "cov", "covariance", "std", "err", "error", "mag"}  # fmt: skip
"""A column whose name has one of these words holds neither the rate nor the encoder count of a wheel."""
COMMAND = {"cmd", "command", "commanded", "soll", "setpoint", "desired", "des", "target", "ref", "reference", "goal",
           "request", "requested", "consigne"}  # fmt: skip
ODOMETRY = {"odom", "odometry", "odo", "odometrie", "wheelodom"}
MEASURED = {"gt", "truth", "tracker", "mocap", "vicon", "optitrack", "qualisys", "leica", "station", "gps",
            "gnss", "rtk", "vrpn", "camera", "slam", "vo", "vio", "utm"}  # fmt: skip
"""Words that mark a pose of the rover as measured from outside, for example by a camera system or by satellites."""
TIME = {"t", "time", "zeit", "zeitstempel", "timestamp", "stamp", "temps", "horodatage", "tiempo", "marca", "tempo",
        "epoch", "clock", "elapsed", "sec", "rosbagtimestamp"}  # fmt: skip
X = {"x", "easting", "east", "ost", "rechtswert", "px", "xpos", "posx", "e", "este", "est"}
Y = {"y", "northing", "north", "nord", "hochwert", "py", "ypos", "posy", "n", "norte"}
UP = {"height", "hoehe", "altitude", "alt", "elevation", "hauteur", "up", "altura", "altitud", "quota"}
Z = UP | {"z", "pz", "zpos", "posz"}
AXES = {"x", "y", "z", "px", "py", "pz", "xpos", "ypos", "zpos", "posx", "posy", "posz"}
"""Words for the axes x, y and z of a position whose direction in the world the column name does not state."""
NO_PLACE = {"vel", "velocity", "speed", "acc", "accel", "acceleration", "beschleunigung", "gyro", "gyr", "imu", "ang",
            "angular", "mag", "magnetic", "magnetometer", "q", "quat", "quaternion", "orientation", "force", "kraft",
            "torque", "cov", "covariance", "std", "sigma", "error", "err", "linear", "twist", "a",
            "geschwindigkeit", "wheel", "rate", "sd", "rpy", "euler", "vitesse", "velocidad", "velocita"}  # fmt: skip
ROLL = {"roll", "rollwinkel", "wanken", "wankwinkel", "roulis", "phi", "alabeo", "rollen", "rollio"}
PITCH = {"pitch", "nick", "nicken", "nickwinkel", "tangage", "cabeceo", "tilt", "beccheggio"}
YAW = {"yaw", "heading", "hdg", "gier", "gieren", "gierwinkel", "kurs", "azimuth", "azimut", "psi", "theta", "course",
       "cog", "bearing", "lacet", "rumbo", "cap", "orientation", "guinada", "imbardata"}  # fmt: skip
COMPASS = {"heading", "hdg", "kurs", "azimuth", "azimut", "course", "cog", "bearing", "rumbo", "cap"}
"""Words for a heading angle that is often counted clockwise from north, unlike yaw."""
NO_ANGLE = {"rate", "gyro", "vel", "velocity", "speed", "dot", "omega", "angular", "std", "cov", "cmd", "error", "acc"}
LATITUDE = {"lat", "latitude", "breite", "breitengrad", "latitud", "latitudine"}
LONGITUDE = {"lon", "lng", "long", "longitude", "laenge", "laengengrad", "longitud", "longitudine"}
TURN = {"yawrate", "gierrate", "omega", "wz", "turn", "drehrate"}
AHEAD = {"v", "vx", "speed", "velocity", "geschwindigkeit", "vitesse", "linear"}
BATTERY = {"battery", "batterie", "akku", "vbat", "ubat", "bus", "supply"}
ONE_LETTER = {"m": X | Y | Z | {"pos", "position"}, "s": TIME, "v": BATTERY | {"voltage", "spannung"}, "a": CURRENT,
              "g": {"acc", "accel", "accelerometer"}}  # fmt: skip
"""Letter -> the words after which this letter at the end of a column name is a unit, as "m" in "position m"."""
SMALL = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "°": " deg ", "µ": "u", "ω": " omega ", "θ": " theta "}
)


class Word(NamedTuple):
    """A column's name, split into words (`tokens`) and a unit."""

    name: str
    tokens: tuple[str, ...]
    unit: str
    """symbol of the unit in the spelling of UNITS; empty if the name states no unit"""

    def has(self, words: set[str]) -> bool:
        """Return whether at least one of the given words occurs in the column's name."""
        return bool(words.intersection(self.tokens))


def word(name: str) -> Word:
    """Return a column's name together with its words and its unit.

    The words are in small letters, and a change to a capital letter or to a digit begins a new word: "WheelSpeedFL
    [rpm]" gives the words wheel, speed and fl, and the unit rpm.
    """
    # The reader of tables numbers columns with equal names, as in "speed [rpm] (2)"; the unit is before the number.
    numbered = re.fullmatch(r"(.*\S)\s+\((\d+)\)", name)
    if numbered:
        first = word(numbered[1])
        return Word(name, (*first.tokens, numbered[2]), first.unit)
    # A unit may be in brackets, or after a slash, a comma or "in", at the end of the name.
    bracket = re.search(r"(?:\s*[\[({<]\s*|\s+/\s+|\s*,\s+|\s+in\s+)([^\[({<\])}>]{1,12}?)\s*[\])}>]?\s*$", name)
    unit = stated_unit(bracket[1]) if bracket else ""
    # A unit in brackets is removed from the name before the name is split into words.
    stem = name[: bracket.start()] if bracket and unit else name
    tokens = tokens_of(stem)
    # Two words at the end may be a unit without its slash, as in "speed_m_s".
    if not unit and len(tokens) > 2 and "/".join(tokens[-2:]) in UNITS:
        unit, tokens = UNITS["/".join(tokens[-2:])], tokens[:-2]
    # A unit of one letter counts only after a word that can have this unit: "v" is a volt after "battery" only.
    is_unit = len(tokens[-1]) > 1 or bool(ONE_LETTER.get(tokens[-1], set()) & set(tokens[:-1]))
    if not unit and len(tokens) > 1 and tokens[-1] in UNITS and is_unit:
        unit, tokens = UNITS[tokens[-1]], tokens[:-1]
    # The word rpm is both the quantity and its unit, so it stays a word of the name.
    if not unit and "rpm" in tokens:
        unit = "rpm"
    return Word(name, tuple(tokens), unit)


def tokens_of(text: str) -> list[str]:
    """Return the words and the numbers of a name in small letters, in their order.

    A capital letter after a small letter begins a new word. Accents are removed, and umlauts become two letters (ae,
    oe).
    """
    # mA and mV at the end are units, not two words.
    text = re.sub(r"m([AV])$", lambda unit: unit[0].lower(), text)
    # A capital letter after a small letter begins a new word (camelCase).
    spaced = re.sub(r"(?<=[a-zäöüß0-9])(?=[A-ZÄÖÜ])", " ", text)
    plain = unicodedata.normalize("NFKD", spaced.lower().translate(SMALL))
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return re.findall(r"[^\W\d_]+|\d+", plain) or [text]


def usual_unit(text: str) -> str:
    """Return the symbol of a unit that is written in a spelling of UNITS or WRITTEN; an empty text for any other
    text.
    """
    plain = unicodedata.normalize("NFKC", text.strip().lower().replace("°", "deg"))
    plain = re.sub(r"[ ·⋅*^()]", "", plain.replace("µ", "u").replace("μ", "u").replace("−", "-"))
    return UNITS.get(WRITTEN.get(plain, plain), "")


def stated_unit(text: str) -> str:
    """Return the symbol of a unit that a column name has in brackets; an empty text if the text is not a unit.

    If a unit of UNITS has an equal size, its symbol is returned, so that callers have to handle few symbols. Any other
    unit of a length, time, angle, rate, speed, acceleration, current or voltage is returned unchanged.
    """
    unit = usual_unit(text)
    if unit or not any(char.isalpha() for char in text):
        return unit
    # Any other unit counts if it measures a kind of quantity that recordings hold.
    for si in ("m", "s", "rad", "rad/s", "m/s", "m/s^2", "A", "V"):
        factor = factor_to(UNIT_WORDS.get(text.strip().lower(), text), si)
        if math.isfinite(factor):
            same = (name for name in dict.fromkeys(UNITS.values()) if math.isclose(factor_to(name, si), factor))
            return next(same, UNIT_WORDS.get(text.strip().lower(), text.strip()))
    return ""


def corner(tokens: tuple[str, ...]) -> tuple[str, str, tuple[str, ...]]:
    """Return the axle and the side of a wheel from the words of a column's name, and the words that state neither.

    The axle is 'front', 'mid' or 'rear', or the wheel's number as text, or '' if the name states no axle. The side is
    'l', 'r' or ''. The letter r means right; if the name also states a side, the letter r means rear.
    """
    # An abbreviation such as "fl" states the axle and the side together.
    for token in reversed(tokens):
        if token in CORNERS:
            return *CORNERS[token], _without(tokens, {token})
    # Otherwise the axle and the side are two words, such as "front" and "left".
    both = set(tokens)
    sides = {"l": both & LEFT, "r": both & (RIGHT - {"r"})}
    axles = {"front": both & FRONT, "rear": both & REAR, "mid": both & MIDDLE}
    side = next((name for name, words in sides.items() if words), "")
    axle = next((name for name, words in axles.items() if words), "")
    # The letter r is right, unless another word states the side; then r is the axle (rear).
    if "r" in both:
        side, axle = (side or "r", axle) if axle or not side else (side, "rear")
    # An axle without a side does not identify a wheel.
    if not side:
        axle = ""
    used = set().union(*sides.values(), *(axles.values() if axle else ()), {"r"} if side else set())
    # Without a word for the axle, a number of one or two digits is the number of the wheel.
    numbers = [token for token in tokens if token.isdigit() and len(token) < 3]
    if not axle and numbers:
        return numbers[-1], side, _without(tokens, used | {numbers[-1]})
    return axle, side, _without(tokens, used)


def _without(tokens: tuple[str, ...], used: set[str]) -> tuple[str, ...]:
    """Return the words of `tokens` that are not in `used`, in their order."""
    return tuple(token for token in tokens if token not in used)
