"""Simulated tests of a wheel on a rig: three repeats of eight slips at two wheel loads, with sensor noise."""

import math
from pathlib import Path

import numpy as np

from rover_pin.base.files.table import columns_text
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import as_table
from rover_pin.contact import Soil, Wheel
from rover_pin.demo.hidden import CONTACT, DemoSet, choose_hidden, contact_effect, keep_truth
from rover_pin.experiments.wheel_rig.model import NOMINAL, RigModel, conditions
from rover_pin.measurements.foreign_rig import channel_unit
from rover_pin.simulation.model.effect_files import reading_traction

WHEEL = Wheel(r=0.08, b=0.07)
"""The tested wheel, of the size of the wheels of a small rover."""
SOIL = Soil(c=150.0, phi=math.radians(32.0), k=0.010, k_1=70e3, k_2=0.0, n=1.0)
"""Dry sand as the data set states it. The numbers of the true sand differ from these by the errors of soil tests."""
LOADS, SLIPS, REPEATS = (30.0, 45.0), (-0.2, 0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8), 3
"""Wheel loads [N] and slips [-] of the simulated tests, and the number of runs for each combination of load and
slip."""
NOISE = {"drawbar_pull_N": 0.3, "torque_Nm": 0.03, "sinkage_m": 0.0006}
"""Column of the table -> standard deviation of its noise in a single run, similar to the scatter between repeats in
published rig data."""


def write(folder: Path, hidden: str, seed: int) -> DemoSet:
    """Simulate tests on a wheel rig, and write rig.toml and points.csv into `folder`.

    `hidden` is the effect to hide, in words such as "SlipSinkage.n_1=0.7", or "any" for a random choice, or "nothing".
    `seed` determines the noise, the true soil and the random choice.

    Raises ParameterError if the effect is unknown or does not act on a steadily rolling wheel.
    Raises DataError if the folder cannot be written to.
    """
    random = np.random.default_rng(seed)
    effect = contact_effect(choose_hidden(hidden, CONTACT, random))
    soil = SOIL.replace(
        phi=SOIL.phi + math.radians(random.normal(0.0, 1.0)),
        k=SOIL.k * math.exp(random.normal(0.0, 0.15)),
        k_1=SOIL.k_1 * math.exp(random.normal(0.0, 0.15)),
    )
    # The true model: the true sand, and the hidden effect.
    model = RigModel(WHEEL, soil)
    model = model if effect is None else model.having(reading_traction(effect, model.effects))
    # One row for each combination of load and slip and for each repeat.
    load, slip, repeat = (grid.ravel() for grid in np.meshgrid(LOADS, SLIPS, np.arange(REPEATS), indexing="ij"))
    speeds = conditions(load, slip)[:, 2:4]
    prediction = model.predict(load, slip, speeds)
    true = {"drawbar_pull_N": prediction.drawbar_pull, "torque_Nm": prediction.torque, "sinkage_m": prediction.sinkage}
    # The repeats of a combination have one level number, by which the loop estimates their scatter.
    level = np.repeat(np.arange(1.0, 1.0 + len(load) // REPEATS), REPEATS)
    table = {"level": level, "repeat": repeat + 1.0, "slip": slip, "load_N": load}
    table |= {"travel_speed_mps": speeds[:, 0], "rim_speed_mps": speeds[:, 1]}
    table |= {name: np.round(values + random.normal(0.0, NOISE[name], len(values)), 6) for name, values in true.items()}
    # The file states the noise by channel, without the unit in the column's name.
    noise = {column.rpartition("_")[0]: sd for column, sd in NOISE.items()}
    document = {
        "kind": "wheel-rig",
        "name": folder.name,
        "source": "made up by rover-pin demo; not measured",
        "files": {"points": "points.csv"},
        "wheel": as_table(WHEEL),
        "soil": {name: as_table(SOIL)[name] for name in ("c", "phi", "k", "k_1", "k_2", "n")},
        "noise": {name: {"value": sd, "unit": channel_unit(name)} for name, sd in noise.items()},
    }
    truth = keep_truth(folder, effect, soil, {"seed": seed, "speed_mps": NOMINAL})
    points = replace_file(folder / "points.csv", columns_text(table))
    return DemoSet((replace_file(folder / "rig.toml", toml_text(document)), points), truth)
