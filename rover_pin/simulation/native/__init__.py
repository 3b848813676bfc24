"""The C code of the step, of the loop over the steps, and of setting a rover down. The C files are joined to one source
in the order of `FILES`.

Start at `step.c`, whose last function is the whole step; `loop.c` calls it. `plain/step.py` contains this step in
readable Python. `dual.py` translates the C code to dual numbers, for the derivatives of a drive.
"""

from rover_pin.base.files.paths import text_of_package
from rover_pin.simulation.native.shared import header

FILES = (
    "lanes.h types.h shared.py structs.h rigid_body.c wheel.c terrain.c patch.c contact_law.c loads.c joint_forces.c "
    "solve.c step.c pace.c row.c tables.c control.c loop.c settle.c"
).split()
"""Names of the files that are joined to the C source, in this order. Each file uses only definitions of the files
before it. `shared.py` is a Python file that generates C declarations."""


def source() -> str:
    """Return the C source of the compiled step, one text with all files of FILES. Its #line directives let the
    compiler's messages state the file and the line.
    """
    return "".join(f'#line 1 "{name}"\n{file_text(name)}' for name in FILES)


def step_source() -> str:
    """Return the C source of the step without the vector functions of the laws (lanes.h), for its translation to dual
    numbers.
    """
    return "".join(file_text(name) for name in FILES if name != "lanes.h")


def file_text(name: str) -> str:
    """Return the C code of one of the FILES: the content of the file, or for shared.py the declarations that it
    generates.
    """
    return header() if name == "shared.py" else text_of_package("rover_pin.simulation.native", name)
