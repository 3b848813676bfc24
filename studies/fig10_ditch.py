"""Fig 10: drive through the sandy ditch with and without slip control, and find when the paper's result is reproduced.

Question
    In the paper, the rover without control stops at the far wall and stays at S = 1. With control (S_d = 0.1) the
    wheels slow down, the slip falls, and the rover drives out. Does the paper's model produce this result? If it does
    not, which effect is missing?
Method
    The ditch is 0.05 m deep and 0.2 m wide. The paper does not state the wall angle, so the wall angle is the first
    axis of the map. A constant duty of 0.55 is compared with the PI controller of Fig 9 at several gains. The
    controller reads the true slip or the estimate of Eq 9. For most sands F rises with S, as in Eqs 2-7: Table 1; sands
    with a smaller k, whose R makes the rover cruise on the flat at S = 0.05; and k = 2.5 mm with R = 0.03 < F(0), where
    the rover drives on the flat at S = -0.07. The last sand is repeated with `PostPeak`, a loss of shear strength past
    the peak, which the paper's text mentions and Eq 2 lacks. A drive counts as "out" if the rear wheels pass the far
    lip within 45 s with the usual time step and with half of it. If the two step sizes disagree, the drive counts as
    "open". All drives are mirror-symmetric.
Result
    Table 1 reproduces the left half of Fig 10 at every wall angle (a ditch of this size has no wall below 26.6 deg). At
    30 deg the rover drives at 0.050 m/s and S = 0.05 for 5 s, and at 0.17 m/s down the near wall. The front wheels stop
    at the far wall at 8.0 s, and S > 0.95 from 11 s on. The right half is not reproduced: 0 of 80 controlled drives get
    out. No sand whose F rises with S reproduces the right half either. Over four values of k, control rescues 0 of 156
    stuck drives with the true slip and 0 of 52 with Eq 9. The slip falls, and F(S) falls with it. The true slip turns
    60 of 84 passes into failures, and Eq 9 turns 5 of 28 passes into failures.
    With a strength loss past the peak, the paper's result appears in a window of 1.5 to 2 deg of wall angle: with 30 %
    lost, 9 rescues of 42 at 49 to 50 deg; with 50 % lost, 13 rescues of 42 at 46.5 to 48 deg. All rescues but one have
    S_d = 0.2. At 47 deg S rises to 0.85, the wheels stop and roll back, S falls, and the rover is out 12 s later. Eq 9
    rescues no drive and loses 1 of 24. No outcome depends on the step. The paper's result therefore needs a strength
    loss, a wall angle just beyond the angle that the constant duty can climb, and a controller that reads the true
    slip. `fig10_hinges.py` changes the other numbers (R = 0.1 widens the window to 9 deg).
What the paper says
    Without: "the vehicle lost the velocity at t = 7 [s]. After the vehicle has stopped, the wheel was yet rotating
    constantly, then the slip ratio went up to S = 1 and there was no chance to get recovered." With: "when the slip
    ratio went to S = 1 at t = 8 [s], the slip control functioned to slow down the wheel velocity. This action worked
    out successfully to get the tire slip decreased, as well as the vehicle velocity increased. Finally, after t = 14
    [s] the rover went out of the ditch".
What differs
    Eqs 2-7 give no reason why slip control helps: the pull rises with the slip. Eq 9 reads a wheel that the load slows
    down as a wheel that grips, and the controller then raises the duty. In the drives found here the rear wheels hang
    at the far wall, while in the paper the front wheels do, and the sand is much stiffer (k = 2.5 mm) than that of
    Table 1.

Run: python studies/fig10_ditch.py [--quick] [--out DIR] [--workers N]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from rover_pin.control.slip_control import SlipControl
from rover_pin.effects.post_peak import PostPeak
from rover_pin.plot import COLOURS, configuration, draw_rover, ground_line, save, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import ditch

OUT_AT = 0.95
"""Position x of the body [m] from which the rover is out of the ditch: the rear wheels, 0.155 m behind the body, have
then passed the far edge of the ditch at 0.7 m."""
DURATION = 45.0
LOW_RESISTANCE = {"soil.k": 0.0025, "effect.MotionResistance.R": 0.03}


@dataclass(frozen=True)
class Sand:
    """A sand, its strength loss past the peak (None: no loss), and the wall angles [deg] that are driven on it."""

    label: str
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    loss: PostPeak | None = None
    walls: tuple[float, ...] = (27.0, 30.0, 33.0, 36.0, 39.0, 42.0, 45.0, 50.0, 55.0, 60.0)


class Control(NamedTuple):
    """A control of the map: none, or the PI controller with one source of slip and one set of gains."""

    kind: str
    S_d: float = 0.1
    k_p: float = 0.1
    k_i: float = 1.0

    @property
    def label(self) -> str:
        """Return the name of this control on the map."""
        words = {"none": "duty 0.55", "true": "true slip", "eq9": "Eq 9"}
        gains = "" if self.kind == "none" else f"  {self.S_d:g}  {self.k_p:g}  {self.k_i:g}"
        return words[self.kind] + gains


SANDS = (
    Sand("Table 1: k = 50 mm"),
    Sand("k = 25 mm, R = 0.054", {"soil.k": 0.025, "cruise_slip": 0.05}),
    Sand("k = 10 mm, R = 0.12", {"soil.k": 0.010, "cruise_slip": 0.05}),
    Sand("k = 2.5 mm, R = 0.03", LOW_RESISTANCE, None, (40.0, 50.0, 52.0, 54.0, 56.0, 58.0, 60.0, 65.0, 70.0, 80.0)),
    Sand("the same, 30 % lost", LOW_RESISTANCE, PostPeak(fraction=0.3), tuple(np.arange(46.0, 52.1, 0.5))),
    Sand("the same, 50 % lost", LOW_RESISTANCE, PostPeak(fraction=0.5), tuple(np.arange(43.5, 49.6, 0.5))),
)
GAINS = ((0.1, 0.3), (0.1, 1.0), (0.3, 3.0))
CONTROLS = (
    Control("none"),
    *(Control("true", S_d, *gains) for S_d in (0.1, 0.2) for gains in GAINS),
    *(Control("eq9", 0.1, *gains) for gains in GAINS[:2]),
)
STORY = (SANDS[5], 47.0, Control("true", 0.2, 0.1, 1.0))
"""The drive in which the paper's result appears most clearly: sand, wall angle [deg], control."""
SHOWN = {
    "Table 1, walls 30 deg:\nwithout control": (SANDS[0], 30.0, Control("none")),
    "Table 1, walls 30 deg:\ntrue slip, S_d = 0.1": (SANDS[0], 30.0, Control("true")),
    "50 % of a stiff sand's shear lost, walls 47 deg:\nwithout control": (*STORY[:2], Control("none")),
    "50 % of a stiff sand's shear lost, walls 47 deg:\ntrue slip, S_d = 0.2": STORY,
}
"""The drives of the figure: title -> sand, wall angle [deg], control."""


def main() -> None:
    """Drive all cases of the map of parameters, write the tables and figures, and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a map of two sands, two walls and three controls")
    parser.add_argument("--out", type=Path, default=Path("out/fig10_ditch"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    # The drives of the figure first; they take seconds, while the map takes minutes.
    traces = shown()
    write_csv(histories(traces), options.out / "fig10_ditch.csv")
    first = save(draw_story(traces), options.out / "fig10_ditch.png")
    table = outcomes(planned(options.quick), options.workers, csv := options.out / "fig10_map.csv")
    second = save(draw_map(table), options.out / "fig10_map.png")
    print(summary(table).to_string(index=False))
    print(f"written: {csv}, {first}, {second}")


@lru_cache(maxsize=32)
def prepared(sand: Sand, kind: str) -> Scenario:
    """Return the ditch scenario of this sand and kind of control. `case_of` sets the wall angle and the gains later."""
    base = scenario("ditch", soil="table-1", **sand.settings, control=kind, duration=DURATION)
    return dataclasses.replace(base, model=base.model.having(sand.loss)) if sand.loss else base


def case_of(sand: Sand, wall: float, control: Control) -> Scenario:
    """Return the scenario of one map cell, with its wall angle [deg] and its gains."""
    base = prepared(sand, control.kind)
    model, law = base.model.replace(terrain=ditch(wall_angle=math.radians(wall))), base.controller
    if isinstance(law, SlipControl):
        gains = law.gains.replace(S_d=control.S_d, k_p=control.k_p, k_i=control.k_i)
        law = dataclasses.replace(law, gains=gains, integral=0.0)
    return dataclasses.replace(base, model=model, controller=law)


def time_out(trace: Trace) -> float:
    """Return the time at which the rover is out of the ditch [s], or NaN if the rover stays in."""
    past = np.flatnonzero(trace["body_x"] > OUT_AT)
    return float(trace.t[past[0]]) if past.size else math.nan


def planned(quick: bool) -> list[tuple[Sand, float, Control]]:
    """Return the cells of the map of results, each given by its sand, its wall angle [deg] and its control."""
    if quick:
        controls = (CONTROLS[0], STORY[2], CONTROLS[-1])
        return [
            (sand, wall, chosen) for sand in (SANDS[0], STORY[0]) for wall in sand.walls[6:8] for chosen in controls
        ]
    return [(sand, wall, control) for sand in SANDS for wall in sand.walls for control in CONTROLS]


def outcome(case: Scenario, sand: Sand, wall: float, control: Control) -> dict[str, Any]:
    """Return the result for one cell of the map as a row, from a drive with the usual time step and a drive with half
    of it.
    """
    traces = [case.drive(), dataclasses.replace(case, timing=case.timing.with_half_step()).drive()]
    times = [time_out(trace) for trace in traces]
    # The two step sizes must agree; otherwise the outcome is numerical and counts as open.
    got = [math.isfinite(time) for time in times]
    verdict = "open" if got[0] != got[1] else "out" if got[0] else "stuck"
    end = {"end_x_m": float(traces[1]["body_x"][-1]), "stop": traces[1].attrs["stop"]}
    cell = {"sand": sand.label, "wall_deg": wall, "control": control.label, **control._asdict()}
    return cell | {"verdict": verdict, "out_s": times[0], "out_half_dt_s": times[1], **end}


def outcomes(plan: list[tuple[Sand, float, Control]], workers: int, csv: Path) -> pd.DataFrame:
    """Drive every cell of the map in parallel and return the table; the CSV is updated after every 20 cells."""
    # Results arrive in the order of the plan, so the CSV is valid at any time.
    results = Parallel(n_jobs=workers, return_as="generator", batch_size=4)(
        delayed(outcome)(case_of(*cell), *cell) for cell in plan
    )
    rows = []
    for row in results:
        rows.append(row)
        table = pd.DataFrame(rows).round(4)
        if len(rows) % 20 == 0 or len(rows) == len(plan):
            write_csv(table, csv)
        print(f"\r{len(rows)} of {len(plan)} cases", end="\n" if len(rows) == len(plan) else "", flush=True)
    return table


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a summary for each sand: the largest wall angle that the rover passes without control, and the numbers of
    drives in which control rescues the rover, or loses it.
    """
    rows = []
    for sand, part in table.groupby("sand", sort=False):
        # Each controlled drive is compared with the uncontrolled drive at the same wall angle.
        bare = part[part.kind == "none"].set_index("wall_deg").verdict
        controlled = part[part.kind != "none"]
        before = controlled.wall_deg.map(bare)
        rescued = controlled[(before == "stuck") & (controlled.verdict == "out")]
        lost = controlled[(before == "out") & (controlled.verdict == "stuck")]
        passed = bare[bare == "out"].index
        row = {"sand": sand, "passes_up_to_deg": passed.max() if len(passed) else None, "cases": len(controlled)}
        for kind in ("true", "eq9"):
            row[f"rescued_{kind}"] = (
                f"{(rescued.kind == kind).sum()} of {((before == 'stuck') & (controlled.kind == kind)).sum()}"
            )
            row[f"lost_{kind}"] = (
                f"{(lost.kind == kind).sum()} of {((before == 'out') & (controlled.kind == kind)).sum()}"
            )
        rescues = sorted(rescued.wall_deg.unique())
        row["rescued_at_deg"] = f"{rescues[0]:g} to {rescues[-1]:g}" if rescues else "-"
        rows.append(row | {"open": int((part.verdict == "open").sum())})
    return pd.DataFrame(rows)


def shown() -> dict[str, tuple[Scenario, Trace]]:
    """Simulate the drives of the figure, and return them: title -> scenario and trace."""
    cases = {title: case_of(*cell) for title, cell in SHOWN.items()}
    return {title: (case, case.drive()) for title, case in cases.items()}


def histories(traces: dict[str, tuple[Scenario, Trace]]) -> pd.DataFrame:
    """Return slip, duty and wheel rate of the left wheels over time for each drive of the figure."""
    parts = []
    for title, (_, trace) in traces.items():
        part = {
            "drive": title.replace("\n", " "),
            "t_s": trace.t,
            "body_x_m": trace["body_x"],
            "speed_mps": trace["body_vx"],
        }
        # One wheel of each axle is enough, because the drives are mirror-symmetric.
        part |= {
            f"{name}_{wheel}": trace[f"{name}_{wheel}"]
            for name in ("slip", "duty", "wheel_rate")
            for wheel in ("fl", "ml", "rl")
        }
        parts.append(pd.DataFrame(part)[::5].round(6))
    return pd.concat(parts)


def draw_story(traces: dict[str, tuple[Scenario, Trace]]) -> Figure:
    """Draw the drives of the figure: snapshots, slip, speed and rim speeds, one column for each drive."""
    figure = Figure(figsize=(18, 9), layout="constrained")
    axes = figure.subplots(4, len(traces), sharey="row")
    for column, (title, (case, trace)) in zip(axes.T, traces.items(), strict=True):
        # From top to bottom: snapshots, slip, speed of the body, rim speeds.
        snapshots(column[0], case, trace)
        column[0].set_title(title, fontsize=10)
        column[1].plot(trace.t, trace["slip_ml"], color=COLOURS[1])
        column[2].plot(trace.t, 1e3 * trace["body_vx"], color="black")
        for wheel, name, colour in (("fl", "front", 0), ("ml", "middle", 1), ("rl", "rear", 2)):
            column[3].plot(trace.t, 45.0 * trace[f"wheel_rate_{wheel}"], color=COLOURS[colour], label=name, lw=1.1)
        column[1].set(ylim=(-0.3, 1.05))
        column[2].set(ylim=(-45, 190))
        column[3].set(xlabel="t [s]", ylim=(-45, 110))
        for axis in column[1:]:
            axis.set_xlim(0, 35)
            axis.grid(alpha=0.3)
    labels = ("z [m]", "slip of the middle wheel [-]", "speed [mm/s]", "rim speeds [mm/s]")
    for axis, label in zip(axes[:, 0], labels, strict=True):
        axis.set_ylabel(label)
    axes[3, 0].legend(fontsize=8, ncols=3, loc="upper left")
    return figure


def snapshots(axes: Axes, case: Scenario, trace: Trace) -> None:
    """Draw the rover at three positions in the ditch, with the time of each."""
    low, high = -0.05, 1.25
    x, z = ground_line(case.model.terrain, low, high, 0.16)
    axes.fill_between(x, z, -0.09, color="#d9c9a5", lw=0)
    axes.plot(x, z, color="#8a7340", lw=1)
    places = np.linspace(0.2, min(1.0, float(np.max(trace["body_x"]))), 3)
    for colour, place in zip(("0.6", "0.35", "0.0"), places, strict=True):
        # The body may roll back, so the first passage is searched in the running maximum of x.
        at = int(np.searchsorted(np.maximum.accumulate(trace["body_x"]), place - 1e-9))
        draw_rover(axes, case.model.rover, configuration(case.model.rover, trace, min(at, len(trace.t) - 1)), colour)
        axes.text(place, 0.16, f"{trace.t[min(at, len(trace.t) - 1)]:.0f} s", ha="center", fontsize=9, color=colour)
    axes.set(aspect="equal", xlim=(low, high), ylim=(-0.09, 0.2), xlabel="x [m]")


def draw_map(table: pd.DataFrame) -> Figure:
    """Draw one map panel for each sand."""
    sands = list(dict.fromkeys(table.sand))
    # One panel above the other: on a page of 690 pixels, two panels side by side have letters of 5 pixels.
    figure = Figure(figsize=(8.0, 3.1 * len(sands)), layout="constrained")
    for axes, sand in zip(figure.subplots(len(sands), squeeze=False).ravel(), sands, strict=True):
        panel(axes, table[table.sand == sand], sand)
    figure.suptitle(
        "seconds until out; x: stuck; ?: not the same at half the step\nrows: slip, S_d, k_p, k_i", fontsize=11
    )
    return figure


def panel(axes: Axes, part: pd.DataFrame, title: str) -> None:
    """Draw the panel of one sand, with walls from left to right and controls from top to bottom."""
    walls, controls = sorted(part.wall_deg.unique()), list(dict.fromkeys(part.control))
    colours = {"out": "#9ecae1", "stuck": "#fdd0a2", "open": "#d8d8d8"}
    for cell in part.itertuples():
        # Column and row of the cell in the panel.
        at = walls.index(cell.wall_deg), controls.index(cell.control)
        axes.add_patch(Rectangle((at[0] - 0.48, at[1] - 0.48), 0.96, 0.96, color=colours[cell.verdict], lw=0))
        word = {"out": f"{cell.out_s:.0f}", "stuck": "x", "open": "?"}[cell.verdict]
        axes.text(*at, word, ha="center", va="center", fontsize=9.5)
    axes.set(xlim=(-0.5, len(walls) - 0.5), ylim=(len(controls) - 0.5, -0.5), title=title, xlabel="wall angle [deg]")
    axes.set_xticks(range(len(walls)), [f"{wall:g}" for wall in walls])
    axes.set_yticks(range(len(controls)), controls, fontsize=9.5)


if __name__ == "__main__":
    main()
