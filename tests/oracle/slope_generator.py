"""Slip of a four-wheeler on slopes by bisection: statics by hand, Eqs (2)-(7) by `independent.soil`; no rover_pin."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
if "field_log" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("field_log", HERE / "field_log.py")
    sys.modules["field_log"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["field_log"])
field_log = sys.modules["field_log"]
soil = field_log.soil

HULL, WHEEL, DOWN, HALF = 30.0, 1.5, 0.1, 0.3
"""Masses of hull and wheel [kg]; wheels below the hull's middle, and ahead or behind it [m], as in `field_log`."""
MASS, G = HULL + 4 * WHEEL, 9.81
SLOPES = (0.0, 3.0, 6.0, 9.0, 12.0, 14.0)
SD = 0.01


def loads(slope, sunk):
    """Normal loads of a front and a rear wheel, vertical ground forces all alike in direction."""
    height = (HULL * (DOWN + field_log.R) + 4 * WHEEL * field_log.R) / MASS - sunk
    weight, lever = MASS * G * math.cos(slope), height * math.tan(slope) / HALF
    return 0.25 * weight * (1.0 - lever), 0.25 * weight * (1.0 + lever)


def bisected(of, low, high):
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if of(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def pull(S, load, ground, R):
    """Pull of a wheel that carries a load: torque over radius less R times the load."""

    def forces(theta):
        at = np.array([theta])
        return soil.forces(np.array([S]), at, -ground.exit_ratio * at, ground, field_log.R, field_log.B)

    theta = bisected(lambda theta: forces(theta)[0][0] - load, 1e-3, 1.5)
    return forces(theta)[1][0] / field_log.R - R * load


def slip(slope, ground, R):
    front, rear = loads(slope, 0.0)
    asked = MASS * G * math.sin(slope)
    return bisected(lambda S: 2 * (pull(S, front, ground, R) + pull(S, rear, ground, R)) - asked, -0.4, 0.97)


def write(folder, ground=field_log.SOIL, R=0.05, seed=0, repeats=3, sd=SD):
    """Write points.csv; return slopes [deg] and true slips."""
    random = np.random.default_rng(seed)
    true = np.array([slip(math.radians(slope), ground, R) for slope in SLOPES])
    rows = ["run,slope_deg,slip,slip_sd"]
    for run in range(repeats):
        rows += [
            f"day-{run},{a:g},{S + sd * random.standard_normal():.5f},{SD}" for a, S in zip(SLOPES, true, strict=True)
        ]
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    return np.array(SLOPES), true
