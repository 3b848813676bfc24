"""Logs with nothing wrong in them: no check refuses one by chance, and warnings are rare.

Each log is drawn anew: another drive, sensors that scatter up to five times as much as usual, currents that only drift.
"""

import math

import numpy as np
import pytest

from rover_pin.experiments.drive_log.checks.log import NOTES, REFUSALS, driven_runs
from rover_pin.experiments.drive_log.checks.motors import OPPOSITE, doubtful_current_signs, wrong_wheel_signs
from tests.experiments.drive_log import drive_channels as channels

ALLOWED = {"pose_like_the_wheels"}
"""A rover on level ground slips evenly, as wheel odometry of another radius would have it: nothing tells them apart."""


def drifting_currents(run, random, size=0.004):
    """Currents of motors that draw next to nothing: a zero of a few mA that walks, and noise."""
    count = len(run["t_s"])
    walks = {
        f"current_{wheel}_A": size * (random.standard_normal() + np.cumsum(random.standard_normal(count)) / count**0.5)
        + 0.5 * size * random.standard_normal(count)
        for wheel in channels.WHEELS
    }
    return {**run, **walks}


def stairs(random, levels, hold=5.0):
    """A run of few duties, as a step test has."""
    run = channels.drive(0, duration=hold * len(levels), hill=0.0)
    duty = np.array(levels)[np.minimum((run["t_s"] // hold).astype(int), len(levels) - 1)]
    for wheel in channels.WHEELS:
        run[f"duty_{wheel}"] = duty
        run[f"wheel_rate_{wheel}"] = 2.2 * duty + 0.01 * random.standard_normal(len(duty))
    return run


def null_logs(seed):
    random = np.random.default_rng(seed)
    settings = {
        "duration": float(random.choice([12.0, 20.0, 40.0])),
        "yaw": random.uniform(-math.pi, math.pi),
        "hill": float(random.choice([0.0, 0.02, 0.12])),
    }
    trace = channels.drive(seed, **settings)
    noisy = channels.drive(seed, noise=float(random.choice([2.0, 5.0])), **settings)
    yield trace, {}
    yield noisy, {}
    yield drifting_currents(trace, random), {}
    yield drifting_currents(stairs(random, [0.4, 0.5, 0.6, 0.55]), random), {}
    yield {name: values for name, values in noisy.items() if not name.startswith(("duty", "current"))}, {"motor": {}}
    yield {**noisy, **{f"body_v{axis}": np.gradient(noisy[f"body_{axis}"], noisy["t_s"]) for axis in "xy"}}, {}
    yield {name: values[::12] for name, values in noisy.items()}, {}


def test_no_null_log_is_refused_and_few_are_warned_about():
    logs = [driven_runs(channels.log_of(run, **metadata))[0] for seed in range(40) for run, metadata in null_logs(seed)]
    refused = [str(finding) for run in logs for stage in REFUSALS for check in stage for finding in check.findings(run)]
    assert refused == []
    for check in NOTES:
        name = check.statistic.__name__
        if name not in ALLOWED:
            assert sum(any(check.findings(run)) for run in logs) <= 0.02 * len(logs), name


@pytest.mark.parametrize("duty", ["steps", "constant"])
def test_a_current_that_is_the_other_way_round_is_refused_where_that_is_sure(duty):
    """At steps of the duty, a reversed current changes against them; at a constant duty, only the motor shows it."""
    random = np.random.default_rng(3)
    run = channels.drive(1) if duty == "steps" else stairs(random, [0.6, 0.6])
    wheel_load = 1.0 if duty == "steps" else 0.5
    for wheel in channels.WHEELS:
        run[f"wheel_rate_{wheel}"] = wheel_load * run[f"wheel_rate_{wheel}"]
        drawn = (7.2 * run[f"duty_{wheel}"] - 3.35 * run[f"wheel_rate_{wheel}"]) / 24.0
        run[f"current_{wheel}_A"] = drawn + 0.002 * random.standard_normal(len(drawn))
    if duty == "steps":
        for wheel in channels.WHEELS:
            run[f"current_{wheel}_A"] = 0.1 * run[f"duty_{wheel}"] + 0.002 * random.standard_normal(len(run["t_s"]))
    upright = channels.log_of(run)
    assert [*wrong_wheel_signs(driven_runs(upright)[0], OPPOSITE)] == []
    turned = channels.log_of({**run, "current_ml_A": -run["current_ml_A"]})
    (what, todo) = next(wrong_wheel_signs(driven_runs(turned)[0], OPPOSITE))
    assert "current_ml_A" in what
    assert "-1" in todo
    if duty == "constant":
        unknown = driven_runs(channels.log_of({**run, "current_ml_A": -run["current_ml_A"]}, motor={}))[0]
        assert [*wrong_wheel_signs(unknown, OPPOSITE)] == []
        assert ["current_ml_A" in what for what, _ in doubtful_current_signs(unknown, OPPOSITE)] == [True]


@pytest.mark.parametrize("kind", ["duty", "rate"])
def test_a_wheel_that_stands_has_no_sign(kind):
    """Offsets of a driver and of a tachogenerator have any sign while nothing turns."""
    run = channels.drive(2, duration=20.0, hill=0.0)
    random = np.random.default_rng(0)
    count = len(run["t_s"])
    run["duty_fl"] = 0.01 + 0.002 * random.standard_normal(count)
    run["wheel_rate_fl"] = (-0.02 if kind == "rate" else 1.0) + 0.01 * random.standard_normal(count)
    assert not any("fl" in what for what, _ in wrong_wheel_signs(driven_runs(channels.log_of(run))[0], OPPOSITE))
