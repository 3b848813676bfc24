"""What a logged run really did, where its sensors misread: its place, the rates of its wheels, and its duties."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from rover_pin.simulation.model.model import Model


class Logged(Protocol):
    """The inputs of a replay as they were logged."""

    @property
    def t(self) -> np.ndarray:
        """Times [s] (T,)."""

    @property
    def place(self) -> np.ndarray:
        """x, y [m] and heading [rad] (T, 3)."""

    @property
    def rate(self) -> np.ndarray | None:
        """Wheel rates [rad/s] (T, wheels), where they are held."""


PLACE = ("body_x", "body_y", "body_yaw")
UNEVEN = 0.1
"""Share of the usual time between rows by which every tenth differs. Why: less moves a step by 0.01 s at 10 Hz."""
MISSED = 1.5
"""Times the usual time between rows from which one was not written, or very late. Why: half-way to the next."""


def true_inputs(model: Model, run: Logged) -> dict[str, np.ndarray]:
    """Return the place and the wheel rates, where they are held, of which the model's sensors read the logged."""
    channels = dict(zip(PLACE, run.place.T, strict=True))
    if run.rate is not None:
        channels |= {f"wheel_rate_{wheel.name}": run.rate[:, at] for at, wheel in enumerate(model.rover.wheels)}
    for sensor in reversed(model.sensor_effects):
        channels |= sensor.undo(run.t, channels)
    return channels


def rates_of(model: Model, channels: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the wheels' rates (T, wheels) [rad/s] among channels, of wheels that are tied together one."""
    return tied_means(model, np.column_stack([channels[f"wheel_rate_{wheel.name}"] for wheel in model.rover.wheels]))


def tied_means(model: Model, values: np.ndarray) -> np.ndarray:
    """Return values (T, wheels), of wheels that are tied together their mean: they have one rate and one motor.

    Held each to its own, noise of a second tachogenerator would be torques without bound that turn nothing.
    """
    column = {wheel.dof: at for at, wheel in enumerate(model.rover.wheels)}
    ties = [tie for tie in model.rover.couplings if tie.follower in column and tie.leader in column]
    means = values.copy()
    for leader in {tie.leader for tie in ties}:
        ratios = {column[leader]: 1.0} | {column[tie.follower]: tie.ratio for tie in ties if tie.leader == leader}
        group, ratio = list(ratios), np.array(list(ratios.values()))
        means[:, group] = ratio * (values[:, group] / ratio).mean(axis=1, keepdims=True)
    return means


def is_open(t: np.ndarray) -> np.ndarray:
    """Return between which rows (T - 1,) it is open when commands changed: all of uneven ones, and where some miss.

    Rows are uneven where every tenth time between them differs from the usual one by more than UNEVEN.
    """
    times = np.diff(t) / np.median(np.diff(t))
    return np.asarray((np.quantile(np.abs(times - 1.0), 0.9) > UNEVEN) | (times > MISSED))


def duty_before(t: np.ndarray, duty: np.ndarray, rows: np.ndarray, period: float) -> np.ndarray:
    """Return the mean duties (rows, wheels) in the period before each row, of logged ones (T, wheels).

    The duty of a logged row holds since the row before; where it is open when it changed, the mean of both does.
    """
    is_in_doubt = is_open(t)[:, None]
    if not is_in_doubt.any():
        return duty[np.searchsorted(t, rows - period / 2)]
    acting = np.concatenate([duty[:1], np.where(is_in_doubt, (duty[1:] + duty[:-1]) / 2.0, duty[1:])])
    begin = t[0] - period
    total = np.cumsum(acting * np.diff(t, prepend=begin)[:, None], axis=0)
    ends = [np.interp([rows - period, rows], [begin, *t], [0.0, *of_wheel]) for of_wheel in total.T]
    return np.column_stack([after - before for before, after in ends]) / period


def fill_gaps(row: np.ndarray) -> np.ndarray:
    """Return the row with gaps bridged by straight lines; zeros where nothing was measured."""
    good = np.flatnonzero(np.isfinite(row))
    return np.interp(np.arange(len(row)), good, row[good]) if good.size else np.zeros(len(row))


def means_at(t: np.ndarray, values: np.ndarray, rows: np.ndarray, period: float) -> np.ndarray:
    """Return the mean of the finite values within half a period of each row; not a number where rows are missing.

    A mean is of the mean time of its values, and between means a value is on a straight line.
    """
    at = np.rint((t - rows[0]) / period).astype(int)
    use = np.isfinite(values) & (at >= 0) & (at < len(rows))
    count, *sums = (np.bincount(at[use], weights, len(rows)) for weights in (None, t[use], values[use]))
    if not use.any():
        return np.full(len(rows), np.nan)
    time, mean = (total[count > 0] / count[count > 0] for total in sums)
    spacing = np.diff(t[use], prepend=-np.inf, append=np.inf)[np.searchsorted(t[use], rows)]
    return np.where((count > 0) | (spacing < MISSED * period), np.interp(rows, time, mean), np.nan)
