"""The noise that a drive log declares, held against what its samples scatter, and the floor of a model."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.experiments.drive_log.block_noise import scatter
from rover_pin.experiments.drive_log.checks.log import findings
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import BLOCK, logged_run
from rover_pin.logs.drive_log import kind_of
from rover_pin.rover.rover import load_rover
from tests.experiments.drive_log import drive_channels as channels

GOOD, log_of = channels.GOOD, channels.log_of


def declaring(**noise):
    return log_of(*GOOD, noise=noise)


def test_declared_noise_is_read_in_its_unit_for_every_kind():
    declared_text = declaring(
        wheel_rate=0.01, angle={"value": 1.0, "unit": "deg"}, body_position={"value": 2.0, "unit": "mm"}
    )
    assert declared_text.noise_sd == {"wheel_rate": 0.01, "angle": pytest.approx(math.pi / 180), "body_position": 2e-3}
    kinds = {
        "wheel_rate_fl": "wheel_rate", "rocker_l": "angle", "bogie_r": "angle", "current_fl_A": "current",
        "body_x": "body_position", "body_yaw": "body_attitude", "body_y": "body_position", "body_vy": "body_velocity",
        "body_pitch": "body_attitude", "battery_V": "battery", "duty_fl": "", "t_s": "",
    }  # fmt: skip
    assert {name: kind_of(name) for name in kinds} == kinds


@pytest.mark.parametrize(
    ("noise", "error", "says"),
    [
        ({"wheel_rates": 0.01}, DataError, "'wheel_rates' in .noise.: .* 'wheel_rate'"),
        ({"current": {"value": 0.0}}, DataError, "value = 0.01, unit = 'A'"),
        ({"current": "small"}, DataError, "current has no number"),
        ({"current": {"value": 1.0, "units": "A"}}, ParameterError, "'units': .* 'unit'"),
        ({"current": {"value": 1.0, "unit": "V"}}, ParameterError, "unit 'V'"),
    ],
)
def test_what_noise_cannot_be_is_refused(noise, error, says):
    with pytest.raises(error, match=says):
        _ = declaring(**noise).noise_sd


def test_floor_is_the_declared_noise_if_it_exceeds_the_scatter():
    rover = load_rover("nexus6")
    runs = [logged_run(run, rover) for run in log_of(*GOOD).runs]
    plain, wide, small = (
        DriveExperiment(tuple(runs), (None,) * 3, noise_sd=stated_noise).floor()
        for stated_noise in ({}, {"wheel_rate": 1.0, "sample_period": 0.04}, {"wheel_rate": 1e-6})
    )
    rate = [name.startswith("wheel_rate") for name in runs[0].channels]
    assert wide[rate] == pytest.approx(math.sqrt(0.04 / 0.5))
    assert np.array_equal(wide[~np.array(rate)], plain[~np.array(rate)])
    assert np.array_equal(small, plain)


def test_noise_declared_too_small_is_reported_and_correct_is_not():
    def said(noise):
        return [str(finding) for finding in findings(log_of(*GOOD, noise=noise)) if "[noise]" in str(finding)]

    assert said({"wheel_rate": 0.01, "body_attitude": 0.005, "body_position": 0.0015, "battery": 0.01}) == []
    (line,) = said({"battery": 0.001})
    assert re.search(r"\[noise\].*battery = 0\.001 V.*battery_V.* 0\.01", line)


PERIOD = 0.02
SAMPLES = 20_000


def run(row, usable=None):
    count = len(row) // round(BLOCK / PERIOD)
    return SimpleNamespace(
        commands=SimpleNamespace(period=PERIOD),
        usable=np.ones(count, dtype=bool) if usable is None else usable,
        measured_rows=lambda: {"one": row},
    )


def coloured(rho, sd=1.0, seed=0):
    steps = np.random.default_rng(seed).normal(size=SAMPLES) * np.sqrt(1 - rho**2)
    return sd * lfilter([1.0], [1.0, -rho], steps)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.6])
def test_it_is_the_sd_of_a_blocks_mean(rho):
    """Against the means of blocks of the noise itself; a slow motion of any size adds nothing."""
    noise, length = coloured(rho), round(BLOCK / PERIOD)
    true = noise.reshape(-1, length).mean(axis=1).std()
    t = PERIOD * np.arange(SAMPLES)
    for slow in (0.0, 20 * t, 50 * np.sin(0.05 * t)):
        (sd,) = scatter([run(noise + slow)], ["one"])
        assert sd == pytest.approx(true, rel=0.2)


def test_a_misfit_is_not_noise():
    """What a model leaves in half-second means, a tilt of the ground say, is far above the floor."""
    t = PERIOD * np.arange(SAMPLES)
    bent, noise = 0.02 * np.sin(2 * np.pi * t / 12.0), 1e-3 * coloured(0.0)
    (sd,) = scatter([run(bent + noise)], ["one"])
    assert sd == pytest.approx(1e-3 / np.sqrt(BLOCK / PERIOD), rel=0.3)
    assert sd < 0.02 * np.std(bent)
