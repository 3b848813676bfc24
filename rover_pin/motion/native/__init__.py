"""The step in C, one idea a file: read as one source, in this order; `step.c` has the whole in view."""

from __future__ import annotations

from importlib.resources import files

FILES = (
    "drive.h rigid.c wheel.c ground.c patch.c law.c stiffness.c states.c assembly.c judge.c motor.c springs.c body.c "
    "solve.c account.c configuration.c step.c"
).split()
"""The files of the source: each uses only what those before it define."""


def source() -> str:
    """Return the step's C source; the compiler's messages name the files."""
    folder = files("rover_pin.motion.native")
    return "".join(f'#line 1 "{name}"\n{folder.joinpath(name).read_text(encoding="utf-8")}' for name in FILES)
