"""The fields of the C struct Drive that describe the rover, and the fields that describe the terrain. The compiled step
reads all numbers from this struct.

The fields of a rover do not depend on the ground, so they are computed once and used in all drives of the rover. A
terrain is represented by polylines, divided into bins for a fast search, or by a grid of heights.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.forward_dynamics import supporting_dofs
from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.native.compiled_body import CompiledBody, KeyedModel, compiled_body, order_of_elimination
from rover_pin.simulation.native.shared import MAX_COLS, MAX_DOF, N_FACET, N_PATCH, DriveStruct, fill
from rover_pin.simulation.state import suspension_dofs, suspension_places
from rover_pin.terrain.terrain import BEYOND, HeightGrid, Lanes, Profile, Terrain

NEXUS6_STRENGTH = 5.8 * 0.045
"""Mass times wheel radius [kg m] of Nexus 6. SERVO_GAIN and STOP_GAIN hold for this value; `joint_strength` scales them
in proportion for other rovers."""
SERVO_GAIN = (20.0, 0.2)
"""Stiffness [N m/rad] and damping [N m s/rad] of a steering servo of Nexus 6 that holds its angle (assumed: the side
forces of the wheels hardly turn it)."""
STOP_GAIN = (50.0, 1.0)
"""Stiffness [N m/rad] and damping [N m s/rad] of an end stop of the suspension of Nexus 6 (assumed). An end stop is a
spring that acts beyond the limit of a joint."""
WHEEL_LENGTH = 2.1
"""Length along x of the ground that a step examines under a wheel, divided by the wheel radius. It decides the amount
of reserved memory, and covers the distance REACH of terrain.c forwards and backwards."""
GRID_FACETS = 8
"""Largest number of plane facets that the surface of a height grid can have under one wheel; it equals N_CUT of
terrain.c."""


@dataclass(frozen=True, eq=False)
class RoverFields:
    """The fields of the C struct Drive that describe a rover. Each drive copies the struct. All drives share the arrays
    behind its pointers, so these arrays are read-only.
    """

    struct: DriveStruct
    keep: dict[str, Any]
    """name of a field -> array behind the pointer in this field; stored here so that Python does not free the array"""
    pin_model: pin.Model
    "the rover's Pinocchio model, with the inertia of the motors' rotors added at the wheels"
    body: CompiledBody


@lru_cache(maxsize=64)
def rover_fields(rover: Rover, armature: float, strength: float, rigid_differential: bool, pushed: bool) -> RoverFields:
    """Return the fields of the C struct Drive that describe a rover. The result is stored for later drives of this
    rover.

    Parameters
    ----------
    rover : Rover
        The rover under the model's gravity, with the loads that effects add (`Model.built`).
    armature : float
        Inertia of a motor's rotor, referred to the wheel [kg m^2].
    strength : float
        Factor on the gains of servos and end stops (`joint_strength`).
    rigid_differential : bool
        Whether a differential couples the rockers rigidly.
    pushed : bool
        Whether the model has body effects, whose forces act on the base and the suspension.

    Raises
    ------
    ParameterError
        The rover has more degrees of freedom than the step can hold.
    """
    pin_model, keyed_model = model_with_armature(rover, armature), KeyedModel.of(rover.model)
    body = compiled_body(keyed_model)
    # Fields of the wheels, the joints, the equations, the springs, and the rigid body's function.
    struct, keep = DriveStruct(), dict[str, Any]()
    for fields in (
        _wheels(rover, pin_model),
        _joints(rover, pin_model),
        _equations(rover, keyed_model, rigid_differential, pushed),
        _springs(rover, strength, pushed),
        {
            "n_inertia": len(body.rows),
            "inertia_place": np.concatenate([body.rows * MAX_DOF + body.columns, body.columns * MAX_DOF + body.rows]),
            "rigid_held": body.precomputed,
            "rigid_body": body.address,
        },
    ):
        fill(struct, keep, fields)
    # The arrays are shared by all drives of this rover.
    for array in keep.values():
        array.flags.writeable = False
    return RoverFields(struct, keep, pin_model, body)


def _wheels(rover: Rover, model: pin.Model) -> dict[str, Any]:
    """Return the fields of the struct Drive that describe the wheels: for each wheel the degrees of freedom that move
    it, its axle, and its dimensions.
    """
    # The degrees of freedom above each wheel are the columns of its Jacobian that are not zero.
    columns = [supporting_dofs(model, wheel.joint) for wheel in rover.wheels]
    most = max(map(len, columns))
    # The arrays of the C code have fixed sizes, so that larger rovers are refused here.
    if model.nv > MAX_DOF or most > MAX_COLS:
        raise ParameterError(
            f"The rover has too many joints: it has {model.nv} degrees of freedom, {most} of which move one wheel, but "
            f'the engine "compiled", which also sets a rover down, allows at most {MAX_DOF} and {MAX_COLS}. Make some '
            "joints in its URDF fixed, or drive from a DriveState with "
            'simulate(model, controller, duration, state, engine="pinocchio-crba").'
        )
    # One row for each wheel, filled up with zeros that `col_count` leaves out.
    cols = np.zeros((len(columns), most), dtype=np.int64)
    for row, dofs in zip(cols, columns, strict=True):
        row[: len(dofs)] = dofs
    # Wheels of equal dimensions are one kind, for which the contact law's constants are computed once.
    dimensions = np.array([laws.numbers([wheel.wheel]) for wheel in rover.wheels])
    kinds, kind = np.unique(dimensions, axis=0, return_inverse=True)
    return {
        "n_wheels": len(columns),
        "n_cols": most,
        "n_axles": 1 + max(wheel.axle for wheel in rover.wheels),
        "cols": cols,
        "col_count": np.array([len(dofs) for dofs in columns], dtype=np.int64),
        "wheel_dof": np.array([wheel.dof for wheel in rover.wheels], dtype=np.int64),
        "axle": np.array([wheel.axle for wheel in rover.wheels], dtype=np.int64),
        "radius": rover.radii,
        "n_kinds": len(kinds),
        "kind": np.asarray(kind, dtype=np.int64).ravel(),
        "kinds": kinds,
    }


def _joints(rover: Rover, model: pin.Model) -> dict[str, Any]:
    """Return the fields of the struct Drive that describe the layout of configuration and velocity: the indices of each
    joint in them, and the permutation and signs that mirror them at the x-z plane.
    """
    # Joint 0 is the world, joint 1 the free base.
    joints = [model.joints[j] for j in range(2, model.njoints)]
    perm, sign = rover.mirror
    return {
        "nq": model.nq,
        "nv": model.nv,
        "n_joints": len(joints),
        "joint_dof": np.array([joint.idx_v for joint in joints], dtype=np.int64),
        "joint_q": np.array([joint.idx_q for joint in joints], dtype=np.int64),
        "joint_unbounded": np.array([joint.nq == 2 for joint in joints], dtype=np.int64),
        "mirror_index": np.array(perm, dtype=np.int64),
        "mirror_sign": np.array(sign, dtype=float),
    }


def _equations(rover: Rover, keyed_model: KeyedModel, rigid_differential: bool, pushed: bool) -> dict[str, Any]:
    """Return the fields of the struct Drive that describe the equations of motion: the couplings between
    joints, and the order in which the linear solver eliminates the speeds.
    """
    # A rigid differential is a coupling with the ratio -1.
    differential = rover.differential if rigid_differential else None
    coupled = [(coupling.follower, coupling.leader, coupling.ratio) for coupling in rover.couplings]
    coupled += [] if differential is None else [(differential.right, differential.left, -1.0)]
    # A body effect may couple any two of the degrees of freedom that it pushes.
    body = [*range(6), *suspension_dofs(rover)] if pushed else []
    order, above = order_of_elimination(keyed_model, tuple(pair[:2] for pair in coupled), tuple(body))
    # For each eliminated speed, the later speeds that its elimination changes.
    table = np.zeros((len(order), MAX_DOF), dtype=np.int64)
    for row, remaining in zip(table, above, strict=True):
        row[: len(remaining)] = remaining
    return {
        "differential_left": -1 if differential is None else differential.left,
        "n_coupled": len(coupled),
        "coupled_dof": np.array([pair[:2] for pair in coupled], dtype=np.int64).ravel(),
        "coupled_ratio": np.array([ratio for *_, ratio in coupled]),
        "n_free": len(order),
        "free_order": np.array(order),
        "free_count": np.array([len(remaining) for remaining in above], dtype=np.int64),
        "free_above": table,
    }


def _springs(rover: Rover, strength: float, pushed: bool) -> dict[str, Any]:
    """Return the fields of the struct Drive for the steering servos, for the end stops, and for the joints on which
    body effects act.
    """
    model = rover.model
    q_of = {joint.idx_v: joint.idx_q for joint in model.joints}
    # Servos act on the steering, end stops on the suspension.
    servos = [wheel.steer_dof for wheel in rover.wheels if wheel.steer_dof is not None]
    # Both kinds of springs pull a joint to an angle: a servo to its target, a stop back within the limits of the URDF.
    stops, places = suspension_dofs(rover), suspension_places(rover)
    limits = [(model.lowerPositionLimit[place], model.upperPositionLimit[place]) for place in places]
    # Body effects push the base and the joints of the suspension, which are also those with stops.
    body_dofs = [*range(6), *stops] if pushed else []
    return {
        "n_body": len(body_dofs),
        "body_dof": np.array(body_dofs, dtype=np.int64),
        "body_q": np.array(places, dtype=np.int64),
        "n_servos": len(servos),
        "servo_dof": np.array(servos, dtype=np.int64),
        "servo_q": np.array([q_of[i] for i in servos], dtype=np.int64),
        "servo_gain": strength * np.array(SERVO_GAIN),
        "n_stops": len(stops),
        "stop_dof": np.array(stops, dtype=np.int64),
        "stop_q": np.array(places, dtype=np.int64),
        "stop_limits": np.array(limits).ravel(),
        "stop_gain": strength * np.array(STOP_GAIN),
    }


def model_with_armature(rover: Rover, armature: float) -> pin.Model:
    """Return a copy of a rover's Pinocchio model with a rotor of the inertia `armature` [kg m^2] at each wheel."""
    copy = rover.model.copy()
    on_joints = np.array(copy.armature)
    for wheel in rover.wheels:
        on_joints[wheel.dof] = armature
    copy.armature = on_joints
    return copy


def joint_strength(rover: Rover) -> float:
    """Return the factor that scales the gains of servos and end stops from Nexus 6 to this rover.

    The factor is the rover's mass times its wheel radius, divided by this product of Nexus 6. It is rounded to six
    digits, so that the round-off of a sum of masses does not change a drive.
    """
    return float(f"{rover.mass * float(rover.radii.max()) / NEXUS6_STRENGTH:.6g}")


def terrain_fields(terrain: Terrain, radius: float) -> dict[str, Any]:
    """Return the fields of the C struct Drive that describe a terrain.

    Parameters
    ----------
    terrain : Lanes or HeightGrid
        The ground.
    radius : float
        Radius of the largest wheel [m]. The amount of memory for facets and contact patches follows from it.
    """
    # Lanes of ground: the profiles are joined end to end, and `_starts` gives the index at which each profile begins.
    if isinstance(terrain, Lanes):
        lines = [line_of(profile) for profile in terrain.profiles]
        # A profile of N points has N - 1 pieces. Normals and soils get one entry more, a copy of the last, so that all
        # arrays have one entry for each point.
        fields = {
            "n_lanes": len(lines),
            "lane_borders": np.append(np.asarray(terrain.borders, dtype=float), np.inf),
            "lane_start": _starts([len(line.x) for line in lines]),
            "lane_x": np.concatenate([line.x for line in lines]),
            "lane_z": np.concatenate([line.z for line in lines]),
            "lane_normal": np.concatenate([np.vstack([line.normals, line.normals[-1:]]) for line in lines]),
            "lane_ground": np.concatenate([np.append(line.ground, line.ground[-1]) for line in lines]).astype(np.int64),
            "bin": np.concatenate([line.bins for line in lines]).astype(np.int64),
            "bin_start": _starts([len(line.bins) for line in lines]),
            "bin_x0": np.array([line.begin for line in lines]),
            "bin_per_metre": np.array([line.per_metre for line in lines]),
        }
        crowds = [line.crowd(WHEEL_LENGTH * radius) for line in lines]
    else:
        assert isinstance(terrain, HeightGrid)
        # A grid of heights: the C code finds the cell under a point by a product with the reciprocal spacing.
        fields = {
            "grid_nx": terrain.z.shape[0],
            "grid_ny": terrain.z.shape[1],
            "grid_x0": terrain.x0,
            "grid_y0": terrain.y0,
            "grid_per_x": 1.0 / terrain.dx,
            "grid_per_y": 1.0 / terrain.dy,
            "grid_z": np.ascontiguousarray(terrain.z, dtype=float),
            "grid_ground": np.ascontiguousarray(terrain.ground, dtype=np.int64),
        }
        crowds = [GRID_FACETS]
    # Room for the facets of a wheel on one lane, and for its patches on all of them. In addition to the points under
    # the wheel there are the pieces at both ends, and one more beyond each.
    facets = [crowd + 4 for crowd in crowds]
    room = {"facets": np.zeros((max(facets), N_FACET)), "patches": np.zeros((sum(facets), N_PATCH))}
    return {**fields, **room}


class Line(NamedTuple):
    """A profile of the terrain (height over x) as a polyline of N points. The x axis is divided into bins of equal
    length, so that the C code finds the piece of the polyline at a position fast.
    """

    x: np.ndarray
    """(N,) x of the points [m], ascending"""
    z: np.ndarray
    """(N,) height of the points [m]"""
    ground: np.ndarray
    """(N - 1,) index of the soil of each piece between two points"""
    normals: np.ndarray
    """(N - 1, 2) x and z of the unit normal of each piece between two points"""
    bins: np.ndarray
    """(N,) for each bin, the index of the last point that is not ahead of the beginning of the bin"""
    begin: float
    "x at which the first bin begins [m]"
    per_metre: float
    """number of bins per metre along x [1/m]"""

    def crowd(self, length: float) -> int:
        """Return the largest number of points in an interval of the given `length` [m] along x. It decides the number
        of facets under a wheel that memory is reserved for.
        """
        return int(np.max(np.searchsorted(self.x, self.x + length, side="right") - np.arange(len(self.x))))


@lru_cache(maxsize=64)
def line_of(profile: Profile) -> Line:
    """Return a profile of the terrain as a polyline with bins. Points that lie on straight lines between their
    neighbours are removed, and the polyline is extended far beyond both ends, so that a rover never leaves it.
    """
    # A piece along (dx, dz) has the upward normal (-dz, dx).
    x, z, ground = profile.without_collinear_points().extended_points()
    along = np.column_stack([-np.diff(z), np.diff(x)])
    normals = along / np.linalg.norm(along, axis=1, keepdims=True)
    # As many bins as points: in a profile of even points, each bin then holds one.
    inner = x[len(BEYOND) : -len(BEYOND)]  # a position beyond these is found from the first or the last bin
    begins = np.linspace(inner[0], inner[-1], len(x))
    bins = np.searchsorted(x, begins, side="right") - 1
    bins[0], bins[-1] = 0, len(x) - 2
    per_metre = (len(begins) - 1) / (begins[-1] - begins[0])
    return Line(x, z, ground, normals, bins, float(begins[0]), float(per_metre))


def _starts(lengths: list[int]) -> np.ndarray:
    """Return the index at which each of several arrays begins after they are joined to one, and the total length.
    `lengths` are the lengths of the arrays.
    """
    return np.cumsum([0, *lengths]).astype(np.int64)
