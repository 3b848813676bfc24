"""Without vector functions, and in the portable mode, step and laws are compiled from an equal source, and drive
equally.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

DRIVE = """
import sys
import numpy as np
from rover_pin.simulation.compiled import toolchain
commands = []
run = toolchain.subprocess.run
toolchain.subprocess.run = lambda command, **named: commands.append(command) or run(command, **named)
if sys.argv[1] == "scalar":
    toolchain.has_vector_math = lambda: False
from rover_pin.scenarios.scenario import scenario
case = scenario("ditch", duration=0.5)
np.savez(sys.argv[2], **case.drive().channels)
# In an empty folder for libraries everything is compiled: for this processor, or for every one.
for_this = [any(word.startswith("-march") for word in command) for command in commands]
vectors = [any("mvec" in word.lower() for word in command) for command in commands]
assert commands and {*for_this, *vectors} == {sys.argv[1] == "lanes" and VECTORS}
"""


@pytest.mark.slow
def test_a_drive_without_vector_math_is_the_same(tmp_path):
    """Other rounding changes a channel within 100 steps by less than 1e-11 of its largest value."""
    from rover_pin.simulation.compiled.toolchain import has_vector_math, level

    vectors = bool(level() and has_vector_math())
    code = DRIVE.replace("VECTORS", str(vectors))
    for path in ("lanes", "scalar", "portable"):
        variables = {**os.environ, "ROVER_PIN_CACHE": str(tmp_path / f"cache-{path}"), "ROVER_PIN_PORTABLE": "0"}
        variables |= {"ROVER_PIN_PORTABLE": "1"} if path == "portable" else {}
        (tmp_path / f"cache-{path}").mkdir(mode=0o700)
        subprocess.run([sys.executable, "-c", code, path, str(tmp_path / path)], check=True, timeout=300, env=variables)
    lanes, scalar, portable = (np.load(tmp_path / f"{path}.npz") for path in ("lanes", "scalar", "portable"))
    for name in lanes.files:
        scale = max(float(np.max(np.abs(lanes[name]))), 1e-3)
        assert float(np.max(np.abs(lanes[name] - scalar[name]))) < 1e-11 * scale, name
        # The same options of the compiler and the same processor give the same bits.
        np.testing.assert_array_equal(portable[name], scalar[name], err_msg=name)
