"""Batch studies: a plan over any parameter, run on all cores or on a cluster, resumed after a kill."""

from rover_pin.sweep.axis import LogRange, Range, Values
from rover_pin.sweep.case import drive_case
from rover_pin.sweep.plan import Grid, LatinHypercube, Sobol
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
