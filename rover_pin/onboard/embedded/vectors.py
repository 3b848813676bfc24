"""Test vectors of an exported slip control: random readings, and the results of the Python control for these readings.

The program `test_vectors.c` in the exported folder compares the C code with these results.
"""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.sensing.stop import StopStuck
from rover_pin.onboard.embedded.source import EmbeddedControl
from rover_pin.onboard.monitor.monitor import CANNOT_TELL, CAUSES
from rover_pin.simulation.command import Command, Reading, Truth

CORRELATION = 0.97
"""Correlation of successive random readings, which makes the readings change slowly, as measurements do."""
UNSEEN_FRACTION = 0.3
"""Fraction of the samples in the test vectors without a speed from visual odometry."""
SAMPLES_BETWEEN_RESETS = 100
"""Number of samples in the test vectors after which the control is reset, so that the C code of the reset is also
compared."""
READINGS = {"rate": (5.0, 4.0), "current": (0.6, 0.4), "link": (0.0, 0.15), "tilt": (0.0, 0.15), "slip": (0.3, 0.4),
           "travel": (0.05, 0.03), "duty": (0.5, 0.4)}  # fmt: skip
"""Mean and standard deviation of the random readings in SI units, by the group of readings. The values are typical of a
small rover."""


class _GivenSpeed(NamedTuple):
    """A visual odometry that returns the speed that is written in the reading, because the C code also takes the speed
    from the reading.
    """

    lag: int
    """latency, as a number of samples"""
    camera: object
    """the camera of the control's visual odometry; the particle filter uses its noise"""

    def reset(self) -> None:
        """Do nothing, because this visual odometry has no memory."""

    def speed(self, reading: Reading) -> float:
        """Return the forward speed in the reading [m/s], where `_python_answers` has written it."""
        return float(reading.truth.velocity[0])


def vectors(export: EmbeddedControl, count: int, seed: int = 0) -> Iterator[list[float]]:
    """Yield `count` rows of test vectors of an exported slip control, one for each sample.

    A row begins with 1 if the control is reset before the sample, and with 0 otherwise. The readings follow in the
    order of the C struct RoverReading, and then the results of the Python control: the duty, the slip and the depth of
    the hole of each wheel, the probability that the rover does not move, and 1 if the rover has been stopped. If the
    export has a monitor, P(stuck), P(buried), 1 for an alarm, the number of the cause, and the probability of each
    cause follow.

    Parameters
    ----------
    export : EmbeddedControl
        The exported control.
    count : int
        Number of samples.
    seed : int
        Seed of the random readings.
    """
    # The samples drive a copy of the export that has its own memory. The control, the stop and the monitor of the copy
    # must all refer to the copy's slip estimate. Its visual odometry returns the speed that is written in the reading.
    control, on_board = dataclasses.replace(export.control, integral=0.0, depth=0.0), export.on_board
    twin, wheels = dataclasses.replace(export, control=control), len(export.rover.wheels)
    if on_board is not None:
        odometry: Any = on_board.odometry and _GivenSpeed(on_board.odometry.lag, on_board.odometry.camera)
        estimate = dataclasses.replace(on_board, odometry=odometry)
        control = dataclasses.replace(control, estimate=estimate)
        stop = StopStuck(control, estimate, export.stop.stop) if export.stop else None
        monitor = export.monitor and export.monitor.reading_from(estimate)
        twin = dataclasses.replace(export, control=control, stop=stop, monitor=monitor)
    widths = {"duty": wheels, "rate": wheels, "current": wheels, "link": export.links, "tilt": 2, "travel": wheels}
    widths |= {"slip": wheels}
    random = np.random.default_rng(seed)
    state = {name: random.standard_normal(width) for name, width in widths.items()}
    for sample in range(count):
        resets = sample % SAMPLES_BETWEEN_RESETS == 0
        if resets:
            twin.controller.reset()
            if twin.monitor:
                twin.monitor.reset()
        # Each reading is an autoregressive process of first order with mean 0 and SD 1, scaled to its mean and SD.
        for name, width in widths.items():
            state[name] = CORRELATION * state[name] + math.sqrt(1 - CORRELATION**2) * random.standard_normal(width)
        read = {name: READINGS[name][0] + READINGS[name][1] * values for name, values in state.items()}
        read |= {"duty": np.clip(read["duty"], -1.0, 1.0), "slip": np.clip(read["slip"], -1.0, 1.0)}
        late_speed = math.nan if random.random() < UNSEEN_FRACTION else float(read["travel"][0])
        before = np.concatenate([read[name] for name in ("duty", "rate", "current", "link", "tilt")])
        inputs = [*before.tolist(), late_speed, *read["slip"].tolist(), *read["travel"].tolist()]
        yield [float(resets), *inputs, *_python_answers(twin, read, late_speed)]


def _python_answers(twin: EmbeddedControl, read: dict[str, np.ndarray], late_speed: float) -> list[float]:
    """Return the results of the Python control, and of the monitor if the export has one, for the readings of one
    sample.
    """
    blank, attitude = np.zeros(len(read["duty"])), (*read["tilt"].tolist(), 0.0)
    truth = Truth(read["slip"], blank, blank, read["travel"], np.zeros(3), np.array([late_speed, 0.0, 0.0]))
    reading = Reading(0.0, read["duty"], read["rate"], read["current"], read["link"], attitude, truth)
    command = twin.controller(reading)
    assert isinstance(command, Command)
    # The belief has been updated by the control; asking the estimate for the slip again would update it twice.
    on_board = twin.on_board
    slip = on_board.belief.estimates[:, 0] if on_board else twin.control.estimate.slip(reading)
    rows = [np.broadcast_to(row, blank.shape).tolist() for row in (command.duty, slip, twin.control.depth)]
    stopped = twin.stop.stopped if twin.stop else False
    answers = [*rows[0], *rows[1], *rows[2], on_board.p_stands if on_board else 0.0, float(stopped)]
    if twin.monitor is None:
        return answers
    ahead = twin.monitor.after(reading)
    cause = (*CAUSES, CANNOT_TELL).index(ahead.cause) if ahead.cause else -1
    return [*answers, ahead.p_stuck, ahead.p_buried, float(ahead.alarm), float(cause), *ahead.causes]
