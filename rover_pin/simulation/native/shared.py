"""What the C files and Python share: the struct Drive, sizes, and where each quantity stands, from one definition."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.quantity import Record, quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.simulation.compiled.laws import GEOMETRY, MAX_STATES
from rover_pin.simulation.pace import CALM, FINEST, GLANCE, GROWS, LEAST_GROWN, ROUGH

GAMMA = 1.0 - math.sqrt(0.5)
"""Weight of a step's end in its solve for the speeds (`plain/step.py`)."""
MAX_DOF, MAX_COLS = 48, 24
MOST = {"DOF": MAX_DOF, "COLS": MAX_COLS, "STATES": MAX_STATES, "MOTOR_OUT": 128, "SPOTS": 64}
"""The most of each that the step holds; COLS in whole rows of 8, SPOTS: patches whose laws are worked out together."""
N_FACET, N_PATCH = 8, 11
"""Numbers in the C structs of one facet and of one patch."""

RECORD = ("slip", "slip_y", "sinkage", "normal", "tangential", "lateral", "soil_torque", "travel", "patches", "torque",
          "current", "supply")  # fmt: skip
"""What is recorded of a wheel."""
ENERGY = ("motor", "soil", "stops", "servos", "electric", "body")
"""Where energy goes, as the drive's account names it."""

INTEGERS = (
    "nq nv n_inertia n_wheels n_cols n_axles n_contact_states n_motor_states n_joints n_servos n_stops n_body n_lanes "
    "grid_nx grid_ny n_soils n_kinds n_held differential_left n_coupled symmetric settling accounts n_free pivoted"
).split()
NUMBERS = "dt direction_speed grid_x0 grid_y0 grid_per_x grid_per_y wheel_share misjudged growth".split()
ARRAYS = {
    "nle q v du": "",
    "rigid": "the generated column of the rigid body, whose parts are nle and the next four",
    "axes points rotation potential": "",
    "rigid_held gravity armature": "",
    "radius": "of each wheel",
    "kinds": "the quantities of each kind of wheel: n_kinds x N_WHEEL",
    "servo_target servo_gain": "gain: stiffness, damping",
    "stop_limits stop_gain": "limits: lower, upper per stop",
    "coupled_ratio mirror_sign": "",
    "contact_states motor_states contact_odd": "",
    "contact_parameters motor_parameters body_parameters": "",
    "soils": "n_soils x N_SOIL",
    "held": "what the contact law holds for each kind of wheel on each soil: n_kinds x n_soils x n_held",
    "held_lanes": "the same, as the lanes took it last",
    "duty": "",
    "held_rate hold_inertia": "rates that the wheels are held to, and with what; 0: the motors turn them",
    "lane_borders lane_x lane_z grid_z": "",
    "lane_normal": "of each piece: x, z",
    "bin_x0 bin_per_metre": "where a lane's first bin begins, bins per metre",
    "facets patches": "room for those of one wheel",
    "foreseen": "4 a wheel: its load as the last step expected it",
    "record energy loads": "n_wheels x N_RECORD; N_ENERGY; n_wheels x 6: force and moment at a wheel's centre",
    "mean_loads": "the same half-way through the step, as the account has them; loads: as it began",
    "impulse differential": "of the soil's forces; the differential's torque",
    "history": "how many steps there were, then their lengths; 0: none are kept",
    "work_w": "",
}
"""Arrays of double, with what is to be said of them."""
INDICES = {
    "inertia_place": "of each entry in A: upper triangle, then lower triangle",
    "free_order free_count free_above": "order of elimination, and what each row then meets",
    "cols col_count wheel_dof axle": "",
    "kind": "wheels of one kind have the same sizes",
    "joint_dof joint_q joint_unbounded": "",
    "servo_dof servo_q stop_dof stop_q": "",
    "body_dof body_q": "base (6), then the suspension's joints; body_q: those joints alone",
    "coupled_dof": "follower, leader of each coupling; a rigid differential is the last one, of ratio -1",
    "mirror_index lane_start lane_ground grid_ground work_i": "",
    "bin bin_start": "the last point at or behind each bin's begin, and where a lane's bins begin",
}
"""Arrays of integer, likewise."""
PACE = {"FINEST": FINEST, "ROUGH": ROUGH, "CALM": CALM, "GLANCE": GLANCE, "GROWS": GROWS}
PACE |= {"LEAST_GROWN": LEAST_GROWN, "GAMMA": GAMMA}
FUNCTIONS = "contact_before body_law rigid_body".split()
LANES_FUNCTIONS = "contact_law motor_law".split()

FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_int64, {" ".join(INTEGERS): ""}, "integer {}"),
    (ctypes.c_double, {" ".join(NUMBERS): ""}, "double {}"),
    (ctypes.c_void_p, ARRAYS, "double *{}"),
    (ctypes.c_void_p, INDICES, "integer *{}"),
    (ctypes.c_void_p, {" ".join(FUNCTIONS): ""}, "casadi_function {}"),
    (ctypes.c_void_p, {" ".join(LANES_FUNCTIONS): ""}, "lanes_function {}"),
    (ctypes.c_void_p, {"step": "what a step works with"}, "struct Step *{}"),
]


LOOP_FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (
        ctypes.c_int64,
        {
            "k steps per_control per_sample row check_every": "step, and steps in all, a control sample, a row",
            "asks asked obeyed": "whether a controller in Python is asked, how often, and the step of its last answer",
            "size": "of a step, in FINEST parts of dt",
            "before before_size": "where the step before is saved, and its size; 0: it cannot be taken again",
            "seen": "whether `now` is of this instant",
            "n_moving moving_size": "",
            "row_size n_folding": "",
            "n_table n_pitches noise_row n_memory": "of a built-in controller",
        },
        "integer {}",
    ),
    (
        ctypes.c_double,
        {
            "dt begin": "",
            "rough": "how many times ROUGH and CALM a step may misjudge",
            "fastest upright buried folded": "where a drive ends: failure.py",
            "elapsed": "of the steps that are followed",
            "share mass": "of a row's way to the logged place; of the rover",
            "control_period table_radius stall_torque no_load_rate": "of a built-in controller",
            "backwards rim_radius": "of the on-board estimate: duty below which it drives backwards",
            "stop_p": "P from which a rover counts as standing, for a control that stops for good",
        },
        "double {}",
    ),
    (
        ctypes.c_void_p,
        {
            "log questions": "rows; those of the instants at which a controller is asked",
            "duty_rows rate_rows steer_rows force_rows grip_rows place_rows": "commands of a replay; 0 for none",
            "followed": "lengths of the steps that are taken, until a 0; 0: it chooses them",
            "gave": "by how much each servo gave way, a row before",
            "now": "the wheels' record and the differential's torque, as `observe` saw them last",
            "moved down soils_at_rest folding_limits": "",
            "saved": "two steps' beginnings: all that moves",
            "duty_fixed steer_fixed": "of a built-in controller; 0: none is given",
            "gains integral depth table_duty table_speed limit_pitch limit_torque": "",
            "read noise noise_sds noise_steps": "what sensors say; standard normals, a row a sample; 0: no noise",
            "sample slips_and_holes p_stands": "of the on-board estimate",
            "stop_law stop_memory": "of `stops`; late share, has stopped",
            "law_numbers law_memory law_next law_limits law_w": "of drive_law, which goes on in law_memory",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"moving": "the arrays that a step changes"}, "double **{}"),
    (ctypes.c_void_p, {"folding_q": "the suspension's places in q", "moving_sizes": ""}, "integer *{}"),
    (ctypes.c_void_p, {"slip_law": "of one wheel", "drive_law": "of the whole rover"}, "casadi_function {}"),
    (ctypes.c_void_p, {"sense": "of the on-board estimate"}, "sense_function {}"),
    (ctypes.c_void_p, {"belief": "its memory"}, "void *{}"),
]


SETTLING_FIELDS: list[tuple[Any, dict[str, str], str]] = [
    (ctypes.c_int64, {"n_slip": ""}, "integer {}"),
    (ctypes.c_double, {"yaw gravity radius most_slid": "most_slid: change of a slip in one step"}, "double {}"),
    (
        ctypes.c_void_p,
        {
            "place rise": "x, y, and the ground's slope there",
            "lengths": "what makes each speed one of a wheel; 0 where it is locked",
            "free_lengths free_rotors": "of the slide, for when it is let go",
            "most_shear": "of each slip",
            "before looked in_hand": "room for a state each",
        },
        "double *{}",
    ),
    (ctypes.c_void_p, {"slip": "their places among a wheel's states"}, "integer *{}"),
]


def struct_fields(fields: list[tuple[Any, dict[str, str], str]]) -> list[tuple[str, Any]]:
    """Return name and kind of each of a struct's fields, as ctypes takes them."""
    return [(name, kind) for kind, lines, _ in fields for names in lines for name in names.split()]


class LoopStruct(ctypes.Structure):
    """The struct Loop."""

    _fields_ = struct_fields(LOOP_FIELDS)


class SettlingStruct(ctypes.Structure):
    """The struct Settling."""

    _fields_ = struct_fields(SETTLING_FIELDS)


class DriveStruct(ctypes.Structure):
    """The struct Drive."""

    _fields_ = struct_fields(FIELDS)


def fill(struct: ctypes.Structure, keep: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Let fields of a struct have these values; an array's field has its address, and `keep` the array."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            keep[name] = value
            value = value.ctypes.data
        setattr(struct, name, value)


def header() -> str:
    """Return the C declarations: sizes (N_SOIL), places (SOIL_N: where the exponent n stands), and the structs."""
    tables = {"SOIL": _names(Soil), "WHEEL": _names(Wheel), "GEOMETRY": GEOMETRY, "RECORD": RECORD, "ENERGY": ENERGY}
    lines = [f"#define MAX_{name} {size}" for name, size in MOST.items()]
    lines += [f"#define N_FACET {N_FACET}", f"#define N_PATCH {N_PATCH}"]
    lines += [_places(table, names) for table, names in tables.items()]
    lines += [f"#define {name} {value!r}" for name, value in PACE.items()]
    for name, fields in {"Drive": FIELDS, "Loop": LOOP_FIELDS, "Settling": SETTLING_FIELDS}.items():
        lines += ["typedef struct {", *members(fields), f"}} {name};"]
    return "\n".join([*lines, ""])


def _names(record: type[Record]) -> Sequence[str]:
    return list(quantities(record))


def _places(table: str, names: Sequence[str]) -> str:
    entries = ", ".join(f"{table}_{name.upper()}" for name in names)
    return f"enum {{ {entries}, N_{table} }};"


def c_number(value: float) -> str:
    """Return a number in C, to the last bit."""
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


def c_table(kind: str, name: str, values: Any) -> str:
    """Return the C of a constant table of numbers."""
    row = [c_number(value) for value in np.ravel(np.asarray(values)).tolist()]
    return f"static const {kind} {name}[{max(len(row), 1)}] = {{{', '.join(row) or '0'}}};"


def members(fields: list[tuple[Any, dict[str, str], str]]) -> list[str]:
    """Return the lines of a struct with these fields."""
    return [
        f"  {form.format(name)};" + (f" /* {comment} */" if comment else "")
        for _, lines, form in fields
        for names, comment in lines.items()
        for name in names.split()
    ]
