"""The effects that a simulated data set can hide, and the file that states the hidden effect and the true soil."""

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
"""Effects at the wheel contact that the choice "any" can hide, with sizes that are visible in a simulated data set."""
DRIVEN = ("SupplySag.R_b=3", "WeakMotor.wheel=0,g=0.3", "TetherDrag.f_0=2,f_1=0.5", *CONTACT)
"""Effects that the choice "any" can hide in a drive log: effects of motors, battery and tether, and the effects at the
wheel contact."""


@dataclass(frozen=True)
class DemoSet:
    """A simulated data set that was written: its files, and the truth, which none of these files contains."""

    files: tuple[Path, ...]
    truth: Mapping[str, Any]


def choose_hidden(word: str, choices: tuple[str, ...], random: np.random.Generator) -> str:
    """Return the effect to hide in a data set, in words that `effect_of` understands; an empty text for no effect.

    `word` is the user's choice: an effect, "nothing", or "any" for a random choice among `choices` and no effect.
    """
    if word in ("", NONE):
        return ""
    return str(random.choice(["", *choices])) if word == ANY else word


def contact_effect(word: str) -> Effect | None:
    """Return the effect that a text such as "SlipSinkage.n_1=0.7" describes; None for an empty text.

    The effect must act at the contact of a steadily rolling wheel, because a wheel rig or a table of slip against slope
    cannot show any other effect.

    Raises ParameterError if the effect or one of its numbers is unknown, or if the effect acts on motors, on the body
    or on sensors.
    """
    if not word:
        return None
    # `effect_of` builds effects for a model; any rover's model will do for an effect at the contact.
    soil, rover = Soil(), load_rover("nexus6")
    effect = effect_of(word, Model(rover, flat(), (soil,), Motor(), effects=base_effects(soil, rover, SoilTraction())))
    if not isinstance(effect, Effect) or effect.before_slip or effect.places:
        # An effect that changes the speeds (before_slip), or that lies at a certain place, shows in a drive only: on a
        # rig the slip is prescribed.
        name, allowed = type(effect).__name__, [entry.partition(".")[0] for entry in CONTACT]
        raise ParameterError(
            f"{name} does not act on a steadily rolling wheel: {closest(name, allowed)} A drive-log can hide it."
        )
    return effect


def keep_truth(folder: Path, hidden: AnyEffect | None, soil: Soil, details: Mapping[str, Any]) -> dict[str, Any]:
    """Write the truth of a simulated data set into a file next to the data set's folder, and return the truth as a
    dict.

    The truth is the hidden effect, the true soil and `details`. The file is never inside the folder, so that nobody
    reads it as a part of the data.

    This is the first file that is written, after all checks. Therefore this function also logs which files of an
    earlier data set will be replaced.
    """
    say_what_is_replaced(folder, tuple(SETS.values()))
    truth = {"hidden": NONE if hidden is None else word_of(hidden), **details, "soil": as_table(soil)}
    replace_file(truth_file(folder), toml_text(truth))
    return truth


def truth_file(folder: Path) -> Path:
    """Return the path of the file with the hidden effect and the true soil, next to the folder of the data set."""
    return folder.with_name(f"{folder.name}-truth.toml")
