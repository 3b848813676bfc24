"""Read and check the code that the package does not contain: experiments and effects of users and of other packages.

An experiment is a class that belongs to the package, to another installed package, or to a user's file. Experiments and
effects are checked before any fit, so that a mistake is reported at once and not after minutes of fits.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

import rover_pin.experiments
from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.files.paths import is_file
from rover_pin.base.installed_packages import EXPERIMENTS, Offer, offers
from rover_pin.base.quantity import quantities
from rover_pin.base.users_code import is_stop, mistake
from rover_pin.contact import Soil
from rover_pin.discrepancy.experiment import FileExperiment
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.catalogue import OWN_PACKAGE, Entry, first_sentence
from rover_pin.simulation.compiled.laws import contact_law, motor_law
from rover_pin.simulation.model.effect_files import AnyEffect, offered_effects, reading_traction, run_file, user_effects
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat


@cache
def package_experiments() -> dict[str, type[FileExperiment]]:
    """Return the package's own experiments on which the search for missing effects can run: name -> class.

    The name is the name of the file that defines the class, without its suffix.
    """
    names = [module.name for module in pkgutil.iter_modules(rover_pin.experiments.__path__) if not module.ispkg]
    modules = {name: importlib.import_module(f"rover_pin.experiments.{name}") for name in names}
    return {name: kind for name, module in modules.items() for kind in _experiments_in(module) if kind.is_for_loop}


def offered_experiments() -> dict[str, Offer]:
    """Return the experiments that other installed packages offer: name of the entry point -> offer."""
    return offers(EXPERIMENTS, tuple(package_experiments()))


def installed_experiments() -> dict[str, type[FileExperiment]]:
    """Return a mapping from names to the experiment classes of the package and of other installed packages.

    Raises DataError if the code of a package cannot be imported, or if it offers no experiment class.
    """
    classes = {name: offer.load((FileExperiment,)) for name, offer in offered_experiments().items()}
    return {**package_experiments(), **classes}


def experiments() -> list[Entry]:
    """Return the list of all experiments that `close-loop --experiment NAME` knows, each with its data file and with
    the package that offers it.
    """
    sources = {name: offer.source for name, offer in offered_experiments().items()}
    return [
        Entry(name, first_sentence(kind), {"data_file": kind.file, "package": sources.get(name, OWN_PACKAGE)})
        for name, kind in installed_experiments().items()
    ]


def _experiments_in(module: ModuleType) -> list[type[FileExperiment]]:
    """Return the experiment classes that a module defines itself. Abstract and imported classes do not count."""
    return [
        kind
        for _, kind in inspect.getmembers(module, inspect.isclass)
        if kind.__module__ == module.__name__ and issubclass(kind, FileExperiment) and not inspect.isabstract(kind)
    ]


def experiment_of_folder(data: Path) -> str | None:
    """Return the name of the installed experiment that can read the data in a folder; None if no experiment can.

    An experiment is recognised by the name of its data file, such as slope.toml.
    """
    marks = {kind.file: name for name, kind in installed_experiments().items() if kind.file}
    return next((name for file, name in marks.items() if is_file(data / file)), None)


def read_experiment(data: str | Path, experiment: str | Path) -> FileExperiment:
    """Return the experiment that a Python file defines, after it has read and checked its data.

    Parameters
    ----------
    data : path
        Path of the data; it is passed to the experiment's method `read`.
    experiment : path or str
        A Python file with one class that derives from `FileExperiment`, or the name of an experiment of the package or
        of another installed package. The code of the file runs.

    Raises
    ------
    DataError
        If there is no such file, if it cannot be run or does not define exactly one experiment, if its `read` refuses
        the data, or if its arrays do not fit each other.
    """
    # The package's own names are tried first, then the names of other installed packages, then a file of the user.
    own = package_experiments()
    own = own if str(experiment) in own else installed_experiments()
    if str(experiment) in own:
        kinds = [own[str(experiment)]]
    elif is_file(Path(experiment)):
        kinds = _experiments_in(run_file(Path(experiment)))
    else:
        names = ", ".join(own)
        raise DataError(f"{experiment}: there is no such file of an experiment; give its path, or one of: {names}.")
    if len(kinds) != 1:
        names = ", ".join(kind.__name__ for kind in kinds) or "none"
        raise DataError(
            f"{experiment}: the file of an experiment must define exactly one class that derives from "
            "rover_pin.discrepancy.experiment.FileExperiment and implements all of its abstract methods; "
            f"this file defines {names}."
        )
    built = kinds[0].read(Path(data))
    _refuse_unfit_experiment(built, str(experiment))
    return built


def _refuse_unfit_experiment(experiment: FileExperiment, where: str) -> None:
    """Check the types and shapes of an experiment's arrays. A wrong array would make a fit fail later with a less clear
    message.

    Raises DataError: an array has a wrong type or shape, or lacks finite numbers. `where` is the beginning of the
    message.
    """
    for name, kind in {"channels": tuple, "folds": tuple, "observed": np.ndarray}.items():
        value = getattr(experiment, name, "not there")
        if not isinstance(value, kind):
            raise DataError(f"{where}: {name} is {value!r}, but it must be a {kind.__name__}.")
    observed = experiment.observed
    if observed.dtype.kind != "f":
        raise DataError(f"{where}: observed holds {observed.dtype}, but it must hold float numbers.")
    # The model that the experiment declares predicts all measured values once. The shape of this prediction is compared
    # with the shapes of the measured values and of the noise.
    noise, predicted = experiment.noise(), experiment.predict([experiment.base_model()])
    counts = (len(experiment.folds), len([experiment.unit(channel) for channel in experiment.channels]))
    full_shape = (*counts, *observed.shape[2:3])
    shapes = {
        "observed (folds, channels, samples)": (observed.shape, full_shape),
        "the array that predict returns for one model": (predicted.shape, (1, *full_shape)),
        "noise().good": (noise.good.shape, full_shape),
        "noise().sd": (noise.sd.shape, full_shape if noise.sd.ndim == 3 else full_shape[1:2]),
    }
    for name, (shape, expected) in shapes.items():
        if shape != expected or len(full_shape) != 3:
            raise DataError(f"{where}: {name} has the shape {shape}, but {expected} is needed.")
    # A fit needs measured numbers, finite predictions where something was measured, and positive noise.
    measured = np.isfinite(observed)
    finite = np.isfinite(predicted[0][measured])
    for problem, good in (
        ("observed holds no number in some channel", measured.any(axis=(0, 2))),
        ("predict gives no finite number for the declared model where something was measured", finite),
        ("noise().sd is not positive in some channel", noise.floor > 0.0),
    ):
        if not good.all():
            raise DataError(f"{where}: {problem}; correct the file or its data.")


def refuse_unfit_effects(path: str | Path) -> None:
    """Check that the search for missing effects can add and remove each effect in a user's file or folder.

    An effect must declare its neutral values, at which it vanishes, and its formulas must be computable.

    Raises DataError if a file cannot be run or an effect in it cannot be used; the message names the file, the line and
    the effect.
    """
    _refuse_unusable({kind: str(path) for kind in user_effects(path)})


def refuse_unfit_offered_effects() -> None:
    """Check that the search for missing effects can add and remove each effect that another installed package offers.

    Raises DataError if such an effect cannot be imported or used; the message names the package.
    """
    if offered := offered_effects():
        _refuse_unusable({kind: f"installed package {offer.source}" for kind, offer in offered.items()})


def _refuse_unusable(kinds: Mapping[type[AnyEffect], str]) -> None:
    """Check that the search for missing effects can use each effect in `kinds`: class -> words for the origin of the
    class.
    """
    rover = load_rover("nexus6")
    # Each effect is added to the model of a simple rover, because its formulas only need to be computed once.
    effects = base_effects(Soil(), rover, SoilTraction())
    model = Model(rover, flat(), (Soil(),), Motor(), effects=effects)
    for kind, place in kinds.items():
        if not kind.neutral:
            raise DataError(
                f"{place}: {kind.__name__} does not declare the values at which the effect vanishes, so the loop "
                'cannot add it. Add the line neutral: ClassVar[dict[str, float]] = {"a": 0.0} to the class, with the '
                "quantity that sets the effect's size in place of a."
            )
        # A misspelt name would leave the effect's real size at its default when the loop removes the effect.
        strange = [name for name in kind.neutral if name not in quantities(kind)]
        if strange:
            names = ", ".join(quantities(kind))
            has = f"it has {names}." if names else "it has none. Is @dataclass(frozen=True) above the class?"
            raise DataError(
                f"{place}: {kind.__name__} has a neutral value for '{strange[0]}', but the effect has no quantity of "
                f"this name: {has}"
            )
        try:
            # The loop will build the effect, set it to its neutral values, and compile its formulas, so each step is
            # tried here.
            effect = reading_traction(kind(), model.effects)
            effect.replace(**effect.neutral)
            model_with_effect = model.having(effect)
            if isinstance(effect, Effect):
                contact_law(model_with_effect.contact_effects)
            elif isinstance(effect, MotorEffect):
                motor_law(model_with_effect.motor, model_with_effect.motor_effects)
        except BaseException as error:
            # If an error of this package does not name the user's file, the file and the line of the class are added.
            file, line = inspect.getfile(kind), inspect.getsourcelines(kind)[1]
            if isinstance(error, RoverPinError) and file not in str(error):
                raise DataError(f"{file}, line {line}: {error}") from error
            if is_stop(error):
                raise
            raise mistake(error, file, line) from error
