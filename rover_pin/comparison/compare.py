"""Two of a kind compared; what their paths hold says which kind it is."""

from enum import StrEnum
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.trust import Trust
from rover_pin.comparison import drives, models, verdicts
from rover_pin.comparison.side import Comparison
from rover_pin.logs.drive_log import FILE as DRIVE_FILE


class Kind(StrEnum):
    """What can be compared."""

    VERDICT = "a verdict"
    MODEL = "a model"
    DRIVE = "a drive"


def compare(first: str | Path, second: str | Path, run: str = "", trust: Trust = Trust()) -> Comparison:
    """Return two verdicts, two models or two drives side by side.

    Parameters
    ----------
    first, second : path
        The folder of a close-loop or its verdict.json; a model.toml; a drive log's folder or a trace in .parquet.
    run : str
        Which run of drive logs; the first if not said.
    trust : Trust
        Whether the code of a user's effects that a model names may run.

    Returns
    -------
    Comparison
        With `sentence`, `rows` and `as_dict()`.

    Raises
    ------
    DataError
        They are of two kinds, or one is none of these or cannot be read.
    """
    paths = (Path(first), Path(second))
    kinds = [kind_of(path) for path in paths]
    if kinds[0] is not kinds[1]:
        raise DataError(f"{first} is {kinds[0]}, {second} {kinds[1]}: compare two of a kind.")
    if kinds[0] is Kind.VERDICT:
        sides = [verdicts.read_verdict(path if is_file(path) else path / verdicts.FILE) for path in paths]
        return verdicts.compare_verdicts(*sides)
    if kinds[0] is Kind.MODEL:
        return models.compare_models(*(models.read_side(path, trust) for path in paths))
    return drives.compare_drives(*(drives.read_drive(path, run, trust) for path in paths))


def kind_of(path: Path) -> Kind:
    """Return what lies at a path.

    Raises DataError: nothing, or something else.
    """
    if is_file(path / verdicts.FILE) or (path.suffix == ".json" and is_file(path)):
        return Kind.VERDICT
    if is_file(path / DRIVE_FILE) or path.suffix == ".parquet":
        return Kind.DRIVE
    if path.suffix == ".toml" and is_file(path):
        return Kind.MODEL
    raise DataError(
        f"{path}: nothing to compare is there: give the folder of a close-loop ({verdicts.FILE}), a model.toml, a "
        f"drive log's folder ({DRIVE_FILE}) or a trace in .parquet."
    )
