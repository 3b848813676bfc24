"""Lists the choices of a user: scenarios, soils, rovers, effects, samples and settings.

The lists come from the code itself, so that a new scenario, soil or effect is listed without a change here.
"""

import inspect
import itertools
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_pin.base.arguments import arguments_of
from rover_pin.base.files.bounded import text
from rover_pin.base.files.paths import sample_folder, sample_names
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.settings import Setting, numbers_of
from rover_pin.contact import Soil
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect
from rover_pin.parameters import SOILS
from rover_pin.rover.description.layout import rover_folder
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import settings_of
from rover_pin.scenarios.scenes import SCENES
from rover_pin.simulation.model.effect_files import AnyEffect, offered_effects, package_effects

OWN_PACKAGE = "rover_pin"
"""Word in lists for a soil, effect or experiment that rover_pin itself contains, instead of another package's name."""
ACTS = {Effect: "contact", MotorEffect: "motor", BodyEffect: "body", SensorEffect: "sensor"}
"""Base class of an effect -> word for the part of the rover on which the effect acts. Lists of effects are in this
order."""


@dataclass(frozen=True)
class Entry:
    """One choice in a list, such as a soil: its name, one line of description, further facts, and its numbers."""

    name: str
    summary: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    numbers: tuple[Setting, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the entry as plain values that can be written to JSON."""
        return {
            "name": self.name,
            "about": self.summary,
            **self.facts,
            "numbers": [plain(number) for number in self.numbers],
        }


def plain(number: Setting) -> dict[str, Any]:
    """Return a numeric setting as plain values that can be written to JSON. Empty texts and infinite bounds are
    omitted.
    """
    table = {name: value for name, value in number._asdict().items() if value not in ("", ())}
    if number.choices:
        table["choices"] = tuple(number.choices)
    bounds = {name: table.pop(name) for name in ("low", "high")}
    return {**table, **{name: value for name, value in bounds.items() if math.isfinite(value)}}


def scenarios() -> list[Entry]:
    """Return the list of ready-made drives, each with the numbers of its terrain and with its settings that are not
    defaults.
    """
    entries = []
    for name, scene in SCENES.items():
        # A terrain of a file has no numbers before the file is known, so that only the arguments of its reader are
        # listed. Any other scene shows its settings that differ from the defaults, and all numbers of its terrain.
        if "path" in scene.terrain_settings:
            numbers = [
                Setting.of(f"terrain.{argument}", scene.terrain_settings.get(argument, 0.0), spec.quantity)
                for argument, spec in arguments_of(scene.terrain).items()
            ]
        else:
            all_settings = settings_of(name)
            changed = [setting for setting in all_settings if setting.name in scene.settings]
            numbers = [setting._replace(source="of this scenario") for setting in changed]
            numbers += [setting for setting in all_settings if setting.name.startswith("terrain.")]
        summary = scene.summary or first_sentence(scene.terrain)
        entries.append(Entry(name, summary, {"duration_s": scene.duration}, tuple(numbers)))
    return entries


def soils() -> list[Entry]:
    """Return the list of the soils of the package and of other installed packages, each with its numbers and their
    sources.
    """
    entries = []
    offered = SOILS.offered()
    for name, soil in SOILS.items():
        # The soil of Table 1 is the class Soil itself, whose docstring is about every soil.
        is_table_1 = type(soil) is Soil
        summary = "The paper's Table 1, completed where it is silent" if is_table_1 else first_sentence(type(soil))
        package = offered[name].source if name in offered else OWN_PACKAGE
        entries.append(Entry(name, summary, {"package": package}, numbers_of(soil)))
    return entries


def rovers() -> list[Entry]:
    """Return the list of the package's rovers, each with its mass, wheels and suspension."""
    entries = []
    for file in sorted(rover_folder().glob("*.toml")):
        rover = load_rover(file.stem)
        facts = {
            "wheels": len(rover.wheels),
            "steered": sum(wheel.steer_dof is not None for wheel in rover.wheels),
            "mass_kg": round(rover.mass, 6),
            "suspension": [angle for angle in rover.angles if not angle.startswith("steer_")],
            "file": str(file),
        }
        summary = f"{len(rover.wheels)} wheels of r = {1e3 * float(rover.wheel.r):g} mm, {rover.mass:.3g} kg"
        entries.append(Entry(file.stem, summary, facts, numbers_of(rover.wheel)))
    return entries


def effects() -> list[Entry]:
    """Return the list of the effects of the package and of other installed packages, sorted by the part of the rover on
    which they act, then by name.
    """
    entries, offered = [], offered_effects()
    places = list(ACTS.values())
    for kind in sorted((*package_effects(), *offered), key=lambda kind: (places.index(_acts(kind)), kind.__name__)):
        facts = {
            "title": kind.title,
            "meaning": kind.meaning,
            "acts": _acts(kind),
            "equation": _equation(kind),
            "vanishes_at": dict(kind.neutral),
            "package": offered[kind].source if kind in offered else OWN_PACKAGE,
        }
        # Each effect of the package is described by its file; another package may have several effects in one file.
        described = kind if kind in offered else sys.modules[kind.__module__]
        entries.append(Entry(kind.__name__, first_sentence(described), facts, numbers_of(kind())))
    return entries


def _equation(kind: type[AnyEffect]) -> str:
    """Return the equation of an effect: the first indented lines of the docstring of its class; empty without such
    lines.
    """
    lines = iter((inspect.getdoc(kind) or "").split("\n"))
    block = itertools.takewhile(
        lambda line: line.startswith("    "), itertools.dropwhile(lambda line: not line.startswith("    "), lines)
    )
    return re.sub(r"\s+", " ", " ".join(block)).strip(" .,")


def _acts(kind: type[AnyEffect]) -> str:
    """Return the word for the part of the rover on which an effect acts (see ACTS)."""
    return next(word for base, word in ACTS.items() if issubclass(kind, base))


def samples() -> list[Entry]:
    """Return the list of the measured data sets that come with the package, each with its source."""
    entries = []
    for name in sample_names():
        folder = sample_folder() / name
        file = next(folder.glob("*.toml"))
        summary = text(file).split("\n")[0].removeprefix("#").strip()  # a comment that describes the sample
        entries.append(Entry(name, summary, {"source": str(read_toml(file)["source"]), "folder": str(folder)}))
    return entries


def settings(scenario: str = "ditch", **overrides: Any) -> list[Setting]:
    """Return every setting of a scenario with its default, sorted by the number of dots in its name and then by name.

    Parameters
    ----------
    scenario : str
        Name of a ready-made drive.
    **overrides
        Settings of the drive. Defaults that depend on these settings, such as the numbers of another soil, follow them.

    Raises
    ------
    ParameterError
        The scenario or a setting is unknown.
    """
    return sorted(settings_of(scenario, **overrides), key=lambda setting: (setting.name.count("."), setting.name))


def first_line(thing: Any) -> str:
    """Return the first line of the docstring of a module, class or function, without its full stop."""
    return (inspect.getdoc(thing) or "").split("\n")[0].removesuffix(".")


def first_sentence(thing: Any) -> str:
    """Return the first line of the docstring of a module, class or function, as a description for a list.

    If this line ends within a sentence, the description is the whole first sentence of the docstring instead. The full
    stop and a leading 'Return' are removed, and the first letter becomes a capital letter.
    """
    paragraph = (inspect.getdoc(thing) or "").split("\n\n")[0]
    ends_here = paragraph.split("\n")[0].endswith(".")
    sentence = first_line(thing) if ends_here else re.split(r"\.(?:\s|$)", " ".join(paragraph.split()))[0]
    sentence = sentence.removeprefix("Return ")
    return sentence[:1].upper() + sentence[1:]
