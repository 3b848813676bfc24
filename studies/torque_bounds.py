"""Torque bounds of the wheels by load, slope and soil: which wheel slips first, and does the motor reach the bounds?

Question
    How much torque can each of the six wheels take before it slips more than 0.2 (T_lim), and before the soil yields
    under its full arc (T_sat)? Which wheel slips first on a slope, which slope does the pull at the bound hold, and
    does a motor with 1 N m stall torque (assumed) exceed the bounds?
Method
    `torque_bounds` over load for four soils; `rover_torque_bounds` over slope with the loads of static balance;
    `climbable_slope` with three definitions of the traction factor, net (drawbar pull / normal force f_n), torque (T /
    (r f_n)) and gross (thrust / f_n); the ratio of the bound to the stall torque.
Result
    T_sat is nearly proportional to the load; T_lim grows as W^1.46 on the literature's sand (53 mN m at 10 N). On a 12
    deg slope of this sand T_lim is 38, 33 and 75 mN m for front, middle and rear. The middle wheels carry the smallest
    load on every slope here, so with equal motors at equal duty and speed they slip first, on every soil. A blocked
    wheel exceeds T_lim at duty 0.03 to 0.08 and T_sat at 0.19 to 0.33, so duty 0.55 spins any wheel that the rover
    cannot follow.
    All wheels at S = 0.2 hold 3.3 deg on Table 1 and 6.6 deg on the literature's sand (torque factor), and at S = 1
    they hold 10.3 and 17.7 deg. With the net factor, the wheels do not even drive on the flat at S = 0.2. Full shear
    would hold 28 and 30 deg, but with k = 50 or 25 mm under a 45 mm wheel even S = 1 uses only a third and a half of
    T_sat.
What the paper says
    Section 5: "limit the driving torque not to exceed the maximum share"; section 4.2: at 12 deg "the tire driving
    force exceeded the maximum share force of the soil, then the wheel started to dig a hole".
What differs
    With Table 1 the pull at S = 1 holds 10.3 deg (torque factor) and the soil's full strength 28 deg: the slip reaches
    1 long before c + sigma tan(phi) is reached. A limiter at T_sat, as the text states it, does not prevent that; a
    limiter at T_lim does. The paper gives neither bound as a formula.

Run: python studies/torque_bounds.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from rover_pin.control.rover_bounds import bounds_table, climbable_slope, rover_torque_bounds
from rover_pin.control.torque_bounds import TractionLimit, torque_bounds
from rover_pin.parameters import NEXUS6_WHEEL, SOILS
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.motor import nexus6_motor
from rover_pin.soil.wheel_forces import FORMS

ROVER = load_rover("nexus6")
MOTOR = nexus6_motor()
S_LIM = 0.2
SETS = {"table-1": "tab:blue", "literature-sand": "tab:orange", "hit-lss1": "tab:green", "fjs-1": "tab:red"}
ON_SLOPE = "literature-sand"
AXLES = {"fl": ("front", "tab:blue"), "ml": ("middle", "tab:orange"), "rl": ("rear", "tab:green")}
PAPER_SLOPE, CRUISE_DUTY = 12.0, 0.55


def main() -> None:
    """Compute all tables, write them with the figure, and print the bounds on the paper's slope."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the loads and slopes")
    parser.add_argument("--out", type=Path, default=Path("out/torque_bounds"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    # Three questions, three tables: by load, by slope, and the slope that the pull holds.
    tables = {
        "by_load": by_load(np.linspace(0.0, 25.0, 11 if options.quick else 101)),
        "by_slope": by_slope(np.linspace(0.0, 30.0, 7 if options.quick else 61)),
        "climbable": climbable(),
    }
    for name, table in tables.items():
        table.to_csv(options.out / f"{name}.csv", index=False, float_format="%.6g")
    draw(tables, options.out / "torque_bounds.png")
    print(f"{ON_SLOPE} on {PAPER_SLOPE:g} deg, S_lim = {S_LIM:g}, stall torque {MOTOR.stall_torque:.2f} N m:")
    print(bounds_table(rover_torque_bounds(ROVER, SOILS[ON_SLOPE], math.radians(PAPER_SLOPE)), MOTOR))
    print(tables["climbable"].round(2).to_string(index=False))
    print(first_to_slip(tables["by_slope"]).to_string(index=False))
    print(f"written: {', '.join(f'{name}.csv' for name in tables)} and torque_bounds.png in {options.out}")


def by_load(loads: np.ndarray) -> pd.DataFrame:
    """Return T_lim and T_sat of one wheel over load, for each soil."""
    rows = []
    for soil in SETS:
        for load in loads:
            bounds = torque_bounds(float(load), SOILS[soil], NEXUS6_WHEEL, S_LIM)
            rows.append((soil, load, bounds.limit, bounds.saturation))
    return pd.DataFrame(rows, columns=["soil", "load_N", "T_lim_Nm", "T_sat_Nm"])


def by_slope(slopes_deg: np.ndarray) -> pd.DataFrame:
    """Return the bounds of all wheels of the rover over slope, for each soil."""
    rows = []
    for soil in SETS:
        for slope in slopes_deg:
            bounds = rover_torque_bounds(ROVER, SOILS[soil], math.radians(slope), limit=TractionLimit(S_LIM))
            rows += [{"soil": soil, "slope_deg": slope, **row} for row in bounds.rows(MOTOR)]
    return pd.DataFrame(rows)


def climbable() -> pd.DataFrame:
    """Return the slope that the pull holds at S_lim, at S = 1 and at full shear, for each soil and form."""
    rows = []
    for soil in SETS:
        for form in FORMS.values():
            full, at_limit = climbable_slope(ROVER, SOILS[soil], TractionLimit(S_LIM, form))
            # A limit at S = 1 gives the pull of wheels that spin on the spot.
            _, spinning = climbable_slope(ROVER, SOILS[soil], TractionLimit(1.0, form))
            rows.append((soil, form.name, *(math.degrees(slope) for slope in (at_limit, spinning, full))))
    return pd.DataFrame(rows, columns=["soil", "form", "deg_at_S_lim", "deg_at_S_1", "deg_at_full_shear"])


def first_to_slip(table: pd.DataFrame) -> pd.DataFrame:
    """Return the wheels that slip first, with the range of slopes, for each soil."""
    first = table[table.slips_first].groupby(["soil", "slope_deg"]).wheel.agg(" ".join).reset_index()
    spans = first.groupby(["soil", "wheel"], sort=False).slope_deg.agg(["min", "max"]).reset_index()
    return spans.rename(columns={"wheel": "first to slip", "min": "from_deg", "max": "to_deg"})


def draw(tables: dict[str, pd.DataFrame], path: Path) -> None:
    """Draw the four panels of the figure."""
    figure, axes = plt.subplots(2, 2, figsize=(12, 9), layout="constrained")
    draw_load(axes[0, 0], tables["by_load"])
    # Panels over slope show one soil; all soils would not be readable.
    on_slope = tables["by_slope"][tables["by_slope"].soil == ON_SLOPE]
    draw_slope(axes[0, 1], on_slope)
    draw_climbable(axes[1, 0], tables["climbable"])
    draw_margin(axes[1, 1], on_slope)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_load(axis: Axes, table: pd.DataFrame) -> None:
    """Draw the torque bounds of one wheel against its load."""
    for soil, colour in SETS.items():
        # Solid lines are T_sat, dashed lines T_lim.
        of_soil = table[table.soil == soil]
        axis.plot(of_soil.load_N, 1e3 * of_soil.T_sat_Nm, color=colour, label=soil)
        axis.plot(of_soil.load_N, 1e3 * of_soil.T_lim_Nm, color=colour, ls="--")
    axis.plot([], [], color="black", label="T_sat: soil yields")
    axis.plot([], [], color="black", ls="--", label=f"T_lim: S = {S_LIM:g}")
    axis.set(title="Bounds of one wheel", xlabel="load W [N]", ylabel="torque [mN m]", xlim=(0, 25), ylim=(0, None))
    axis.legend(frameon=False)


def draw_slope(axis: Axes, table: pd.DataFrame) -> None:
    """Draw the torque bounds of the rover's wheels against the slope."""
    for wheel, (name, colour) in AXLES.items():
        # One wheel of each axle is enough, because left and right are equal on a straight slope.
        of_wheel = table[table.wheel == wheel]
        axis.plot(of_wheel.slope_deg, 1e3 * of_wheel.T_sat_Nm, color=colour, label=name)
        axis.plot(of_wheel.slope_deg, 1e3 * of_wheel.T_lim_Nm, color=colour, ls="--")
    axis.axvline(PAPER_SLOPE, color="black", ls=":", lw=1.2, label="12 deg (Fig 8)")
    axis.set(title=f"Bounds of the rover's wheels, {ON_SLOPE} (lines as left)")
    axis.set(xlabel="slope [deg]", ylabel="torque [mN m]", xlim=(0, 30), ylim=(0, None))
    axis.legend(frameon=False)


def draw_climbable(axis: Axes, table: pd.DataFrame) -> None:
    """Draw the slopes that the pull holds, for each soil and form."""
    places = {soil: i for i, soil in enumerate(SETS)}
    shades = {"net": "tab:red", "torque": "tab:blue", "gross": "tab:green"}
    # For each soil three bars side by side, one for each form.
    for offset, (form, colour) in zip((-0.25, 0.0, 0.25), shades.items(), strict=True):
        of_form = table[table.form == form]
        x = np.array([places[soil] + offset for soil in of_form.soil])
        axis.vlines(x, of_form.deg_at_S_lim, of_form.deg_at_full_shear, color=colour, lw=2, label=form)
        axis.plot(x, of_form.deg_at_S_lim, "o", color=colour)
        axis.plot(x, of_form.deg_at_S_1, "s", color=colour)
        axis.plot(x, of_form.deg_at_full_shear, "_", color=colour, ms=12, mew=2)
    # Empty curves that only serve the legend.
    for marker, name in (("o", f"all wheels at S = {S_LIM:g}"), ("s", "at S = 1"), ("_", "at full shear")):
        axis.plot([], [], marker, color="black", label=name)
    axis.axhline(PAPER_SLOPE, color="black", ls=":", lw=1.2)
    axis.axhline(0.0, color="black", lw=0.8)
    axis.set_xticks(list(places.values()), list(places))
    axis.set(title="Slope that the pull at the bound holds, by form", ylabel="slope [deg]", ylim=(-15, 50))
    axis.legend(frameon=False, ncols=2, loc="upper left")


def draw_margin(axis: Axes, table: pd.DataFrame) -> None:
    """Draw the duty at which a wheel that is held fast reaches its torque bound, against the slope."""
    for wheel, (name, colour) in AXLES.items():
        of_wheel = table[table.wheel == wheel]
        axis.plot(of_wheel.slope_deg, of_wheel.T_sat_Nm / MOTOR.stall_torque, color=colour, label=name)
        axis.plot(of_wheel.slope_deg, of_wheel.duty_lim, color=colour, ls="--")
    # Where a curve lies below this duty, constant duty spins a blocked wheel.
    axis.axhline(CRUISE_DUTY, color="black", ls=":", lw=1.2, label="duty 0.55, without control")
    axis.set(title=f"Duty at which a held wheel reaches its bound, {ON_SLOPE}")
    axis.set(xlabel="slope [deg]", ylabel="duty = bound / stall torque [-]", xlim=(0, 30), ylim=(0, 0.8))
    axis.legend(frameon=False, ncols=2, loc="upper left")


if __name__ == "__main__":
    main()
