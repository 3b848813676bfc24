"""Stop for good where the rover stands and its wheels dig: what turns there only buries it."""

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.control import Commands, StopLaw, commands_of


@dataclass(frozen=True)
class Stop(Record):
    """When to stop: P(stands) > p_stands for about `time`, and the deepest hole over r above `depth`.

    Source: none; set on drives that no study counts. To go back or to try again in such a hole digs on, so that it is
    left to the operator: all burials that were left there were such trials.
    """

    p_stands: Scalar = quantity(0.5, "", "tuned", 0.0, 1.0, "P")
    time: Scalar = quantity(1.0, "s", "tuned: time constant", 0.01, 100.0, "tau")
    share: Scalar = quantity(0.6, "", "tuned: of late samples that say so", 0.0, 1.0)
    depth: Scalar = quantity(0.133, "", "tuned: 6 mm where r = 45 mm", 0.0, 1.0, "D/r")


@dataclass
class StopStuck:
    """A controller that stops for good as its estimator says; `estimate` is the one that `controller` asks."""

    controller: Controller
    estimate: OnboardSlip
    stop: Stop = field(default_factory=Stop)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Drive again."""
        self.memory = np.zeros(2)
        "late share of samples that say that it stands; above 0: it has stopped"
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command | np.ndarray | float:
        """Return the controller's command, or no duty."""
        command = self.controller(reading)
        estimate, stop = self.estimate, self.stop
        stands = estimate.p_stands > stop.p_stands
        self.memory[0] += self._gain * (float(stands) - self.memory[0])
        deepest = float(np.max(estimate.hole / estimate.rover.radii))
        if self.memory[0] > stop.share and deepest > stop.depth:
            self.memory[1] = 1.0
        return Command(0.0) if self.stopped else command

    @property
    def stopped(self) -> bool:
        """Whether it has stopped for good."""
        return bool(self.memory[1] > 0.0)

    @property
    def _gain(self) -> float:
        return self.estimate.period / float(self.stop.time)

    def native(self, wheels: int) -> Commands | None:
        """Return the same for the compiled loop, which keeps the memory; None where the controller must be asked."""
        commands, stop = commands_of(self.controller, wheels), self.stop
        if commands is None or commands.onboard is None:
            return None
        law = np.array([self._gain, float(stop.share), float(stop.depth)])
        return dataclasses.replace(commands, stop=StopLaw(float(stop.p_stands), law, self.memory))
