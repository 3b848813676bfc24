"""What a made-up data set hides: an effect by its word, or one that chance chooses, and where the truth is kept."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.results_folder import say_what_is_replaced
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import as_table
from rover_pin.contact import Soil
from rover_pin.demo import SETS
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.model.effect_files import AnyEffect
from rover_pin.simulation.model.effect_words import effect_of, word_of
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat

ANY, NONE = "any", "nothing"
CONTACT = ("SlipSinkage.n_1=0.7", "ExitAngle.e_1=0.4", "PostPeak.fraction=0.4")
"""What chance may hide in a wheel's contact, at sizes that such sets show."""
DRIVEN = ("SupplySag.R_b=3", "WeakMotor.wheel=0,g=0.3", "TetherDrag.f_0=2,f_1=0.5", *CONTACT)
"""What it may hide in a drive besides."""


@dataclass(frozen=True)
class Made:
    """A set that was written: its files, and the truth, which is in none of them."""

    files: tuple[Path, ...]
    truth: Mapping[str, Any]


def choose_hidden(word: str, among: tuple[str, ...], random: np.random.Generator) -> str:
    """Return the word of what is hidden: as given, one of `among` or nothing for "any"; empty for nothing."""
    if word in ("", NONE):
        return ""
    return str(random.choice(["", *among])) if word == ANY else word


def contact_effect(word: str) -> Effect | None:
    """Return the effect of a word that acts at a steady wheel's contact.

    Raises ParameterError: an unknown effect or number, or one that acts elsewhere: in motors, on the body, on sensors.
    """
    if not word:
        return None
    soil, rover = Soil(), load_rover("nexus6")
    effect = effect_of(word, Model(rover, flat(), (soil,), Motor(), effects=base_effects(soil, rover, SoilTraction())))
    if not isinstance(effect, Effect) or effect.before_slip or effect.places:
        name, allowed = type(effect).__name__, [entry.partition(".")[0] for entry in CONTACT]
        raise ParameterError(f"{name} shows in no steady wheel: {closest(name, allowed)} Or hide it in a drive-log.")
    return effect


def keep_truth(folder: Path, hidden: AnyEffect | None, soil: Soil, details: Mapping[str, Any]) -> dict[str, Any]:
    """Write the truth beside the folder of a set, never in it; return it. It is the first that is written.

    Nothing is left then that could refuse the set, so that what it replaces is said here.
    """
    say_what_is_replaced(folder, tuple(SETS.values()))
    truth = {"hidden": NONE if hidden is None else word_of(hidden), **details, "soil": as_table(soil)}
    replace_file(truth_file(folder), toml_text(truth))
    return truth


def truth_file(folder: Path) -> Path:
    """Return the file beside a set's folder that says what was hidden."""
    return folder.with_name(f"{folder.name}-truth.toml")
