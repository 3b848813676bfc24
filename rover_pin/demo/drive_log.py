"""A drive log, made up: six runs over waves and a slope, both ways, at duties that vary, read by sensors."""

import dataclasses
import math
from pathlib import Path

import numpy as np

from rover_pin.base.files.paths import named_from
from rover_pin.base.quantity import as_table
from rover_pin.contact import Soil
from rover_pin.demo.hidden import DRIVEN, Made, choose_hidden, keep_truth
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.parameters import TABLE_1
from rover_pin.parameters.hard import HARD_GROUND
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.defaults import (
    has_papers_wheel,
    own_motor,
    own_soil,
    pace,
    scale,
    usual_angles,
    usual_slip,
)
from rover_pin.simulation.model.effect_files import AnyEffect
from rover_pin.simulation.model.effect_words import effect_of
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.simulate import Progress, simulate
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import Lanes
from rover_pin.terrain.toml_table import write_terrain

RUNS, SECONDS = 6, 16.0
"""Runs, of which the last two repeat the first two; seconds of each for Nexus 6, longer for a slower rover."""
K, K_SD, PHI_SD = 0.005, 0.2, math.radians(1.5)
"""Shear displacement of the declared sand for Nexus 6's wheels [m]; SDs of its bench tests."""
DRIFT = 5e-4
"""How far the tracker's zero of x and y wanders in a second, growing with the root of time [m]."""
MOTORS_APART, TACHOS_APART = 0.01, 0.005
"""SDs of one motor's torque and of one tachogenerator's gain against the others'."""


def write(folder: Path, hidden: str, seed: int, rover: str = "nexus6", progress: Progress | None = None) -> Made:
    """Write drive.toml, its ground and a CSV a run; return them and what was hidden.

    Raises ParameterError: something to hide that is unknown, or that this rover cannot have.
    Raises DataError, UrdfError, SimulationError: it cannot be written there, the rover cannot be read, or does not
    drive.
    """
    random, model = np.random.default_rng(seed), declared_model(rover)
    true, effect = hidden_model(model, hidden, random)
    size, seconds = scale(model.rover), SECONDS * pace(model.rover, model.motor)
    traces, plans = {}, [_plan(random, seconds, len(model.rover.wheels)) for _ in range(RUNS - 2)]
    for run, plan in enumerate([*plans, *plans[:2]]):
        start = Start(-0.6 * size, 0.0, 0.0) if run % 2 == 0 else Start(0.7 * size, 0.0, math.pi)
        driven = simulate(true, plan, seconds, start, measure_error=False)
        log = _drifting(measure(driven, Sensors(), int(random.integers(2**31)), true.sensor_effects), random)
        traces[f"run-{run + 1}"] = dataclasses.replace(log, attrs={"start": dataclasses.asdict(start)})
        if progress is not None:
            progress(run + 1.0)
    truth = keep_truth(folder, effect, true.soils[0], {"seed": seed})
    metadata = LogMetadata(
        folder.name,
        "made up by rover-pin demo; not measured",
        named_from(folder, rover),
        wheels=tuple(wheel.name for wheel in model.rover.wheels),
        terrain=write_terrain(folder, model.terrain),
        soil=_known_constants(model.soils[0]),
        motor=as_table(model.motor),
    )
    write_drive_log(folder, traces, metadata)
    return Made((folder / "drive.toml", *(folder / f"{name}.csv" for name in traces)), truth)


def hidden_model(model: Model, hidden: str, random: np.random.Generator) -> tuple[Model, AnyEffect | None]:
    """Return the model that drives in place of the declared one, and the effect that it hides."""
    word, soil = choose_hidden(hidden, DRIVEN, random), model.soils[0]
    effect = effect_of(word, model) if word else None
    soil = soil.replace(
        phi=soil.phi + random.normal(0.0, PHI_SD / 2), k=soil.k * math.exp(random.normal(0.0, K_SD / 2))
    )
    true = _apart(model.replace(soils=(soil, *model.soils[1:])), random)
    return (true if effect is None else true.having(effect)), effect


def declared_model(rover: str) -> Model:
    """Return the model as the log declares it: waves, then a slope of 5 deg, sized by the rover's wheels."""
    built = load_rover(rover)
    size = scale(built)
    soil = TABLE_1.replace(k=K) if has_papers_wheel(built) else own_soil(built).value
    x = size * np.arange(-1.8, 1.81, 0.06)
    z = 0.012 * size * np.sin(2 * np.pi * x / (0.8 * size))
    z += np.where(x > 0.2 * size, (x - 0.2 * size) * math.tan(math.radians(5)), 0.0)
    effects = base_effects(soil, built, SoilTraction(TorqueTraction(), usual_angles(built)))
    ground = Lanes((Profile(x, z),), ())
    return Model(
        built,
        ground,
        (soil, HARD_GROUND),
        own_motor(built).value,
        usual_slip(built),
        effects,
        body_effects=built.springs,
    )


def _apart(model: Model, random: np.random.Generator) -> Model:
    """Return the model with motors and tachogenerators that are not quite alike, as none are."""
    for number, wheel in enumerate(model.rover.wheels):
        model = model.having(WeakMotor(g=random.normal(0.0, MOTORS_APART), wheel=number))
        model = model.having(TachoScale(e=random.normal(0.0, TACHOS_APART), wheel=wheel.name))
    return model


def _drifting(log: Trace, random: np.random.Generator) -> Trace:
    """Return the log with a tracker whose zero wanders."""
    steps = np.sqrt(np.diff(log.t, prepend=log.t[0]))
    drifted = {
        axis: log[axis] + np.cumsum(DRIFT * steps * random.normal(size=len(steps))) for axis in ("body_x", "body_y")
    }
    return dataclasses.replace(log, channels={**log.channels, **drifted})


def _known_constants(soil: Soil) -> dict[str, dict[str, object]]:
    """Return the declared constants with their SDs."""
    table = as_table(soil)
    sds = {"phi": PHI_SD, "k": K_SD * float(soil.k), "k_1": K_SD * float(soil.k_1)}
    return {name: {**table[name], "sd": sd} for name, sd in sds.items()}


def _plan(random: np.random.Generator, seconds: float, wheels: int) -> Controller:
    """Return duties held for a while each, wheels apart from each other."""
    holds, t = [], 0.0
    while t < seconds:
        holds.append((t, random.uniform(0.4, 0.85) + random.uniform(-0.09, 0.09, wheels)))
        t += seconds * random.uniform(0.1, 0.2)
    return lambda reading: next(duty for start, duty in reversed(holds) if start <= reading.t + 1e-9)
