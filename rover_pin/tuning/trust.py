"""Where the reduced model drives the same drive as the full rover, and so where its costs and derivatives count."""

from collections.abc import Sequence
from typing import NamedTuple

from rover_pin.tuning.drives import Control, reduced_errors
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.study import DriveCase, SlipLaw, TuningStudy

SLIP_ERROR = 0.05
"""RMSE of the slip, over wheels and time, up to which a reduced drive counts as that of the full rover (assumed)."""


class Checked(NamedTuple):
    """How far the reduced model of a drive is from the full rover's."""

    case: DriveCase
    slip: float
    "RMSE [-]"
    speed: float
    "RMSE [m/s]"
    end: float
    "distance of the ends [m]"

    @property
    def trusted(self) -> bool:
        """Whether the slip is near enough."""
        return self.slip < SLIP_ERROR


def check_drives(study: TuningStudy, evaluations: Evaluations, law: SlipLaw) -> tuple[Checked, ...]:
    """Return the check of every training drive under these numbers; none of a control that is not in the model."""
    if not study.has_reduced_model:
        return ()
    control = Control.of(study.estimate, law)
    jobs = [(case, control) for case in study.training]
    results = evaluations.run("check of the reduced model", reduced_errors, jobs)
    return tuple(Checked(case, *errors) for case, errors in zip(study.training, results, strict=True))


def checked_over(study: TuningStudy, evaluations: Evaluations) -> tuple[Checked, ...]:
    """Return of every training drive the worse check of two: the gains before, and the middle of the free ones' bounds.

    One alone may lie where nothing moves: a rover that control holds before a wall is easily modelled.
    """
    both = [check_drives(study, evaluations, law) for law in (study.law_before, study.law([0.5] * len(study.free)))]
    return tuple(max(pair, key=lambda check: check.slip) for pair in zip(*both, strict=True))


def refusal(checks: Sequence[Checked]) -> str:
    """Return in words on which drives the reduced model is not to be trusted; nothing where it is on all."""
    off = sorted((check for check in checks if not check.trusted), key=lambda check: -check.slip)
    if not off:
        return ""
    worst = off[0]
    others = f" and {len(off) - 1} more" if len(off) > 1 else ""
    return (
        f"the reduced model's slip is off by {worst.slip:.3f} (RMSE, limit {SLIP_ERROR:g}) on {worst.case.name}{others}"
    )
