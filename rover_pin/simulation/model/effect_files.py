"""Effects in files: found by their class's name in the package or in a user's file, written to TOML and read back."""

import dataclasses
import hashlib
import importlib
import inspect
import pkgutil
import sys
import tempfile
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, TypeVar

import rover_pin.effects
from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.toml_file import text_in
from rover_pin.base.jobs.workers import sent_by_value
from rover_pin.base.quantity import Record, as_table, quantities, record_from
from rover_pin.base.trust import Trust
from rover_pin.base.users_code import guard, is_stop, mistake
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import FORMS

BASES = (Effect, MotorEffect, BodyEffect, SensorEffect)
AnyEffect = Effect | MotorEffect | BodyEffect | SensorEffect
OneKind = TypeVar("OneKind", bound=Record)
ANGLES = {kind.__name__: kind() for kind in (FixedAngles, SinkageAngles)}
CHOICES: dict[str, Mapping[str, Any]] = {"is no traction form": FORMS, "are no angles": ANGLES}
"""How one says that there is none, and the choices by the word for them in a file."""
OWN = "rover_pin.effects."


@lru_cache(maxsize=1)
def package_effects() -> tuple[type[AnyEffect], ...]:
    """Return every effect of the package, by looking at its files."""
    names = [module.name for module in pkgutil.iter_modules(rover_pin.effects.__path__)]
    return tuple(kind for name in names for kind in defined_in(importlib.import_module(OWN + name)))


def user_effects(path: str | Path) -> tuple[type[AnyEffect], ...]:
    """Return the effects that a user's file defines, or all files of a folder.

    Raises DataError: the path is missing, holds no effect, or a file cannot be run.
    """
    path = Path(path)
    files = sorted(path.glob("*.py")) if is_folder(path) else [path]
    kinds = tuple(kind for file in files for kind in defined_in(run_file(file)))
    for kind in kinds:
        _default_effect(kind)
    if not kinds:
        bases = ", ".join(base.__name__ for base in BASES)
        raise DataError(f"{path}: no effect stands there; give a .py file with a class that derives from {bases}.")
    return kinds


def known_effects(path: str | Path | None = None) -> tuple[type[AnyEffect], ...]:
    """Return the package's effects and a user's, which take the place of those of their names; errors as of both."""
    kinds = (*package_effects(), *(user_effects(path) if path else ()))
    return tuple({kind.__name__: kind for kind in kinds}.values())


def trusted_effects(trust: Trust) -> tuple[type[AnyEffect], ...]:
    """Return the effects of all files that the user trusts by name; a file may hold none, as a controller's does."""
    files = [file for path in trust.effects for file in (sorted(path.glob("*.py")) if is_folder(path) else [path])]
    return tuple(kind for file in files for kind in defined_in(run_file(file)))


def _default_effect(kind: type[AnyEffect]) -> AnyEffect:
    """Return an effect of a user's file with its defaults, as it is tried first."""
    try:
        return kind()
    except Exception as error:
        if is_stop(error):
            raise
        file = str(inspect.getfile(kind))
        raise mistake(error, file, inspect.getsourcelines(kind)[1]) from error


def effects_of_text(text: str) -> tuple[type[AnyEffect], ...]:
    """Return the effects that the text of an effect file defines, of which no file is kept."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "measured_remainder.py"
        file.write_text(text, encoding="utf-8")
        return user_effects(file)


def defined_in(module: ModuleType) -> tuple[type[AnyEffect], ...]:
    """Return the effects that a module defines itself."""
    kinds = [kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__]
    return tuple(kind for kind in kinds if issubclass(kind, BASES) and kind not in BASES)


def run_file(file: Path) -> ModuleType:
    """Return the module that a user's Python file makes, from its text alone: no compiled copy beside it is read.

    Raises DataError: it is missing or cannot be run.
    """
    if not is_file(file):
        raise DataError(f"{file}: there is no such effect file; give a .py file or a folder of them.")
    path = str(file.resolve())
    name = f"rover_pin_user_effect_{file.stem}_{hashlib.sha256(path.encode()).hexdigest()[:8]}"
    loader = _AsRead(name, path)
    module = ModuleType(name)
    module.__file__ = path
    sys.modules[name] = module  # dataclasses look their module up while they are made
    try:
        loader.exec_module(module)
        guard(module)
    except BaseException as error:
        del sys.modules[name]
        if is_stop(error):
            raise
        raise mistake(error, path) from error
    sent_by_value(module)
    return module


class _AsRead(SourceFileLoader):
    """Runs the text of a file, which its user may have read, never a compiled copy."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the text."""
        return self.source_to_code(self.get_data(self.path), self.path)


def reading_traction(effect: OneKind, present: Iterable[Any]) -> OneKind:
    """Return an effect that reads the traction law with the form and angles of the `SoilTraction` that is present."""
    choice_names = {field.name for field in dataclasses.fields(effect)} - set(quantities(effect))
    for traction in present:
        if isinstance(traction, SoilTraction):
            return effect.replace(**{name: getattr(traction, name) for name in choice_names if hasattr(traction, name)})
    return effect


def effect_entry(effect: AnyEffect) -> dict[str, Any]:
    """Return an effect as a TOML table: its class's name, its choices, its quantities with units.

    An effect from outside the package keeps the path of its file.
    """
    kind = type(effect)
    entry: dict[str, Any] = {"name": kind.__name__}
    if not kind.__module__.startswith(OWN):
        entry["file"] = str(file_of(kind))
    for field in dataclasses.fields(effect):
        if field.name not in quantities(effect):
            entry[field.name] = _word(getattr(effect, field.name))
    return entry | as_table(effect)


def file_of(kind: type[AnyEffect]) -> Path:
    """Return the file with an effect's code.

    Raises DataError: it has none, as one that was written at a prompt.
    """
    try:
        return Path(inspect.getfile(kind))
    except (TypeError, OSError) as error:
        raise DataError(
            f"Effect {kind.__name__} has no file of its code, from which a model could be read back: put its class "
            "into a .py file."
        ) from error


def _word(choice: Any) -> Any:
    """Return the word that stands for a choice in a file; numbers and text stand for themselves."""
    for options in CHOICES.values():
        for word, option in options.items():
            if type(option) is type(choice):
                return word
    return choice


def effect_from(entry: Mapping[str, Any], where: str, folder: Path, trust: Trust = Trust()) -> AnyEffect:
    """Return the effect of a TOML table; a `file` of its code may be relative to `folder`, and `trust` must allow it.

    Raises DataError: an effect or choice that is not known, or a file of code that is not trusted or cannot be run.
    Raises ParameterError: an unknown field, unit or value, or one out of bounds.
    """
    kinds, file = {kind.__name__: kind for kind in package_effects()}, entry.get("file")
    if file is not None:
        code = folder / str(file)
        trust.refuse_code(code, f"{where} {text_in(entry, 'name', where)}".rstrip())
        kinds |= {kind.__name__: kind for kind in user_effects(code)}
    return effect_among(kinds, entry, where)


def effect_among(kinds: Mapping[str, type[AnyEffect]], entry: Mapping[str, Any], where: str) -> AnyEffect:
    """Return the effect of a TOML table, one of these by the names of their classes; see `effect_from`."""
    name = text_in(entry, "name", where)
    fields = {field: value for field, value in entry.items() if field not in ("name", "file")}
    if name not in kinds:
        raise DataError(f"{where}: there is no effect '{name}': {closest(name, kinds)}")
    default, where = kinds[name](), f"{where} {name}"
    choices = {
        field.name: _choice(fields.pop(field.name), getattr(default, field.name), f"{where}: {field.name}")
        for field in dataclasses.fields(default)
        if field.name in fields and field.name not in quantities(default)
    }
    effect: AnyEffect = record_from(kinds[name], fields, where)
    return effect.replace(**choices)


def _choice(value: Any, default: Any, where: str) -> Any:
    """Return what a file's word stands for, where the field's default is `default`."""
    for none, options in CHOICES.items():
        if type(default) in map(type, options.values()):
            if not isinstance(value, str) or value not in options:
                raise DataError(f"{where}: there {none} '{value}': {closest(str(value), options)}")
            return options[value]
    if type(value) is not type(default):
        raise DataError(f"{where} = {value!r} must be like {default!r}.")
    return value
