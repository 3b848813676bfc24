"""The program `rover-pin`: it sets up the process and runs the command line."""

import os

from rover_pin.base.jobs.search_path import leave_search_path

leave_search_path()  # before anything else is imported, of the standard library too

import atexit  # noqa: E402
import gc  # noqa: E402

from rover_pin.base.jobs.safe_environment import leave_folder_out  # noqa: E402

SELDOM = (50_000, 20, 100)
"""Thresholds of Python's garbage collector that make it run rarely: imports create many objects and discard few, and
the end of the process frees all of them at once."""


def main() -> None:
    """Run the command line. The garbage collector runs rarely, which shortens the imports by a tenth.

    Linear algebra uses one thread, unless the user's environment states another number: further threads, which wait by
    spinning, would take processor time from worker processes that compute replays (a loop on eight logs took 158 s with
    them and 114 s without them).
    """
    if "OMP_NUM_THREADS" not in os.environ:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    leave_folder_out()
    gc.set_threshold(*SELDOM)
    atexit.register(gc.freeze)
    from rover_pin.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
