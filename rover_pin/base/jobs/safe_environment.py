"""Protection from code in the working directory. This directory may hold the data of another person, and code among
these data must not run.

Without protection, three mechanisms could run such code. Python puts the working directory first on the search path of
`python -m` and `python -c`, and worker processes start by such commands. An empty entry of PATH or PYTHONPATH means the
working directory. matplotlib reads ./matplotlibrc, and the settings in this file can name programs to run.
"""

import importlib
import os
import resource
import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from rover_pin.base.jobs.search_path import PYTHON_PATH, leave_search_path, search_path_without_folder

SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable of Python. If it is set, Python does not put the working directory on the search path."""
PICTURES = "matplotlib"
"""Name of the package that draws figures."""
_LOCK = threading.RLock()
"""Lock that a thread holds while it changes the environment in `safe_path`."""
_OPEN_BLOCKS: list[str] = []
"""One entry for each `safe_path` block that has not ended."""
_BEFORE: dict[str, str] = {}
"""Values of the environment variables before the first open `safe_path` block."""
MIN_MEMORY_LIMIT = 2 << 30
"""Smallest memory limit that is set for a process [bytes]. A smaller limit could stop the reading of an allowed file:
the largest allowed file and one copy of it take 2 GiB."""


def leave_folder_out() -> None:
    """Exclude code in the working directory from this process, and limit the memory of the process.

    Call this only in a process that runs the command line: it changes the environment and the search path of the
    process.
    """
    leave_search_path()
    os.environ.update(safe_environment())
    read_pictures_settings()
    bound_memory()


def safe_environment() -> dict[str, str]:
    """Return environment variables for a child process that must find no module and no program in the working
    directory.
    """
    python_path = {PYTHON_PATH: search_path_without_folder(os.environ.get(PYTHON_PATH, ""))}
    return {**os.environ, **python_path, SAFE_PATH: "1", "PATH": _absolute(os.environ.get("PATH", os.defpath))}


def program(name: str) -> str | None:
    """Return the absolute path of a program on the search path (PATH), or None if there is no such program.

    The working directory is not searched, but `name` may be the path of a program in it.
    """
    path = shutil.which(name, path=safe_environment()["PATH"])
    return path and os.path.abspath(path)


@contextmanager
def safe_path() -> Iterator[None]:
    """Prevent Python processes that start inside this `with` block from importing modules of the working directory.

    Several blocks may be open and may end in any order, as blocks in generators do. When the last block has ended, the
    environment from before the first block is restored.
    """
    # The first open block stores the environment, and the last one to end restores it.
    with _LOCK:
        if not _OPEN_BLOCKS:
            _BEFORE.update({name: value for name, value in os.environ.items() if name in (SAFE_PATH, PYTHON_PATH)})
        _OPEN_BLOCKS.append(SAFE_PATH)
        os.environ[SAFE_PATH] = "1"
        if PYTHON_PATH in os.environ:
            os.environ[PYTHON_PATH] = search_path_without_folder(os.environ[PYTHON_PATH])
    try:
        yield
    finally:
        with _LOCK:
            _OPEN_BLOCKS.pop()
            if not _OPEN_BLOCKS:
                os.environ.pop(SAFE_PATH, None)
                os.environ.update(_BEFORE)  # including PYTHONPATH
                _BEFORE.clear()


def read_pictures_settings() -> None:
    """Import matplotlib from the root folder if the working directory has a file `matplotlibrc`.

    matplotlib would read this file at import, and its settings may name programs that matplotlib runs.
    """
    if PICTURES in sys.modules or not os.path.lexists("matplotlibrc"):
        return
    working_folder = os.open(".", os.O_RDONLY)
    try:
        os.chdir(os.sep)
        importlib.import_module(PICTURES)
    finally:
        os.fchdir(working_folder)
        os.close(working_folder)


@lru_cache(maxsize=1)
def bound_memory(workers: int = 1) -> None:
    """Limit the memory of this process, and of each process that it starts, to 1 / (`workers` + 1) of the machine's
    memory.

    A process that needs more gets a MemoryError, and the machine stays usable. The limit applies to the memory that a
    process writes to (RLIMIT_DATA). A limit on addresses (RLIMIT_AS) would be wrong, because libraries reserve far more
    addresses than they use.
    """
    # One share of the memory is left for this process and for the rest of the machine.
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    share = max(machine // (workers + 1), MIN_MEMORY_LIMIT)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    bounds = [limit for limit in (share, soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(bounds), hard))


def _absolute(path: str) -> str:
    """Return a search path for programs (a value of PATH) without its relative entries."""
    return os.pathsep.join(filter(os.path.isabs, path.split(os.pathsep))) or os.defpath
