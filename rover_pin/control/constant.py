"""The paper's drive without control: one duty for all wheels, all the time."""

from dataclasses import dataclass

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.native.control import Commands


@dataclass(frozen=True)
class ConstantDuty(Record):
    """delta held at a value, wheels steered straight. Source: the paper, section 5: delta = 0.55.

    Examples
    --------
    >>> ConstantDuty(0.3).delta
    0.3
    """

    delta: Scalar = quantity(0.55, "", "paper, section 5", -1.0, 1.0, "delta")

    def __call__(self, reading: Reading) -> Command:
        """Return the command."""
        return Command(self.delta)

    def native(self, wheels: int) -> Commands:
        """Return the same for the compiled loop."""
        return Commands(float(self.delta))
