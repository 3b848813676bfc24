"""The slip control of section 5 (Fig 9): PI on the duty of each wheel, limited by the soil's greatest shear."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rover_pin.contact import Scalar
from rover_pin.control.slip_estimate import SlipEstimate
from rover_pin.control.torque_limit import NoLimit, TorqueLimit
from rover_pin.motion.command import Command, Reading
from rover_pin.motion.simulate import CONTROL_PERIOD
from rover_pin.quantity import Record, quantity


@dataclass(frozen=True)
class Gains(Record):
    """PI gains and limits: delta = delta_0 + k_p e + k_i int e dt, e = S_d - S_hat, within [delta_min, delta_max].

    The integral takes k_aw (limited - asked) back in (back-calculation), so that it cannot wind up on the flat, where
    the load and not the duty sets the slip.
    """

    S_d: Scalar = quantity(0.1, "", "paper, section 5", -1.0, 1.0, "S_d")
    k_p: Scalar = quantity(0.1, "", "assumed: not in the paper", 0.0, 100.0, "k_p")
    k_i: Scalar = quantity(1.0, "1/s", "assumed: not in the paper", 0.0, 1000.0, "k_i")
    k_aw: Scalar = quantity(2.0, "1/s", "assumed: not in the paper", 0.0, 1000.0, "k_aw")
    delta_0: Scalar = quantity(0.55, "", "paper, section 5: cruise duty", -1.0, 1.0, "delta_0")
    delta_min: Scalar = quantity(0.05, "", "assumed: a wheel is never stopped", -1.0, 1.0, "delta_min")
    delta_max: Scalar = quantity(0.55, "", "assumed: the duty without control", -1.0, 1.0, "delta_max")


@dataclass
class SlipControl:
    """The control law; sampled every `period` [s], held in between. Keeps one integral a wheel; `reset` clears them."""

    gains: Gains
    estimate: SlipEstimate
    limit: TorqueLimit | NoLimit = field(default_factory=NoLimit)
    period: float = CONTROL_PERIOD
    integral: np.ndarray | float = 0.0

    def reset(self) -> None:
        """Forget the past."""
        self.integral = 0.0

    def __call__(self, reading: Reading) -> Command:
        """Return the duty of each wheel."""
        gains = self.gains
        error = gains.S_d - self.estimate.slip(reading)
        asked = gains.delta_0 + gains.k_p * error + self.integral
        highest = np.minimum(gains.delta_max, self.limit.duty(reading))
        given = np.clip(asked, np.minimum(gains.delta_min, highest), highest)
        self.integral = self.integral + self.period * (gains.k_i * error + gains.k_aw * (given - asked))
        return Command(given)
