"""Drives per minute of a batch study with one worker, with two, and on a Dask cluster of two workers.

    python studies/benchmarks/sweep_throughput.py [--quick]

Each way runs the study of sweep_ditch.toml four times into a fresh folder: "cold", the first, pays for starting
processes, importing and what is calibrated once; "warm", the others, do not. The tables must be equal, or there is
nothing to compare.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rover_pin.sweep import Sobol, Study, read_study, sweep

RUNS = 4
STUDY = Path(__file__).parents[1] / "sweep_ditch.toml"


@contextmanager
def two_dask_workers() -> Iterator[str]:
    """Yield the address of a scheduler on this machine with two workers of one thread each."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def timed(study: Study, folder: Path, **how: Any) -> tuple[float, Any]:
    """Return the drives per minute of a sweep and its table."""
    start = time.perf_counter()
    table = sweep(study, folder, **how).table
    return 60.0 * len(table) / (time.perf_counter() - start), table


def compare(study: Study, folder: Path) -> None:
    """Run the study in each way and print one line each."""
    with two_dask_workers() as address:
        ways: dict[str, dict[str, Any]] = {
            "1 worker": {"workers": 1},
            "2 workers": {"workers": 2},
            "Dask, 2 workers": {"scheduler": address},
        }
        tables = []
        for name, how in ways.items():
            (cold, *warm), made = zip(*(timed(study, folder / name / str(i), **how) for i in range(RUNS)), strict=True)
            tables += made
            print(f"{name:16s} cold {cold:6.0f}, warm {min(warm):.0f} to {max(warm):.0f} drives per minute", flush=True)
    if not all(table.equals(tables[0]) for table in tables):
        raise SystemExit("The tables differ: the rates above compare nothing.")
    print(f"{len(tables[0])} cases of {study.duration:g} s, {tables[0]['error'].notna().sum()} failed; equal tables.")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="4 cases of 2 s instead of 64 of 20 s")
    study = read_study(STUDY)
    if parser.parse_args().quick:
        study = dataclasses.replace(study, plan=Sobol(4), duration=2.0)
    with tempfile.TemporaryDirectory() as folder:
        compare(study, Path(folder))


if __name__ == "__main__":
    main()
