"""Motors and sensors that do not do what they say: readings that stand still, and motors off their own law."""

from __future__ import annotations

from collections import deque

import numpy as np

from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.motor import Motor

WINDOW = 20
"""Samples that are looked at together."""
RARE = 1e-3
"""Probability beforehand that a motor, or a sensor of a wheel, is at fault (assumed)."""
MOTOR_SD, NOISE = 0.05, 0.02
"""Error of the motor's law: share of its largest term, and of the stall current (assumed: gears, windings, noise)."""
TURNS = 0.05
"""Duty above which a motor's sensors must scatter."""


class Faults:
    """Probabilities that a motor or a sensor is at fault, from the last `WINDOW` samples.

    A motor that is well has i R = delta V - K omega. A fault leaves anything up to the stall current in it. A reading
    that is not finite, or has not changed by its last bit while its motor is driven, is no reading.
    """

    def __init__(self, motor: Motor):
        self.no_load_rate = float(motor.no_load_rate)
        self.stall_current = float(motor.supply / motor.resistance)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.rows: deque[np.ndarray] = deque(maxlen=WINDOW)
        self.motor = self.sensor = 0.0
        self.readable = True

    def step(self, reading: Reading) -> None:
        """Take a sample in."""
        duty, rate, current = np.asarray(reading.duty), np.asarray(reading.wheel_rate), np.asarray(reading.current)
        sensed = np.concatenate([rate, current, reading.suspension, reading.attitude[:2]])
        self.readable = bool(np.isfinite(sensed).all())
        if not self.readable:
            self.sensor = 1.0
            return
        self.rows.append(np.stack([duty, rate / self.no_load_rate, current / self.stall_current]))
        rows = np.array(self.rows)
        if len(rows) < WINDOW:
            return
        frozen = (np.abs(rows[:, 0]).min(axis=0) > TURNS) & (np.ptp(rows[:, 1:], axis=0) == 0.0)
        self.sensor = float(np.any(frozen))
        mean = rows.mean(axis=0)
        sd = np.hypot(MOTOR_SD * np.abs(mean).max(axis=0), NOISE)
        well = np.exp(-0.5 * ((mean[2] - mean[0] + mean[1]) / sd) ** 2) / (sd * np.sqrt(2.0 * np.pi))
        p_well = well * (1.0 - RARE) / (well * (1.0 - RARE) + 0.5 * RARE)
        self.motor = float(1.0 - p_well.min()) * (1.0 - self.sensor)
