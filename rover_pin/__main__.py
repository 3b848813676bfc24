"""The program `rover-pin`."""

import atexit
import gc
import os

from rover_pin.base.jobs.safe_environment import leave_folder_out

SELDOM = (50_000, 20, 100)
"""When garbage is collected: importing makes much and drops little, and the process's end frees all at once."""


def main() -> None:
    """Run the command line, whose imports are a tenth shorter where garbage is seldom looked for.

    Linear algebra takes one thread unless the user's environment says otherwise: more of them, which wait by spinning,
    take the cores of workers that replay (a loop on eight logs: 158 s on the clock, 114 so).
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
