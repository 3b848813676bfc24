"""What a drive log declares against what its runs show: soil and motor left out, the start, the ground's ends."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rover_pin.base.quantity import Record, quantities, record_from
from rover_pin.contact import Wheel
from rover_pin.estimation.wording import NOISE_LIKE
from rover_pin.experiments.drive_log.checks.driven import Driven, Remarks, degrees
from rover_pin.experiments.drive_log.model import is_rate_driven, usual_soil
from rover_pin.experiments.drive_log.readings.outliers import white_noise_sd
from rover_pin.logs.declared_noise import NOISE, kind_of
from rover_pin.logs.drive_log import FILE, DriveLog
from rover_pin.measurements.checks import Finding
from rover_pin.simulation.model.defaults import own_motor
from rover_pin.terrain.files import LARGEST

SOIL = ("phi", "k", "k_1")
MOTOR = ("supply", "resistance", "k_t", "gear")
"""What a loop needs most of a soil and of a motor."""

FIRST = 0.3
"""Time at the beginning of a run [s] whose mean place is held against its declared start. Why: several samples of 10
Hz, before the rover is under way (assumed)."""

NEAR, NEARLY = 0.03, math.radians(6.0)
"""Distance [m] and angle [rad] from which the start is named."""

FAR, FARTHER = 0.25, math.radians(30.0)
"""Distance [m] and angle [rad] from which start and tracker have other axes. Why: about a rover's length (assumed)."""


FAR_OFF = 10.0 * LARGEST
"""Coordinate [m] that is on no declared ground. Why: grids of maps begin hundreds of kilometres away."""

OTHER_WHEEL = 0.02
"""Relative difference of a declared wheel's radius or width from the rover's that is no rounding. Why: 0.1 mm of the
smallest wheels' 5 mm; lengths are stated to three digits."""


def rover_faults(log: DriveLog) -> Iterator[Finding]:
    """Yield wheels that the log has and the rover has not, or the other way, and wheels of another size."""
    rover = log.load_rover()
    rover_wheels = tuple(wheel.name for wheel in rover.wheels)
    if set(rover_wheels) != set(log.metadata.wheels):
        named = ", ".join(log.metadata.wheels)
        what = f"wheels are {named}, but those of the rover '{rover.name}' {', '.join(rover_wheels)}"
        yield Finding(what, FILE, "give the rover that was driven, and name wheels and columns as it does")
    for name in ("r", "b"):
        if name in log.metadata.wheel:
            size = float(getattr(record_from(Wheel, {name: log.metadata.wheel[name]}, f"{log.file}: [wheel]"), name))
            actual = float(getattr(rover.wheel, name))
            if abs(size - actual) > OTHER_WHEEL * actual:
                what = f"[wheel] has {name} = {1e3 * size:.4g} mm, but the rover '{rover.name}' {1e3 * actual:.4g} mm"
                yield Finding(what, FILE, "the rover's is driven: mend the one that is wrong")


def declared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield soil and motor constants that the log leaves to the package's assumptions."""
    rover = log.load_rover()
    kinds: list[tuple[str, Mapping[str, Any], tuple[str, ...], Record]] = [
        ("soil", log.metadata.soil, SOIL, usual_soil(rover)),
        ("motor", log.metadata.motor, MOTOR, own_motor(rover).value),
    ]
    for title, table, names, record in kinds[:1] if is_rate_driven(log) else kinds:
        undeclared = [name for name in names if name not in table]
        if undeclared:
            what = f"[{title}] does not declare {', '.join(undeclared)}, so {_values(record, undeclared)} are assumed"
            yield Finding(what, FILE, f"a wrong {title} may pass for a missing effect: declare what you know of it")
    yield from _noise_findings(log)


def _noise_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield kinds of channels whose samples scatter by much more than `[noise]` declares, the worst channel of each."""
    noise_sd = log.noise_sd
    worst: dict[str, tuple[float, str, str]] = {}
    for run in log.runs:
        for name in (channel for channel in run.channels if kind_of(channel) in noise_sd):
            kind, scatter = kind_of(name), (white_noise_sd(run[name]), name, str(run.attrs["file"]))
            worst[kind] = max(worst.get(kind, scatter), scatter)
    for kind, (sd, name, where) in worst.items():
        if sd > NOISE_LIKE * noise_sd[kind]:
            what = f"[noise] declares {kind} = {noise_sd[kind]:.3g} {NOISE[kind]}, but {name} scatters by {sd:.3g}"
            yield Finding(what, where, "mend [noise]: the samples' scatter is taken where it is more")


def _values(record: Record, names: list[str]) -> str:
    specs = quantities(record)
    return ", ".join(f"{float(getattr(record, name)):.4g} {specs[name].unit}".strip() for name in names)


def start_faults(run: Driven) -> Remarks:
    """Yield a declared start that is elsewhere than where the tracker first sees the rover."""
    yield from _off_by(
        FAR, FARTHER, run, "give start in the axes and units of body_x, body_y and body_yaw, or leave it out"
    )


def start_findings(run: Driven) -> Remarks:
    """Yield a declared start that is a little off from where the tracker first sees the rover."""
    yield from _off_by(NEAR, NEARLY, run, "the first seconds suffer: mend start, or leave it out")


def _off_by(distance: float, angle: float, run: Driven, todo: str) -> Remarks:
    off, turn = _off_start(run)
    if off > distance or turn > angle:
        yield f"the declared start is {1e3 * off:.3g} mm and {degrees(turn)} off from the first tracked pose", todo


def _off_start(run: Driven) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] from the declared start to the first tracked poses; 0 without."""
    start, trace = run.trace.attrs.get("start"), run.trace
    if not start:
        return 0.0, 0.0
    first = trace.t <= trace.t[0] + FIRST
    x, y, yaw = (trace[f"body_{name}"][first] for name in ("x", "y", "yaw"))
    place = (x - start.get("x", 0.0)) + 1j * (y - start.get("y", 0.0))
    heading = np.exp(1j * (yaw - start.get("yaw", 0.0)))
    place, heading = place[np.isfinite(place)], heading[np.isfinite(heading)]
    off = float(np.abs(place.mean())) if place.size else 0.0
    return off, abs(float(np.angle(heading.mean()))) if heading.size else 0.0


def far_faults(run: Driven) -> Remarks:
    """Yield a place far from where any ground is described, as of a map's grid."""
    for name in ("body_x", "body_y", "body_z"):
        values = run.finite(name)
        middle = float(np.median(values)) if values.size else 0.0
        if abs(middle) > FAR_OFF:
            todo = f"give metres from an origin on the declared ground, which lies within {LARGEST:g} m of 0"
            yield f"{name} is {middle:.3g} m in the median", todo


def ground_findings(run: Driven) -> Remarks:
    """Yield how far the rover goes beyond what is declared of the ground."""
    if run.declared.terrain is None:
        return
    box = run.declared.terrain.extent
    for axis, low, high in (("x", box.x_low, box.x_high), ("y", box.y_low, box.y_high)):
        values = run.finite(f"body_{axis}")
        overshoot = float(np.max(np.maximum(low - values, values - high), initial=0.0))
        if overshoot > 0.0:
            what = (
                f"body_{axis} goes {overshoot:.3g} m beyond the declared ground, which spans {low:.4g} to {high:.4g} m"
            )
            yield what, "what lies there is guessed: extend the terrain's file"
