"""Test vectors of a slip control that was taken away: readings that wander, and what the package answers to them."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.embedded.source import Embedded
from rover_pin.control.monitor.monitor import CANNOT_TELL, CAUSES
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.simulation.command import Command, Reading, Truth

MEMORY, UNSEEN, ANEW = 0.97, 0.3, 100
"""Correlation of a reading with the one before; share of samples in which visual odometry sees nothing; samples after
which the control begins anew."""
SPREADS = {"rate": (5.0, 4.0), "current": (0.6, 0.4), "link": (0.0, 0.15), "tilt": (0.0, 0.15), "slip": (0.3, 0.4),
           "travel": (0.05, 0.03), "duty": (0.5, 0.4)}  # fmt: skip
"""Mean and SD of what is read [SI]."""


class _Seen(NamedTuple):
    """Visual odometry whose speed is given with the reading."""

    lag: int
    camera: object

    def reset(self) -> None:
        """Forget nothing."""

    def speed(self, reading: Reading) -> float:
        """Return the speed that is given."""
        return float(reading.truth.velocity[0])


def vectors(taken: Embedded, count: int, seed: int = 0) -> Iterator[list[float]]:
    """Yield rows: 1 where the control begins anew, else 0; what is read, in the order of the C struct; what it answers.

    That is the duty, slip and hole of each wheel, the probability of standing, and 1 where it has stopped; with a
    monitor P(stuck), P(buried), 1 for an alarm, the cause's number, and P of each cause.
    """
    twin, wheels = _twin(taken), len(taken.rover.wheels)
    widths = {"duty": wheels, "rate": wheels, "current": wheels, "link": taken.links, "tilt": 2, "travel": wheels}
    widths |= {"slip": wheels}
    random = np.random.default_rng(seed)
    state = {name: random.standard_normal(width) for name, width in widths.items()}
    for at in range(count):
        if at % ANEW == 0:
            twin.controller.reset()
            if twin.monitor:
                twin.monitor.reset()
        for name, width in widths.items():
            state[name] = MEMORY * state[name] + math.sqrt(1 - MEMORY**2) * random.standard_normal(width)
        read = {name: SPREADS[name][0] + SPREADS[name][1] * values for name, values in state.items()}
        read |= {"duty": np.clip(read["duty"], -1.0, 1.0), "slip": np.clip(read["slip"], -1.0, 1.0)}
        late_speed = math.nan if random.random() < UNSEEN else float(read["travel"][0])
        yield [float(at % ANEW == 0), *_inputs(read, late_speed), *_outputs(twin, read, late_speed)]


def _inputs(read: dict[str, np.ndarray], late_speed: float) -> list[float]:
    before = np.concatenate([read[name] for name in ("duty", "rate", "current", "link", "tilt")])
    return [*before.tolist(), late_speed, *read["slip"].tolist(), *read["travel"].tolist()]


def _outputs(twin: Embedded, read: dict[str, np.ndarray], late_speed: float) -> list[float]:
    blank, attitude = np.zeros(len(read["duty"])), (*read["tilt"].tolist(), 0.0)
    truth = Truth(read["slip"], blank, blank, read["travel"], np.zeros(3), np.array([late_speed, 0.0, 0.0]))
    reading = Reading(0.0, read["duty"], read["rate"], read["current"], read["link"], attitude, truth)
    command = twin.controller(reading)
    assert isinstance(command, Command)
    on_board = twin.on_board
    slip = on_board.belief.told[:, 0] if on_board else twin.control.estimate.slip(reading)
    rows = [np.broadcast_to(row, blank.shape).tolist() for row in (command.duty, slip, twin.control.depth)]
    stopped = twin.stop.stopped if twin.stop else False
    answers = [*rows[0], *rows[1], *rows[2], on_board.p_stands if on_board else 0.0, float(stopped)]
    if twin.monitor is None:
        return answers
    ahead = twin.monitor.after(reading)
    cause = (*CAUSES, CANNOT_TELL).index(ahead.cause) if ahead.cause else -1
    return [*answers, ahead.p_stuck, ahead.p_buried, float(ahead.alarm), float(cause), *ahead.causes]


def _twin(taken: Embedded) -> Embedded:
    """Return the same at its beginning, with another memory, and the speed that is seen given."""
    control, on_board = dataclasses.replace(taken.control, integral=0.0, depth=0.0), taken.on_board
    if on_board is None:
        return dataclasses.replace(taken, control=control)
    odometry: Any = on_board.odometry and _Seen(on_board.odometry.lag, on_board.odometry.camera)
    estimate = dataclasses.replace(on_board, odometry=odometry)
    control = dataclasses.replace(control, estimate=estimate)
    stop = StopStuck(control, estimate, taken.stop.stop) if taken.stop else None
    monitor = taken.monitor and taken.monitor.reading_from(estimate)
    return dataclasses.replace(taken, control=control, stop=stop, monitor=monitor)
