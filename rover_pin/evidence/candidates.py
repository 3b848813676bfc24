"""Which effects may be missing: every effect file of the package and of a user's folder, found by looking."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import inspect
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

import rover_pin.effects
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.errors import DataError
from rover_pin.evidence.rig_model import RigModel
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
    names = [module.name for module in pkgutil.iter_modules(rover_pin.effects.__path__)]
    kinds = [kind for name in names for kind in _defined(importlib.import_module(f"rover_pin.effects.{name}"))]
    own = _of_folder(Path(folder)) if folder is not None else []
    replaced = {kind.__name__ for kind in own}
    return [kind for kind in kinds if kind.__name__ not in replaced] + own


def rig_kinds(folder: str | Path | None = None) -> list[type[Effect]]:
    """Return the effects that a rig can show: none of a place, none that changes the slip."""
    return [kind for kind in effect_kinds(folder) if not kind.places and not kind.before_slip]


def _defined(module: ModuleType) -> list[type[Effect]]:
    kinds = [kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__]
    return [kind for kind in kinds if issubclass(kind, Effect) and kind.neutral]


def _of_folder(path: Path) -> list[type[Effect]]:
    files = sorted(path.glob("*.py")) if path.is_dir() else [path]
    kinds = [kind for file in files for kind in _defined(_run(file))]
    if not kinds:
        raise DataError(
            f"{path}: no effect stands there; give a .py file with a class that derives from Effect and names its "
            "`neutral` values, or a folder of such files."
        )
    return kinds


def _run(file: Path) -> ModuleType:
    name = f"rover_pin_user_effect_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise DataError(f"{file}: there is no such effect file; give a .py file or a folder of them.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up while they are made
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise DataError(f"{file}: the effect file cannot be run: {type(error).__name__}: {error}.") from error
    return module


def added(kind: type[Effect], model: RigModel) -> Effect:
    """Return the effect at its defaults, reading traction as the model's `SoilTraction` does where it asks."""
    effect = kind()
    asked = {field.name for field in dataclasses.fields(effect)} - set(quantities(effect))
    for traction in model.effects:
        if isinstance(traction, SoilTraction):
            shared = {name: getattr(traction, name) for name in asked if hasattr(traction, name)}
            return effect.replace(**shared)
    return effect


def sizes(effect: Effect) -> tuple[str, ...]:
    """Return the parameters that make the effect vanish, as a model names them."""
    return tuple(f"{type(effect).__name__}.{name}" for name in effect.neutral)


def shapes(effect: Effect) -> tuple[str, ...]:
    """Return the parameters that only shape the effect, as a model names them."""
    return tuple(f"{type(effect).__name__}.{name}" for name in quantities(effect) if name not in effect.neutral)


def vanished(effect: Effect) -> Effect:
    """Return the effect at its neutral values."""
    return effect.replace(**effect.neutral)
