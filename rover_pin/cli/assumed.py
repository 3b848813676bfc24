"""The numbers and choices that a command assumed, at the end of its output, the same records in JSON and as a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_pin.base.errors import RoverPinError
from rover_pin.cli.terminal import report

if TYPE_CHECKING:
    from rover_pin.scenarios.assumptions import Assumption
    from rover_pin.scenarios.scenario import Scenario
    from rover_pin.simulation.trace.trace import Trace
    from rover_pin.sweep import Study

RESULTS = {"distance_m": "m", "max_slip": "", "energy_motor_J": "J"}
"""Results of a drive whose change by an assumed number is reported -> unit. The first one decides the order of the
numbers, because the distance shows at once whether a rover gets stuck."""


USED_BY_BOUNDS = ("rover", "soil", "form", "angles", "motor", "gravity", "effect.MotionResistance.R")
"""Settings, and first parts of settings, on which the torque bounds depend. Other settings of a drive are not read."""


def report_assuming(
    result: Mapping[str, Any],
    assumptions: "Sequence[Assumption]",
    as_json: bool,
    out: Path | None = None,
    decisive: Mapping[str, str] = {},
    error: float = 0.0,
) -> None:
    """Print the result of a command, and what the command assumed.

    The JSON object has all assumptions. The table has only their number and the most decisive ones, because there are
    often forty of them; the folder of the results has all of them in assumed.csv.

    Parameters
    ----------
    result : mapping
        The result, as for `report`.
    assumptions : sequence of Assumption
        Numbers and choices that the user did not give.
    as_json : bool
        Whether JSON is printed.
    out : path, optional
        Folder of the results, where assumed.csv is written. Without it, no file is written.
    decisive : mapping
        Result whose most decisive assumptions are printed -> unit of this result.
    error : float
        Numerical error of these results, in their unit. Smaller changes are not printed.
    """
    from rover_pin.scenarios.assumptions import most_decisive, write_assumptions

    files = [str(write_assumptions(assumptions, out))] if out is not None and assumptions else []
    if as_json:
        report({**result, "assumptions": [entry.row() for entry in assumptions]}, as_json)
        return
    where = f", listed in {files[0]}" if files else "; --json lists them"
    lines = {"not given": f"{len(assumptions)} numbers and choices are assumed{where}"} if assumptions else {}
    sentences = [line for name, unit in decisive.items() for line in most_decisive(assumptions, name, unit, error)]
    report({**result, **lines, **({"most decisive": sentences} if sentences else {})}, as_json)


def assumed_by_bounds(assumptions: "Sequence[Assumption]") -> "tuple[Assumption, ...]":
    """Return the assumptions of a level drive on which the torque bounds of its rover depend."""
    used = set(USED_BY_BOUNDS)
    return tuple(entry for entry in assumptions if used & {entry.name, entry.name.split(".")[0]})


def assumed_by_sweep(study: "Study") -> "tuple[Assumption, ...]":
    """Return the assumptions that the drives of a batch study have in common, by its first and its last case.

    The result is empty if one of these two cases fails; the row of this case in the results then has the reason.
    """
    from rover_pin.scenarios.assumptions import shared_by
    from rover_pin.sweep.case import scenario_of

    cases = study.cases()
    try:
        return shared_by(scenario_of(study, case).assumptions for case in (cases[0], cases[-1]))
    except RoverPinError:
        return ()


def weighed_by_drives(
    chosen: "Scenario", trace: "Trace", name: str, settings: Mapping[str, Any]
) -> "tuple[Assumption, ...]":
    """Return the assumptions of a drive with their influence on its distance, slip and energy.

    Each assumed number with an SD costs one drive more. The influence stays empty if this is too slow or not allowed:
    if the control is the user's own, because its code would run again, and if the drive diverged.

    Parameters
    ----------
    chosen : Scenario
        The drive.
    trace : Trace
        The trace of the drive.
    name, settings : str and mapping
        The scenario or drive file, and the settings, from which the drive was made.
    """
    from rover_pin.scenarios.assumptions import with_influence
    from rover_pin.scenarios.scenario import scenario

    own_control = str(settings.get("control", "")).endswith(".py")
    if own_control or str(trace.attrs["stop"]).startswith("diverged") or not len(trace.t):
        return chosen.assumptions

    def results(changes: Mapping[str, float]) -> dict[str, float]:
        # The step error of these drives is not needed, and without it each drive costs less than half.
        summary = scenario(name, **{**settings, **changes}).drive(measure_error=False).summary()
        return {result: float(summary[result]) for result in RESULTS if result in summary}

    return with_influence(chosen.assumptions, results)
