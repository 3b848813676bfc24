"""Exact derivatives of a whole drive by several numbers: the drive is computed once more with dual numbers, which carry
the derivatives through every step, the laws of soil and motors, and the control law.

The C code of the drive itself is translated to dual numbers (`native/dual.py`). The inputs of the drive (numbers of the
model, state at rest, control law) are computed in Python, and their derivatives are differences of inputs, not of
drives.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.simulation.compiled.generated_laws import Structure, law_functions, structure_of
from rover_pin.simulation.compiled.kernel import Kernel, step_layout
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.driving import RunningDrive, loop_of
from rover_pin.simulation.native import lanes, step_source
from rover_pin.simulation.native.compiled_body import rigid_body_laws
from rover_pin.simulation.native.dual import DUAL_SIZE, dual_laws_source, dual_source
from rover_pin.simulation.native.loop import Loop
from rover_pin.simulation.native.rigid_body import tree_of
from rover_pin.simulation.native.shared import FIELDS, LOOP_FIELDS, Fields, fill
from rover_pin.simulation.trace.record import row_type

MAX_NUMBERS = DUAL_SIZE - 1
"""Largest number of numbers whose derivatives one drive carries."""
OPTIONS = ("-ffp-contract=fast",)
"""Options of the compiler for code with dual numbers: products and sums may be fused, which saves about 7 % of the
time. Derivatives need not be equal to the bit on all processors."""
REPLACED = ("held_lanes", "work_w")
"""Arrays of the struct Drive that a drive with dual numbers does not take from the plain drive."""
NO_INPUTS = (*REPLACED, "held", "facets", "patches", "rigid", "nle", "axes", "points", "rotation", "potential", "log",
             "saved", "now", "bin", "work_i", "moving")  # fmt: skip
"""Arrays that a drive writes before it reads them, and `bin`, which only speeds up a search: they may differ between
neighbouring drives."""


class NoTangentError(Exception):
    """A drive has no tangent by a number. The message states why."""


class Neighbour(NamedTuple):
    """A drive with a slightly changed number, and its weight in the difference that gives the derivatives of the
    inputs.
    """

    weight: float
    drive: RunningDrive


class TangentDrive:
    """A drive that follows given steps, computed with dual numbers.

    Parameters
    ----------
    drive : RunningDrive
        The drive, which has not yet moved, with the lengths of its steps (`followed`). It stays as it is.
    duration : float
        Time to drive [s].

    Raises
    ------
    NoTangentError
        The controller is called from Python or estimates the slip on board, so that its derivatives are not known.
    """

    def __init__(self, drive: RunningDrive, duration: float):
        self.duration, self.row_type = duration, row_type(drive.model)
        self.loop, controller = loop_of(drive, duration)
        if controller is None:
            raise NoTangentError("the controller is called from Python")
        if controller.onboard is not None:
            raise NoTangentError("the slip estimate of the control has no derivatives")
        kernel = self.loop.kernel
        self.library, self.arrays = dual_library(), _Arrays.of(self.loop)
        # The laws with dual numbers, and the fields of the structs that hold their addresses.
        laws_of_model, body = dual_laws(structure_of(kernel.model)), _dual_body(*_body_key(kernel))
        control = {"slip_law": controller.slip, "drive_law": controller.law}
        laws_of_control = {name: _dual_control(part.law) for name, part in control.items() if part is not None}
        self.drive_functions = {**laws_of_model.fields(), "rigid_body": body.address(0)}
        self.loop_functions = {name: law.address(0) for name, law in laws_of_control.items()}
        self.libraries = [laws_of_model, body, laws_of_control]

    def input_slopes(self, neighbours: Sequence[Neighbour]) -> InputSlopes:
        """Return the derivatives of all inputs of the drive by one number: for each input the sum of weight times value
        over neighbouring drives that have not moved either.

        Raises NoTangentError: the neighbours differ from the drive in more than real numbers.
        """
        around = [(weight, _Arrays.of(loop_of(drive, self.duration)[0])) for weight, drive in neighbours]
        slopes: InputSlopes = {}
        for name, value in self.arrays.values.items():
            others = [(weight, arrays.values[name]) for weight, arrays in around]
            if any(np.shape(other) != np.shape(value) for _, other in others):
                raise NoTangentError(f"the size of the input {name} changes")
            if isinstance(value, np.ndarray) and value.dtype == np.int64:
                if not all(np.array_equal(other, value) for _, other in others):
                    raise NoTangentError(f"the input {name} changes, which has whole numbers")
                continue
            slope = _difference(value, others)
            if slope.any():
                slopes[name] = slope
        return slopes

    def rows(self, slopes: Sequence[InputSlopes]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Drive, and return the rows (`row_type`), and for each number the derivatives of the rows.

        `slopes` are the derivatives of the inputs by at most MAX_NUMBERS numbers.
        """
        rooms = _Rooms()
        drive = self._struct(_DriveStruct(), FIELDS, self.loop.kernel.struct, slopes, rooms)
        loop = self._struct(_LoopStruct(), LOOP_FIELDS, self.loop.struct, slopes, rooms)
        # The arrays that a step changes, and room for the intermediate results of a step.
        layout, keep = step_layout(self.library), dict[str, Any]()
        moving = np.array([rooms.room_of(array).ctypes.data for array in self.loop.kernel.moving], dtype=np.int64)
        constants = np.zeros((layout.questions * drive.n_held, DUAL_SIZE))
        fill(drive, keep, {"step": np.zeros(layout.step // 8), "held_lanes": constants, **self.drive_functions})
        fill(loop, keep, {"moving": moving, **self.loop_functions})
        # One call drives to the end.
        log = rooms.room_of(self.loop.rows).reshape(len(self.loop.rows), -1, DUAL_SIZE)
        addresses = ctypes.addressof(drive), ctypes.addressof(loop)
        self.library.rover_pin_hold(addresses[0])
        self.library.rover_pin_run(*addresses, len(log))
        columns = (np.ascontiguousarray(log[: loop.row, :, k]) for k in range(1 + len(slopes)))
        rows, *row_slopes = (column.view(self.row_type).reshape(-1) for column in columns)
        return rows, row_slopes

    def _struct(
        self, struct: Any, fields: Fields, plain: ctypes.Structure, slopes: Sequence[InputSlopes], rooms: _Rooms
    ) -> Any:
        """Fill a struct with dual numbers from the plain struct of the drive and the derivatives of its inputs."""
        for kind, names, declaration in fields:
            for name in names:
                value = getattr(plain, name)
                if kind is ctypes.c_double:
                    derivatives = [float(slope.get(name, 0.0)) for slope in slopes]
                    getattr(struct, name)[: 1 + len(slopes)] = [value, *derivatives]
                elif declaration == "double *{}" and value and name not in REPLACED:
                    room = rooms.room_of(self.arrays.kept[name])
                    for k, slope in enumerate(slopes):
                        if name in slope:
                            room[:, 1 + k] = slope[name]
                    setattr(struct, name, room.ctypes.data)
                else:
                    setattr(struct, name, value)
        return struct


InputSlopes = dict[str, np.ndarray]
"""Name of an input of a drive (a field of the structs Drive and Loop) -> its derivative by a number. Inputs that do not
depend on the number are missing."""


class _Arrays(NamedTuple):
    """The inputs of a drive."""

    kept: dict[str, np.ndarray]
    """name of a field of the structs Drive and Loop -> array behind its pointer"""
    values: dict[str, Any]
    """name of a field -> its value: a number, or a flat array; without room that the drive only writes to"""

    @staticmethod
    def of(loop: Loop) -> _Arrays:
        kernel = loop.kernel
        kept = {**kernel.fixed.keep, **kernel.keep, **loop.keep}
        values: dict[str, Any] = {}
        for struct, fields in ((kernel.struct, FIELDS), (loop.struct, LOOP_FIELDS)):
            for kind, names, declaration in fields:
                for name in names:
                    value = getattr(struct, name)
                    if kind is ctypes.c_double:
                        values[name] = value
                    elif kind is ctypes.c_int64:
                        values[name] = np.array(value)
                    elif declaration in ("double *{}", "integer *{}") and value and name not in NO_INPUTS:
                        values[name] = kept[name].ravel()
        return _Arrays(kept, values)


class _Rooms:
    """The arrays of a drive as arrays of dual numbers. Arrays that share memory share it as dual numbers too."""

    def __init__(self) -> None:
        self.rooms: dict[int, np.ndarray] = {}

    def room_of(self, array: np.ndarray) -> np.ndarray:
        """Return the room of dual numbers (n, DUAL_SIZE) for the n numbers of an array. At first it holds the values,
        without derivatives.
        """
        base = array.base if isinstance(array.base, np.ndarray) else array
        begin = base.ctypes.data
        if begin not in self.rooms:
            self.rooms[begin] = np.zeros((base.nbytes // 8, DUAL_SIZE))
            if base.size:
                self.rooms[begin][:, 0] = np.frombuffer(base, dtype=float)
        first = (array.ctypes.data - begin) // 8
        return self.rooms[begin][first : first + array.nbytes // 8]


def _difference(value: Any, around: Sequence[tuple[float, Any]]) -> np.ndarray:
    """Return the sum of weight times value over the neighbours. Values that are equal in all of them have no
    derivative, also if they are infinite.
    """
    total = np.zeros(np.shape(value))
    for weight, other in around:
        changed = np.asarray(other != value)
        if changed.any():
            total += np.where(changed, weight * (np.asarray(other) - value), 0.0)
    return total


def _dual_fields(fields: Fields) -> list[tuple[str, Any]]:
    """Return the fields of a struct with dual numbers in the place of its real numbers."""
    number = ctypes.c_double * DUAL_SIZE
    return [(name, number if kind is ctypes.c_double else kind) for kind, names, _ in fields for name in names]


class _DriveStruct(ctypes.Structure):
    _fields_ = _dual_fields(FIELDS)


class _LoopStruct(ctypes.Structure):
    _fields_ = _dual_fields(LOOP_FIELDS)


class DualFunctions(NamedTuple):
    """A compiled library of generated functions with dual numbers."""

    handle: ctypes.CDLL
    names: tuple[str, ...]
    """names of the C functions, in the order of `places`"""
    places: tuple[str, ...] = ()
    """names of the fields of the struct Drive that hold their addresses"""

    def address(self, k: int) -> int:
        """Return the address of the C function number k."""
        return ctypes.cast(getattr(self.handle, self.names[k]), ctypes.c_void_p).value or 0

    def fields(self) -> dict[str, int]:
        """Return the addresses by the names of the fields of the struct Drive."""
        return {place: self.address(k) for k, place in enumerate(self.places)}


@lru_cache(maxsize=1)
def dual_library() -> ctypes.CDLL:
    """Return the library of the step and the loop with dual numbers; it is compiled on first use."""
    handle = shared_library(dual_source(step_source()), "dual_kernel", OPTIONS)
    handle.rover_pin_hold.argtypes = [ctypes.c_void_p]
    handle.rover_pin_hold.restype = None
    handle.rover_pin_run.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    handle.rover_pin_sizes.argtypes = [ctypes.c_void_p]
    handle.rover_pin_sizes.restype = None
    # Structs of unequal sizes would make the C code read and write the wrong memory.
    assert step_layout(handle).drive == ctypes.sizeof(_DriveStruct), "compiler and ctypes lay out Drive differently"
    return handle


@lru_cache(maxsize=16)
def dual_laws(structure: Structure) -> DualFunctions:
    """Return the laws of a structure of effects with dual numbers."""
    before, during, motor, body = law_functions(structure)
    names = (f"{before.name()}_scalar", during.name(), motor.name(), *(f"{f.name()}_scalar" for f in body))
    return DualFunctions(
        shared_library(_dual_functions([during, motor], [before, *body]), "dual_laws", OPTIONS),
        names,
        ("contact_before", "contact_law", "motor_law", "body_law")[: len(names)],
    )


def _body_key(kernel: Kernel) -> tuple[Any, int, int]:
    model = kernel.pin_model
    return tree_of(model).joints, model.nq, model.nv


@lru_cache(maxsize=16)
def _dual_body(joints: Any, nq: int, nv: int) -> DualFunctions:
    during = rigid_body_laws(joints, nq, nv)[1]
    return DualFunctions(
        shared_library(_dual_functions([], [during]), "dual_body", OPTIONS), (f"{during.name()}_scalar",)
    )


@lru_cache(maxsize=16)
def _dual_control(law: ca.Function) -> DualFunctions:
    return DualFunctions(shared_library(_dual_functions([], [law]), "dual_control", OPTIONS), (f"{law.name()}_scalar",))


def _dual_functions(plain: Sequence[ca.Function], scalar: Sequence[ca.Function]) -> str:
    """Return the C source of generated functions with dual numbers. The functions in `scalar` are called with arrays
    of pointers to inputs and results, as CasADi's own code would be.
    """
    columns = [_one_column(function) for function in scalar]
    try:
        source = "".join(lanes.c_source(function) for function in [*plain, *columns])
    except ParameterError as error:
        raise NoTangentError(str(error)) from error
    return dual_laws_source(source, [(f.name(), f.n_in(), [f.numel_out(k) for k in range(f.n_out())]) for f in scalar])


def _one_column(function: ca.Function) -> ca.Function:
    """Return a function whose outputs are joined to one column."""
    inputs = [ca.SX.sym(f"in{k}", function.numel_in(k)) for k in range(function.n_in())]
    outputs = function.expand().call([ca.reshape(x, function.size_in(k)) for k, x in enumerate(inputs)])
    return ca.Function(function.name(), inputs, [ca.vertcat(*(ca.vec(ca.densify(out)) for out in outputs))])
