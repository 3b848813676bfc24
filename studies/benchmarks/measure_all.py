"""Measure all numbers of docs/speed.md, one benchmark after another, and store them: about ten minutes alone.

    python studies/benchmarks/measure_all.py

The numbers go to studies/results/speed.csv. Other work on the machine changes ratios little and seconds much, so run it
on a machine without other work.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

BENCHMARKS = ("drive_speed", "ground_speed", "replay_speed", "tangent_speed", "process_cost", "close_loop_speed")


def main() -> None:
    """Run each benchmark as a separate process."""
    for name in BENCHMARKS:
        print(f"{name}, load {os.getloadavg()[0]:.1f}", flush=True)
        subprocess.run([sys.executable, str(Path(__file__).with_name(f"{name}.py")), "--keep"], check=True)


if __name__ == "__main__":
    main()
