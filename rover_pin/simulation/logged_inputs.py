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


def is_uneven(t: np.ndarray) -> bool:
    """Return whether every tenth time between rows differs from the usual one by more than UNEVEN."""
    dt = np.diff(t)
    return bool(np.quantile(np.abs(dt / np.median(dt) - 1.0), 0.9) > UNEVEN)


def duty_between(t: np.ndarray, duty: np.ndarray) -> np.ndarray:
    """Return the duties (T, wheels) that act from the row before to each row."""
    return np.concatenate([duty[:1], (duty[1:] + duty[:-1]) / 2.0]) if is_uneven(t) else duty
