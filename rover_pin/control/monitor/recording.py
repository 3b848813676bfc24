"""A recorded drive put before the monitor, sample by sample."""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.control.monitor.monitor import Forecast, Monitor
from rover_pin.control.torque_factor import torque_factors
from rover_pin.simulation.command import Reading, Truth
from rover_pin.simulation.compiled.suspension import joints_of
from rover_pin.simulation.model.cruise import CRUISE_SLIP
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace

LONGEST_GAP = 1.0
"""Gap between rows [s] across which nothing is interpolated: the monitor begins anew."""
TURNING = 0.1
"""Share of the fastest rims [-] from which a row counts as driving."""


class Recorded(NamedTuple):
    """What the monitor reads of a recording, resampled to its period; the rest is what was assumed."""

    t: np.ndarray
    rates: np.ndarray
    currents: np.ndarray
    duties: np.ndarray
    suspension: np.ndarray
    attitude: np.ndarray
    begins: np.ndarray
    "whether a sample is the first after a gap"
    assumed: tuple[str, ...]

    def readings(self) -> Iterator[Reading]:
        """Yield a reading a sample; its truth is NaN."""
        wheels, place = np.full(self.rates.shape[1], np.nan), np.full(3, np.nan)
        nothing = Truth(wheels, wheels, wheels, wheels, place, place)
        rows = zip(self.t, self.duties, self.rates, self.currents, self.suspension, self.attitude, strict=True)
        for t, duty, rate, current, angles, (roll, pitch) in rows:
            yield Reading(float(t), duty, rate, current, angles, (float(roll), float(pitch), 0.0), nothing)


def monitor_input(trace: Trace, model: Model, period: float, has_scale: bool = True) -> Recorded:
    """Return what the monitor reads of a drive log's run: wheel rates, currents, roll and pitch are needed.

    Duties that were not logged are those of the motor's law, so that a motor's fault does not show. Suspension angles
    that were not logged are 0, so that walls do not show. Where the currents' scale is unknown (`has_scale`) it is that
    at which the rover, on the whole, pulls what slope and resistance ask of it.

    Raises DataError: a channel that is needed was not recorded, or holds no number.
    """
    wheels, raw = [mount.name for mount in model.rover.wheels], not _has(trace, model, "current_{}_A")
    currents = [f"raw_current_{wheel}" if raw else f"current_{wheel}_A" for wheel in wheels]
    if raw and not all(name in trace for name in currents):
        currents = [f"current_{wheel}_A" for wheel in wheels]
    trace.need(*(f"wheel_rate_{wheel}" for wheel in wheels), *currents, "body_roll", "body_pitch")
    t = np.arange(trace.t[0], trace.t[-1], period)

    def sample_channel(name: str) -> np.ndarray:
        finite = np.isfinite(trace[name])
        if not finite.any():
            raise DataError(f"{trace.attrs.get('file', 'run')}: channel {name} holds no number: the monitor needs it.")
        return np.interp(t, trace.t[finite], trace[name][finite])

    rates = np.column_stack([sample_channel(f"wheel_rate_{wheel}") for wheel in wheels])
    amperes = np.column_stack([sample_channel(name) for name in currents])
    attitude = np.column_stack([sample_channel("body_roll"), sample_channel("body_pitch")])
    assumed = []
    if raw or not has_scale:
        scale = current_scale(model, rates, amperes, attitude[:, 1])
        amperes = scale * amperes
        assumed.append(
            f"the currents' scale is unknown: {scale:.3g} A for 1, at which the pull fits slope and resistance"
        )
    duties = rates / float(model.motor.no_load_rate) + amperes * float(model.motor.resistance / model.motor.supply)
    if _has(trace, model, "duty_{}"):
        duties = np.column_stack([sample_channel(f"duty_{wheel}") for wheel in wheels])
    else:
        assumed.append("duties were not logged: they are the motor's law's, so that a motor's fault does not show")
    angles = joints_of(model.rover)[2]
    suspension = np.column_stack(
        [sample_channel(name) if name in trace else 0.0 * t for name in angles] or [t[:, None][:, :0]]
    )
    if missing := [name for name in angles if name not in trace]:
        assumed.append(f"not logged, so taken for 0: {', '.join(missing)}; walls do not show then")
    gaps = trace.t[1:][np.diff(trace.t) > LONGEST_GAP]
    begins = np.zeros(len(t), dtype=bool)
    begins[np.minimum(np.searchsorted(t, gaps), len(t) - 1)] = bool(gaps.size)
    return Recorded(t, rates, amperes, duties, suspension, attitude, begins, tuple(assumed))


def current_scale(model: Model, rates: np.ndarray, currents: np.ndarray, pitch: np.ndarray) -> float:
    """Return the factor on currents at which sum T / r over the weight is tan(nose-up) and T / (r W) of S = 0.05.

    Both as medians over the rows in which the rims turn forwards.
    """
    radii, weight = model.built.radii, model.built.mass * model.built.gravity
    rims = np.median(radii * rates, axis=1)
    drives = rims > TURNING * max(float(rims.max()), 1e-9)
    pull = (currents * float(model.motor.constant) / radii).sum(axis=1) / weight
    needed = float(torque_factors(model, [CRUISE_SLIP])[0]) - np.tan(pitch)
    median = float(np.median(np.abs(pull[drives]))) if drives.any() else 0.0
    return max(float(np.median(needed[drives])), 1e-3) / median if median > 0.0 else 1.0


def forecasts_of(monitor: Monitor, run: Recorded) -> list[Forecast]:
    """Return a forecast a sample."""
    forecasts = []
    monitor.reset()
    for reading, begins in zip(run.readings(), run.begins, strict=True):
        if begins:
            monitor.reset()
        forecasts.append(monitor.step(reading))
    return forecasts


def alarms(forecasts: list[Forecast]) -> list[tuple[float, float, float, float, str]]:
    """Return begin and end [s] of each alarm, its greatest P(stuck) and P(buried), and its most frequent cause."""
    spans = (list(span) for raised, span in groupby(forecasts, lambda forecast: forecast.alarm) if raised)
    return [
        (
            span[0].t,
            span[-1].t,
            max(forecast.p_stuck for forecast in span),
            max(forecast.p_buried for forecast in span),
            Counter(forecast.cause for forecast in span).most_common(1)[0][0],
        )
        for span in spans
    ]


def _has(trace: Trace, model: Model, pattern: str) -> bool:
    return all(pattern.format(mount.name) in trace for mount in model.rover.wheels)
