"""Parts of the studies' figures that a look at the picture does not check."""

import importlib.util
from pathlib import Path

import numpy as np

STUDIES = Path(__file__).parents[2] / "studies"


def study(name):
    spec = importlib.util.spec_from_file_location(name, STUDIES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_gains_lie_in_the_cell_of_the_nearest_point_by_ratio():
    centres = np.geomspace(0.01, 10.0, 12)
    edges = study("tune_gains").log_edges(centres)
    for gain in np.geomspace(0.009, 11.0, 97):
        cell = np.searchsorted(edges, gain) - 1
        assert cell == np.argmin(np.abs(np.log(centres / gain)))
