"""A simulated drive that takes one command at a time, for co-simulation, reinforcement learning, or hardware in the
loop.
"""

from typing import Any

from rover_pin.base.errors import SimulationError
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.driving import LoopResult, obey, questions
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start import Start
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.trace.record import finite, trace_of
from rover_pin.simulation.trace.trace import Trace


class SteppedDrive:
    """A simulated drive that a caller advances step by step: `step` applies a command for one control period and
    returns the next reading of the sensors.

    The drive begins with the rover set down at rest. `reading` is the latest reading, and `stop` is the reason why the
    drive has ended, or an empty text while it continues.

    Parameters
    ----------
    model : Model
        Rover, soil and ground, for example `scenario(...).model`.
    duration : float
        Time after which the drive ends [s].
    start : Start
        Position and heading at which the rover is set down.
    timing : Timing
        Time step, control period and period of the trace's rows [s].

    Examples
    --------
    >>> from rover_pin import scenario
    >>> drive = SteppedDrive(scenario("flat").model, 2.0)
    >>> while not drive.stop:
    ...     reading = drive.step(0.5 if drive.reading.t < 1.0 else 0.0)
    >>> drive.stop, bool(reading.t > 1.9)
    ('duration', True)
    """

    def __init__(self, model: Model, duration: float, start: Start = Start(), timing: Timing = Timing()):
        self.stop = ""
        """reason why the drive ended, as in the attribute `stop` of its trace; empty while the drive continues"""
        self.command = Command(0.0)
        """command of the present step"""
        # The simulation asks for the command of each sample through this function, and gets the latest one.
        self._drive = set_out(model, lambda reading: self.command, duration, start, timing)
        self._readings = questions(self._drive, duration)
        self._result: LoopResult | None = None
        self.reading = next(self._readings)
        "the latest reading"

    def step(self, command: Command | Any) -> Reading:
        """Apply a command for one control period, and return the reading of the sensors at the end of the period.

        The command is a `Command`, one duty for all wheels, or an array of duties (wheels,) [-].

        Raises SimulationError: the drive has ended, or the value is not a command.
        """
        # A command after the end would be lost without a notice.
        if self.stop:
            raise SimulationError(f"The drive has ended ({self.stop}), so that no step is left. Start another drive.")
        self.command = command
        # The command holds from this sample on. The generator then runs to the next sample, or ends with the drive.
        obey(self._drive, self.reading)
        try:
            self.reading = next(self._readings)
        except StopIteration as end:
            self._result = end.value
            self.stop = end.value.stop
        return self.reading

    def trace(self) -> Trace:
        """Return the trace of the drive, the record of its channels over time, after the drive has ended.

        Raises SimulationError: the drive has not ended.
        """
        if self._result is None:
            raise SimulationError(
                "The drive has not ended, so that it has no trace yet. Call `step` until `stop` is no longer empty."
            )
        timing = self._drive.timing
        attrs = {"dt_s": timing.dt, "control_period_s": timing.control, "symmetric": False, "stop": self.stop}
        return trace_of(self._drive.model, finite(self._result.rows), attrs)
