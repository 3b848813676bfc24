"""What docs/speed.md says against the table that the benchmarks kept: the same digits, and the promised bounds."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
TEXT = " ".join((ROOT / "docs" / "speed.md").read_text(encoding="utf-8").split())
TABLE = pd.read_csv(ROOT / "studies" / "results" / "speed.csv").set_index(["benchmark", "name"]).value
N = r"([0-9.]+[0-9])"


def of(benchmark, name):
    """A number of the table."""
    return float(TABLE[benchmark, name])


def drive(name):
    return of("drive_speed", name)


def ground(name):
    return of("ground_speed", name)


def replay(name):
    return of("replay_speed", name)


def process(name):
    return of("process_cost", name)


@pytest.mark.parametrize(
    ("said", "numbers"),
    [
        (rf"20 s of the ditch take {N} s \({N} times real time\) at the default step of 5 ms",
         lambda: [drive("ditch [s]"), 20 / drive("ditch [s]")]),
        (rf"x is within {N} mm of a sixteenth of the step \(the rover stops before the wall; {N} mm with k = 10 mm",
         lambda: [drive("off [mm]"), drive("off with k = 10 mm [mm]")]),
        (rf"and {N} s \({N} times\) at 10 ms, within {N} mm",
         lambda: [drive("ditch at 10 ms [s]"), 20 / drive("ditch at 10 ms [s]"), drive("off at 10 ms [mm]")]),
        (rf"A step takes {N} µs", lambda: [drive("step [us]")]),
        (rf"runs at {N} times real time with steps of 2 ms, {N} times with 4 ms: ours at 5 ms is {N} times as fast as "
         rf"its 2 ms, at 10 ms {N} times",
         lambda: [20 / drive("MuJoCo at 2 ms [s]"), 20 / drive("MuJoCo at 4 ms [s]"),
                  drive("MuJoCo at 2 ms [s]") / drive("ditch [s]"),
                  drive("MuJoCo at 2 ms [s]") / drive("ditch at 10 ms [s]")]),
        (rf"plain NumPy reference takes {N} times as long", lambda: [drive("plain [x]")]),
        (rf"A drive needs {N} MB", lambda: [drive("memory [MB]")]),
        (rf"controller in Python costs {N} µs a sample", lambda: [drive("Python controller [us]")]),
        (rf"1,000 points along the same ditch cost {N} times as much", lambda: [
            ground("ditch, 1,000 points and its corners [x]")]),
        (rf"a grid of 300 x 300 {N} times", lambda: [ground("ditch, 300 x 300 grid [x]")]),
        (rf"rough ground of 81 points {N} times", lambda: [ground("rough ground, 81 points [x]")]),
        (rf"of 1,000 points {N} times", lambda: [ground("rough ground, 1,000 points [x]")]),
        (rf"A sweep's case costs {N} times its drive, {N} s of driving a second of one core",
         lambda: [ground("case over drive [x]"), ground("drive-seconds a core-second")]),
        (rf"driven again in {N} ms on the ditch, {N} ms on a washboard, {N} and {N} times faster",
         lambda: [replay("ditch [ms]"), replay("washboard [ms]"), replay("ditch, former over now [x]"),
                  replay("washboard, former over now [x]")]),
        (rf"compiles: {N} s for the step, {N} s for a new rover, {N} s for a new set of effects",
         lambda: [replay(f"compiling {name} [s]") for name in ("the step", "a rigid body", "a set of laws")]),
        (rf"nobody declared take {N} s of CPU with two workers, {N} s on the clock",
         lambda: [of("close_loop_speed", "close-loop, CPU [s]"), of("close_loop_speed", "close-loop, clock [s]")]),
        (rf"`rover-pin --help` takes {N} s of CPU, `drive flat` {N} s: {N} and {N} of what they took",
         lambda: [process("--help [s]"), process("drive flat [s]"), process("--help, over former [x]"),
                  process("drive flat, over former [x]")]),
    ],
)  # fmt: skip
def test_the_page_says_what_was_measured(said, numbers):
    found = re.search(said, TEXT)
    assert found, said
    for text, value in zip(found.groups(), numbers(), strict=True):
        last = 10.0 ** -len(text.partition(".")[2])
        assert abs(float(text) - value) <= 0.51 * last + 5e-4 * abs(value), (text, value)


def test_what_was_asked_of_the_step_is_reached():
    """The bounds that the step is held to; the table is measured, no test times anything."""
    assert drive("off [mm]") <= 0.1
    assert drive("off with k = 10 mm [mm]") <= 0.1
    assert drive("MuJoCo at 2 ms [s]") / drive("ditch [s]") >= 7.0
    assert ground("ditch, 1,000 points and its corners [x]") <= 1.3
    assert ground("ditch, 300 x 300 grid [x]") <= 1.5
    assert ground("case over drive [x]") <= 1.3
    assert ground("drive-seconds a core-second") >= 250.0
    assert replay("ditch, former over now [x]") >= 3.5
    assert replay("washboard, former over now [x]") >= 3.5
    assert sum(replay(f"compiling {name} [s]") for name in ("the step", "a rigid body", "a set of laws")) <= 4.0
    assert drive("memory [MB]") <= 210.0
    assert process("--help, over former [x]") <= 0.5
    assert process("drive flat, over former [x]") <= 0.5
