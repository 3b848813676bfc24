"""The belief in C: its source, its struct, and the arrays that it works with."""

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native import lanes
from rover_pin.simulation.native.library import aligned_zeros
from rover_pin.simulation.native.shared import fill, members, struct_fields

PARTICLES = 200
LENGTHS = {
    "MAX_WHEELS": 48, "N_FACTORS": 201, "WINDOW": 16, "POSTURE": 8, "RECENT": 4, "LEAST_ROWS": 6,
    "STILL": 8, "PAST": 17,
}  # fmt: skip
"""Samples from which rates, posture, torques and rim speeds are taken; strides of 0.25 s that are looked back."""
THRESHOLDS = {"LEAST_LOAD": 0.5, "LEAST_RIM": 5e-4, "BENT": 0.04, "STANDING": 0.12}
"""Load [N] and rim speed [m/s] that tell something; bend that counts; u / (r omega) below which a rover stands."""
UNDER = "SLOPE LEVEL LOAD AHEAD RISE SWING HEIGHT".split()

FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_uint64, {"random": ""}, "unsigned long long {}"),
    (
        ctypes.c_int64,
        {"n N n_posture lag stride": "", "count k backwards folds no_progress": "samples kept, and in all"},
        "integer {}",
    ),
    (
        ctypes.c_double,
        {
            "period torque_per_current most_factor floor wall_gain least_roll settled odometry_sd": "",
            "strength correlated fold_correlated wall_share wander surprise stalls wall_stalls frees": "of `laws.py`",
            "wall bend reference rolled stuck speed pace": "pace: median of the rims' speeds",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "radius factors": "of each wheel; F over slips of -1 to 1",
            "samples mean rates under": "",
            "torque rim factor tells": "of each wheel",
            "share stalled travel way log_weight weight odds chance": "of each particle",
            "slip hole": "of each wheel, a row of particles each",
            "way_then travel_then past": "",
            "told": "4 a wheel: slip, its SD, hole, its SD",
            "work_w": "",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"parent work_i": ""}, "integer *{}"),
]


class BeliefStruct(ctypes.Structure):
    """The struct Belief."""

    _fields_ = struct_fields(FIELDS)


class Compiled(NamedTuple):
    """A belief's functions, and the room that the expression of the ground works in."""

    library: ctypes.CDLL
    work: tuple[int, int]


def compile_belief(ground: ca.Function, laws: Sequence[ca.Function]) -> Compiled:
    """Return `belief.c` with the ground of a rover and the laws, compiled."""
    handle = shared_library(_source(ground, laws), "belief")
    handle.rover_pin_sense.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_double]
    handle.rover_pin_sense.restype = handle.rover_pin_forget.restype = None
    handle.rover_pin_forget.argtypes = [ctypes.c_void_p]
    return Compiled(handle, (ground.sz_iw(), ground.sz_w()))


def row_lengths(wheels: int, links: int, lag: int) -> dict[str, int]:
    """Return the lengths of the arrays of `double` that a belief works with, but for `told` and `work_w`."""
    posture, many = 2 + links, PARTICLES
    sample = posture + 2 * wheels
    rows = {"mean": sample, "rates": posture, "samples": LENGTHS["WINDOW"] * sample, "under": len(UNDER) * wheels}
    rows |= dict.fromkeys("torque rim factor tells".split(), wheels)
    rows |= dict.fromkeys("share stalled travel way log_weight weight odds chance".split(), many)
    past, lags = LENGTHS["PAST"], lag + 1
    rows |= {"past": past * (wheels + 2), "way_then": past * many, "travel_then": lags * many}
    return rows | {"slip": wheels * many, "hole": wheels * many}


class Belief:
    """A belief in C: its numbers are given, its arrays are here."""

    def __init__(self, functions: Compiled, wheels: int, links: int, lag: int, **numbers: Any):
        self._sizes = functions, wheels, links, lag
        self._library = functions.library
        self.struct = BeliefStruct()
        self.keep: dict[str, Any] = {}
        self.numbers = numbers
        self.sample = np.zeros(2 + links + 2 * wheels)
        self.told = np.zeros((wheels, 4))
        rows = row_lengths(wheels, links, lag) | {"work_w": functions.work[1]}
        integers = {"parent": PARTICLES, "work_i": functions.work[0] + 1}
        rows_of_integers = {name: np.zeros(size, dtype=np.int64) for name, size in integers.items()}
        counts = {"n": wheels, "N": PARTICLES, "n_posture": 2 + links, "lag": lag, "told": self.told}
        fill(
            self.struct,
            self.keep,
            {name: aligned_zeros(size) for name, size in rows.items()} | rows_of_integers | counts | numbers,
        )
        self._address = ctypes.addressof(self.struct)
        self.forget()

    def __deepcopy__(self, memo: dict[int, Any]) -> "Belief":
        """Return another that believes the same; the struct holds addresses, which a copy of it would share."""
        twin = Belief(*self._sizes, **self.numbers)
        for name, values in self.keep.items():
            twin.keep[name][...] = values
        for name, kind in BeliefStruct._fields_:
            if kind is not ctypes.c_void_p:
                setattr(twin.struct, name, getattr(self.struct, name))
        twin.sample[:] = self.sample
        return twin

    @property
    def addresses(self) -> tuple[int, int]:
        """Those of the function that takes a sample in, and of the struct."""
        return ctypes.cast(self._library.rover_pin_sense, ctypes.c_void_p).value or 0, self._address

    @property
    def p_stands(self) -> int:
        """The address of the probability that the rover stands."""
        return self._address + BeliefStruct.stuck.offset

    def forget(self) -> None:
        """Begin anew."""
        self._library.rover_pin_forget(self._address)

    def sense(self, backwards: bool, late: float) -> None:
        """Take `sample` in: posture, wheel rates, currents; `late` is a speed of `lag` samples ago, or NaN."""
        self._library.rover_pin_sense(self._address, self.sample.ctypes.data, backwards, late)


def c_source() -> str:
    """Return `belief.c` with what it shares with the monitor."""
    return "\n".join(text_of_package("rover_pin.control.sensing", name) for name in ("draws.c", "belief.c"))


def constants() -> str:
    """Return the C definitions that `belief.c` is written with."""
    lines = [f"#define {name} {value!r}" for name, value in (LENGTHS | THRESHOLDS).items()]
    return "\n".join([*lines, f"enum {{ {', '.join(UNDER)} }};"])


def _source(ground: ca.Function, laws: Sequence[ca.Function]) -> str:
    lines = [lanes.header(), generated_source(ground), "typedef int64_t integer;", "typedef double real;"]
    lines += ["typedef void (*lanes_law)(const double *, const double *, double *);"]
    lines += [constants(), "typedef struct {", *members(FIELDS), "} Belief;"]
    lines += [lanes.c_source(law, shared=(1,)) for law in laws]
    return "\n".join([*lines, c_source()])
