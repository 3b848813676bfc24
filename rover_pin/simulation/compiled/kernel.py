"""The compiled step: Pinocchio's matrices on one side, the generated laws on the other, native/ between them."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.generated_laws import compiled_laws, structure_of
from rover_pin.simulation.compiled.rover_numbers import rover_fields
from rover_pin.simulation.compiled.suspension import joint_strength
from rover_pin.simulation.compiled.terrain_numbers import terrain_fields
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.library import aligned_zeros, library, step_layout
from rover_pin.simulation.native.shared import ENERGY, RECORD, DriveStruct, fill
from rover_pin.simulation.state import DriveState

DIRECTION_SPEED = 0.005
"""Below this mean of rim and travel speed [m/s] the direction of travel is blended."""
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
        strength, armature = joint_strength(model.rover), float(model.motor.armature)
        self.fixed = rover_fields(rover, armature, strength, model.rigid_differential, bool(model.body_effects))
        self.pin_model = self.fixed.pin_model
        self.keep: dict[str, Any] = {}
        self.struct = DriveStruct.from_buffer_copy(self.fixed.struct)
        self.record = np.zeros((len(rover.wheels), len(RECORD)))
        self.loads, self.mean_loads = np.zeros((len(rover.wheels), 6)), np.zeros((len(rover.wheels), 6))
        self.foreseen = np.zeros((len(rover.wheels), 4))
        self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1)
        self._set(dt=dt, direction_speed=direction_speed, symmetric=int(symmetric), accounts=1)
        self._bind_rover(rover)
        self._bind_state(state)
        self._bind_terrain()
        self._bind_laws()
        self._step = library().rover_pin_step
        self._address = ctypes.addressof(self.struct)
        self.set_soils(self.soils)
        self.moving = [state.q, state.v, state.contact, state.motor, self.record, self.loads, self.foreseen]
        self.moving += [self.energy, self.impulse, self.differential]

    def step(self) -> int:
        """Advance the state by dt; return 0, or 1 (not finite) or 2 (singular)."""
        return int(self._step(self._address))

    @property
    def dt(self) -> float:
        """Length of its steps [s]."""
        return float(self.struct.dt)

    def set_step(self, dt: float) -> None:
        """Let steps have this length [s] from now on."""
        self.struct.dt = dt

    def saved_arrays(self) -> list[np.ndarray]:
        """Return a copy of all that a step changes."""
        return [array.copy() for array in self.moving]

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Go back to where `saved_arrays` was taken."""
        for array, value in zip(self.moving, saved, strict=True):
            array[...] = value

    def hold(self, rates: np.ndarray) -> None:
        """Turn the wheels at these rates [rad/s] from now on, whatever that takes; the array may change in place."""
        self._set(held_rate=rates, hold_inertia=HOLDING * self.model.built.mass * self.model.rover.radii**2)

    def keep_history(self, history: np.ndarray | None) -> None:
        """Count steps from now on in the first number, and put the length [s] of each behind it; None: no more."""
        self._set(history=history)

    @property
    def misjudged(self) -> float:
        """By how much of its normal force some wheel's load was not what the step before took it to become."""
        return self.struct.misjudged

    @property
    def growth(self) -> float:
        """By how much the last step enlarged a speed that forces push away; 0 where it was GROWS times or less."""
        return self.struct.growth

    @property
    def pivoted(self) -> int:
        """How many steps had to exchange rows to solve for their speeds."""
        return int(self.struct.pivoted)

    def disable_energy_balance(self) -> None:
        """Keep no account of energies and impulses from now on: a replay has no use for them."""
        self.struct.accounts = 0

    def set_soils(self, soils: np.ndarray) -> None:
        """Let the soils have these constants from now on: (soils, quantities), in the order of `Soil`'s fields."""
        self.soils[:] = soils
        library().rover_pin_hold(self._address)

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy [J] at the present state."""
        energy = np.zeros(2)
        library().rover_pin_energies(self._address, energy.ctypes.data)
        return float(energy[0]), float(energy[1])

    def _set(self, **values: Any) -> None:
        fill(self.struct, self.keep, values)

    def _bind_rover(self, rover: Any) -> None:
        """Bind what moves and what is recorded; `rover_fields` holds what the rover decides."""
        pin_model, ends = self.pin_model, self.fixed.body.ends
        column = np.zeros(ends["potential"])
        self.gravity, self.armature = np.array(pin_model.gravity.linear), np.array(pin_model.armature)
        self.servo_wheels = [i for i, wheel in enumerate(rover.wheels) if wheel.steer_dof is not None]
        self.servo_target = np.zeros(max(1, len(self.servo_wheels)))
        self._set(
            rigid=column,
            nle=column[ends["inertia"] :],
            axes=column[ends["bias"] :],
            points=column[ends["axes"] :],
            rotation=column[ends["points"] :],
            potential=column[ends["rotation"] :],
            gravity=self.gravity,
            armature=self.armature,
            servo_target=self.servo_target,
            wheel_share=self.model.wheel_share,
            du=np.zeros(pin_model.nv),
            foreseen=self.foreseen,
            record=self.record,
            energy=self.energy,
            differential=self.differential,
            loads=self.loads,
            mean_loads=self.mean_loads,
            impulse=self.impulse,
        )

    def _bind_state(self, state: DriveState) -> None:
        self.duty = np.zeros(len(self.model.rover.wheels))
        odd = [-1.0 if variable.odd else 1.0 for effect in self.model.contact_effects for variable in effect.states]
        self._set(
            q=state.q,
            v=state.v,
            contact_states=state.contact,
            motor_states=state.motor,
            n_contact_states=state.contact.shape[1],
            n_motor_states=state.motor.shape[1],
            contact_odd=np.array(odd),
            duty=self.duty,
        )

    def _bind_terrain(self) -> None:
        radius = max(float(wheel.wheel.r) for wheel in self.model.rover.wheels)
        self._set(**terrain_fields(self.model.ground, radius))

    def _bind_laws(self) -> None:
        model = self.model
        room = step_layout(library())
        compiled, rigid = compiled_laws(structure_of(model)), self.fixed.body.work
        self.soils = np.array([laws.numbers([soil]) for soil in model.soils])
        assert compiled.lanes == room.lanes, "the laws and the step are compiled for other lanes"
        self._set(
            soils=self.soils,
            n_soils=len(self.soils),
            n_held=compiled.held,
            held=np.zeros((self.struct.n_kinds * len(self.soils), compiled.held)),
            held_lanes=aligned_zeros(room.questions * compiled.held),
            step=aligned_zeros(room.step // 8),
            contact_parameters=laws.numbers(model.contact_effects),
            motor_parameters=laws.numbers([model.motor, *model.motor_effects]),
            body_parameters=laws.numbers(model.body_effects),
            contact_before=compiled.contact_before,
            contact_law=compiled.contact,
            motor_law=compiled.motor,
            body_law=compiled.body,
            work_i=np.zeros(max(compiled.work[0], rigid[0]), dtype=np.int64),
            work_w=np.zeros(max(compiled.work[1], rigid[1])),
        )
        self.keep["laws"] = compiled
