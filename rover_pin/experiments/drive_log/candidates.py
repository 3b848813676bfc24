"""List the candidates for a missing effect of a drive model: each known effect at each wheel, channel or place.

An effect that the model already has can be a candidate too: the size of this effect is then fitted without its prior.
"""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import PLACE_SPACING, Candidate, plain_candidate, released_candidate
from rover_pin.effects.bent_ground import KNOTS, BentGround
from rover_pin.effects.effect import MotorEffect
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.estimation.experiment import find
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.model import owner_name, owners
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import corners
from rover_pin.simulation.model.defaults import NEXUS6_MASS, has_papers_wheel, scale
from rover_pin.simulation.model.effect_files import AnyEffect, reading_traction
from rover_pin.simulation.model.model import Model

BIASED = ("body_roll", "body_pitch", "rocker_", "bogie_", "current_", "gyro_", "accelerometer_")
"""Channels (or beginnings of channel names) whose sensor may have a wrong zero. Wheel rates are not among them: their
sensors, tachogenerators, may only have a wrong gain."""
MIN_DISTANCE = 0.2
"""A bent ground is a candidate only if the runs of a log extend along x by more than this distance [m]. The length of
the rover smooths bends over shorter distances (assumed)."""
MAX_PLACES = 60
"""Maximum number of places along the runs at which a patch of different ground is tried as a candidate."""
SMOOTHING = (".x_0", ".y_0", ".v_0", ".w_s", ".theta_c", ".relaxation")
"""Endings of the names of quantities that are never fitted. These quantities smooth a law at standstill or hold the
start of a run, so that no data determine them."""


def candidates(
    model: Model, experiment: DriveExperiment, free: Sequence[Parameter], kinds: Iterable[type[AnyEffect]]
) -> tuple[Candidate, ...]:
    """Return the candidates for a missing effect of a drive model, for the channels and places of the runs in a log.

    An effect is a candidate if the model does not have it, if it can act on this rover, and if it can change the
    channels of the log. A number of an effect that the model already has is a candidate too, and is then fitted without
    its prior, if the user declared the number or if its value is neutral (the effect then does nothing). A number that
    is only assumed is no candidate, because a different value of an assumed number is not a missing effect.

    Parameters
    ----------
    model : Model
        The model; effects may be added to it.
    experiment : DriveExperiment
        The runs of the log as an experiment.
    free : sequence of Parameter
        The uncertain numbers of the model (`nuisances`).
    kinds : classes of effects
        Classes of all known effects, including the user's effects (`known_effects`).
    """
    # Soil, motor and effects without a neutral value belong to every model, so their numbers are no missing effects.
    unknown = {owner_name(effect) for effect in model.sensor_effects if not effect.neutral}
    excluded_owners = {"soil", "motor"} | unknown
    loosened = []
    for number in free:
        if number.prior and number.name.rpartition(".")[0] not in excluded_owners:
            record, quantity, _ = find(owners(model), number.name)
            if number.declared or record.neutral.get(quantity) == number.origin:
                loosened.append(released_candidate(number, owners(model)))
    # Contact effects of the model's own classes are left out, all others only at the same wheel, channel or place.
    present = {owner_name(effect) for effect in model.all_effects}
    present_kinds = {type(effect).__name__ for effect in model.contact_effects}
    added = [
        candidate_of(effect)
        for kind in kinds
        if kind.neutral and kind.__name__ not in present_kinds
        for effect in variants(kind, model, experiment)
        if owner_name(effect) not in present and not model.refusal(effect) and shows(effect, experiment)
    ]
    return (*loosened, *added)


def shows(effect: AnyEffect, experiment: DriveExperiment) -> bool:
    """Return whether an effect can change the compared channels in the runs of a log.

    An effect in the motors cannot change them if the wheels are held to their measured rates. A tilt or bend of the
    common ground cannot change them if a run has a terrain of its own.
    """
    # Both a tilt and a bend of the ground act on the common terrain, which such a run does not use.
    has_own_terrain = any(run.commands.terrain is not None for run in experiment.runs)
    is_in_motor = experiment.rate_driven and isinstance(effect, MotorEffect)
    return not is_in_motor and not (has_own_terrain and type(effect) in (GravityTilt, BentGround))


def candidate_of(effect: AnyEffect) -> Candidate:
    """Return an effect as a candidate that states on which wheel, joint, channel or stretch of ground the effect acts.

    A stretch of ground is stated by the x at which it begins, and the search for the best place moves it. A bent ground
    extends over the whole path, so its place is not searched.
    """
    plain = plain_candidate(effect, owner_name(effect))
    # Quantities that no data determine are not fitted.
    plain = dataclasses.replace(plain, shapes=tuple(name for name in plain.shapes if not name.endswith(SMOOTHING)))
    if isinstance(effect, BentGround):
        return dataclasses.replace(plain, shapes=())
    if "x_from" not in effect.places:
        return plain
    return dataclasses.replace(plain, place=f"{float(effect.values()['x_from']):.3f}", place_searched=True)


def scale_effect(effect: Any, rover: Rover, gravity: float) -> Any:
    """Return an effect after scaling its forces, torques and masses from the paper's rover Nexus 6 to another rover.

    Forces are scaled by the rover's weight, and torques by its weight times its wheel radius. Without the scaling, each
    effect would be tried with the size for a rover of 6 kg, which is too small to show on a rover of 60 kg. Scaled
    values are kept within the bounds of their quantities.

    Parameters
    ----------
    gravity : float
        Gravity where the rover drives [m/s^2].
    """
    if has_papers_wheel(rover):
        return effect
    # Each unit has its own ratio: a stiffness per metre, for example, is a weight divided by a length.
    mass, length = rover.mass / NEXUS6_MASS, scale(rover)
    weight = mass * abs(gravity) / EARTH
    ratios = {"kg": mass, "N": weight, "N/m": weight / length, "rad/(N m)": 1.0 / (weight * length)}
    ratios |= dict.fromkeys(("N m", "N m s", "N m/rad", "N m s/rad"), weight * length)
    specs, values = quantities(effect), effect.values()
    larger = {name: ratios[specs[name].unit] * values[name] for name in effect.neutral if specs[name].unit in ratios}
    return effect.replace(**{name: min(max(v, specs[name].low), specs[name].high) for name, v in larger.items()})


def variants(kind: type[AnyEffect], model: Model, experiment: DriveExperiment) -> Iterable[AnyEffect]:
    """Return the effects of one class at their default size: one effect for each wheel, channel or place on which it
    may act.
    """
    effect: Any = scale_effect(reading_traction(kind(), model.effects), model.rover, model.gravity)
    # Which field an effect has decides where it can act: channel, wheel, stretch of ground, or everywhere.
    fields = {field.name: field for field in dataclasses.fields(effect)}
    if isinstance(effect, SensorBias):
        names = [name for name in experiment.channels if name.startswith(BIASED)]
        return [effect.replace(channel=name) for name in names]
    if "wheel" in fields:
        # An effect takes wheels either by number, or by name with "" for all wheels.
        wheels = [wheel.name for wheel in model.rover.wheels]
        wheel_labels: Sequence[Any] = range(len(wheels)) if isinstance(effect.wheel, int) else ["", *wheels]
        return [effect.replace(wheel=wheel) for wheel in wheel_labels]
    if isinstance(effect, BentGround):
        # The knots of the bend lie along the path of the wheels, which reach ahead of the body and behind it.
        ahead = float(np.abs(corners(model.rover)[..., 0]).max())
        low, high = _range_of_x(experiment)
        begin, spacing = low - ahead, (high - low + 2 * ahead) / (KNOTS - 1)
        bent = effect.replace(x_from=begin - spacing, length=(KNOTS + 1) * spacing)
        return [bent] if high - low > MIN_DISTANCE else []
    if "x_from" in effect.places:
        return [effect.replace(x_from=x) for x in _places(experiment, float(effect.length))]
    return [effect]


def _range_of_x(experiment: DriveExperiment) -> tuple[float, float]:
    """Return the smallest and the largest x [m] that the body of the rover reaches in all runs."""
    xs = np.concatenate([run.commands.place[:, 0] for run in experiment.runs])
    return float(np.nanmin(xs)), float(np.nanmax(xs))


def _places(experiment: DriveExperiment, length: float) -> list[float]:
    """Return the positions x [m] at which a patch of ground of this length may begin, PLACE_SPACING apart along the
    runs.

    If there are more than MAX_PLACES positions, only those are returned that several runs have crossed. A patch that a
    single run has crossed cannot be distinguished from the random ground of this run.
    """
    low, high = _range_of_x(experiment)
    low, high = low - 0.1, high + 0.1
    count = math.ceil((high - low) / PLACE_SPACING)
    places: Iterable[int] = range(count)
    if count > MAX_PLACES:
        # Number of runs that cross each place.
        crossings = np.zeros(count, dtype=int)
        for run in experiment.runs:
            x = run.commands.place[:, 0]
            crossings[np.unique(np.floor((x[np.isfinite(x)] - low) / PLACE_SPACING).astype(int))] += 1
        shared = np.flatnonzero(crossings > 1)
        places = [int(place) for place in shared[:: max(1, math.ceil(len(shared) / MAX_PLACES))]]
    return [low + PLACE_SPACING * place - length / 4 for place in places]
