"""Write a drive in one of many table layouts. Each property is drawn alone, so that nobody chose the combination."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from foreign.drive import CORNERS, HALF, Drive, R
from foreign.names import CORNERS as PLACES
from foreign.names import LANGUAGES, SIDES, parted

DEG = math.pi / 180.0
EPOCH = 1_713_880_000
"""Start of every recording [s] since 1970."""
UNITS = {"rad/s": 1.0, "rpm": 30.0 / math.pi, "deg/s": 1.0 / DEG, "rev/s": 0.5 / math.pi, "m/s": R, "mm/s": 1e3 * R}
"""Unit of a wheel speed -> the value of 1 rad/s in this unit."""
SUFFIX = {"rad/s": "rad_s", "rpm": "rpm", "deg/s": "deg_s", "rev/s": "rps", "m/s": "mps", "mm/s": "mm_s", "A": "A",
          "mA": "mA", "m": "m", "mm": "mm", "cm": "cm", "rad": "rad", "deg": "deg", "s": "s", "ms": "ms", "us": "us",
          "ns": "ns", "%": "pct"}  # fmt: skip


class Layout(NamedTuple):
    """A simulated recording as a table in the layout of an invented owner, together with the true channels that its
    columns contain.
    """

    columns: dict[str, Any]
    units: dict[str, str]
    """Units that the owner states, by column."""
    truth: dict[str, np.ndarray]
    """The drive log's channels, in SI units, that the table contains."""
    habits: dict[str, str]
    clock: tuple[str, ...] = ()
    """Columns of the clock, such as a time or a row counter. While the rover is at rest, these columns continue to
    increase and all other columns keep their values."""


class _Writer:
    """A table under construction: random choices, columns, stated units, true channels and habits."""

    def __init__(self, random: np.random.Generator, recorded_drive: Drive):
        self.random, self.seen = random, recorded_drive
        self.language = str(random.choice(list(LANGUAGES), p=[0.56, 0.14, 0.1, 0.1, 0.1]))
        self.words = LANGUAGES[self.language]
        self.notation = str(random.choice(["none", "square", "round", "suffix"], p=[0.35, 0.25, 0.15, 0.25]))
        self.columns: dict[str, Any] = {}
        self.units: dict[str, str] = {}
        self.truth: dict[str, np.ndarray] = {}
        self.habits = {"language": self.language, "units": self.notation}

    def pick(self, *options: Any, p: Any = None) -> Any:
        """Return one of the options at random, with probabilities p if given."""
        return options[int(self.random.choice(len(options), p=p))]

    def word(self, kind: str) -> str:
        """Return one of the language's names for a kind of column."""
        return str(self.pick(*self.words[kind]))

    def put(self, name: str, values: Any, unit: str = "") -> None:
        """Add a column; the unit appears in its name as the notation requires."""
        # Without a notation of units, or for a column without unit, the bare name is used.
        if self.notation == "none" or not unit:
            pass
        elif self.notation == "suffix":
            name = f"{name}_{SUFFIX[unit]}"
        else:
            name += f" [{unit}]" if self.notation == "square" else f" ({unit})"
        self.columns[name] = values
        self.units[name] = unit


def layout(random: np.random.Generator, truth: Drive) -> Layout:
    """Return the drive in a layout that is drawn at random."""
    writer = _Writer(random, truth)
    _clock(writer)
    clock = tuple(writer.columns)
    for part in (_place, _tilt, _wheels, _motors, _beside):
        part(writer)
    return Layout(writer.columns, writer.units, writer.truth, writer.habits, clock)


def _clock(writer: _Writer) -> None:
    """Write the time: seconds, ticks, dates, two columns, a counter, or several of these."""
    kind = writer.pick("s", "epoch s", "ms", "us", "epoch ns", "iso", "underscored", "colons", "two columns", "counter",
                    "counter beside", "time of day", p=[0.18, 0.1, 0.13, 0.06, 0.1, 0.07, 0.07, 0.06, 0.07, 0.05, 0.06,
                                                        0.05])  # fmt: skip
    writer.habits["clock"], t, name = kind, writer.seen.t, writer.word("clock")
    # A frame counter starts at a random number, as in a part of a longer recording.
    rows = np.arange(len(t)) + int(writer.random.integers(0, 500))
    if kind.startswith("counter"):
        writer.put(writer.word("counter"), rows)
    if kind in ("s", "counter beside"):
        # Half of the clocks start at zero, half at another time.
        writer.put(name, t + float(writer.random.uniform(0.0, 50.0)) * writer.random.integers(0, 2), "s")
    elif kind == "epoch s":
        writer.put(name, EPOCH + t, "s")
    elif kind in ("ms", "us"):
        writer.put(
            name, np.round((1e3 if kind == "ms" else 1e6) * (t + writer.random.integers(0, 100))).astype(int), kind
        )
    elif kind == "epoch ns":
        writer.put(name, EPOCH * 10**9 + np.round(1e9 * t).astype(np.int64), "ns")
    elif kind == "two columns":
        stamp = writer.pick("header.stamp.", "stamp_", "field.header.stamp.")
        ends = writer.pick(("sec", "nanosec"), ("secs", "nsecs"))
        writer.put(stamp + ends[0], EPOCH + t.astype(int))
        writer.put(stamp + ends[1], np.round(1e9 * (t % 1.0)).astype(int))
    elif kind != "counter":
        stamps = np.datetime64(EPOCH, "s") + np.round(1e3 * t).astype("timedelta64[ms]")
        texts = [str(moment) for moment in stamps.astype("datetime64[ms]")]
        form = {
            "iso": lambda text: text + "Z",
            "underscored": lambda text: text.replace("-", "_").replace("T", "_").replace(":", "_").replace(".", "_"),
            "colons": lambda text: text.replace("-", ":", 1).replace("T", " "),
            "time of day": lambda text: text[11:],
        }[kind]
        writer.put(name, [form(text) for text in texts])


def _place(writer: _Writer) -> None:
    """Write the position: in metres or millimetres, in another frame, in UTM or as latitude and longitude."""
    truth = writer.seen
    frame = writer.pick("usual", "north east down", "y up", "utm", "geo", p=[0.5, 0.14, 0.1, 0.1, 0.16])
    writer.habits["frame"] = frame
    writer.truth |= {"body_x": truth.x, "body_y": truth.y, "body_z": truth.z}
    unit = writer.pick("m", "mm", "cm", p=[0.75, 0.2, 0.05]) if frame not in ("utm", "geo") else "m"
    writer.habits["length"] = unit
    scale = {"m": 1.0, "mm": 1e3, "cm": 1e2}[unit]
    if frame == "geo":
        # Metres for each degree of latitude and longitude at 48.1 deg north.
        north, east = 48.1 + truth.y / 111_200.4, 11.5 + truth.x / 74_514.4
        lat, lon, up = parted(writer.word("geo"))
        writer.put(lat, np.round(north, 9))
        writer.put(lon, np.round(east, 9))
        writer.put(up, 520.0 + truth.z, "m")
    elif frame == "utm":
        e, n, up = parted(writer.word("utm"))
        writer.put(e, 691_000.0 + truth.x, "m")
        writer.put(n, 5_331_000.0 + truth.y, "m")
        writer.put(up, 520.0 + truth.z, "m")
    else:
        names = parted(writer.word("place"))
        axes = {
            "usual": (truth.x, truth.y, truth.z),
            "north east down": (truth.x, -truth.y, -truth.z),
            "y up": (truth.x, truth.z, -truth.y),
        }[frame]
        for name, values in zip(names, axes, strict=True):
            writer.put(name, scale * values, unit)
    _heading(writer, frame)


def _heading(writer: _Writer, frame: str) -> None:
    """Write the heading as an angle or a quaternion, or omit it."""
    truth = writer.seen
    kind = writer.pick("angle", "quaternion", "none", p=[0.62, 0.2, 0.18])
    # In these frames a quaternion would need the rotated axes as well, so an angle replaces it.
    if frame in ("north east down", "y up") and kind == "quaternion":
        kind = "angle"
    writer.habits["heading"] = kind
    writer.truth["body_yaw"] = truth.yaw
    if kind == "quaternion":
        real_first = bool(writer.random.integers(0, 2))
        style = writer.pick("q{}", "orientation.{}", "quat_{}", "pose.orientation.{}", "numbers")
        writer.habits["quaternion"] = ("w first" if real_first else "w last") + f", {style}"
        x, y, z, w = _quaternion(truth)
        order = (w, x, y, z) if real_first else (x, y, z, w)
        letters = "0123" if style == "numbers" else "wxyz" if real_first else "xyzw"
        for letter, values in zip(letters, order, strict=True):
            writer.put(("q{}" if style == "numbers" else style).format(letter), values)
    elif kind == "angle":
        unit = writer.pick("rad", "deg", p=[0.45, 0.55])
        # Maps measure the course clockwise from north; the truth is counterclockwise from x.
        clockwise = frame == "north east down" or (frame in ("utm", "geo") and writer.random.random() < 0.7)
        yaw = -truth.yaw if frame == "north east down" else 0.5 * math.pi - truth.yaw if clockwise else truth.yaw
        wrapped = np.mod(yaw, 2 * math.pi) if clockwise else np.angle(np.exp(1j * yaw))
        writer.habits["angle"] = f"{unit}, {'clockwise' if clockwise else 'to the left'}"
        writer.put(writer.word("yaw"), wrapped / (DEG if unit == "deg" else 1.0), unit)


def _quaternion(truth: Drive) -> tuple[np.ndarray, ...]:
    """Return x, y, z, w of the attitude, from yaw, pitch and roll in this order."""
    # Cosine and sine of half the yaw, pitch and roll.
    (cy, sy), (cp, sp), (cr, sr) = (
        (np.cos(0.5 * turn_angle), np.sin(0.5 * turn_angle)) for turn_angle in (truth.yaw, truth.pitch, truth.roll)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _tilt(writer: _Writer) -> None:
    """Write pitch and roll, with the pitch positive nose down or nose up, or omit both."""
    kind = writer.pick("none", "nose down", "nose up", p=[0.25, 0.4, 0.35])
    writer.habits["pitch"] = kind
    writer.truth |= {"body_pitch": writer.seen.pitch, "body_roll": writer.seen.roll}
    if kind != "none":
        unit = writer.pick("rad", "deg")
        # The truth has the pitch positive with the nose down.
        scale = 1.0 / DEG if unit == "deg" else 1.0
        writer.put(writer.word("pitch"), (-scale if kind == "nose up" else scale) * writer.seen.pitch, unit)
        writer.put(writer.word("roll"), scale * writer.seen.roll, unit)


def _wheels(writer: _Writer) -> None:
    """Write the wheel speeds: for each wheel, for each side, as a twist, as encoder counts, or on the motor side."""
    truth = writer.seen
    kind = writer.pick("each", "sides", "twist", "counts", "motor side", p=[0.68, 0.12, 0.07, 0.06, 0.07])
    places = writer.habits["corners"] = writer.word("corners")
    names = PLACES[places]
    writer.habits["wheels"] = kind
    rates = truth.rates
    if kind == "twist":
        # Forward speed and yaw rate of the rims, by half the track.
        ahead, turn = R * rates.mean(axis=0), R * (rates[1] + rates[3] - rates[0] - rates[2]) / (4.0 * HALF)
        for name, values, unit in zip(parted(writer.word("twist")), (ahead, turn), ("m/s", "rad/s"), strict=True):
            writer.put(name, values, unit)
        rates = np.array([ahead - HALF * turn, ahead + HALF * turn] * 2) / R
    elif kind == "sides":
        left, right = 0.5 * (rates[0] + rates[2]), 0.5 * (rates[1] + rates[3])
        unit = writer.pick("m/s", "rad/s", "rpm", p=[0.6, 0.2, 0.2])
        writer.habits["rate unit"] = unit
        name = writer.word("speed" if unit == "m/s" else "rate")
        for side, values in zip(SIDES[writer.language], (left, right), strict=True):
            writer.put(name.format(side), UNITS[unit] * values, unit)
        rates = np.array([left, right] * 2)
    elif kind == "counts":
        name = writer.word("count")
        for place, values in zip(names, rates, strict=True):
            writer.put(name.format(place), np.round(np.cumsum(values) * (truth.t[1] - truth.t[0]) * 613.0))
    else:
        # A motor turns faster than its wheel by the gear ratio, which the table does not state.
        unit = writer.pick(*UNITS, p=[0.4, 0.3, 0.08, 0.04, 0.12, 0.06])
        unit = writer.pick("rad/s", "rpm") if kind == "motor side" else unit
        gear = float(writer.pick(19.2, 53.0, 71.0)) if kind == "motor side" else 1.0
        mirrored = writer.random.random() < 0.2
        writer.habits |= {"rate unit": unit, "gear": f"{gear:g}", "right side": "turned" if mirrored else "as left"}
        name = writer.word("rate")
        # Motors on the right are often mounted mirrored, so their rates have the opposite sign.
        for at, place in enumerate(names):
            sign = -1.0 if mirrored and at % 2 else 1.0
            writer.put(name.format(place), sign * gear * UNITS[unit] * rates[at], unit)
    writer.truth |= {f"wheel_rate_{corner}": rates[at] for at, corner in enumerate(CORNERS)}


def _motors(writer: _Writer) -> None:
    """Write motor currents and duties in their units, or omit them."""
    names = PLACES[writer.habits["corners"]]
    kind = writer.habits["currents"] = writer.pick("none", "A", "mA", "counts", p=[0.35, 0.35, 0.15, 0.15])
    writer.truth |= {f"current_{corner}_A": writer.seen.currents[at] for at, corner in enumerate(CORNERS)}
    # Counts have an offset and no unit, as from an analogue-to-digital converter.
    if kind != "none":
        name, scale = writer.word("current"), {"A": 1.0, "mA": 1e3, "counts": 27.0}[kind]
        for place, values in zip(names, writer.seen.currents, strict=True):
            writer.put(name.format(place), scale * values + (512.0 if kind == "counts" else 0.0),
                    "" if kind == "counts" else kind)  # fmt: skip
    kind = writer.habits["duties"] = writer.pick("none", "share", "percent", "of 255", p=[0.6, 0.15, 0.15, 0.1])
    writer.truth |= {f"duty_{corner}": writer.seen.duties[at] for at, corner in enumerate(CORNERS)}
    if kind != "none":
        name, scale = writer.word("duty"), {"share": 1.0, "percent": 100.0, "of 255": 255.0}[kind]
        for place, values in zip(names, writer.seen.duties, strict=True):
            writer.put(name.format(place), scale * values, "%" if kind == "percent" else "")


def _beside(writer: _Writer) -> None:
    """Write further columns that are no part of a drive log: inertial sensors, odometry, battery and others."""
    truth, random = writer.seen, writer.random
    n = len(truth.t)
    noise = lambda size: size * random.standard_normal(n)  # noqa: E731
    speed = np.gradient(truth.x, truth.t), np.gradient(truth.y, truth.t)
    # Each entry is a function, so that random numbers are drawn only for the chosen columns.
    several = {
        "accelerometer": lambda: {
            writer.pick("a_{}", "acc_{}", "imu.accel.{}", "lin_acc_{}").format(axis): values
            for axis, values in zip("XYZ", (9.81 * -truth.pitch, 9.81 * truth.roll, 9.81 + 0.0 * truth.t), strict=True)
        },
        "gyro": lambda: {f"gyro_{axis}": noise(0.005) + (truth.turn if axis == "z" else 0.0) for axis in "xyz"},
        "odometry": lambda: {"odom_x": 1.15 * (truth.x - truth.x[0]), "odom_y": 1.15 * (truth.y - truth.y[0])},
        "battery": lambda: {
            "battery_voltage": 24.0 + noise(0.05),
            "battery_current": np.abs(truth.currents).sum(0) + 0.8,
        },
        "commands": lambda: {f"cmd_{corner}": np.round(truth.rates[at]) for at, corner in enumerate(CORNERS)},
        "temperature": lambda: {f"motor_temp_{corner}": 31.0 + np.arange(n) * 1e-3 for corner in CORNERS},
        "speed": lambda: {"gps_speed": np.hypot(*speed)},
        "status": lambda: {"status": np.full(n, 3), "mode": ["auto"] * n},
        "target": lambda: {"goal_x": np.full(n, 8.0), "goal_y": np.full(n, -3.0)},
    }
    chosen = [name for name in several if random.random() < 0.25]
    writer.habits["beside"] = " ".join(chosen)
    for name in chosen:
        for column, values in several[name]().items():
            writer.put(column, values)
            # Only the inertial sensors are channels of a drive log; the other columns are distractions.
            if name in ("accelerometer", "gyro"):
                still = name == "gyro" and column[-1] != "z"
                writer.truth[f"{name}_{column[-1].lower()}"] = 0.0 * truth.t if still else values
