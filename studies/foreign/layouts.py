"""One drive in one of very many layouts: each property is drawn alone, so that a seed gives what nobody chose."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from foreign.drive import CORNERS, HALF, Drive, R
from foreign.names import CORNERS as PLACES
from foreign.names import LANGUAGES, SIDES, parted

DEG = math.pi / 180.0
EPOCH = 1_713_880_000
"""[s] since 1970."""
UNITS = {"rad/s": 1.0, "rpm": 30.0 / math.pi, "deg/s": 1.0 / DEG, "rev/s": 0.5 / math.pi, "m/s": R, "mm/s": 1e3 * R}
"""What 1 rad/s is in them."""
SUFFIX = {"rad/s": "rad_s", "rpm": "rpm", "deg/s": "deg_s", "rev/s": "rps", "m/s": "mps", "mm/s": "mm_s", "A": "A",
          "mA": "mA", "m": "m", "mm": "mm", "cm": "cm", "rad": "rad", "deg": "deg", "s": "s", "ms": "ms", "us": "us",
          "ns": "ns", "%": "pct"}  # fmt: skip


class Layout(NamedTuple):
    """A table as its owner writes it, and what its columns truly are."""

    columns: dict[str, Any]
    units: dict[str, str]
    "those that the owner says"
    truth: dict[str, np.ndarray]
    "channels of a drive log in SI that the table holds"
    habits: dict[str, str]
    clock: tuple[str, ...] = ()
    "columns that run on where the rover stands"


class _Writer:
    def __init__(self, random: np.random.Generator, seen: Drive):
        self.random, self.seen = random, seen
        self.language = str(random.choice(list(LANGUAGES), p=[0.56, 0.14, 0.1, 0.1, 0.1]))
        self.words = LANGUAGES[self.language]
        self.notation = str(random.choice(["none", "square", "round", "suffix"], p=[0.35, 0.25, 0.15, 0.25]))
        self.columns: dict[str, Any] = {}
        self.units: dict[str, str] = {}
        self.truth: dict[str, np.ndarray] = {}
        self.habits = {"language": self.language, "units": self.notation}

    def pick(self, *options: Any, p: Any = None) -> Any:
        return options[int(self.random.choice(len(options), p=p))]

    def word(self, kind: str) -> str:
        return str(self.pick(*self.words[kind]))

    def put(self, name: str, values: Any, unit: str = "") -> None:
        if self.notation == "none" or not unit:
            pass
        elif self.notation == "suffix":
            name = f"{name}_{SUFFIX[unit]}"
        else:
            name += f" [{unit}]" if self.notation == "square" else f" ({unit})"
        self.columns[name] = values
        self.units[name] = unit


def layout(random: np.random.Generator, seen: Drive) -> Layout:
    """Return a drive in a layout drawn at random."""
    own = _Writer(random, seen)
    _clock(own)
    clock = tuple(own.columns)
    for part in (_place, _tilt, _wheels, _motors, _beside):
        part(own)
    return Layout(own.columns, own.units, own.truth, own.habits, clock)


def _clock(own: _Writer) -> None:
    kind = own.pick("s", "epoch s", "ms", "us", "epoch ns", "iso", "underscored", "colons", "two columns", "counter",
                    "counter beside", "time of day", p=[0.18, 0.1, 0.13, 0.06, 0.1, 0.07, 0.07, 0.06, 0.07, 0.05, 0.06,
                                                        0.05])  # fmt: skip
    own.habits["clock"], t, name = kind, own.seen.t, own.word("clock")
    rows = np.arange(len(t)) + int(own.random.integers(0, 500))
    if kind.startswith("counter"):
        own.put(own.word("counter"), rows)
    if kind in ("s", "counter beside"):
        own.put(name, t + float(own.random.uniform(0.0, 50.0)) * own.random.integers(0, 2), "s")
    elif kind == "epoch s":
        own.put(name, EPOCH + t, "s")
    elif kind in ("ms", "us"):
        own.put(name, np.round((1e3 if kind == "ms" else 1e6) * (t + own.random.integers(0, 100))).astype(int), kind)
    elif kind == "epoch ns":
        own.put(name, EPOCH * 10**9 + np.round(1e9 * t).astype(np.int64), "ns")
    elif kind == "two columns":
        stamp = own.pick("header.stamp.", "stamp_", "field.header.stamp.")
        ends = own.pick(("sec", "nanosec"), ("secs", "nsecs"))
        own.put(stamp + ends[0], EPOCH + t.astype(int))
        own.put(stamp + ends[1], np.round(1e9 * (t % 1.0)).astype(int))
    elif kind != "counter":
        stamps = np.datetime64(EPOCH, "s") + np.round(1e3 * t).astype("timedelta64[ms]")
        texts = [str(each) for each in stamps.astype("datetime64[ms]")]
        form = {
            "iso": lambda text: text + "Z",
            "underscored": lambda text: text.replace("-", "_").replace("T", "_").replace(":", "_").replace(".", "_"),
            "colons": lambda text: text.replace("-", ":", 1).replace("T", " "),
            "time of day": lambda text: text[11:],
        }[kind]
        own.put(name, [form(text) for text in texts])


def _place(own: _Writer) -> None:
    seen = own.seen
    frame = own.pick("usual", "north east down", "y up", "utm", "geo", p=[0.5, 0.14, 0.1, 0.1, 0.16])
    own.habits["frame"] = frame
    own.truth |= {"body_x": seen.x, "body_y": seen.y, "body_z": seen.z}
    unit = own.pick("m", "mm", "cm", p=[0.75, 0.2, 0.05]) if frame not in ("utm", "geo") else "m"
    own.habits["length"] = unit
    scale = {"m": 1.0, "mm": 1e3, "cm": 1e2}[unit]
    if frame == "geo":
        north, east = 48.1 + seen.y / 111_200.4, 11.5 + seen.x / 74_514.4
        lat, lon, up = parted(own.word("geo"))
        own.put(lat, np.round(north, 9))
        own.put(lon, np.round(east, 9))
        own.put(up, 520.0 + seen.z, "m")
    elif frame == "utm":
        e, n, up = parted(own.word("utm"))
        own.put(e, 691_000.0 + seen.x, "m")
        own.put(n, 5_331_000.0 + seen.y, "m")
        own.put(up, 520.0 + seen.z, "m")
    else:
        names = parted(own.word("place"))
        axes = {
            "usual": (seen.x, seen.y, seen.z),
            "north east down": (seen.x, -seen.y, -seen.z),
            "y up": (seen.x, seen.z, -seen.y),
        }[frame]
        for name, values in zip(names, axes, strict=True):
            own.put(name, scale * values, unit)
    _heading(own, frame)


def _heading(own: _Writer, frame: str) -> None:
    seen = own.seen
    kind = own.pick("angle", "quaternion", "none", p=[0.62, 0.2, 0.18])
    if frame in ("north east down", "y up") and kind == "quaternion":
        kind = "angle"
    own.habits["heading"] = kind
    own.truth["body_yaw"] = seen.yaw
    if kind == "quaternion":
        real_first = bool(own.random.integers(0, 2))
        style = own.pick("q{}", "orientation.{}", "quat_{}", "pose.orientation.{}", "numbers")
        own.habits["quaternion"] = ("w first" if real_first else "w last") + f", {style}"
        x, y, z, w = _quaternion(seen)
        order = (w, x, y, z) if real_first else (x, y, z, w)
        letters = "0123" if style == "numbers" else "wxyz" if real_first else "xyzw"
        for letter, values in zip(letters, order, strict=True):
            own.put(("q{}" if style == "numbers" else style).format(letter), values)
    elif kind == "angle":
        unit = own.pick("rad", "deg", p=[0.45, 0.55])
        clockwise = frame == "north east down" or (frame in ("utm", "geo") and own.random.random() < 0.7)
        yaw = -seen.yaw if frame == "north east down" else 0.5 * math.pi - seen.yaw if clockwise else seen.yaw
        wrapped = np.mod(yaw, 2 * math.pi) if clockwise else np.angle(np.exp(1j * yaw))
        own.habits["angle"] = f"{unit}, {'clockwise' if clockwise else 'to the left'}"
        own.put(own.word("yaw"), wrapped / (DEG if unit == "deg" else 1.0), unit)


def _quaternion(seen: Drive) -> tuple[np.ndarray, ...]:
    (cy, sy), (cp, sp), (cr, sr) = (
        (np.cos(0.5 * each), np.sin(0.5 * each)) for each in (seen.yaw, seen.pitch, seen.roll)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _tilt(own: _Writer) -> None:
    kind = own.pick("none", "nose down", "nose up", p=[0.25, 0.4, 0.35])
    own.habits["pitch"] = kind
    own.truth |= {"body_pitch": own.seen.pitch, "body_roll": own.seen.roll}
    if kind != "none":
        unit = own.pick("rad", "deg")
        scale = 1.0 / DEG if unit == "deg" else 1.0
        own.put(own.word("pitch"), (-scale if kind == "nose up" else scale) * own.seen.pitch, unit)
        own.put(own.word("roll"), scale * own.seen.roll, unit)


def _wheels(own: _Writer) -> None:
    seen = own.seen
    kind = own.pick("each", "sides", "twist", "counts", "motor side", p=[0.68, 0.12, 0.07, 0.06, 0.07])
    places = own.habits["corners"] = own.word("corners")
    names = PLACES[places]
    own.habits["wheels"] = kind
    rates = seen.rates
    if kind == "twist":
        ahead, turn = R * rates.mean(axis=0), R * (rates[1] + rates[3] - rates[0] - rates[2]) / (4.0 * HALF)
        for name, values, unit in zip(parted(own.word("twist")), (ahead, turn), ("m/s", "rad/s"), strict=True):
            own.put(name, values, unit)
        rates = np.array([ahead - HALF * turn, ahead + HALF * turn] * 2) / R
    elif kind == "sides":
        left, right = 0.5 * (rates[0] + rates[2]), 0.5 * (rates[1] + rates[3])
        unit = own.pick("m/s", "rad/s", "rpm", p=[0.6, 0.2, 0.2])
        own.habits["rate unit"] = unit
        name = own.word("speed" if unit == "m/s" else "rate")
        for side, values in zip(SIDES[own.language], (left, right), strict=True):
            own.put(name.format(side), UNITS[unit] * values, unit)
        rates = np.array([left, right] * 2)
    elif kind == "counts":
        name = own.word("count")
        for place, values in zip(names, rates, strict=True):
            own.put(name.format(place), np.round(np.cumsum(values) * (seen.t[1] - seen.t[0]) * 613.0))
    else:
        unit = own.pick(*UNITS, p=[0.4, 0.3, 0.08, 0.04, 0.12, 0.06])
        unit = own.pick("rad/s", "rpm") if kind == "motor side" else unit
        gear = float(own.pick(19.2, 53.0, 71.0)) if kind == "motor side" else 1.0
        mirrored = own.random.random() < 0.2
        own.habits |= {"rate unit": unit, "gear": f"{gear:g}", "right side": "turned" if mirrored else "as left"}
        name = own.word("rate")
        for at, place in enumerate(names):
            sign = -1.0 if mirrored and at % 2 else 1.0
            own.put(name.format(place), sign * gear * UNITS[unit] * rates[at], unit)
    own.truth |= {f"wheel_rate_{corner}": rates[at] for at, corner in enumerate(CORNERS)}


def _motors(own: _Writer) -> None:
    names = PLACES[own.habits["corners"]]
    kind = own.habits["currents"] = own.pick("none", "A", "mA", "counts", p=[0.35, 0.35, 0.15, 0.15])
    own.truth |= {f"current_{corner}_A": own.seen.currents[at] for at, corner in enumerate(CORNERS)}
    if kind != "none":
        name, scale = own.word("current"), {"A": 1.0, "mA": 1e3, "counts": 27.0}[kind]
        for place, values in zip(names, own.seen.currents, strict=True):
            own.put(name.format(place), scale * values + (512.0 if kind == "counts" else 0.0),
                    "" if kind == "counts" else kind)  # fmt: skip
    kind = own.habits["duties"] = own.pick("none", "share", "percent", "of 255", p=[0.6, 0.15, 0.15, 0.1])
    own.truth |= {f"duty_{corner}": own.seen.duties[at] for at, corner in enumerate(CORNERS)}
    if kind != "none":
        name, scale = own.word("duty"), {"share": 1.0, "percent": 100.0, "of 255": 255.0}[kind]
        for place, values in zip(names, own.seen.duties, strict=True):
            own.put(name.format(place), scale * values, "%" if kind == "percent" else "")


def _beside(own: _Writer) -> None:
    """Columns that are something else."""
    seen, random = own.seen, own.random
    n = len(seen.t)
    noise = lambda size: size * random.standard_normal(n)  # noqa: E731
    speed = np.gradient(seen.x, seen.t), np.gradient(seen.y, seen.t)
    several = {
        "accelerometer": lambda: {
            own.pick("a_{}", "acc_{}", "imu.accel.{}", "lin_acc_{}").format(axis): values
            for axis, values in zip("XYZ", (9.81 * -seen.pitch, 9.81 * seen.roll, 9.81 + 0.0 * seen.t), strict=True)
        },
        "gyro": lambda: {f"gyro_{axis}": noise(0.005) + (seen.turn if axis == "z" else 0.0) for axis in "xyz"},
        "odometry": lambda: {"odom_x": 1.15 * (seen.x - seen.x[0]), "odom_y": 1.15 * (seen.y - seen.y[0])},
        "battery": lambda: {
            "battery_voltage": 24.0 + noise(0.05),
            "battery_current": np.abs(seen.currents).sum(0) + 0.8,
        },
        "commands": lambda: {f"cmd_{corner}": np.round(seen.rates[at]) for at, corner in enumerate(CORNERS)},
        "temperature": lambda: {f"motor_temp_{corner}": 31.0 + np.arange(n) * 1e-3 for corner in CORNERS},
        "speed": lambda: {"gps_speed": np.hypot(*speed)},
        "status": lambda: {"status": np.full(n, 3), "mode": ["auto"] * n},
        "target": lambda: {"goal_x": np.full(n, 8.0), "goal_y": np.full(n, -3.0)},
    }
    chosen = [name for name in several if random.random() < 0.25]
    own.habits["beside"] = " ".join(chosen)
    for name in chosen:
        for column, values in several[name]().items():
            own.put(column, values)
            if name in ("accelerometer", "gyro"):
                still = name == "gyro" and column[-1] != "z"
                own.truth[f"{name}_{column[-1].lower()}"] = 0.0 * seen.t if still else values
