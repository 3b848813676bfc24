"""Slip of a rover with four wheels on slopes by bisection: statics by hand, Eqs (2)-(7) by `independent.soil`; imports
nothing of rover_pin.
"""

import dataclasses
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
    """Return the normal loads of a front and a rear wheel. All forces of the ground have the vertical direction."""
    height = (HULL * (DOWN + field_log.R) + 4 * WHEEL * field_log.R) / MASS - sunk
    weight, lever = MASS * G * math.cos(slope), height * math.tan(slope) / HALF
    return 0.25 * weight * (1.0 - lever), 0.25 * weight * (1.0 + lever)


def bisected(of, low, high):
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if of(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def stands(S, load, ground):
    """Return the entry angle of a wheel that carries a load, and its torque."""

    def forces(theta):
        at = np.array([theta])
        return soil.forces(np.array([S]), at, -ground.exit_ratio * at, ground, field_log.R, field_log.B)

    theta = bisected(lambda theta: forces(theta)[0][0] - load, 1e-3, 1.5)
    return theta, forces(theta)[1][0]


def rut(theta, ground):
    """Return the work of compaction for each metre of a rut, b int p dz from the exit of the wheel, Eq (4), by the
    trapezoidal rule.
    """
    across = np.linspace(-ground.exit_ratio * theta, theta, 4001)
    depth = np.maximum(np.cos(across) - math.cos(theta), 0.0)
    pressure = (ground.k_1 + ground.k_2 * field_log.B) * (field_log.R / field_log.B * depth) ** ground.n
    return field_log.B * field_log.R * np.trapezoid(pressure * np.sin(across), across)


def pull(S, load, ground, R, digs=0.0):
    """Return the pull of a wheel that carries a load: torque over radius minus R times the load.

    The hidden effect `digs` increases the exponent n in proportion to a driving slip. The additional work for the
    deeper rut is subtracted from the pull.
    """
    softer = dataclasses.replace(ground, n=ground.n + digs * max(S, 0.0))
    theta, torque = stands(S, load, softer)
    lost = rut(theta, softer) - rut(stands(S, load, ground)[0], ground) if digs else 0.0
    return torque / field_log.R - R * load - lost


def slip(slope, ground, R, digs=0.0):
    front, rear = loads(slope, 0.0)
    wanted_pull = MASS * G * math.sin(slope)

    def left(S):
        return 2 * (pull(S, front, ground, R, digs) + pull(S, rear, ground, R, digs)) - wanted_pull

    return bisected(left, -0.4, 0.97)


def write(folder, ground=field_log.SOIL, R=0.05, seed=0, repeats=3, sd=SD, slopes=SLOPES, digs=0.0):
    """Write points.csv, and return slopes [deg] and true slips."""
    random = np.random.default_rng(seed)
    true = np.array([slip(math.radians(slope), ground, R, digs) for slope in slopes])
    rows = ["run,slope_deg,slip,slip_sd"]
    for run in range(repeats):
        rows += [
            f"day-{run},{a:g},{S + sd * random.standard_normal():.5f},{sd or SD}"
            for a, S in zip(slopes, true, strict=True)
        ]
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    return np.array(slopes), true
