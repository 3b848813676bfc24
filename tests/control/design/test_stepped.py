"""A drive commanded sample by sample is the drive of a controller that commands the same."""

import numpy as np
import pytest

from rover_pin import scenario, simulate
from rover_pin.base.errors import SimulationError
from rover_pin.control.design.stepped import SteppedDrive


def law(reading):
    return 0.55 if reading.attitude[1] > -0.03 else 0.3


def test_it_is_the_drive_of_the_same_law():
    case = scenario("incline", duration=6.0, **{"terrain.start": 0.1, "terrain.angle_deg": 6.0})
    drive = SteppedDrive(case.model, 6.0, case.start, case.timing)
    times = []
    while not drive.stop:
        times.append(drive.reading.t)
        drive.step(law(drive.reading))
    wanted = simulate(case.model, law, 6.0, case.start, case.timing, measure_error=False)
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 0.05))
    assert drive.trace()["body_x"].tobytes() == wanted["body_x"].tobytes()
    assert set(np.round(drive.trace()["duty_fl"], 2)) == {0.3, 0.55}


def test_it_says_why_it_ended_and_ends():
    drive = SteppedDrive(scenario("flat").model, 0.2)
    with pytest.raises(SimulationError, match="not ended"):
        drive.trace()
    with pytest.raises(SimulationError, match=r"duty 1\.5"):
        drive.step(1.5)
    while not drive.stop:
        drive.step(0.1)
    assert drive.stop == "duration"
    with pytest.raises(SimulationError, match="has ended"):
        drive.step(0.1)
