"""Check of the reduced model: on which drives does its slip agree with the slip of the full rover, so that the search
may use it?

The full rover is the complete simulation. A search with the reduced model is much faster, but is useful only for drives
on which the two agree.
"""

from collections.abc import Sequence
from typing import NamedTuple

from rover_pin.tuning.drives import Control, reduced_errors
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.study import DriveCase, SlipLaw, TuningStudy

MAX_SLIP_ERROR = 0.05
"""Maximum RMSE of the reduced model's slip on a drive, over wheels and time (assumed). Up to this error, the search
uses the reduced model for the drive; above it, the search uses the full rover."""


class ReducedModelCheck(NamedTuple):
    """The errors of the reduced model on one drive, compared with the full rover (the complete simulation)."""

    case: DriveCase
    slip: float
    "RMSE of the slip over wheels and time [-]"
    speed: float
    "RMSE of the speed over time [m/s]"
    end: float
    """distance between the positions of the two rovers at the end [m]"""

    @property
    def trusted(self) -> bool:
        """Whether the slip error is below `MAX_SLIP_ERROR`, so that the search may use the reduced model."""
        return self.slip < MAX_SLIP_ERROR


def check_drives(study: TuningStudy, evaluations: Evaluations, law: SlipLaw) -> tuple[ReducedModelCheck, ...]:
    """Return the errors of the reduced model on every training drive of a study, with the gains in `law`.

    If the reduced model does not contain the control of the study, the result is empty.
    """
    if not study.has_reduced_model:
        return ()
    # One evaluation for each drive: it drives both models with the same gains and compares them.
    control = Control.of(study.estimate, law)
    jobs = [(case, control) for case in study.training]
    results = evaluations.run("check of the reduced model", reduced_errors, jobs)
    return tuple(ReducedModelCheck(case, *errors) for case, errors in zip(study.training, results, strict=True))


def worse_checks(study: TuningStudy, evaluations: Evaluations) -> tuple[ReducedModelCheck, ...]:
    """Return, for every training drive of a study, the worse of two checks of the reduced model.

    The first check is with the gains before the tuning, the second with the middle of the bounds of the free gains. One
    set of gains is not enough, because with it the rover may stop before a wall, which is easy to model.
    """
    both = [check_drives(study, evaluations, law) for law in (study.law_before, study.law([0.5] * len(study.free)))]
    return tuple(max(pair, key=lambda check: check.slip) for pair in zip(*both, strict=True))


def refusal(checks: Sequence[ReducedModelCheck]) -> str:
    """Return a text about the drives that the reduced model is not used for; an empty text if it is used for all
    drives.
    """
    # The text names the drive with the largest error, and the number of the other drives.
    refused = sorted((check for check in checks if not check.trusted), key=lambda check: -check.slip)
    if not refused:
        return ""
    worst = refused[0]
    others = f" and {len(refused) - 1} more" if len(refused) > 1 else ""
    return (
        f"the slip of the reduced model has an error of {worst.slip:.3f} (RMSE, limit {MAX_SLIP_ERROR:g}) on "
        f"{worst.case.name}{others}"
    )
