"""Definitions that Python and the C files share: the structs of a drive, sizes, and the place of each quantity.

They are written once, here. `header` gives them as C declarations with their documentation, and the ctypes structures
below give Python an equal layout. Conventions of all fields: SI units and radians; x forward, y left, z up; arrays are
row-major; `q` and `v` are Pinocchio's configuration and velocity, the base first (position and quaternion x, y, z, w in
q; velocity and angular velocity in the base's own axes in v). (n) or (n, m) is the shape of an array.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.simulation.compiled.laws import GEOMETRY, MAX_STATES
from rover_pin.simulation.stepping.pace import CALM, FINEST, GLANCE, GROWS, LEAST_GROWN, ROUGH

GAMMA = 1.0 - math.sqrt(0.5)
"""Weight of a step's end in its solve for the speeds (`plain/step.py`)."""
MAX_DOF, MAX_COLS = 48, 24
"""Largest number of degrees of freedom of a rover (MAX_DOF), and largest number of degrees of freedom that move one
wheel (MAX_COLS, a multiple of 8)."""
MAX_SIZES = {"DOF": MAX_DOF, "COLS": MAX_COLS, "STATES": MAX_STATES, "MOTOR_OUT": 128, "SPOTS": 64}
"""Sizes of the fixed arrays in C. MOTOR_OUT: numbers in one answer of the motor law; SPOTS: patches whose contact laws
are evaluated together."""
N_FACET, N_PATCH = 8, 11
"""Number of values in the C struct of one facet (N_FACET), and in the C struct of one contact patch (N_PATCH)."""

RECORD = ("slip", "slip_y", "sinkage", "normal", "tangential", "lateral", "soil_torque", "travel", "patches", "torque",
          "current", "supply")  # fmt: skip
"""Quantities that a step records of each wheel, in the order of the columns of `record`: S and S_y [-], sinkage [m],
normal, tangential and lateral force of the soil [N], its torque [N m], travel speed [m/s], number of patches, motor
torque at the wheel [N m], motor current [A], supply voltage [V]. S > 0 drives; the tangential force is positive
forwards, the lateral one to the left."""
ENERGY = ("motor", "soil", "stops", "servos", "electric", "body")
"""Terms of the drive's energy account [J], summed since its start: given by the motors to the wheels; taken by the
soil, by end stops and by servos; taken from the supply; taken by the effects that push the body."""

INTEGERS = {
    "nq": "numbers in q",
    "nv": "numbers in v: the degrees of freedom",
    "n_inertia": "entries in the upper triangle of the joint-space inertia that are not always zero",
    "n_wheels": "wheels",
    "n_cols": "row length of `cols`: the most degrees of freedom above one wheel",
    "n_axles": "axles; the contact law counts them from the front",
    "n_contact_states": "states of the contact effects, of each wheel",
    "n_motor_states": "states of the motor effects, of each wheel",
    "n_joints": "joints, without the free base",
    "n_servos": "steering servos",
    "n_stops": "suspension joints with end stops",
    "n_body": "degrees of freedom that body effects push: 6 of the base and the suspension's; 0: no body effect",
    "n_lanes": "strips of ground along x; 0: the ground is a height grid",
    "grid_nx": "points of the height grid along x",
    "grid_ny": "points of the height grid along y",
    "n_soils": "soils",
    "n_kinds": "kinds of wheels: wheels of one kind have equal dimensions",
    "n_held": "precomputed constants of the contact law, for one kind of wheel on one soil",
    "differential_left": "degree of freedom of the left rocker, where a rigid differential couples both; else -1",
    "n_coupled": "couplings between two joints, a rigid differential included",
    "symmetric": "1: hold the mirror symmetry about the x-z plane",
    "settling": "0: drive; else a stage of setting the rover down (structs.h)",
    "accounts": "1: keep the account of energies and impulses",
    "n_free": "speeds that the equations are solved for: all but the followers of couplings",
    "pivoted": "number of steps so far that had to exchange rows to solve their equations",
}
"""Fields of the struct Drive that are integers."""
NUMBERS = {
    "dt": "length of the step [s]",
    "direction_speed": "forward and backward travel are blended at a mean of rim and travel speed below this [m/s]",
    "grid_x0": "x of the height grid's first point [m]",
    "grid_y0": "y of the height grid's first point [m]",
    "grid_per_x": "grid cells per metre along x [1/m]",
    "grid_per_y": "grid cells per metre along y [1/m]",
    "wheel_share": "an equal share of the rover's weight for each wheel [N]",
    "misjudged": "worst forecast error of a wheel's load in the last step, over its normal force [-]",
    "growth": "largest factor by which the last step enlarged a speed that forces push away; 0: none beyond GROWS",
}
"""Fields of the struct Drive that are real numbers."""
ARRAYS = {
    "nle": "(nv) bias force: Coriolis, centrifugal and gravity terms [N, N m]; part of `rigid`",
    "q": "(nq) configuration",
    "v": "(nv) velocity [m/s, rad/s]",
    "du": "(nv) change of v over the step",
    "rigid": "output of the rigid body's function: inertia entries, then nle, axes, points, rotation, potential",
    "axes": "(joints, 3) axis of each joint but the base, unit vectors in the world; part of `rigid`",
    "points": "(joints, 3) a point on each of these axes, in the world [m]; part of `rigid`",
    "rotation": "(3, 3) axes of the base in the world, one after another; part of `rigid`",
    "potential": "(1) potential energy [J]; part of `rigid`",
    "rigid_held": "constants of the rigid body's function: placements and inertias of this rover",
    "gravity": "(3) gravity in the world [m/s^2]; points down",
    "armature": "(nv) rotor inertia at each joint [kg m^2]",
    "radius": "(n_wheels) wheel radii [m]",
    "kinds": "(n_kinds, N_WHEEL) dimensions of each kind of wheel, in the order of the fields of `Wheel`",
    "servo_target": "(n_servos) commanded steering angles [rad]",
    "servo_gain": "(2) stiffness [N m/rad] and damping [N m s/rad] of a servo",
    "stop_limits": "(n_stops, 2) lower and upper limit of each suspension joint [rad]",
    "stop_gain": "(2) stiffness [N m/rad] and damping [N m s/rad] of an end stop",
    "coupled_ratio": "(n_coupled) ratio of the follower's speed to its leader's",
    "mirror_sign": "(nv) sign of each speed in the mirror image of v",
    "contact_states": "(n_wheels, n_contact_states) states of the contact effects",
    "motor_states": "(n_wheels, n_motor_states) states of the motor effects",
    "contact_odd": "(n_contact_states) -1 for a state that changes sign with the direction of travel, else 1",
    "contact_parameters": "quantities of all contact effects, one effect after another",
    "motor_parameters": "quantities of the motor, then of all motor effects",
    "body_parameters": "quantities of all body effects",
    "soils": "(n_soils, N_SOIL) constants of each soil, in the order of the fields of `Soil`",
    "held": "(n_kinds, n_soils, n_held) precomputed constants of the contact law",
    "held_lanes": "(MAX_QUESTIONS / LANES, n_held, LANES) these constants, spread over the SIMD lanes",
    "duty": "(n_wheels) duty of each motor, -1 to 1",
    "held_rate": "(n_wheels) rates that the wheels are held to [rad/s]; 0: the motors turn them",
    "hold_inertia": "(n_wheels) inertia that holds a wheel to its rate [kg m^2]",
    "lane_borders": "(n_lanes) y of the left border of each lane [m]; lanes count from the right",
    "lane_x": "x of the points of all lanes' profiles [m], lane after lane",
    "lane_z": "height of these points [m]",
    "grid_z": "(grid_nx, grid_ny) heights of the grid [m]",
    "lane_normal": "(points, 2) x and z of the unit normal of the piece from each point to the next",
    "bin_x0": "(n_lanes) x at which a lane's first bin begins [m]",
    "bin_per_metre": "(n_lanes) bins per metre [1/m]",
    "facets": "room for the facets under one wheel (struct Facet)",
    "patches": "room for the patches of one wheel (struct Patch)",
    "foreseen": "(n_wheels, 4) f_t, f_y, f_n [N], torque [N m] that the last step expected at its end",
    "record": "(n_wheels, N_RECORD) record of the last step, as the step began; see RECORD",
    "energy": "(N_ENERGY) energy account of the drive [J]; see ENERGY",
    "loads": "(n_wheels, 6) force [N] and moment [N m] of the soil at each wheel's centre, as the step began",
    "mean_loads": "(n_wheels, 6) this wrench at the mean of the step, as the energy account uses it",
    "impulse": "(3) sum over time of the soil's forces on all wheels [N s]",
    "differential": "(1) torque of the differential on the left rocker [N m]",
    "history": "number of steps, then the length of each [s]; 0: lengths are not kept",
    "work_w": "real work space of the generated functions",
}
"""Fields of the struct Drive that are arrays of real numbers."""
INDICES = {
    "inertia_place": "(2, n_inertia) flat index in A of each inertia entry: in the upper, then in the lower triangle",
    "free_order": "(n_free) order of elimination of the speeds, from the leaves to the base",
    "free_count": "(n_free) number of speeds that each eliminated speed still meets",
    "free_above": "(n_free, MAX_DOF) these speeds, in ascending order",
    "cols": "(n_wheels, n_cols) degrees of freedom that move each wheel",
    "col_count": "(n_wheels) number of these",
    "wheel_dof": "(n_wheels) degree of freedom of each wheel's own joint",
    "axle": "(n_wheels) axle of each wheel, counted from the front",
    "kind": "(n_wheels) kind of each wheel",
    "joint_dof": "(n_joints) place of each joint in v",
    "joint_q": "(n_joints) place of each joint in q",
    "joint_unbounded": "(n_joints) 1: the joint turns freely, and its place in q holds cosine and sine",
    "servo_dof": "(n_servos) place of each steering joint in v",
    "servo_q": "(n_servos) place of each steering joint in q",
    "stop_dof": "(n_stops) place of each suspension joint in v",
    "stop_q": "(n_stops) place of each suspension joint in q",
    "body_dof": "(n_body) degrees of freedom that body effects push: the base's 6, then the suspension's",
    "body_q": "(n_body - 6) place of the suspension's joints in q",
    "coupled_dof": "(n_coupled, 2) follower and leader of each coupling; a rigid differential is the last, of ratio -1",
    "mirror_index": "(nv) degree of freedom whose speed becomes each speed of the mirror image",
    "lane_start": "(n_lanes + 1) index of each lane's first point",
    "lane_ground": "soil of the piece from each point of the lanes to the next",
    "grid_ground": "(grid_nx - 1, grid_ny - 1) soil of each cell of the grid",
    "work_i": "integer work space of the generated functions",
    "bin": "for each bin, the index within its lane of the last point at or behind its beginning",
    "bin_start": "(n_lanes + 1) index of each lane's first bin",
}
"""Fields of the struct Drive that are arrays of integers."""
PACE = {"FINEST": FINEST, "ROUGH": ROUGH, "CALM": CALM, "GLANCE": GLANCE, "GROWS": GROWS}
PACE |= {"LEAST_GROWN": LEAST_GROWN, "GAMMA": GAMMA}
"""Constants of the step and of its size, by their names in C."""
FUNCTIONS = {
    "contact_before": "wheel and soil constants -> precomputed constants of the contact law",
    "body_law": "push of the body effects (compiled/body_law.py)",
    "rigid_body": "q, v, gravity -> `rigid`",
}
LANES_FUNCTIONS = {
    "contact_law": "contact, states, precomputed constants -> load, rates and their slopes (compiled/laws.py)",
    "motor_law": "duty, rate, wheel, supply current -> torque, rates and their slopes (compiled/laws.py)",
}
"""Generated functions: on plain numbers, and on SIMD lanes."""

Fields = list[tuple[Any, dict[str, str], str]]
"""Fields of a C struct in groups: type of ctypes, names with their documentation, and the C declaration of a name. One
entry may hold several names with a space between them."""

FIELDS: Fields = [
    (ctypes.c_int64, INTEGERS, "integer {}"),
    (ctypes.c_double, NUMBERS, "double {}"),
    (ctypes.c_void_p, ARRAYS, "double *{}"),
    (ctypes.c_void_p, INDICES, "integer *{}"),
    (ctypes.c_void_p, FUNCTIONS, "casadi_function {}"),
    (ctypes.c_void_p, LANES_FUNCTIONS, "lanes_function {}"),
    (ctypes.c_void_p, {"step": "intermediate results of a step"}, "struct Step *{}"),
]
"""Fields of the C struct Drive: model, state and results of a drive, as the compiled step reads and writes them."""

LOOP_FIELDS: Fields = [
    (
        ctypes.c_int64,
        {
            "k": "number of steps dt taken so far",
            "steps": "number of steps dt at which the drive ends",
            "per_control": "steps dt of one control period",
            "per_sample": "steps dt between two rows",
            "row": "number of rows written so far",
            "check_every": "rows between two checks whether the drive can go on",
            "asks": "1: a controller in Python is asked at every control period",
            "asked": "rows used in `questions`",
            "obeyed": "step k at which the controller was asked last; -1: never",
            "size": "size of the steps, in FINEST parts of dt",
            "before": "slot (0 or 1) of `saved` that holds the beginning of the step before",
            "before_size": "size of the step before; 0: it cannot be taken again",
            "seen": "1: `now` belongs to the present instant",
            "n_moving": "arrays that a step changes",
            "moving_size": "numbers in all of these",
            "row_size": "numbers in a row",
            "n_folding": "suspension joints",
            "n_table": "points of Eq (9)'s table",
            "n_pitches": "pitch angles in the table of torque limits",
            "noise_row": "sensor noise: rows used so far",
            "n_memory": "numbers in the memory of the drive law",
        },
        "integer {}",
    ),
    (
        ctypes.c_double,
        {
            "dt": "undivided step [s]",
            "begin": "time at which the drive began [s]",
            "rough": "factor on ROUGH and CALM",
            "fastest": "a drive with a faster base counts as diverged [m/s] (failure.py)",
            "upright": "least cosine between the base's vertical and the world's",
            "buried": "a wheel with a larger sinkage over its radius counts as buried",
            "folded": "angle beyond an end stop at which the suspension counts as folded [rad]",
            "elapsed": "time covered by the given steps that were taken so far [s]",
            "share": "replay: fraction of the distance to the logged place that is made up in each row",
            "mass": "mass of the rover [kg]",
            "control_period": "sample time of the slip control [s]",
            "table_radius": "wheel radius of Eq (9) [m]",
            "stall_torque": "torque limit: stall torque of a motor at the wheel [N m]",
            "no_load_rate": "torque limit: rate of a wheel without load at full duty [rad/s]",
            "backwards": "slip estimate: the rover drives backwards if its largest duty is below this one",
            "rim_radius": "slip estimate: wheel radius [m]; 0: the control has no law of holes",
            "stop_p": "a sample counts as standing still above this probability",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "log": "(rows, row_size) the rows of the drive",
            "questions": "(QUESTIONS, row_size) rows of the instants at which a controller in Python is asked",
            "duty_rows": "replay: (rows, n_wheels) duties; 0: this is no replay",
            "rate_rows": "replay: (rows, n_wheels) rates that the wheels are held to [rad/s]; 0: they are not",
            "steer_rows": "replay: (rows, n_servos) logged steering angles [rad]",
            "force_rows": "replay: (rows) force along the heading [N]; 0: none",
            "grip_rows": "replay: (rows) relative change of tan phi of all soils; 0: none",
            "place_rows": "replay: (rows, 3) logged x, y [m] and heading [rad]; NaN: a gap",
            "followed": "lengths of the steps to take [s], ended by a 0; 0: the loop chooses the steps",
            "gave": "replay: (n_servos) deflection of each servo one row earlier [rad]",
            "now": "(n_wheels N_RECORD + 1) record of the wheels and torque of the differential at the last look",
            "moved": "(3) sum of a replay's corrections in x, y [m] and heading [rad]",
            "down": "(3) gravity without a replay's force [m/s^2]",
            "soils_at_rest": "(n_soils, N_SOIL) soils without a replay's change of grip",
            "folding_limits": "(n_folding, 2) lower and upper limit of each suspension joint [rad]",
            "saved": "(2, moving_size) two slots for the beginning of a step",
            "duty_fixed": "(n_wheels) fixed duties of a built-in controller; 0: the controller is not built in",
            "steer_fixed": "(n_servos) fixed steering angles [rad]",
            "gains": "gains of the slip law",
            "integral": "(n_wheels) integral of the slip control, read and written",
            "depth": "(n_wheels) slip control's memory of the hole's depth [m], read and written",
            "table_duty": "(n_table) duties of Eq (9)'s table; 0: the true slip is used",
            "table_speed": "(n_table) travel speeds of Eq (9)'s table [m/s]",
            "limit_pitch": "(n_pitches) pitch angles of the torque limit's table [rad]; 0: no limit",
            "limit_torque": "(n_wheels, n_pitches) largest torque of each wheel [N m]",
            "read": "(3 + 2 n_wheels + n_folding) sensor readings: attitude, wheel rates, currents, suspension angles",
            "noise": "(samples, size of `read`) standard normal numbers; 0: sensors are exact",
            "noise_sds": "(4) standard deviation of attitude, rates, currents, angles",
            "noise_steps": "(4) quantisation step of attitude, rates, currents, angles; 0: none",
            "sample": "input of the slip estimate: roll, pitch, suspension angles, rates, currents",
            "slips_and_holes": "(n_wheels, 4) slip estimate: slip, its SD, hole [m], its SD",
            "p_stands": "(1) slip estimate: probability that the rover does not move",
            "stop_law": "(3) weight of a sample, threshold of the late share, threshold of the deepest hole over r",
            "stop_memory": "(2) late share of standing samples; above 0: the control has stopped for good",
            "law_numbers": "constants of the drive law",
            "law_memory": "(n_memory) memory of the drive law, read and written",
            "law_next": "(n_memory) room for its next memory",
            "law_limits": "(2, n_wheels) lowest and highest duty under the torque limit",
            "law_w": "work space of the drive law",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"moving": "(n_moving) the arrays that a step changes"}, "double **{}"),
    (
        ctypes.c_void_p,
        {
            "folding_q": "(n_folding) places of the suspension's joints in q",
            "moving_sizes": "(n_moving) sizes of the arrays that a step changes",
        },
        "integer *{}",
    ),
    (
        ctypes.c_void_p,
        {"slip_law": "control law of one wheel's slip", "drive_law": "control law of the whole rover"},
        "casadi_function {}",
    ),
    (ctypes.c_void_p, {"sense": "update of the slip estimate by a sample"}, "sense_function {}"),
    (ctypes.c_void_p, {"belief": "memory of the slip estimate"}, "void *{}"),
]
"""Fields of the C struct Loop, which the compiled loop over the steps uses: commands, rows of results, and the
controller of a drive or a replay."""

SETTLING_FIELDS: Fields = [
    (ctypes.c_int64, {"n_slip": "states of the slip law, of each wheel"}, "integer {}"),
    (
        ctypes.c_double,
        {
            "yaw": "heading at which the rover is set down [rad]",
            "gravity": "[m/s^2]",
            "radius": "radius of the smallest wheel [m]",
            "most_slid": "largest change of a slip state in one step",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "place": "(2) x and y at which the rover is set down [m]",
            "rise": "(2) slope of the ground there, dz/dx and dz/dy",
            "lengths": "(nv) factor that turns each speed into one of a wheel [1, m]; 0: the speed is locked",
            "free_lengths": "(3) these factors of the base's slide (x, y, yaw), for after its release",
            "free_rotors": "(3) armature of the base's slide after its release",
            "most_shear": "(n_slip) limit of each slip state: the slip of a wheel that only slides",
            "before": "room for the state before a step",
            "looked": "room for the state while the acceleration is measured",
            "in_hand": "room for the rest of the rover that is held in hand",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"slip": "(n_slip) places of the slip states among a wheel's states"}, "integer *{}"),
]
"""Fields of the C struct Settling, which describes a rover while it is set down on the ground, before a drive
begins."""


def struct_fields(fields: Fields) -> list[tuple[str, Any]]:
    """Return name and ctypes type of each field of a struct."""
    return [(name, kind) for kind, lines, _ in fields for names in lines for name in names.split()]


class LoopStruct(ctypes.Structure):
    """The struct Loop."""

    _fields_ = struct_fields(LOOP_FIELDS)


class SettlingStruct(ctypes.Structure):
    """The ctypes layout of the C struct Settling: numbers and work space for setting a rover down."""

    _fields_ = struct_fields(SETTLING_FIELDS)


class DriveStruct(ctypes.Structure):
    """The ctypes layout of the C struct Drive: everything that a step of a drive reads and writes."""

    _fields_ = struct_fields(FIELDS)


def fill(struct: ctypes.Structure, keep: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Set fields of a struct: numbers by value, arrays by their address.

    C does not keep Python's arrays alive, so each array is stored in `keep` under the name of its field, until the
    struct is no longer used.
    """
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            keep[name] = value
            value = value.ctypes.data
        setattr(struct, name, value)


def header() -> str:
    """Return the C declarations of sizes (N_SOIL), places (SOIL_N: column of the exponent n), constants and structs."""
    tables = {
        "SOIL": tuple(quantities(Soil)),
        "WHEEL": tuple(quantities(Wheel)),
        "GEOMETRY": GEOMETRY,
        "RECORD": RECORD,
        "ENERGY": ENERGY,
    }
    lines = [f"#define MAX_{name} {size}" for name, size in MAX_SIZES.items()]
    lines += [f"#define N_FACET {N_FACET}", f"#define N_PATCH {N_PATCH}"]
    # A place in C is an enum's entry; the last entry of each enum is the number of places.
    for table, names in tables.items():
        entries = ", ".join(f"{table}_{name.upper()}" for name in names)
        lines.append(f"enum {{ {entries}, N_{table} }};")
    lines += [f"#define {name} {value!r}" for name, value in PACE.items()]
    for name, fields in {"Drive": FIELDS, "Loop": LOOP_FIELDS, "Settling": SETTLING_FIELDS}.items():
        lines += ["typedef struct {", *members(fields), f"}} {name};"]
    return "\n".join([*lines, ""])


def members(fields: Fields) -> list[str]:
    """Return the lines of a C struct with these fields, each with its documentation as a comment."""
    return [
        f"  {declaration.format(name)};" + (f" /* {doc} */" if doc else "")
        for _, lines, declaration in fields
        for names, doc in lines.items()
        for name in names.split()
    ]


def c_number(value: float) -> str:
    """Return a number as a C literal that reads back to equal bits."""
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


def c_table(kind: str, name: str, values: Any) -> str:
    """Return the C of a constant array `name` of type `kind` with these numbers, row after row."""
    row = [c_number(value) for value in np.ravel(np.asarray(values)).tolist()]
    return f"static const {kind} {name}[{max(len(row), 1)}] = {{{', '.join(row) or '0'}}};"
