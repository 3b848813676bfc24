"""Candidate runs that a test bed could drive next: duty, slope, heading, load, each with a sentence that says it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import PERIOD, Commands
from rover_pin.simulation.start.place import Start
from rover_pin.terrain.profile import FAR, Profile
from rover_pin.terrain.shapes import cross_slope
from rover_pin.terrain.terrain import Lanes, Terrain

DURATION = 20.0
"""Length of a run [s]."""
SLOPE, STEEP = math.radians(6.0), math.radians(15.0)
"""Slope of most runs, and one on which a rover rolls down with its motors shorted."""
DOWN = (0.8, 0.65, 0.5, 0.35, 0.2, 0.06)
STAIRS = (*DOWN, *DOWN[-2::-1])
"""Duties of a staircase down and up again; the lowest is below what a dead band or a gear's friction takes."""
FASTER, SLOWER = 1.45, 0.7
"""Shares of the cruising duty at which the logged ground is driven again."""
HOLD, LEVELS, APART = 2.5, (0.45, 0.85), 0.1
"""Random duties: how long each is held [s], between which, and how far single wheels are from their mean."""
ALONE = 0.25
"""By how much of full duty one wheel differs from the others."""
BALLAST = 0.2
"""Ballast of a loaded run, as a share of the rover's mass."""


@dataclass(frozen=True, eq=False)
class CandidateRun:
    """One candidate run: `duty` (T, wheels), steering straight; `terrain` is the log's own where it is None.

    `ballast` [kg] is set down at the rover's centre of mass, and both models know it.
    """

    label: str
    duty: np.ndarray = field(repr=False)
    start: Start = Start()
    terrain: Terrain | None = field(default=None, repr=False)
    ballast: float = 0.0
    fastest: float = 0.0
    "rate of a wheel [rad/s] at 1, where `duty` is the share of a rate that the wheels are held to; 0: it is a duty"

    @property
    def description(self) -> str:
        """The run in words, with how long it is."""
        return f"{DURATION:g} s {self.label}"

    def held_to(self, fastest: float) -> CandidateRun:
        """Return the run at shares of a wheel rate [rad/s] instead of duties."""
        label = (
            f"{self.label.replace('duty', 'wheel rate').replace('duties', 'wheel rates')} (1 is {fastest:.2g} rad/s)"
        )
        return replace(self, label=label, fastest=fastest)

    def on(self, model: Model) -> Model:
        """Return a model of the log as it meets this run: on its ground, under its load."""
        rover = model.rover.carrying(self.ballast) if self.ballast else model.rover
        return model.replace(rover=rover, terrain=self.terrain or model.terrain)

    def commands(self, rover: Rover, place: np.ndarray | None = None) -> Commands:
        """Return the commands of a replay; it drives freely unless it is held to a `place` (T, 3)."""
        t = PERIOD * np.arange(len(self.duty))
        steered = sum(wheel.steer_dof is not None for wheel in rover.wheels)
        free = np.full((len(t), 3), np.nan)
        rate = self.fastest * self.duty if self.fastest else None
        return Commands(t, self.duty, np.zeros((len(t), steered)), free if place is None else place, self.start, rate)


def candidate_runs(
    rover: Rover, cruise: float, log_start: Start, alone: Sequence[int] = (0,)
) -> tuple[CandidateRun, ...]:
    """Return the candidate runs for a rover.

    Parameters
    ----------
    cruise : float
        Duty at which the rover of the log goes along, as the middle of the runs at one duty.
    log_start : Start
        Where a run on the log's own ground starts.
    alone : sequence of int
        Wheels that are tried at another duty than the rest.
    """
    wheels = len(rover.wheels)
    steady = _duties([cruise], wheels)
    return (
        *_on_the_flat(rover, cruise, alone),
        *_on_slopes(steady, wheels),
        *_loaded_runs(rover, steady),
        *on_own_ground(rover, cruise, log_start),
    )


def on_own_ground(rover: Rover, cruise: float, log_start: Start) -> tuple[CandidateRun, ...]:
    """Return the runs that cross the ground of the log again, for effects that are tied to a place on it."""
    wheels, name = len(rover.wheels), "over the logged ground"
    fast, slow = min(FASTER * cruise, 1.0), SLOWER * cruise
    begin = f"from x = {log_start.x:.2g} m, heading {math.degrees(log_start.yaw):.0f} deg"
    return (
        CandidateRun(f"{name} {begin} at a constant duty of {fast:.2f}", _duties([fast], wheels), log_start),
        CandidateRun(f"{name} {begin} at a constant duty of {slow:.2f}", _duties([slow], wheels), log_start),
        CandidateRun(
            f"{name} {begin}, the duty stepping from 0.8 down to 0.06 and back", _duties(STAIRS, wheels), log_start
        ),
    )


def _on_the_flat(rover: Rover, cruise: float, alone: Sequence[int]) -> tuple[CandidateRun, ...]:
    wheels, flat, back = len(rover.wheels), _ramp(0.0), Start(yaw=math.pi)
    steady, at = _duties([cruise], wheels), f"at a constant duty of {cruise:.2f}"
    pause, turn = _duties([cruise, cruise, 0.0, cruise, cruise], wheels), _duties([cruise, -cruise], wheels)
    return (
        CandidateRun(f"on the flat towards +x {at}", steady, Start(), flat),
        CandidateRun(f"on the flat towards -x {at}", steady, back, flat),
        CandidateRun(
            "on the flat, the duty stepping from 0.8 down to 0.06 and back", _duties(STAIRS, wheels), Start(), flat
        ),
        CandidateRun(f"on the flat, driving, a pause of 4 s, driving again, duty {cruise:.2f}", pause, Start(), flat),
        CandidateRun(f"on the flat, ahead and then back by the same way, duty {cruise:.2f}", turn, Start(), flat),
        CandidateRun("on the flat, duties held for 2.5 s at random, 0.45 to 0.85", _random(wheels), Start(), flat),
        *(_one_alone(rover, cruise, wheel, flat) for wheel in alone),
    )


def _one_alone(rover: Rover, cruise: float, wheel: int, terrain: Terrain) -> CandidateRun:
    """Return a run in which one wheel works less than the others, then more."""
    duty = _duties([cruise, cruise], len(rover.wheels))
    half = len(duty) // 2
    duty[:half, wheel] -= ALONE
    duty[half:, wheel] = min(cruise + ALONE, 1.0)
    name = rover.wheels[wheel].name
    label = (
        f"on the flat at a duty of {cruise:.2f}, wheel {name} at {duty[0, wheel]:.2f}, then at {duty[-1, wheel]:.2f}"
    )
    return CandidateRun(label, duty, Start(), terrain)


def _on_slopes(steady: np.ndarray, wheels: int) -> tuple[CandidateRun, ...]:
    up, back, degrees = _ramp(SLOPE), Start(yaw=math.pi), f"{math.degrees(SLOPE):.0f} deg"
    steep = f"{math.degrees(STEEP):.0f} deg"
    hard, coast = _duties([0.8], wheels), _duties([0.4, 0.0], wheels)
    side, at = cross_slope(SLOPE), f"at a constant duty of {steady[0, 0]:.2f}"
    return (
        CandidateRun(f"up a slope of {degrees} towards +x at a constant duty of 0.80", hard, Start(), up),
        CandidateRun(f"up a slope of {degrees} towards -x at a constant duty of 0.80", hard, back, _ramp(-SLOPE)),
        CandidateRun(f"up a slope of {degrees}, duties held for 2.5 s at random", _random(wheels), Start(), up),
        CandidateRun(f"down a slope of {degrees} towards -x {at}", steady, back, up),
        CandidateRun(
            f"down a slope of {degrees}, the duty stepping from 0.8 to 0.06 and back", _duties(STAIRS, wheels), back, up
        ),
        CandidateRun(
            f"down a slope of {steep}, 10 s at a duty of 0.40, then rolling at duty 0", coast, back, _ramp(STEEP)
        ),
        CandidateRun(f"across a slope of {degrees} that rises to the left {at}", steady, Start(), side),
    )


def _loaded_runs(rover: Rover, steady: np.ndarray) -> tuple[CandidateRun, ...]:
    mass = sum(inertia.mass for inertia in rover.model.inertias)
    kilos, up, degrees = round(BALLAST * mass, 1), _ramp(SLOPE), f"{math.degrees(SLOPE):.0f} deg"
    load, wheels = f"with ballast of {kilos:g} kg at the centre of mass", len(rover.wheels)
    return (
        CandidateRun(f"on the flat {load}, duty {steady[0, 0]:.2f}", steady, Start(), _ramp(0.0), kilos),
        CandidateRun(f"up a slope of {degrees} {load}, duty 0.80", _duties([0.8], wheels), Start(), up, kilos),
        CandidateRun(
            f"on the flat {load}, duties held for 2.5 s at random", _random(wheels), Start(), _ramp(0.0), kilos
        ),
    )


def _ramp(slope: float) -> Lanes:
    """Return a plane that rises along +x [rad]."""
    x = np.array([-FAR, FAR])
    return Lanes((Profile(x, x * math.tan(slope)),))


def _duties(levels: Sequence[float], wheels: int) -> np.ndarray:
    """Return duties (T, wheels) that share the duration equally."""
    rows = np.arange(round(DURATION / PERIOD))
    column = np.asarray(levels, dtype=float)[rows * len(levels) // len(rows)]
    return np.repeat(column[:, None], wheels, axis=1)


def _random(wheels: int) -> np.ndarray:
    """Return duties (T, wheels) as in a good campaign; the same at every call."""
    random, count = np.random.default_rng(0), math.ceil(DURATION / HOLD)
    duties = random.uniform(*LEVELS, (count, 1)) + random.uniform(-APART, APART, (count, wheels))
    return np.asarray(np.repeat(np.clip(duties, -1.0, 1.0), round(HOLD / PERIOD), axis=0)[: round(DURATION / PERIOD)])
