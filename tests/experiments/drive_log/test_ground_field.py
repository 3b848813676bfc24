"""The ground of a log as a random field, what grip and slope move, and the steps between lanes."""

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Soil, Trace, load_rover
from rover_pin.effects.bent_ground import BentGround
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.random_effects.learnt_noise import with_random_effects
from rover_pin.estimation.random_effects.random_field import SHARED
from rover_pin.experiments.drive_log import ground_variability
from rover_pin.experiments.drive_log import random_effects as ground
from rover_pin.experiments.drive_log.candidates import candidate_of, variants
from rover_pin.experiments.drive_log.excluded_rows import on_borders
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import LEAK, logged_run
from rover_pin.experiments.drive_log.model import parameter
from rover_pin.experiments.drive_log.random_effects import STEPS
from rover_pin.logs.run_terrain import GroundEstimate
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.replay import PERIOD, ReplayCommands, replay
from rover_pin.simulation.start import Start
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import BEYOND, HeightGrid, Lanes, Profile
from tests.experiments.drive_log.linear_drive import on_flat

SECONDS, SD = 12.0, 1e-3


@pytest.fixture(scope="module")
def model():
    return on_flat(Soil(k=0.005))


def commands(model, duty, yaw=0.0):
    t = PERIOD * np.arange(round(SECONDS / PERIOD))
    steer = np.zeros((len(t), sum(wheel.steer_dof is not None for wheel in model.rover.wheels)))
    return ReplayCommands(t, np.full((len(t), 6), duty), steer, np.full((len(t), 3), np.nan), Start(yaw=yaw))


def logged(truths, name="run"):
    """Return a run of each truth, without noise of its sensors."""
    runs = []
    for at, (truth, duty, yaw) in enumerate(truths):
        commanded = commands(truth, duty, yaw)
        drive = replay(truth, commanded)
        wheels = [wheel.name for wheel in truth.rover.wheels]
        duties = {f"duty_{wheel}": commanded.duty[:, at] for at, wheel in enumerate(wheels)}
        attrs = {"start": dataclasses.asdict(commanded.start), "file": f"{name}-{at}.csv"}
        runs.append(logged_run(Trace({**drive.channels, **duties}, attrs=attrs), truth.rover))
    return runs


@pytest.fixture(scope="module")
def two(model):
    return experiment_of(logged([(model, 0.6, 0.0), (model, 0.7, 0.0)]), model)


@pytest.fixture(scope="module")
def field(two, model):
    return two.random_field(model)


def of(field, kind, fold):
    """Return the columns of a kind of one run (columns, channels, blocks)."""
    return field.moved[(field.kind == ground.KINDS.index(kind)) & (field.fold == fold), fold]


def test_each_column_moves_its_own_run_alone(field):
    for at, fold in enumerate(field.fold):
        assert not np.delete(field.moved[at], fold, axis=0).any()
        assert np.isfinite(field.moved[at]).all()


def test_places_share_the_way_evenly(two, model):
    for run in two.runs:
        shares = ground.shares_of(run, model.rover)
        assert len(shares) > 3
        np.testing.assert_allclose(shares.sum(axis=0), 1.0)
        assert np.all(shares.max(axis=1) > 0.9)


def test_grip_of_a_run_acts_like_a_change_of_the_friction_angle(two, model, field):
    soil = model.soils[0]
    phi = math.atan((1 + ground.GRIP.size) * math.tan(soil.phi))
    second = model.replace(soils=(soil.replace(phi=phi), *model.soils[1:]))
    still, gripped = two.predict([model, second])
    scale = np.nanmax(np.abs(gripped - still), axis=2)
    for fold in range(2):
        field_change = of(field, ground.GRIP_OF_RUN, fold)[0]
        assert np.nanmax(np.abs(field_change - (gripped - still)[fold]) / np.maximum(scale[fold], 1e-6)[:, None]) < 0.05


def test_slope_of_a_run_acts_like_ground_of_that_slope(model):
    """The ground itself is inclined, a second way to say it: drive, currents and attitude move alike."""
    rise = Lanes(
        (Profile(np.array([-BEYOND[0], BEYOND[0]]), np.array([-BEYOND[0], BEYOND[0]]) * math.tan(ground.SLOPE.size)),)
    )
    experiment = experiment_of(logged([(model, 0.6, 0.0)]), model)
    inclined = experiment_of(experiment.runs, model.replace(terrain=rise))
    difference = inclined.predict([model.replace(terrain=rise)])[0] - experiment.predict([model])[0]
    field_change = of(experiment.random_field(model), ground.SLOPE_OF_RUN, 0)[0]
    for name in ("path", "body_pitch", "current_ml_A", "wheel_rate_rr"):
        row = experiment.channels.index(name)
        use = experiment.runs[0].usable
        wanted, field_part = difference[0, row, use], field_change[row, use]
        assert field_part @ wanted > 0.99 * np.linalg.norm(field_part) * np.linalg.norm(wanted), name
        assert np.linalg.norm(field_part) == pytest.approx(np.linalg.norm(wanted), rel=0.1), name


def on_estimate(model, truths):
    """Runs whose flat ground was estimated; the only error that the estimate may have is a slope along x."""
    x = np.linspace(-6.0, 6.0, 25)
    plane = np.repeat(ground.SLOPE.size * x[:, None], 2, axis=1)
    level = HeightGrid(-6.0, -6.0, 0.5, 12.0, np.zeros((25, 2)))
    estimate = GroundEstimate(level, plane[None], 0.0)
    runs = [
        dataclasses.replace(run, ground=estimate, commands=dataclasses.replace(run.commands, terrain=level))
        for run in logged(truths)
    ]
    return experiment_of(runs, model)


def test_an_error_of_the_estimated_ground_moves_all_runs_over_it(model):
    """One plane is uphill for one run and downhill for the other, and acts as the slope of each whole run does."""
    experiment = on_estimate(model, [(model, 0.6, 0.0), (model, 0.6, math.pi)])
    field = experiment.random_field(model)
    (error,) = field.moved[field.fold == SHARED]
    for fold, sense in ((0, 1.0), (1, -1.0)):
        of_run, use = of(field, ground.SLOPE_OF_RUN, fold)[0], experiment.runs[fold].usable
        for name in ("path", "body_pitch", "current_ml_A", "wheel_rate_rr"):
            row = experiment.channels.index(name)
            wanted, found = sense * of_run[row, use], error[fold, row, use]
            assert found @ wanted > 0.99 * np.linalg.norm(found) * np.linalg.norm(wanted), name
            assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(wanted), rel=0.1), name


def test_an_estimated_ground_states_its_error_and_breaks_no_declaration(model):
    """Two runs on a ground of 0.02 that was estimated as level: what is found is its SD, and no wrong declaration."""
    rise = np.array([-BEYOND[0], BEYOND[0]])
    truth = model.replace(terrain=Lanes((Profile(rise, 0.02 * rise),)))
    experiment = on_estimate(model, [(truth, 0.6, 0.0), (truth, 0.7, math.pi)])
    learnt_experiment = taught(experiment, model)
    variability = ground_variability.ground_variability(learnt_experiment, {"run-0", "run-1"})
    assert variability.worst is None
    assert variability.sentence == ""
    # Beforehand the SD is that of the shape; pitch and height of two runs leave a small part of it.
    assert 0.0 < variability.estimate_sd < 0.1 * ground.SLOPE.size
    assert variability.as_dict()["estimate_sd"] == variability.estimate_sd
    assert "estimated from the attitude" in variability.lines[-1]


def test_height_gained_at_one_place_persists_to_the_end(two, field):
    """A place's slope falls evenly to 0 at its neighbours: after them the ground is higher by slope times distance."""
    row, (run, *_) = two.channels.index("body_z"), two.runs
    place = run.commands.place[:, :2]
    way = np.nansum(np.hypot(*np.diff(place, axis=0).T))
    heights = of(field, ground.SLOPE, 0)[2:-1, row, run.usable]  # those whose whole stretch is compared
    assert heights[:, -1] - heights[:, 0] == pytest.approx(ground.SLOPE.size * way / (len(heights) + 2), rel=0.05)


def test_a_step_that_comes_late_is_a_way_that_stays_behind(model):
    """A step of the speed that comes d later is a way of d times the step, which stays; wheels turn as before."""
    commanded = commands(model, 0.4)
    duty = np.where(commanded.t[:, None] < 3.0, 0.4, 0.7) * np.ones(6)
    drive = replay(model, dataclasses.replace(commanded, duty=duty))
    keep = np.abs(commanded.t - 3.0) > 0.12
    names = [f"duty_{wheel.name}" for wheel in model.rover.wheels]
    attrs = {"start": dataclasses.asdict(commanded.start), "file": "run.csv"}
    channels = {**drive.channels, **dict(zip(names, duty.T, strict=True))}
    run = logged_run(Trace({name: row[keep] for name, row in channels.items()}, attrs=attrs), model.rover)
    experiment = experiment_of([run], model)
    (field_change,) = experiment.random_field(model).moved[-1]
    assert experiment.random_field(model).kinds[-1] == STEPS[0]
    speed = np.gradient(drive.channels["body_x"], commanded.t)
    gained = np.mean(speed[(commanded.t > 4.0) & (commanded.t < 5.0)]) - np.mean(
        speed[(commanded.t > 1.5) & (commanded.t < 2.5)]
    )
    uncertainty = np.diff(commanded.t[keep]).max() / math.sqrt(12.0)
    after = np.flatnonzero((run.times > 3.5) & run.usable)
    way = field_change[run.channels.index("path"), after]
    assert way == pytest.approx(-gained * uncertainty * np.exp(-(run.times[after] - 3.0) / LEAK), rel=0.15)
    assert np.abs(field_change[run.channels.index("wheel_rate_ml"), after]).max() < 0.02 * 0.3


def taught(experiment, model):
    """Return the fit of a base model and its noise, with the ground's SDs learnt, phi free."""
    good = np.isfinite(experiment.observed)
    noise = Noise(np.full(len(experiment.channels), SD), np.zeros(len(experiment.channels)),
                  np.eye(len(experiment.channels)), good)  # fmt: skip
    base = fit(Task(experiment, noise), model, [parameter(model, "soil.phi", math.radians(2.0))])
    return with_random_effects(base, (), experiment.random_field(base.model))


def test_runs_on_slopes_of_their_own_are_told_and_where(model):
    truths = [(model.having(GravityTilt(rise_x=rise, rise_y=0.0)), 0.6, 0.0) for rise in (0.02, -0.02, 0.0)]
    experiment = experiment_of(logged(truths), model)
    # a tilt of gravity shows in the drive, not in the attitude, which is of the table's frame: pitch is left out
    learnt_experiment = taught(_without(experiment, "body_pitch", "body_z"), model)
    variability = ground_variability.ground_variability(learnt_experiment)
    of_run = next(candidate for candidate in variability.learnt if candidate.kind == ground.SLOPE_OF_RUN)
    assert of_run.sd == pytest.approx(0.02, rel=0.4)
    assert variability.rms == pytest.approx(0.02 * math.sqrt(2 / 3), rel=0.15)
    assert abs(variability.worst.slope) == pytest.approx(0.02, rel=0.15)
    assert variability.worst.run in ("run-0", "run-1")
    assert math.copysign(1.0, variability.worst.slope) == (1.0 if variability.worst.run == "run-0" else -1.0)
    way = "more uphill" if variability.worst.run == "run-0" else "more downhill"
    assert re.fullmatch(
        rf"The ground is not as declared: its slope differs by 0\.9\d? deg rms, most in {variability.worst.run}, "
        rf"1\.\d deg {way} from \(x, y\) = \([-\d.]+, -?0\.00\) to \([\d.]+, -?0\.00\) m\.",
        variability.sentence,
    )
    assert "slope of a run" in variability.lines[0]
    assert variability.as_dict()["worst"]["run"] == variability.worst.run


BEND = BentGround(0.02, 0.03, 0.0, -0.02, -0.03, x_from=-0.3, length=1.0)


def test_a_bend_that_the_runs_share_is_fitted_as_an_effect(model):
    """Driven both ways over one bent ground, declared flat: knots along the way find the ground as it is bent."""
    truths = [(model.having(BEND), duty, yaw) for duty, yaw in ((0.6, 0.0), (0.7, math.pi), (0.75, 0.0))]
    experiment = experiment_of(logged(truths), model)
    (effect,) = variants(BentGround, model, experiment)
    bent = candidate_of(effect)
    noise = declared_noise(np.full(len(experiment.channels), SD), experiment.observed)
    model_built = fit(Task(experiment, noise), bent.on(model), bent.cause.parameters, stale=True).model
    x = np.concatenate([run.commands.place[:, 0] for run in experiment.runs])
    grid = np.linspace(np.nanquantile(x, 0.1), np.nanquantile(x, 0.9), 20)
    heights = [model_with_bend.ground.height(grid, 0.0) for model_with_bend in (model_built, model.having(BEND))]
    off, true = (row - row.mean() for row in (heights[0] - heights[1], heights[1]))
    assert np.std(off) < 0.1 * np.std(true)


def test_ends_of_a_stretch_follow_the_facing_direction(model):
    """Driven towards -x: what is uphill towards +x is downhill on this way, which is told from the larger x on."""
    tilted = model.having(GravityTilt(rise_x=0.02, rise_y=0.0))
    truths = [(tilted, 0.6, math.pi), (model, 0.6, math.pi), (model, 0.7, math.pi)]
    learnt_experiment = taught(_without(experiment_of(logged(truths), model), "body_pitch", "body_z"), model)
    worst = ground_variability.ground_variability(learnt_experiment).worst
    assert worst.run == "run-0"
    assert worst.slope < -0.01
    assert worst.begin[0] - worst.end[0] > 0.1
    assert abs(worst.begin[1] - worst.end[1]) < 0.05
    back = dataclasses.replace(
        logged_runs(learnt_experiment)[0], heading=logged_runs(learnt_experiment)[0].heading + math.pi
    )
    turned = dataclasses.replace(learnt_experiment.task.experiment, runs=(back, *logged_runs(learnt_experiment)[1:]))
    task = dataclasses.replace(learnt_experiment.task, experiment=turned)
    again = ground_variability.ground_variability(dataclasses.replace(learnt_experiment, task=task)).worst
    assert (again.begin, again.end) == (worst.end, worst.begin)


def logged_runs(runs):
    return runs.task.experiment.runs


def test_ground_as_declared_is_not_doubted(model):
    experiment = experiment_of(logged([(model, 0.6, 0.0), (model, 0.7, 0.0)]), model)
    learnt_experiment = taught(experiment, model)
    variability = ground_variability.ground_variability(learnt_experiment)
    assert variability.worst is None
    assert variability.sentence == ""
    assert variability.rms < 1e-3


def _without(experiment, *names):
    keep = np.array([name not in names for name in experiment.runs[0].channels])
    runs = tuple(
        dataclasses.replace(run, channels=tuple(np.array(run.channels)[keep].tolist()), observed=run.observed[keep])
        for run in experiment.runs
    )
    return dataclasses.replace(experiment, runs=runs)


ROVER = load_rover("nexus6")
LEFT = float(wheel_places(ROVER)["fl"][1])
X = np.array([-2.0, 0.0, 2.0])
B = float(ROVER.wheel.b)


def rows(y, x=0.5, yaw=0.0, terrain=None):
    """Return whether a wheel stands on a border where the rover stands, on lanes that part from x = 0 on."""
    lanes = Lanes((Profile(X, 0.0 * X), Profile(X, np.array([0.0, 0.0, 0.4]))), (0.0,))
    place = np.array([[x, y, yaw]])
    run = SimpleNamespace(t=np.zeros(1), place=place)
    return bool(on_borders(run, ROVER, lanes if terrain is None else terrain)[0])


@pytest.mark.parametrize("side", [LEFT, -LEFT])
def test_a_wheel_is_on_a_border_within_half_its_width(side):
    assert rows(-side)
    assert rows(-side + 0.49 * B)
    assert not rows(-side + 0.51 * B)


def test_the_middle_between_the_wheels_is_on_none():
    assert not rows(0.0)


def test_lanes_of_one_height_have_no_step():
    assert not rows(-LEFT, x=-1.0)
    assert not rows(-LEFT, terrain=flat())


def test_a_turned_rover_has_its_wheels_elsewhere():
    assert rows(0.0, yaw=math.pi / 2), "the middle wheels stand about the border"
    assert not rows(0.6, yaw=math.pi / 2)
