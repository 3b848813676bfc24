"""Random drives as separate C programs: no sanitizer and no floating-point trap reports an error."""

import numpy as np
import pytest

from rover_pin.base.errors import RoverPinError
from rover_pin.onboard.fmi.plant import plant
from tests.onboard.fmi.standalone import PERIODS, ran_sanely
from tests.simulation import random_drives

FEW, MANY = (1,), 200
"""Seeds of every run with slow tests (1 overflowed once); how many there are at night."""


def driven(seed, folder):
    """Return the number of periods that a random drive lasts; None if the rover cannot be set down on its soil."""
    try:
        chosen = random_drives.drive(seed)
        unit = plant(chosen.model, chosen.start)
    except RoverPinError:
        return None
    duty = np.random.default_rng(seed).uniform(-1.0, 1.0, len(chosen.model.rover.wheels)).tolist()
    return ran_sanely(unit, folder, duty)


@pytest.mark.slow
@pytest.mark.parametrize("seed", FEW)
def test_a_random_drive_is_sound(seed, tmp_path):
    assert driven(seed, tmp_path) > 0


@pytest.mark.nightly
def test_two_hundred_random_drives_are_sound(tmp_path):
    periods = []
    for seed in range(MANY):
        folder = tmp_path / str(seed)
        folder.mkdir()
        periods.append(driven(seed, folder))
    went = [count for count in periods if count is not None]
    assert len(went) > 0.6 * MANY
    assert np.median(went) == PERIODS
