"""Drives on a model of a file, remembered by what the file says: what was found for one is never another's."""

import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import content
from rover_pin.simulation.model.toml_file import model_files
from rover_pin.tuning.study import DriveCase, TuningStudy


def sealed(study: TuningStudy) -> TuningStudy:
    """Return the study with each drive's model file, if it has one, sealed as it is now.

    Raises DataError, UrdfError: a model file, or one that it names, that cannot be read.
    """
    seals = {file: digest(file) for file in study.model_files}
    return dataclasses.replace(study, training=_with(seals, study.training), held_out=_with(seals, study.held_out))


def refuse_other_model(case: DriveCase) -> None:
    """Refuse a model file that is no longer what it was when the study was sealed.

    Raises DataError: it was changed in the meantime.
    """
    if case.seal and case.seal != digest(case.model_file):
        raise DataError(f"{case.model_file}: the model was changed while it is tuned for: start the tuning again.")


def digest(file: str | Path) -> str:
    """Return a digest of a model file and of all files that it names."""
    hasher = hashlib.sha1()
    for part in model_files(file):
        try:
            raw = content(part)
        except OSError as error:
            raise DataError(f"{file}: {part} cannot be read: {error.strerror}.") from error
        hasher.update(b"%d " % len(raw) + raw)
    return hasher.hexdigest()


def _with(seals: dict[str, str], cases: Sequence[DriveCase]) -> tuple[DriveCase, ...]:
    return tuple(dataclasses.replace(case, seal=seals.get(case.model_file, "")) for case in cases)
