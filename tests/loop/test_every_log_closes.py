"""Contract: every log that the package can write closes, and where nothing is hidden nothing is found."""

import numpy as np
import pytest

from rover_pin import RoverPinError, close_the_loop
from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.data_check import check_data
from rover_pin.scenarios.scenes import SCENES
from rover_pin.simulation.sensors import Sensors
from tests.loop import own_log

EASY = {"effect.MotionResistance.R": 0.01}
QUIET = (Answer.NONE_NEEDED, Answer.CANNOT_TELL)
HIDDEN = {"park": {"gear_friction": 0.0}}
"""What a scene has that no log declares, taken out: its gears' friction is found, as it should be."""
READY = sorted(set(SCENES) - {"grid", "polyline"})
"""Scenes that need no file of one's own."""
SAND = {
    "nexus6": {"soil.k": "5mm", "side": "shear"},
    "nexus6_links": {"soil.k": "5mm", "side": "shear", "rover": "nexus6_links"},
    "cart": {"side": "shear", "rover": "cart"},
}
"""Settings by which the drives have the laws that the base model has."""
random = np.random.default_rng(25)
CASES = [
    (scene, str(random.choice(sorted(SAND))), bool(random.integers(2)), int(random.integers(2, 7))) for scene in READY
]
"""A scene each, with a rover, with sensors or exact, and so many runs."""


@pytest.mark.parametrize("noisy", [True, False])
@pytest.mark.parametrize("scene", ["flat", "field", "crab"])
def test_a_log_of_one_run_says_what_it_lacks(scene, noisy, tmp_path):
    own_log.write(tmp_path, scene, runs=1, seconds=4.0, sensors=Sensors() if noisy else None, **SAND["nexus6"])
    assert close_the_loop(tmp_path).answer is Answer.CANNOT_TELL


@pytest.mark.parametrize("scene", ["flat", "slope", "turn"])
def test_wheels_that_others_push_are_no_fault(scene, tmp_path):
    """Motors of a rover whose duties differ give current back, so that it runs against their duty."""
    own_log.write(tmp_path, scene, runs=2, seconds=12.0, sensors=None, **SAND["nexus6"], **EASY)
    assert not any("runs against" in str(finding) for finding in check_data(tmp_path).findings)


@pytest.mark.parametrize("rover", ["nexus6", "cart"])
@pytest.mark.parametrize("scene", ["bump", "crab", "cross-slope", "hills", "one-sided-bump", "turn", "washboard"])
def test_without_noise_the_declared_model_misses_its_steps_alone(scene, rover, tmp_path):
    """From rest on soil that slopes shear, and with servos that give way under their wheels."""
    if (scene, rover) == ("crab", "cart"):
        pytest.skip("none of its wheels steers")
    own_log.write(tmp_path, scene, runs=1, seconds=6.0, sensors=None, **SAND[rover])
    log = read_drive_log(tmp_path)
    model = base_model(log)
    experiment = experiment_of(logged_runs(log, model.rover), model)
    left = experiment.observed - experiment.predict([model])[0]
    missed = np.sqrt(np.nanmean(left**2, axis=(0, 2)))
    assert np.all(missed <= experiment.least_noise(model)), dict(zip(experiment.channels, missed, strict=True))


@pytest.mark.nightly
@pytest.mark.parametrize(("scene", "rover", "noisy", "runs"), CASES)
def test_a_log_with_nothing_hidden_closes_without_an_alarm(scene, rover, noisy, runs, tmp_path):
    try:
        settings = SAND[rover] | HIDDEN.get(scene, {})
        own_log.write(tmp_path, scene, runs=runs, sensors=Sensors() if noisy else None, **settings)
        verdict = close_the_loop(tmp_path, jobs=2)
    except RoverPinError as refused:
        pytest.skip(f"refused in a sentence: {refused}")
    assert verdict.answer in QUIET, verdict.summary()
