"""The compiled loop over the steps, as Python uses it. One call runs a drive or a replay to its end, or until a
controller in Python has to be called.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from rover_pin.simulation.command import Instant, ReadingPlaces
from rover_pin.simulation.compiled.kernel import Kernel, library
from rover_pin.simulation.failure import MAX_OVERTRAVEL, MAX_SPEED, MIN_UPRIGHT_COSINE
from rover_pin.simulation.native.shared import LoopStruct, fill
from rover_pin.simulation.state import Checkpoint, suspension_places
from rover_pin.simulation.stepping.pace import FINEST
from rover_pin.simulation.trace.record import row_type


class LoopStatus(IntEnum):
    """Reason why the compiled loop returned to Python; the enum in native/structs.h has equal numbers."""

    DONE = 0
    """the requested number of rows is written, or the drive has reached its end"""
    NOT_FINITE = 1
    "a step failed: a velocity is not finite"
    SINGULAR = 2
    "a step failed: its equations are singular"
    ASKS = 3
    "a controller in Python has to be called"
    FAILS = 4
    """the drive has to end: the rover is too fast, has capsized, is buried, or has folded its suspension (`failure`)"""


QUESTIONS = 256
"""Number of readings for a controller in Python whose memory is reserved at once. A controller may keep its readings,
so that memory is not used again; new memory is reserved after this number of readings."""


class Loop:
    """The compiled loop over the steps of a drive. It also writes the rows of the drive and runs controllers of the
    package.

    Parameters
    ----------
    kernel : Kernel
        The compiled step, with its model and state.
    dt : float
        Length of a step [s] before it is divided into parts.
    steps : int
        Number of steps of the length dt in the drive.
    per_sample : int
        Number of steps of the length dt between two rows.
    **fields
        Further fields of the struct Loop (`native/shared.py`, LOOP_FIELDS), for example the fields of a controller.
    """

    def __init__(self, kernel: Kernel, dt: float, steps: int, per_sample: int, **fields: Any):
        model, state = kernel.model, kernel.state
        self.kernel, self.state = kernel, state
        # Python's arrays are shared with C: rows of the drive, and corrections of a replay.
        self.rows = np.zeros(steps // per_sample, dtype=row_type(model))
        "rows of the drive; only the first `row` of them are written so far"
        self.moved = np.zeros(3)
        self.struct = LoopStruct()
        self.keep: dict[str, Any] = {}
        self._run = library().rover_pin_run
        self._addresses = ctypes.addressof(kernel.struct), ctypes.addressof(self.struct)
        # Settings of any drive; those of a controller or a replay follow from `fields`.
        joints, stops = suspension_places(model.rover), model.rover.model
        self.set(
            dt=dt,
            rough=1.0,
            begin=state.t,
            steps=steps,
            per_control=steps,
            per_sample=per_sample,
            check_every=1,
            size=FINEST,
            obeyed=-1,
            row_size=self.rows.dtype.itemsize // 8,
            n_folding=len(joints),
            folding_q=joints,
            folding_limits=np.column_stack([stops.lowerPositionLimit[joints], stops.upperPositionLimit[joints]]),
            fastest=MAX_SPEED,
            upright=MIN_UPRIGHT_COSINE,
            buried=model.buried,
            folded=MAX_OVERTRAVEL,
            mass=model.built.mass,
            down=kernel.gravity.copy(),
            soils_at_rest=kernel.soils.copy(),
            **_moving(kernel.moving),
            log=self.rows,
            moved=self.moved,
            now=np.zeros(kernel.record.size + 1),
        )
        self.set(**fields)

    def set(self, **values: Any) -> None:
        """Set fields of the struct Loop by name. Arrays are not copied: C reads and writes the caller's arrays."""
        fill(self.struct, self.keep, values)

    def keep_history(self, count: int) -> None:
        """Record the lengths of the following steps, at most `count` of them. `steps_taken` returns the lengths."""
        # The first number is the count of steps, and one more step is needed to evaluate the forces (`pace.look`).
        self.history = np.zeros(2 + count)
        self.kernel.keep_history(self.history)
        # A step that is undone must not be counted, so that the counter is restored with the state.
        self.set(**_moving([*self.kernel.moving, self.history[:1]]))

    def steps_taken(self) -> np.ndarray:
        """Return the length [s] of each step since the last call of this function, or since `keep_history`, and clear
        the record.
        """
        lengths = self.history[1 : 1 + int(self.history[0])].copy()
        self.history[0] = 0.0
        return lengths

    def ask(self) -> None:
        """Make the loop return to Python at the beginning of every control period, so that a controller in Python can
        be called.
        """
        self.places = ReadingPlaces.of(self.kernel.model)
        self.set(asks=1, asked=QUESTIONS)

    def question(self) -> Instant:
        """Return the reading for a controller in Python, after the loop returned because the controller has to be
        called.
        """
        return Instant(self.keep["questions"], self.struct.asked - 1, self.places)

    def continue_from(self, checkpoint: Checkpoint) -> None:
        """Continue an earlier drive at its checkpoint (time and number of steps). The caller has already restored the
        arrays of the kernel to their values at the checkpoint.
        """
        self.set(begin=checkpoint.begin, k=checkpoint.steps, steps=checkpoint.steps + self.struct.steps)
        self.set(size=checkpoint.size)
        self.kernel.set_step(checkpoint.size * (self.struct.dt / FINEST))

    @property
    def checkpoint(self) -> Checkpoint:
        """Time and number of steps that the drive has reached, so that another loop can continue the drive."""
        return Checkpoint(self.struct.begin, self.struct.k, self.struct.size)

    def run(self, until: int) -> LoopStatus:
        """Drive until `until` rows are written, until the end of the drive, until a step or the drive fails, or until a
        controller in Python has to be called. Return which of these ended the loop. The time of the state is
        updated.
        """
        if self.struct.asks and self.struct.asked == QUESTIONS:
            self.set(asked=0, questions=np.zeros(QUESTIONS, dtype=self.rows.dtype))
        status = self._run(*self._addresses, until)
        self.state.t = self.struct.begin + self.struct.k * self.struct.dt
        return LoopStatus(status)

    def now(self) -> np.ndarray:
        """Return the present state of the drive in the form of a row. The row is not added to the rows of the drive."""
        row = np.zeros(1, dtype=self.rows.dtype)
        library().rover_pin_row(*self._addresses, row.ctypes.data)
        return np.asarray(row[0])

    @property
    def row(self) -> int:
        """Number of rows written so far."""
        return int(self.struct.row)

    @property
    def done(self) -> bool:
        """Whether the drive has reached its end."""
        return bool(self.struct.k >= self.struct.steps)


def _moving(arrays: Sequence[np.ndarray]) -> dict[str, Any]:
    """Return the fields of the struct Loop that describe the arrays which a step changes: their addresses and sizes,
    and memory for two copies of them. The loop needs the copies to undo steps.
    """
    assert all(array.flags.c_contiguous and array.dtype == float for array in arrays)
    # C copies the arrays by address and size, so they must be contiguous.
    sizes = np.array([array.size for array in arrays], dtype=np.int64)
    total = int(sizes.sum())
    addresses = np.array([array.ctypes.data for array in arrays], dtype=np.int64)
    return {
        "moving": addresses,
        "moving_sizes": sizes,
        "n_moving": len(sizes),
        "moving_size": total,
        "saved": np.zeros(2 * total),
    }
