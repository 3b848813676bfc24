"""Predictions of a moment ago are not made again, and are the same."""

import numpy as np

from rover_pin.effects.point_mass import PointMass
from rover_pin.experiments.drive_log import experiment as experiments
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start
from rover_pin.simulation.trace.trace import Trace


def test_model_is_replayed_once_and_another_model_or_ground_anew(monkeypatch):
    case = scenario("incline", **{"soil.k": 0.005, "terrain.angle_deg": 5})
    driven = simulate(case.model, case.controller, 2.0, Start(-0.2))
    log = Trace(dict(driven.channels), attrs={"start": {"x": -0.2, "y": 0.0, "yaw": 0.0}})
    counted, real = [], experiments.replay
    monkeypatch.setattr(experiments, "replay", lambda *given: counted.append(1) or real(*given))
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
