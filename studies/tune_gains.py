"""What tuned gains are worth: the paper's slip control before and after, by true slip and by Eq 9, beside none at all.

Question
    The paper gives S_d = 0.1 and no gains. What gains does an optimiser choose for ditches, slopes, bumps and weak
    motors together, what do they cost on drives that it has not seen, and is the control better than constant duty?
Method
    `tune_gains` on studies/tune_ditch.toml, once with the true slip fed back, once with Eq 9's estimate: differential
    evolution and adjoint L-BFGS on the reduced model, judged by the full rover. Then the landscape over k_p and k_i at
    the paper's S_d and at the tuned one, on the reduced model, and the training drive that changes most.
Result
    Both tunings run away from the paper's S_d = 0.1 to 0.86 and 0.88, where the control hardly ever acts. Mean cost on
    training / held-out drives: constant duty 0.343 / 0.296; hand-set gains 1.254 / 1.249 with the true slip (67 %
    stuck) and 0.351 / 0.315 with Eq 9; tuned 0.350 / 0.302 (true slip) and 0.350 / 0.301 (Eq 9), none stuck. Worst
    held out: 0.473, 1.779, 0.527, 0.491, 0.485. So tuning saves the control, and constant duty is still better.
    Reduced model against the full rover: slip RMSE 0.02 and speed RMSE 1.6 mm/s on inclines, 0.06 and 5.5 mm/s on a
    bump, 0.31 to 0.41 and 19 to 25 mm/s in ditches, which it leaves some seconds too early.
What the paper says
    Section 5: with the control the rover leaves a ditch in which it stays without.
What differs
    No gains do that here: F(S) never falls with the slip (or falls too little), so that less slip is less thrust.

Run: python studies/tune_gains.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin import plot
from rover_pin.control.evaluations import Evaluations
from rover_pin.control.tuning import reduced_costs, tune_gains, values
from rover_pin.control.tuning_drives import CONSTANT, Control, controller_of, drive_full
from rover_pin.control.tuning_report import TuningResult
from rover_pin.control.tuning_study import ESTIMATES, DriveCase, Effort, TuningStudy, read_tuning

EXAMPLE = Path(__file__).parent / "tune_ditch.toml"
K_P = K_I = (0.01, 10.0)


def main() -> None:
    """Tune twice, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two drives and hardly any search: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/tune_gains"))
    options = parser.parse_args()
    study = read_tuning(EXAMPLE)
    if options.quick:
        study = dataclasses.replace(
            study,
            training=study.training[-2:],
            held_out=study.held_out[-2:],
            effort=Effort(population=5, generations=0, starts=1, steps=1, keep=1),
        )
    results = {}
    for estimate in ESTIMATES:
        results[estimate] = tune_gains(dataclasses.replace(study, estimate=estimate), options.out / estimate)
        print(f"tuned by {estimate} slip: {results[estimate].gains}")
        print("\n".join(results[estimate].verdicts()), flush=True)
    table = pd.concat([digests(estimate, result) for estimate, result in results.items()])
    plot.write_csv(table, options.out / "tune_gains.csv")
    print(table.round(3).to_string(index=False))
    for name, *errors in results["true"].check:
        print(f"reduced model, {name}: slip RMSE {errors[0]:.3f}, speed RMSE {1e3 * errors[1]:.1f} mm/s")
    landscape_figure(results["true"], options.out, 4 if options.quick else 12)
    drives_figure(results, most_changed(results["eq9"]), options.out)
    print(f"written: {options.out}/tune_gains.csv, landscape.csv, landscape.png, before_after.png, */gains.toml")


def digests(estimate: str, result: TuningResult) -> pd.DataFrame:
    rows = [
        (estimate, where, control, *each)
        for where, controls in result.digests().items()
        for control, each in controls.items()
    ]
    return pd.DataFrame(rows, columns=["tuned_by", "set", "control", "mean", "worst", "tail_10", "stuck_share"])


def landscape_figure(result: TuningResult, out: Path, points: int) -> None:
    """Draw the reduced model's cost over k_p and k_i, S_d as tuned and as in the paper."""
    k_p, k_i = np.geomspace(*K_P, points), np.geomspace(*K_I, points)
    sheet, axes = plot.new_figure(1, 2, size=(12.0, 5.0), sharey=True)
    tables = []
    for axis, S_d, name in zip(axes, (result.study.before.S_d, result.gains.S_d), ("before", "tuned"), strict=True):
        cost = landscape(result.study, S_d, k_p, k_i, out)
        shown = axis.pcolormesh(log_edges(k_p), log_edges(k_i), cost.T, shading="flat", cmap="viridis")
        sheet.colorbar(shown, ax=axis, label="cost of the reduced model")
        chosen = result.gains if name == "tuned" else result.study.before
        axis.plot(chosen.k_p, chosen.k_i, "w*", ms=14, mec="black", label=f"{name} gains")
        axis.set(xscale="log", yscale="log", xlabel="k_p [-]", ylabel="k_i [1/s]", title=f"S_d = {S_d:.2f} ({name})")
        axis.legend(fontsize=8)
        grid = np.meshgrid(k_p, k_i, indexing="ij")
        tables.append(pd.DataFrame({"S_d": S_d, "k_p": grid[0].ravel(), "k_i": grid[1].ravel(), "cost": cost.ravel()}))
    plot.write_csv(pd.concat(tables), out / "landscape.csv")
    plot.save(sheet, out / "landscape.png")


def log_edges(centres: np.ndarray) -> np.ndarray:
    """Return the edges of cells whose middles on a logarithmic axis are `centres`, equally spaced there."""
    half = np.sqrt(centres[1] / centres[0])
    return np.append(centres / half, centres[-1] * half)


def landscape(study: TuningStudy, S_d: float, k_p: np.ndarray, k_i: np.ndarray, out: Path) -> np.ndarray:
    """Return the cost over the grid; resumes as the tuning does."""
    gains = [study.before.replace(S_d=S_d, k_p=float(p), k_i=float(i)) for p in k_p for i in k_i]
    return reduced_costs(study, Evaluations(out / "landscape", None, None), gains).reshape(len(k_p), len(k_i))


def most_changed(result: TuningResult) -> DriveCase:
    """Return the training drive whose cost the tuned gains change most against constant duty."""
    cost = {each.control: [score.cost(result.study.cost) for score in each.training] for each in result.drives}
    change = np.subtract(cost[f"tuned, {result.study.estimate}"], cost["constant duty"])
    return result.study.training[int(np.argmax(np.abs(change)))]


def drives_figure(results: dict[str, TuningResult], case: DriveCase, out: Path) -> None:
    """Draw x, the slip and the duty of a middle wheel without control, before and after."""
    before = results["true"].study.before
    controls: dict[str, Any] = {"constant duty": Control(CONSTANT, values(before))}
    for estimate, result in results.items():
        controls[f"before, {estimate}"] = Control(estimate, values(before))
        controls[f"tuned, {estimate}"] = Control(estimate, values(result.gains))
    sheet, axes = plot.new_figure(3, size=(9.0, 8.0), sharex=True)
    for (name, control), colour in zip(controls.items(), plot.COLOURS, strict=False):
        trace = drive_full(case, controller_of(case, control))
        style = {"color": colour, "ls": "--" if "before" in name else "-", "label": name, "lw": 1.3}
        for axis, channel in zip(axes, ("body_x", "slip_ml", "duty_ml"), strict=True):
            axis.plot(trace.t, trace[channel], **style)
    for axis, label in zip(axes, ("x [m]", "true slip, middle left [-]", "duty, middle left [-]"), strict=True):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8, ncols=2)
    axes[0].set_title(case.name)
    axes[-1].set_xlabel("t [s]")
    plot.save(sheet, out / "before_after.png")


if __name__ == "__main__":
    main()
