"""The compiled step: the C code of native/ as a library, together with the numbers of a model, and the generated code
of its laws and of its rigid-body dynamics.

Pinocchio only builds the rover's model from the URDF. CasADi generates the C code of the rigid-body dynamics from a
recursion over this model (`native/rigid_body.py`); no algorithm of Pinocchio computes a step here. The step that uses
Pinocchio's algorithms is `plain/step.py`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from rover_pin.simulation.compiled import laws
from rover_pin.simulation.compiled.drive_fields import joint_strength, rover_fields, terrain_fields
from rover_pin.simulation.compiled.generated_laws import compiled_laws, structure_of
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native import source
from rover_pin.simulation.native.shared import ENERGY, RECORD, DriveStruct, fill
from rover_pin.simulation.state import DriveState

DIRECTION_SPEED = 0.005
"""Minimum mean of rim speed and travel speed [m/s] for a single direction of travel. Below this value, the contact laws
of forward and of backward travel are blended. Without the blend, the forces would jump where a wheel changes its
direction."""
HOLDING_INERTIA = 1e6
"""Inertia of a wheel that is held to a measured rate, divided by the rover's m r^2 (mass times squared wheel radius).
The wheel then follows the rate to about 1e-7 rad/s. The wheels are eliminated first, so that the large number does not
spoil the condition of the other equations."""


class StepArrays:
    """The arrays that a step of a drive reads and writes: the state, the commands, and the forces on the wheels.

    The compiled step (`Kernel`) and the step in NumPy (`PlainStepper`) derive from this class, so that both have equal
    arrays, and a step of either can be undone by common code. `native/shared.py` documents the arrays.

    Parameters
    ----------
    model : Model
        The model to drive.
    state : DriveState
        Initial state of the steps; each step changes it in place.
    """

    def __init__(self, model: Model, state: DriveState):
        self.model, self.state = model, state
        wheels = len(model.rover.wheels)
        # Results of a step for each wheel: its quantities, present load, mean load, and the load predicted for the
        # step's end.
        self.record = np.zeros((wheels, len(RECORD)))
        self.loads, self.mean_loads = np.zeros((wheels, 6)), np.zeros((wheels, 6))
        self.foreseen = np.zeros((wheels, 4))
        self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1)
        # Commands. C needs the address of at least one steering angle, also for a rover without servos.
        self.duty = np.zeros(wheels)
        self.servo_wheels = [i for i, wheel in enumerate(model.rover.wheels) if wheel.steer_dof is not None]
        self.servo_target = np.zeros(max(1, len(self.servo_wheels)))
        # All arrays that a step changes, and that must be restored before a step is repeated.
        self.moving = [state.q, state.v, state.contact, state.motor, self.record, self.loads, self.foreseen]
        self.moving += [self.energy, self.impulse, self.differential]

    def saved_arrays(self) -> list[np.ndarray]:
        """Return copies of all arrays that a step changes. `restore` puts these copies back to undo the step."""
        return [array.copy() for array in self.moving]

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Put the copies `saved`, which `saved_arrays` returned, back into the arrays. This undoes all steps taken
        since then.
        """
        for array, value in zip(self.moving, saved, strict=True):
            array[...] = value


class Kernel(StepArrays):
    """The compiled step of a model. It is one of the two classes that advance a drive (`Stepper`); the other,
    `PlainStepper`, is written in NumPy and uses Pinocchio's algorithms.

    Parameters
    ----------
    model, state : Model, DriveState
        The model to drive, and its state, which the steps change (`StepArrays`).
    dt : float
        Length of the steps [s].
    symmetric : bool
        Keep the motion mirror-symmetric about the x-z plane.
    direction_speed : float
        Minimum mean of rim speed and travel speed [m/s] for a single direction of travel; below it, the contact laws of
        both directions are blended.
    """

    def __init__(
        self, model: Model, state: DriveState, dt: float, symmetric: bool, direction_speed: float = DIRECTION_SPEED
    ):
        super().__init__(model, state)
        rover = model.built
        # Fields that belong to the rover are stored for all its drives; the fields of this drive are set in a copy.
        strength, armature = joint_strength(model.rover), float(model.motor.armature)
        self.fixed = rover_fields(rover, armature, strength, model.rigid_differential, bool(model.body_effects))
        self.pin_model = self.fixed.pin_model
        self.keep: dict[str, Any] = {}
        """arrays and libraries behind the pointers of the struct; stored here so that Python does not free them"""
        self.struct = DriveStruct.from_buffer_copy(self.fixed.struct)
        self._set(dt=dt, direction_speed=direction_speed, symmetric=int(symmetric), accounts=1)

        # Records and commands.
        self._set(
            du=np.zeros(self.pin_model.nv),
            wheel_share=model.wheel_share,
            foreseen=self.foreseen,
            record=self.record,
            energy=self.energy,
            differential=self.differential,
            loads=self.loads,
            mean_loads=self.mean_loads,
            impulse=self.impulse,
            duty=self.duty,
            servo_target=self.servo_target,
        )

        # The rigid body's function writes one column; the fields point at its parts.
        column, ends = np.zeros(self.fixed.body.ends["potential"]), self.fixed.body.ends
        self.gravity, self.armature = np.array(self.pin_model.gravity.linear), np.array(self.pin_model.armature)
        self._set(
            rigid=column,
            nle=column[ends["inertia"] :],
            axes=column[ends["bias"] :],
            points=column[ends["axes"] :],
            rotation=column[ends["points"] :],
            potential=column[ends["rotation"] :],
            gravity=self.gravity,
            armature=self.armature,
        )

        # State. An odd state of an effect changes its sign when the direction of travel is mirrored.
        odd = [-1.0 if variable.odd else 1.0 for effect in model.contact_effects for variable in effect.states]
        self._set(
            q=state.q,
            v=state.v,
            contact_states=state.contact,
            motor_states=state.motor,
            n_contact_states=state.contact.shape[1],
            n_motor_states=state.motor.shape[1],
            contact_odd=np.array(odd),
        )

        # Ground, laws and library.
        self._set(**terrain_fields(model.ground, max(float(wheel.wheel.r) for wheel in model.rover.wheels)))
        self._bind_laws()
        self._step = library().rover_pin_step
        self._address = ctypes.addressof(self.struct)
        self.set_soils(self.soils)

    def step(self) -> int:
        """Advance the state by dt. Return 0 if the step succeeded, 1 if a velocity is not finite, or 2 if the equations
        are singular.
        """
        return int(self._step(self._address))

    @property
    def dt(self) -> float:
        """Length of the steps [s]."""
        return float(self.struct.dt)

    def set_step(self, dt: float) -> None:
        """Set the length of the following steps [s]."""
        self.struct.dt = dt

    def hold(self, rates: np.ndarray) -> None:
        """From now on, turn the wheels at these rates (wheels,) [rad/s] instead of driving them by the motors.

        The array is not copied: the caller may change the rates in place.
        """
        self._set(held_rate=rates, hold_inertia=HOLDING_INERTIA * self.model.built.mass * self.model.rover.radii**2)

    def keep_history(self, history: np.ndarray | None) -> None:
        """Record the lengths [s] of all following steps in the array `history`, or end the recording if `history` is
        None.

        The first entry of the array is the number of steps recorded so far; the lengths follow it.
        """
        self._set(history=history)

    @property
    def misjudged(self) -> float:
        """Forecast error of the last step [-], which decides whether the step has to be repeated in parts.

        At its end, each step predicts the load on every wheel; the next step computes the true load. The error is the
        difference between both, divided by the wheel's normal force; the largest one of all wheels is returned.
        """
        return self.struct.misjudged

    @property
    def growth(self) -> float:
        """Largest growth factor of a speed in the last step, if forces push the speed away from zero; 0 if no factor
        exceeds `pace.GROWS`. A large factor shows that the step is too long.
        """
        return self.struct.growth

    @property
    def pivoted(self) -> int:
        """Number of steps so far whose equations were nearly singular, so that their solution needed an exchange of
        rows (pivoting).
        """
        return int(self.struct.pivoted)

    def disable_energy_balance(self) -> None:
        """Stop the summation of energies and impulses over the steps, which a replay does not need."""
        self.struct.accounts = 0

    def set_soils(self, soils: np.ndarray) -> None:
        """Set the constants of all soils, an array (soils, constants) in the order of the fields of `Soil`, and compute
        the numbers of the contact law that depend on them.
        """
        self.soils[:] = soils
        library().rover_pin_hold(self._address)

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy of the rover in its present state [J]."""
        energy = np.zeros(2)
        library().rover_pin_energies(self._address, energy.ctypes.data)
        return float(energy[0]), float(energy[1])

    def _set(self, **values: Any) -> None:
        """Set fields of the C struct Drive by name. Arrays are also stored in `keep`, so that Python does not free the
        memory behind the pointers of the struct.
        """
        fill(self.struct, self.keep, values)

    def _bind_laws(self) -> None:
        """Set the fields of the struct Drive that describe the compiled laws: addresses of the C functions, parameters
        of the effects, constants of the soils, and work space.
        """
        model = self.model
        layout = step_layout(library())
        compiled, rigid_work = compiled_laws(structure_of(model)), self.fixed.body.work
        # Soils stay in an array that a replay may change; `set_soils` precomputes their constants.
        self.soils = np.array([laws.numbers([soil]) for soil in model.soils])
        assert compiled.lanes == layout.lanes, "the laws and the step are compiled for different numbers of lanes"
        self._set(
            soils=self.soils,
            n_soils=len(self.soils),
            # The contact law's constants for every kind of wheel on every soil, and their copies in the SIMD lanes.
            n_held=compiled.held,
            held=np.zeros((self.struct.n_kinds * len(self.soils), compiled.held)),
            held_lanes=aligned_zeros(layout.questions * compiled.held),
            step=aligned_zeros(layout.step // 8),
            contact_parameters=laws.numbers(model.contact_effects),
            motor_parameters=laws.numbers([model.motor, *model.motor_effects]),
            body_parameters=laws.numbers(model.body_effects),
            contact_before=compiled.contact_before,
            contact_law=compiled.contact,
            motor_law=compiled.motor,
            body_law=compiled.body,
            # One work space serves all functions, because they run one after another.
            work_i=np.zeros(max(compiled.work[0], rigid_work[0]), dtype=np.int64),
            work_w=np.zeros(max(compiled.work[1], rigid_work[1])),
        )
        self.keep["laws"] = compiled


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL:
    """Return the library of the compiled step; it is compiled on first use. Python calls these C functions of it:

    - `rover_pin_step(drive)`: take one step; returns 0, or the status of a failure.
    - `rover_pin_energies(drive, numbers)`: write kinetic and potential energy [J].
    - `rover_pin_hold(drive)`: precompute the constants of the contact law; must be called after a change of the soils.
    - `rover_pin_run(drive, loop, row)`: drive until a row is written, or until the loop has to return (`LoopStatus`).
    - `rover_pin_row(drive, loop, numbers)`: write the present state as a row.
    - `rover_pin_set_down(drive, settling)`: set the rover down (`Rest`).
    - `rover_pin_sizes(numbers)`: write the sizes of `StepLayout`.
    """
    handle = shared_library(source(), "kernel")
    # Without declared types, ctypes would pass addresses as 32-bit integers.
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
    # Structs of unequal sizes would make the C code read and write the wrong memory.
    assert step_layout(handle).drive == ctypes.sizeof(DriveStruct), (
        "the compiler and ctypes lay out the struct Drive differently"
    )
    return handle


class StepLayout(NamedTuple):
    """Sizes that the compiled library of the step reports: bytes of its structs, number of evaluations in one call, and
    number of SIMD lanes. Python reserves its memory accordingly.
    """

    drive: int
    "size of the struct Drive [bytes]"
    step: int
    "size of the struct Step [bytes]"
    questions: int
    """largest number of contact-law evaluations that one call of the library needs"""
    lanes: int
    """number of SIMD lanes: the contact and motor laws evaluate this number of patches or wheels together"""


def step_layout(handle: ctypes.CDLL) -> StepLayout:
    """Return the sizes of structs and arrays that a compiled library of the step reports."""
    counts = np.zeros(4, dtype=np.int64)
    handle.rover_pin_sizes(counts.ctypes.data)
    return StepLayout(*counts.tolist())


def aligned_zeros(count: int) -> np.ndarray:
    """Return an array of `count` zeros whose address is a multiple of 64 bytes, as SIMD instructions need."""
    room = np.zeros(count + 8)
    return room[(-room.ctypes.data // 8) % 8 :][:count]
