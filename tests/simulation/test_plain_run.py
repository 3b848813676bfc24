"""The plain loop on a stepper that only counts: what it asks, notes and tells, row by row and step by step."""

import math

import numpy as np
import pytest

from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.command import Command
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import Drive
from rover_pin.simulation.native.shared import ENERGY, RECORD
from rover_pin.simulation.pace import FINEST
from rover_pin.simulation.plain.run import run_plain
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.start.place import Start, hovering, settled
from rover_pin.simulation.timing import Timing

MODEL = scenario("flat").model
TIMING = Timing(0.005, control=0.02, sample=0.05)


class Counting:
    """Moves the base by 1 mm a step; fails, or lifts a corner, when it is told to."""

    def __init__(self, state, bad=math.inf, tips=math.inf):
        self.state, self.bad, self.tips = state, bad, tips
        n, steered = len(MODEL.rover.wheels), 4
        self.record, self.loads = np.zeros((n, len(RECORD))), np.zeros((n, 6))
        self.energy, self.impulse, self.differential = np.zeros(len(ENERGY)), np.zeros(3), np.zeros(1)
        self.duty, self.servo_target, self.servo_wheels = np.zeros(n), np.zeros(steered), list(range(steered))
        self.misjudged, self.steps, self.lengths, self.pivoted, self.dt = 0.0, 0, [], 0, 0.005

    def set_step(self, dt):
        self.dt = dt
        self.lengths.append(dt)

    def saved(self):
        kept = (self.state.q, self.record, self.energy, self.impulse, self.differential)
        return [np.array(self.steps), *(each.copy() for each in kept)]

    def restore(self, saved):
        self.steps = int(saved[0])
        for array, value in zip(
            (self.state.q, self.record, self.energy, self.impulse, self.differential), saved[1:], strict=True
        ):
            array[...] = value

    def energies(self):
        return float(self.steps), -float(self.steps)

    def step(self):
        self.steps += 1
        self.state.q[0] += 1e-3
        self.record[:, RECORD.index("current")] = self.energy[:] = self.impulse[:] = self.differential[:] = self.steps
        if self.steps > self.tips:
            self.state.q[3:7] = 1.0, 0.0, 0.0, 0.0
        return int(self.steps > self.bad)


def drive(stepper, controller=lambda reading: 0.5, counted=None, timing=TIMING):
    return Drive(MODEL, stepper.state, stepper, controller, timing, counted)


def state():
    return hovering(MODEL, Start())


def test_it_asks_at_its_period_and_notes_every_sample():
    """Steps of 5 ms, questions every 20 ms, rows every 50 ms."""
    asked = []

    def controller(reading):
        asked.append((reading.t, float(reading.current[0])))
        return Command(0.01 * len(asked), 0.001 * len(asked))

    begun = state()
    begun.t = 3.0
    stepper = Counting(begun)
    ran = run_plain(drive(stepper, controller), 0.2, None)
    assert [t for t, _ in asked] == pytest.approx(3.0 + 0.02 * np.arange(10))
    assert [current for _, current in asked] == list(range(1, 41, 4)), "of that instant, by a look"
    assert ran.stop == "duration"
    assert ran.checkpoint == Checkpoint(3.0, 40, FINEST)
    rows, steps = ran.rows, np.array([10.0, 20.0, 30.0, 40.0])
    assert rows["t"] == pytest.approx(3.0 + 0.005 * steps)
    assert rows["q"][:, 0] == pytest.approx(1e-3 * steps)
    assert rows["record"][:, 2, RECORD.index("current")].tolist() == (steps + 1.0).tolist()
    for name in ("energy", "impulse"):
        assert rows[name][:, 1].tolist() == steps.tolist()
    assert rows["mechanical"][:, 0].tolist() == steps.tolist()
    assert rows["differential"].tolist() == (steps + 1.0).tolist()
    questions = np.array([3, 5, 8, 10])
    assert rows["duty"][:, 5] == pytest.approx(0.01 * questions)
    assert rows["servo"][:, 3] == pytest.approx(0.001 * questions)
    assert not rows["attitude"].any()


def test_a_step_without_numbers_ends_it_before_its_row():
    ran = run_plain(drive(Counting(state(), bad=17)), 1.0, None)
    assert ran.stop == "diverged at 0.09 s: a velocity is not finite"
    assert ran.rows["t"] == pytest.approx([0.05])
    assert (ran.checkpoint.steps, ran.checkpoint.size) == (17, 1)


def test_wheels_are_held_by_the_same_inertia_in_both_steps():
    """What it takes to hold them differs by that inertia's share: its first seven digits are the inverse dynamics'."""
    begun = settled(MODEL, Start())
    begun.q[2] += 0.5
    told = []
    for kind in (Plain, Kernel):
        stepper = kind(MODEL, begun.copy(), 0.005, False)
        stepper.hold(np.linspace(-2.0, 3.0, 6))
        assert stepper.step() == 0
        told.append(stepper.record[:, RECORD.index("torque")].copy())
    np.testing.assert_allclose(told[0], told[1], rtol=1e-8)


def test_a_plain_step_whose_numbers_are_lost_says_so():
    begun = settled(MODEL, Start())
    begun.v[0] = math.nan
    assert Plain(MODEL, begun, 0.005, False).step() == 1


def test_plain_step_returns_a_forced_differential_to_its_tie():
    """The compiled step, which eliminates the follower, keeps what it was given: drives begin tied."""
    begun, rover = settled(MODEL, Start()), MODEL.built
    begun.v[rover.differential.left] = 0.3
    G = constraint_rows(rover)
    assert np.abs(G @ begun.v).max() == pytest.approx(0.3)
    assert Plain(MODEL, begun, 0.005, False).step() == 0
    assert np.abs(G @ begun.v).max() < 1e-9
