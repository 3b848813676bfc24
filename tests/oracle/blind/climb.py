"""Drive logs for the method of section 4 of the paper: the independent simulator climbs a slope of growing inclination
at constant duty.
"""

from math import radians

import numpy as np

from .campaign import MOTOR, MOTOR_SPREAD, TACHO_SPREAD, declared
from .drive import HOLD, drive
from .logs import write_set
from .sensors import measured
from .world import PLAIN, Run

RATE, FROM, STEEPEST = radians(10.0), 0.5, radians(20.0)
"""The slope grows by RATE [rad/m] from x = FROM [m] to STEEPEST."""
X = np.round(np.arange(-1.0, 4.001, 0.02), 6)
RESISTANCES = (0.01, 0.06)
"""Share of the load that wheels take to roll, at least and at most (assumed)."""
CONSTANTS_SD, DURATION = 0.015, 60.0
"""Relative SD of the declared torque constant about the true one: within the doubt that `identify` assumes."""


def slope(x):
    """Return the height of the slope: the integral of tan(RATE s), then a straight continuation."""
    s, end = np.maximum(x - FROM, 0.0), STEEPEST / RATE
    bent = -np.log(np.cos(RATE * np.minimum(s, end))) / RATE
    return bent + np.tan(STEEPEST) * np.maximum(s - end, 0.0)


def run(numbers, random, duration=DURATION, duty=0.55):
    """Return a climb of a rover whose motors differ slightly."""
    true = dict(numbers)
    lane = (X, slope(X))
    rows = round(duration / HOLD) + 1
    gain = tuple(1.0 + MOTOR_SPREAD * random.standard_normal(6))
    true["R"] = random.uniform(*RESISTANCES)
    return Run(true, (lane,), (), (0.0, 0.0, 0.0), np.full((rows, 6), duty), motor_gain=gain)


def climbs(truths, seed, duration=DURATION):
    """Return the true channels of one climb for each row of `truths` (dictionaries of numbers); all are
    driven at once.
    """
    runs = [run(numbers, np.random.default_rng([seed, at]), duration) for at, numbers in enumerate(truths)]
    channels = drive(runs, duration)
    return [(climb_run, {name: values[at] for name, values in channels.items()}) for at, climb_run in enumerate(runs)]


def write_climb(folder, climb, seed, electric=True, sure=False):
    """Write the log of a climb as sensors record it: with noise, six gains of tachometers, and a declared torque
    constant that is slightly wrong.
    """
    item, channels = climb
    random = np.random.default_rng(seed)
    gains = 1.0 + (0.0 if sure else TACHO_SPREAD) * random.standard_normal(6)
    off = 1.0 + (0.0 if sure else CONSTANTS_SD) * random.standard_normal()
    logged = measured(channels, {}, gains, random, electric)
    declaration = declared({name: PLAIN[name] for name in ("phi", "k", "k_1")}, {"phi": 0.05, "k": 1.0, "k_1": 0.1})
    declaration["motor"] = {
        name: {k: v for k, v in entry.items() if k != "sd"} for name, entry in declaration["motor"].items()
    }
    # A torque K i alone changes with k_t where the gear makes up for it in the back-EMF: none is measured by current.
    declaration["motor"]["k_t"]["value"] = MOTOR["k_t"] * off
    plan = {
        "runs": [("climb", "a slope that steepens", item)],
        "declared": declaration,
        "heights": [slope(X)],
        "X": X,
        "borders": (),
    }
    write_set(folder, plan, [logged])
