"""Which lines of the package a test runs, and how long that takes."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path


def covered(tree: Path, work: Callable[[], str]) -> tuple[str, float, dict[str, list[int]]]:
    """Return what `work` returns, its CPU time [s], and the lines of the package that it runs, by file."""
    import coverage

    begun = time.process_time()
    measured = coverage.Coverage(data_file=None, include=[f"{tree}/rover_pin/*"], config_file=False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No data was collected")
        with measured.collect():
            found = work()
        data = measured.get_data()
    lines = {str(Path(each).relative_to(tree)): sorted(data.lines(each) or []) for each in data.measured_files()}
    return found, time.process_time() - begun, lines
