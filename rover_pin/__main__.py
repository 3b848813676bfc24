"""The program `rover-pin`."""

import atexit
import gc

from rover_pin.base.jobs.safe_environment import leave_folder_out

SELDOM = (50_000, 20, 100)
"""When garbage is collected: importing makes much and drops little, and the process's end frees all at once."""


def main() -> None:
    """Run the command line, whose imports are a tenth shorter where garbage is seldom looked for."""
    leave_folder_out()
    gc.set_threshold(*SELDOM)
    atexit.register(gc.freeze)
    from rover_pin.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
