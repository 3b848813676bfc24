"""The same drives on Earth, Mars and the Moon, with the paper's fixed angles and with angles that follow the sinkage.

Question
    What does a smaller gravity change, and how much of the answer comes from the fixed theta_1, theta_2 of Table 1?
Method
    Flat, an incline of 6 deg, a bump of sand, a bump of hard ground (0.04 m over 0.3 m), a step of 0.04 m down and the
    ditch of Fig 10 (walls 30 deg), duty 0.55, torque form. Table 1, but k = 10 mm in the ditch, where Table 1 is stuck
    everywhere. Motor and R are those for 0.05 m/s at S = 0.05 on the Earth
    (R = 0.028; 0.12 with k = 10 mm). With "fixed" angles the load decides the sinkage and F(S) does not
    care; with "sinkage" both angles follow Eq 5 at each instant. Sinkage and slip are means over wheels and time after
    the first 2 s; "lift-off" is the share of wheels and rows without a normal force, "load swing" the standard
    deviation of the normal forces over their mean. Times are repeated at half the step.
Result
    Sinkage falls with the weight, as Eq 5 has it: 8.1 mm on Earth, 4.2 on Mars, 2.4 on the Moon. With fixed angles
    nothing else changes much: flat slip 0.05 everywhere, all drives arrive within 9 % of the Earth's time (earlier, as
    the motors have less to pull). With angles that follow the sinkage the Earth is the same, but the shorter contact
    mobilises less shear: flat slip 0.14 on Mars and 0.21 on the Moon, 6 deg take 0.70 and 0.75 instead of 0.52, the
    bump of sand is passed on Earth only, the ditch takes 24.5 s on Earth, 28.8 s on Mars, and more than 40 s on the
    Moon. No wheel leaves the ground in any of these drives, not even over the step; loads swing by 10 % on Earth and by
    14 to 16 % on the Moon there. All times are the same at half the step.
What the paper says
    "the gravity is smaller then a rover bounces more dynamically" (section 1); "the smaller gravity environment such as
    on the Moon or the Mars, where the dynamic effect will be much more highlighted" (section 6). It shows no numbers.
What differs
    At 0.05 m/s and with the damping assumed here nothing bounces: the greater "dynamic effect" is a swing of the loads.
    The larger effect of gravity is in the grip, and it hinges on the angles: fixed ones, as in Table 1, hide it.

Run: python studies/gravity.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from rover_pin.motion.trace import Trace
from rover_pin.parameters.gravity import GRAVITIES
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.scenarios import Scenario, scenario

SCENES: dict[str, tuple[str, dict[str, Any], float, float]] = {
    "flat": ("flat", {}, 16.0, 0.5),
    "incline 6 deg": ("incline", {"terrain.start": 0.4}, 40.0, 0.9),
    "bump, sand": ("bump", {}, 40.0, 1.0),
    "bump, hard": ("bump", {"terrain.ground": 1}, 40.0, 1.0),
    "step down, 0.04 m": ("step", {"terrain.height": -0.04}, 40.0, 1.0),
    "ditch, k = 10 mm": ("ditch", {"soil.k": 0.010, "cruise_slip": 0.05}, 40.0, 0.95),
}
"""Name -> scenario, settings, duration [s], and the place whose passing is timed [m]."""
PLACES = ("earth", "mars", "moon")
ANGLES = ("fixed", "sinkage")


def main() -> None:
    """Compute, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="flat and ditch, one step size")
    parser.add_argument("--out", type=Path, default=Path("out/gravity"))
    options = parser.parse_args()
    scenes = ("flat", "ditch, k = 10 mm") if options.quick else tuple(SCENES)
    rows, traces = [], {}
    for scene in scenes:
        for angles in ANGLES:
            for place in PLACES:
                case = driven(scene, place, angles)
                trace = traces[scene, angles, place] = case.drive()
                rows.append(row((scene, angles, place), case, trace, options.quick))
    table = pd.DataFrame(rows)
    csv = write_csv(table, options.out / "gravity.csv")
    png = save(draw(table, traces), options.out / "gravity.png")
    print(table.to_string(index=False))
    print(f"written: {csv}, {png}")


def driven(scene: str, place: str, angles: str) -> Scenario:
    name, settings, duration, _ = SCENES[scene]
    return scenario(name, **settings, duration=duration, gravity=place, angles=angles)


def passing(trace: Trace, place: float) -> float:
    """Return when the body comes past `place` [s]; NaN if it does not."""
    past = np.flatnonzero(trace["body_x"] > place)
    return float(trace.t[past[0]]) if past.size else math.nan


def row(names: tuple[str, str, str], case: Scenario, trace: Trace, quick: bool) -> dict[str, Any]:
    scene, angles, place = names
    later = trace.t > 2.0
    normal = trace.stack("normal")[later]
    made = {"scene": scene, "angles": angles, "place": place, "g_mps2": GRAVITIES[place]}
    made |= {"sinkage_mm": 1e3 * float(np.mean(trace.stack("sinkage")[later]))}
    made |= {"slip": float(np.mean(trace.stack("slip")[later])), "time_s": passing(trace, SCENES[scene][3])}
    made |= {
        "lift_off": float(np.mean(normal < 1e-6)),
        "bogie_deg": peak(trace, "bogie_l"),
        "pitch_deg": peak(trace, "body_pitch"),
    }
    made |= {"load_swing": float(np.std(normal / np.mean(normal)))}
    if not quick:
        half = dataclasses.replace(case, timing=case.timing.halved()).drive()
        made["time_half_dt_s"] = passing(half, SCENES[scene][3])
    return {key: round(value, 3) if isinstance(value, float) else value for key, value in made.items()} | {
        "stop": trace.attrs["stop"]
    }


def peak(trace: Trace, name: str) -> float:
    return float(np.degrees(np.max(np.abs(trace[name]))))


def draw(table: pd.DataFrame, traces: dict[tuple[str, str, str], Trace]) -> Figure:
    scenes = list(dict.fromkeys(table.scene))
    figure = Figure(figsize=(13, 8.5), layout="constrained")
    above, below = figure.subfigures(2, 1)
    bars = above.subplots(1, 3)
    titles = {
        "sinkage_mm": "mean sinkage [mm]",
        "slip": "mean slip [-]",
        "time_s": "time to the mark [s] (no bar: not reached)",
    }
    for axes, (column, title) in zip(bars, titles.items(), strict=True):
        for i, (angles, place) in enumerate((angles, place) for angles in ANGLES for place in PLACES):
            part = table[(table.angles == angles) & (table.place == place)].set_index("scene")[column].reindex(scenes)
            look = {
                "color": COLOURS[PLACES.index(place)],
                "hatch": "" if angles == "fixed" else "///",
                "edgecolor": "white",
            }
            axes.bar(np.arange(len(scenes)) + 0.13 * (i - 2.5), part, 0.125, label=f"{place}, {angles} angles", **look)
        axes.set_xticks(range(len(scenes)), [name.replace(", ", "\n") for name in scenes], fontsize=8)
        axes.set_title(title, fontsize=10)
        axes.grid(axis="y", alpha=0.3)
    above.legend(*bars[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    lines = below.subplots(1, 2)
    for axes, angles in zip(lines, ANGLES, strict=True):
        for place, colour in zip(PLACES, COLOURS, strict=False):
            trace = traces[scenes[-1], angles, place]
            axes.plot(trace.t, 1e3 * trace["body_vx"], color=colour, label=place, lw=1.2)
        axes.set(title=f"{scenes[-1]}: {angles} angles", xlabel="t [s]", ylabel="speed [mm/s]", ylim=(-20, 110))
        axes.legend(fontsize=8, loc="upper right")
        axes.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    main()
