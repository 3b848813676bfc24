"""Propose drives that a rover could make next: candidate runs, simulated with the channels and the noise of the log.

A rover on a prepared terrain with a tracker can drive over flat ground, over slopes and with ballast. `candidate_runs`
lists such runs. `next_drives` simulates them, and the most informative run is then chosen as the next measurement. In
the simulation, the most probable model drives each run freely. All other models are held to its path, as replays are
held to the path of a log.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from rover_pin.base.errors import SimulationError
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of_log
from rover_pin.experiments.drive_log.features import WHOLE, LoggedRun, blocks, comparable_rows
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.next_measurement import Offer
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import PERIOD, ReplayCommands, replay
from rover_pin.simulation.sensors import Sensors
from rover_pin.simulation.start import Start, shared_rest
from rover_pin.terrain.shapes import cross_slope
from rover_pin.terrain.terrain import BEYOND, Lanes, Profile, Terrain

DURATION = 20.0
"""Duration of a candidate run [s]."""
SLOPE, STEEP_SLOPE = math.radians(6.0), math.radians(15.0)
"""Slope of most sloped runs [rad], and slope on which a rover rolls down while its motors are shorted (duty 0)
[rad]."""
DESCENDING = (0.8, 0.65, 0.5, 0.35, 0.2, 0.06)
STAIRS = (*DESCENDING, *DESCENDING[-2::-1])
"""Duties of a run whose duty goes down and up again in steps. The lowest duty is below the dead band of a driver and
the friction of a gear."""
FASTER, SLOWER = 1.45, 0.7
"""Duties of two additional drives over the ground of the log, as multiples of the log's median driving duty."""
HOLD, DUTY_RANGE, WHEEL_SPREAD = 2.5, (0.45, 0.85), 0.1
"""Random duties: the duration of each duty [s], the range of the mean duty of all wheels, and the maximum difference
between one wheel's duty and this mean."""
ONE_WHEEL_STEP = 0.25
"""Difference between one wheel's duty and the duty of the other wheels, in runs that test a single wheel."""
BALLAST = 0.2
"""Ballast of a loaded run, as a fraction of the mass of the rover."""
ROLLING_LABEL = "rolling"
"""Word in the label of a run with a rover that rolls freely. Such a run is not proposed if the wheels follow given
rates, because they cannot roll freely then."""
MOVING_DUTY = 0.1
"""Minimum mean duty of all wheels of a driving rover. The median duty of a log is taken over such rows."""


@dataclass(frozen=True, eq=False)
class CandidateRun:
    """One run that could be driven next on a prepared terrain, with straight steering.

    Parameters
    ----------
    label : str
        The run in words, without its duration.
    duty : np.ndarray
        Duties (rows, wheels), one row for each time step of a replay.
    start : Start
        Place and heading of the rover at the start.
    terrain : Terrain, optional
        Terrain of the run; None for the terrain of the log.
    ballast : float
        Additional mass at the rover's centre of mass [kg]. Every model that simulates the run includes it.
    fastest : float
        If the wheels follow given rates, the wheel rate for a `duty` of 1 [rad/s]. It is 0 if the wheels are driven by
        duties.
    """

    label: str
    duty: np.ndarray = field(repr=False)
    start: Start = Start()
    terrain: Terrain | None = field(default=None, repr=False)
    ballast: float = 0.0
    fastest: float = 0.0

    @property
    def description(self) -> str:
        """The run in words, beginning with its duration, for the proposal to the user."""
        return f"{DURATION:g} s {self.label}"

    def held_to(self, fastest: float) -> CandidateRun:
        """Return the run with wheel rates instead of duties. A duty of 1 becomes the wheel rate `fastest` [rad/s]."""
        label = self.label.replace("duty", "wheel rate").replace("duties", "wheel rates")
        return replace(self, label=f"{label} (1 is {fastest:.2g} rad/s)", fastest=fastest)

    def on(self, model: Model) -> Model:
        """Return a model that was fitted to the log with the terrain and the ballast of this run."""
        rover = model.rover.carrying(self.ballast) if self.ballast else model.rover
        return model.replace(rover=rover, terrain=self.terrain or model.terrain)

    def commands(self, rover: Rover, place: np.ndarray | None = None) -> ReplayCommands:
        """Return the commands for the simulation of a model on this run.

        `place` (rows, 3) with x, y [m] and yaw [rad] is the path that the simulation is held to. Without `place`, the
        model drives freely.
        """
        # NaN as the place lets the model drive freely.
        t = PERIOD * np.arange(len(self.duty))
        steered = sum(wheel.steer_dof is not None for wheel in rover.wheels)
        free = np.full((len(t), 3), np.nan)
        rate = self.fastest * self.duty if self.fastest else None
        return ReplayCommands(
            t, self.duty, np.zeros((len(t), steered)), free if place is None else place, self.start, rate
        )


def next_drives(leading: Sequence[Hypothesis]) -> Iterator[Offer]:
    """Yield the runs that could be measured next to distinguish between the leading hypotheses on the residual.

    A hypothesis is the base model together with a set of possible causes of the residual.

    The first hypothesis is the most probable one. A run is dropped if the model of this hypothesis cannot drive it to
    the end.
    """
    for run in _choice(leading):
        offer = _offer_of_run(run, leading[0].fit)
        if offer is not None:
            yield offer


def _offer_of_run(run: CandidateRun, fit: Fit) -> Offer | None:
    """Return a candidate run as a measurement that could be made next, simulated by the model of a fit.

    The result is None if the model cannot start the run or breaks it off. Otherwise it has the channels of the log. If
    the log does not measure the motor currents, these are added as further channels that could be measured.
    """
    # A run that the model cannot start or finish is no useful proposal.
    model, log = run.on(fit.model), experiment_of_log(fit)
    try:
        rest_state = shared_rest(model, run.start)
        free = replay(model, run.commands(model.rover), rest_state=rest_state)
    except SimulationError:
        return None
    if free.stop:
        return None
    # The path of the free simulation takes the part of a logged path, to which all models are held.
    place = np.column_stack([free.channels[name] for name in ("body_x", "body_y", "body_yaw")])
    commands = run.commands(model.rover, place)
    compared = comparable_rows(commands, [free.channels[f"wheel_rate_{wheel.name}"] for wheel in model.rover.wheels])
    currents = () if log.rate_driven else tuple(f"current_{wheel.name}_A" for wheel in model.rover.wheels)
    unmeasured = tuple(name for name in currents if name not in log.channels)
    channels = (*log.channels, *unmeasured)
    usable = blocks(compared, commands.period) > WHOLE
    blank = np.zeros((len(channels), len(usable)))
    ahead = LoggedRun(run.description, commands, channels, blank, place[:, 2], {}, compared, compared)
    experiment = DriveExperiment((ahead,), (rest_state,), log.jobs)
    noise = noise_with(fit.task.noise, log.channels, unmeasured, np.broadcast_to(usable, (1, *blank.shape)))
    return Offer(experiment, noise, run.on, unmeasured)


def noise_with(noise: Noise, channels: Sequence[str], unmeasured: Sequence[str], good: np.ndarray) -> Noise:
    """Return the noise of a planned run: the noise of the log's channels, and the noise of motor currents not yet
    measured.

    The noise of a current is the SD of one sample, multiplied by the ratio between the noise of the half-second means
    and the noise of single samples of the wheel rates. The ground is assumed to add equal relative noise to rates and
    currents.

    Parameters
    ----------
    noise : Noise
        Noise of the features in the log.
    channels, unmeasured : sequence of str
        Names of the log's channels, and of the currents that the log does not have.
    good : np.ndarray
        Mask of the values of the planned run that are compared (1, channels, blocks).
    """
    # The currents of a planned run are assumed to be independent of the log's channels and of each other.
    sensors, count = Sensors(), len(unmeasured)
    rates = [sd for name, sd in zip(channels, noise.floor, strict=True) if name.startswith("wheel_rate_")]
    ratio = max(1.0, float(np.median(rates)) / float(sensors.rate_sd)) if rates else 1.0
    return Noise(
        np.concatenate([noise.floor, np.full(count, ratio * float(sensors.current_sd))]),
        np.concatenate([noise.rho, np.zeros(count)]),
        block_diag(noise.mixing, np.eye(count)),
        good,
        noise.inflation,
    )


def _choice(leading: Sequence[Hypothesis]) -> tuple[CandidateRun, ...]:
    """Return the candidate runs that can distinguish between the leading hypotheses, at the median driving duty of the
    log.

    If an effect of a hypothesis acts at a place on the ground of the log, these are runs over this ground. If the
    wheels of the log follow given rates, the runs have wheel rates instead of duties, as fractions of the fastest
    logged rate.
    """
    experiment, rover = experiment_of_log(leading[0].fit), leading[0].fit.model.rover
    duty = np.concatenate([np.abs(run.commands.duty).mean(axis=1) for run in experiment.runs])
    # A log without a driven row gives no median, so the usual duty is taken.
    moving = duty[duty > MOVING_DUTY]
    cruise = round(float(np.median(moving)), 2) if moving.size else CRUISE_DUTY
    log_start = experiment.runs[0].commands.start
    if any("x_from" in effect.places for hypothesis in leading for effect in hypothesis.fit.model.all_effects):
        runs = on_own_ground(rover, cruise, log_start)
    else:
        # Wheels that a hypothesis names, by name or by number as in WeakMotor[2], are driven at a duty of their own.
        marks = {name.partition("[")[2].rstrip("]") for hypothesis in leading for name in hypothesis.names}
        alone = [i for i, wheel in enumerate(rover.wheels) if wheel.name in marks or str(i) in marks]
        runs = candidate_runs(rover, cruise, log_start, alone or [0])
    if not experiment.rate_driven:
        return runs
    rates = [np.abs(run.commands.rate) for run in experiment.runs if run.commands.rate is not None]
    fastest = max(float(np.max(rate)) for rate in rates)
    return tuple(run.held_to(fastest) for run in runs if ROLLING_LABEL not in run.label)


def candidate_runs(
    rover: Rover, cruise: float, log_start: Start, alone: Sequence[int] = (0,)
) -> tuple[CandidateRun, ...]:
    """Return all candidate runs for a rover: on flat ground, on slopes, with ballast, and over the ground of the log.

    Parameters
    ----------
    rover : Rover
        The rover of the log.
    cruise : float
        Median duty of the rover while it drives in the log. Runs at a constant duty have this duty.
    log_start : Start
        Start pose of the runs over the ground of the log.
    alone : sequence of int
        Indices of the wheels that are tested singly. Each gets a run of its own, with a duty that differs from the duty
        of the other wheels.
    """
    # Runs come in both directions, because a slope or a drag looks different in each of them.
    wheels, flat, up, back = len(rover.wheels), _ramp(0.0), _ramp(SLOPE), Start(yaw=math.pi)
    slope, steep = (f"{math.degrees(angle):.0f} deg" for angle in (SLOPE, STEEP_SLOPE))
    steady, steady_duty = _duties([cruise], wheels), f"at a constant duty of {cruise:.2f}"
    hard, coast, stairs = _duties([0.8], wheels), _duties([0.4, 0.0], wheels), _duties(STAIRS, wheels)
    pause, turn = _duties([cruise, cruise, 0.0, cruise, cruise], wheels), _duties([cruise, -cruise], wheels)
    on_the_flat = [
        CandidateRun(f"on the flat towards +x {steady_duty}", steady, Start(), flat),
        CandidateRun(f"on the flat towards -x {steady_duty}", steady, back, flat),
        CandidateRun("on the flat, the duty stepping from 0.8 down to 0.06 and back", stairs, Start(), flat),
        CandidateRun(f"on the flat, driving, a pause of 4 s, driving again, duty {cruise:.2f}", pause, Start(), flat),
        CandidateRun(f"on the flat, ahead and then back along the same path, duty {cruise:.2f}", turn, Start(), flat),
        CandidateRun("on the flat, duties held for 2.5 s at random, 0.45 to 0.85", _random(wheels), Start(), flat),
    ]
    for wheel in alone:
        # One wheel has a lower duty than the others in the first half of the run, and a higher one in the second half.
        duty = _duties([cruise, cruise], wheels)
        half = len(duty) // 2
        duty[:half, wheel] -= ONE_WHEEL_STEP
        duty[half:, wheel] = min(cruise + ONE_WHEEL_STEP, 1.0)
        own_duties = f"wheel {rover.wheels[wheel].name} at {duty[0, wheel]:.2f}, then at {duty[-1, wheel]:.2f}"
        on_the_flat.append(CandidateRun(f"on the flat at a duty of {cruise:.2f}, {own_duties}", duty, Start(), flat))
    on_slopes = [
        CandidateRun(f"up a slope of {slope} towards +x at a constant duty of 0.80", hard, Start(), up),
        CandidateRun(f"up a slope of {slope} towards -x at a constant duty of 0.80", hard, back, _ramp(-SLOPE)),
        CandidateRun(f"up a slope of {slope}, duties held for 2.5 s at random", _random(wheels), Start(), up),
        CandidateRun(f"down a slope of {slope} towards -x {steady_duty}", steady, back, up),
        CandidateRun(f"down a slope of {slope}, the duty stepping from 0.8 to 0.06 and back", stairs, back, up),
        CandidateRun(
            f"down a slope of {steep}, 10 s at a duty of 0.40, then rolling at duty 0", coast, back, _ramp(STEEP_SLOPE)
        ),
        CandidateRun(
            f"across a slope of {slope} that rises to the left {steady_duty}", steady, Start(), cross_slope(SLOPE)
        ),
    ]
    # Ballast changes the loads but not the motors, which separates effects of both.
    kilos = round(BALLAST * sum(inertia.mass for inertia in rover.model.inertias), 1)
    load = f"with ballast of {kilos:g} kg at the centre of mass"
    loaded = [
        CandidateRun(f"on the flat {load}, duty {cruise:.2f}", steady, Start(), flat, kilos),
        CandidateRun(f"up a slope of {slope} {load}, duty 0.80", hard, Start(), up, kilos),
        CandidateRun(f"on the flat {load}, duties held for 2.5 s at random", _random(wheels), Start(), flat, kilos),
    ]
    return (*on_the_flat, *on_slopes, *loaded, *on_own_ground(rover, cruise, log_start))


def on_own_ground(rover: Rover, cruise: float, log_start: Start) -> tuple[CandidateRun, ...]:
    """Return the candidate runs over the ground of the log, for effects that act at a place on this ground.

    For the arguments, see `candidate_runs`.
    """
    wheels = len(rover.wheels)
    # Other duties than the logged one, over the same ground.
    fast, slow = min(FASTER * cruise, 1.0), SLOWER * cruise
    label = f"over the logged ground from x = {log_start.x:.2g} m, heading {math.degrees(log_start.yaw):.0f} deg"
    return (
        CandidateRun(f"{label} at a constant duty of {fast:.2f}", _duties([fast], wheels), log_start),
        CandidateRun(f"{label} at a constant duty of {slow:.2f}", _duties([slow], wheels), log_start),
        CandidateRun(f"{label}, the duty stepping from 0.8 down to 0.06 and back", _duties(STAIRS, wheels), log_start),
    )


def _ramp(slope: float) -> Lanes:
    """Return a plane that rises towards +x by the angle `slope` [rad], as the terrain of a run."""
    x = np.array([-BEYOND[0], BEYOND[0]])
    return Lanes((Profile(x, x * math.tan(slope)),))


def _duties(levels: Sequence[float], wheels: int) -> np.ndarray:
    """Return duties (rows, wheels), equal for all wheels, that hold each of the duties in `levels` for an equal part of
    DURATION.
    """
    rows = np.arange(round(DURATION / PERIOD))
    column = np.asarray(levels, dtype=float)[rows * len(levels) // len(rows)]
    return np.repeat(column[:, None], wheels, axis=1)


def _random(wheels: int) -> np.ndarray:
    """Return random duties (rows, wheels), each held for HOLD seconds. Every call returns equal duties."""
    # The seed is fixed, so that a proposed run is the same in every proposal.
    random, count = np.random.default_rng(0), math.ceil(DURATION / HOLD)
    duties = random.uniform(*DUTY_RANGE, (count, 1)) + random.uniform(-WHEEL_SPREAD, WHEEL_SPREAD, (count, wheels))
    return np.asarray(np.repeat(np.clip(duties, -1.0, 1.0), round(HOLD / PERIOD), axis=0)[: round(DURATION / PERIOD)])
