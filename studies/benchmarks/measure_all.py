"""All numbers of docs/speed.md, one benchmark after another, into studies/results/speed.csv: about ten minutes alone.

    python studies/benchmarks/measure_all.py

What else runs beside them costs ratios little and seconds much: run it on a machine that is left alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

BENCHMARKS = ("drive_speed", "ground_speed", "replay_speed", "process_cost", "close_loop_speed")


def main() -> None:
    """Run each, as a process of its own."""
    for name in BENCHMARKS:
        print(f"{name}, load {os.getloadavg()[0]:.1f}", flush=True)
        subprocess.run([sys.executable, str(Path(__file__).with_name(f"{name}.py")), "--keep"], check=True)


if __name__ == "__main__":
    main()
