"""The drive log of Fig 8, made by this simulator: sand whose grip builds up at once, wheels that dig, and a slope of
growing inclination.

python tests/oracle/blind/fig8.py --out studies/data/steepening-slope writes the log again, equal to the last digit. The
hidden effect is `DiggingMemory`. The declared k is more than twice the true k.
"""

import argparse
import os
import sys
from math import radians
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np  # noqa: E402

from blind import campaign  # noqa: E402
from blind.drive import HOLD, drive  # noqa: E402
from blind.logs import write_set  # noqa: E402
from blind.sensors import measured  # noqa: E402
from blind.world import PLAIN, Run  # noqa: E402

SEED, DURATION, EVERY = 8, 40.0, 2
"""Rows are logged at 10 Hz."""
TRUE = {"k": 0.0015, "R": 0.34, "phi": radians(30.0), "DiggingMemory.c_d": 0.1, "DiggingMemory.length": 0.04}
SAID = {"phi": radians(30.0), "k": 0.0035, "k_1": PLAIN["k_1"]}
SAID_SD = {"phi": radians(1.5), "k": 0.5, "k_1": 0.15}
"""Of k and k_1 relative."""
FROM, RATE, STEEPEST = 0.25, radians(10.0), radians(20.0)
"""Fig 8's slope grows by 10 deg a metre, assumed as the package's."""
X = np.round(np.arange(-1.2, 3.001, 0.04), 6)
FINE = np.round(np.arange(-1.2, 3.001, 0.02), 6)
SLOPE, FLAT, BORDER = 0.6, -0.6, 0.0
"""y of the lanes' middles, and between them [m]."""
ROWS = round(DURATION / HOLD) + 1


def height(x):
    """Return the height of the slope: the integral of tan(RATE s), then a straight continuation."""
    s, end = np.maximum(x - FROM, 0.0), STEEPEST / RATE
    bent = -np.log(np.cos(RATE * np.minimum(s, end))) / RATE
    return bent + np.tan(STEEPEST) * np.maximum(s - end, 0.0)


def steps(random, low, high, side=0.08, longest=5.0):
    """Return duties that are constant for some seconds and that differ slightly between wheels [ROWS, 6]."""
    duty, at = np.empty((ROWS, 6)), 0
    while at < ROWS:
        until = at + round(random.uniform(2.5, longest) / HOLD)
        duty[at:until] = random.uniform(low, high) + random.uniform(-side, side, 6)
        at = until
    return duty


def between(duty, begin, end, factor):
    """Return the duties, multiplied by a factor from `begin` to `end` [s]."""
    changed = duty.copy()
    changed[round(begin / HOLD) : round(end / HOLD)] *= factor
    return changed


def drives(random):
    """Return (name, purpose, y, x, yaw, duties) of the runs."""
    constant_duty = np.full((ROWS, 6), 0.55)
    return (
        ("climb-1", "Fig 8: constant duty up a slope that steepens", SLOPE, 0.0, 0.0, constant_duty),
        ("climb-2", "the same on sand raked again", SLOPE, 0.0, 0.0, constant_duty),
        ("climb-steps", "the same slope, duties in steps, a pause where the wheels have dug", SLOPE, 0.1, 0.0,
         between(steps(random, 0.45, 0.8), 24.0, 27.0, 0.0)),
        ("climb-back", "up until it slips, back, and up again", SLOPE, 0.2, 0.0,
         between(between(np.full((ROWS, 6), 0.7), 20.0, 26.0, -0.8), 0.0, 8.0, 0.8)),
        ("flat-steps", "duties in steps on the flat", FLAT, -0.4, 0.0, steps(random, 0.3, 0.85)),
        ("descent", "down the slope from 9 deg, duties in steps, some backwards", SLOPE, 1.1, np.pi,
         between(steps(random, 0.35, 0.75), 14.0, 22.0, -1.0)),
    )  # fmt: skip


def plan(seed=SEED, true=TRUE):
    """Return the runs and the declarations of the log."""
    random = np.random.default_rng([seed, 0])
    gains = {"motor": 1.0 + campaign.MOTOR_SPREAD * random.standard_normal(6)}
    gains["tacho"] = 1.0 + campaign.TACHO_SPREAD * random.standard_normal(6)
    heights, runs = np.round([np.zeros(len(X)), height(X)], 5), []
    for at, (name, purpose, y, x, yaw, duty) in enumerate(drives(random)):
        run_rng = np.random.default_rng([seed, 1, at])
        row = heights[1 if y > BORDER else 0]
        z = np.interp(FINE, X, row) + campaign.relief(run_rng, FINE)
        run = Run(
            dict(true), tuple((FINE, height) for height in z), (y,), (x, y, yaw), duty, None, tuple(gains["motor"]),
            (FINE[0], FINE[1] - FINE[0]), campaign.strength(run_rng, FINE),
        )  # fmt: skip
        runs.append((name, purpose, run))
    declared = campaign.declared(SAID, SAID_SD)
    declared["motor"] |= {name: declared["motor"][name] | {"sd": 0.02 * declared["motor"][name]["value"]}
                          for name in ("gear", "resistance")}  # fmt: skip
    metadata = {
        "source": "Simulated, not measured: tests/oracle/blind/fig8.py, a second simulator that shares no code with "
        "the package, with the noise of the test bed's sensors; it stands in for Fig 8's experiment, not published",
        "licence": "MIT, as this repository",
        "header": (
            "Six drives of Nexus 6 on sand that gives way at once, on a slope that steepens as in Fig 8. SIMULATED.",
            *told(seed, true),
        ),
    }
    return {"runs": runs, "declared": declared, "heights": heights, "X": X, "borders": (BORDER,)} | metadata, gains


def told(seed, true):
    """Return the lines that state the hidden effect."""
    if (seed, true) != (SEED, TRUE):
        numbers = ", ".join(f"{name} = {value:.6g}" for name, value in true.items())
        return (f"True: {numbers}. Written by tests/oracle/blind/fig8.py, seed {seed}.",)
    return (
        "Hidden: DiggingMemory, c_d = 0.1, L = 40 mm. True: k = 1.5 mm, phi = 30 deg, R = 0.34; motors and",
        "tachometers 1 % apart; the declared k is wrong on purpose. Written by tests/oracle/blind/fig8.py, seed 8.",
    )


def write(folder, seed=SEED, true=TRUE):
    """Drive the runs and write the log."""
    planned, gains = plan(seed, true)
    driven = drive([run for _, _, run in planned["runs"]], DURATION)
    logged = []
    for at, _ in enumerate(planned["runs"]):
        channels = {name: values[at] for name, values in driven.items()}
        random = np.random.default_rng([seed, 2, at])
        read = measured(channels, {}, gains["tacho"], random)
        logged.append({name: values[EVERY - 1 :: EVERY] for name, values in read.items()})
    write_set(folder, planned, logged, digits=5, sample_period=EVERY * 0.05)
    return driven


def number(text):
    """Return name and value from the text NAME=VALUE."""
    name, _, value = text.partition("=")
    return name, float(value)


def main():
    """Write the log, or a log with other true numbers if options state them."""
    reader = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    reader.add_argument("--out", type=Path, required=True)
    reader.add_argument("--seed", type=int, default=SEED)
    reader.add_argument("--true", type=number, action="append", default=[], metavar="NAME=VALUE", help="SI, repeatable")
    options = reader.parse_args()
    write(options.out.resolve(), options.seed, TRUE | dict(options.true))


if __name__ == "__main__":
    main()
