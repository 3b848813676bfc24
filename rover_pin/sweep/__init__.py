"""Batch studies: a scenario is driven with many parameter values, on all cores or on a cluster.

A study that was stopped can be continued. Start at `sweep`, which runs a study, and at `read_study`, which reads a
study from a TOML file.
"""

from rover_pin.sweep.case import drive_case
from rover_pin.sweep.plan import Grid, LatinHypercube, LogRange, Range, Sobol, Values
from rover_pin.sweep.reading import read_study
from rover_pin.sweep.run import Results, sweep
from rover_pin.sweep.store import collect
from rover_pin.sweep.study import Case, Study

__all__ = [
    "Case",
    "Grid",
    "LatinHypercube",
    "LogRange",
    "Range",
    "Results",
    "Sobol",
    "Study",
    "Values",
    "collect",
    "drive_case",
    "read_study",
    "sweep",
]
