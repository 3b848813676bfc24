"""Fig 8: a slope of increasing inclination: where does the grip end, how suddenly, and does the rover continue to rise?

Question
    Does the slip stay near 0 up to 12 deg and then switch to 1, while the elevation continues to rise?
Method
    The inclination grows by 10 deg a metre (assumed: 12 deg after 25 s at 0.05 m/s), at duty 0.55, for 80 s. The soils
    are: Table 1 with three definitions of the traction factor, net (drawbar pull / normal force f_n), torque (T / (r
    f_n), with the wheel torque T) and gross (thrust / f_n); a smaller k; and an invented sand whose slip switches, with
    a small k, so that grip builds up at little slip, and a small phi, so that its maximum is low. The invented sand is
    repeated where slipping wheels dig (`DiggingMemory`) or soften the sand (`SlipSoftening`, with a as fitted to a
    measured wheel). S is that of the left middle wheel; the inclination is the terrain's under the body. "Most" is atan
    F(1). With its resistance R a rover must stop at atan(F(1) - R).
Result
    Table 1, torque factor: S = 0.05 on the flat, 0.5 at 4.6 deg (23.5 s), 0.9 at 8.0 deg (52.3 s); after 80 s 8.7 deg
    of a maximum of 8.8 with its R, still rising by 2.6 mm in 10 s. The results with the gross factor differ by at most
    0.2 deg. Net factor: S = 0.99 on the flat, so the rover does not reach the slope. Torque factor with k = 30 mm
    instead of 50: S = 0.5 at 6.8 deg, 11.7 deg after 80 s. Net factor with k = 14.5 mm: S = 0.25 on the flat, 0.5 at
    5.3 deg, 10.7 deg of a maximum of 12.0. Only the invented sand (k = 1 mm, phi = 13.7 deg) switches: S = 0.1 at 10.4
    deg, 0.5 at 11.9 deg, 0.9 at 11.9 deg; the rover still rises, by 8.9 mm from there on.
    Fig 8's end is reproduced with wheels that dig: from S = 0.9 at 11.2 deg on, the body falls by 18.9 mm, while a
    wheel sinks to 32 mm; in the last 10 s it falls by 0.4 mm, and the rover is at rest. On sand that slip softens, with
    a as fitted to measured wheels, the wheel sinks to 16 mm. The rover comes to rest as well, falling by 1.8 mm since S
    = 0.9, and by 0.5 in the last 10 s. The times at S = 0.5 are the same with half the time step.
What the paper says
    Experiment: "the slip ratio stays near 0 before t = 25 [s]"; "at t = 25 [s], the inclination of the slope reaches
    almost 12 degrees. After that the slip ratio increases up to 1"; "the elevation stayed constant after t = 30".
    Simulation: "the slip ratio switches from 0 to 1 at the inclination of 12 degrees"; "the elevation keeps rising
    after switching the value of the slip".
What differs
    With Table 1 the slip neither stays near 0 nor switches: it grows by 0.1 a degree from the start, and the climb ends
    at 8.8, not 12 deg. Where wheels do not dig, the elevation continues to rise more and more slowly, as the paper
    states for its simulation. A switch at 12 deg needs a grip that builds up at once and has a low maximum, which
    contradicts Table 1's k and phi.

Run: python studies/fig8_slope.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.plot import COLOURS, save, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.wheel_forces import load_traction_factor

RATE, START, STEEPEST = math.radians(10.0), 0.5, math.radians(20.0)
TWELVE = 12.0


class Reading(NamedTuple):
    """A variant of the soil and the form of traction: Table 1 of the paper, or Table 1 with changed values."""

    label: str
    settings: dict[str, Any]


SWITCHING = {"soil.k": 0.001, "soil.phi_deg": 13.7, "effect.MotionResistance.R": 0.03}
"""An invented sand whose grip builds up at little slip and has a low maximum."""
READINGS = (
    Reading("Table 1, torque form", {}),
    Reading("Table 1, gross form", {"form": "gross"}),
    Reading("Table 1, net form", {"form": "net"}),
    Reading("torque form, k = 30 mm, R = 0.045", {"soil.k": 0.030, "cruise_slip": 0.05}),
    Reading("net form, k = 14.5 mm", {"form": "net", "soil.k": 0.0145}),
    Reading("k = 1 mm, phi = 13.7 deg, R = 0.03", SWITCHING),
    Reading("k = 1 mm, wheels dig, c_d = 0.05", {**SWITCHING, "add": "DiggingMemory.c_d=0.05", "buried": 0.9}),
    Reading("k = 1 mm, slip softens, a = 1.2", {**SWITCHING, "add": "SlipSoftening.a=1.2", "buried": 0.9}),
)


def main() -> None:
    """Drive all variants, write histories, table and figure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="four readings, 40 s, one step size")
    parser.add_argument("--out", type=Path, default=Path("out/fig8_slope"))
    options = parser.parse_args()
    duration, readings = (40.0, READINGS[::2]) if options.quick else (80.0, READINGS)
    cases = {
        variant.label: scenario("slope", soil="table-1", **variant.settings, duration=duration) for variant in readings
    }
    traces = {label: case.drive() for label, case in cases.items()}
    # The table has one row for each variant, with the half-step check unless --quick.
    table = pd.DataFrame([row(label, cases[label], traces[label], options.quick) for label in cases])
    csv = write_csv(histories(traces), options.out / "fig8_slope.csv")
    write_csv(table, options.out / "fig8_summary.csv")
    png = save(draw(traces), options.out / "fig8_slope.png")
    print(table.to_string(index=False))
    print(f"written: {csv}, {png}")


def inclination(trace: Trace) -> np.ndarray:
    """Return the terrain's inclination under the body [deg]."""
    return np.degrees(np.clip(RATE * (trace["body_x"] - START), 0.0, STEEPEST))


def reached(trace: Trace, slip: float) -> tuple[float, float]:
    """Return the time [s] and the inclination [deg] from which on the slip stays above `slip`. Both are NaN if the slip
    does not stay above it.
    """
    below = np.flatnonzero(trace["slip_ml"] <= slip)
    first = 0 if below.size == 0 else int(below[-1]) + 1
    if first >= len(trace.t):
        return math.nan, math.nan
    return float(trace.t[first]), float(inclination(trace)[first])


def risen_since(trace: Trace, slip: float) -> float:
    """Return the elevation gained [m] since the time from which on the slip stays above `slip`; NaN if there is no such
    time.
    """
    when = reached(trace, slip)[0]
    return float(trace["body_z"][-1] - np.interp(when, trace.t, trace["body_z"]))


def steepest(case: Scenario) -> float:
    """Return the steepest slope [deg] that the soil holds at full slip: atan F(1), with the traction factor F of the
    soil and the form of traction.
    """
    law, wheel = case.model.effect(SoilTraction), case.model.rover.wheel
    return math.degrees(math.atan(load_traction_factor(1.0, case.model.soils[0], wheel, law.form, law.angles)))


def row(label: str, case: Scenario, trace: Trace, quick: bool) -> dict[str, Any]:
    """Return the results of a drive as a row of the table: time and inclination at which the rover reaches several
    slips, the end of the climb, and the time at which it reaches a slip of 0.5 with half the time step.
    """
    cells = {"reading": label, "most_deg": steepest(case), "S_10s": float(np.interp(10.0, trace.t, trace["slip_ml"]))}
    for slip in (0.1, 0.5, 0.9):
        cells[f"S{slip}_at_s"], cells[f"S{slip}_at_deg"] = reached(trace, slip)
    # The rise over the last 10 s shows whether the rover still climbs.
    after = trace["body_z"][-1] - np.interp(trace.t[-1] - 10.0, trace.t, trace["body_z"])
    cells |= {"end_deg": float(inclination(trace)[-1]), "end_S": float(trace["slip_ml"][-1])}
    cells["last_10s_rise_mm"] = 1e3 * float(after)
    cells["since_S0.9_rise_mm"] = 1e3 * risen_since(trace, 0.9)
    cells["sunk_mm"] = 1e3 * float(trace.stack("sinkage")[-1].max())
    if not quick:
        half = dataclasses.replace(case, timing=case.timing.with_half_step()).drive(measure_error=False)
        cells["S0.5_at_s_half_dt"] = reached(half, 0.5)[0]
    return {key: round(value, 3) if isinstance(value, float) else value for key, value in cells.items()}


def histories(traces: dict[str, Trace]) -> pd.DataFrame:
    """Return slip, inclination, elevation and speed over time for each variant."""
    parts = []
    for label, trace in traces.items():
        part = {"reading": label, "t_s": trace.t, "slip": trace["slip_ml"], "inclination_deg": inclination(trace)}
        part |= {"elevation_m": trace["body_z"] - trace["body_z"][0], "speed_mps": trace["body_vx"]}
        parts.append(pd.DataFrame(part)[::10].round(6))
    return pd.concat(parts)


def draw(traces: dict[str, Trace]) -> Figure:
    """Draw four panels: slip against time, slip against inclination, inclination against time, and elevation against
    time.
    """
    figure = Figure(figsize=(12, 8), layout="constrained")
    time_slip, steep_slip, steep_time, height = figure.subplots(2, 2).ravel()
    for (label, trace), colour in zip(traces.items(), COLOURS, strict=False):
        # The gross form nearly coincides with the torque form, so it is dashed.
        look = {"color": colour, "ls": "--" if "gross" in label else "-", "lw": 1.6}
        steep, slip = inclination(trace), trace["slip_ml"]
        climbs = steep > 0
        time_slip.plot(trace.t, slip, label=label if climbs.any() else f"{label} (stays on the flat)", **look)
        # Slip against inclination is meaningful on the slope only. For a rover that does not reach the slope, a point
        # shows the slip on the flat.
        if climbs.any():
            steep_slip.plot(steep[climbs], slip[climbs], **look)
        else:
            steep_slip.plot(steep[-1:], slip[-1:], "o", color=colour)
        steep_time.plot(trace.t, steep, **look)
        height.plot(trace.t, 1e3 * (trace["body_z"] - trace["body_z"][0]), **look)
    paper(time_slip, steep_slip, steep_time)
    time_slip.set(ylabel="slip of the middle wheel [-]", xlabel="t [s]", ylim=(-0.15, 1.05))
    steep_slip.set(ylabel="slip of the middle wheel [-]", xlabel="inclination under the body [deg]", ylim=(-0.15, 1.05))
    steep_time.set(ylabel="inclination under the body [deg]", xlabel="t [s]", ylim=(-0.4, 14))
    height.set(ylabel="elevation gained [mm]", xlabel="t [s]")
    for axes in (time_slip, steep_slip, steep_time, height):
        axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def paper(time_slip: Axes, steep_slip: Axes, steep_time: Axes) -> None:
    """Draw the values that the text states for its experiment."""
    look = {"color": "black", "ls": ":", "lw": 1.4}
    time_slip.plot([0, 25, 30, 40], [0, 0, 1, 1], label="the text, experiment (times)", **look)
    steep_slip.plot([0, TWELVE, TWELVE], [0, 0, 1], **look)
    steep_time.plot([25], [TWELVE], "k*", ms=9)
    steep_time.annotate("the text: 12 deg at 25 s", (25, TWELVE), (4, 12.8), fontsize=9)


if __name__ == "__main__":
    main()
