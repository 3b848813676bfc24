"""Which effects may be missing: every effect file of the package and of a user's folder, found by looking."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import ASKEW, NOMINAL, RigModel, conditions, predictor
from rover_pin.experiments.wheel_rig.presets import is_of_other_wheel, preset_candidate
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_files import AnyEffect, known_effects, reading_traction, user_effects
from rover_pin.soil.slip import rim_and_travel

OF_SPEED = 0.05
"""Relative change of a signature with speed from which it needs the speeds. Why: less is noise (assumed)."""


def effect_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the contact effects that can be added to a model: those that name the values at which they vanish.

    Every `Effect` of a user's folder of effect files, or of one file, takes the place of the package's of its name.

    Raises DataError: the path is missing, holds no effect, or a file cannot be run.
    """
    if folder is not None and not _that_vanish(user_effects(folder)):
        raise DataError(
            f"{folder}: no effect stands there; give a .py file with a class that derives from Effect and names its "
            "`neutral` values, or a folder of such files."
        )
    return _that_vanish(known_effects(folder))


def rig_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the effects that a rig can show: none of a place, none that changes the slip."""
    return [kind for kind in effect_kinds(folder) if not kind.places and not kind.before_slip]


def _that_vanish(kinds: Iterable[type[AnyEffect]]) -> list[type[Effect]]:
    return [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral]


def candidates(
    experiment: RigExperiment, model: RigModel | JointModel, kinds: Sequence[type[Effect]]
) -> tuple[Candidate, ...]:
    """Return what the model may lack of these kinds: what it does not have, and every set shows by its own model.

    An effect of speed is left out where a set has no speeds: what was assumed of them would decide; one of lugs where
    the wheel that is declared has none. Geometry is as declared.
    """
    declared = experiment.declared
    present = {name for effect in model.effects for name in (type(effect).__name__, *effect.holds)}
    pairs = [(data, model.of(data.name)) for data in experiment.sets]
    silent = [(data, set_model) for data, set_model in pairs if data.speeds is None]
    effects = [default_effect(kind, pairs[0][1]) for kind in kinds if kind.__name__ not in present]
    return tuple(
        preset_candidate(effect, declared)
        for effect in effects
        if not is_of_other_wheel(effect, declared) and not any(needs_speeds(*pair, effect) for pair in silent)
    )


def default_effect(kind: type[Effect], model: RigModel) -> Effect:
    """Return the effect at its defaults, reading traction as the model's `SoilTraction` does where it asks."""
    return reading_traction(kind(), model.effects)


def needs_speeds(data: RigSet, model: RigModel, effect: Effect) -> bool:
    """Return whether what the effect moves changes with the speed at which the wheel is driven."""
    fast = 4 * NOMINAL * np.column_stack(rim_and_travel(data.slip)[::-1])
    slow_moved, fast_moved = (_effect_response(data, model, effect, speeds) for speeds in (None, fast))
    return bool(np.linalg.norm(fast_moved - slow_moved) > OF_SPEED * np.linalg.norm(slow_moved))


def _effect_response(data: RigSet, model: RigModel, effect: Effect, speeds: np.ndarray | None) -> np.ndarray:
    """Return what the effect at its default size moves [SD]; 0 where it carries no load."""
    runs = conditions(data.load, data.slip, speeds, data.slip_angle)
    rows = [RIG_CHANNELS.index(type(channel)) for channel in data.channels]
    sd = np.array([channel.sd for channel in data.channels])
    with_it, without = (
        predictor(variant, (), runs)(variant.vector()).values[rows] for variant in (model.having(effect), model)
    )
    return np.nan_to_num((with_it - without) / sd)


def present_amplitudes(effects: Sequence[Effect], known_parameters: Sequence[Parameter] = ()) -> tuple[Parameter, ...]:
    """Return the sizes of a model's effects, but for what it starts from, and for the known ones."""
    present_candidates = [plain_candidate(effect) for effect in effects if effect not in ASKEW]
    known_names = {parameter.name for parameter in known_parameters}
    return tuple(
        candidate.size(name)
        for candidate in present_candidates
        for name in candidate.amplitudes
        if name not in known_names
    )


def numbers_of(experiment: RigExperiment, model: RigModel | JointModel) -> tuple[Parameter, ...]:
    """Return the free numbers of a model: what is uncertain of the sets, and the sizes of the effects it has."""
    uncertain_numbers = experiment.uncertain(model)
    return (*uncertain_numbers, *present_amplitudes(model.effects, uncertain_numbers))
