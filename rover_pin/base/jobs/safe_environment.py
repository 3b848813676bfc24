"""The working directory holds data: no program, module or setting of it is taken by us or our children.

Python puts the working directory first on the path of `python -m` and `python -c`, by which worker processes and their
trackers start; a shell does so for an empty entry of PATH, and matplotlib reads ./matplotlibrc.
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
from pathlib import Path

SAFE_PATH = "PYTHONSAFEPATH"
PICTURES = "matplotlib"
_LOCK = threading.RLock()
_OPEN_BLOCKS: list[str] = []
_BEFORE: dict[str, str] = {}
LEAST_SHARE = 2 << 30
"""Bytes that any process may have: the largest file that is read (`bounded`), and as much to work with it."""


def leave_folder_out() -> None:
    """Take nothing from the working directory from now on, and bound our memory: for a process that is ours alone."""
    package_root = str(Path(__file__).parents[1])
    if not sys.flags.safe_path and sys.path[:1] in ([""], [os.getcwd()]) and os.getcwd() != package_root:
        del sys.path[0]
    os.environ.update(safe_environment())
    read_pictures_settings()
    bound_memory()


def safe_environment() -> dict[str, str]:
    """Return our environment, with which a child finds no module and no program in the working directory."""
    return {**os.environ, SAFE_PATH: "1", "PATH": _absolute(os.environ.get("PATH", os.defpath))}


def program(name: str) -> str | None:
    """Return the path of a program, or None; one in the working directory only where its name says so."""
    path = shutil.which(name, path=safe_environment()["PATH"])
    return path and os.path.abspath(path)


@contextmanager
def safe_path() -> Iterator[None]:
    """Let the Python processes that start in this block, also by themselves, import nothing from here.

    Blocks may end in any order, as those of generators do: what stood before the first comes back after the last.
    """
    with _LOCK:
        if not _OPEN_BLOCKS:
            _BEFORE.update({name: value for name, value in os.environ.items() if name == SAFE_PATH})
        _OPEN_BLOCKS.append(SAFE_PATH)
        os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        with _LOCK:
            _OPEN_BLOCKS.pop()
            if not _OPEN_BLOCKS:
                os.environ.pop(SAFE_PATH, None)
                os.environ.update(_BEFORE)
                _BEFORE.clear()


def read_pictures_settings() -> None:
    """Import matplotlib where it does not see a ./matplotlibrc, which names programs to run; no cost where none is."""
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
    """Bound the memory of this process and of each that it starts to a share: one of as many as work, and one more.

    What is bounded is what a process writes (RLIMIT_DATA): of addresses alone (RLIMIT_AS), libraries reserve far more
    than they use. Beyond it a MemoryError is raised, and the machine goes on.
    """
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    share = max(machine // (workers + 1), LEAST_SHARE)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    bounds = [limit for limit in (share, soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(bounds), hard))


def _absolute(path: str) -> str:
    return os.pathsep.join(filter(os.path.isabs, path.split(os.pathsep))) or os.defpath
