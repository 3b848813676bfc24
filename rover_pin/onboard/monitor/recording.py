"""Apply the monitor to a recorded drive: the recording is resampled, and the monitor gets one sample after another."""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.control.torque_factor import torque_factors
from rover_pin.onboard.monitor.monitor import Forecast, Monitor
from rover_pin.simulation.command import Reading, Truth
from rover_pin.simulation.model.cruise import CRUISE_SLIP
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import joints_of
from rover_pin.simulation.trace.trace import Trace

MAX_GAP = 1.0
"""Maximum gap between two rows of a recording that is interpolated [s]. After a longer gap, the monitor is reset."""
MIN_DRIVING_RATIO = 0.1
"""Minimum ratio of the rim speed to its maximum in the recording, for a row that counts as driving [-]. Other rows are
not used to find the scale of the currents."""


class MonitorInput(NamedTuple):
    """A recording that is resampled to the period of the monitor, and the assumptions about channels that were not
    recorded.
    """

    t: np.ndarray
    "time (samples,) [s]"
    rates: np.ndarray
    "wheel rates (samples, wheels) [rad/s]"
    currents: np.ndarray
    "motor currents (samples, wheels) [A]"
    duties: np.ndarray
    "duties (samples, wheels) [-]"
    suspension: np.ndarray
    "suspension angles (samples, joints) [rad]"
    attitude: np.ndarray
    "roll and pitch (samples, 2) [rad]"
    begins: np.ndarray
    """whether each sample is the first sample after a gap longer than `MAX_GAP` (samples,)"""
    assumed: tuple[str, ...]
    """the assumptions about channels that the recording lacks, one text for each"""

    def readings(self) -> Iterator[Reading]:
        """Yield one reading of the sensors for each sample. The true slips and speeds in the reading are NaN, because a
        recording does not contain them.
        """
        wheels, place = np.full(self.rates.shape[1], np.nan), np.full(3, np.nan)
        nothing = Truth(wheels, wheels, wheels, wheels, place, place)
        rows = zip(self.t, self.duties, self.rates, self.currents, self.suspension, self.attitude, strict=True)
        for t, duty, rate, current, angles, (roll, pitch) in rows:
            yield Reading(float(t), duty, rate, current, angles, (float(roll), float(pitch), 0.0), nothing)


def monitor_input(trace: Trace, model: Model, period: float, has_scale: bool = True) -> MonitorInput:
    """Return a run of a drive log as input for the monitor, resampled to equal time steps.

    Wheel rates, currents, roll and pitch must have been recorded. If the duties were not recorded, they follow from the
    law of the motor, and a faulty motor cannot be recognised. If the suspension angles were not recorded, they are set
    to 0, and walls cannot be recognised.

    Parameters
    ----------
    trace : Trace
        The run with its channels.
    model : Model
        Rover, soil and motor.
    period : float
        Time step of the monitor [s].
    has_scale : bool
        Whether the recorded currents are in A. If not, their scale is chosen so that the rover's mean pull equals slope
        and motion resistance (`current_scale`).

    Raises
    ------
    DataError
        A channel that is needed was not recorded, or has no finite value.
    """
    # Currents in A are preferred to raw currents, whose scale is unknown.
    wheels, raw = [mount.name for mount in model.rover.wheels], not _has(trace, model, "current_{}_A")
    currents = [f"raw_current_{wheel}" if raw else f"current_{wheel}_A" for wheel in wheels]
    if raw and not all(name in trace for name in currents):
        currents = [f"current_{wheel}_A" for wheel in wheels]
    trace.need(*(f"wheel_rate_{wheel}" for wheel in wheels), *currents, "body_roll", "body_pitch")
    # Every channel is interpolated from its finite values.
    t = np.arange(trace.t[0], trace.t[-1], period)

    def sample_channel(name: str) -> np.ndarray:
        finite = np.isfinite(trace[name])
        if not finite.any():
            raise DataError(
                f"{trace.attrs.get('file', 'run')}: channel {name} has no finite value, but the monitor needs "
                "this channel. Record it, or choose another run."
            )
        return np.interp(t, trace.t[finite], trace[name][finite])

    rates = np.column_stack([sample_channel(f"wheel_rate_{wheel}") for wheel in wheels])
    amperes = np.column_stack([sample_channel(name) for name in currents])
    attitude = np.column_stack([sample_channel("body_roll"), sample_channel("body_pitch")])
    assumed = []
    if raw or not has_scale:
        scale = current_scale(model, rates, amperes, attitude[:, 1])
        amperes = scale * amperes
        assumed.append(
            f"the scale of the currents is unknown; {scale:.3g} A per recorded unit is assumed, so that the pull "
            "equals slope and motion resistance"
        )
    # The law of the motor, i R = delta V - K omega, gives the duty if it was not recorded.
    duties = rates / float(model.motor.no_load_rate) + amperes * float(model.motor.resistance / model.motor.supply)
    if _has(trace, model, "duty_{}"):
        duties = np.column_stack([sample_channel(f"duty_{wheel}") for wheel in wheels])
    else:
        assumed.append(
            "the duties were not logged; they are computed by the law of the motor, so that a faulty motor is not "
            "recognised"
        )
    angles = joints_of(model.rover)[2]
    suspension = np.column_stack(
        [sample_channel(name) if name in trace else 0.0 * t for name in angles] or [t[:, None][:, :0]]
    )
    if missing := [name for name in angles if name not in trace]:
        assumed.append(f"{', '.join(missing)} were not logged; 0 is assumed, so that walls are not recognised")
    # The interpolation across a long gap is meaningless, so that the monitor starts again behind the gap.
    gaps = trace.t[1:][np.diff(trace.t) > MAX_GAP]
    begins = np.zeros(len(t), dtype=bool)
    begins[np.minimum(np.searchsorted(t, gaps), len(t) - 1)] = bool(gaps.size)
    return MonitorInput(t, rates, amperes, duties, suspension, attitude, begins, tuple(assumed))


def current_scale(model: Model, rates: np.ndarray, currents: np.ndarray, pitch: np.ndarray) -> float:
    """Return the factor [A per recorded unit] that turns recorded currents of unknown scale into currents in A.

    With this factor, the pull of the wheels balances the slope and the motion resistance. The factor is computed from
    the rows of forward driving: there, the median of sum(T / r) / W equals the median of tan(slope) plus the torque
    factor T / (r W) at the slip of a cruise. T is the torque of a wheel, r its radius, and W the weight of the rover.

    Parameters
    ----------
    model : Model
        Rover, soil and motor.
    rates, currents : array
        Wheel rates [rad/s] and recorded currents (samples, wheels).
    pitch : array
        Pitch of the body (samples,) [rad], positive with the nose down.
    """
    # Medians are used, because single rows may have an obstacle or a jump of the current.
    radii, weight = model.built.radii, model.built.mass * model.built.gravity
    rims = np.median(radii * rates, axis=1)
    drives = rims > MIN_DRIVING_RATIO * max(float(rims.max()), 1e-9)
    pull = (currents * float(model.motor.constant) / radii).sum(axis=1) / weight
    needed = float(torque_factors(model, [CRUISE_SLIP])[0]) - np.tan(pitch)
    median = float(np.median(np.abs(pull[drives]))) if drives.any() else 0.0
    return max(float(np.median(needed[drives])), 1e-3) / median if median > 0.0 else 1.0


def forecasts_of(monitor: Monitor, run: MonitorInput) -> list[Forecast]:
    """Return the forecasts of a monitor for a recording, one for each sample.

    The monitor is reset at the start and after each gap that is longer than `MAX_GAP`.
    """
    forecasts = []
    monitor.reset()
    for reading, begins in zip(run.readings(), run.begins, strict=True):
        if begins:
            monitor.reset()
        forecasts.append(monitor.step(reading))
    return forecasts


def alarms(forecasts: list[Forecast]) -> list[tuple[float, float, float, float, str]]:
    """Return one tuple for each alarm in a series of forecasts.

    The tuple has the times at which the alarm begins and ends [s], the highest P(stuck) and P(buried) during the alarm,
    and the most frequent cause.
    """
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
    """Return whether a trace has a channel for every wheel of a model. `pattern` is the name of the channel, with {} in
    the place of the wheel's name.
    """
    return all(pattern.format(mount.name) in trace for mount in model.rover.wheels)
