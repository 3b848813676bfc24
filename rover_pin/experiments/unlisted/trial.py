"""The draft of what a drive model leaves, as an effect that can be tried."""

from rover_pin.discrepancy.draft import Draft, draft_of
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.signature import signatures
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.drive_log.candidates import candidate_of, variants
from rover_pin.experiments.drive_log.experiment import logged
from rover_pin.experiments.unlisted.draft import can_draft
from rover_pin.experiments.unlisted.residual import DriveResidual, draft_effect
from rover_pin.simulation.model.effect_files import effects_of_text


def drafted(fit: Fit, residual: DriveResidual, name: str, progress: Progress) -> Draft | None:
    """Return the draft of what a fit leaves, tried on it; None where no effect can imitate any term."""
    if not any(can_draft(term) for term in residual.terms):
        return None
    progress("trying the draft of what is left")
    text = draft_effect(residual, name)
    (kind,) = effects_of_text(text)
    search = Search(fit, progress)
    search.run(signatures(fit, [candidate_of(effect) for effect in variants(kind, fit.model, logged(fit))]))
    rows = [row for (row, *_) in search.fitted.values() if row.causes]
    if not rows:
        return draft_of(text, fit, None, -1.0)
    best, without = max(rows, key=lambda row: row.log_evidence), search.fitted[frozenset()][0]
    return draft_of(text, fit, best.fit, best.log_evidence - without.log_evidence)
