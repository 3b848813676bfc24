"""Where slip control helps: sands that a slipping wheel digs, on slopes and in ditches, by what knows the slip.

Question
    The ensemble of the other studies does not dig, and there slip control does not help. Does it where a slipping wheel
    digs, as the paper says; how much slip should it allow; and how much of it needs the true slip?
Method
    Inclines of 3 to 9 deg on sands of k = 10 to 50 mm (Table 1: 50) that `DiggingMemory` digs with c_d = 0 to 0.2, R
    that of each sand's own flat at S = 0.05, 60 s. Ditches (0.05 m deep, 0.2 m wide) with walls of 38 to 48 deg in a
    stiff sand, k = 2.5 mm, that loses half of its strength past the peak (`PostPeak`), R = 0.03 or 0.1, with and
    without digging (c_d = 0.05), 45 s; and two in a sand of k = 10 mm that keeps its strength and digs (c_d = 0.1).
    Controls: constant duty 0.55; the paper's law with Eq 9 (its table measured on the same sand's flat), with the
    true slip at S_d = 0.1, 0.2, 0.5; the torque check alone, at the soil's greatest shear
    (T_sat) or at a slip of 0.5 (T_lim), or T_lim with a slip; tacking. A wheel counts as buried from a sinkage of CUT =
    0.5 radii, where a drive usually ends; these go on to 0.9. "Way" is x of the base then, or in the end; energy is
    electric, until buried or there; "further" by 10 mm. One drive in eight again at half the step.
Result
    Inclines, k = 25 and 50 mm, c_d = 0.1 and 0.2 (16; on the softest sand the rover digs in on the flat before them):
    constant duty is buried in 15, with T_sat, T_lim(0.5) and tacking as well; with Eq 9 in 11 of 12 (in 4 the sand is
    too soft for a table), T_lim(0.5) besides or not; truly known in none. Wheels sink to 32 mm without, to 10-19 mm
    with the true slip. S_d = 0.5 comes further than the buried rover in 15 of 15, 0.2 in 12, 0.1 in 11. But further is
    not up: of all 24 inclines that dig, S_d = 0.5 climbs the same 8 as constant duty and creeps on in the others; S_d =
    0.2 climbs 3, 0.1 none. Where nothing digs control costs: constant duty and 0.5 climb 3 of 4, 0.2 1, 0.1 none.
    Ditches where strength is lost: the true slip at 0.2 rescues 4 of 11 stuck drives and loses 0 of 5, at 0.1 and 0.5
    it rescues 1; Eq 9 and T_lim rescue 0 and lose 0. Where the sand digs too, constant duty is buried in 6 of 8, S_d =
    0.5 in 2, S_d = 0.2 in none. Tacking passes 14 of 16, from on-board sensors: in a ditch it is not slip that has to
    be known. Where strength is kept, only the true slip at 0.1 and 0.2 saves both from burial, nothing rescues any. At
    half the step all outcomes are the same, within 2.1 mm (median 0.004). With holes that faded below 5 mm/s T_lim(0.5)
    was buried in 10.
What the paper says
    "it will be stuck when the slip ratio develops to around 1 [...]. Based on this knowledge, we propose a traction
    control method to target the slip ratio at a small value"; it "keeps the slip ratio within a small value [...], so
    that the rover can successfully traverse over the obstacle without digging the soil or being stuck". S_d = 0.1.
What differs
    "Without digging or being stuck" comes out on sands that dig, with a slip that is known, and S_d = 0.1 is too timid:
    0.5 buries no wheel on an incline and comes furthest. The paper's own estimate, Eq 9, is blind here, and its torque
    check at the greatest shear does nothing. "Traverse the obstacle" needs a loss of strength, and S_d = 0.2.

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
"""Sinkage over wheel radius from which a wheel counts as buried here, and at which the drives themselves end."""
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
"""Name -> settings; constant duty 0.55 and the assumed gains (k_p = 0.1, k_i = 1/s) unless said."""
STARTS, UP = 0.4, 1.0
"""Where the inclines begin [m], and how far up them counts as climbed [m along x]."""
OUT_AT = 0.95
"""x of the base [m] from which all wheels have left the ditch, whose far lip is at 0.7."""
DURATION = {"incline": 60.0, "ditch": 45.0}
EVERY = 8
"""Each so many-th drive is repeated at half the step: all grounds and controls take part."""
FURTHER = 0.01
"""Way [m] from which one rover counts as having come further than another, when that was buried."""


class Ground(NamedTuple):
    """Where a drive goes: scenario, angle of slope or walls [deg], sand; R None is that of its flat at S = 0.05."""

    scene: str
    angle: float
    k: float
    R: float | None
    loss: float
    c_d: float


class Outcome(NamedTuple):
    """What a drive comes to: times [s] (NaN: never), places, sinkage [m], speed of the last 10 s [m/s], energy [J]."""

    buried: float
    there: float
    end_x: float
    x_buried: float
    deepest: float
    creep: float
    energy: float


SANDS = {0.010: (0.05, 0.1), 0.025: (0.0, 0.1, 0.2), 0.050: (0.1, 0.2)}
"""Sands of the inclines: k [m] -> c_d; DITCHES are in a sand that loses strength, RISING in one that does not."""
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
    """Drive, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few grounds, one step size: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/digging"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    grounds = [INCLINES[13], INCLINES[-1], DITCHES[1], DITCHES[12]] if options.quick else [*INCLINES, *DITCHES, *RISING]
    evaluations = Evaluations(options.out, None, said)
    jobs = [(ground, name, False) for ground in grounds for name in CONTROLS]
    halves = [] if options.quick else [(ground, name, True) for ground, name, _ in jobs[::EVERY]]
    results = tabled(jobs, evaluations.run("drives", judged, jobs))
    if halves:
        results = beside(results, tabled(halves, evaluations.run("at half the step", judged, halves)))
    files = plot.write_csv(results, options.out / "digging.csv"), figure(results, options.out / "digging.png")
    print(report(results))
    print(f"written: {files[0]}, {files[1]}")


def said(stage: str, done: int, total: int) -> None:
    if done % 100 == 0 or done == total:
        print(f"{stage}: {done} of {total}", flush=True)


def driven(ground: Ground, name: str, *, halved: bool = False) -> Trace:
    """Return the drive of a ground under a control of CONTROLS."""
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
    case: Scenario = scenario(ground.scene, soil="table-1", **settings, **CONTROLS[name])
    if name == "tacking":
        case = dataclasses.replace(case, controller=TackingControl(case.model.rover), symmetric=False)
    timing = case.timing.with_half_step() if halved else case.timing
    return dataclasses.replace(case, timing=timing).drive(measure_error=False)


def judged(ground: Ground, name: str, halved: bool) -> list[float]:
    """Return the Outcome of a drive; all NaN where Eq (9) has no table on this sand."""
    try:
        trace = driven(ground, name, halved=halved)
    except ParameterError:
        if not name.startswith("Eq 9"):
            raise
        return [math.nan] * len(Outcome._fields)
    deep, x, t = trace.stack("sinkage").max(axis=1), trace["body_x"], trace.t
    buried = first(t, deep > CUT * 0.045)
    there = first(t, x > (STARTS + UP if ground.scene == "incline" else OUT_AT))
    until = min(each for each in (buried, there, float(t[-1])) if not math.isnan(each))
    last = t > t[-1] - 10.0
    return [*Outcome(
        buried, there, float(x[-1]), float(np.interp(until if until == buried else t[-1], t, x)), float(deep.max()),
        float((x[-1] - x[last][0]) / (t[-1] - t[last][0])), float(np.interp(until, t, trace["energy_electric"])),
    )]  # fmt: skip


def first(t: np.ndarray, holds: np.ndarray) -> float:
    return float(t[np.argmax(holds)]) if holds.any() else math.nan


def tabled(jobs: Sequence[tuple[Ground, str, bool]], outcomes: Sequence[Sequence[float]]) -> pd.DataFrame:
    """Return a row for every drive."""
    rows = [(*ground, name, *found) for (ground, name, _), found in zip(jobs, outcomes, strict=True)]
    return pd.DataFrame(rows, columns=[*Ground._fields, "control", *Outcome._fields])


def beside(results: pd.DataFrame, halves: pd.DataFrame) -> pd.DataFrame:
    """Return the table with what half the step says of each EVERY-th drive: same outcome, and how far ends differ."""
    again = results.iloc[::EVERY].reset_index(drop=True)
    same = (again.buried.isna() == halves.buried.isna()) & (again.there.isna() == halves.there.isna())
    rows = results.index[::EVERY]
    moved = (again.end_x - halves.end_x).abs()
    return results.assign(same=pd.Series(same.to_numpy(), rows), moved=pd.Series(moved.to_numpy(), rows))


def report(results: pd.DataFrame) -> str:
    """Return the tables: inclines by sand and digging, ditches against constant duty, and what half the step says."""
    lines = []
    for (k, c_d), part in results[results.scene == "incline"].groupby(["k", "c_d"]):
        lines.append(f"inclines, k = {1e3 * k:g} mm, c_d = {c_d:g}, {part.angle.nunique()} slopes")
        lines += [inclined(name, part) for name in CONTROLS]
    for (k, loss, R, c_d), part in results[results.scene == "ditch"].groupby(["k", "loss", "R", "c_d"], dropna=False):
        told = "its own" if math.isnan(R) else f"{R:g}"
        walls = part.angle.nunique()
        lines.append(f"ditches, k = {1e3 * k:g} mm, R {told}, strength lost {loss:g}, c_d = {c_d:g}, {walls} walls")
        lines += [ditched(name, part) for name in CONTROLS]
    if "same" in results:
        again = results.dropna(subset="moved")
        kept = again[again.same.astype(bool)]
        lines.append(
            f"half the step: {len(kept)} of {len(again)} outcomes are the same; their ends differ by "
            f"{1e3 * kept.moved.median():.2g} mm (median), {int((kept.moved > 1e-3).sum())} by more than 1 mm, "
            f"{1e3 * kept.moved.max():.3g} mm at most"
        )
    return "\n".join(lines)


def inclined(name: str, part: pd.DataFrame) -> str:
    """Return a line on a control on inclines of one sand."""
    own, free = (part[part.control == each].set_index("angle") for each in (name, "none"))
    lost, there = free.buried.notna(), own.there.dropna()
    further = int((own.x_buried > free.x_buried + FURTHER)[lost].sum())
    climbed = f"climbed {len(there)}" + (f" in {there.mean():.0f} s" if len(there) else "")
    creep = f"at last {1e3 * own.creep.mean():5.2f} mm/s; further in {further} of {int(lost.sum())}"
    return drove(name, own, f"{climbed:17s}", creep)


def ditched(name: str, part: pd.DataFrame) -> str:
    """Return a line on a control in ditches of one sand: rescues and losses against constant duty."""
    own, free = (part[part.control == each].set_index("angle") for each in (name, "none"))
    there, base = own.there.notna(), free.there.notna()
    rescued = [f"{angle:g}" for angle in own.index[there & ~base]]
    walls = f" (walls {', '.join(rescued)})" * bool(rescued)
    out = f"out {int(there.sum())}" + (f" in {own.there.mean():.0f} s" if there.any() else "")
    lost = f"lost {int((base & ~there).sum())} of {int(base.sum())}"
    return drove(name, own, f"{out:13s}", f"rescued {len(rescued)} of {int((~base).sum())}{walls}, {lost}")


def drove(name: str, own: pd.DataFrame, there: str, more: str) -> str:
    """Return the line of a control: buried or there, how deep and far, for what energy, and more."""
    buried, deep = int(own.buried.notna().sum()), 1e3 * own.deepest
    if deep.isna().all():
        return f"  {name:20s} has no table of this sand"
    return (
        f"  {name:20s} buried {buried}, {there} sunk {deep.min():4.1f}-{deep.max():4.1f} mm, "
        f"way {own.x_buried.mean():5.2f} m, {own.energy.mean():5.1f} J, {more}"
    )


def figure(results: pd.DataFrame, file: Path) -> Path:
    """Draw one slope over time, and what becomes of each control on the inclines that dig."""
    sheet, axes = plot.new_figure(1, 3, size=(15.0, 4.4))
    shown = Ground("incline", 7.0, 0.025, None, 0.0, 0.1)
    names = ("none", "true slip 0.1", "true slip 0.5", "T_lim(0.5) alone")
    for name, colour in zip(names, plot.COLOURS, strict=False):
        trace = driven(shown, name)
        axes[0].plot(trace.t, 1e3 * trace.stack("sinkage").max(axis=1), color=colour, label=name)
        axes[1].plot(trace.t, trace["body_x"], color=colour, label=name)
    axes[0].axhline(1e3 * CUT * 0.045, color="black", lw=0.8, ls=":")
    axes[0].set(xlabel="t [s]", ylabel="deepest wheel [mm]", title="7 deg, k = 25 mm, c_d = 0.1; dotted: buried")
    axes[1].set(xlabel="t [s]", ylabel="x of the base [m]", title="the same: how far")
    axes[1].legend(fontsize=8)
    fates(axes[2], results)
    return plot.save(sheet, file)


def fates(axis: Axes, results: pd.DataFrame) -> None:
    """Draw the share of inclines on which each control is buried, climbs, or does neither; Eq 9 may lack a table."""
    part = results[(results.scene == "incline") & (results.c_d > 0.0)]
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
