"""List the effects that the model of a wheel on a rig may lack, from the package and from a user's folder."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.wheel_rig.declared import is_of_other_wheel, preset_candidate
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import ASKEW, NOMINAL, RigModel, conditions, predictor
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_files import AnyEffect, known_effects, reading_traction, user_effects
from rover_pin.soil.slip import rim_and_travel

SPEED_TOLERANCE = 0.05
"""Maximum relative change of the response to an effect if the assumed speed is multiplied by four. If the change is
larger, the effect counts as dependent on speed and is tried only if speeds were measured (assumed)."""


def effect_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the classes of contact effects that can be added to a model: the classes that declare neutral values.

    An effect does nothing at its neutral values. An effect of the user's file or folder replaces the package's effect
    of that name.

    Raises
    ------
    DataError
        The path does not exist or holds no contact effect, or a file cannot be run.
    """
    if folder is not None and not _contact_effects(user_effects(folder)):
        raise DataError(
            f"{folder}: there is no effect in it; give a .py file with a class that derives from Effect and names its "
            "`neutral` values, or a folder of such files."
        )
    return _contact_effects(known_effects(folder))


def rig_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the classes of effects that can change the channels of a rig, from the package and from a user's file or
    folder.

    Examples
    --------
    >>> names = [kind.__name__ for kind in rig_kinds()]
    >>> "SlipSinkage" in names, "WeakMotor" in names  # a rig drives its wheel without the rover's motor
    (True, False)
    """
    return shown_by_rigs(effect_kinds(folder))


def shown_by_rigs(kinds: Iterable[type[AnyEffect]]) -> list[type[Effect]]:
    """Return those of the given classes of effects that can change the channels of a rig.

    These are contact effects that do not depend on a place and do not change the slip. The slip is measured by the rig,
    so effects that change it do not show.
    """
    return [kind for kind in _contact_effects(kinds) if not kind.places and not kind.before_slip]


def _contact_effects(kinds: Iterable[type[AnyEffect]]) -> list[type[Effect]]:
    """Return the given classes that are contact effects with neutral values, without the others. At its neutral values,
    an effect does nothing.
    """
    return [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral]


def candidates(
    experiment: RigExperiment, model: RigModel | JointModel, kinds: Sequence[type[Effect]]
) -> tuple[Candidate, ...]:
    """Return the effects that the model lacks and that can change the channels of every data set, as candidates.

    An effect that depends on the speed is dropped if a data set states no speeds, because its response would depend on
    the assumed speed. An effect of lugs is dropped if rig.toml declares that the wheel has no lugs. Declared numbers of
    lugs and sand are the initial values of the effects.

    Parameters
    ----------
    experiment : RigExperiment
        The data sets as an experiment.
    model : RigModel or JointModel
        The base model.
    kinds : sequence of type
        Classes of the effects that are considered.
    """
    declared = experiment.declared
    # An effect that contains another one (`holds`) already has its influence.
    present = {name for effect in model.effects for name in (type(effect).__name__, *effect.holds)}
    pairs = [(data, model.of(data.name)) for data in experiment.sets]
    without_speeds = [(data, set_model) for data, set_model in pairs if data.speeds is None]
    effects = [default_effect(kind, pairs[0][1]) for kind in kinds if kind.__name__ not in present]
    return tuple(
        preset_candidate(effect, declared)
        for effect in effects
        if not is_of_other_wheel(effect, declared) and not any(needs_speeds(*pair, effect) for pair in without_speeds)
    )


def default_effect(kind: type[Effect], model: RigModel) -> Effect:
    """Return an effect with default numbers, but with the form and the contact angles of the model's traction law.

    Form and angles keep their defaults if the effect or the model does not have them.
    """
    return reading_traction(kind(), model.effects)


def needs_speeds(data: RigSet, model: RigModel, effect: Effect) -> bool:
    """Return whether the change of the channels by an effect depends on the speed of the wheel, at constant slip."""
    # The slip stays the same, because both speeds are multiplied by four.
    fast = 4 * NOMINAL * np.column_stack(rim_and_travel(data.slip)[::-1])
    rows = [RIG_CHANNELS.index(type(channel)) for channel in data.channels]
    sd = np.array([channel.sd for channel in data.channels])
    changes = []
    for speeds in (None, fast):
        # Change of the channels by the effect with default numbers (channels, runs), in SDs of the noise, which makes
        # changes of different channels comparable. It is 0 in a run whose load cannot be carried by any sinkage.
        runs = conditions(data.load, data.slip, speeds, data.slip_angle)
        with_it, without = (
            predictor(variant, (), runs)(variant.vector()).values[rows] for variant in (model.having(effect), model)
        )
        changes.append(np.nan_to_num((with_it - without) / sd))
    slow, faster = changes
    return bool(np.linalg.norm(faster - slow) > SPEED_TOLERANCE * np.linalg.norm(slow))


def present_amplitudes(effects: Sequence[Effect], known_parameters: Sequence[Parameter] = ()) -> tuple[Parameter, ...]:
    """Return the sizes (amplitudes) of the effects that a model has in addition to the base model, as free parameters.

    A parameter that is one of the `known_parameters` is omitted.
    """
    # Effects of the base model are part of every model, so their sizes are not free.
    present_candidates = [plain_candidate(effect) for effect in effects if effect not in ASKEW]
    known_names = {parameter.name for parameter in known_parameters}
    return tuple(
        candidate.size(name)
        for candidate in present_candidates
        for name in candidate.amplitudes
        if name not in known_names
    )


def numbers_of(experiment: RigExperiment, model: RigModel | JointModel) -> tuple[Parameter, ...]:
    """Return the free parameters of a fit: the uncertain numbers of the data sets, and the sizes of the model's added
    effects.
    """
    uncertain_numbers = experiment.uncertain(model)
    return (*uncertain_numbers, *present_amplitudes(model.effects, uncertain_numbers))
