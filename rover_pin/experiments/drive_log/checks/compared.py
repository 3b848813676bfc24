"""What of a log the loop does not compare: runs in which the rover stands or turns, wheels on a border of lanes."""

from collections.abc import Iterator

from rover_pin.experiments.drive_log.features import BLOCK, logged_run
from rover_pin.experiments.drive_log.readings.lane_borders import lanes_under
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.finding import Finding


def compared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield each run without a half-second mean that is compared: left out like any other, it tells nothing.

    Yield also how long a wheel stood on the border of two lanes, where that was long enough to be missed.
    """
    rover, shared = log.load_rover(), log.terrain()
    for trace in log.runs:
        run = logged_run(trace, rover, lanes_under(log, trace, shared))
        if run.on_border > BLOCK:
            yield Finding(
                f"for {run.on_border:.1f} s a wheel stands on the border of lanes of other heights: what carries it "
                "there is not declared, and not compared",
                str(trace.attrs["file"]),
                "drive in the middle of the lanes, or declare the ground as a grid",
            )
        if not run.usable.any():
            yield Finding(
                "the rover stands or turns on the spot, so nothing of this run is compared, and leaving it out tests "
                "nothing",
                str(trace.attrs["file"]),
                "drop it from drive.toml, or drive ahead or back for 5 s or more in it",
            )
