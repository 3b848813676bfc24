"""Slip against slope of a rover, made up: three days on seven slopes, as publications print it."""

import math
from pathlib import Path

import numpy as np

from rover_pin.base.files.paths import named_from
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.demo.hidden import CONTACT, Made, choose_hidden, contact_effect, keep_truth
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.experiments.slip_slope import FILE, KIND, SlipSlope
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.defaults import own_soil
from rover_pin.simulation.model.effect_files import reading_traction

STEEPEST, COUNT, MAX_SLIP = 30.0, 7, 0.85
"""Slopes looked at [deg], how many of them are driven, and the slip up to which anybody drives."""
DAYS = ("day-1", "day-2", "day-3")
NOISE = 0.012
"""SD of one slip: of a minute's drive on prepared sand, assumed."""
PHI_SD, K_SD = math.radians(2.0), 0.25


def write(folder: Path, hidden: str, seed: int, rover: str = "nexus6") -> Made:
    """Write slope.toml and points.csv; return them and what was hidden. Slopes end where the rover slips too much.

    Raises ParameterError: something to hide that is unknown, or shows at no steady wheel.
    Raises DataError, UrdfError: it cannot be written there, or the rover cannot be read.
    """
    random, built = np.random.default_rng(seed), load_rover(rover)
    effect = contact_effect(choose_hidden(hidden, CONTACT, random))
    default_soil = own_soil(built).value
    soil = default_soil.replace(
        phi=default_soil.phi + random.normal(0.0, PHI_SD / 2), k=default_soil.k * math.exp(random.normal(0.0, K_SD / 2))
    )
    fine = np.radians(np.arange(0.0, STEEPEST, 0.1))
    bed = SlipSlope(built, soil, EARTH, ("all",), fine[None], np.zeros((1, 1, len(fine))), np.array([NOISE]))
    model = bed.base_model()
    resistance = next(candidate for candidate in model.effects if isinstance(candidate, MotionResistance))
    model = model if effect is None else model.having(reading_traction(effect, model.effects))
    slips = bed.predict([model])[0, 0, 0]
    driven = np.unique(np.linspace(0, max(np.flatnonzero(slips < MAX_SLIP), default=0), COUNT).round().astype(int))
    readings = np.clip(slips[driven] + random.normal(0.0, NOISE, (len(DAYS), len(driven))), -0.99, 0.99)
    rows = [
        f"{day},{math.degrees(slope):.1f},{slip:.4f},{NOISE:g}"
        for day, row in zip(DAYS, readings, strict=True)
        for slope, slip in zip(fine[driven], row, strict=True)
    ]
    constants = {"phi": (default_soil.phi, "rad", PHI_SD), "k": (default_soil.k, "m", K_SD * default_soil.k)}
    document = {
        "kind": KIND,
        "name": folder.name,
        "source": "made up by rover-pin demo; not measured",
        "rover": named_from(folder, rover),
        "gravity": EARTH,
        "soil": {name: {"value": float(v), "unit": unit, "sd": float(sd)} for name, (v, unit, sd) in constants.items()},
    }
    truth = keep_truth(folder, effect, soil, {"seed": seed, "R": float(resistance.R)})
    points = replace_file(folder / "points.csv", "\n".join(["run,slope_deg,slip,slip_sd", *rows]) + "\n")
    return Made((replace_file(folder / FILE, toml_text(document)), points), truth)
