"""Without vector math the step and the laws are compiled from the same source, and drive the same."""

import subprocess
import sys

import numpy as np
import pytest

DRIVE = """
import sys
import numpy as np
from rover_pin.simulation.compiled import toolchain
if sys.argv[1] == "scalar":
    toolchain.has_vector_math = lambda: False
assert any("LIBMVEC" in flag for flag in toolchain.fast_flags(["cc"])) is (sys.argv[1] == "lanes" and VECTORS)
from rover_pin.scenarios.scenario import scenario
case = scenario("ditch", duration=0.5)
np.savez(sys.argv[2], **case.drive().channels)
"""


@pytest.mark.slow
def test_a_drive_without_vector_math_is_the_same(tmp_path):
    """What 100 steps make of other rounding stays below 1e-11 of what a channel reaches."""
    from rover_pin.simulation.compiled.toolchain import has_vector_math, level

    vectors = bool(level() and has_vector_math())
    code = DRIVE.replace("VECTORS", str(vectors))
    for how in ("lanes", "scalar"):
        subprocess.run([sys.executable, "-c", code, how, str(tmp_path / how)], check=True, timeout=300)
    lanes, scalar = (np.load(tmp_path / f"{how}.npz") for how in ("lanes", "scalar"))
    for name in lanes.files:
        scale = max(float(np.max(np.abs(lanes[name]))), 1e-3)
        assert float(np.max(np.abs(lanes[name] - scalar[name]))) < 1e-11 * scale, name
