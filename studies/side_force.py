"""Turning, crabbing and side slopes with the old and the new law of the side force.

Question
    What does the law of the side force that measured wheels require (studies/wheel_laws.py) change in a drive?
Method
    Nexus 6 on sand of k = 3 mm, 20 s at duty 0.55. The old law is `SideShear`: f_y is limited by the part of the shear
    strength at the middle of the contact that f_t does not use. The new law is `CombinedShear`, one shear stress for
    thrust and side force at every point of the rim, opposite to the whole sliding motion, with `FlankPressure` on the
    buried part of the disc and the numbers of measured wheels. For comparison: the combined shear alone, and the new
    law with `SlipSoftening`, which lets the wheel sink at a slip angle. Turn: Ackermann angles for a radius of 1 m.
    Crab: all steered wheels at 20 deg to one side, the others dragged. Across: straight ahead over a slope that falls
    to the left by 10 deg. Skid: the cart, without steering, on the spot, with the speeds of its sides held for 7.98
    deg/s. The last 5 s give: the driven radius, the angle between the direction of travel and the body's axis, the
    maximum of side force divided by load, and the motor work per metre.
Result
    The effect on a steered turn is small: a radius of 0.939 m with the old law, 0.934 with the new. In crabbing, the
    side force of the dragged middle wheels falls from 0.40 of their load to 0.34 (thrust and side force share one
    strength), at the same direction, 16.8 deg of 20 commanded, and 4 % less speed. Across the slope the rover drifts
    down by 2.97 deg, with the old law by 3.95 deg: the old law used the shear at mid-contact, which at a small slip
    angle is less than the shear over the arc. A cart that skids on the spot (k = 20 mm) turns at 4.76 deg/s, with the
    old law at 5.99 deg/s, and with the combined shear alone at 5.34 deg/s: the pressure on the flank slows the turn
    further. Where slip and drift soften the sand, it sinks by 48 mm and turns at 1.45 deg/s.
    With the flank that measured wheels require, turning and crabbing on sand stay easy while the wheels sink by 9 mm,
    but not if they sink deeper. Half the step moves each of these drives by less than 1e-3 mm and 1e-4 deg.
    The scenes turn, point-turn, crab and cross-slope use the new law, and so does any drive whose controller steers,
    which the drive reports; `--set side=shear` selects the old law. Other scenes keep the old law (`--set
    side=combined` selects the new law), because independent simulators and shipped logs use it, and on straight drives
    both are equal.
What the paper says
    The paper has no side force, and no turning drive.
What differs
    B, k_f and l of the flank were fitted to wheels of 125 mm in another sand; no turning rover was measured here.

Run: python studies/side_force.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from rover_pin.control.open_loop import Crab
from rover_pin.parameters import TABLE_1
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.defaults import own_soil
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.trace.trace import Trace

LAST = 5.0
"""Duration at the end of a drive over which it is measured [s]."""
LAWS: dict[str, tuple[str, ...]] = {
    "old: SideShear": (),
    "combined shear alone": ("CombinedShear",),
    "new: combined shear, flank": ("CombinedShear", "FlankPressure"),
    "new, and slip softens": ("CombinedShear", "FlankPressure", "SlipSoftening"),
}
SAND = {"soil": TABLE_1.replace(k=0.003)}
WAYS: dict[str, dict[str, Any]] = {
    "turn": {"control.radius": 1.0, **SAND},
    "skid": {"rover": "cart", "control": "point-turn", "soil": own_soil(load_rover("cart")).value.replace(k=0.02)},
    "crab": SAND,
    "across": {
        "control": "none",
        "terrain.angle_deg": 10.0,
        "start.yaw_deg": 90.0,
        "effect.MotionResistance.R": 0.028,
        **SAND,
    },
}
PATH = ("x [m]", "y [m]")
PANELS = {
    "turn": ("turn, asked for 1 m of radius: path", *PATH),
    "skid": ("a cart skids on the spot: heading", "t [s]", "turned to the left [deg]"),
    "crab": ("crab, wheels at 20 deg: path", *PATH),
    "across": ("across a slope of 10 deg: drift", "along the contour [m]", "drifted downhill [mm]"),
}
"""Title, x label and y label of each panel."""
SCENE = {"turn": "turn", "skid": "turn", "crab": "crab", "across": "park"}


def main() -> None:
    """Drive every manoeuvre with every law, write the table and the figure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="old and new, 10 s")
    parser.add_argument("--out", type=Path, default=Path("out/side_force"))
    options = parser.parse_args()
    names = [name for name in LAWS if not options.quick or name.startswith(("old:", "new:"))]
    # Every manoeuvre with every law, 20 s each.
    traces = {(way, name): driven(way, LAWS[name], 10.0 if options.quick else 20.0) for way in WAYS for name in names}
    table = pd.DataFrame([row(way, name, trace) for (way, name), trace in traces.items()])
    csv = write_csv(table, options.out / "side_force.csv")
    png = save(draw(traces), options.out / "side_force.png")
    print(table.to_string(index=False, float_format=lambda value: f"{value:.3g}"))
    print(f"written: {csv}, {png}")


def driven(way: str, law: tuple[str, ...], duration: float) -> Trace:
    """Return the trace of a simulated manoeuvre, after the given effects were added to the model."""
    case = scenario(SCENE[way], duration=duration, side="shear", add=law, **WAYS[way])
    if way != "across":
        return case.drive()
    # Straight ahead across the slope: a crab angle of zero keeps the wheels straight.
    return simulate(case.model, Crab.of(case.model.built, 0.0), duration, case.start, Timing())


def row(way: str, name: str, trace: Trace) -> dict[str, Any]:
    """Return the results of a drive as a row of the table, measured over its last LAST seconds."""
    late = trace.t >= trace.t[-1] - LAST
    x, y, yaw = (trace[f"body_{coordinate}"][late] for coordinate in ("x", "y", "yaw"))
    dx, dy, turned = np.diff(x), np.diff(y), float(np.unwrap(yaw)[-1] - yaw[0])
    travelled = float(np.hypot(dx, dy).sum())
    # Angle between the direction of travel and the body's axis.
    off = np.arctan2(dy, dx) - yaw[1:]
    side = np.abs(trace.stack("lateral")[late]) / trace.stack("normal")[late]
    return {
        "way": way,
        "law": name,
        "speed_mmps": 1e3 * travelled / LAST,
        "turned_deg_per_s": math.degrees(turned) / LAST,
        "radius_m": travelled / abs(turned) if abs(turned) > 1e-3 else math.inf,
        "travel_to_axis_deg": math.degrees(float(np.mean(np.arctan2(np.sin(off), np.cos(off))))),
        "slip": float(trace.stack("slip")[late].mean()),
        "side_over_load": float(side.mean(axis=0).max()),
        "sinkage_mm": 1e3 * float(trace.stack("sinkage")[late].max()),
        "work_J_per_m": float(np.ptp(trace["energy_motor"][late])) / travelled,
    }


def draw(traces: dict[tuple[str, str], Trace]) -> Figure:
    """Draw the paths, headings and drifts of each manoeuvre with every law."""
    figure = Figure(figsize=(11, 7), layout="constrained")
    panels = dict(zip(WAYS, figure.subplots(2, 2).ravel(), strict=True))
    # Colour and line style belong to a law in all panels.
    looks = dict(zip(LAWS, zip(COLOURS, ("-", "-", "--", ":"), strict=False), strict=True))
    for (way, name), trace in traces.items():
        colour, style = looks[name]
        panels[way].plot(*seen(way, trace), label=name, color=colour, ls=style, lw=1.8)
    for way, axes in panels.items():
        title, along, beside = PANELS[way]
        axes.set(title=title, xlabel=along, ylabel=beside)
        axes.grid(alpha=0.3)
    figure.legend(*panels["turn"].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def seen(way: str, trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Return the curve that a panel shows: the heading over time for a skid, the drift down the slope for a drive
    across a slope, and the path for all other manoeuvres.
    """
    x, y = (trace[f"body_{coordinate}"] - trace[f"body_{coordinate}"][0] for coordinate in ("x", "y"))
    if way == "skid":
        return trace.t, np.degrees(np.unwrap(trace["body_yaw"]))
    return (y, -1e3 * x) if way == "across" else (x, y)


if __name__ == "__main__":
    main()
