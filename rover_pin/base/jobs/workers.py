"""Worker processes end with the program that started them, however it is asked to end."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import import_module
from types import FrameType, ModuleType
from typing import Any

from rover_pin.base.jobs.safe_environment import bound_memory, read_pictures_settings

LOOKED = 1.0
"""Time [s] between a worker's looks at whether its program is still there."""


class Terminated(SystemExit):
    """The program was asked to end by SIGTERM."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


@contextmanager
def ending_workers() -> Iterator[None]:
    """Let SIGTERM raise `Terminated` in this block; when that or Ctrl-C ends it, no worker process goes on.

    A handler of the program's own stays, and in another thread than the main one there can be none.
    """
    handles_term = (
        threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    )
    if handles_term:
        signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if handles_term:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would end this by a traceback
        _end_all()
        raise
    finally:
        if handles_term:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def working_for(program: int, workers: int, function: Callable[..., Any], *job: Any) -> Any:
    """Return `function(*job)`, in one of `workers` processes, which end when the process `program` is gone.

    A program that is killed outright (SIGKILL, no memory left) cannot end its workers itself.
    """
    if os.getpid() != program:
        _follow(program, workers)
    return function(*job)


@lru_cache(maxsize=1)
def _follow(program: int, workers: int) -> None:
    read_pictures_settings()
    bound_memory(workers)
    threading.Thread(target=_end_after, args=(program,), daemon=True).start()


def _end_after(program: int) -> None:
    while os.getppid() == program:
        time.sleep(LOOKED)
    os._exit(1)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated


def _end_all() -> None:
    """End joblib's processes, if it has started any."""
    if "joblib.externals.loky" in sys.modules:
        from joblib.externals.loky import get_reusable_executor

        get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)


def sent_by_value(module: ModuleType) -> None:
    """Let worker processes be sent what a module defines: they cannot import one that was read from a user's file."""
    for name in ("joblib.externals.cloudpickle", "cloudpickle"):  # joblib before 1.6 brings its own; Dask's
        with suppress(ImportError):
            import_module(name).register_pickle_by_value(module)
