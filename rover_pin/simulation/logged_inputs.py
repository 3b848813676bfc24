"""Inputs of the replay of a logged run: true position, wheel rates and duties, computed from the log for rows at equal
time steps.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from rover_pin.simulation.model.model import Model


class ReplayInputs(Protocol):
    """The data of a logged run that the true inputs of its replay are computed from (`true_inputs`)."""

    @property
    def t(self) -> np.ndarray:
        """Times of the T rows (T,) [s]."""

    @property
    def place(self) -> np.ndarray:
        """Logged position x, y [m] and heading [rad] of the base (T, 3)."""

    @property
    def rate(self) -> np.ndarray | None:
        """Measured wheel rates (T, wheels) [rad/s] at which the wheels turn in the replay; None if the motors turn the
        wheels.
        """


PLACE = ("body_x", "body_y", "body_yaw")
UNEVEN_SHARE = 0.1
"""Limit for uneven logs. A time between two rows counts as uneven if it deviates from the median time by more than this
fraction of it. A log counts as uneven if at least a tenth of its times between rows are uneven; its commands may then
have changed at any time between two rows. Reason: a smaller deviation shifts a command by less than 0.01 s at 10 Hz."""
MISSING_ROW_RATIO = 1.5
"""Limit for gaps in a log. A row counts as missing if the time between two neighbouring rows exceeds this multiple of
the median time. The limit is the middle between the median time, at which no row is missing, and twice the median time,
at which one row is missing."""


def true_inputs(model: Model, run: ReplayInputs) -> dict[str, np.ndarray]:
    """Return the true values of position, heading and wheel rates of a logged run, as channel -> values (T,).

    The log holds readings of sensors. The sensor effects of the model (such as a scale or a delay) describe how the
    true values became these readings. The function undoes the effects in reverse order.
    """
    # Begin with the logged channels, and replace those that a sensor effect has changed.
    channels = dict(zip(PLACE, run.place.T, strict=True))
    if run.rate is not None:
        channels |= {f"wheel_rate_{wheel.name}": run.rate[:, at] for at, wheel in enumerate(model.rover.wheels)}
    for sensor in reversed(model.sensor_effects):
        channels |= sensor.undo(run.t, channels)
    return channels


def rates_of(model: Model, channels: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the wheel rates (T, wheels) [rad/s] as one array. `channels` maps the names of channels to their values
    (T,). Wheels that one motor drives together get the mean of their rates (`tied_means`).
    """
    return tied_means(model, np.column_stack([channels[f"wheel_rate_{wheel.name}"] for wheel in model.rover.wheels]))


def tied_means(model: Model, values: np.ndarray) -> np.ndarray:
    """Return wheel rates (T, wheels). Wheels that one motor drives together get the mean of their rates.

    If a replay held each of these wheels to its own measured rate, the noise of the tachogenerators would cause large
    opposing torques between the wheels. Before the mean, each rate is converted by the gear ratio of its coupling.
    """
    # Only couplings between two wheels count; other joints have no rate in a log.
    column = {wheel.dof: at for at, wheel in enumerate(model.rover.wheels)}
    ties = [tie for tie in model.rover.couplings if tie.follower in column and tie.leader in column]
    means = values.copy()
    for leader in {tie.leader for tie in ties}:
        # Each wheel's value is converted to its leader's rate before the mean, and back after it.
        ratios = {column[leader]: 1.0} | {column[tie.follower]: tie.ratio for tie in ties if tie.leader == leader}
        group, ratio = list(ratios), np.array(list(ratios.values()))
        means[:, group] = ratio * (values[:, group] / ratio).mean(axis=1, keepdims=True)
    return means


def is_open(t: np.ndarray) -> np.ndarray:
    """Return for each interval between two neighbouring rows (T - 1,) whether the time at which the command changed is
    unknown.

    If the rows of the log at the times `t` [s] are evenly spaced, a command changes at a row, so that the time is
    known. If the rows are uneven (UNEVEN_SHARE), or if a row is missing in the interval (MISSING_ROW_RATIO), the
    command may have changed at any time in the interval.
    """
    times = np.diff(t) / np.median(np.diff(t))
    return np.asarray((np.quantile(np.abs(times - 1.0), 0.9) > UNEVEN_SHARE) | (times > MISSING_ROW_RATIO))


def duty_before(t: np.ndarray, duty: np.ndarray, rows: np.ndarray, period: float) -> np.ndarray:
    """Return, for each row of a replay, the mean duty of each wheel in the period before this row (rows, wheels).

    Parameters
    ----------
    t, duty : arrays (T,) [s] and (T, wheels)
        Times and duties of the log. The duty of a row acts from the previous row until this row. If the time of the
        change is unknown (`is_open`), the mean of the duties of both rows acts in the interval between them.
    rows : array (rows,) [s]
        Times of the replay's rows.
    period : float
        Time between the replay's rows [s].
    """
    is_in_doubt = is_open(t)[:, None]
    if not is_in_doubt.any():
        return duty[np.searchsorted(t, rows - period / 2)]
    # `acting` is the duty in the interval before each row of the log: the duty of that row, or the mean of both rows if
    # the time of the change is unknown.
    acting = np.concatenate([duty[:1], np.where(is_in_doubt, (duty[1:] + duty[:-1]) / 2.0, duty[1:])])
    # Means over a period are differences of the running integral, which is linear between logged rows.
    begin = t[0] - period
    total = np.cumsum(acting * np.diff(t, prepend=begin)[:, None], axis=0)
    ends = [np.interp([rows - period, rows], [begin, *t], [0.0, *of_wheel]) for of_wheel in total.T]
    return np.column_stack([after - before for before, after in ends]) / period


def fill_gaps(row: np.ndarray) -> np.ndarray:
    """Return the values of a channel with each gap (NaN) filled by linear interpolation between its neighbours. If all
    values are NaN, the result is zero.
    """
    good = np.flatnonzero(np.isfinite(row))
    return np.interp(np.arange(len(row)), good, row[good]) if good.size else np.zeros(len(row))


def means_at(t: np.ndarray, values: np.ndarray, rows: np.ndarray, period: float) -> np.ndarray:
    """Return, for each row of a replay, the mean of the logged values within half a period of this row (rows,); NaN
    where logged rows are missing.

    The values of a log are means at times that differ from the times of the rows. The means are therefore interpolated
    linearly to the times of the rows. A steady motion is then reproduced exactly, wherever the rows of the log lie
    between the rows of the replay.

    Parameters
    ----------
    t, values : arrays (T,)
        Times [s] and values of a logged channel; values that are not finite are ignored.
    rows : array (rows,)
        Times of the replay's rows [s].
    period : float
        Time between the replay's rows [s].
    """
    # Assign each logged value to the nearest row of the replay, and compute mean time and mean value for each row.
    nearest = np.rint((t - rows[0]) / period).astype(int)
    use = np.isfinite(values) & (nearest >= 0) & (nearest < len(rows))
    count, *sums = (np.bincount(nearest[use], weights, len(rows)) for weights in (None, t[use], values[use]))
    if not use.any():
        return np.full(len(rows), np.nan)
    time, mean = (total[count > 0] / count[count > 0] for total in sums)
    # A row without values is interpolated only if the log has no gap around this row.
    spacing = np.diff(t[use], prepend=-np.inf, append=np.inf)[np.searchsorted(t[use], rows)]
    return np.where((count > 0) | (spacing < MISSING_ROW_RATIO * period), np.interp(rows, time, mean), np.nan)
