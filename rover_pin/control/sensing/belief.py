"""The memory of the on-board slip estimate, a particle filter in C: its C source, its struct, and its arrays.

`belief.c` is the filter. `OnboardSlip` sets its constants and gives it a sample of the sensors in every control period.
"""

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.simulation.compiled.kernel import aligned_zeros
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native import lanes
from rover_pin.simulation.native.shared import fill, members, struct_fields

PARTICLES = 216
"""Number of particles of the filter that estimates the slip on board. They are in blocks of equal size, one for each
soil that the filter considers, so that the number is a multiple of the number of soils times the SIMD lanes."""
LENGTHS = {
    "MAX_WHEELS": 48,  # largest number of wheels of a rover
    "N_FACTORS": 201,  # slips at which the torque factor F is tabulated
    "WINDOW": 16,  # samples from which the rates of the posture are computed
    "POSTURE": 8,  # latest samples of which the posture is the mean
    "RECENT": 4,  # latest samples of which wheel rates and currents are the mean
    "MIN_ROWS": 6,  # samples from which on the rates of the posture are used
    "STILL": 8,  # strides over which the posture is compared for `still_law`
    "PAST": 17,  # strides that are kept, the present one included
}
"""Sizes of the filter's arrays, in samples or in strides. A stride is the time between two postures (roll, pitch and
suspension angles) of the rover that the filter compares, `STRIDE` = 0.25 s in `onboard_slip.py`."""
THRESHOLDS = {
    "MIN_LOAD": 0.5,  # load of a wheel below which its torque is not used [N]
    "MIN_RIM": 5e-4,  # rim speed of a wheel below which its torque is not used [m/s]
    "MIN_BEND": 0.04,  # bend of the ground below which the ground counts as even [-]
    "LEAST_ODDS": 0.05,  # least probability of a soil, relative to the most probable soil
    "STANDING_RATIO": 0.12,  # a particle counts as standing below this ratio of its speed u to r omega [-]
}
"""Limits that decide which readings the particle filter uses, and which particles count as not moving."""
UNDER = "SLOPE LEVEL LOAD AHEAD RISE SWING HEIGHT".split()
"""Names of the rows in the filter's array `under`, which has one value for each wheel in each row. The rows are the
fields of `UnderWheels` in `ground.py`."""

FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_uint64, {"random": "state of the random numbers"}, "unsigned long long {}"),
    (
        ctypes.c_int64,
        {
            "n": "wheels",
            "N": "particles",
            "n_soils": "soils that the filter considers, each with a block of N / n_soils particles",
            "n_posture": "numbers in a posture: roll, pitch and the suspension angles",
            "lag": "delay of visual odometry [samples]",
            "stride": "samples between two postures that are compared",
            "count": "samples that are kept, at most WINDOW",
            "k": "samples since the start",
            "backwards": "1: the duties drive the rover backwards",
            "rates_known": "1: enough samples are kept for the rates of the posture",
            "no_progress": "1: the posture shows that the rover does not move although its rims turn",
        },
        "integer {}",
    ),
    (
        ctypes.c_double,
        {
            "period": "time between two samples [s]",
            "torque_per_current": "[N m/A]",
            "max_factor": "largest torque factor F of the soil, mean over the soils [-]",
            "memory": "time in which the evidence for a soil is forgotten [s]",
            "resistance": "motion resistance R, as a fraction of the weight",
            "resistance_sd": "SD of the resistance to motion; 0: the balance of forces is not used",
            "torque_sd": "relative SD of all torques in common, because of the torque constant",
            "hole_length": "travel over which a wheel climbs out of its hole [m]",
            "balance_correlated": "balances of forces within this time have one error [s]",
            "floor": "smallest rim speed of which the speeds of the particles are multiples [m/s]",
            "wall_gain": "weight of a sample in the low-pass filter of `wall`",
            "min_roll": "rim travel without progress after which the rover counts as standing [m]",
            "settled": "change of the posture below which there is no progress [m]",
            "odometry_sd": "SD of the speed by visual odometry [m/s]",
            "strength": "relative error of the soil's law and of the loads",
            "correlated": "torques within this time have one error [s]",
            "rise_correlated": "rises of the wheels within this time have one error [s]",
            "wall_error": "relative error of all torque factors where a wheel is at a wall",
            "wander": "SD of the change of u / (r omega) within a second",
            "surprise": "rate of jumps to any speed [1/s]",
            "stalls": "rate at which a moving rover stalls [1/s]",
            "wall_stalls": "additional rate of stalling at a wall [1/s]",
            "frees": "rate at which a stalled rover comes free [1/s]",
            "wall": "0: no wheel is at a wall; 1 and above: a wheel is",
            "bend": "bend of the ground: mean distance of the slopes from their median [-]",
            "reference": "signed rim speed of which the speeds of the particles are multiples [m/s]",
            "rolled": "travel of the rims since the start [m]",
            "stuck": "probability that the rover does not move",
            "speed": "mean forward speed of the particles [m/s]",
            "pace": "median of the rim speeds [m/s]",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "radius": "(n) wheel radii [m]",
            "factors": "(n_soils, N_FACTORS) torque factor F of each soil over slips from -1 to 1",
            "softness": "(n_soils) shear displacement k over strength, relative to the mean soil",
            "greatest": "(n_soils) largest torque factor F of each soil",
            "p_soil": "(n_soils) probability of each soil",
            "samples": "(WINDOW, sample) latest samples",
            "mean": "(sample) means over the latest samples",
            "rates": "(n_posture) rates of the posture [rad/s]",
            "under": "(rows, n) ground under the wheels, in the rows SLOPE to HEIGHT",
            "torque": "(n) torques of the motors at the wheels [N m]",
            "rim": "(n) rim speeds over the ground [m/s]",
            "factor": "(n) measured torque factors T / (r W)",
            "informative": "(n) 1: the torque of the wheel is used",
            "ratio": "(N) u / (r omega), speed over `reference`",
            "stalled": "(N) 1: the particle is stalled",
            "travel": "(N) forward speed u [m/s]",
            "distance": "(N) distance since the start [m]",
            "log_weight": "(N) logarithms of the weights",
            "weight": "(N) weights, sum 1",
            "likelihood": "(N) product of the densities of the torques; also memory for one step",
            "chance": "(N) random numbers; also memory for one step",
            "slip": "(n, N) slip of each wheel",
            "hole": "(n, N) depth of the hole of each wheel [m]",
            "past_distance": "(PAST, N) `distance` at earlier strides [m]",
            "past_travel": "(lag + 1, N) `travel` at earlier samples [m/s]",
            "past": "(PAST, n + 2) heights of the wheels, bend and rim travel at earlier strides",
            "estimates": "(n, 4) mean slip, its SD, mean depth of the hole [m], its SD [m]",
            "work_w": "work array of the ground's expression",
        },
        "double *{}",
    ),
    (
        ctypes.c_void_p,
        {"parent": "(N) particle that each new particle copies", "work_i": "work array of the ground's expression"},
        "integer *{}",
    ),
]
"""Fields of the C struct Belief, in groups of one type: the ctypes type, the names with their meaning, and the C
declaration."""
WHEEL_ROWS = "torque rim factor informative".split()
PARTICLE_ROWS = "ratio stalled travel distance log_weight weight likelihood chance".split()


class BeliefStruct(ctypes.Structure):
    """The C struct Belief, the memory of the particle filter, as a ctypes structure of equal layout. Python fills it
    and C code updates it.
    """

    _fields_ = struct_fields(FIELDS)


class BeliefLibrary(NamedTuple):
    """The compiled C functions that update and reset the particle filter of one rover."""

    library: ctypes.CDLL
    """shared library with the functions `rover_pin_sense` and `rover_pin_forget`"""
    work: tuple[int, int]
    """lengths of the work array of integers and of the work array of reals that the CasADi function `ground_law`
    needs"""


def compile_belief(ground: ca.Function, laws: Sequence[ca.Function]) -> BeliefLibrary:
    """Return the particle filter of `belief.c`, compiled for one rover.

    `ground` is the CasADi function that `ground_law` returns. `laws` are the functions that `belief_laws` returns,
    which move the particles and compute the densities of readings.
    """
    # The C source consists of generated code, definitions of constants, the struct, the laws, and the filter itself.
    lines = [lanes.header(), generated_source(ground), "typedef int64_t integer;", "typedef double real;"]
    lines += ["typedef void (*lanes_law)(const double *, const double *, double *);"]
    lines += [constants(), "typedef struct {", *members(FIELDS), "} Belief;"]
    # Each law is evaluated for several particles at once, in the lanes of a SIMD register.
    lines += [lanes.c_source(law, shared=(1,)) for law in laws]
    handle = shared_library("\n".join([*lines, c_source()]), "belief")
    # ctypes must know the types of the arguments, because it would pass a float as an integer otherwise.
    handle.rover_pin_sense.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_double]
    handle.rover_pin_sense.restype = handle.rover_pin_forget.restype = None
    handle.rover_pin_forget.argtypes = [ctypes.c_void_p]
    return BeliefLibrary(handle, (ground.sz_iw(), ground.sz_w()))


def row_lengths(wheels: int, links: int, lag: int, soils: int) -> dict[str, int]:
    """Return the length of each array of reals in the particle filter, by the name of the array. The arrays `estimates`
    and `work_w` are not included.

    `links` is the number of suspension angles, `lag` the delay of visual odometry in samples, and `soils` the number of
    soils that the filter considers.
    """
    # A posture is roll, pitch and the suspension angles; a sample also has the rate and the current of each wheel.
    posture = 2 + links
    sample = posture + 2 * wheels
    rows = {"mean": sample, "rates": posture, "samples": LENGTHS["WINDOW"] * sample, "under": len(UNDER) * wheels}
    rows |= dict.fromkeys(WHEEL_ROWS, wheels) | dict.fromkeys(PARTICLE_ROWS, PARTICLES)
    past, lags = LENGTHS["PAST"], lag + 1
    rows |= {"past": past * (wheels + 2), "past_distance": past * PARTICLES, "past_travel": lags * PARTICLES}
    return rows | {"p_soil": soils, "slip": wheels * PARTICLES, "hole": wheels * PARTICLES}


class Belief:
    """The memory of the particle filter that estimates the slip on board; C code updates this memory.

    The C struct points to the arrays of this object. Keep the object while C code uses the struct. Write a sample of
    the sensors into `sample`, call `sense`, and read the result from `estimates` and `struct`.

    Parameters
    ----------
    functions : BeliefLibrary
        The compiled filter.
    wheels, links : int
        Number of wheels, and number of suspension angles.
    lag : int
        Delay of visual odometry in samples; 0 if the rover has no visual odometry.
    numbers : float, int or array
        Constants of the filter, by the names of their fields in the struct.
    """

    def __init__(self, functions: BeliefLibrary, wheels: int, links: int, lag: int, **numbers: Any):
        # The arguments are kept, so that a copy of the filter can be built from them.
        self._sizes = functions, wheels, links, lag
        soils = len(numbers["softness"])
        self._library = functions.library
        self.struct = BeliefStruct()
        self.keep: dict[str, Any] = {}
        self.numbers = numbers
        self.sample = np.zeros(2 + links + 2 * wheels)
        "roll, pitch, suspension angles [rad], wheel rates [rad/s], currents [A]"
        self.estimates = np.zeros((wheels, 4))
        "for each wheel: mean slip, its SD, mean depth of the hole [m], its SD [m]"
        rows = row_lengths(wheels, links, lag, soils) | {"work_w": functions.work[1]}
        # Arrays of reals are aligned for the SIMD lanes, in which the laws are evaluated.
        integers = {"parent": PARTICLES, "work_i": functions.work[0] + 1}
        arrays = {name: aligned_zeros(size) for name, size in rows.items()}
        arrays |= {name: np.zeros(size, dtype=np.int64) for name, size in integers.items()}
        counts = {"n": wheels, "N": PARTICLES, "n_soils": soils, "n_posture": 2 + links, "lag": lag}
        fill(self.struct, self.keep, arrays | counts | {"estimates": self.estimates} | numbers)
        self._address = ctypes.addressof(self.struct)
        self.forget()

    def __deepcopy__(self, memo: dict[int, Any]) -> "Belief":
        """Return a copy that has its own arrays. A copy of the struct alone would point to the arrays of the
        original.
        """
        # The copy gets the contents of all arrays and of all plain fields, but keeps its own pointers.
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
        """Memory addresses of the C function `rover_pin_sense` and of the struct. The compiled simulation loop calls
        the function with the struct.
        """
        return ctypes.cast(self._library.rover_pin_sense, ctypes.c_void_p).value or 0, self._address

    @property
    def p_stands(self) -> int:
        """Memory address of the probability that the rover does not move, which the compiled simulation loop reads."""
        return self._address + BeliefStruct.stuck.offset

    def forget(self) -> None:
        """Reset the filter to the start of a drive: all speeds are possible, no wheel slips, and no wheel has dug a
        hole.
        """
        self._library.rover_pin_forget(self._address)

    def sense(self, backwards: bool, late: float) -> None:
        """Update the filter with the readings in `sample`; call this method once in each control period.

        `backwards` states whether the duties drive the rover backwards. `late` is the forward speed by visual odometry
        `lag` samples ago [m/s], or NaN if no image measured this speed.
        """
        self._library.rover_pin_sense(self._address, self.sample.ctypes.data, backwards, late)


def c_source() -> str:
    """Return the C code of the particle filter, the texts of `draws.c` and `belief.c`. The struct and the laws are not
    included.
    """
    return "\n".join(text_of_package("rover_pin.control.sensing", name) for name in ("draws.c", "belief.c"))


def constants() -> str:
    """Return C definitions of the constants `LENGTHS`, `THRESHOLDS` and `UNDER`, which `belief.c` and `monitor.c`
    use.
    """
    lines = [f"#define {name} {value!r}" for name, value in (LENGTHS | THRESHOLDS).items()]
    return "\n".join([*lines, f"enum {{ {', '.join(UNDER)} }};"])
