"""The compiled loop: a whole drive or replay in one call, or from one question to a controller to the next."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.failure import FASTEST, FOLDED, UPRIGHT
from rover_pin.simulation.instant import Instant, Places
from rover_pin.simulation.native.library import library
from rover_pin.simulation.native.shared import LoopStruct, fill
from rover_pin.simulation.pace import FINEST
from rover_pin.simulation.trace.rows import row_type


class Outcome(IntEnum):
    """Why the loop came back."""

    DONE = 0
    NOT_FINITE = 1
    SINGULAR = 2
    ASKS = 3
    FAILS = 4


QUESTIONS = 256
"""Rows of questions that have room at once; those that a controller keeps stay."""


class Loop:
    """Steps of a kernel with its rows; `rows` is filled as far as `row`."""

    def __init__(self, kernel: Kernel, dt: float, steps: int, per_sample: int, **fields: Any):
        model, state = kernel.model, kernel.state
        self.kernel, self.state = kernel, state
        self.rows = np.zeros(steps // per_sample, dtype=row_type(model))
        self.moved = np.zeros(3)
        self.struct = LoopStruct()
        self.keep: dict[str, Any] = {}
        self._run = library().rover_pin_run
        self._addresses = ctypes.addressof(kernel.struct), ctypes.addressof(self.struct)
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
            fastest=FASTEST,
            upright=UPRIGHT,
            buried=model.buried,
            folded=FOLDED,
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
        """Let fields of the struct Loop have these values; an array stays where it is."""
        fill(self.struct, self.keep, values)

    def keep_history(self, most: int) -> None:
        """Keep the lengths of steps from now on, `most` and a look at most."""
        self.history = np.zeros(2 + most)
        self.kernel.keep_history(self.history)
        self.set(**_moving([*self.kernel.moving, self.history[:1]]))

    def steps_taken(self) -> np.ndarray:
        """Return the length [s] of each step since `keep_history`, or since this was asked last."""
        lengths = self.history[1 : 1 + int(self.history[0])].copy()
        self.history[0] = 0.0
        return lengths

    def ask(self) -> None:
        """Let the loop come back at every control sample, to ask a controller."""
        self.places = Places.of(self.kernel.model)
        self.set(asks=1, asked=QUESTIONS)

    def question(self) -> Instant:
        """Return what is to be read at the instant at which the loop asks."""
        return Instant(self.keep["questions"], self.struct.asked - 1, self.places)

    def _make_room(self) -> None:
        if self.struct.asks and self.struct.asked == QUESTIONS:
            self.set(asked=0, questions=np.zeros(QUESTIONS, dtype=self.rows.dtype))

    def go_on(self, checkpoint: Checkpoint) -> None:
        """Count on from where a drive ended; the kernel's arrays are already as they were there."""
        self.set(begin=checkpoint.begin, k=checkpoint.steps, steps=checkpoint.steps + self.struct.steps)
        self.set(size=checkpoint.size)
        self.kernel.set_step(checkpoint.size * (self.struct.dt / FINEST))

    @property
    def checkpoint(self) -> Checkpoint:
        """How far the drive is."""
        struct = self.struct
        return Checkpoint(struct.begin, struct.k, struct.size)

    def run(self, until: int) -> Outcome:
        """Go on to the row `until`, or the end, a failure, or a question; the state's time follows."""
        self._make_room()
        step = self._run(*self._addresses, until)
        self.state.t = self.struct.begin + self.struct.k * self.struct.dt
        return Outcome(step)

    def now(self) -> np.ndarray:
        """Return the present instant as a row."""
        row = np.zeros(1, dtype=self.rows.dtype)
        library().rover_pin_row(*self._addresses, row.ctypes.data)
        return np.asarray(row[0])

    @property
    def row(self) -> int:
        """How many rows there are."""
        return int(self.struct.row)

    @property
    def done(self) -> bool:
        """Whether the last step is taken."""
        return bool(self.struct.k >= self.struct.steps)


def _moving(arrays: Sequence[np.ndarray]) -> dict[str, Any]:
    """Return the fields that say what a step changes, with room to save it twice."""
    assert all(array.flags.c_contiguous and array.dtype == float for array in arrays)
    lengths = np.array([array.size for array in arrays], dtype=np.int64)
    total = int(lengths.sum())
    addresses = np.array([array.ctypes.data for array in arrays], dtype=np.int64)
    return {
        "moving": addresses, "moving_sizes": lengths, "n_moving": len(lengths), "moving_size": total,
        "saved": np.zeros(2 * total),
    }  # fmt: skip
