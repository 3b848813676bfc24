"""Whether rig sets can answer at all, alone or together: refusals, and findings that a reader should know of."""

from rover_pin.experiments.rig_sets.experiment import RigExperiment
from rover_pin.experiments.wheel_rig import checks
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_physics import refuse_impossible


def refuse_unfit(experiment: RigExperiment) -> None:
    """Refuse sets that cannot answer whatever the model; of several only what no wheel on any soil gives.

    Raises DataError: what the `refuse_unfit` of one set, or `refuse_impossible`, refuses.
    """
    for data in experiment.sets:
        if len(experiment.sets) > 1:
            refuse_impossible(data)
        else:
            checks.refuse_unfit(data)


def too_poor(experiment: RigExperiment, nuisances: int) -> str:
    """Return why the sets cannot tell an effect from nuisance parameters and what would, or an empty string."""
    if len(experiment.sets) == 1:
        return checks.too_poor(experiment.sets[0], nuisances)
    levels, fewest = len(experiment.folds), checks.FEWEST_LEVELS
    return f"{levels} levels in all sets: measure at {fewest} or more, or give more sets." if levels < fewest else ""


def findings_of(experiment: RigExperiment) -> list[Finding]:
    """Return what the check of each set found, of several with the set's name before its place."""
    if len(experiment.sets) == 1:
        return checks.findings(experiment.sets[0])
    of_sets = [(data.name, finding) for data in experiment.sets for finding in checks.findings(data)]
    return [*experiment.twice, *(finding._replace(where=f"{name}, {finding.where}") for name, finding in of_sets)]
