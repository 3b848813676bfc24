"""What a drive model may lack: every known effect at every wheel, channel or place, and priors that may be wrong."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import SPACING, Candidate, plain_candidate, released_candidate
from rover_pin.effects.bent_ground import KNOTS, BentGround
from rover_pin.effects.effect import MotorEffect
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.estimation.experiment import find
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.parameters import owner_name, owners
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import corners
from rover_pin.simulation.model.defaults import NEXUS6_MASS, has_papers_wheel, scale
from rover_pin.simulation.model.effect_files import AnyEffect, known_effects, reading_traction
from rover_pin.simulation.model.model import Model

BIASED = ("body_roll", "body_pitch", "rocker_", "bogie_", "current_", "gyro_", "accelerometer_")
"""Channels whose zero may be wrong; those of rates are the tachogenerators' gains."""
SHORTEST = 0.2
"""Way along x from which a bend is identified [m]: the rover's own length smooths what is shorter (assumed)."""
MOST_PLACES = 60
"""Places at which a patch is tried, of those where more than one run has been."""
SMOOTHING = (".x_0", ".y_0", ".v_0", ".w_s", ".theta_c", ".relaxation")
"""Quantities that round a law off at standstill, or say where a run began: no data tell them, so they stay."""


def candidates(
    model: Model, experiment: DriveExperiment, free: Sequence[Parameter], effects_path: str | Path | None
) -> tuple[Candidate, ...]:
    """Return everything that the model may lack and its rover can have, for the channels and places of these runs.

    Parameters
    ----------
    free : sequence of Parameter
        The uncertain numbers; of effects those are candidates too, freed from their priors, that are declared, or
        neutral beforehand: of what is assumed to be something, nothing is missing where it is something else.
    effects_path : path or None
        A user's effect file or folder.
    """
    unknown = {owner_name(effect) for effect in model.sensor_effects if not effect.neutral}
    excluded_owners = {"soil", "motor"} | unknown
    own_numbers = [number for number in free if number.prior and number.name.rpartition(".")[0] not in excluded_owners]
    loosened = [
        released_candidate(number, owners(model))
        for number in own_numbers
        if number.declared or _is_neutral(number, model)
    ]
    present = {owner_name(effect) for effect in model.all_effects}
    present_kinds = {type(effect).__name__ for effect in model.contact_effects}
    added = [
        candidate_of(effect)
        for kind in known_effects(effects_path)
        if kind.neutral and kind.__name__ not in present_kinds
        for effect in variants(kind, model, experiment)
        if owner_name(effect) not in present and not model.refusal(effect) and shows(effect, experiment)
    ]
    return (*loosened, *added)


def _is_neutral(number: Parameter, model: Model) -> bool:
    """Return whether a number is beforehand what it is where its effect does nothing."""
    record, quantity, _ = find(owners(model), number.name)
    return bool(record.neutral.get(quantity) == number.origin)


def shows(effect: AnyEffect, experiment: DriveExperiment) -> bool:
    """Return whether an effect can show in such logs.

    Wheels held to their rates hide what acts in the motors; where each run tells its own ground, no tilt or bend of all
    shows.
    """
    own_ground = any(run.commands.terrain is not None for run in experiment.runs)
    in_motor = experiment.rate_driven and isinstance(effect, MotorEffect)
    return not in_motor and not (own_ground and type(effect) in (GravityTilt, BentGround))


def candidate_of(effect: AnyEffect) -> Candidate:
    """Return an effect as a candidate: its class, and its wheel, joint or channel, or where on the way it begins.

    A bent ground has a place, all of the way, and need not be sought.
    """
    plain = plain_candidate(effect, owner_name(effect))
    plain = dataclasses.replace(plain, shapes=tuple(name for name in plain.shapes if not name.endswith(SMOOTHING)))
    if isinstance(effect, BentGround):
        return dataclasses.replace(plain, shapes=())
    if "x_from" not in effect.places:
        return plain
    return dataclasses.replace(plain, place=f"{float(effect.values()['x_from']):.3f}", place_searched=True)


def scale_effect(effect: Any, rover: Rover, gravity: float) -> Any:
    """Return an effect whose forces, torques and masses, assumed for Nexus 6, are in proportion for another rover.

    A force goes with the weight, a torque with weight times wheel radius. Tried at its size for a rover of 6 kg, a
    cable behind one of 60 kg moved nothing and was never looked at.
    """
    if has_papers_wheel(rover):
        return effect
    mass, length = rover.mass / NEXUS6_MASS, scale(rover)
    weight = mass * abs(gravity) / EARTH
    ratios = {"kg": mass, "N": weight, "N/m": weight / length, "rad/(N m)": 1.0 / (weight * length)}
    ratios |= dict.fromkeys(("N m", "N m s", "N m/rad", "N m s/rad"), weight * length)
    specs, values = quantities(effect), effect.values()
    larger = {name: ratios[specs[name].unit] * values[name] for name in effect.neutral if specs[name].unit in ratios}
    return effect.replace(**{name: min(max(v, specs[name].low), specs[name].high) for name, v in larger.items()})


def variants(kind: type[AnyEffect], model: Model, experiment: DriveExperiment) -> Iterable[AnyEffect]:
    """Return the effect at its default size, once for every wheel, channel or place where it may be."""
    effect: Any = scale_effect(reading_traction(kind(), model.effects), model.rover, model.gravity)
    fields = {field.name: field for field in dataclasses.fields(effect)}
    if isinstance(effect, SensorBias):
        names = [name for name in experiment.channels if name.startswith(BIASED)]
        return [effect.replace(channel=name) for name in names]
    if "wheel" in fields:
        wheels = [wheel.name for wheel in model.rover.wheels]
        owners_of: Sequence[Any] = range(len(wheels)) if isinstance(effect.wheel, int) else ["", *wheels]
        return [effect.replace(wheel=wheel) for wheel in owners_of]
    if isinstance(effect, BentGround):
        return _along_the_way(effect, experiment, float(np.abs(corners(model.rover)[..., 0]).max()))
    if "x_from" in effect.places:
        return [effect.replace(x_from=x) for x in _places(experiment, float(effect.length))]
    return [effect]


def _along_the_way(effect: BentGround, experiment: DriveExperiment, ahead: float) -> list[BentGround]:
    """Return a bent ground with knots along all that wheels passed, to `ahead` of the body [m]; none without a way."""
    low, high = _reach_of(experiment)
    begin, spacing = low - ahead, (high - low + 2 * ahead) / (KNOTS - 1)
    return [effect.replace(x_from=begin - spacing, length=(KNOTS + 1) * spacing)] if high - low > SHORTEST else []


def _reach_of(experiment: DriveExperiment) -> tuple[float, float]:
    """Return the least and the greatest x [m] where any run was."""
    xs = np.concatenate([run.commands.place[:, 0] for run in experiment.runs])
    return float(np.nanmin(xs)), float(np.nanmax(xs))


def _places(experiment: DriveExperiment, length: float) -> list[float]:
    """Return where a patch may begin: all along the ground that the runs have driven.

    Where that is too long, only on what more than one run has passed: a patch that one run met is that run's ground.
    """
    low, high = _reach_of(experiment)
    low, high = low - 0.1, high + 0.1
    count = math.ceil((high - low) / SPACING)
    places = range(count) if count <= MOST_PLACES else _passed_twice(experiment, low, count)
    return [low + SPACING * at - length / 4 for at in places]


def _passed_twice(experiment: DriveExperiment, low: float, count: int) -> list[int]:
    """Return at most MOST_PLACES of the places that more than one run has passed."""
    passed = np.zeros(count, dtype=int)
    for run in experiment.runs:
        x = run.commands.place[:, 0]
        at = np.unique(np.floor((x[np.isfinite(x)] - low) / SPACING).astype(int))
        passed[at] += 1
    shared = np.flatnonzero(passed > 1)
    return [int(at) for at in shared[:: max(1, math.ceil(len(shared) / MOST_PLACES))]]
