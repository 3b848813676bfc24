"""Where slip control helps: drives on slopes and in ditches whose sand a slipping wheel digs, by source of the slip.

Question
    In the drives of the other studies no wheel digs, and there slip control does not help. The paper says that slip
    control helps where a slipping wheel digs. Is this statement right, how much slip should the control allow, and how
    much of the improvement needs the true slip?
Method
    Inclines of 3 to 9 deg are driven for 60 s on sands of k = 10 to 50 mm (Table 1: 50), which `DiggingMemory` digs
    with c_d = 0 to 0.2. R is chosen for each sand so that the rover cruises on the flat at S = 0.05. Ditches (0.05 m
    deep, 0.2 m wide) with walls of 38 to 48 deg are driven for 45 s in a stiff sand, k = 2.5 mm, that loses half of its
    strength past the peak (`PostPeak`), with R = 0.03 or 0.1, with and without digging (c_d = 0.05). Two further
    ditches lie in a sand of k = 10 mm that keeps its strength and digs (c_d = 0.1).
    The controls are: constant duty 0.55; the paper's law with Eq 9 (its table measured on the flat of the same sand);
    the paper's law with the true slip at S_d = 0.1, 0.2, 0.5; the torque limit alone, at the soil's maximum shear
    (T_sat) or at a slip of 0.5 (T_lim); T_lim together with a slip; and tacking. A wheel counts as buried at a sinkage
    of CUT = 0.5 radii, where a drive usually ends. Here the drives go on to 0.9 radii. The column "Way" is the x of the
    base at burial or at the end of the drive. Energy is electric, up to burial or arrival. A rover goes "further" than
    another rover if its x is larger by 10 mm. One drive in eight is repeated with half the time step.
Result
    Inclines with k = 25 and 50 mm and c_d = 0.1 and 0.2 (16 inclines; on the softest sand the rover digs in on the flat
    before them): constant duty buries a wheel on 15 inclines, and so do T_sat, T_lim(0.5) and tacking. Eq 9 buries a
    wheel on 11 of 12, with or without T_lim(0.5) (on 4 the sand is too soft for a table). The true slip buries no
    wheel. Wheels sink to 32 mm with constant duty and to 10-19 mm with the true slip. With S_d = 0.5 the rover goes
    further than the buried rover with constant duty on 15 of 15 inclines, with 0.2 on 12, and with 0.1 on 11. However,
    going further is not climbing: of all 24 inclines that dig, S_d = 0.5 climbs the same 8 as constant duty and creeps
    on the other 16; S_d = 0.2 climbs 3 and 0.1 none. Where no wheel digs, slip control reduces the distance: constant
    duty and S_d = 0.5 climb 3 of 4 inclines, 0.2 climbs 1, 0.1 none.
    Ditches with strength loss: the true slip at 0.2 rescues 4 of 11 stuck drives and loses 0 of 5; at 0.1 and 0.5 the
    true slip rescues 1; Eq 9 and T_lim rescue 0 and lose 0. Where the sand digs too, constant duty buries a wheel in 6
    of 8, S_d = 0.5 in 2, S_d = 0.2 in none. Tacking passes 14 of 16 with on-board sensors only, so passing a ditch does
    not require a known slip. Without strength loss, only the true slip at 0.1 and 0.2 saves both ditches from burial,
    and no control rescues a drive. With half the time step all outcomes are the same, and final positions agree within
    2.1 mm (median 0.004). With holes that faded below 5 mm/s, T_lim(0.5) buried a wheel in 10.
What the paper says
    "it will be stuck when the slip ratio develops to around 1 [...]. Based on this knowledge, we propose a traction
    control method to target the slip ratio at a small value"; it "keeps the slip ratio within a small value [...], so
    that the rover can successfully traverse over the obstacle without digging the soil or being stuck". S_d = 0.1.
What differs
    "Without digging or being stuck" is reproduced on sands that dig, if the controller knows the slip. S_d = 0.1 is too
    low: 0.5 buries no wheel on an incline and goes furthest. The paper's own estimate, Eq 9, does not see this slip,
    and its torque limit at the maximum shear has no effect. "Traverse the obstacle" needs a strength loss and S_d =
    0.2.

Run: python studies/digging.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from shared.tacking import TackingControl

from rover_pin import plot
from rover_pin.base.errors import ParameterError
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning.evaluations import Evaluations

CUT, CONTACT_ENDS = 0.5, 0.9
"""Limits of the sinkage divided by the wheel radius. At CUT a wheel counts as buried in this study, and at CONTACT_ENDS
the simulation ends the drive."""
CONTROLS: dict[str, dict[str, Any]] = {
    "none": {},
    "Eq 9": {"control": "eq9"},
    "true slip 0.1": {"control": "true", "control.S_d": 0.1},
    "true slip 0.2": {"control": "true", "control.S_d": 0.2},
    "true slip 0.5": {"control": "true", "control.S_d": 0.5},
    "T_sat alone": {"control": "limit", "control.limit": "saturation"},
    "T_lim(0.5) alone": {"control": "limit"},
    "Eq 9, T_lim(0.5)": {"control": "eq9", "control.limit": "at-slip"},
    "true 0.2, T_lim(0.5)": {"control": "true", "control.S_d": 0.2, "control.limit": "at-slip"},
    "tacking": {},
}
"""Name -> settings. The default is constant duty 0.55 with the assumed gains (k_p = 0.1, k_i = 1/s)."""
STARTS, UP = 0.4, 1.0
"""Start of the inclines [m], and distance along x [m] after which an incline counts as climbed."""
OUT_AT = 0.95
"""Position x of the base [m] from which all wheels have left the ditch. The far edge of the ditch is at 0.7 m."""
DURATION = {"incline": 60.0, "ditch": 45.0}
EVERY = 8
"""Every EVERY-th drive is repeated with half the time step, to check the numerical error. With this number, the
repeated drives include all grounds and controls."""
FURTHER = 0.01
"""Minimum difference of the driven distances [m]. Above this difference, a rover counts as having driven further than a
buried rover."""


class Ground(NamedTuple):
    """The ground of a drive: scenario, slope or wall angle [deg], sand. R = None gives S = 0.05 on the flat."""

    scene: str
    angle: float
    k: float
    R: float | None
    loss: float
    c_d: float


class Outcome(NamedTuple):
    """Result of a drive: times [s] (NaN: never), positions, sinkage [m], speed of the last 10 s [m/s], energy [J]."""

    buried: float
    there: float
    end_x: float
    x_buried: float
    deepest: float
    creep: float
    energy: float


SANDS = {0.010: (0.05, 0.1), 0.025: (0.0, 0.1, 0.2), 0.050: (0.1, 0.2)}
"""Sands of the inclines: k [m] -> c_d. The sand of DITCHES loses strength, and the sand of RISING does not."""
INCLINES = [
    Ground("incline", angle, k, None, 0.0, c_d)
    for k, digging in SANDS.items()
    for c_d, angle in itertools.product(digging, (3.0, 5.0, 7.0, 9.0))
]
DITCHES = [
    Ground("ditch", wall, 0.0025, R, 0.5, c_d)
    for R, c_d, wall in itertools.product((0.03, 0.1), (0.0, 0.05), (38.0, 42.0, 46.0, 48.0))
]
RISING = [Ground("ditch", wall, 0.010, None, 0.0, 0.1) for wall in (30.0, 45.0)]


def main() -> None:
    """Drive every ground under every control, write the table and the figure, and print the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few grounds, one step size: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/digging"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    grounds = [INCLINES[13], INCLINES[-1], DITCHES[1], DITCHES[12]] if options.quick else [*INCLINES, *DITCHES, *RISING]
    evaluations = Evaluations(options.out, None, said)
    jobs = [(ground, name, False) for ground in grounds for name in CONTROLS]
    # A repeated drive at half the step shows whether the outcome depends on the step.
    halves = [] if options.quick else [(ground, name, True) for ground, name, _ in jobs[::EVERY]]
    results = tabled(jobs, evaluations.run("drives", judged, jobs))
    if halves:
        results = beside(results, tabled(halves, evaluations.run("at half the step", judged, halves)))
    files = plot.write_csv(results, options.out / "digging.csv"), figure(results, options.out / "digging.png")
    print(report(results))
    print(f"written: {files[0]}, {files[1]}")


def said(stage: str, done: int, total: int) -> None:
    """Print the progress after every 100 drives."""
    if done % 100 == 0 or done == total:
        print(f"{stage}: {done} of {total}", flush=True)


def driven(ground: Ground, name: str, *, halved: bool = False) -> Trace:
    """Return the trace of a ground under a control of CONTROLS."""
    slope = {"angle_deg": ground.angle, "start": STARTS}
    place = slope if ground.scene == "incline" else {"wall_angle_deg": ground.angle}
    effects = {"PostPeak.fraction": ground.loss, "DiggingMemory.c_d": ground.c_d}
    settings = {
        **{f"terrain.{key}": value for key, value in place.items()},
        "soil.k": ground.k,
        **({"cruise_slip": 0.05} if ground.R is None else {"effect.MotionResistance.R": ground.R}),
        "add": [f"{word}={size}" for word, size in effects.items() if size],
        "buried": CONTACT_ENDS,
        "duration": DURATION[ground.scene],
    }
    # The tacking controller steers, so its drives are not mirror-symmetric.
    case: Scenario = scenario(ground.scene, soil="table-1", **settings, **CONTROLS[name])
    if name == "tacking":
        case = dataclasses.replace(case, controller=TackingControl(case.model.rover), symmetric=False)
    timing = case.timing.with_half_step() if halved else case.timing
    return dataclasses.replace(case, timing=timing).drive(measure_error=False)


def judged(ground: Ground, name: str, halved: bool) -> list[float]:
    """Return the Outcome of a drive as a list. All values are NaN if the table of steady speeds for Eq (9) cannot be
    measured on this sand.
    """
    try:
        trace = driven(ground, name, halved=halved)
    except ParameterError:
        if not name.startswith("Eq 9"):
            raise
        return [math.nan] * len(Outcome._fields)
    deep, x, t = trace.stack("sinkage").max(axis=1), trace["body_x"], trace.t
    buried = first(t, deep > CUT * 0.045)
    there = first(t, x > (STARTS + UP if ground.scene == "incline" else OUT_AT))
    # Energy and distance are those at the first event: burial, arrival, or the end of the drive.
    until = min(time for time in (buried, there, float(t[-1])) if not math.isnan(time))
    last = t > t[-1] - 10.0
    return [*Outcome(
        buried, there, float(x[-1]), float(np.interp(until if until == buried else t[-1], t, x)), float(deep.max()),
        float((x[-1] - x[last][0]) / (t[-1] - t[last][0])), float(np.interp(until, t, trace["energy_electric"])),
    )]  # fmt: skip


def first(t: np.ndarray, holds: np.ndarray) -> float:
    """Return the first time at which a condition holds, or NaN if it never holds."""
    return float(t[np.argmax(holds)]) if holds.any() else math.nan


def tabled(jobs: Sequence[tuple[Ground, str, bool]], outcomes: Sequence[Sequence[float]]) -> pd.DataFrame:
    """Return the table of all drives, one row each."""
    rows = [(*ground, name, *values) for (ground, name, _), values in zip(jobs, outcomes, strict=True)]
    return pd.DataFrame(rows, columns=[*Ground._fields, "control", *Outcome._fields])


def beside(results: pd.DataFrame, halves: pd.DataFrame) -> pd.DataFrame:
    """Return the table of all drives with two more columns for the repeated drives: whether the outcome is the same
    with half the time step, and the difference of the final x [m].
    """
    again = results.iloc[::EVERY].reset_index(drop=True)
    is_same = (again.buried.isna() == halves.buried.isna()) & (again.there.isna() == halves.there.isna())
    rows = results.index[::EVERY]
    distance = (again.end_x - halves.end_x).abs()
    return results.assign(same=pd.Series(is_same.to_numpy(), rows), moved=pd.Series(distance.to_numpy(), rows))


def report(results: pd.DataFrame) -> str:
    """Return the report: inclines by sand and digging, ditches against constant duty, and the comparison of steps."""
    lines = []
    for (k, c_d), part in results[results.scene == "incline"].groupby(["k", "c_d"]):
        lines.append(f"inclines, k = {1e3 * k:g} mm, c_d = {c_d:g}, {part.angle.nunique()} slopes")
        lines += [inclined(name, part) for name in CONTROLS]
    # R is NaN where each sand has its own; groupby would drop these rows otherwise.
    for (k, loss, R, c_d), part in results[results.scene == "ditch"].groupby(["k", "loss", "R", "c_d"], dropna=False):
        R_text = "its own" if math.isnan(R) else f"{R:g}"
        walls = part.angle.nunique()
        lines.append(f"ditches, k = {1e3 * k:g} mm, R {R_text}, strength lost {loss:g}, c_d = {c_d:g}, {walls} walls")
        lines += [ditched(name, part) for name in CONTROLS]
    if "same" in results:
        again = results.dropna(subset="moved")
        equal = again[again.same.astype(bool)]
        lines.append(
            f"half the step: {len(equal)} of {len(again)} outcomes are the same; their ends differ by "
            f"{1e3 * equal.moved.median():.2g} mm (median), {int((equal.moved > 1e-3).sum())} by more than 1 mm, "
            f"{1e3 * equal.moved.max():.3g} mm at most"
        )
    return "\n".join(lines)


def inclined(name: str, part: pd.DataFrame) -> str:
    """Return the report line of one control on the inclines of one sand."""
    controlled, free = (part[part.control == control].set_index("angle") for control in (name, "none"))
    # Distances are compared only where constant duty is buried.
    lost, there = free.buried.notna(), controlled.there.dropna()
    further_count = int((controlled.x_buried > free.x_buried + FURTHER)[lost].sum())
    climbed = f"climbed {len(there)}" + (f" in {there.mean():.0f} s" if len(there) else "")
    creep = f"at last {1e3 * controlled.creep.mean():5.2f} mm/s; further in {further_count} of {int(lost.sum())}"
    return drove(name, controlled, f"{climbed:17s}", creep)


def ditched(name: str, part: pd.DataFrame) -> str:
    """Return the report line of one control in the ditches of one sand: the drives in which it passes and constant duty
    does not (rescues), and the opposite (losses).
    """
    controlled, free = (part[part.control == control].set_index("angle") for control in (name, "none"))
    # A rescue needs constant duty to fail on the same ground; a loss needs it to pass.
    there, base = controlled.there.notna(), free.there.notna()
    rescued = [f"{angle:g}" for angle in controlled.index[there & ~base]]
    walls = f" (walls {', '.join(rescued)})" * bool(rescued)
    out = f"out {int(there.sum())}" + (f" in {controlled.there.mean():.0f} s" if there.any() else "")
    lost = f"lost {int((base & ~there).sum())} of {int(base.sum())}"
    return drove(name, controlled, f"{out:13s}", f"rescued {len(rescued)} of {int((~base).sum())}{walls}, {lost}")


def drove(name: str, controlled: pd.DataFrame, there: str, more: str) -> str:
    """Return the report line of a control: numbers of buried rovers and of drives that arrive, sinkage, distance,
    energy, and further text.
    """
    buried, deep = int(controlled.buried.notna().sum()), 1e3 * controlled.deepest
    # Eq (9) has no table where the flat of the sand cannot be driven.
    if deep.isna().all():
        return f"  {name:20s} has no table of this sand"
    return (
        f"  {name:20s} buried {buried}, {there} sunk {deep.min():4.1f}-{deep.max():4.1f} mm, "
        f"way {controlled.x_buried.mean():5.2f} m, {controlled.energy.mean():5.1f} J, {more}"
    )


def figure(results: pd.DataFrame, file: Path) -> Path:
    """Draw one drive up a slope over time, and the shares of the outcomes of each control on inclines in whose sand
    wheels dig.
    """
    sheet, axes = plot.new_figure(1, 3, size=(15.0, 4.4))
    # One slope of the inclines that dig, under four of the controls.
    ground = Ground("incline", 7.0, 0.025, None, 0.0, 0.1)
    names = ("none", "true slip 0.1", "true slip 0.5", "T_lim(0.5) alone")
    for name, colour in zip(names, plot.COLOURS, strict=False):
        trace = driven(ground, name)
        axes[0].plot(trace.t, 1e3 * trace.stack("sinkage").max(axis=1), color=colour, label=name)
        axes[1].plot(trace.t, trace["body_x"], color=colour, label=name)
    axes[0].axhline(1e3 * CUT * 0.045, color="black", lw=0.8, ls=":")
    axes[0].set(xlabel="t [s]", ylabel="deepest wheel [mm]", title="7 deg, k = 25 mm, c_d = 0.1; dotted: buried")
    axes[1].set(xlabel="t [s]", ylabel="x of the base [m]", title="the same: how far")
    axes[1].legend(fontsize=8)
    fates(axes[2], results)
    return plot.save(sheet, file)


def fates(axis: Axes, results: pd.DataFrame) -> None:
    """Draw, for each control, the share of the inclines on which the rover is buried, climbs 1 m, or does neither. The
    shares may add up to less than 100 % for the control that uses Eq (9), because its table cannot be measured on some
    sands.
    """
    part = results[(results.scene == "incline") & (results.c_d > 0.0)]
    # The three outcomes exclude each other, so the bars add up to 100 %.
    shares = {
        "buried": part.buried.notna(),
        "climbed 1 m": part.buried.isna() & part.there.notna(),
        "neither": part.buried.isna() & part.there.isna() & part.deepest.notna(),
    }
    bottom = np.zeros(len(CONTROLS))
    for (label, holds), colour in zip(shares.items(), (plot.COLOURS[3], plot.COLOURS[2], "lightgrey"), strict=True):
        share = np.array([100.0 * float(holds[part.control == name].mean()) for name in CONTROLS])
        axis.barh(list(CONTROLS), share, left=bottom, color=colour, label=label)
        bottom = bottom + share
    axis.invert_yaxis()
    axis.set(xlabel="% of inclines that dig", title=f"inclines with digging ({len(part) // len(CONTROLS)})")
    axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)


if __name__ == "__main__":
    main()
