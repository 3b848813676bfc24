"""Effects in files: effect classes in the package, in other installed packages or in a user's Python file, and single
effects as tables of a TOML file.
"""

import dataclasses
import hashlib
import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, TypeVar

import rover_pin.effects
from rover_pin.base.errors import DataError, RoverPinError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.toml_file import text_in
from rover_pin.base.installed_packages import EFFECTS, Offer, offers
from rover_pin.base.jobs.workers import sent_by_value
from rover_pin.base.quantity import Record, as_table, quantities, record_from
from rover_pin.base.trust import Trust, code_files
from rover_pin.base.users_code import guard, is_stop, mistake
from rover_pin.contact import Scalar
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import FORMS

BASES = (Effect, MotorEffect, BodyEffect, SensorEffect)
"""Base classes of all effects. The base class decides where an effect acts: at the contact, in a motor, on the body, or
in a sensor."""
AnyEffect = Effect | MotorEffect | BodyEffect | SensorEffect
OneKind = TypeVar("OneKind", bound=Record)
ANGLES = {kind.__name__: kind() for kind in (FixedAngles, SinkageAngles)}
CHOICES: dict[str, Mapping[str, Any]] = {"is no traction form": FORMS, "are no angles": ANGLES}
"""The fields of an effect that are no numbers: the traction form and the contact angles. For each of them, the second
half of the error message for an unknown word -> the allowed words, each with its value."""
PACKAGE = "rover_pin.effects."
"""Beginning of the names of the modules that contain the package's own effects. All other effects are a user's, or
belong to another installed package."""
NO_FIELDS = ("name", "file", "package")
"""Keys of an effect's TOML table that decide its class. All other keys are fields of the effect."""


@lru_cache(maxsize=1)
def package_effects() -> tuple[type[AnyEffect], ...]:
    """Return the classes of all effects that the package contains."""
    names = [module.name for module in pkgutil.iter_modules(rover_pin.effects.__path__)]
    return tuple(kind for name in names for kind in defined_in(importlib.import_module(PACKAGE + name)))


def offered_effects() -> dict[type[AnyEffect], Offer]:
    """Return the classes of all effects that other installed packages offer, each with its package.

    Raises DataError: an effect cannot be imported or created, is no effect, is not named by its entry point as its
    class is named, or has the name of another effect. The message names the package.
    """
    classes: dict[type[AnyEffect], Offer] = {}
    for name, offer in offers(EFFECTS, tuple(kind.__name__ for kind in package_effects())).items():
        kind = offer.load(BASES)
        # Scenarios name an effect by its class, so that the entry point must use this name.
        if kind.__name__ != name:
            raise DataError(
                f"The installed package {offer.source} offers the effect {kind.__name__} under the name '{name}'; in "
                f"its entry point, the name must be {kind.__name__}."
            )
        # An error in the class is reported now, with the package, its file and line.
        try:
            kind()
        except BaseException as error:
            if is_stop(error) and not isinstance(error, RoverPinError):
                raise
            place = f"{inspect.getfile(kind)} (installed package {offer.source})"
            raise mistake(error, place, inspect.getsourcelines(kind)[1]) from error
        classes[kind] = offer
    return classes


def installed_effects() -> tuple[type[AnyEffect], ...]:
    """Return the classes of the package's effects and of the effects that other installed packages offer."""
    return (*package_effects(), *offered_effects())


def user_effects(path: str | Path) -> tuple[type[AnyEffect], ...]:
    """Return the classes of effects that a user's Python file defines. If the path is a folder, all Python files in it
    are read. The code of the files is run.

    Raises DataError: the path is missing, its files define no effect, or a file cannot be run.
    """
    path = Path(path)
    kinds = tuple(kind for file in code_files(path) for kind in defined_in(run_file(file)))
    for kind in kinds:
        # An error in the class is reported now, with its file and line, rather than in the middle of a drive.
        try:
            kind()
        except BaseException as error:
            if is_stop(error):
                raise
            raise mistake(error, str(inspect.getfile(kind)), inspect.getsourcelines(kind)[1]) from error
    if not kinds:
        bases = ", ".join(base.__name__ for base in BASES)
        raise DataError(
            f"{path}: the file or folder defines no effect; give a .py file with a class that derives from {bases}."
        )
    return kinds


def known_effects(path: str | Path | None = None) -> tuple[type[AnyEffect], ...]:
    """Return the classes of the package's effects, of the effects of other installed packages, and of the effects in a
    user's file or folder. If a user's effect has the name of a package's effect, only the user's is returned.
    """
    kinds = (*installed_effects(), *(user_effects(path) if path else ()))
    return tuple({kind.__name__: kind for kind in kinds}.values())


def trusted_effects(trust: Trust) -> tuple[type[AnyEffect], ...]:
    """Return the classes of effects in all files whose code the user allows to run. Such a file may also contain no
    effect, for example the file of a controller.
    """
    files = (file for path in trust.effects for file in code_files(path))
    return tuple(kind for file in files for kind in defined_in(run_file(file)))


def effect_class(
    name: str, base: type[OneKind], quantities: Mapping[str, Any], members: Mapping[str, Any], content: str
) -> type[OneKind]:
    """Return a new class of effects that is made of Python objects. No text from a data set is compiled for this class,
    so that a data set cannot run code.

    Parameters
    ----------
    name : str
        Name of the class.
    base : type
        One of `BASES`, or a class that derives from one of them.
    quantities : mapping
        Name -> `quantity(...)` of each parameter.
    members : mapping
        Hooks as functions, and class variables such as `title` and `neutral`.
    content : str
        A text that differs if the law of the effect differs. It distinguishes the class from other classes of this
        name, for example when a stored result is looked up by a digest of the model.
    """
    module = f"rover_pin_drafted_{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    body = {**members, **quantities, "__module__": module, "__annotations__": dict.fromkeys(quantities, Scalar)}
    return dataclasses.dataclass(frozen=True)(type(name, (base,), body))


def defined_in(module: ModuleType) -> tuple[type[AnyEffect], ...]:
    """Return the effect classes that a module defines itself, without the classes that it imports."""
    kinds = [kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__]
    return tuple(kind for kind in kinds if issubclass(kind, BASES) and kind not in BASES)


def run_file(file: Path) -> ModuleType:
    """Run a user's Python file and return its module.

    Only the text of the file is run, because the user may have read it. A compiled copy of the file (.pyc), which may
    differ, is never used.

    Raises DataError: the file is missing or cannot be run.
    """
    if not is_file(file):
        raise DataError(f"{file}: this Python file does not exist; give a .py file, or a folder of .py files.")
    path = str(file.resolve())
    # Each path gets its own module name, so that two files with the same name do not replace each other.
    name = f"rover_pin_user_effect_{file.stem}_{hashlib.sha256(path.encode()).hexdigest()[:8]}"
    loader = _TextLoader(name, path)
    # The module is registered before it runs, and removed again if it fails, so that no half of it remains.
    module = ModuleType(name)
    module.__file__ = path
    sys.modules[name] = module  # a dataclass looks its module up while it is created
    try:
        loader.exec_module(module)
        guard(module)
    except BaseException as error:
        del sys.modules[name]
        if is_stop(error):
            raise
        raise mistake(error, path) from error
    # Worker processes do not have the file's module, so they get its classes by value.
    sent_by_value(module)
    return module


class _TextLoader(SourceFileLoader):
    """A module loader that compiles the text of a file at each call and never uses a compiled copy (.pyc)."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the code that is compiled from the present text of the file."""
        return self.source_to_code(self.get_data(self.path), self.path)


def reading_traction(effect: OneKind, present: Iterable[Any]) -> OneKind:
    """Return an effect with the traction form and the contact angles of a model's traction law, so that both use equal
    formulas.

    Parameters
    ----------
    effect : effect
        The effect. If it has a form or angles, these fields are set.
    present : iterable of effects
        The effects of the model; the first `SoilTraction` among them is the traction law. If there is none, `effect` is
        returned unchanged.
    """
    choice_names = {field.name for field in dataclasses.fields(effect)} - set(quantities(effect))
    for traction in present:
        if isinstance(traction, SoilTraction):
            return effect.replace(**{name: getattr(traction, name) for name in choice_names if hasattr(traction, name)})
    return effect


def effect_entry(effect: AnyEffect) -> dict[str, Any]:
    """Return an effect as a TOML table that `effect_from` converts back to an equal effect: the name of its class, its
    choices (traction form, contact angles), and its quantities with units.

    For an effect of another installed package, the table also contains the name of this package; for a user's effect,
    it contains the path of the file that defines its class.
    """
    kind = type(effect)
    entry: dict[str, Any] = {"name": kind.__name__}
    if not kind.__module__.startswith(PACKAGE):
        offered = offered_effects()
        entry |= {"package": offered[kind].package} if kind in offered else {"file": str(file_of(kind))}
    for field in dataclasses.fields(effect):
        if field.name not in quantities(effect):
            value = getattr(effect, field.name)
            # A choice is written as its word in CHOICES; numbers and texts are written unchanged.
            words = [word for options in CHOICES.values() for word, o in options.items() if type(o) is type(value)]
            entry[field.name] = words[0] if words else value
    return entry | as_table(effect)


def file_of(kind: type[AnyEffect]) -> Path:
    """Return the path of the Python file that defines a class of effects.

    Raises DataError: there is no file, because the class was typed at a Python prompt.
    """
    try:
        return Path(inspect.getfile(kind))
    except (TypeError, OSError) as error:
        raise DataError(
            f"A model with the effect {kind.__name__} cannot be written, because the class of the effect is not in a "
            "file from which it could be read again: put the class into a .py file."
        ) from error


def effect_from(entry: Mapping[str, Any], where: str, folder: Path, trust: Trust = Trust()) -> AnyEffect:
    """Return the effect that a TOML table describes.

    Parameters
    ----------
    entry : mapping
        The table: the name of the effect's class, optionally the file or the installed package that defines the class,
        and the effect's fields.
    where : str
        Position of the table in the TOML file, for error messages.
    folder : Path
        Folder of the TOML file; the path of the effect's `file` is relative to it.
    trust : Trust
        The files whose code may run; it must contain the effect's `file`.

    Raises
    ------
    DataError
        An effect, or the word for a choice, is not known; or a file of code is not trusted or cannot be run.
    ParameterError
        A field, unit or value is unknown or beyond its limits.
    """
    # Code of a user runs only from a file that is trusted.
    kinds, file = {kind.__name__: kind for kind in package_effects()}, entry.get("file")
    name = text_in(entry, "name", where)
    if file is None and ("package" in entry or name not in kinds):
        # Other installed packages may offer the effect. A table that names its package accepts no other.
        offered, package = offered_effects(), text_in(entry, "package", where) if "package" in entry else None
        sources = {(kind.__name__, one.package) for kind, one in offered.items()}
        if package is not None and (name, package) not in sources:
            raise DataError(
                f"{where}: the effect '{name}' belongs to the package '{package}', but no installed "
                "package of this name offers it. If you trust the maker of this package, install it."
            )
        kinds |= {kind.__name__: kind for kind in offered}
    if file is not None:
        code = folder / str(file)
        trust.refuse_code(code, f"{where} {name}".rstrip())
        kinds |= {kind.__name__: kind for kind in user_effects(code)}
    return effect_among(kinds, entry, where)


def effect_among(kinds: Mapping[str, type[AnyEffect]], entry: Mapping[str, Any], where: str) -> AnyEffect:
    """Return the effect that a TOML table describes. The table names the class of the effect, which must be a key of
    `kinds` (name -> class). For the errors, see `effect_from`.
    """
    name = text_in(entry, "name", where)
    fields = {field: value for field, value in entry.items() if field not in NO_FIELDS}
    if name not in kinds:
        raise DataError(f"{where}: there is no effect '{name}': {closest(name, kinds)}")
    default, where = kinds[name](), f"{where} {name}"
    # Choices are words, all other fields quantities.
    choices = {
        field.name: _choice(fields.pop(field.name), getattr(default, field.name), f"{where}: {field.name}")
        for field in dataclasses.fields(default)
        if field.name in fields and field.name not in quantities(default)
    }
    effect: AnyEffect = record_from(kinds[name], fields, where)
    return effect.replace(**choices)


def _choice(value: Any, default: Any, where: str) -> Any:
    """Return the value of a field that is no number, such as the traction form, from the word in a file. The type of
    the field's default decides which words are allowed.
    """
    for none, options in CHOICES.items():
        if type(default) in map(type, options.values()):
            if not isinstance(value, str) or value not in options:
                raise DataError(f"{where}: there {none} '{value}': {closest(str(value), options)}")
            return options[value]
    if type(value) is not type(default):
        raise DataError(f"{where} = {value!r} has the wrong type: give a value such as {default!r}.")
    return value
