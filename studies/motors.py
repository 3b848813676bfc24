"""Compare a speed-like and a torque-like motor: the reading of Eq (9), and the paper's sentences that each reproduces.

Question
    Section 2 calls the duty "effectively in proportion to the driving torque", while in sections 4.2 and 5 the wheels
    of a stuck rover continue to turn. Which motor agrees with the paper's text, and does Eq (9) see the slip with
    either?
Method
    Two motors that run 0.05 m/s at duty 0.55 differ in stall torque, 1 and 0.25 N m (simulation/model/motor.py). The
    study computes rim speed and S_hat of a wheel under a sixth of the weight at duty 0.55, for slips from 0.05 to 1, on
    Table 1's sand (k = 50 mm) and on a firmer sand (k = 10 mm). It then runs the drives of Figs 8 and 10 with either
    motor. Each outcome, out or stuck, is checked with half the time step.
Result
    On Table 1's sand the rim slows from 52.6 mm/s at S = 0.05 to 46.2 at S = 1 with the speed-like motor and to 25.0
    with the torque-like motor. S_hat falls from 0.05 to -0.08 and to -1.00, respectively. Eq (9) does not see the slip
    with the speed-like motor and reads it with the wrong sign with the torque-like motor. On k = 10 mm S_hat falls from
    -0.03 to -0.42; the torque-like motor cannot turn the wheel at S = 0.6 and beyond.
    Speed-like: 11.5 of Fig 8's 12 deg are reached at 56 s. Stuck in the ditch of Fig 10, all rims run at 44 to 49 mm/s.
    Where half of the strength is lost, control with the true slip leaves a ditch in which duty 0.55 is stuck; duty 1
    and Eq (9) at full duty leave it as well.
    Torque-like: 68 s, 15 to 37 mm/s, and at duties up to 0.55 no control leaves the ditch, because the front and rear
    wheels are blocked and do not spin. With full duty allowed, the true slip leaves it, while constant duty 1 and Eq
    (9) stay.
    The default is therefore speed-like: its wheels continue to turn, and the control has a slip to reduce, as in the
    paper.
What the paper says
    Section 2: the duty is "effectively in proportion to the driving torque"; section 5: "After the vehicle has stopped,
    the wheel was yet rotating constantly".
What differs
    While the soil's resistance rises with the slip, S_hat rises with the slip for no motor that has back-EMF.

Run: python studies/motors.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin import plot
from rover_pin.control.slip_estimate import TableEstimate, calibrated_table
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.model.cruise import CRUISE_DUTY, CRUISE_SPEED
from rover_pin.simulation.model.motor import MOTORS, motor_named
from rover_pin.soil.wheel_forces import TorqueTraction, load_traction_factor

SLIPS = (0.05, 0.2, 0.4, 0.6, 0.8, 1.0)
SANDS = (0.05, 0.01)
OUT_AT = 0.95
TWELVE, RATE, FOOT = 12.0, 10.0, 0.5
ABRUPT = {"soil.k": 0.001, "soil.phi_deg": 13.0, "effect.MotionResistance.R": 0.03}
LOSING = {
    "soil.k": 0.0025,
    "effect.MotionResistance.R": 0.03,
    "terrain.wall_angle_deg": 47.0,
    "add": "PostPeak.fraction=0.5",
}
GAINS = {"control.S_d": 0.2, "control.k_p": 0.1, "control.k_i": 1.0}
FULL = {"control.delta_max": 1.0}
CONTROLS: dict[str, dict[str, Any]] = {
    "duty 0.55": {},
    "duty 1": {"control.delta": 1.0},
    "torque check at S = 0.5": {"control": "limit"},
    "true slip, duty up to 0.55": {"control": "true", **GAINS},
    "true slip, duty up to 1": {"control": "true", **GAINS, **FULL},
    "Eq 9, duty up to 0.55": {"control": "eq9", **GAINS},
    "Eq 9, duty up to 1": {"control": "eq9", **GAINS, **FULL},
}


def main() -> None:
    """Compute both tables, write them, and print them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="short drives: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/motors"))
    options = parser.parse_args()
    read, sentence_table = readings(), sentences(0.1 if options.quick else 1.0)
    plot.write_csv(read, options.out / "eq9.csv")
    plot.write_csv(sentence_table, options.out / "sentences.csv")
    # One table for each motor, with both sands.
    for name, table in read.groupby("motor", sort=False):
        print(f"\n{name}: rim speed [mm/s] and S_hat of Eq (9) at duty {CRUISE_DUTY:g}")
        print(table.drop(columns="motor").round(3).to_string(index=False))
    print()
    print(sentence_table.round(2).T.to_string(header=False))
    figure(read, options.out)
    print(f"\nwritten: {options.out}/eq9.csv, eq9.png, sentences.csv")


def figure(read: pd.DataFrame, out: Path) -> None:
    """Draw rim speed and estimated slip S_hat against the true slip."""
    sheet, axes = plot.new_figure(1, 2, size=(11.0, 4.5))
    for (motor, k), table in read.groupby(["motor", "k_mm"], sort=False):
        style = {"marker": "o", "ls": "-" if motor == "speed-like" else "--", "label": f"{motor}, k = {k:g} mm"}
        axes[0].plot(table["S"], table["rim_mmps"], **style)
        axes[1].plot(table["S"], table["S_hat"], **style)
    # A correct estimate would lie on this line.
    axes[1].plot([0.0, 1.0], [0.0, 1.0], "k:", label="S itself")
    for axis, label in zip(axes, ("rim speed at duty 0.55 [mm/s]", "S_hat of Eq (9) [-]"), strict=True):
        axis.set(xlabel="slip S [-]", ylabel=label)
        axis.grid(alpha=0.3)
    axes[1].legend(fontsize=8)
    plot.save(sheet, out / "eq9.png")


def readings() -> pd.DataFrame:
    """Return rim speed and S_hat against slip: the motor's steady speed under the torque r F(S) W, where F(S) is the
    traction factor T / (r W) for the wheel torque T and the load W.

    A wheel that its motor cannot turn at that slip has a rim speed of 0 and no S_hat.
    """
    rows = []
    for name in MOTORS:
        motor = motor_named(name)
        for k in SANDS:
            rover = scenario("flat", soil="table-1", **{"soil.k": k}).model.rover
            soil, wheel = scenario("flat", soil="table-1", **{"soil.k": k}).model.soils[0], rover.wheel
            load = rover.mass * 9.81 / len(rover.wheels)
            for S in SLIPS:
                torque = float(load_traction_factor(S, soil, wheel, TorqueTraction())) * float(wheel.r) * load
                # The torque uses a share of the stall torque; the rest of the duty sets the speed.
                share = CRUISE_DUTY - torque / float(motor.stall_torque)
                rim = max(float(wheel.r) * float(motor.no_load_rate) * share, 0.0)
                S_hat = max(1.0 - CRUISE_SPEED / rim, -1.0) if rim > 0.0 else np.nan
                rows.append({"motor": name, "k_mm": 1e3 * k, "S": S, "rim_mmps": 1e3 * rim, "S_hat": S_hat})
    return pd.DataFrame(rows)


def sentences(share: float) -> pd.DataFrame:
    """Return the results for the sentences on Figs 8 and 10, one row for each motor. `share` scales the durations."""
    return pd.DataFrame([{"motor": name, **slope(name, share), **ditch(name, share)} for name in MOTORS])


def slope(motor: str, share: float) -> dict[str, Any]:
    """Return the time at which the rover almost reaches the slope of 12 deg, and the inclinations at which the slip of
    a middle wheel exceeds 0.1 and 0.9. The sand is invented, so that the slip rises suddenly near this slope.
    """
    trace = scenario("slope", soil="table-1", motor=motor, duration=80.0 * share, **ABRUPT).drive()
    # The inclination grows with the distance from the foot of the slope.
    inclination = RATE * np.clip(trace["body_x"] - FOOT, 0.0, None)
    there = np.flatnonzero(inclination >= TWELVE - 0.5)
    # First rows at which the slip of the middle wheel exceeds 0.1 and 0.9.
    above = [np.flatnonzero(trace["slip_ml"] > slip) for slip in (0.1, 0.9)]
    switch = [float(inclination[rows[0]]) if rows.size else np.nan for rows in above]
    return {
        "Fig 8: 11.5 deg reached at [s]": float(trace.t[there[0]]) if there.size else np.nan,
        "Fig 8: slip of the middle wheel passes 0.1 at [deg]": switch[0],
        "Fig 8: and 0.9 at [deg]": switch[1],
    }


def ditch(motor: str, share: float) -> dict[str, Any]:
    """Return the wheel speeds in the ditch on Table 1's sand, and the outcome of each control on sand that loses
    strength.
    """
    stuck = scenario("ditch", soil="table-1", motor=motor, duration=20.0 * share).drive()
    # Rim speeds at the end of the drive in mm/s, for a wheel radius of 45 mm.
    rims = 45.0 * stuck.stack("wheel_rate")[-1]
    results = {
        "Fig 10: velocity lost at [s]": first(stuck.t, (stuck.t > 5.0) & (stuck["body_vx"] < 0.002)),
        "Fig 10: slowest and fastest rim, stuck [mm/s]": f"{rims.min():.0f} to {rims.max():.0f}",
    }
    # Every control on the sand that loses half of its strength.
    for name, settings in CONTROLS.items():
        drive = scenario("ditch", soil="table-1", motor=motor, duration=40.0 * share, **settings, **LOSING)
        results[f"Fig 10, half the strength lost: {name}"] = outcome(with_its_table(drive))
    return results


def with_its_table(drive: Scenario) -> Scenario:
    """Return the drive with a slip estimate by Eq (9) whose table of steady speeds was measured with the motor of this
    drive, on level ground of the default sand.
    """
    if not isinstance(getattr(drive.controller, "estimate", None), TableEstimate):
        return drive
    table = calibrated_table(scenario("flat", soil="table-1").model.replace(motor=drive.model.motor))
    estimate = dataclasses.replace(drive.controller.estimate, table=table)  # type: ignore[attr-defined]
    return dataclasses.replace(drive, controller=dataclasses.replace(drive.controller, estimate=estimate))  # type: ignore[type-var]


def outcome(drive: Scenario) -> str:
    """Return the outcome of a ditch drive: "out" or "stuck", or "open" if the drive with half the time step has the
    other outcome.
    """
    both = {
        bool(np.any(dataclasses.replace(drive, timing=timing).drive()["body_x"] > OUT_AT))
        for timing in (drive.timing, drive.timing.with_half_step())
    }
    return "open" if len(both) > 1 else "out" if True in both else "stuck"


def first(t: np.ndarray, true: np.ndarray) -> float:
    """Return the first time at which a condition is true, or NaN if it never is."""
    return float(t[np.argmax(true)]) if np.any(true) else np.nan


if __name__ == "__main__":
    main()
