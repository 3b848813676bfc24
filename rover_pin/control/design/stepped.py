"""A drive that waits for its command at every sample: for another simulator, a learner, or hardware in the loop."""

from typing import Any

from rover_pin.base.errors import SimulationError
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.compiled_run import questions
from rover_pin.simulation.driving import Ran, obey
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.timing import Timing
from rover_pin.simulation.trace.record import trace_of
from rover_pin.simulation.trace.rows import finite
from rover_pin.simulation.trace.trace import Trace


class SteppedDrive:
    """A rover set down at rest; `step` commands it for a control period and returns what is read then.

    Parameters
    ----------
    model : Model
        As `scenario(...).model` has it.
    duration : float
        After which it ends [s].
    start : Start
        Where it is set down.
    timing : Timing
        Step, control period and rows of the trace [s].

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
        self.stop, self.command = "", Command(0.0)
        "why the drive ended, as the trace says it; empty while it goes on"
        self._drive = set_out(model, self._command, duration, start, timing)
        self._asking = questions(self._drive, duration)
        self._ran: Ran | None = None
        self.reading = next(self._asking)
        "what is read now"

    def step(self, command: Command | Any) -> Reading:
        """Command a `Command`, a duty, or one a wheel, for a control period; return what is read then.

        Raises SimulationError: the drive has ended, or the command is none.
        """
        if self.stop:
            raise SimulationError(f"The drive has ended ({self.stop}): begin another one.")
        self.command = command
        obey(self._drive, self.reading)
        try:
            self.reading = next(self._asking)
        except StopIteration as end:
            self._ran = end.value
            self.stop = end.value.stop
        return self.reading

    def trace(self) -> Trace:
        """Return the trace of a drive that has ended.

        Raises SimulationError: it goes on.
        """
        if self._ran is None:
            raise SimulationError("The drive goes on: its trace is there when `stop` says why it ended.")
        timing = self._drive.timing
        attrs = {"dt_s": timing.dt, "control_period_s": timing.control, "symmetric": False, "stop": self.stop}
        return trace_of(self._drive.model, finite(self._ran.rows), attrs)

    def _command(self, reading: Reading) -> Command | Any:
        return self.command
