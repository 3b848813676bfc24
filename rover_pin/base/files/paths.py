"""Whether there is a file of a name that a user gave, and how another file names it."""

import os
from importlib.resources import files
from pathlib import Path


def is_file(path: Path) -> bool:
    """Return whether this is a file; False too where no file can have such a name, which `Path.is_file` raises for."""
    try:
        return path.is_file()
    except OSError:
        return False


def exists(path: Path) -> bool:
    """Return whether this is a file or folder; False too where none can have such a name."""
    return is_file(path) or is_folder(path)


def is_folder(path: Path) -> bool:
    """Return whether this is a folder; False too where none can have such a name."""
    try:
        return path.is_dir()
    except OSError:
        return False


def named_from(folder: Path, name: str | Path) -> str:
    """Return how a file in this folder names what a user gave: a file by the way to it, anything else as it is."""
    return os.path.relpath(Path(name).resolve(), folder.resolve()) if is_file(Path(name)) else str(name)


def text_of_package(folder: str, name: str) -> str:
    """Return a text file that comes with the package, by its folder as a module's name."""
    return files(folder).joinpath(name).read_text(encoding="utf-8")
