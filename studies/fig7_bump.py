"""Fig 7: rocker and bogie angles over a bump, and the effect of a hard obstacle, which the paper suspects.

Question
    Does the suspension move over an obstacle as it should? Does a hard obstacle on loose sand, instead of sand
    everywhere, change "the time scale" and leave "the overall profile", as the paper supposes of its experiment?
Method
    The bump is a raised cosine of 0.03 m over 0.3 m (shape and size are not in the paper), across the full width or
    under the left wheels only, of sand (Table 1, with the traction factor T / (r f_n), wheel torque T over radius r and
    normal force f_n) or of hard ground between sand. The duty is 0.55. "Crossing" is the time from the front wheels'
    first touch to the rear wheels' last. Profiles are compared over position, and over time with the crossing time
    scaled to one. Every drive is repeated with half the time step.
Result
    Full width: the crossing takes 16.4 s over sand and 13.4 s over the hard bump; the ratio of both times is 1.23. Left
    wheels only: 15.6 and 13.7 s; the ratio is 1.14. The bogie turns by 15 deg in all four drives, the rocker by 3.7 deg
    (sand) and 4.5 deg (hard, left only). Bogie angles on sand and hard ground differ by 11.7 deg rms on one clock, by
    5.6 with the crossing time scaled to one, and by 1.7 when compared over position (left wheels only: 10.6, 6.5, 4.3).
    The paper's supposition is therefore right in kind: the ground of the obstacle changes the time scale, and the
    profile much less. The ratio of the crossing times depends on the height of the bump: 1.15 at 0.02 m, 1.43 at 0.04
    m. On sand the one-sided bump also turns the rover, by 15 deg, and at 0.04 m so much that a right wheel meets the
    edge of the bump. With half the time step no crossing time changes by 0.01 s.
What the paper says
    "the time scale, which corresponds to the translational velocity of the rover, has difference between the two
    although, the overall profile shows good agreement"; "in the simulation, all the surface is modeled as dry sand but,
    in reality, the obstacle has a hard surface while other flat area is composed by loose sand."
What differs
    The figure's numbers are not available, so profiles are compared with each other and not with the paper's. Over an
    obstacle as wide as the rover both rockers stay at 0, because left and right are equal and the differential makes
    one the opposite of the other. Rocker angles as in Fig 7 need a one-sided obstacle.

Run: python studies/fig7_bump.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from rover_pin.plot import configuration, draw_rover, ground_line, save, write_csv
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.trace.trace import Trace

HEIGHT, LENGTH, AT = 0.03, 0.3, 0.5
REACH = 0.21
"""Distance from the body's origin to the farthest point at which a wheel can touch the bump [m]: half the wheelbase
plus the radius of a wheel."""
WIDTHS = {"bump": "full width", "one-sided-bump": "left wheels only"}
GROUNDS = {0: ("sand", "tab:orange"), 1: ("hard", "tab:blue")}
Case = tuple[str, int]


def main() -> None:
    """Drive over all bumps, write table, histories and figure, and print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one step size only, no other heights")
    parser.add_argument("--out", type=Path, default=Path("out/fig7_bump"))
    options = parser.parse_args()
    # Every combination of width and ground, at the height of the study.
    cases = {(width, ground): over(width, ground) for width in WIDTHS for ground in GROUNDS}
    traces = {case: drive.drive() for case, drive in cases.items()}
    table = summary(cases, traces, options.quick)
    csv = write_csv(histories(traces), options.out / "fig7_bump.csv")
    write_csv(table, options.out / "fig7_summary.csv")
    png = save(draw(cases, traces), options.out / "fig7_bump.png")
    print(table.to_string(index=False))
    for width, label in WIDTHS.items():
        print(f"{label}: {agreement(traces[width, 0], traces[width, 1])}")
    print(f"written: {csv}, {png}")


def over(width: str, ground: int, height: float = HEIGHT) -> Scenario:
    """Return the drive over the bump of a ground: 0 sand, 1 hard."""
    settings = {"terrain.height": height, "terrain.length": LENGTH, "terrain.at": AT, "terrain.ground": ground}
    return scenario(width, soil="table-1", **settings, duration=30.0)


def crossing(trace: Trace) -> tuple[float, float]:
    """Return the times at which the first wheel reaches the bump and the last leaves it [s]; NaN if it does not."""
    places = np.array([AT - REACH, AT + LENGTH + REACH])
    # The rover may roll back a little, so the first passage is that of the running maximum of x.
    begin, end = np.interp(places, np.maximum.accumulate(trace["body_x"]), trace.t, right=np.nan)
    return float(begin), float(end)


def peak(trace: Trace, name: str) -> float:
    """Return the maximum absolute angle of a channel [deg]."""
    return float(np.degrees(np.max(np.abs(trace[name]))))


def summary(cases: dict[Case, Scenario], traces: dict[Case, Trace], quick: bool) -> pd.DataFrame:
    """Return the results as a table with one row for each bump and height. Drives at the usual height are taken from
    the earlier results.
    """
    rows = []
    heights = (HEIGHT,) if quick else (0.02, HEIGHT, 0.04)
    for width, ground in cases:
        for height in heights:
            # Drives at the height of the study exist already.
            is_usual = height == HEIGHT
            case = cases[width, ground] if is_usual else over(width, ground, height)
            rows.append(row(case, traces[width, ground] if is_usual else case.drive(), (width, ground, height), quick))
    return pd.DataFrame(rows)


def row(case: Scenario, trace: Trace, names: tuple[str, int, float], quick: bool) -> dict[str, object]:
    """Return the results of a drive as a row of the table: crossing time, largest angles of the suspension, and the
    crossing time with half the time step.
    """
    width, ground, height = names
    begin, end = crossing(trace)
    cells = {
        "bump": WIDTHS[width],
        "of": GROUNDS[ground][0],
        "height_mm": 1e3 * height,
        "crossing_s": round(end - begin, 2),
    }
    # Angles of the left side, which meets the bump in both widths.
    cells |= {f"{angle_name}_deg": round(peak(trace, f"{angle_name}_l"), 1) for angle_name in ("rocker", "bogie")}
    cells |= {f"{angle_name}_deg": round(peak(trace, f"body_{angle_name}"), 1) for angle_name in ("pitch", "yaw")}
    if not quick:
        begin, end = crossing(dataclasses.replace(case, timing=case.timing.with_half_step()).drive(measure_error=False))
        cells["crossing_half_dt_s"] = round(end - begin, 2)
    return cells | {"stop": trace.attrs["stop"]}


def histories(traces: dict[Case, Trace]) -> pd.DataFrame:
    """Return the angles of all drives over time, one drive after the other."""
    parts = []
    for (width, ground), trace in traces.items():
        part = pd.DataFrame(
            {"bump": WIDTHS[width], "of": GROUNDS[ground][0], "t_s": trace.t, "body_x_m": trace["body_x"]}
        )
        for name in ("rocker_l", "rocker_r", "bogie_l", "bogie_r", "body_pitch", "body_roll", "body_yaw"):
            part[f"{name}_deg"] = np.degrees(trace[name])
        part["speed_mps"] = trace["body_vx"]
        # About 600 rows of each drive are enough for the figure.
        parts.append(part[:: max(1, len(part) // 600)].round(6))
    return pd.concat(parts)


def agreement(sand: Trace, hard: Trace) -> str:
    """Return the RMS difference of the two bogie profiles over position, over time, and over scaled time, as text."""
    (a, b), (c, d) = crossing(sand), crossing(hard)
    share = np.linspace(0.0, 1.0, 500)
    x = np.linspace(AT - REACH, AT + LENGTH + REACH, 500)
    angle = "bogie_l"

    def apart(first: np.ndarray, second: np.ndarray) -> float:
        """Return the RMS difference between two profiles of an angle [deg]."""
        return float(np.degrees(np.sqrt(np.mean((first - second) ** 2))))

    over_place = apart(*(np.interp(x, np.maximum.accumulate(trace["body_x"]), trace[angle]) for trace in (sand, hard)))
    same_clock = apart(*(np.interp(c + (d - c) * share, trace.t, trace[angle]) for trace in (sand, hard)))
    # Scaled time: each drive from its first to its last touch of the bump.
    pairs = ((sand, a, b), (hard, c, d))
    scaled = apart(*(np.interp(begin + (end - begin) * share, trace.t, trace[angle]) for trace, begin, end in pairs))
    return (
        f"crossing on sand takes {(b - a) / (d - c):.2f} times as long as over the hard bump; bogies differ (rms) "
        f"by {same_clock:.1f} deg on one clock, {scaled:.1f} deg with time scaled, {over_place:.1f} deg over the place"
    )


def draw(cases: dict[Case, Scenario], traces: dict[Case, Trace]) -> Figure:
    """Draw the rover on the bump, the suspension angles against time and against position, and the speed."""
    figure = Figure(figsize=(11, 10.5), layout="constrained")
    axes = figure.subplot_mosaic([["bump", "bump"], ["a", "b"], ["c", "d"]], height_ratios=[1.05, 1, 1])
    outline(axes["bump"], cases["bump", 0], traces["bump", 0])
    # Angles over time: the left wheels over a bump of sand and of hard ground.
    for key, width in (("a", "bump"), ("b", "one-sided-bump")):
        for ground, (name, colour) in GROUNDS.items():
            trace = traces[width, ground]
            for joint, style in (("bogie_l", "-"), ("rocker_l", "--")):
                label = f"{joint[:-2]}, {name} bump"
                axes[key].plot(trace.t, np.degrees(trace[joint]), style, color=colour, label=label)
        axes[key].set(title=f"{WIDTHS[width]}: left side over time", xlabel="t [s]", ylabel="angle [deg]", xlim=(4, 24))
    # Angles over position, where the time scale has no influence, and the speed.
    for ground, (name, colour) in GROUNDS.items():
        trace = traces["one-sided-bump", ground]
        axes["c"].plot(trace["body_x"], np.degrees(trace["bogie_l"]), color=colour, label=f"bogie, {name} bump")
        axes["c"].plot(trace["body_x"], np.degrees(trace["rocker_l"]), "--", color=colour, label=f"rocker, {name} bump")
        full = traces["bump", ground]
        axes["d"].plot(full.t, 1e3 * full["body_vx"], color=colour, label=f"full width, {name} bump")
        axes["d"].plot(trace.t, 1e3 * trace["body_vx"], ":", color=colour, label=f"left only, {name} bump")
    axes["c"].set(
        title="left wheels only: the same over the place", xlabel="body x [m]", ylabel="angle [deg]", xlim=(0.2, 1.1)
    )
    axes["d"].set(title="speed: the time scale", xlabel="t [s]", ylabel="forward speed [mm/s]", xlim=(4, 24))
    for key in "abcd":
        axes[key].grid(alpha=0.3)
        axes[key].margins(y=0.32)
        axes[key].legend(fontsize=8, ncols=2, loc="upper center")
    return figure


def outline(axes: object, case: Scenario, trace: Trace) -> None:
    """Draw the rover's outline at equal distances over the bump of sand."""
    low, high = -0.05, 1.3
    x, z = ground_line(case.model.terrain, low, high, 0.16)
    axes.fill_between(x, z, -0.04, color="#d9c9a5", lw=0)
    axes.plot(x, z, color="#8a7340", lw=1)
    places = (0.2, 0.42, 0.64, 0.86, 1.08)
    # Darker outlines are later.
    for shade, place in zip(np.linspace(0.6, 0.0, len(places)), places, strict=True):
        at = int(np.searchsorted(trace["body_x"], place))
        if at < len(trace.t):
            draw_rover(axes, case.model.rover, configuration(case.model.rover, trace, at), str(shade))
            axes.text(place, 0.2, f"{trace.t[at]:.1f} s", ha="center", fontsize=9, color=str(shade))
    axes.set(aspect="equal", xlim=(low, high), ylim=(-0.04, 0.23), xlabel="x [m]", ylabel="z [m]")
    axes.set_title("over the full-width bump of sand (Table 1, torque form, duty 0.55)")


if __name__ == "__main__":
    main()
