"""The compiled step as a library."""

import ctypes
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native import source
from rover_pin.simulation.native.shared import DriveStruct


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL:
    """Return the compiled kernel."""
    handle = shared_library(source(), "kernel")
    handle.rover_pin_step.argtypes = [ctypes.c_void_p]
    handle.rover_pin_energies.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    handle.rover_pin_energies.restype = None
    handle.rover_pin_hold.argtypes = [ctypes.c_void_p]
    handle.rover_pin_hold.restype = None
    handle.rover_pin_run.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    handle.rover_pin_row.argtypes = [ctypes.c_void_p] * 3
    handle.rover_pin_row.restype = None
    handle.rover_pin_set_down.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    handle.rover_pin_sizes.argtypes = [ctypes.c_void_p]
    handle.rover_pin_sizes.restype = None
    assert step_layout(handle).drive == ctypes.sizeof(DriveStruct), "this compiler lays the struct Drive out otherwise"
    return handle


class StepLayout(NamedTuple):
    """What the compiled step says of itself: bytes of its structs, most questions to the laws at once, lanes."""

    drive: int
    step: int
    questions: int
    lanes: int


def step_layout(handle: ctypes.CDLL) -> StepLayout:
    """Return the sizes of a compiled step."""
    counts = np.zeros(4, dtype=np.int64)
    handle.rover_pin_sizes(counts.ctypes.data)
    return StepLayout(*counts.tolist())


def aligned_zeros(count: int) -> np.ndarray:
    """Return `count` zeros that begin where a row of lanes may begin."""
    room = np.zeros(count + 8)
    return room[(-room.ctypes.data // 8) % 8 :][:count]
