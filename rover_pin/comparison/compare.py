"""Compare two verdicts, two models or two drives. The files at the two paths decide which of the three are compared."""

from enum import StrEnum
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.trust import Trust
from rover_pin.comparison import drives, models, verdicts
from rover_pin.comparison.side import Comparison
from rover_pin.logs.drive_log import FILE as DRIVE_FILE


class Comparable(StrEnum):
    """The kinds of results that `compare` can compare. The value is the name of the kind in error messages."""

    VERDICT = "a verdict"
    MODEL = "a model"
    DRIVE = "a drive"


def compare(first: str | Path, second: str | Path, run: str = "", trust: Trust = Trust()) -> Comparison:
    """Compare two verdicts, two models or two drives.

    Parameters
    ----------
    first, second : path
        Two paths with results of one kind. A verdict is the results folder of a close-loop run or its verdict.json, a
        model is a model.toml, and a drive is the folder of a drive log or a trace in .parquet.
    run : str
        Name of the run to compare, for drive logs with several runs; by default the first run.
    trust : Trust
        Whether the code of user-supplied effects that a model names may run.

    Returns
    -------
    Comparison
        With `sentence`, `rows` and `as_dict()`. Differences are second minus first.

    Raises
    ------
    DataError
        If the paths hold results of different kinds or nothing that can be compared, or if a file cannot be read.

    Examples
    --------
    >>> from rover_pin.comparison.compare import compare
    >>> print(compare("out/monday/model.toml", "out/tuesday/model.toml").sentence)  # doctest: +SKIP
    """
    paths = (Path(first), Path(second))
    kinds = [kind_of(path) for path in paths]
    if kinds[0] is not kinds[1]:
        raise DataError(f"{first} is {kinds[0]}, but {second} is {kinds[1]}: compare two of the same kind.")
    if kinds[0] is Comparable.VERDICT:
        sides = [verdicts.read_verdict(path if is_file(path) else path / verdicts.FILE) for path in paths]
        return verdicts.compare_verdicts(*sides)
    if kinds[0] is Comparable.MODEL:
        return models.compare_models(*(models.read_side(path, trust) for path in paths))
    return drives.compare_drives(*(drives.read_drive(path, run, trust) for path in paths))


def kind_of(path: Path) -> Comparable:
    """Return whether a path holds a verdict, a model or a drive.

    Raises DataError if the path holds none of these.
    """
    # A results folder also holds model.toml, so the verdict is looked for first.
    if is_file(path / verdicts.FILE) or (path.suffix == ".json" and is_file(path)):
        return Comparable.VERDICT
    if is_file(path / DRIVE_FILE) or path.suffix == ".parquet":
        return Comparable.DRIVE
    if path.suffix == ".toml" and is_file(path):
        return Comparable.MODEL
    raise DataError(
        f"{path}: there is nothing to compare at this path. Give the folder of a close-loop ({verdicts.FILE}), a "
        f"model.toml, the folder of a drive log ({DRIVE_FILE}) or a trace in .parquet."
    )
