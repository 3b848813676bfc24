"""The value of tuned gains where wheels dig in: slip control before and after tuning, torque limit, and no control.

Question
    The paper gives S_d = 0.1 and no gains. Which gains does an optimiser choose for sand in which wheels dig, on slopes
    and in ditches, what is their cost on held-out drives, and where does the control help?
Method
    `tune_gains` runs on studies/tune_slopes.toml (digging slopes) and studies/tune_ditch.toml (digging ditches and
    slopes, a bump), with the true slip fed back. Differential evolution uses the reduced model where its slip agrees
    with the full rover, else the full rover. Nelder-Mead then starts from its two best points on the full rover, which
    decides all comparisons. The cost weighs sinkage, progress, slip and energy as the files state; gains that bury
    fewer wheels always rank first. For comparison: constant duty, the torque limit at S = 0.5 alone, and Eq (9) with
    the same gains. Finally the cost is mapped over k_p and k_i on the slopes.
Result
    Mean cost on held-out drives, slopes / ditches and slopes: constant duty 2.825 / 3.826 (83 and 88 % stuck, 50 and 75
    % buried), torque limit alone 1.327 / 2.178, hand-set gains with the true slip 0.853 / 1.597, tuned 0.477 / 0.883
    (none and 25 % stuck, none buried); Eq (9) with the hand-set gains 2.228 / 3.487, with the tuned gains 2.824 /
    3.803. The tuned values are S_d = 0.45, k_p = 1.9, k_i = 3.2 for the slopes, 0.39, 2.1 and 0.067 for the ditches. On
    slopes tuned gains help on 5 of 6 held-out drives and do no harm. The torque limit, which senses no slip, prevents
    burials but leaves 5 stuck. Of the 8 other drives tuned gains help on 7 and do harm on one, the bump, which constant
    duty passes; they improve on the hand-set gains on 6.
    Reduced model against the full rover, tuned gains: slip RMSE 0.004 to 0.020 on slopes, 0.04 on the bump, 0.16 to
    0.20 in ditches. The search drives the ditches with the full rover, and also one slope, where other gains have an
    error of 0.058. The Nelder-Mead polish lowered the training cost of the two best from 0.4225 and 0.4241 to 0.4211
    and 0.4212 on the slopes, from 0.5998 and 0.6044 to 0.5988 and 0.6003 in the ditches.
What the paper says
    Section 5: with the control, S_d = 0.1, the rover gets on "without digging the soil or being stuck".
What differs
    The tuned S_d is higher than the paper's. Eq (9) has no use here, because it does not see the slip
    (studies/motors.py).

Run: python studies/tune_gains.py [--quick] [--estimate eq9] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd

from rover_pin import plot
from rover_pin.tuning.drives import CONSTANT_DUTY, TORQUE_CHECK, Control, controller_of, drive_full
from rover_pin.tuning.evaluations import Evaluations
from rover_pin.tuning.report import TuningResult
from rover_pin.tuning.study import IDEAL, DriveCase, Effort, SlipLaw, TuningStudy
from rover_pin.tuning.study_file import read_tuning
from rover_pin.tuning.tune import reduced_costs, tune_gains

ENSEMBLES = ("slopes", "ditch")
K_P = K_I = (0.01, 10.0)


def main() -> None:
    """Tune for both sets of drives, draw the figures, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two drives and hardly any search: shows that it runs")
    parser.add_argument("--estimate", choices=IDEAL, default="true", help="the slip that is fed back")
    parser.add_argument("--out", type=Path, default=Path("out/tune_gains"))
    options = parser.parse_args()
    results = {}
    for name in ENSEMBLES:
        study = dataclasses.replace(asked(name, options.quick), estimate=options.estimate)
        results[name] = tune_gains(study, options.out / name)
        print(f"\n{name}: {results[name].gains}")
        print("\n".join((*results[name].verdicts(), *results[name].where(), *results[name].search_notes)), flush=True)
        # Agreement of the reduced model with the full rover, drive by drive.
        for case, *errors in results[name].check:
            print(f"reduced model, {case}: slip RMSE {errors[0]:.3f}, speed RMSE {1e3 * errors[1]:.1f} mm/s")
    table = pd.concat([digests(name, result) for name, result in results.items()])
    plot.write_csv(table, options.out / "tune_gains.csv")
    print(table.round(3).to_string(index=False))
    landscape_figure(results["slopes"], options.out, 3 if options.quick else 8)
    drives_figure(results["ditch"], options.out)
    print(f"written: {options.out}/tune_gains.csv, landscape.csv, landscape.png, before_after.png, */gains.toml")


def asked(name: str, quick: bool) -> TuningStudy:
    """Return a shipped study. A quick study has its last two drives only and hardly any search."""
    study = read_tuning(Path(__file__).parent / f"tune_{name}.toml")
    if not quick:
        return study
    effort = Effort(population=5, generations=0, starts=1, steps=1, keep=1)
    return dataclasses.replace(study, training=study.training[-2:], held_out=study.held_out[-2:], effort=effort)


def digests(ensemble: str, result: TuningResult) -> pd.DataFrame:
    """Return a table with statistics of the costs: one row for each control on the training drives and on the held-out
    drives.
    """
    rows = [
        (ensemble, where, control, *statistics)
        for where, controls in result.statistics().items()
        for control, statistics in controls.items()
    ]
    return pd.DataFrame(
        rows, columns=["ensemble", "set", "control", "mean", "worst", "tail_10", "stuck_share", "buried_share"]
    )


def landscape_figure(result: TuningResult, out: Path, points: int) -> None:
    """Draw the reduced model's cost over k_p and k_i, with S_d as tuned and as in the paper."""
    k_p, k_i = np.geomspace(*K_P, points), np.geomspace(*K_I, points)
    sheet, axes = plot.new_figure(1, 2, size=(12.0, 5.0), sharey=True)
    tables = []
    # The left panel has the paper's S_d, the right panel the tuned one.
    for axis, S_d, name in zip(axes, (result.study.before.S_d, result.gains.S_d), ("before", "tuned"), strict=True):
        cost = landscape(result.study, S_d, k_p, k_i, out)
        mesh = axis.pcolormesh(log_edges(k_p), log_edges(k_i), cost.T, shading="flat", cmap="viridis")
        sheet.colorbar(mesh, ax=axis, label="cost of the reduced model")
        chosen = result.gains if name == "tuned" else result.study.before
        axis.plot(chosen.k_p, chosen.k_i, "w*", ms=14, mec="black", label=f"{name} gains")
        axis.set(xscale="log", yscale="log", xlabel="k_p [-]", ylabel="k_i [1/s]", title=f"S_d = {S_d:.2f} ({name})")
        axis.legend(fontsize=8)
        # The CSV has one row for each cell of the map.
        grid = np.meshgrid(k_p, k_i, indexing="ij")
        tables.append(pd.DataFrame({"S_d": S_d, "k_p": grid[0].ravel(), "k_i": grid[1].ravel(), "cost": cost.ravel()}))
    plot.write_csv(pd.concat(tables), out / "landscape.csv")
    plot.save(sheet, out / "landscape.png")


def log_edges(centres: np.ndarray) -> np.ndarray:
    """Return the edges of cells from their centres, which are equally spaced on a logarithmic axis."""
    half = np.sqrt(centres[1] / centres[0])
    return np.append(centres / half, centres[-1] * half)


def landscape(study: TuningStudy, S_d: float, k_p: np.ndarray, k_i: np.ndarray, out: Path) -> np.ndarray:
    """Return the mean cost for each pair of gains (k_p, k_i) of a grid. If the study was interrupted, it continues with
    the stored costs.
    """
    laws = [SlipLaw(study.before.replace(S_d=S_d, k_p=float(p), k_i=float(i))) for p in k_p for i in k_i]
    return reduced_costs(study, Evaluations(out / "landscape", None, None), laws).reshape(len(k_p), len(k_i))


def most_changed(result: TuningResult) -> DriveCase:
    """Return the training drive whose cost the tuned gains change most against constant duty."""
    cost = {
        control_drives.control: [score.cost(result.study.cost) for score in control_drives.training]
        for control_drives in result.drives
    }
    change = np.subtract(cost[f"tuned, {result.study.estimate}"], cost["constant duty"])
    return result.study.training[int(np.argmax(np.abs(change)))]


def drives_figure(result: TuningResult, out: Path) -> None:
    """Draw x of the rover, and slip and sinkage of a middle wheel, in four drives: at constant duty, with the torque
    check alone, and with slip control before and after tuning.
    """
    case, by = most_changed(result), result.study.estimate
    before = result.study.law_before
    # Four drives of one case: constant duty, torque check alone, and slip control before and after tuning.
    controls = {"constant duty": Control.of(CONSTANT_DUTY, before), "torque check": Control.of(TORQUE_CHECK, before)}
    controls |= {f"before, {by}": Control.of(by, before), f"tuned, {by}": Control.of(by, result.law)}
    sheet, axes = plot.new_figure(3, size=(9.0, 8.0), sharex=True)
    for (name, control), colour in zip(controls.items(), plot.COLOURS, strict=False):
        trace = drive_full(case, controller_of(case, control))
        style = {"color": colour, "ls": "--" if "before" in name else "-", "label": name, "lw": 1.3}
        for axis, channel in zip(axes, ("body_x", "slip_ml", "sinkage_ml"), strict=True):
            axis.plot(trace.t, trace[channel], **style)
    for axis, label in zip(axes, ("x [m]", "true slip, middle left [-]", "sinkage, middle left [m]"), strict=True):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8, ncols=2)
    axes[0].set_title(case.name)
    axes[-1].set_xlabel("t [s]")
    plot.save(sheet, out / "before_after.png")


if __name__ == "__main__":
    main()
