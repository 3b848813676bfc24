"""What a rover decides of the compiled step, whatever it drives on: worked out once for all drives of it."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.forward_dynamics import supporting_dofs
from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.suspension import suspension_dofs, suspension_places
from rover_pin.simulation.native.compiled_body import CompiledBody, KeyedModel, compiled_body, order_of_elimination
from rover_pin.simulation.native.shared import MAX_COLS, MAX_DOF, DriveStruct, fill

SERVO_GAIN = (20.0, 0.2)
"""Stiffness [N m/rad] and damping [N m s/rad] of a steering servo (assumed: stiff beside the wheel's side forces)."""
STOP_GAIN = (50.0, 1.0)
"""The same of a suspension's end stop (assumed)."""


@dataclass(frozen=True, eq=False)
class RoverFields:
    """A struct Drive with the rover's fields set, to be copied; their arrays are shared and never written."""

    struct: DriveStruct
    keep: dict[str, Any]
    "the arrays that the struct points at"
    pin_model: pin.Model
    "with the motors' rotors on the wheels"
    body: CompiledBody


@lru_cache(maxsize=64)
def rover_fields(rover: Rover, armature: float, strength: float, rigid_differential: bool, pushed: bool) -> RoverFields:
    """Return the fields of a rover with rotors of this inertia [kg m^2] and joints of this `joint_strength`.

    `pushed`: effects act on its body.
    """
    pin_model, keyed_model = model_with_armature(rover, armature), KeyedModel.of(rover.model)
    body = compiled_body(keyed_model)
    struct, keep = DriveStruct(), dict[str, Any]()
    for fields in (
        _wheels(rover, pin_model),
        _joints(rover, pin_model),
        _couplings(rover, keyed_model, rigid_differential, pushed),
        _rigid_body(body),
        _springs(rover, strength, pushed),
    ):
        fill(struct, keep, fields)
    for array in keep.values():
        array.flags.writeable = False
    return RoverFields(struct, keep, pin_model, body)


def _wheels(rover: Rover, model: pin.Model) -> dict[str, Any]:
    columns = [supporting_dofs(model, wheel.joint) for wheel in rover.wheels]
    most = max(map(len, columns))
    if model.nv > MAX_DOF or most > MAX_COLS:
        raise ParameterError(
            f"The rover has {model.nv} degrees of freedom, {most} above a wheel; "
            f"the step holds {MAX_DOF} and {MAX_COLS}."
        )
    cols = np.zeros((len(columns), most), dtype=np.int64)
    for row, dofs in zip(cols, columns, strict=True):
        row[: len(dofs)] = dofs
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


def _couplings(rover: Rover, keyed_model: KeyedModel, rigid_differential: bool, pushed: bool) -> dict[str, Any]:
    differential = rover.differential if rigid_differential else None
    coupled = [(coupling.follower, coupling.leader, coupling.ratio) for coupling in rover.couplings]
    coupled += [] if differential is None else [(differential.right, differential.left, -1.0)]
    return {
        "differential_left": -1 if differential is None else differential.left,
        "n_coupled": len(coupled),
        "coupled_dof": np.array([pair[:2] for pair in coupled], dtype=np.int64).ravel(),
        "coupled_ratio": np.array([ratio for *_, ratio in coupled]),
        **_elimination(rover, keyed_model, [pair[:2] for pair in coupled], pushed),
    }


def _elimination(rover: Rover, keyed_model: KeyedModel, coupled: list[Any], pushed: bool) -> dict[str, Any]:
    """Return the fields that say in which order the step's equations are solved."""
    body = [*range(6), *suspension_dofs(rover)] if pushed else []
    order, above = order_of_elimination(keyed_model, tuple(coupled), tuple(body))
    table = np.zeros((len(order), MAX_DOF), dtype=np.int64)
    for row, remaining in zip(table, above, strict=True):
        row[: len(remaining)] = remaining
    count = np.array([len(remaining) for remaining in above], dtype=np.int64)
    return {"n_free": len(order), "free_order": np.array(order), "free_count": count, "free_above": table}


def _rigid_body(body: CompiledBody) -> dict[str, Any]:
    return {
        "n_inertia": len(body.rows),
        "inertia_place": np.concatenate([body.rows * MAX_DOF + body.columns, body.columns * MAX_DOF + body.rows]),
        "rigid_held": body.precomputed,
        "rigid_body": body.address,
    }


def _springs(rover: Rover, strength: float, pushed: bool) -> dict[str, Any]:
    model = rover.model
    q_of = {joint.idx_v: joint.idx_q for joint in model.joints}
    servos = [wheel.steer_dof for wheel in rover.wheels if wheel.steer_dof is not None]
    stops, places = suspension_dofs(rover), suspension_places(rover)
    limits = [(model.lowerPositionLimit[place], model.upperPositionLimit[place]) for place in places]
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
    """Return a copy of a rover's model with motors' rotors of this inertia [kg m^2] on the wheels."""
    copy = rover.model.copy()
    on_joints = np.array(copy.armature)
    for wheel in rover.wheels:
        on_joints[wheel.dof] = armature
    copy.armature = on_joints
    return copy
