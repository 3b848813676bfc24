"""The loop on a test bench: an experiment in one file of the package or of a user's, found by its path or name."""

import inspect
import time
from importlib.resources import files
from pathlib import Path

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.standalone import Standalone, question_of
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.slip_slope import FILE as SLOPE_FILE
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.loop.verdict_file import written_last
from rover_pin.report.standalone.report import write_report
from rover_pin.simulation.model.effect_files import known_effects, run_file

OWN = ("motor_brake", "pendulum", "slip_slope")
"""The package's own test benches, by the name of their file."""


def own_kind(data: object) -> str | None:
    """Return which of the package's own test benches reads a folder, by the file in it; None where none does."""
    slopes = isinstance(data, (str, Path)) and is_file(Path(data) / SLOPE_FILE)
    return "slip_slope" if slopes else None


def read_standalone(data: str | Path, experiment: str | Path) -> Standalone:
    """Return the experiment that a file defines, read from the data.

    Parameters
    ----------
    experiment : path or str
        A Python file with one class that derives from `Standalone`, or the name of one of the package's own. To name a
        file is to let its code run.

    Raises
    ------
    DataError
        No such file, one that cannot be run or defines no experiment, or what its `read` refuses.
    """
    kinds = _experiment_classes(_file(experiment))
    if len(kinds) != 1:
        names = ", ".join(kind.__name__ for kind in kinds) or "none"
        raise DataError(
            f"{experiment}: an experiment's file defines one class that derives from "
            f"rover_pin.discrepancy.standalone.Standalone and leaves none of its methods abstract; here there is "
            f"{names}."
        )
    standalone = kinds[0].read(Path(data))
    _refuse_unfit(standalone, str(experiment))
    return standalone


def _refuse_unfit(standalone: Standalone, where: str) -> None:
    """Refuse a test bench whose arrays do not fit one another, before any fit."""
    for name, kind in {"channels": tuple, "folds": tuple, "observed": np.ndarray}.items():
        if not isinstance(getattr(standalone, name, None), kind):
            raise DataError(
                f"{where}: {name} is {getattr(standalone, name, 'not there')!r}, where a {kind.__name__} belongs."
            )
    if standalone.observed.dtype.kind != "f":
        raise DataError(f"{where}: observed holds {standalone.observed.dtype}, where numbers of kind float belong.")
    observed, noise, predicted = standalone.observed, standalone.noise(), standalone.predict([standalone.base_model()])
    full_shape = (
        len(standalone.folds),
        len([standalone.unit(channel) for channel in standalone.channels]),
        *observed.shape[2:3],
    )
    shapes = {
        "observed (folds, channels, samples)": (observed.shape, full_shape),
        "what predict returns for one model": (predicted.shape, (1, *full_shape)),
        "noise().good": (noise.good.shape, full_shape),
        "noise().sd": (noise.sd.shape, full_shape if noise.sd.ndim == 3 else full_shape[1:2]),
    }
    for what, (shape, expected) in shapes.items():
        if shape != expected or len(full_shape) != 3:
            raise DataError(f"{where}: {what} has the shape {shape}, where {expected} belongs.")
    measured = np.isfinite(observed)
    for what, good in (
        ("observed holds no number in some channel", measured.any(axis=(0, 2))),
        (
            "predict gives no finite number for the declared model where something was measured",
            np.isfinite(predicted[0][measured]),
        ),
        ("noise().sd is not positive in some channel", noise.floor > 0.0),
    ):
        if not good.all():
            raise DataError(f"{where}: {what}; mend the file or its data.")


def _file(experiment: str | Path) -> Path:
    if str(experiment) in OWN:
        return Path(str(files("rover_pin.experiments") / f"{experiment}.py"))
    if not is_file(Path(experiment)):
        bed_names = ", ".join(OWN)
        raise DataError(f"{experiment}: there is no such file of an experiment; give its path, or one of: {bed_names}.")
    return Path(experiment)


def _experiment_classes(file: Path) -> list[type[Standalone]]:
    module = run_file(file)
    kinds = [kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__]
    return [kind for kind in kinds if issubclass(kind, Standalone) and not inspect.isabstract(kind)]


def close_standalone(standalone: Standalone, request: LoopRequest, progress: Progress) -> Verdict:
    """Return what the model of a test bench lacks; with `out`, report.html and verdict.json are written there."""
    begun, out, poor = time.monotonic(), request.out, standalone.insufficient()
    say_what_is_replaced(out, OF_A_LOOP)
    if poor:
        verdict = Verdict("test-bed", Answer.CANNOT_TELL, standalone.name, poor, standalone.base_model())
    else:
        verdict = conclude(question_of(standalone, known_effects(request.effects)), progress, request.seed)
    verdict.provenance.update(provenance(request, time.monotonic() - begun))
    if out is not None:
        verdict = written_last(verdict, write_report(verdict, standalone, Path(out)), Path(out))
    return verdict
