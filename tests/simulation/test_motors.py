"""Both named motors drive as the paper says at its one point, differ as they are said to, and go by a setting."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.motors import MOTORS, motor_named

STUDY = Path(__file__).parents[2] / "studies" / "motors.py"


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("motors_study", STUDY)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", MOTORS)
def test_duty_055_runs_at_5_cm_a_second(name):
    trace = scenario("flat", soil="table-1", motor=name).drive()
    assert trace["body_vx"][-1] == pytest.approx(0.05, rel=0.01)
    assert np.mean(trace.stack("slip")[-1]) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("name", MOTORS)
def test_held_still_the_torque_is_in_proportion_to_the_duty(name):
    motor = motor_named(name)
    for delta in (0.1, 0.55, 1.0):
        drive = motor.drive(delta, 0.0)
        assert float(drive.constant * drive.current) == pytest.approx(MOTORS[name] * delta)


@pytest.mark.parametrize(("name", "share"), [("speed-like", 0.98), ("torque-like", 0.91)])
def test_what_back_emf_takes_of_the_cruising_duty(name, share):
    motor = motor_named(name)
    assert 0.05 / 0.95 / 0.045 / float(motor.no_load_rate) / 0.55 == pytest.approx(share, abs=0.005)


@pytest.mark.parametrize("name", MOTORS)
def test_what_eq_9_reads_is_what_a_drive_shows(study, name):
    """The study's table is statics; here the wheels of a rover that climbs steadily, each under its own load."""
    drive = scenario(
        "incline", soil="table-1", motor=name, duration=8.0, **{"terrain.angle_deg": 4.0, "terrain.start": -2.0}
    )
    trace, rows = drive.drive(), study.readings()
    rows = rows[(rows["motor"] == name) & (rows["k_mm"] == 50.0)]
    S, rim = (np.mean(values[-40:]) for values in (trace.stack("slip"), 0.045 * trace.stack("wheel_rate")))
    assert 0.3 < S < 0.6
    assert 1e3 * rim == pytest.approx(np.interp(S, rows["S"], rows["rim_mmps"]), rel=0.03)


def test_no_motor_lets_eq_9_see_a_slip_that_the_soil_resists(study):
    """S_hat falls as S rises, for every stall torque that carries the flat."""
    for _, table in study.readings().groupby(["motor", "k_mm"]):
        assert np.all(np.diff(table["S_hat"].dropna()) <= 0.0)


@pytest.mark.parametrize(("name", "at"), [("speed-like", 55.7), ("torque-like", 67.5)])
def test_when_12_degrees_are_reached(study, name, at):
    assert study.slope(name, 1.0)["Fig 8: 11.5 deg reached at [s]"] == pytest.approx(at, abs=0.5)
