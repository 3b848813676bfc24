"""Compare physics with odometry on a public log: a skid-steered rover, tracked by RTK.

Question
    The runs of a Husky have its position by RTK, and its speed and turn rate from its filter. On runs that are left
    out, how large are the errors of odometry with fitted slip, track and tracked point, of the fitted base model, and
    of the model from the loop?
Method
    The recordings are public, without a stated licence, so they are not stored here:
    https://github.com/kaasmandje/ResearchMethods2023. The argument is the folder of a download. Every line is a single
    record (GPS, IMU, Odometry). `import-log` reads them. They contain no wheel rates. The rim speeds are v -+ omega B'
    / 2, with the effective track B' = B (1 + (L / B)^2) that scrubbing requires. omega is the turn rate of the gyro
    (the rover's filter follows the gyro within 0.005 rad/s), so the compared turn rate contains more than wheels alone
    would show. The recordings contain no heading with the same zero as the position. The course replaces the heading,
    so that a constant sideways drift is not known. The rover is a URDF with the maker's numbers.
Result
    studies/results/rtk_log.csv. The base model does not describe these data. On runs left out, the path error of
    odometry is 20.8 mm (noise 14.8), of the fitted base model 37.5, and of the loop's model (a load, rates, a grip that
    falls with slip) 25.4. The model's heading is better (2.4 against 2.8 deg, noise 2.3). The same holds on later runs
    that turn. On nearly straight runs all three are at the noise, since wheels may now roll on their own radius. In
    turns the scrub of the wheels does not reduce the reported speed; a speed that was measured at the wheels would be
    reduced. These data do not determine the active cause: the named cause changed with each change of the candidates.
What the paper says
    The paper has no such log: its rover steers, and its wheels are measured.
What differs
    The ground, a field, is unknown, and so is the tracked point.

Run: python studies/rtk_log.py FOLDER [--quick] [--runs B1 B2 C1 C2] [--out DIR]
"""

from __future__ import annotations

import argparse
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin import close_the_loop, plot
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.experiments.drive_log.odometry_rival import odometry_baselines
from rover_pin.importing.import_log import import_log
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.rover.rover import load_rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.simulation.model.model import Model

R, B, L = 0.1651, 0.5708, 0.512
"""Wheel radius, track and wheelbase of a Husky [m], from its maker's URDF."""
WHEELS = {"fl": (L / 2, B / 2), "fr": (L / 2, -B / 2), "rl": (-L / 2, B / 2), "rr": (-L / 2, -B / 2)}
ORIGIN, BEGIN = (174040.0, 444350.0), datetime(2022, 6, 1, 13, tzinfo=UTC)
LATER = (["B3", "B4", "C3", "C4"], ["B5", "B6", "C5", "C6"], ["D1", "D2", "D3", "D4"], ["E1", "E2", "E3", "E4"],
         ["A2", "A3", "A4", "A5"])  # fmt: skip
"""Runs that are not fitted. In A1 the rover is at rest, and A6 fails for its authors too."""
V, OMEGA = "Odometry_DeltaPosition_1", "Odometry_AngularVelocity_3"


def main() -> None:
    """Search for the missing effect in some runs (`close_the_loop`), predict other runs with the resulting model, and
    print and write the errors.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", help="of the downloaded CSVs")
    parser.add_argument("--quick", action="store_true", help="a made-up drive of that layout against odometry alone")
    parser.add_argument("--runs", nargs="+", default=["B1", "B2", "C1", "C2"], help="those to fit")
    parser.add_argument("--out", type=Path, default=Path("out/rtk_log"), help="folder of rtk_log.csv")
    options = parser.parse_args()
    if options.folder is None and not options.quick:
        parser.error("give the folder of the downloaded CSVs; the docstring says where they are")
    folder, runs, out = options.folder, options.runs, options.out
    out.mkdir(parents=True, exist_ok=True)
    # The quick check needs no download: it invents two runs and compares odometry only.
    log = read_drive_log(imported(None, [], out / "quick") if options.quick else imported(folder, runs, out / "fitted"))
    rows = against_odometry(log) if options.quick else closed(log, out)
    # Later runs are predicted with the models from the first runs, without a new fit.
    for group in () if options.quick else LATER:
        verdict, later = rows[0]["verdict"], read_drive_log(imported(folder, group, out / "-".join(group)))
        rows += predicted(log, later, (verdict.before.model, verdict.model), " ".join(group))
    table = pd.DataFrame(rows).drop(columns="verdict", errors="ignore")
    plot.write_csv(table, out / "rtk_log.csv")
    print(table.to_string(index=False, float_format="{:.4f}".format))
    figure(table, out)


def imported(folder: Path | None, runs: list[str], work: Path) -> Path:
    """Return the folder of the drive log of these runs, or of two invented runs if `folder` is None."""
    work.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{run}.csv" for run in runs] if folder else [made_up(work / f"{side}.csv", side) for side in
                                                                    (1, -1)]  # fmt: skip
    if (work / "log").exists():
        shutil.rmtree(work / "log")
    rover = husky(work)
    half = effective_track(load_rover(str(rover))) / 2
    # Rim rates by the effective track, as expressions of the recorded columns.
    rates = {f"wheel_rate_{name}": f"({V} {'-' if y > 0 else '+'} {half:.6f} * {OMEGA}) / {R}"
             for name, (_, y) in WHEELS.items()}  # fmt: skip
    done = import_log(files, rover, work / "log", {"body_x": "GPS_4", "body_y": "GPS_5", **rates})
    print("\n".join(done.notes))
    return work / "log"


def husky(work: Path) -> Path:
    """Write a rover with the maker's numbers; return the path of its TOML file."""
    # Boxes with the maker's masses; the inertias are those of the body and of a wheel.
    box = '<inertia ixx="{0}" iyy="{1}" izz="{2}" ixy="0" ixz="0" iyz="0"/>'
    body = f'<inertial><origin xyz="0 0 0.1"/><mass value="46.0"/>{box.format(0.6, 1.5, 1.7)}</inertial>'
    parts = [f'<link name="base_link">{body}</link>']
    for name, (x, y) in WHEELS.items():
        solid = f'<inertial><mass value="2.6"/>{box.format(0.025, 0.044, 0.025)}</inertial>'
        place = f'<parent link="base_link"/><child link="{name}_link"/><origin xyz="{x} {y} 0.03"/><axis xyz="0 1 0"/>'
        parts.append(f'<link name="{name}_link">{solid}</link><joint name="{name}" type="continuous">{place}</joint>')
    (work / "husky.urdf").write_text(f'<robot name="husky">{"".join(parts)}</robot>')
    (work / "husky.toml").write_text(
        'name = "husky"\nurdf = "husky.urdf"\nbase = "base_link"\n'
        f'[wheels]\nfront = ["fl", "fr"]\nrear = ["rl", "rr"]\n[wheel]\nr = {R}\nb = 0.1143\n'
    )
    return work / "husky.toml"


def made_up(path: Path, side: int) -> Path:
    """Write a drive by equations in the layout of the recordings: straight, a curve, straight, with 5 % slip."""
    random, t = np.random.default_rng(side % 5), np.arange(0.0, 40.0, 0.02)
    omega, v = 0.3 * side * ((t > 14.0) & (t < 24.0)), 0.4 * np.minimum(1.0, t / 2.0)
    yaw = np.cumsum(omega) * 0.02
    # The tracked point lies 0.1 m behind the middle of the rover.
    place = np.cumsum(0.95 * v * np.exp(1j * yaw)) * 0.02 - 0.1 * np.exp(1j * yaw)
    lines = []
    for at, second in enumerate(t):
        stamp = (BEGIN + timedelta(seconds=float(second))).strftime("%Y:%m:%d %H:%M:%S.%f")
        heading = f"Orientation;0.0;0.0;{np.degrees(yaw[at])}"
        rate = f"AngularVelocity;0.0;0.0;{omega[at] + random.normal(0.0, 0.005)}"
        lines.append(f"Odometry;{stamp};Position;0.0;0.0;0.0;DeltaPosition;{v[at]};0.0;0.0;{heading};{rate}")
        if at % 5 == 0:
            x, y = np.array([place[at].real, place[at].imag]) + ORIGIN + random.normal(0.0, 0.005, 2)
            lines.append(f"GPS;{stamp};51.98;5.66;4;{x};{y}")
    path.write_text("\n".join(lines) + "\n")
    return path


def against_odometry(log: DriveLog) -> list[dict[str, Any]]:
    """Return the errors of odometry on each run, fitted to the other runs."""
    experiment, model, _ = experiment_on(log, with_spread(base_model(log), motors=False))
    baselines = odometry_baselines(experiment, model.rover)
    errors = [(baseline, zip(experiment.folds, baseline.by_fold, strict=True)) for baseline in baselines]
    return [{"runs": run, "channel": baseline.channel, "unit": baseline.unit, "odometry": error}
            for baseline, by_run in errors for run, error in by_run]  # fmt: skip


def closed(log: DriveLog, out: Path) -> list[dict[str, Any]]:
    """Return the errors on parts of the data that are left out one after another, for odometry, for the base model, and
    for the model with the added effects.
    """
    verdict = close_the_loop(log, out=out / "loop", progress=print)
    print(verdict.summary())
    # Odometry with fitted slip, track and tracked point is the rival of the physics.
    odometry = {baseline.channel: baseline.error for baseline in verdict.baselines}
    return [{"runs": f"{len(log.runs)} parts, each left out", "channel": score.name, "unit": score.unit,
             "odometry": odometry[score.name], "base": score.before, "loop": score.after, "noise": score.floor,
             "answer": verdict.answer.value, "named": " + ".join(verdict.named), "verdict": verdict}
            for score in verdict.scores]  # fmt: skip


def predicted(log: DriveLog, later: DriveLog, models: tuple[Model, ...], runs: str) -> list[dict[str, Any]]:
    """Return the errors of odometry, of the base model and of the model with the added effects on later runs. All three
    were fitted to `log`.
    """
    # The log to which everything was fitted, and the later log, with the same channels.
    fitted, later_runs = (experiment_on(drive_log, models[0])[0] for drive_log in (log, later))
    odometry = {
        baseline.channel: baseline.error for baseline in odometry_baselines(fitted, models[0].rover, later_runs)
    }
    missed = later_runs.observed - later_runs.predict(models)
    rms = lambda values: float(np.sqrt(np.nanmean(values**2)))  # noqa: E731
    return [{"runs": runs, "channel": name, "unit": later_runs.unit(name), "odometry": odometry[name],
             "base": rms(missed[0, :, at]), "loop": rms(missed[1, :, at]), "noise": later_runs.floor()[at]}
            for at, name in enumerate(later_runs.channels)]  # fmt: skip


def figure(table: pd.DataFrame, out: Path) -> None:
    """Draw the errors of odometry and of the models for each run."""
    channels = list(dict.fromkeys(table["channel"]))
    sheet, axes = plot.new_figure(len(channels), size=(7.0, 2.4 * len(channels)))
    for panel, channel in zip(np.atleast_1d(axes), channels, strict=True):
        rows = table[table["channel"] == channel]
        for name in ("odometry", "base", "loop"):
            if name in rows:
                panel.plot(rows[name], rows["runs"], "o", label=name)
        panel.set(xlabel=f"{channel} [{rows['unit'].iloc[0]}]")
    np.atleast_1d(axes)[0].legend(fontsize=8)
    plot.save(sheet, out / "rtk_log.png")


if __name__ == "__main__":
    main()
