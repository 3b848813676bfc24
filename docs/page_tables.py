"""Tables of the pages: `{{ tables.NAME }}` is made of the fields of results when the site is built.

A column is its head and a pattern over the fields of a row, as `{cost:.3f} m`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Rows = Iterable[Mapping[str, Any]]

CONTROLS = ("constant duty", "S_d = 0.2, true slip", "by the hole, true slip", "by the hole, on board")
TUNED = ("constant duty", "torque check", "before, true", "tuned, true", "tuned, eq9")
DIGGING = {
    "constant duty": "none",
    "torque check at the greatest shear": "T_sat alone",
    "torque check at a slip of 0.5": "T_lim(0.5) alone",
    "true slip, S_d = 0.1": "true slip 0.1",
    "true slip, S_d = 0.2": "true slip 0.2",
    "true slip, S_d = 0.5": "true slip 0.5",
    "Eq 9, where it has a table": "Eq 9",
}
DRIVE = {
    "at the default step of 17 ms [s]": "ditch [s]",
    "at the default step, with its error estimate [s]": "ditch with its error [s]",
    "the coarsest step within the tolerance [ms]": "step within the tolerance [ms]",
    "at this coarsest step [s]": "ditch at that step [s]",
    "difference of x to a sixteenth of the step [mm]": "off [mm]",
    "the same difference with k = 10 mm, when the rover leaves the ditch [mm]": "off with k = 10 mm [mm]",
    "the same difference at the coarsest step [mm]": "off at that step [mm]",
    "one step [µs]": "step [us]",
    "one sample of a controller in Python [µs]": "Python controller [us]",
    "NumPy reference, equal to round-off [times as long]": "plain [x]",
    "memory [MB]": "memory [MB]",
    "MuJoCo, the same rover on rigid boxes, 2 ms [s]": "MuJoCo at 2 ms [s]",
    "MuJoCo, 4 ms [s]": "MuJoCo at 4 ms [s]",
}
GROUND = {
    "ditch with 1,000 points": "ditch, 1,000 points and its corners [x]",
    "ditch as a grid of 300 x 300": "ditch, 300 x 300 grid [x]",
    "rough ground of 81 points": "rough ground, 81 points [x]",
    "rough ground of 1,000 points": "rough ground, 1,000 points [x]",
    "a case of a sweep, compared with its drive": "case over drive [x]",
}
REPLAY = {
    "replay of a log of 20 s, ditch [ms]": "ditch [ms]",
    "replay of a log of 20 s, washboard [ms]": "washboard [ms]",
    "compiling the step [s]": "compiling the step [s]",
    "compiling a new rover [s]": "compiling a rigid body [s]",
    "compiling new effects [s]": "compiling a set of laws [s]",
}
STEP_ERROR = {
    "drives": "drives",
    "drives that state an error within the tolerance": "kept",
    "of these, drives with a true error above the tolerance": "not kept",
    "drives with a true error above the stated error": "low",
    "of these, drives without the control `onboard`": "low elsewhere",
    "median of stated error over true error": "ratio",
}
IMPROVED = {
    "the true gain lies in its 90 % interval": "inside",
    "the advice is to keep constant duty": "keeps",
    "the advice is the tuned control, and the true gain is positive": "true_gains",
    "the advice is the tuned control, and it does harm (a true loss above 0.02)": "harms",
}
READINGS = {
    "net": "f_t / f_n, Eqs (6) and (7) taken literally",
    "torque": "torque / (r f_n), as section 4 measured it",
    "gross": "thrust / f_n, Eq (7) without its second term",
}
MEASURED = {"Quantity": "{name}", "Measured": "{value:.3g}"}
CURVES = {"Quadratic": "{quadratic}", "Gaussian process": "{Gaussian process}"}


def tables(of: Mapping[str, Any]) -> dict[str, str]:
    """Return every table by its name, of the fields of results."""
    speed, wheels = of["speed"], of["wheels"]
    return {
        "controllers": table(
            rows_of(of["control"]["rows"], CONTROLS),
            {"Control": "{name}", "Passed": "{passed}", "Buried": "{buried}", "Mean distance": "{way:.3f} m"},
        ),
        "beliefs": table(
            of["beliefs"]["rows"],
            {"Belief of the on-board estimate": "{name}", "Passed": "{project[passed]}", "Buried": "{project[buried]}",
             "Passed, second generator": "{strange[passed]}", "Buried, second generator": "{strange[buried]}"},
        ),
        "digging": table(
            rows_of(of["digging"], DIGGING),
            {"Control": "{name}", "Buried": "{buried} of {driven}",
             "Drives that end further than constant duty, which is buried": "{further}"},
        ),
        "slip": table(
            rows_of(of["slip"], ("onboard", "onboard, wrong soil", "eq9")),
            {"Estimate": "{name}", "Bias": "{all[bias]:.3f}", "SD": "{all[sd]:.2f}", "RMS on hills": "{hills[rms]:.2f}",
             "in ditches": "{ditch[rms]:.2f}", "on rocks": "{rocks[rms]:.2f}"},
        ),
        "monitor": table(
            of["monitor"].values(),
            {"Alarm from P(stuck)": "{level:g}", "Burials warned 2 s before": "{warned:.0f}",
             "Shortest lead time": "{lead_least_s:.1f} s", "Median lead time": "{lead_median_s:.1f} s",
             "False alarms an hour": "{false_per_hour:.1f}"},
        ),
        "brier": table(
            of["brier"],
            {"Forecast of the next 4 s": "{name}", "Brier score": "{score:.3f}",
             "Brier score of the mean share": "{base:.3f}"},
        ),
        "tuned": table(
            rows_of(of["tuned"]["cost"], TUNED),
            {"Control": "{name}", "Digging slopes": "{slopes:.3f}", "Ditches and slopes": "{ditch:.3f}"},
        ),
        "as_driven": table(
            of["as_driven"],
            {"Control": "{name}", "Sand: passed / buried": "{sand[through]:.0f} / {sand[buried]:.1f} %",
             "Ditches": "{ditches[through]:.0f} / {ditches[buried]:.1f} %",
             "Rough": "{rough[through]:.0f} / {rough[buried]:.1f} %", "Mean cost": "{all[cost]:.3f}",
             "Drives better / worse than with hand-set gains": "{all[better]} / {all[worse]}"},
        ),
        "foreign": table(
            of["foreign"],
            {"Importer": "{importer}", "Seeds": "{seeds}", "Right": "{right}", "Asked": "{asked}",
             "Silently wrong": "{wrong}"},
        ),
        "rtk": table(
            of["rtk"]["rows"],
            {"Runs: RMS errors of path and heading": "{runs}", "Odometry": "{odometry}", "Base model": "{base}",
             "Model of the loop": "{loop}", "Noise": "{noise}"},
        ),
        "turns": table(
            of["turns"],
            {"Rover": "{rover}", "Effective track / B": "{ours}", "Maker's": "{makers}", "Left at 2 m": "{turn left}",
             "Right at 2 m": "{turn right}", "On the spot": "{on the spot}"},
        ),
        "improved": table(rows_of(of["improved"], IMPROVED), {"Logs in which": "{name}", "Count": "{value}"}),
        "ditches": table(
            rows_of(of["ditches"]["passed"], ("tacking", "constant 0.55", "paper, Eq 9", "paper, Eq 9, tuned")),
            {"Control": "{name}", "Passed": "{value}"},
        ),
        "log_loop": table(
            of["log_loop"]["errors"], {"Error": "{name}", "Before": "{before:.1f} mm", "After": "{after:.1f} mm"}
        ),
        "log_fitted": table(of["log_loop"]["fitted"], {"Number": "{name}", "95 %": "{fitted}", "True": "{true:g}"}),
        "wheels": table(
            wheels["own"],
            {"Set": "{set}", "Law": "{law}", "Held out": "{held}", **CURVES, "Authors": "{authors}",
             "One soil": "{one}", "To reach": "{reach}"},
        ),
        "from_the_others": table(wheels["from the others"], {"Set": "{set}", "Law": "{held}", **CURVES}),
        "measured_loops": table(
            of["measured_loops"],
            {"Data": "{data}", "Answer": "{answer}: {sets}", "Probability of each family": "{families}",
             "Held out, before": "{before}", "after": "{after}", "together": "{together}"},
        ),
        "drive_speed": table(rows_of(speed["drive_speed"], DRIVE), MEASURED),
        "ground_speed": table(rows_of(speed["ground_speed"], GROUND), {"Ground": "{name}", "Times": "{value:.3g}"}),
        "replay_speed": table(rows_of(speed["replay_speed"], REPLAY), MEASURED),
        "step_error": table(rows_of(of["step_error"], STEP_ERROR), {"Of these": "{name}", "Measured": "{value:.3g}"}),
        "traction": table(
            [{"name": name, "reading": READINGS[name], **row} for name, row in of["traction"].items()],
            {"Form": "`{name}`", "F(S) is": "{reading}", "S = 0": "{F[0]:.3f}", "S = 0.2": "{F[1]:.3f}",
             "S = 1": "{F[2]:.3f}", "steepest slope, without and with R": "{slopes}"},
        ),
        "pendulum": table(of["pendulum"], {"Sets": "{what}", "Count": "{count} of {whole}"}),
        "benchmark_systems": table(
            of["benchmark_systems"],
            {"System": "{system}", "Hidden": "{hidden}", "Samples": "{samples}", "Answer": "{answer}",
             "Named": "{named}", "Largest probability of another cause": "{largest extra}",
             "RMSE": "{RMSE unseen}", "RMSE of the plain fit": "{RMSE plain fit}", "CPU [s]": "{CPU}"},
        ),
        "mutation": table(
            of["mutation"],
            {"Room": "{room}", "Changes": "{changes}", "Tried": "{tried}", "Not detected": "{not noticed}"},
        ),
        "gallery": table(of["gallery"], {"Command": "`{command}`", "Outcome": "{outcome}"}),
    }  # fmt: skip


def rows_of(result: Mapping[str, Any], names: Mapping[str, str] | Sequence[str]) -> list[dict[str, Any]]:
    """Return parts of a result, each with its `name`; a part that is a number is its `value`."""
    names = names if isinstance(names, Mapping) else {name: name for name in names}
    parts = {name: result[key] for name, key in names.items()}
    return [{"name": name, **(part if isinstance(part, Mapping) else {"value": part})} for name, part in parts.items()]


def table(rows: Rows, columns: Mapping[str, str]) -> str:
    """Return rows as a table of Markdown."""
    lines = [[*columns], ["---"] * len(columns), *([each.format(**row) for each in columns.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
