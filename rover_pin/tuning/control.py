"""A control law as plain values, by which evaluations are remembered, and the controller that it is."""

from __future__ import annotations

from typing import NamedTuple

from rover_pin.base.quantity import quantities
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.scenarios.controllers import controller_from
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.sensors import Sensed, Sensors
from rover_pin.tuning.reduced_model.drive import GAIN_NAMES
from rover_pin.tuning.study import HOLE, SENSED, SlipLaw

CONSTANT = "constant"
"""The name of the drive without control, beside those of the estimates."""
CHECKED = "limit"
"""The name of the drive at constant duty under the torque check at a slip, which senses no slip."""
HOLE_NAMES = tuple(name for name in quantities(HoleLaw) if name != "r")


class Control(NamedTuple):
    """Slip control by an estimate of ESTIMATES, `constant` or `limit` (delta_0)."""

    estimate: str
    gains: tuple[float, ...]
    hole: tuple[float, ...] = ()
    "of the hole law; empty where S_d is constant"
    seed: int = 0
    "of the sensors' noise"

    @classmethod
    def of(cls, estimate: str, law: SlipLaw, seed: int = 0) -> Control:
        """Return the control of a law; what reads no sensors has no seed."""
        gains = tuple(law.number(name) for name in GAIN_NAMES)
        hole = tuple(law.number(f"{HOLE}{name}") for name in HOLE_NAMES) if law.hole else ()
        return cls(estimate, gains, hole, seed if estimate in SENSED else 0)

    @property
    def named(self) -> Gains:
        """The gains."""
        return Gains(**dict(zip(GAIN_NAMES, self.gains, strict=True)))

    def controller(self, model: Model) -> Controller:
        """Return the controller for the full rover, as a scenario makes it; what reads sensors has their noise."""
        if self.estimate == CONSTANT:
            return ConstantDuty(self.named.delta_0)
        if self.estimate == CHECKED:
            return TorqueLimited(ConstantDuty(self.named.delta_0), TorqueLimit.at_slip(model))
        numbers = dict(zip(GAIN_NAMES, self.gains, strict=True))
        numbers |= {f"{HOLE}{name}": value for name, value in zip(HOLE_NAMES, self.hole, strict=False)}
        words = {"control": self.estimate, "control.aim": "hole" if self.hole else "constant"}
        if self.estimate in ("camera", "tracked"):
            words["control.seed"] = str(self.seed)
        request = Settings({**words, **{f"control.{name}": value for name, value in numbers.items()}})
        controller = controller_from(request, model, Trust())
        return Sensed(controller, Sensors(), self.seed) if self.estimate in SENSED else controller
