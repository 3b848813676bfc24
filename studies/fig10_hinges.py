"""Fig 10: on which unstated numbers does the paper's result depend?

Question
    `fig10_ditch.py` finds the paper's result, stuck with constant duty and out with slip control, in a window of wall
    angles on a sand that loses half of its shear strength past the peak. How wide is that window when one number is
    changed?
Method
    One number at a time is changed from that sand (k = 2.5 mm, R = 0.03, 50 % lost with S_w = 0.4, relaxed slip, true
    slip fed back, S_d = 0.2). Bisection to 0.5 deg finds the smallest wall angle at which constant duty is stuck. From
    there on, in steps of 0.5 deg, three sets of gains are tried, until none of them gets the rover out at two walls in
    a row. All outcomes must hold with the usual time step and with half of it; outcomes that differ between them do not
    count as a rescue.
Result
    Unchanged: stuck from 46.5 deg, out under control up to 48 deg, a window of 2 deg, 12 of 18 drives rescued. With the
    paper's S_d = 0.1 1 of 9, at 46.5 deg. No rescue with the slip of Eq 9, without a loss (stuck from 62 deg), with k =
    10 mm, or with R = F(0.05) of this k (0.34: the duty does not even pass 27 deg). 20 % lost: 0.5 deg, 30 %: 1.5 deg.
    S_w = 0.2: 1.5 deg from 40 deg on; S_w = 1: 0.5 deg. k = 5 mm: 1 deg. R = 0.10 instead of 0.03: 9 deg, from 37.5 to
    46 deg, 43 of 60 drives. Slip by Eq 1 itself: 3.5 deg. The torque limit has no effect. The result therefore needs a
    strength loss of 20 % or more at a k of 5 mm or less, an S_d above the paper's (except for one drive), and the true
    slip. The width of the window depends on the resistance R.
What the paper says
    The paper states no wall angle, gains or strength loss. It states k = 0.05 m, where no rescue occurs, and S_d = 0.1.
What differs
    The result is possible, not predicted: the paper contains none of the numbers that the result needs, and two stated
    numbers (k, S_d) contradict it.

Run: python studies/fig10_hinges.py [--quick] [--out DIR] [--workers N]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from matplotlib.figure import Figure

from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.torque_check import NoLimit
from rover_pin.effects.post_peak import PostPeak
from rover_pin.plot import save, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.terrain.shapes import ditch

OUT_AT, DURATION = 0.95, 45.0
GENTLEST, STEEPEST, STEP = 27.0, 85.0, 0.5
GAINS = ((0.1, 0.3), (0.1, 1.0), (0.3, 3.0))


class Change(NamedTuple):
    """A variant of the sand and the control, with one number changed."""

    label: str
    settings: dict[str, Any] = {}  # noqa: RUF012 - never changed
    loss: tuple[float, float] = (0.5, 0.4)
    S_d: float = 0.2
    limited: bool = True


CHANGES = (
    Change("as in fig10_ditch"),
    Change("S_d = 0.1 (the paper's)", S_d=0.1),
    Change("slip estimated by Eq 9", {"control": "eq9"}),
    Change("no strength lost", loss=(0.0, 0.4)),
    Change("20 % lost", loss=(0.2, 0.4)),
    Change("30 % lost", loss=(0.3, 0.4)),
    Change("lost at less slip: S_w = 0.2", loss=(0.5, 0.2)),
    Change("lost at more slip: S_w = 1", loss=(0.5, 1.0)),
    Change("k = 5 mm", {"soil.k": 0.005}),
    Change("k = 10 mm", {"soil.k": 0.010}),
    Change("R = 0.10", {"effect.MotionResistance.R": 0.10}),
    Change("R = F(0.05) = 0.34", {"effect.MotionResistance.R": 0.341}),
    Change("slip by Eq 1 itself", {"slip": "algebraic"}),
    Change("no torque limit", limited=False),
)


def main() -> None:
    """Find the window of each change (the wall angles at which control rescues the rover), write the table and the
    figure, and print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one change only")
    parser.add_argument("--out", type=Path, default=Path("out/fig10_hinges"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    changes = CHANGES[9:10] if options.quick else CHANGES
    csv, rows = options.out / "fig10_hinges.csv", []
    # The table is written after every change, so that an interrupted run keeps its rows.
    for row in Parallel(n_jobs=options.workers, return_as="generator")(delayed(window)(change) for change in changes):
        rows.append(row)
        table = pd.DataFrame(rows)
        write_csv(table, csv)
        print(f"{len(rows)} of {len(changes)} in {csv}: {row['change']}", file=sys.stderr, flush=True)
    png = save(draw(table), options.out / "fig10_hinges.png")
    print(table.to_string(index=False))
    print(f"written: {csv}, {png}")


def base_of(change: Change, kind: str) -> Scenario:
    """Return the ditch drive with one changed number and a kind of control. Wall angle and gains are set later."""
    settings = {"soil.k": 0.0025, "effect.MotionResistance.R": 0.03, **change.settings}
    base = scenario("ditch", soil="table-1", **{**settings, "control": kind}, duration=DURATION)
    fraction, S_w = change.loss
    model = base.model.having(PostPeak(fraction=fraction, S_w=S_w))
    return dataclasses.replace(base, model=model)


def gets_out(case: Scenario, wall: float) -> list[bool]:
    """Return two values: whether the rover gets out of the ditch with the usual time step, and with half of it."""
    model = case.model.replace(terrain=ditch(wall_angle=math.radians(wall)))
    timings = (case.timing, case.timing.with_half_step())
    cases = [dataclasses.replace(case, model=model, timing=timing) for timing in timings]
    traces = [drive.drive(measure_error=False) for drive in cases]
    return [bool(np.any(trace["body_x"] > OUT_AT)) for trace in traces]


def least_stuck(bare: Scenario) -> float:
    """Return the smallest wall angle [deg], in steps of STEP, at which the rover gets stuck at constant duty. It is
    infinite if the rover never gets stuck.
    """
    if not any(gets_out(bare, GENTLEST)):
        return GENTLEST
    low, high = GENTLEST, STEEPEST
    if any(gets_out(bare, high)):
        return math.inf
    # Bisection on multiples of STEP, so that all changes are compared on the same angles.
    while high - low > STEP:
        middle = low + STEP * round(0.5 * (high - low) / STEP)
        low, high = (middle, high) if any(gets_out(bare, middle)) else (low, middle)
    return high


def window(change: Change) -> dict[str, Any]:
    """Return the result for one changed number: the range of wall angles at which the rover gets stuck at constant duty
    and gets out with slip control.
    """
    limit = least_stuck(base_of(change, "none"))
    kind = change.settings.get("control", "true")
    rescued: dict[float, int] = {}
    misses, wall = 0, limit
    # Two walls in a row without a rescue end the window.
    while misses < 2 and wall < STEEPEST:
        rescued[wall] = sum(all(gets_out(drive, wall)) for drive in controlled(change, kind))
        misses = 0 if rescued[wall] else misses + 1
        wall += STEP
    last = max((wall for wall, count in rescued.items() if count), default=math.nan)
    width = 0.0 if math.isnan(last) else last - limit + STEP
    tried = f"{sum(rescued.values())} of {len(GAINS) * len(rescued)}"
    return {
        "change": change.label,
        "stuck_from_deg": limit,
        "rescued_to_deg": last,
        "window_deg": width,
        "rescues": tried,
    }


def controlled(change: Change, kind: str) -> list[Scenario]:
    """Return the change's drives under slip control, one for each set of gains."""
    base = base_of(change, kind)
    law = base.controller
    limit = law.limit if change.limited else NoLimit()
    laws = [SlipControl(Gains(S_d=change.S_d, k_p=k_p, k_i=k_i), law.estimate, limit) for k_p, k_i in GAINS]
    return [dataclasses.replace(base, controller=controller) for controller in laws]


def draw(table: pd.DataFrame) -> Figure:
    """Draw the window of wall angles of each change as a bar."""
    figure = Figure(figsize=(10, 0.42 * len(table) + 1.6), layout="constrained")
    axes = figure.subplots()
    for row, outcome in enumerate(table.itertuples()):
        # Three bars for each change: out with constant duty, out with control only, stuck.
        end = min(outcome.stuck_from_deg, STEEPEST)
        axes.barh(row, end - 25.0, left=25.0, color="#a8d5a2", height=0.7)
        axes.barh(row, outcome.window_deg, left=end, color="tab:blue", height=0.7)
        axes.barh(row, STEEPEST - end - outcome.window_deg, left=end + outcome.window_deg, color="#e8b4ae", height=0.7)
        if outcome.window_deg:
            axes.text(end + outcome.window_deg + 0.4, row, f"{outcome.window_deg:g} deg", va="center", fontsize=9)
    axes.set_yticks(range(len(table)), table.change)
    axes.set(xlabel="wall angle [deg]", xlim=(25.0, STEEPEST), ylim=(len(table) - 0.5, -0.5))
    axes.set_title("green: constant duty gets out; blue: only slip control does; red: stuck", fontsize=10)
    return figure


if __name__ == "__main__":
    main()
