"""The step in C, one idea a file: read as one source, in this order; `step.c` has the whole in view."""

from rover_pin.base.files.paths import text_of_package
from rover_pin.simulation.native.shared import header

FILES = (
    "lanes.h types.h shared.py drive.h system.h rigid.c wheel.c lanes.c grid.c arc.c patch.c law.c stiffness.c "
    "spots.c states.c assembly.c judge.c motor.c springs.c body.c solve.c account.c configuration.c step.c "
    "pace.c row.c tables.c control.c loop.c settle.c"
).split()
"""The files of the source: each uses only what those before it define."""


def source() -> str:
    """Return the step's C source; the compiler's messages name the files."""
    return "".join(f'#line 1 "{name}"\n{_text(name)}' for name in FILES)


def _text(name: str) -> str:
    """Return what a file declares: a C file itself, of shared.py what it writes."""
    return header() if name == "shared.py" else text_of_package("rover_pin.simulation.native", name)
