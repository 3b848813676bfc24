"""Worker processes that end together with the program that started them, even if the program is killed."""

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

SECONDS_BETWEEN_LOOKS = 1.0
"""Interval at which a worker process checks whether the program that started it is still running [s]. After the program
was killed, its workers take computing time and memory for at most this interval."""


class Terminated(SystemExit):
    """Raised when the program is asked to end by the signal SIGTERM."""

    def __init__(self) -> None:
        super().__init__(128 + signal.SIGTERM)


@contextmanager
def ending_workers() -> Iterator[None]:
    """Make SIGTERM raise `Terminated` inside this `with` block. If SIGTERM or Ctrl-C ends the block, all worker
    processes are ended too.

    If the program has its own handler of SIGTERM, or if this thread is not the main thread, SIGTERM is not handled
    here.
    """
    # Only the main thread may set a handler, and a program that embeds this package keeps its own handler.
    handles_term = (
        threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    )

    def terminate(number: int, frame: FrameType | None) -> None:
        raise Terminated

    if handles_term:
        signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if handles_term:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second signal would end the clean-up with a traceback
        if "joblib.externals.loky" in sys.modules:  # otherwise no worker was started
            from joblib.externals.loky import get_reusable_executor

            get_reusable_executor(reuse=True).shutdown(wait=True, kill_workers=True)
        raise
    finally:
        if handles_term:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def working_for(program: int, workers: int, function: Callable[..., Any], *job: Any) -> Any:
    """Return `function(*job)`, computed in a worker process that ends when the program that started it has ended.

    A program that is killed outright (by SIGKILL, or for lack of memory) cannot end its workers. Therefore a worker
    starts at its first job to watch the program, and ends when the program is gone.

    Parameters
    ----------
    program : int
        Process number of the program that started the worker.
    workers : int
        Number of worker processes, which determines the memory limit of each.
    function, *job
        The function to call, and its arguments.
    """
    if os.getpid() != program:
        _follow(program, workers)
    return function(*job)


@lru_cache(maxsize=1)
def _follow(program: int, workers: int) -> None:
    """Prepare this worker process once: limit its memory, and start a thread that watches the program.

    `program` is the process number of the program that started the worker, and `workers` is the number of workers.
    """

    def end_after_program() -> None:
        # When the program has ended, the system gives this process another parent.
        while os.getppid() == program:
            time.sleep(SECONDS_BETWEEN_LOOKS)
        os._exit(1)

    read_pictures_settings()
    bound_memory(workers)
    threading.Thread(target=end_after_program, daemon=True).start()


def sent_by_value(module: ModuleType) -> None:
    """Register a module whose functions and classes are sent to worker processes as code, not as a name to import.

    A module that was loaded from a user's file needs this, because the worker processes cannot import it.
    """
    for name in ("joblib.externals.cloudpickle", "cloudpickle"):
        with suppress(ImportError):
            import_module(name).register_pickle_by_value(module)
