"""A stop for a rover that does not move while its wheels dig. If the wheels continued to turn, they would only bury the
rover.
"""

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.control import CompiledController, StopLaw, commands_of


@dataclass(frozen=True)
class Stop(Record):
    """The rule that stops a stuck rover.

    The rule stops the rover if two conditions are met: P(stands), the probability that the rover does not move, has
    been above `p_stands` for about `time`, and the deepest hole of a wheel is deeper than `depth` times the wheel
    radius. The rover then stays stopped. Reversing or trying again in such a hole would dig deeper, so that the
    operator decides.

    Source: none; tuned on drives that no study uses.
    """

    p_stands: Scalar = quantity(0.5, "", "tuned", 0.0, 1.0, "P")
    time: Scalar = quantity(1.0, "s", "tuned: time constant", 0.01, 100.0, "tau")
    share: Scalar = quantity(0.6, "", "tuned: fraction of recent samples with P(stands) > p_stands", 0.0, 1.0)
    depth: Scalar = quantity(0.133, "", "tuned: 6 mm where r = 45 mm", 0.0, 1.0, "D/r")


@dataclass
class StopStuck:
    """A controller that stops a stuck rover: it passes on the commands of another controller, and after the stop all
    duties are 0.

    Parameters
    ----------
    controller : Controller
        The controller that is used until the stop.
    estimate : OnboardSlip
        The slip estimate that `controller` itself uses; it provides P(stands), the probability that the rover does not
        move, and the depths of the holes.
    stop : Stop
        The rule of the stop.
    """

    controller: Controller
    estimate: OnboardSlip
    stop: Stop = field(default_factory=Stop)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Cancel the stop and reset the controller, at the start of a drive."""
        self.memory = np.zeros(2)
        "fraction of recent samples with P(stands) > p_stands; 1 if the rover has been stopped, else 0"
        if hasattr(self.controller, "reset"):
            self.controller.reset()

    def __call__(self, reading: Reading) -> Command | np.ndarray | float:
        """Return the command of the controller for a reading of the sensors, or duties of zero after the stop."""
        command = self.controller(reading)
        estimate, stop = self.estimate, self.stop
        stands = estimate.p_stands > stop.p_stands
        # A first-order low-pass of the samples: a single doubtful sample must not stop the rover.
        self.memory[0] += self._gain * (float(stands) - self.memory[0])
        deepest = float(np.max(estimate.hole / estimate.rover.radii))
        if self.memory[0] > stop.share and deepest > stop.depth:
            self.memory[1] = 1.0
        return Command(0.0) if self.stopped else command

    @property
    def stopped(self) -> bool:
        """Whether the rover has been stopped."""
        return bool(self.memory[1] > 0.0)

    @property
    def _gain(self) -> float:
        """Weight of one sample in the low-pass filter: the control period divided by the time constant."""
        return self.estimate.period / float(self.stop.time)

    def native(self, wheels: int) -> CompiledController | None:
        """Return the control in the form for the compiled simulation loop, which updates `memory`.

        The result is None if the controller cannot run in the compiled loop, or does not estimate the slip on board.
        """
        commands, stop = commands_of(self.controller, wheels), self.stop
        if commands is None or commands.onboard is None:
            return None
        law = np.array([self._gain, float(stop.share), float(stop.depth)])
        return dataclasses.replace(commands, stop=StopLaw(float(stop.p_stands), law, self.memory))
