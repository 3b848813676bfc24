"""Half-second blocks of a drive log and their noise, without any search; predictions of a moment ago are kept."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin import Trace, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.experiments.drive_log import experiment as experiments
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.simulation.replay import commands, replay
from rover_pin.simulation.simulate import Timing
from rover_pin.simulation.start import Start

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
STEERED = ("fl", "fr", "rl", "rr")
ANY = DriveExperiment((), ())
LOGGED = ("t_s", "duty", "wheel_rate", "body", "rocker", "bogie")


@pytest.fixture(scope="module")
def model():
    return scenario("incline", **{"soil.k": 0.005, "terrain.angle_deg": 5}).model


def duties(t):
    return 0.6 + 0.15 * math.sin(1.3 * t) + 0.03 * np.arange(6)


@pytest.fixture(scope="module")
def driven(model):
    return simulate(model, lambda reading: duties(reading.t), 6.0, Start(-0.2), Timing(0.005))


def as_logged(trace):
    channels = {name: row for name, row in trace.channels.items() if name.startswith(LOGGED)}
    return Trace(channels, attrs={"start": {"x": -0.2, "y": 0.0, "yaw": 0.0}})


def test_a_replay_of_the_true_model_drives_as_the_log(model, driven):
    """At twice the step; but for the first 100 ms, in which the wheels jump from rest to speed and the body rings."""
    run = commands(as_logged(driven), WHEELS, STEERED)
    again = replay(model, run).channels
    for name, off in {
        "body_x": 5e-4,
        "body_z": 2e-5,
        "body_pitch": 1e-4,
        "wheel_rate_ml": 1e-2,
        "slip_rr": 1e-2,
    }.items():
        assert again[name][2:] == pytest.approx(driven[name][2:], abs=off), name


def test_a_replay_stays_where_the_log_was_and_tells_its_own_way(model, driven):
    weak = model.having(SupplySag(R_b=8.0))
    run = commands(as_logged(driven), WHEELS, STEERED)
    channels, free = (
        replay(weak, run).channels,
        replay(weak, dataclasses.replace(run, place=run.place * np.nan)).channels,
    )
    offset_held, lost = driven["body_x"][-1] - channels["body_x"][-1], driven["body_x"][-1] - free["body_x"][-1]
    assert lost > 0.008
    assert offset_held == pytest.approx(lost, rel=0.25)  # its own way is as short, though it was drawn along
    assert channels["body_z"][-1] == pytest.approx(driven["body_z"][-1], abs=3e-4)  # and it stood on the same ground


def test_a_body_that_cannot_be_is_turned_down_not_crashed_on(model, driven):
    """A fit may try to take off a mass that leaves the base no inertia."""
    experiment = experiment_of([logged_run(as_logged(driven), model.rover)], model)
    impossible, right = experiment.predict([model.having(PointMass(m=-2.0)), model])
    path = experiment.channels.index("path")
    assert np.isfinite(impossible).all()
    distant, close = (
        np.nanmedian(np.abs(experiment.observed - prediction)[0, path]) for prediction in (impossible, right)
    )
    assert distant > 10 * close


@pytest.mark.parametrize(
    ("name", "message"),
    [("sol.phi", "no 'sol' to fit"), ("soil.fi", "'soil' has no number 'fi'"), ("Sag.R", "no 'Sag' to fit")],
)
def test_an_unknown_number_is_refused(model, name, message):
    with pytest.raises(ParameterError, match=message):
        ANY.value(model, name)


def test_model_is_replayed_once_and_another_model_or_ground_anew(monkeypatch):
    case = scenario("incline", **{"soil.k": 0.005, "terrain.angle_deg": 5})
    driven = simulate(case.model, case.controller, 2.0, Start(-0.2))
    log = Trace(dict(driven.channels), attrs={"start": {"x": -0.2, "y": 0.0, "yaw": 0.0}})
    counted, real = [], experiments.replay
    monkeypatch.setattr(experiments, "replay", lambda *value: counted.append(1) or real(*value))
    experiment = experiment_of([logged_run(log, case.model.rover)], case.model)
    first = experiment.predict([case.model])
    heavier = case.model.having(PointMass(m=0.5))
    again = experiment.predict([case.model, heavier])
    assert len(counted) == 2
    np.testing.assert_array_equal(again[0], first[0])
    assert not np.array_equal(again[1], first[0])
    again.fill(0.0)  # what is returned is the caller's own
    np.testing.assert_array_equal(experiment.predict([case.model])[0], first[0])
    assert np.isfinite(experiment.free.predict([case.model])).all()
    assert len(counted) == 3
