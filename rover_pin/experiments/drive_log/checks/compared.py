"""Runs in which the rover stands or turns on the spot throughout: the loop compares nothing of them."""

from __future__ import annotations

from collections.abc import Iterator

from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.finding import Finding


def compared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield each run without a half-second mean that is compared: left out like any other, it tells nothing."""
    rover = log.load_rover()
    for trace in log.runs:
        if not logged_run(trace, rover).usable.any():
            yield Finding(
                "the rover stands or turns on the spot, so nothing of this run is compared, and leaving it out tests "
                "nothing",
                str(trace.attrs["file"]),
                "drop it from drive.toml, or drive ahead or back for 5 s or more in it",
            )
