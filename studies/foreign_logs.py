"""Test whether `import-log` reads recordings correctly: drives in layouts that nobody chose, compared with their truth.

Question
    Of 40 layouts of a seed, how many are read correctly, refused with a question, or read incorrectly without notice?
Method
    `foreign/` drives a cart by its own equations and writes the measurements in a layout that is drawn property by
    property: language, names, units stated or not, clock, frame, heading, tilt, rates, gear, currents, duties, other
    columns, kind of file. It shares no code with the importer. In three of twenty layouts the drive is a ROS 2 bag. In
    another three of twenty the drive is split into three files, and in half of these the rover is at rest in one file.
    Right: every channel of the written log equals the truth: the clock to 2 %; the position up to a rotation and a
    shift, never mirrored; heading to 0.1 rad (0.4 if no heading is recorded); rates, currents and duties to 5 % and for
    the correct wheel; heights and tilts with the correct sign. Asked: a refusal. Wrong: anything else, whatever the log
    marks as guessed.
Result
    studies/results/foreign_logs.csv. The importer that guessed each part alone read 33 of 160 layouts right and 53
    wrong. The joint importer reads 435 of 520 right, asks about 84, and reads one wrong: rates behind a gear of 53,
    which look like degrees. Of the 360 layouts of seeds 51 to 74, first tried when it was finished, two more were
    wrong: a drive with the y axis up whose path rose like a wall, and a pitch whose sign was decided by one start.
What the paper says
    The paper imports no recordings: it logged with its own test bed.
What differs
    The layouts are invented. Real recordings may have properties that no layout has.

Run: python studies/foreign_logs.py [--quick] [--seeds 1 2 21 ...] [--count 40] [--out DIR]
"""

from __future__ import annotations

import argparse
import logging
import re
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from foreign.drive import Drive, drive
from foreign.files import bag, written
from foreign.layouts import Layout, layout

from rover_pin import plot
from rover_pin.base.errors import RoverPinError
from rover_pin.importing.import_log import import_log
from rover_pin.logs.drive_log import read_drive_log

SEEDS = [1, 2, 21, 22, 51, 52, 53, 61, 62, 71, 72, 73, 74]
ENOUGH = 0.05
"""Maximum error of an imported channel that counts as right, as a fraction of the channel's RMS value."""


class Outcome(NamedTuple):
    """Result of the import of one layout of a recording: 'right', 'asked' (the importer refuses and asks) or 'wrong',
    with the faults or the text of the refusal.
    """

    answer: str
    why: str
    left_out: str
    """Channels that the file contains and the log lacks."""


def main() -> None:
    """Try the layouts of the seeds, print their results, and add them to the table of all importers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two layouts: shows that it runs")
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--importer", default="joint", help="what to call it in the table")
    parser.add_argument("--out", type=Path, default=Path("out/foreign_logs"), help="folder of foreign_logs.csv")
    options = parser.parse_args()
    seeds, count = ([1], 2) if options.quick else (options.seeds, options.count)
    rows = []
    for seed in seeds:
        tried_rows = [{"importer": options.importer, **tried(seed, number)} for number in range(count)]
        for row in tried_rows:
            if row["answer"] != "right":
                print(f"{row['layout']:3d} {row['answer']:6s} {row['why'][:150]}")
        print(f"seed {seed}:", dict(Counter(row["answer"] for row in tried_rows)), flush=True)
        rows += tried_rows
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "foreign_logs.csv"
    # Rows of other importers stay in the table, so that versions can be compared.
    stored = pd.read_csv(path, keep_default_na=False) if path.exists() else pd.DataFrame(columns=list(rows[0]))
    table = pd.concat([stored[stored["importer"] != options.importer], pd.DataFrame(rows)])
    plot.write_csv(table, path)
    figure(table, options.out)


def figure(table: pd.DataFrame, out: Path) -> None:
    """Draw the number of layouts that each importer reads right, asks about, and reads wrong."""
    counts = table.groupby(["importer", "answer"]).size().unstack(fill_value=0)
    sheet, axes = plot.new_figure(1, size=(7.0, 1.2 + 0.6 * len(counts)))
    start = np.zeros(len(counts))
    for answer, colour in zip(("right", "asked", "wrong"), plot.COLOURS, strict=False):
        # An importer may lack one of the answers.
        size = counts.get(answer, 0) + 0 * start
        axes.barh(counts.index, size, left=start, color=colour, label=answer)
        start = start + size
    axes.set(xlabel=f"layouts (of {int(start.max())})")
    axes.legend(fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.25))
    plot.save(sheet, out / "foreign_logs.png")


def tried(seed: int, number: int) -> dict[str, Any]:
    """Import a recording in one random layout, and return the result as a row of the table."""
    random = np.random.default_rng([seed, number])
    # A temporary folder for each layout.
    with tempfile.TemporaryDirectory() as folder:
        truth = drive(random)
        paths, written_layout, begins = recorded(truth, Path(folder), random)
        outcome = imported(truth, written_layout, paths, begins, Path(folder) / "log")
    habits = ", ".join(f"{key}: {value}" for key, value in written_layout.habits.items() if value)
    return {"seed": seed, "layout": number, **outcome._asdict(), "habits": habits}


def recorded(truth: Drive, folder: Path, random: np.random.Generator) -> tuple[list[Path], Layout, dict[str, float]]:
    """Write a drive; return its files, its layout, and the start of each file [s]."""
    if random.random() < 0.15:
        path, table = bag(truth, folder, random)
        return [path], table, {path.name: 0.0}
    table = layout(random, truth)
    if random.random() > 0.15:
        path = written(table, folder, random)
        return [path], table, {path.name: 0.0}
    # Three files: all are written with the same random state, so that they have the same format.
    table.habits["files"] = "three"
    spans = np.array_split(np.arange(len(truth.t)), 3)
    stands = bool(random.random() < 0.5)
    state, paths, begins = random.bit_generator.state, [], {}
    for at, rows in enumerate(spans):
        part = {name: [values[row] for row in rows] if isinstance(values, list) else np.asarray(values)[rows]
                for name, values in table.columns.items()}  # fmt: skip
        # A file of a rover at rest repeats the first row, except for clocks and text.
        if stands and at == 1:
            table.habits["files"] = "three, one stands"
            part = {name: values if name in table.clock or isinstance(values, list)
                    else np.full(len(values), values[0]) for name, values in part.items()}  # fmt: skip
        (folder / "abc"[at]).mkdir()
        random.bit_generator.state = state
        path = written(table._replace(columns=part), folder / "abc"[at], random)
        paths.append(path.rename(folder / f"part{at}{path.suffix}"))
        begins[paths[-1].name] = float(truth.t[rows[0]])
    return paths, table, begins


def imported(truth: Drive, table: Layout, paths: list[Path], begins: dict[str, float], out: Path) -> Outcome:
    """Import a recording and compare the log with the truth."""
    try:
        # A refusal is a question to the user, so it is no error.
        import_log(paths, "cart", out)
        log = read_drive_log(out)
    except RoverPinError as error:
        return Outcome("asked", " ".join(str(error).replace(str(paths[0].parent), "").split()), "")
    # Each run of the log states in its purpose the file and the time at which it begins.
    runs = [(run, run.attrs["purpose"]) for run in log.runs]
    spans = []
    for run, purpose in runs:
        begin, name = re.search(r"from ([\d.]+) s of (.*)", purpose).groups()  # type: ignore[union-attr]
        spans.append((run, begins[name] + float(begin)))
    wrong = list(dict.fromkeys(faults(truth, table, spans)))
    there = set(spans[0][0].channels)
    lost = [
        name for name in table.truth if name not in there and name.replace("current", "raw_current")[:-2] not in there
    ]
    return Outcome("wrong" if wrong else "right", ", ".join(wrong), " ".join(lost))


def faults(truth: Drive, table: Layout, spans: list[tuple[Any, float]]) -> Any:
    """Yield the name of each channel that is wrong."""
    # The clock first: with a wrong clock no other comparison makes sense.
    step = float(np.median(np.diff(truth.t)))
    if table.habits["file"] != "bag":
        if any(abs(float(np.median(np.diff(run.t))) / step - 1.0) > 0.02 for run, _ in spans):
            yield "clock"
            return
    elif any(begin + run.t[-1] > 1.02 * truth.t[-1] for run, begin in spans):
        yield "clock"
        return
    at = [begin + np.asarray(run.t) for run, begin in spans]
    true = lambda name: [np.interp(t, truth.t, table.truth[name]) for t in at]  # noqa: E731
    logged = lambda name: [np.asarray(run[name]) for run, _ in spans]  # noqa: E731
    # A log may rotate and shift the position, so the truth is aligned before the comparison.
    turn, off = aligned(logged("body_x"), logged("body_y"), true("body_x"), true("body_y"))
    if off > 0.03 + 0.02 * float(np.ptp(truth.x) + np.ptp(truth.y)):
        yield f"place ({off:.2g} m off)"
    heading = np.concatenate([a - b - turn for a, b in zip(logged("body_yaw"), true("body_yaw"), strict=True)])
    angle = float(np.nanmedian(np.abs(np.angle(np.exp(1j * heading)))))
    if angle > (0.4 if table.habits.get("heading") == "none" else 0.1):
        yield f"heading ({angle:.2g} rad)"
    channels = set(spans[0][0].channels)
    inertial = [f"{kind}_{axis}" for kind in ("gyro", "accelerometer") for axis in "xyz"]
    for name in ("body_z", "body_pitch", "body_roll", *(name for name in inertial if name in table.truth)):
        if name in channels and unlike(logged(name), true(name), shifted=name == "body_z"):
            yield name
    for kind in ("wheel_rate_{}", "current_{}_A", "duty_{}"):
        names = [kind.format(corner) for corner in ("fl", "fr", "bl", "br")]
        for name in names:
            raw = name.replace("current", "raw_current").removesuffix("_A")
            # A current of unknown scale must correlate best with its own wheel.
            if name in channels and name in table.truth and unlike(logged(name), true(name)):
                yield name
            elif raw != name and raw in channels and other_wheel(np.concatenate(logged(raw)), name, names, true):
                yield raw
    extra = channels - {"t_s", *table.truth} - {f"raw_current_{corner}" for corner in ("fl", "fr", "bl", "br")}
    yield from (f"{name} made up" for name in sorted(extra))


def aligned(x: Any, y: Any, true_x: Any, true_y: Any) -> tuple[float, float]:
    """Return the rotation [rad] that turns the true path to the imported path, after a shift of each run, and the
    remaining RMS distance [m].
    """
    # Positions as complex numbers: the optimal rotation is the angle of the correlation.
    logged, truth = ([a + 1j * b - np.nanmean(a + 1j * b) for a, b in zip(*axes, strict=True)]
                  for axes in ((x, y), (true_x, true_y)))  # fmt: skip
    logged, truth = np.concatenate(logged), np.concatenate(truth)
    turn = np.angle(np.nansum(logged * np.conj(truth)))
    return float(turn), float(np.sqrt(np.nanmean(np.abs(logged - np.exp(1j * turn) * truth) ** 2)))


def unlike(logged: Any, true: Any, shifted: bool = False) -> bool:
    """Return whether an imported channel differs from the truth by more than its noise plus the fraction ENOUGH of its
    RMS value. The median difference is compared.
    """
    if shifted:
        logged, true = ([part - np.nanmean(part) for part in both] for both in (logged, true))
    logged, true = np.concatenate(logged), np.concatenate(true)
    size = float(np.sqrt(np.mean(true**2)))
    return not float(np.nanmedian(np.abs(logged - true))) < 6e-3 + ENOUGH * size


def other_wheel(raw: np.ndarray, name: str, names: list[str], true: Any) -> bool:
    """Return whether an imported motor current of unknown scale correlates better with the true current of another
    wheel than with the true current of its own wheel, or whether its correlation with its own wheel is below 0.9.
    """
    with_each = {candidate: abs(np.corrcoef(raw, np.concatenate(true(candidate)))[0, 1]) for candidate in names}
    return not with_each[name] > 0.9 or max(with_each, key=lambda candidate: with_each[candidate]) != name


if __name__ == "__main__":
    logging.disable(logging.INFO)
    warnings.simplefilter("ignore")
    sys.exit(main())
