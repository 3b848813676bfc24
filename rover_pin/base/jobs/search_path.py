"""Removes the working directory, which holds data and no code, from the folders that Python searches for modules.

This module imports only `os` and `sys`, which Python has loaded before any program begins. The program imports
everything else after it has called `leave_search_path`.
"""

import os
import sys

PYTHON_PATH = "PYTHONPATH"
"""Environment variable of Python: folders that Python searches for modules, with colons between them."""


def is_working_folder(entry: str, folder: str) -> bool:
    """Return whether an entry of a search path means the working directory `folder`, or is a path relative to it."""
    return not os.path.isabs(entry) or os.path.realpath(entry) == os.path.realpath(folder)


def is_clone(folder: str) -> bool:
    """Return whether `folder` is the clone of the repository that contains this running program."""
    clone = __file__
    for _ in ("jobs", "base", "rover_pin", "clone"):
        clone = os.path.dirname(clone)
    return os.path.realpath(folder) == os.path.realpath(clone)


def search_path_without_folder(path: str) -> str:
    """Return a value of PYTHONPATH without the entries that are relative or lead to the working directory.

    An empty entry, as in `:/opt/ros`, means the working directory. If the working directory is the clone that contains
    this program, the value is returned unchanged.
    """
    folder = os.getcwd()
    if is_clone(folder):
        return path
    return os.pathsep.join(entry for entry in path.split(os.pathsep) if not is_working_folder(entry, folder))


def leave_search_path() -> None:
    """Remove the working directory from the search path for modules, in this process and in processes that it starts.

    If the working directory is the clone that contains this program, it stays on the path.
    """
    folder = os.getcwd()
    if not is_clone(folder):
        # At its start, Python has already put the relative entries of PYTHONPATH on sys.path as absolute paths.
        relative = [entry for entry in os.environ.get(PYTHON_PATH, "").split(os.pathsep) if not os.path.isabs(entry)]
        data = {os.path.realpath(os.path.join(folder, entry)) for entry in relative}
        sys.path[:] = [
            entry for entry in sys.path if not is_working_folder(entry, folder) and os.path.realpath(entry) not in data
        ]
    # Child processes read the environment variable, so it is corrected as well.
    if PYTHON_PATH in os.environ:
        os.environ[PYTHON_PATH] = search_path_without_folder(os.environ[PYTHON_PATH])
