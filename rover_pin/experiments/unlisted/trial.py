"""The draft of what a drive model leaves, as an effect that can be tried."""

from __future__ import annotations

from rover_pin.discrepancy.draft import Draft, Drafted, tried
from rover_pin.discrepancy.refit import Progress
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.drive_log.candidates import candidate_of, variants
from rover_pin.experiments.drive_log.experiment import logged
from rover_pin.experiments.unlisted.draft import can_draft
from rover_pin.experiments.unlisted.residual import DriveResidual, draft_effect
from rover_pin.simulation.model.effect_files import effects_of_text


def drafted(fit: Fit, residual: DriveResidual, name: str, progress: Progress) -> Draft | None:
    """Return the draft of what a fit leaves, tried on it; None where no effect can imitate any term."""
    if not any(can_draft(term, residual.wheels) for term in residual.terms):
        return None
    text = draft_effect(residual, name)
    (kind,) = effects_of_text(text)
    effects = variants(kind, fit.model, logged(fit))
    return tried(Drafted(text, tuple(map(candidate_of, effects))), fit, progress)
