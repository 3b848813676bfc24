"""Chooses the words and the writer of a report by the kind of data: drive log, wheel rig, or a user's experiment."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rover_pin.discrepancy.question import LoopData
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report import experiment
from rover_pin.report.drive import report as drive
from rover_pin.report.rig import report as rig
from rover_pin.report.words import Labels


class KindReport(NamedTuple):
    """The two functions that make the report of one kind of data, such as a drive log."""

    labels: Callable[[Verdict], Labels]
    """function that returns the words of the report for a verdict, such as "runs" for the held-out parts of a drive
    log"""
    write: Callable[[Verdict, Any, Path], list[Path]]
    """function that writes report.html for a verdict and its data into a folder, and returns the paths of all files"""


OTHER = KindReport(lambda verdict: experiment.LABELS, experiment.write_report)
"""Report of all other kinds of data, which are experiments that a user's file defines."""
REPORTS = {
    "drive-log": KindReport(drive.labels_of, lambda verdict, data, out: drive.write_report(verdict, data.log, out)),
    "wheel-rig": KindReport(
        lambda verdict: rig.UNSEEN, lambda verdict, data, out: rig.write_report(verdict, data.experiment, out)
    ),
}


def labels_of(verdict: Verdict) -> Labels:
    """Return the words that sentences about a verdict use for its kind of data, such as "runs" for a drive log.

    The terminal uses these words. For a wheel rig, slip levels have their names here, and their slips ("S = 0.5") on
    the page.
    """
    return REPORTS.get(verdict.kind, OTHER).labels(verdict)


def write_report(verdict: Verdict, data: LoopData, out: Path) -> list[Path]:
    """Write report.html and its figures for data of any kind into the folder `out`, and return the files' paths."""
    return REPORTS.get(data.kind, OTHER).write(verdict, data, out)
