"""How the verdict on each kind of data speaks, for those who have the verdict alone."""

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.drive.report import labels_of as of_drive
from rover_pin.report.rig.report import UNSEEN as RIG
from rover_pin.report.standalone.report import LABELS as BED
from rover_pin.report.words import Labels


def labels_of(verdict: Verdict) -> Labels:
    """Return what the data of a verdict call their parts; levels of a rig by their names."""
    if verdict.kind == "drive-log":
        return of_drive(verdict)
    return RIG if verdict.kind == "wheel-rig" else BED
