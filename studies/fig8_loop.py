"""Fig 8 and the loop: does the elevation stop rising in the loop's model, as it does in the log, and in which runs not?

Question
    The paper's experiment: "The elevation stayed constant after t = 30 [s]"; its simulation: "the elevation keeps
    rising". On a log of such a drive, does the model stop rising once `close-loop` has added the effect that it names?
Method
    studies/data/steepening-slope (or --log) has six drives made by a second simulator with sensor noise, on sand whose
    grip builds up at once and that digs (`DiggingMemory`), with k declared too large. Three models are driven freely
    from the start of each run, at the logged duties: as declared, with all numbers fitted but no effect added, and with
    the effects from the loop (--found, a folder that `close-loop` wrote; the stored one is
    studies/results/steepening-slope). Elevation is that of the body. "late" is its gain in the last 4 of 40 s, "off"
    its RMS distance from the log.
Result
    Late, in the two equal climbs (sand raked between them): the log 1.7 and 6.0 mm, as declared 15.5, with all numbers
    fitted 10.5, with the loop's model 2.7. With a pause: the log -0.9, 19.8, 11.0 and -0.9; up, back and up again:
    -3.2, 22.3, 14.8 and -1.1. The loop's model therefore stops rising. Its elevation is off by 1.7, 3.3, 7.0 and 2.5 mm
    in the four climbs, against 6.7 to 10.5 as declared and 1.9 to 6.6 fitted. Over a whole run two climbs are not
    better than with the fitted base: the second (1.9 -> 3.3 mm) and the one with the pause (3.2 -> 7.0 mm). The two
    equal climbs differ by 11 mm (RMS of the position) and 3.3 mm in elevation, so one sand for both follows neither
    better than half of that.
What the paper says
    "the digging and sinking process is not modeled in the simulation"; with the tire near S = 1 "the tire driving force
    exceeded the maximum share force of the soil, then the wheel started to dig a hole and sank".
What differs
    The log is simulated by other code, not measured. Raked sand differs from run to run.

Run: python studies/fig8_loop.py [--quick] [--log FOLDER] [--found FOLDER] [--out DIR]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import read_model

HERE = Path(__file__).parent
LATE = 4.0
"""Duration at the end of a run over which the gain of elevation is measured [s]."""
DECLARED, FITTED, FOUND = "as declared", "fitted, nothing added", "with what was found"
Heights = dict[str, dict[str, np.ndarray]]
"""By run: times `t` [s], and elevations [m] of the `log` and of each model above the start of the run."""


def main() -> None:
    """Replay the runs with the three models, write the table and the figure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the same: it takes seconds")
    parser.add_argument("--log", type=Path, default=HERE / "data" / "steepening-slope")
    parser.add_argument("--found", type=Path, default=HERE / "results" / "steepening-slope")
    parser.add_argument("--out", type=Path, default=Path("out/fig8_loop"))
    options = parser.parse_args()
    # The stored folder of a loop replaces a run of the loop, which takes minutes.
    heights = driven(read_drive_log(options.log), options.found)
    table = rows(heights)
    csv = write_csv(table, options.out / "fig8_loop.csv")
    png = save(draw(heights), options.out / "fig8_loop.png")
    print(table.to_string(index=False))
    print(f"written: {csv}, {png}")


def driven(log: DriveLog, loop_folder: Path) -> Heights:
    """Return the elevation over time of every run, from the log and from the three models driven freely."""
    declared = base_model(log)
    experiment: DriveExperiment = experiment_of(logged_runs(log, declared.rover), declared)
    # The fitted base model separates the gain of the added effect from the gain of the fit.
    models = {DECLARED: declared, FITTED: fitted(experiment, declared, loop_folder)}
    models[FOUND] = read_model(loop_folder / "model.toml", declared.terrain)
    heights: Heights = {}
    for run in experiment.runs:
        heights[run.name] = {"t": run.commands.t, "log": gained(run.commands.t, run.measured["body_z"])}
    # Free replays start where the run started and never use the measured position again.
    for label, model in models.items():
        for run, replay in zip(experiment.runs, experiment.free.replays(model), strict=True):
            heights[run.name][label] = gained(run.commands.t, replay.channels["body_z"])
    return heights


def fitted(experiment: DriveExperiment, declared: Model, loop_folder: Path) -> Model:
    """Return the base model with the numbers that the loop fitted before it searched for a missing effect."""
    before = json.loads((loop_folder / "verdict.json").read_text(encoding="utf-8"))["before"]
    start = with_spread(declared)
    model: Model = experiment.with_values(start, {name: entry["value"] for name, entry in before.items()})
    return model


def gained(t: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the elevation relative to its mean over the first second, because the zero of the tracker's elevation is
    arbitrary.
    """
    return z - float(np.nanmean(z[t <= t[0] + 1.0]))


def rows(heights: Heights) -> pd.DataFrame:
    """Return, for each run, the late gain and the RMS difference of each model from the log [mm]."""
    table = []
    for name, run in heights.items():
        row: dict[str, Any] = {"run": name}
        # Gain of elevation at the end, in mm.
        for label in ("log", DECLARED, FITTED, FOUND):
            row[f"late, {label}"] = 1e3 * late(run["t"], run[label])
        # RMS difference of each model from the log over the whole run.
        for label in (DECLARED, FITTED, FOUND):
            row[f"off, {label}"] = 1e3 * float(np.sqrt(np.nanmean((run[label] - run["log"]) ** 2)))
        table.append({key: round(value, 2) if isinstance(value, float) else value for key, value in row.items()})
    return pd.DataFrame(table)


def late(t: np.ndarray, z: np.ndarray) -> float:
    """Return the gain over the last LATE seconds [m], from means over a second, which reduce the noise."""
    end, begin = t > t[-1] - 1.0, np.abs(t - (t[-1] - LATE - 0.5)) <= 0.5
    return float(np.nanmean(z[end]) - np.nanmean(z[begin]))


def draw(heights: Heights) -> Figure:
    """Draw the elevation of the rover over time in every run: logged, and simulated by the three models."""
    figure = Figure(figsize=(14.0, 7.0), layout="constrained")
    axes = figure.subplots(2, (len(heights) + 1) // 2, squeeze=False).ravel()
    for axis, (name, run) in zip(axes, heights.items(), strict=False):
        # The log lies below the models, as a wide grey line.
        axis.plot(run["t"], 1e3 * run["log"], color="black", lw=2.5, alpha=0.4, label="log")
        for label, colour in zip((DECLARED, FITTED, FOUND), COLOURS, strict=False):
            axis.plot(run["t"], 1e3 * run[label], color=colour, lw=1.2, label=label)
        axis.set(title=name, xlabel="t [s]", ylabel="elevation gained [mm]")
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


if __name__ == "__main__":
    main()
