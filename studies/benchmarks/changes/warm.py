"""What every fork would build anew: rovers and the compiled laws of their models, which take longer than many tests."""

from __future__ import annotations

import warnings
from pathlib import Path

SCENES = ("ditch", "flat")
"""Scenarios whose rover and laws most tests of the motion use."""


def warm() -> None:
    """Build the models that many tests drive; the package keeps them."""
    from rover_pin.motion.kernel import Kernel
    from rover_pin.motion.place import Start, settled
    from rover_pin.scenarios import scenario

    for name in SCENES:
        model = scenario(name).model
        Kernel(model, settled(model, Start()), 0.005, symmetric=False)


def lines_of_warming(tree: Path) -> dict[str, list[int]]:
    """Return the lines that `warm` runs, by file: a change of another finds what it would have built itself."""
    import coverage

    measured = coverage.Coverage(data_file=None, include=[f"{tree}/rover_pin/*"], config_file=False)
    with warnings.catch_warnings(), measured.collect():
        warm()
    data = measured.get_data()
    return {str(Path(each).relative_to(tree)): sorted(data.lines(each) or []) for each in data.measured_files()}
