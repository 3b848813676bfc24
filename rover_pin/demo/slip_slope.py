"""A simulated table of a rover's slip against slope, as publications print it: seven slopes on each of three days."""

import math
from pathlib import Path

import numpy as np

from rover_pin.base.files.paths import named_from
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.demo.hidden import CONTACT, DemoSet, choose_hidden, contact_effect, keep_truth
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.experiments.slip_slope import FILE, KIND, SlipSlope
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.defaults import own_soil
from rover_pin.simulation.model.effect_files import reading_traction

MAX_SLOPE_DEG, SLOPES, MAX_SLIP = 30.0, 7, 0.85
"""Steepest slope that is considered [deg], number of driven slopes, and maximum slip on a driven slope [-]. A slope
with more slip is not driven, because the rover would hardly move there, and nobody would measure on it."""
DAYS = ("day-1", "day-2", "day-3")
NOISE = 0.012
"""Standard deviation of one measured slip [-], assumed for a drive of one minute on prepared sand."""
PHI_SD, K_SD = math.radians(2.0), 0.25
"""Standard deviations that the table states for its soil. PHI_SD holds for the friction angle phi [rad], and K_SD for
the shear displacement k, as a fraction of k [-]."""


def write(folder: Path, hidden: str, seed: int, rover: str = "nexus6") -> DemoSet:
    """Simulate a table of slip against slope, and write slope.toml and points.csv into `folder`.

    `hidden` is the effect to hide, in words such as "SlipSinkage.n_1=0.7", or "any" for a random choice, or "nothing".
    `seed` determines the noise, the true soil and the random choice. `rover` is the name of a rover or the path of its
    URDF file.

    Raises ParameterError if the effect is unknown or does not act on a steadily rolling wheel.
    Raises DataError or UrdfError if the folder cannot be written to or the rover cannot be read.
    """
    random, built = np.random.default_rng(seed), load_rover(rover)
    effect = contact_effect(choose_hidden(hidden, CONTACT, random))
    declared = own_soil(built).value
    # The true soil differs from the stated soil by the errors of soil tests.
    soil = declared.replace(
        phi=declared.phi + random.normal(0.0, PHI_SD / 2), k=declared.k * math.exp(random.normal(0.0, K_SD / 2))
    )
    # Slips on a fine grid of slopes show where the rover slips too much. The driven slopes are chosen below this limit.
    fine = np.radians(np.arange(0.0, MAX_SLOPE_DEG, 0.1))
    table = SlipSlope(built, soil, EARTH, ("all",), fine[None], np.zeros((1, 1, len(fine))), np.array([NOISE]))
    model = table.base_model()
    resistance = next(candidate for candidate in model.effects if isinstance(candidate, MotionResistance))
    model = model if effect is None else model.having(reading_traction(effect, model.effects))
    slips = table.predict([model])[0, 0, 0]
    driven = np.unique(np.linspace(0, max(np.flatnonzero(slips < MAX_SLIP), default=0), SLOPES).round().astype(int))
    # A measured slip lies between -1 and 1; the noise must not lead outside.
    readings = np.clip(slips[driven] + random.normal(0.0, NOISE, (len(DAYS), len(driven))), -0.99, 0.99)
    rows = [
        f"{day},{math.degrees(slope):.1f},{slip:.4f},{NOISE:g}"
        for day, row in zip(DAYS, readings, strict=True)
        for slope, slip in zip(fine[driven], row, strict=True)
    ]
    constants = {"phi": (declared.phi, "rad", PHI_SD), "k": (declared.k, "m", K_SD * declared.k)}
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
    return DemoSet((replace_file(folder / FILE, toml_text(document)), points), truth)
