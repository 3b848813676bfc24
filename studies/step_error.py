"""Compare the error that a drive states with its true error: random drives against a sixteenth of the step.

Question
    Is the stated error of a drive never below its true error, and not much above it? How many drives keep their
    tolerance?
Method
    Scene, rover, sand, effects, gravity, control, duty, start and duration (3 to 10 s) are drawn. Lengths and angles of
    the ground are within a factor of 2 of the scene's own values. Each drive chooses its step and states its error
    (`outcome/step_error.py`). The true error is the maximum distance in x and y, and the maximum change of a wheel's
    mean load over the mean of all, from the same drive at a sixteenth of the usual step, or at a quarter of its own
    step if that is finer.
Result
    studies/results/step_error.csv. An interrupted run continues with the missing drives.
What the paper says
    The paper states no numerical error.
What differs
    A sixteenth of the step counts as the truth. Under a control with random decisions (`onboard`, a particle filter) it
    is one of several possible drives.

Run: python studies/step_error.py [--quick] [--drives N] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import RoverPinError
from rover_pin.plot import COLOURS, new_figure, save
from rover_pin.scenarios import catalogue
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.stepping.timing import TOLERANCE
from rover_pin.simulation.trace.trace import Trace

SCENES = (
    "flat", "incline", "slope", "bump", "one-sided-bump", "ditch", "step", "rocks", "field", "washboard", "cross-slope",
    "hills", "turn", "point-turn", "crab",
)  # fmt: skip
STEERED = ("turn", "point-turn", "crab")
"""Scenarios that have a control of their own, so that no random control is drawn for them."""
SOILS = (
    "table-1", "slope-sand", "literature-sand", "dry-sand", "fjs-1", "hit-lss1", "lunar-nominal", "mars-sand",
)  # fmt: skip
EFFECTS: tuple[tuple[str, ...], ...] = ((), ("SlipSinkage",), ("MultiPass",), ("DiggingMemory", "PostPeak"))
CONTROLS = {"none": 0.4, "true": 0.3, "onboard": 0.2, "eq9": 0.1}
"""Word of the setting `control` -> probability that a random drive uses this control."""
SCALED = {
    "terrain.angle", "terrain.rate", "terrain.steepest", "terrain.height", "terrain.length", "terrain.depth",
    "terrain.wall_angle", "terrain.width", "terrain.amplitude", "terrain.wavelength", "control.radius",
}  # fmt: skip
MAX_REFINEMENT, FINER_THAN_OWN = 16, 4
"""Time step of the reference drive, which gives the true error. The reference divides the usual step by MAX_REFINEMENT,
and the step that the drive chose itself by at least FINER_THAN_OWN."""


def main() -> None:
    """Run the drives that are missing in the table, and draw the stated over the true errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="three drives of 1 s: shows that it runs")
    parser.add_argument("--drives", type=int, default=1000)
    parser.add_argument("--out", type=Path, default=Path("out/step_error"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "step_error.csv"
    # Drives in the table are not repeated, so that an interrupted run continues.
    rows = pd.read_csv(file).to_dict("records") if file.is_file() else []
    done = {row["seed"] for row in rows}
    for seed in range(3 if options.quick else options.drives):
        if seed not in done:
            rows.append(judged(seed, 1.0 if options.quick else None))
            pd.DataFrame(rows).to_csv(file, index=False, float_format="%.4g")
    table = pd.DataFrame(rows).dropna(subset="off_m")
    print("\n".join(summary(table)))
    figure(table, options.out)


def summary(table: pd.DataFrame) -> list[str]:
    """Return the summary of the table as lines of text: the share of drives that kept the tolerance, the share whose
    stated error is smaller than the true error, and the median ratios of stated to true error.
    """
    # A true error above the stated one is a failure of the estimate.
    low, keeps = table["off_m"] > table["stated_m"], table["kept"].astype(bool)
    ratio, load_ratio = table["stated_m"] / table["off_m"], table["load_stated"] / table["load_off"]
    return [
        f"{len(table)} drives, {keeps.sum()} keep their tolerance of {1e3 * TOLERANCE:g} mm",
        f"true error above the stated one: {low.sum()}, {(low & keeps).sum()} of them said to keep it, "
        f"{(keeps & (table['off_m'] > TOLERANCE)).sum()} of these do not",
        f"stated over true, in the median: {ratio.median():.2g} in place, {load_ratio.median():.2g} of the loads",
    ]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a random number on a logarithmic scale."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def drawn(seed: int) -> tuple[str, dict[str, Any]]:
    """Return scene and settings of a random drive."""
    rng = np.random.default_rng([30, seed])
    scene = str(rng.choice(SCENES))
    rover = "cart" if scene != "crab" and rng.random() < 0.25 else "nexus6"
    settings: dict[str, Any] = {
        "rover": rover,
        "soil": str(rng.choice(SOILS)),
        "form": str(rng.choice(["torque", "net"])),
        "add": EFFECTS[rng.integers(len(EFFECTS))],
        "gravity": str(rng.choice(["earth", "mars", "moon"])),
        "duration": round(log_uniform(rng, 3.0, 10.0)),
    }
    # Half of the drives change k; the torque form then needs the R of that sand, so that it can cruise.
    if rng.random() < 0.5:
        settings["soil.k"] = log_uniform(rng, 10**-2.5, 10**-1.5)
        settings |= {"cruise_slip": 0.05} if settings["form"] == "torque" else {}
    control = {} if scene in STEERED else {"control": str(rng.choice([*CONTROLS], p=[*CONTROLS.values()]))}
    if control.get("control") == "none":
        settings["control.delta"] = log_uniform(rng, 0.2, 0.9)
    # Lengths and angles within a factor of 2, clipped to the bounds of the setting.
    for setting in catalogue.settings(scene, rover=rover, **control):
        if setting.name in SCALED:
            settings[setting.name] = min(setting.high, max(setting.low, setting.value * log_uniform(rng, 0.5, 2.0)))
        elif setting.name == "terrain.seed":
            settings[setting.name] = int(rng.integers(1000))
    if rng.random() < 0.5:
        settings |= {"start.x": float(rng.uniform(-0.2, 0.2)), "start.yaw": float(rng.uniform(-0.3, 0.3))}
    return scene, settings | control


def judged(seed: int, seconds: float | None) -> dict[str, Any]:
    """Return the true and the stated numerical errors of a drive, or the reason if the simulation refuses the drive or
    its reference.
    """
    scene, settings = drawn(seed)
    settings |= {"duration": seconds} if seconds else {}
    row = {"seed": seed, "scene": scene, "control": settings.get("control", ""), "rover": settings["rover"]}
    try:
        chosen = scenario(scene, **settings)
        driven = chosen.drive()
        exact = finer(chosen, driven)
    except RoverPinError as refusal:
        return row | {"refused": str(refusal).splitlines()[0][:80]}
    # A drive may stop early, so only the common rows are compared.
    n = min(len(driven.t), len(exact.t))
    off = np.hypot(*(driven[name][:n] - exact[name][:n] for name in ("body_x", "body_y")))
    load, exact_load = (trace.stack("normal")[:n].mean(axis=0) for trace in (driven, exact))
    return row | {
        "dt_s": driven.attrs["dt_s"],
        "kept": not any("exceeds the tolerance" in warning for warning in driven.attrs["warnings"]),
        "off_m": float(off.max()),
        "stated_m": driven.attrs["step_error_m"],
        "load_off": float(np.abs(load - exact_load).max() / exact_load.mean()),
        "load_stated": driven.attrs["step_error_load"],
        "stop": driven.attrs["stop"].split(" ")[0].rstrip(":"),
        "stop_exact": exact.attrs["stop"].split(" ")[0].rstrip(":"),
    }


def finer(chosen: Scenario, driven: Trace) -> Trace:
    """Return the reference drive: the same drive with a finer time step."""
    # One control period is enough to find the step that the scenario usually takes.
    usual_dt = dataclasses.replace(chosen, duration=chosen.timing.control).drive(measure_error=False).attrs["dt_s"]
    divided = max(MAX_REFINEMENT, FINER_THAN_OWN * round(usual_dt / driven.attrs["dt_s"]))
    timing = dataclasses.replace(chosen.timing, divided=divided)
    return dataclasses.replace(chosen, timing=timing).drive(measure_error=False)


def figure(table: pd.DataFrame, out: Path) -> None:
    """Draw the error that the package states for each drive against the true error."""
    sheet, axes = new_figure(1, size=(6.0, 4.5))
    for colour, (keeps, rows) in zip(COLOURS, table.groupby(table["kept"].astype(bool)), strict=False):
        label = "keeps its tolerance" if keeps else "says that it keeps none"
        axes.loglog(1e3 * rows["off_m"], 1e3 * rows["stated_m"], ".", color=colour, label=label)
    # Points above the diagonal state more than their true error, which is the safe side.
    ends = np.array([1e-5, 1e2])
    axes.plot(ends, ends, color="0.5", label="as stated")
    axes.set(xlabel="true error [mm]", ylabel="stated error [mm]")
    axes.legend()
    save(sheet, out / "step_error.png")


if __name__ == "__main__":
    main()
