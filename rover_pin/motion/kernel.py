"""The compiled step: Pinocchio's matrices on one side, the generated laws on the other, native/ between them."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.errors import ParameterError
from rover_pin.motion import laws
from rover_pin.motion.compiled_laws import compiled_laws, structure_of
from rover_pin.motion.kernel_terrain import terrain_fields
from rover_pin.motion.model import Model
from rover_pin.motion.native.compiled_body import Known, compiled_body, order_of_elimination
from rover_pin.motion.native.library import aligned, library, sizes
from rover_pin.motion.native.shared import ENERGY, MAX_COLS, MAX_DOF, RECORD, DriveStruct, fill
from rover_pin.motion.state import DriveState
from rover_pin.motion.suspension import joint_strength, suspension_dofs

DIRECTION_SPEED = 0.005
"""Below this mean of rim and travel speed [m/s] the direction of travel is blended."""
SERVO_GAIN = (20.0, 0.2)
"""Stiffness [N m/rad] and damping [N m s/rad] of a steering servo (assumed: stiff beside the wheel's side forces)."""
STOP_GAIN = (50.0, 1.0)
"""The same of a suspension's end stop (assumed)."""
HOLDING = 1e6
"""Inertia, over the rover's m r^2, that holds a wheel to a measured rate: rates are then met to some 1e-7 rad/s, and
the wheels, eliminated first, leave the equations as well conditioned as they were."""


class Kernel:
    """A model's drive from one step to the next, compiled; `state` is read and written in place.

    Below `direction_speed` [m/s], the mean of rim and travel speed, the two directions of travel are blended.
    """

    def __init__(
        self, model: Model, state: DriveState, dt: float, symmetric: bool, direction_speed: float = DIRECTION_SPEED
    ):
        self.model = model
        self.state = state
        rover = model.built
        self.pin_model = armed(rover.model, model)
        self.known = Known.of(rover.model)
        self.keep: dict[str, Any] = {}
        self.struct = DriveStruct()
        self.record = np.zeros((len(rover.wheels), len(RECORD)))
        self.loads, self.foreseen = np.zeros((len(rover.wheels), 6)), np.zeros((len(rover.wheels), 4))
        self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1)
        self._set(dt=dt, direction_speed=direction_speed, symmetric=int(symmetric), accounts=1)
        self._bind_body(rover)
        self._bind_rigid_body()
        self._bind_springs(rover)
        self._bind_state(state)
        self._bind_terrain()
        self._bind_laws()
        self._step = library().rover_pin_step
        self._address = ctypes.addressof(self.struct)
        self.resoil(self.soils)
        self.moving = [state.q, state.v, state.contact, state.motor, self.record, self.loads, self.foreseen]
        self.moving += [self.energy, self.impulse, self.differential]

    def step(self) -> int:
        """Advance the state by dt; return 0, or 1 (not finite) or 2 (singular)."""
        return int(self._step(self._address))

    def set_step(self, dt: float) -> None:
        """Let steps have this length [s] from now on."""
        self.struct.dt = dt

    def saved(self) -> list[np.ndarray]:
        """Return a copy of all that a step changes."""
        return [each.copy() for each in self.moving]

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Go back to where `saved` was taken."""
        for array, value in zip(self.moving, saved, strict=True):
            array[...] = value

    def hold(self, rates: np.ndarray) -> None:
        """Turn the wheels at these rates [rad/s] from now on, whatever that takes; the array may change in place."""
        self._set(held_rate=rates, hold_inertia=HOLDING * self.model.built.mass * self.keep["radius"] ** 2)

    @property
    def misjudged(self) -> float:
        """By how much of its normal force some wheel's load was not what the step before took it to become."""
        return self.struct.misjudged

    @property
    def pivoted(self) -> int:
        """How many steps had to exchange rows to solve for their speeds."""
        return int(self.struct.pivoted)

    def unaccounted(self) -> None:
        """Keep no account of energies and impulses from now on: a replay has no use for them."""
        self.struct.accounts = 0

    def resoil(self, soils: np.ndarray) -> None:
        """Let the soils have these constants from now on: (soils, quantities), in the order of `Soil`'s fields."""
        self.soils[:] = soils
        library().rover_pin_hold(self._address)

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy [J] at the present state."""
        found = np.zeros(2)
        library().rover_pin_energies(self._address, found.ctypes.data)
        return float(found[0]), float(found[1])

    def _set(self, **values: Any) -> None:
        fill(self.struct, self.keep, values)

    def _bind_body(self, rover: Any) -> None:
        model = self.pin_model
        columns = [supports(model, wheel.joint) for wheel in rover.wheels]
        most = max(map(len, columns))
        if model.nv > MAX_DOF or most > MAX_COLS:
            raise ParameterError(
                f"The rover has {model.nv} degrees of freedom, {most} above a wheel; "
                f"the step holds {MAX_DOF} and {MAX_COLS}."
            )
        cols = np.zeros((len(columns), most), dtype=np.int64)
        for row, own in zip(cols, columns, strict=True):
            row[: len(own)] = own
        sizes = np.array([laws.numbers([wheel.wheel]) for wheel in rover.wheels])
        kinds, kind = np.unique(sizes, axis=0, return_inverse=True)
        joints = [model.joints[j] for j in range(2, model.njoints)]
        perm, sign = rover.mirror
        differential = rover.differential if self.model.rigid_differential else None
        coupled = [(each.follower, each.leader, each.ratio) for each in rover.couplings]
        coupled += [] if differential is None else [(differential.right, differential.left, -1.0)]
        self._set(
            nv=model.nv,
            n_wheels=len(columns),
            n_cols=most,
            n_axles=1 + max(wheel.axle for wheel in rover.wheels),
            n_joints=len(joints),
            differential_left=-1 if differential is None else differential.left,
            n_coupled=len(coupled),
            coupled_dof=np.array([pair[:2] for pair in coupled] or [(0, 0)], dtype=np.int64).ravel(),
            coupled_ratio=np.array([ratio for *_, ratio in coupled] or [1.0]),
            **self._elimination([pair[:2] for pair in coupled]),
            cols=cols,
            col_count=np.array([len(own) for own in columns], dtype=np.int64),
            wheel_dof=np.array([wheel.dof for wheel in rover.wheels], dtype=np.int64),
            axle=np.array([wheel.axle for wheel in rover.wheels], dtype=np.int64),
            radius=np.array([float(wheel.wheel.r) for wheel in rover.wheels]),
            rim_inertia=rim_inertia(model, rover),
            n_kinds=len(kinds),
            kind=np.asarray(kind, dtype=np.int64).ravel(),
            kinds=kinds,
            joint_dof=np.array([joint.idx_v for joint in joints], dtype=np.int64),
            joint_q=np.array([joint.idx_q for joint in joints], dtype=np.int64),
            joint_unbounded=np.array([joint.nq == 2 for joint in joints], dtype=np.int64),
            mirror_index=np.asarray(perm, dtype=np.int64),
            mirror_sign=np.asarray(sign, dtype=float),
            du=np.zeros(model.nv),
            wheel_share=self.model.gravity * rover.mass / len(columns),
            foreseen=self.foreseen,
            record=self.record,
            energy=self.energy,
            differential=self.differential,
            loads=self.loads,
            impulse=self.impulse,
        )

    def _elimination(self, coupled: list[Any]) -> dict[str, Any]:
        """Return the fields that say in which order the step's equations are solved."""
        body = [*range(6), *suspension_dofs(self.model.built)] if self.model.body_effects else []
        order, above = order_of_elimination(self.known, tuple(coupled), tuple(body))
        table = np.zeros((len(order), MAX_DOF), dtype=np.int64)
        for row, left in zip(table, above, strict=True):
            row[: len(left)] = left
        count = np.array([len(left) for left in above], dtype=np.int64)
        return {"n_free": len(order), "free_order": np.array(order), "free_count": count, "free_above": table}

    def _bind_rigid_body(self) -> None:
        model, made = self.pin_model, compiled_body(self.known)
        self.gravity, self.armature = np.array(model.gravity.linear), np.array(model.armature)
        column, ends = np.zeros(made.ends["potential"]), made.ends
        self.keep["rigid_handle"] = made
        self._set(
            nq=model.nq,
            n_inertia=len(made.rows),
            inertia_place=np.concatenate([made.rows * MAX_DOF + made.columns, made.columns * MAX_DOF + made.rows]),
            rigid=column,
            rigid_held=np.append(made.held, 0.0),
            rigid_body=made.address,
            gravity=self.gravity,
            armature=self.armature,
            nle=column[ends["inertia"] :],
            axes=column[ends["bias"] :],
            points=column[ends["axes"] :],
            rotation=column[ends["points"] :],
            potential=column[ends["rotation"] :],
        )

    def _bind_springs(self, rover: Any) -> None:
        model = self.pin_model
        q_of = {model.joints[j].idx_v: model.joints[j].idx_q for j in range(2, model.njoints)}
        servos = [wheel.steer_dof for wheel in rover.wheels if wheel.steer_dof is not None]
        stops = suspension_dofs(rover)
        limits = [(model.lowerPositionLimit[q_of[i]], model.upperPositionLimit[q_of[i]]) for i in stops]
        self.servo_target = np.zeros(max(1, len(servos)))
        self.servo_wheels = [i for i, wheel in enumerate(rover.wheels) if wheel.steer_dof is not None]
        body_dofs = [*range(6), *stops] if self.model.body_effects else []
        self._set(
            n_body=len(body_dofs),
            body_dof=np.array(body_dofs or [0], dtype=np.int64),
            body_q=np.array([q_of[i] for i in stops] or [0], dtype=np.int64),
            n_servos=len(servos),
            servo_dof=np.array(servos or [0], dtype=np.int64),
            servo_q=np.array([q_of[i] for i in servos] or [0], dtype=np.int64),
            servo_target=self.servo_target,
            servo_gain=joint_strength(self.model.rover) * np.array(SERVO_GAIN),
            n_stops=len(stops),
            stop_dof=np.array(stops or [0], dtype=np.int64),
            stop_q=np.array([q_of[i] for i in stops] or [0], dtype=np.int64),
            stop_limits=np.array(limits or [(0.0, 0.0)]).ravel(),
            stop_gain=joint_strength(self.model.rover) * np.array(STOP_GAIN),
        )

    def _bind_state(self, state: DriveState) -> None:
        self.duty = np.zeros(len(self.model.rover.wheels))
        odd = [-1.0 if each.odd else 1.0 for effect in self.model.contact_effects for each in effect.states]
        self._set(
            q=state.q,
            v=state.v,
            contact_states=state.contact,
            motor_states=state.motor,
            n_contact_states=state.contact.shape[1],
            n_motor_states=state.motor.shape[1],
            contact_odd=np.array(odd or [1.0]),
            duty=self.duty,
        )

    def _bind_terrain(self) -> None:
        radius = max(float(wheel.wheel.r) for wheel in self.model.rover.wheels)
        self._set(**terrain_fields(self.model.terrain, radius))

    def _bind_laws(self) -> None:
        model = self.model
        room = sizes(library())
        made, rigid = compiled_laws(structure_of(model)), self.keep["rigid_handle"].work
        self.soils = np.array([laws.numbers([soil]) for soil in model.soils])
        assert made.lanes == room.lanes, "the laws and the step are compiled for other lanes"
        self._set(
            soils=self.soils,
            n_soils=len(self.soils),
            n_held=made.held,
            held=np.zeros((self.struct.n_kinds * len(self.soils), max(1, made.held))),
            held_lanes=aligned(room.questions * made.held + 8),
            step=aligned(room.step // 8 + 1),
            contact_parameters=np.append(laws.numbers(model.contact_effects), 0.0),
            motor_parameters=laws.numbers([model.motor, *model.motor_effects]),
            body_parameters=np.append(laws.numbers(model.body_effects), 0.0),
            contact_before=made.contact_before,
            contact_law=made.contact,
            motor_law=made.motor,
            body_law=made.body,
            work_i=np.zeros(max(made.work[0], rigid[0]) + 1, dtype=np.int64),
            work_w=np.zeros(max(made.work[1], rigid[1]) + 1),
        )
        self.keep["laws"] = made


def rim_inertia(model: pin.Model, rover: Any) -> np.ndarray:
    """Return what each wheel turns about its axle [kg m^2], its rotor included: the same in any configuration."""
    M = pin.crba(model, model.createData(), pin.neutral(model))
    return np.array([M[wheel.dof, wheel.dof] for wheel in rover.wheels])


def supports(model: pin.Model, joint: int) -> list[int]:
    """Return the indices of the velocities that move this joint, from the base outwards."""
    return [
        index
        for each in list(model.supports[joint])[1:]
        for index in range(model.joints[each].idx_v, model.joints[each].idx_v + model.joints[each].nv)
    ]


def armed(model: pin.Model, drive: Model) -> pin.Model:
    """Return a copy of Pinocchio's model with the motors' rotors on the wheels."""
    copy = model.copy()
    armature = np.array(copy.armature)
    for wheel in drive.rover.wheels:
        armature[wheel.dof] = float(drive.motor.armature)
    copy.armature = armature
    return copy
