"""Which effects may be missing: every effect file of the package and of a user's folder, found by looking."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rover_pin.effects.effect import Effect
from rover_pin.errors import DataError
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.motion.effect_files import AnyEffect, package_effects, reading_traction, user_effects
from rover_pin.quantity import quantities


def effect_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the contact effects that can be added to a model: those that name the values at which they vanish.

    A user's effect of the same name takes the place of the package's.

    Parameters
    ----------
    folder : path or None
        A folder of effect files, or one file; every `Effect` that a file defines is taken.

    Raises
    ------
    DataError
        The path is missing, holds no effect, or a file cannot be run.
    """
    kinds = _that_vanish(package_effects())
    own = _of_folder(Path(folder)) if folder is not None else []
    replaced = {kind.__name__ for kind in own}
    return [kind for kind in kinds if kind.__name__ not in replaced] + own


def rig_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the effects that a rig can show: none of a place, none that changes the slip."""
    return [kind for kind in effect_kinds(folder) if not kind.places and not kind.before_slip]


def _that_vanish(kinds: Iterable[type[AnyEffect]]) -> list[type[Effect]]:
    return [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral]


def _of_folder(path: Path) -> list[type[Effect]]:
    kinds = _that_vanish(user_effects(path))
    if not kinds:
        raise DataError(
            f"{path}: no effect stands there; give a .py file with a class that derives from Effect and names its "
            "`neutral` values, or a folder of such files."
        )
    return kinds


def added(kind: type[Effect], model: RigModel) -> Effect:
    """Return the effect at its defaults, reading traction as the model's `SoilTraction` does where it asks."""
    return reading_traction(kind(), model.effects)


def sizes(effect: Effect) -> tuple[str, ...]:
    """Return the parameters that make the effect vanish, as a model names them."""
    return tuple(f"{type(effect).__name__}.{name}" for name in effect.neutral)


def shapes(effect: Effect) -> tuple[str, ...]:
    """Return the parameters that only shape the effect, as a model names them."""
    return tuple(f"{type(effect).__name__}.{name}" for name in quantities(effect) if name not in effect.neutral)


def vanished(effect: Effect) -> Effect:
    """Return the effect at its neutral values."""
    return effect.replace(**effect.neutral)
