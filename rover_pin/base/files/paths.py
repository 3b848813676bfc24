"""Paths that come from a user or a data set: whether they exist, how one file refers to another, and names of samples.

The samples are the measured data sets that come with the package. A command finds them by name from any folder.
"""

import os
from importlib.resources import files
from pathlib import Path

from rover_pin.base.errors import closest


def is_file(path: Path) -> bool:
    """Return whether the path is a file.

    For a name that no file can have, such as one of 5,000 letters, the result is False; `Path.is_file` raises an error.
    """
    try:
        return path.is_file()
    except OSError:
        return False


def is_folder(path: Path) -> bool:
    """Return whether the path is a folder.

    For a name that no folder can have, such as one of 5,000 letters, the result is False.
    """
    try:
        return path.is_dir()
    except OSError:
        return False


def exists(path: Path) -> bool:
    """Return whether the path is a file or a folder.

    For a name that no file and no folder can have, such as one of 5,000 letters, the result is False.
    """
    return is_file(path) or is_folder(path)


def named_from(folder: Path, name: str | Path) -> str:
    """Return the text that a file in `folder` has to contain in order to refer to another file: the path from that
    folder.

    If `name` is not the path of an existing file, for example because it is the name of a rover of the package, `name`
    is returned unchanged.
    """
    return os.path.relpath(Path(name).resolve(), folder.resolve()) if is_file(Path(name)) else str(name)


def text_of_package(folder: str, name: str) -> str:
    """Return the text of a file that is installed with the package, such as `panel.css` in the folder `rover_pin.view`.

    `folder` is written with dots, like a module; `name` is the name of the file.
    """
    return files(folder).joinpath(name).read_text(encoding="utf-8")


def sample_folder() -> Path:
    """Return the folder of the sample data sets: `samples` in an installed package, `studies/data` in a clone of the
    repository.
    """
    # In a clone of the repository, the samples lie outside the package.
    package = Path(str(files("rover_pin")))
    inside = package / "samples"
    return inside if inside.is_dir() else package.parent / "studies" / "data"


def sample_names() -> list[str]:
    """Return the sorted names of the measured data sets that come with the package."""
    return sorted(folder.name for folder in sample_folder().iterdir() if folder.is_dir())


def data_path(location: str | Path) -> Path:
    """Return the path of a data set from the path or the sample name that a user gave.

    If the path `location` exists, it is returned. Otherwise, if the package has a sample of this name, the path of the
    sample is returned. Otherwise `location` is returned unchanged, and the caller reports that the data are missing.

    Examples
    --------
    >>> data_path("cmu-grousered-wheel").is_dir()  # a sample of the package
    True
    >>> data_path("no/such/data").as_posix()
    'no/such/data'
    """
    path = Path(location)
    sample = sample_folder() / path
    # An absolute path or a path with '..' cannot name a sample, and must not lead out of the samples' folder.
    is_named = path.parts and not path.is_absolute() and ".." not in path.parts
    return sample if is_named and not exists(path) and exists(sample) else path


def closest_samples(location: str | Path) -> str:
    """Return the last sentence of an error about missing data. It lists the sample data sets with similar names.

    `location` is the path that the user gave. The text is empty if this path exists, or if it has several parts,
    because a sample's name has only one part.
    """
    path = Path(location)
    if len(path.parts) > 1 or exists(path):
        return ""
    return f" If you meant the name of a sample: {closest(path, sample_names())}"
