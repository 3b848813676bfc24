"""A tracker, or visual odometry, with a scale and a delay of its own: declared, they are found within what is known."""

import re

import pytest

from rover_pin.base.errors import DataError
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay
from rover_pin.experiments.drive_log.model import base_model, nuisances, with_spread
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from tests.experiments.drive_log import drive_sets

SCALE, DELAY = 0.03, 0.12


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    hidden = [TrackerScale(e=SCALE), TrackingDelay(d=DELAY)]
    return drive_sets.write(tmp_path_factory.mktemp("odometry"), hidden, runs=3)


def declaring(folder, text):
    """Return the log with this table of its tracker."""
    file = folder / "drive.toml"
    without_tracker = re.sub(r"\[tracker\][^\[]*", "", file.read_text(encoding="utf-8"))
    file.write_text(without_tracker.replace("[soil]", f"[tracker]\n{text}\n[soil]", 1), encoding="utf-8")
    return read_drive_log(folder)


def test_scale_and_delay_are_found_within_what_is_declared(folder):
    log = declaring(folder, "e = { value = 0.0, sd = 0.05 }\nd = { value = 0.05, unit = 's', sd = 0.1 }\n")
    fit = drive_sets.calibrated_on(log, with_spread(base_model(log)))
    names = [parameter.name for parameter in fit.parameters]
    for name, true, prior in (("TrackerScale.e", SCALE, 0.05), ("TrackingDelay.d", DELAY, 0.1)):
        sd = prior * fit.spread[names.index(name)]
        assert abs(fit.value(name) - true) < 2.5 * sd
        assert sd < 0.3 * prior


def test_a_tracked_point_is_as_uncertain_as_the_log_declares(folder):
    log = declaring(folder, "x = { value = 20.0, unit = 'cm', sd = 5.0 }\ny = 0.1\n")
    model = base_model(log)
    (point,) = [effect for effect in model.sensor_effects if isinstance(effect, TrackedPoint)]
    assert (point.x, point.y) == (pytest.approx(0.2), 0.1)
    (number,) = [
        parameter for parameter in nuisances(log, with_spread(model)) if parameter.name.startswith("TrackedPoint")
    ]
    assert (number.name, number.origin, number.scale) == ("TrackedPoint.x", pytest.approx(0.2), pytest.approx(0.05))
    assert (number.declared, number.source) == (True, "declared in [tracker]")
    assert "TrackedPoint.y" not in {
        parameter.name for parameter in nuisances(declaring(folder, "x = 0.2\n"), with_spread(model))
    }


def test_a_key_that_no_tracker_has_is_refused(folder):
    with pytest.raises(DataError, match=r"\[tracker\].*'latency'"):
        base_model(declaring(folder, "latency = 0.1"))


@pytest.mark.nightly
def test_a_scale_that_nobody_declares_is_named_with_its_size(tmp_path):
    folder = drive_sets.write(tmp_path / "log", [TrackerScale(e=SCALE)])
    verdict = close_the_loop(folder, out=tmp_path / "out", jobs=2)
    assert verdict.named == ("TrackerScale",)
    scale = next(number for number in verdict.after.numbers if number.name == "TrackerScale.e")
    assert scale.low < SCALE < scale.high
