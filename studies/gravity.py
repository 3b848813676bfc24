"""The same drives on Earth, Mars and the Moon, with the paper's fixed angles and with angles that follow the sinkage.

Question
    What does a smaller gravity change, how much of the change comes from the fixed theta_1, theta_2 of Table 1, and is
    the dynamic effect larger, as the paper expects, at the paper's speed and at higher speeds?
Method
    The drives are: flat, an incline of 6 deg, a bump of sand, a bump of hard ground (0.04 m over 0.3 m), a step of 0.04
    m down, and the ditch of Fig 10 (walls 30 deg), at duty 0.55. The pull of a wheel is its torque divided by r (the
    form "torque" of the traction law). The soil is Table 1, but k = 10 mm in the ditch, because with Table 1 the rover
    is stuck there on Earth, Mars and the Moon. The motor and the motion resistance R (a force as a fraction of the
    wheel load) give 0.05 m/s at the slip S = 0.05 on Earth: R = 0.028, and 0.12 with k = 10 mm. With "fixed" angles the
    load determines the sinkage, but the load does not change F(S), the ratio of pull to load. With "sinkage" both
    angles follow Eq 5 at each instant. Sinkage and slip are means over wheels and time after the first 2 s. "lift-off"
    is the share of wheels and rows whose normal force is 0. "load swing" is the standard deviation of the normal forces
    divided by their mean.
    In the fast drives, the motors are geared to 0.05 to 1 m/s on the Earth's flat. After a run-up of 4 m, the rover
    meets the hard bump or a washboard of sand (5 waves, 20 mm high, 0.3 m long). The angles follow the sinkage, and the
    step is 1 ms. The Froude number is v^2 / (g 0.3 m) at that speed. Loads are divided by a sixth of the weight.
    Everything is repeated with half the time step.
Result
    Sinkage falls with the weight, as Eq 5 predicts: 8.1 mm on Earth, 4.2 on Mars, 2.4 on the Moon. With fixed angles
    little else changes: flat slip is 0.05 everywhere, and all drives arrive within 9 % of the Earth's time (the ditch
    earlier, because the motors have less to pull; the step down 1 % later). With angles that follow the sinkage, Earth
    is unchanged, but the shorter contact mobilises less shear on Mars and the Moon: flat slip is 0.14 on Mars and 0.21
    on the Moon; on the 6 deg incline the slip is 0.73 and 0.75 instead of 0.52; the bump of sand is passed on Earth
    only; the ditch takes 24.6 s on Earth, 22.5 s on Mars and 23.8 s on the Moon. No wheel leaves the ground in any of
    these drives, not even over the step. Loads there swing by 9 to 10 % on Earth and by 15 to 19 % on the Moon (14 to
    18 % with half the time step). All times are the same with half the time step.
    Fast drives differ strongly on the Moon. Over the hard bump at 0.2 m/s the loads peak at 1.3, 1.6 and 2.8 times the
    static loads on Earth, Mars and Moon; at 0.5 m/s at 1.6, 2.6 and 4.6, and lunar wheels are in the air for 2 % of the
    time; at 1 m/s at 2.5, 7.3 and 12.3, with wheels in the air for 0, 12 and 29 %, for a maximum of 0.19 s on Mars and
    0.48 s on the Moon. The washboard lifts wheels on the Moon at 1 m/s only (10 %). No wheel lifts at a Froude number
    below 0.08. Grip builds up slowly too: with the 1 m/s gear, the rover on the Moon reaches 0.68 m/s within 4 m.
    Shares in the air agree within 0.002 with half the time step, peaks within 4 % (10 % with another damping). A third
    or three times the assumed damping of the soil changes the share in the air at 1 m/s from 12 to 20 or 10 % on Mars
    and from 29 to 49 or 28 % on the Moon. Neither damping makes wheels leave the ground on Earth, and neither keeps all
    wheels on the ground on Mars and the Moon.
What the paper says
    "the gravity is smaller then a rover bounces more dynamically" (section 1); "the smaller gravity environment such as
    on the Moon or the Mars, where the dynamic effect will be much more highlighted" (section 6). It shows no numbers.
What differs
    At 0.05 m/s and with the damping assumed here no wheel bounces; the larger "dynamic effect" is a swing of the loads.
    The larger effect of gravity is on the grip. This effect depends on the angles: fixed angles, as in Table 1, hide
    it. Bouncing depends on speed: it begins at about 0.2 to 0.5 m/s on the Moon, where the rover on Earth still rolls.

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

from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.parameters.gravity import EARTH, GRAVITIES
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SLIP
from rover_pin.simulation.simulate import Timing
from rover_pin.simulation.trace.trace import Trace

SCENES: dict[str, tuple[str, dict[str, Any], float, float]] = {
    "flat": ("flat", {}, 16.0, 0.5),
    "incline 6 deg": ("incline", {"terrain.start": 0.4}, 40.0, 0.9),
    "bump, sand": ("bump", {}, 40.0, 1.0),
    "bump, hard": ("bump", {"terrain.ground": 1}, 40.0, 1.0),
    "step down, 0.04 m": ("step", {"terrain.height": -0.04}, 40.0, 1.0),
    "ditch, k = 10 mm": ("ditch", {"soil.k": 0.010}, 40.0, 0.95),
}
"""Name -> scenario, settings, duration [s], and the position whose passing is timed [m]."""
PLACES = ("earth", "mars", "moon")
FAST: dict[str, tuple[str, dict[str, Any], float]] = {
    "bump, hard": ("bump", {"terrain.ground": 1}, 1.2),
    "washboard": ("washboard", {"terrain.count": 5}, 2.2),
}
"""Name -> scenario, settings, and end of the evaluated section [m]. The section begins at FROM."""
SPEEDS, FROM, RUN_UP, LENGTH = (0.05, 0.2, 0.5, 1.0), 0.3, 4.0, 0.3
"""Numbers of the fast drives: speeds on level ground on Earth (SPEEDS) [m/s], start of the evaluated section (FROM),
distance before the obstacle at which the drive starts (RUN_UP), and length of a bump and of a wave (LENGTH) [m]."""
DAMPING = (3.0, 10.0, 30.0)
"""Damping of the soil [s/m]: about a third of the assumed damping, the assumed damping 10, and three times the assumed
damping."""
FAST_TIMING = Timing(0.001, 0.05, 0.005)
ANGLES = ("fixed", "sinkage")


def main() -> None:
    """Drive all slow and fast cases, write tables and figures, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="flat and ditch, one step size")
    parser.add_argument("--out", type=Path, default=Path("out/gravity"))
    options = parser.parse_args()
    scenes = ("flat", "ditch, k = 10 mm") if options.quick else tuple(SCENES)
    rows, traces = [], {}
    # Slow drives: every scene with both angle laws at every place.
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
    # Fast drives need other motors and a finer step.
    fast, courses = fast_drives(SPEEDS[-1:] if options.quick else SPEEDS, options.quick)
    fast_csv = write_csv(fast, options.out / "gravity_fast.csv")
    fast_png = save(draw_fast(fast, courses), options.out / "gravity_fast.png")
    print(fast.to_string(index=False))
    print(f"written: {csv}, {png}, {fast_csv}, {fast_png}")


def fast_drives(speeds: tuple[float, ...], quick: bool) -> tuple[pd.DataFrame, dict[tuple[str, float, str], Trace]]:
    """Return the results of all fast drives, one row for each scene, speed and place (Earth, Mars or Moon). The fastest
    drives over the hard bump are repeated with other values of the soil's damping.
    """
    rows, courses = [], {}
    for scene in FAST:
        for speed in speeds:
            for place in PLACES:
                # Other dampings only where bouncing is strongest, to show their influence at low cost.
                fastest = scene == "bump, hard" and speed == SPEEDS[-1] and not quick
                for damping in DAMPING if fastest else DAMPING[1:2]:
                    case = rushing(scene, speed, place, damping)
                    trace = case.drive()
                    if damping == DAMPING[1]:
                        courses[scene, speed, place] = trace
                    half = None if quick else dataclasses.replace(case, timing=case.timing.with_half_step()).drive()
                    rows.append(fast_row((scene, speed, place, damping), trace, half))
    return pd.DataFrame(rows), courses


def rushing(scene: str, speed: float, place: str, damping: float) -> Scenario:
    """Return the scenario of a fast drive. Its motor is geared to `speed` [m/s], it starts RUN_UP before the obstacle,
    and its contact angles follow the sinkage.
    """
    name, settings, end = FAST[scene]
    environment = {"gravity": place, "effect.NormalDamping.d": damping, "start.x": -RUN_UP}
    case = scenario(
        name,
        soil="table-1",
        **as_on_earth(name, settings, "sinkage"),
        **environment,
        duration=(end + RUN_UP) / speed + 15.0,
    )
    model = case.model
    # The operating point at cruise: the torque that the resistance needs under the Earth's weight.
    torque = float(model.effect(MotionResistance).R) * EARTH * model.rover.mass / 6.0 * float(model.rover.wheel.r)
    omega = speed / (1.0 - CRUISE_SLIP) / float(model.rover.wheel.r)
    motor = model.motor.with_operating_point(CRUISE_DUTY, omega, torque)
    return dataclasses.replace(case, model=model.replace(motor=motor), timing=FAST_TIMING)


def fast_row(names: tuple[str, float, str, float], trace: Trace, half: Trace | None) -> dict[str, Any]:
    """Return the results of a fast drive as a row of the table. If `half` is given, the row also holds the results with
    half the time step.
    """
    scene, speed, place, damping = names
    g = GRAVITIES[place]
    cells = {"scene": scene, "speed_mps": speed, "place": place, "froude": speed**2 / (g * LENGTH), "d_spm": damping}
    cells |= bouncing(trace, g, FAST[scene][2])
    # The entry speed does not depend on the step, so it is not repeated.
    if half is not None:
        cells |= {
            f"{name}_half_dt": value for name, value in bouncing(half, g, FAST[scene][2]).items() if name != "in_mps"
        }
    return {key: round(value, 3) if isinstance(value, float) else value for key, value in cells.items()} | {
        "stop": trace.attrs["stop"]
    }


def bouncing(trace: Trace, g: float, end: float) -> dict[str, float]:
    """Return the results of the section from FROM to `end`: entry speed, share of wheels in the air, longest flight of
    a wheel, and largest value and variation of the wheel loads.
    """
    there = (trace["body_x"] > FROM) & (trace["body_x"] < end)
    normal = trace.stack("normal")[there]
    off = normal < 1e-6
    # Longest uninterrupted flight: split each wheel's record at every change between ground and air.
    runs = [len(run) for wheel in off.T for run in np.split(wheel, np.flatnonzero(np.diff(wheel)) + 1) if run[0]]
    return {
        "in_mps": float(trace["body_vx"][there][0]),
        "lift_off": float(np.mean(off)),
        "flight_s": FAST_TIMING.sample * max(runs, default=0),
        "peak_load": float(np.max(normal) / (g * 5.8 / 6.0)),
        "load_swing": float(np.std(normal) / np.mean(normal)),
    }


def driven(scene: str, place: str, angles: str) -> Scenario:
    """Return the scenario of a slow drive with its angles and its gravity."""
    name, settings, duration, _ = SCENES[scene]
    return scenario(name, soil="table-1", **as_on_earth(name, settings, angles), duration=duration, gravity=place)


def as_on_earth(name: str, settings: dict[str, Any], angles: str) -> dict[str, Any]:
    """Return the settings with these angles and with the resistance R found under the Earth's loads."""
    R = float(scenario(name, soil="table-1", **settings, angles=angles).model.effect(MotionResistance).R)
    return {**settings, "angles": angles, "effect.MotionResistance.R": R}


def passing(trace: Trace, place: float) -> float:
    """Return the time at which the body passes `place` [s], or NaN if it does not."""
    past = np.flatnonzero(trace["body_x"] > place)
    return float(trace.t[past[0]]) if past.size else math.nan


def row(names: tuple[str, str, str], case: Scenario, trace: Trace, quick: bool) -> dict[str, Any]:
    """Return the results of a slow drive as a row of the table: sinkage, slip, time, share of wheels in the air,
    largest angles, and variation of the wheel loads.
    """
    scene, angles, place = names
    # The first 2 s contain the settling and the start.
    later = trace.t > 2.0
    normal = trace.stack("normal")[later]
    cells = {"scene": scene, "angles": angles, "place": place, "g_mps2": GRAVITIES[place]}
    cells |= {"sinkage_mm": 1e3 * float(np.mean(trace.stack("sinkage")[later]))}
    cells |= {"slip": float(np.mean(trace.stack("slip")[later])), "time_s": passing(trace, SCENES[scene][3])}
    cells |= {
        "lift_off": float(np.mean(normal < 1e-6)),
        "bogie_deg": peak(trace, "bogie_l"),
        "pitch_deg": peak(trace, "body_pitch"),
    }
    cells |= {"load_swing": swing(trace)}
    # The drive at half the step shows whether the outcome depends on the step.
    if not quick:
        half = dataclasses.replace(case, timing=case.timing.with_half_step()).drive()
        cells |= {"time_half_dt_s": passing(half, SCENES[scene][3]), "load_swing_half_dt": swing(half)}
    return {key: round(value, 3) if isinstance(value, float) else value for key, value in cells.items()} | {
        "stop": trace.attrs["stop"]
    }


def swing(trace: Trace) -> float:
    """Return the standard deviation of the normal forces from 2 s on, divided by their mean."""
    normal = trace.stack("normal")[trace.t > 2.0]
    return float(np.std(normal) / np.mean(normal))


def peak(trace: Trace, name: str) -> float:
    """Return the maximum absolute angle of a channel [deg]."""
    return float(np.degrees(np.max(np.abs(trace[name]))))


def draw(table: pd.DataFrame, traces: dict[tuple[str, str, str], Trace]) -> Figure:
    """Draw sinkage, slip and time as bars, and the speed over time in the last scene."""
    scenes = list(dict.fromkeys(table.scene))
    figure = Figure(figsize=(13, 8.5), layout="constrained")
    above, below = figure.subfigures(2, 1)
    bars = above.subplots(1, 3)
    titles = {
        "sinkage_mm": "mean sinkage [mm]",
        "slip": "mean slip [-]",
        "time_s": "time to the mark [s] (no bar: not reached)",
    }
    # Six bars for each scene: two angle laws at three places.
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
    # Speed over time in the last scene, the ditch.
    lines = below.subplots(1, 2)
    for axes, angles in zip(lines, ANGLES, strict=True):
        for place, colour in zip(PLACES, COLOURS, strict=False):
            trace = traces[scenes[-1], angles, place]
            axes.plot(trace.t, 1e3 * trace["body_vx"], color=colour, label=place, lw=1.2)
        axes.set(title=f"{scenes[-1]}: {angles} angles", xlabel="t [s]", ylabel="speed [mm/s]", ylim=(-20, 110))
        axes.legend(fontsize=8, loc="upper right")
        axes.grid(alpha=0.3)
    return figure


def draw_fast(table: pd.DataFrame, courses: dict[tuple[str, float, str], Trace]) -> Figure:
    """Draw three panels: the share of time with wheels in the air against speed, the largest wheel load (divided by the
    static load) against speed, and the load of the front wheel over the bump at the highest speed.
    """
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    axes = figure.subplots(1, 3)
    default_damping = table[table.d_spm == DAMPING[1]]
    # Colour gives the place, line style the scene.
    for (scene, place), part in default_damping.groupby(["scene", "place"]):
        look = {
            "color": COLOURS[PLACES.index(place)],
            "ls": "-" if scene == "bump, hard" else "--",
            "marker": "o",
            "ms": 4,
        }
        axes[0].plot(part.speed_mps, 100.0 * part.lift_off, label=f"{place}, {scene}", **look)
        axes[1].plot(part.speed_mps, part.peak_load, label=f"{place}, {scene}", **look)
    axes[0].set(xlabel="speed [m/s]", ylabel="wheels in the air [% of wheels and time]", xscale="log")
    axes[1].set(xlabel="speed [m/s]", ylabel="peak load over static load [-]", xscale="log")
    axes[0].legend(fontsize=8)
    for place, colour in zip(PLACES, COLOURS, strict=False):
        trace = courses["bump, hard", SPEEDS[-1], place]
        # Static load: a sixth of the rover's weight (5.8 kg) at this gravity.
        static = GRAVITIES[place] * 5.8 / 6.0
        axes[2].plot(trace["body_x"], trace["normal_fl"] / static, color=colour, lw=1.0, label=place)
    title = f"front wheel over the hard bump at {SPEEDS[-1]:g} m/s"
    axes[2].set(xlabel="x of the body [m]", ylabel="load over static load [-]", xlim=(0.2, 1.2), title=title)
    axes[2].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    main()
