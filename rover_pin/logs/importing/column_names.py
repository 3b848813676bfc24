"""What columns are called: words of English, German, French and Spanish for quantities, places, sides and units."""

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
    "m/s^2": "m/s^2", "m/s2": "m/s^2", "m/s²": "m/s^2", "mps2": "m/s^2", "g": "g",
    "%": "%", "pct": "%", "percent": "%", "prozent": "%", "in": "in",
    "a": "A", "amp": "A", "amps": "A", "ma": "mA", "v": "V", "volt": "V", "volts": "V", "mv": "mV",
}  # fmt: skip
"""Units as they are written, in small letters without blanks."""

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
"""Two letters of a corner; v and h are German, vorne and hinten, av and ar French."""

RATE = {"rate", "speed", "vel", "velocity", "omega", "rpm", "drehzahl", "raddrehzahl", "geschwindigkeit", "vitesse",
        "winkelgeschwindigkeit", "angvel", "angspeed", "w", "rot", "rotation", "spin", "velocidad", "velocita", "v",
        "qd"}  # fmt: skip
COUNT = {"enc", "encoder", "tick", "ticks", "count", "counts", "impulse", "codeur", "position", "pulses"}
"""Words of what a wheel has turned since some begin."""
CURRENT = {"current", "currents", "strom", "motorstrom", "courant", "corriente", "corrente", "amps", "i"}
DUTY = {"duty", "pwm", "dutycycle", "tastgrad", "tastverhaeltnis"}
STEER = {"steer", "steering", "lenk", "lenkung", "lenkwinkel", "braquage", "direction", "corner"}
NO_WHEEL = {"temp", "temperature", "temperatur", "voltage", "spannung", "torque", "effort", "force", "kraft", "power",
            "imu", "gyro", "angular", "gps", "body", "odom", "linear", "twist", "acc", "accel", "q", "quat", "slip",
            "quaternion", "orientation", "battery", "cov", "covariance", "std", "err", "error", "mag"}  # fmt: skip
"""Words of columns that are neither rates nor counts of wheels."""
COMMAND = {"cmd", "command", "commanded", "soll", "setpoint", "desired", "des", "target", "ref", "reference", "goal",
           "request", "requested", "consigne"}  # fmt: skip
ODOMETRY = {"odom", "odometry", "odo", "odometrie", "wheelodom"}
MEASURED = {"gt", "truth", "tracker", "mocap", "vicon", "optitrack", "qualisys", "leica", "station", "gps",
            "gnss", "rtk", "vrpn", "camera", "slam", "vo", "vio", "utm"}  # fmt: skip
"""Words of a pose that was measured from outside."""
TIME = {"t", "time", "zeit", "zeitstempel", "timestamp", "stamp", "temps", "horodatage", "tiempo", "marca", "tempo",
        "epoch", "clock", "elapsed", "sec", "rosbagtimestamp"}  # fmt: skip
X = {"x", "easting", "east", "ost", "rechtswert", "px", "xpos", "posx", "e", "este", "est"}
Y = {"y", "northing", "north", "nord", "hochwert", "py", "ypos", "posy", "n", "norte"}
UP = {"height", "hoehe", "altitude", "alt", "elevation", "hauteur", "up", "altura", "altitud", "quota"}
Z = UP | {"z", "pz", "zpos", "posz"}
AXES = {"x", "y", "z", "px", "py", "pz", "xpos", "ypos", "zpos", "posx", "posy", "posz"}
"""Words of axes that leave open which way they point."""
NO_PLACE = {"vel", "velocity", "speed", "acc", "accel", "acceleration", "beschleunigung", "gyro", "gyr", "imu", "ang",
            "angular", "mag", "magnetic", "magnetometer", "q", "quat", "quaternion", "orientation", "force", "kraft",
            "torque", "cov", "covariance", "std", "sigma", "error", "err", "linear", "twist", "a",
            "geschwindigkeit", "wheel", "rate", "sd", "rpy", "euler", "vitesse", "velocidad", "velocita"}  # fmt: skip
ROLL = {"roll", "rollwinkel", "wanken", "wankwinkel", "roulis", "phi", "alabeo", "rollen", "rollio"}
PITCH = {"pitch", "nick", "nicken", "nickwinkel", "tangage", "cabeceo", "tilt", "beccheggio"}
YAW = {"yaw", "heading", "hdg", "gier", "gieren", "gierwinkel", "kurs", "azimuth", "azimut", "psi", "theta", "course",
       "cog", "bearing", "lacet", "rumbo", "cap", "orientation", "guinada", "imbardata"}  # fmt: skip
COMPASS = {"heading", "hdg", "kurs", "azimuth", "azimut", "course", "cog", "bearing", "rumbo", "cap"}
"""Words of angles that are often counted clockwise from north."""
NO_ANGLE = {"rate", "gyro", "vel", "velocity", "speed", "dot", "omega", "angular", "std", "cov", "cmd", "error", "acc"}
LATITUDE = {"lat", "latitude", "breite", "breitengrad", "latitud", "latitudine"}
LONGITUDE = {"lon", "lng", "long", "longitude", "laenge", "laengengrad", "longitud", "longitudine"}
TURN = {"yawrate", "gierrate", "omega", "wz", "turn", "drehrate"}
AHEAD = {"v", "vx", "speed", "velocity", "geschwindigkeit", "vitesse", "linear"}
BATTERY = {"battery", "batterie", "akku", "vbat", "ubat", "bus", "supply"}
ONE_LETTER = {"m": X | Y | Z | {"pos", "position"}, "s": TIME, "v": BATTERY | {"voltage", "spannung"}, "a": CURRENT,
              "g": {"acc", "accel", "accelerometer"}}  # fmt: skip
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
    if not unit and len(tokens) > 2 and "/".join(tokens[-2:]) in UNITS:
        unit, tokens = UNITS["/".join(tokens[-2:])], tokens[:-2]
    if not unit and len(tokens) > 1 and tokens[-1] in UNITS and _ends_in_unit(tokens):
        unit, tokens = UNITS[tokens[-1]], tokens[:-1]
    if not unit and "rpm" in tokens:
        unit = "rpm"
    return Word(name, tuple(tokens), unit)


def _tokens(text: str) -> list[str]:
    text = re.sub(r"m([AV])$", lambda unit: unit[0].lower(), text)
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


def corner(tokens: tuple[str, ...]) -> tuple[str, str, tuple[str, ...]]:
    """Return where a wheel is, ('front' | 'mid' | 'rear' | a number | '', 'l' | 'r' | ''), and the other words.

    The last number is the wheel's; `r` is right, or rear where a side stands beside it.
    """
    for token in reversed(tokens):
        if token in CORNERS:
            return *CORNERS[token], _without(tokens, {token})
    both = set(tokens)
    sides = {"l": both & LEFT, "r": both & (RIGHT - {"r"})}
    axles = {"front": both & FRONT, "rear": both & REAR, "mid": both & MIDDLE}
    side = next((name for name, words in sides.items() if words), "")
    axle = next((name for name, words in axles.items() if words), "")
    if "r" in both:
        side, axle = (side or "r", axle) if axle or not side else (side, "rear")
    if not side:
        axle = ""
    used = set().union(*sides.values(), *(axles.values() if axle else ()), {"r"} if side else set())
    numbers = [token for token in tokens if token.isdigit() and len(token) < 3]
    if not axle and numbers:
        return numbers[-1], side, _without(tokens, used | {numbers[-1]})
    return axle, side, _without(tokens, used)


def _without(tokens: tuple[str, ...], used: set[str]) -> tuple[str, ...]:
    return tuple(token for token in tokens if token not in used)
