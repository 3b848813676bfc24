"""Measure the cost of a command from start to end, including imports: CPU seconds against those of an earlier version.

    python studies/benchmarks/process_cost.py [--quick] [--keep] [--against COMMIT]

Times are user and system time of the whole process, the minimum of several runs. The present and the earlier version
alternate on one core.
Compiled and checked files, including byte code, are kept from an untimed first run. The earlier version is taken from
the repository's history.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from former import ROOT, as_installed, checkout
from speed_table import keep, reader

BEFORE = "f624ee7"
"""The version before commands were made cheap."""
PROGRAM = """
import sys
try:
    from rover_pin.__main__ import main
except ImportError:  # in the former version
    from rover_pin.cli import main
sys.argv[0] = "rover-pin"
main()
"""
"""Python code that runs a command of the package, in the present version and in the version before the commands were
made cheap."""
COMMANDS = {"--help": (), "drive flat": ("--out", "drive"), "curve": ("--out", "curve"), "bounds": ()}


def main() -> None:
    """Measure the CPU time of every command, in the present version of the package and in an earlier version, and print
    the times. With --keep, store the times in speed.csv.
    """
    parser, measured = reader(__doc__, "two runs of each instead of ten"), {}
    parser.add_argument("--against", default=BEFORE, help=f"the earlier version; {BEFORE} unless given")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with checkout(options.against) as earlier, TemporaryDirectory() as out:
        # Both versions run the same command in the same folder.
        for command, more in COMMANDS.items():
            before, now = compared([*command.split(), *more], earlier, out, 2 if options.quick else 10)
            words = f"rover-pin {command}"
            measured |= {f"{command} [s]": now, f"{command}, over former [x]": now / before}
            print(f"{words:22s} {now:.3f} s of CPU, {before:.3f} s at {options.against}: ratio {now / before:.2f}")
    if options.keep:
        keep(measured)


def compared(words: list[str], earlier: Path, out: str, runs: int) -> tuple[float, float]:
    """Return the minimum CPU time [s] of a command in the former version and in the present version of the package."""
    times: dict[Path, list[float]] = {earlier: [], ROOT: []}
    for run in range(runs + 1):
        for package, taken in times.items():
            seconds = cpu_seconds(words, package, out)
            # The first run fills the caches and does not count.
            taken += [seconds] if run else []
    return min(times[earlier]), min(times[ROOT])


def cpu_seconds(words: list[str], package: Path, out: str) -> float:
    """Return the CPU time [s] of one command of the package in this folder."""
    completed, seconds, _ = timed(words, package, out, out)
    completed.check_returncode()
    return seconds


def timed(
    words: Sequence[str], package: Path, folder: Path | str, kept: Path | str = ""
) -> tuple[subprocess.CompletedProcess[str], float, float]:
    """Run a command of the package in a folder; return the completed process, its CPU time and wall time [s].

    The CPU time includes workers. If `kept` is given, the byte code is stored in that folder.
    """
    before, begin = children(), time.perf_counter()
    command, env = [sys.executable, "-c", PROGRAM, *words], as_installed(package, kept)
    completed = subprocess.run(command, cwd=folder, env=env, check=False, capture_output=True, text=True)
    return completed, children() - before, time.perf_counter() - begin


def children() -> float:
    """Return the CPU time [s] of all processes that this one started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
