"""What there is to choose from: scenarios, soils, rovers, effects, settings; found by looking, never listed by hand."""

import inspect
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_pin.base.arguments import arguments_of
from rover_pin.base.files.bounded import text
from rover_pin.base.files.samples import sample_folder, sample_names
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.settings import Setting, numbers_of
from rover_pin.contact import Soil
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect
from rover_pin.parameters import SOILS
from rover_pin.rover.description.layout import rover_folder
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import settings_of
from rover_pin.scenarios.scenes import SCENES, Scene
from rover_pin.simulation.model.effect_files import AnyEffect, package_effects

ACTS = {Effect: "contact", MotorEffect: "motor", BodyEffect: "body", SensorEffect: "sensor"}


@dataclass(frozen=True)
class Entry:
    """One thing to choose: its name, what it is in one line, further facts, and its numbers."""

    name: str
    summary: str
    facts: Mapping[str, Any] = field(default_factory=dict)
    numbers: tuple[Setting, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, as JSON has them; a bound that is not there is None."""
        return {
            "name": self.name,
            "about": self.summary,
            **self.facts,
            "numbers": [plain(number) for number in self.numbers],
        }


def plain(number: Setting) -> dict[str, Any]:
    """Return a number as plain values; what it has not is left out."""
    table = {name: value for name, value in number._asdict().items() if value not in ("", ())}
    bounds = {name: table.pop(name) for name in ("low", "high")}
    return {**table, **{name: value for name, value in bounds.items() if math.isfinite(value)}}


def scenarios() -> list[Entry]:
    """Return the ready-made drives: ground and duration, the ground's numbers, and what they set that others leave."""
    return [
        Entry(
            name, scene.summary or first_sentence(scene.terrain), {"duration_s": scene.duration}, _of_scene(name, scene)
        )
        for name, scene in SCENES.items()
    ]


def _of_scene(name: str, scene: Scene) -> tuple[Setting, ...]:
    if "path" in scene.terrain_settings:
        arguments = arguments_of(scene.terrain).items()
        return tuple(
            Setting.of(f"terrain.{name}", scene.terrain_settings.get(name, 0.0), argument.quantity)
            for name, argument in arguments
        )
    all_settings = settings_of(name)
    scene_settings = (
        setting._replace(source="of this scenario") for setting in all_settings if setting.name in scene.settings
    )
    return (*scene_settings, *(setting for setting in all_settings if setting.name.startswith("terrain.")))


def soils() -> list[Entry]:
    """Return the parameter sets, each number with its source."""
    return [Entry(name, _soil_summary(soil), {}, numbers_of(soil)) for name, soil in SOILS.items()]


def _soil_summary(soil: Soil) -> str:
    return "The paper's Table 1, completed where it is silent" if type(soil) is Soil else first_sentence(type(soil))


def rovers() -> list[Entry]:
    """Return the rovers that come along."""
    return [_rover(file.stem) for file in sorted(rover_folder().glob("*.toml"))]


def _rover(name: str) -> Entry:
    rover = load_rover(name)
    steered = sum(wheel.steer_dof is not None for wheel in rover.wheels)
    joints = [angle for angle in rover.angles if not angle.startswith("steer_")]
    facts = {"wheels": len(rover.wheels), "steered": steered, "mass_kg": round(rover.mass, 6), "suspension": joints}
    summary = f"{len(rover.wheels)} wheels of r = {1e3 * float(rover.wheel.r):g} mm, {rover.mass:.3g} kg"
    return Entry(name, summary, {**facts, "file": str(rover_folder() / f"{name}.toml")}, numbers_of(rover.wheel))


def effects() -> list[Entry]:
    """Return the effects of the package, by where they act."""
    kinds = sorted(package_effects(), key=lambda kind: (list(ACTS.values()).index(_acts(kind)), kind.__name__))
    return [_effect(kind) for kind in kinds]


def _effect(kind: type[AnyEffect]) -> Entry:
    summary = first_sentence(sys.modules[kind.__module__])
    named = {"title": kind.title, "meaning": kind.meaning}
    facts = {**named, "acts": _acts(kind), "equation": first_line(kind), "vanishes_at": dict(kind.neutral)}
    return Entry(kind.__name__, summary, facts, numbers_of(kind()))


def _acts(kind: type[AnyEffect]) -> str:
    return next(word for base, word in ACTS.items() if issubclass(kind, base))


def samples() -> list[Entry]:
    """Return the measured data that come along, each with where it is from."""
    return [_sample(name) for name in sample_names()]


def _sample(name: str) -> Entry:
    folder = sample_folder() / name
    file = next(folder.glob("*.toml"))
    summary = text(file).split("\n")[0].removeprefix("#").strip()
    return Entry(name, summary, {"source": str(read_toml(file)["source"]), "folder": str(folder)})


def settings(scenario: str = "ditch", **overrides: Any) -> list[Setting]:
    """Return everything that can be set of a scenario, as driven with what is given, with its default.

    Raises ParameterError: an unknown scenario or setting.
    """
    return sorted(settings_of(scenario, **overrides), key=lambda setting: (setting.name.count("."), setting.name))


def first_line(thing: Any) -> str:
    """Return the first line of a docstring, without its full stop."""
    return (inspect.getdoc(thing) or "").split("\n")[0].removesuffix(".")


def first_sentence(thing: Any) -> str:
    """Return a docstring's first line as said of a thing: without its full stop and a leading 'Return'."""
    sentence = first_line(thing).removeprefix("Return ")
    return sentence[:1].upper() + sentence[1:]
