"""Forecasts of the monitor: none on firm ground, a warning before a wheel is buried, and the right cause."""

import numpy as np
import pytest

from rover_pin import ConstantDuty, Motor, scenario, simulate
from rover_pin.control.sensing.onboard_slip import SLIPS
from rover_pin.control.torque_factor import pull_factors
from rover_pin.onboard.monitor.monitor import CAUSES, Monitor
from rover_pin.onboard.monitor.source import HORIZON, RATES, STEPS, WINDOW, WORTH, AheadLaw
from rover_pin.simulation.command import Reading
from rover_pin.simulation.sensors import NoisyController, Sensors


class Beside:
    """A controller with constant duty that also runs the monitor."""

    def __init__(self, monitor):
        self.monitor, self.inner = monitor, ConstantDuty()

    def reset(self):
        self.monitor.reset()
        self.forecasts, self.readings = [], []

    def __call__(self, reading):
        self.readings.append(reading)
        self.forecasts.append(self.monitor.step(reading))
        return self.inner(reading)


def beside(name, duration, **settings):
    scene = scenario(name, soil="table-1", duration=duration, **settings)
    watch = Beside(Monitor.of(scene.model))
    return watch, simulate(scene.model, NoisyController(watch, Sensors(), 1), duration, scene.start)


def digging_incline(c_d):
    add = (f"DiggingMemory.c_d={c_d}",) if c_d else ()
    return {"soil.k": 0.03, "terrain.angle_deg": 9.0, "terrain.start": 0.5, "add": add}


def test_a_steady_drive_on_flat_sand_has_no_warning():
    watch, _ = beside("flat", 10.0, **{"soil.k": 0.01})
    assert max(forecast.p_stuck for forecast in watch.forecasts) < 0.05
    assert not any(forecast.alarm or forecast.cause for forecast in watch.forecasts)


def test_a_burial_is_warned_of_two_seconds_before_and_is_digging():
    watch, trace = beside("incline", 25.0, **digging_incline(0.15))
    assert trace.attrs["stop"].startswith("buried")
    assert next(forecast.t for forecast in watch.forecasts if forecast.alarm) < trace.t[-1] - 2.0
    last = watch.forecasts[-1]
    assert last.cause == "digging"
    assert min(last.p_stuck, last.p_buried) > 0.8
    for forecast in watch.forecasts:
        assert min(forecast.p_stuck, forecast.p_buried, *forecast.causes) >= 0.0
        assert max(forecast.p_stuck, forecast.p_buried, *forecast.causes) <= 1.0
        assert sum(forecast.causes[:3]) == pytest.approx(forecast.p_stuck if forecast.p_stuck >= WORTH else 0.0)


@pytest.mark.parametrize("c_d", [0.0, 0.15])
def test_forces_show_whether_the_wheels_dig(c_d):
    """The forces of a moving rover show whether its wheels dig, because only a hole explains the resistance of the
    hole's rim.
    """
    watch, _ = beside("incline", 12.0, **{**digging_incline(c_d), "terrain.angle_deg": 5.0, "soil.k": 0.015})
    assert watch.monitor.digging @ RATES == pytest.approx(c_d, abs=0.05)


def test_a_slope_beyond_its_grip_is_grip_lost():
    watch, trace = beside("incline", 25.0, **{"soil.k": 0.02, "terrain.angle_deg": 22.0, "terrain.start": 0.5})
    assert trace["slip_ml"][-1] > 0.7
    assert watch.forecasts[-1].cause == "grip lost"


def test_a_ditch_s_wall_is_a_wall():
    sand = {"soil.k": 0.003, "terrain.wall_angle_deg": 47.0, "effect.MotionResistance.R": 0.07}
    watch, _ = beside("ditch", 14.0, **sand, add=("PostPeak.fraction=0.3", "DiggingMemory.c_d=0.1"))
    assert watch.forecasts[-1].alarm
    assert watch.forecasts[-1].cause == "wall"


def test_it_starts_again():
    watch, _ = beside("incline", 3.0, **digging_incline(0.15))
    first = list(watch.forecasts)
    watch.monitor.reset()
    assert [watch.monitor.step(reading) for reading in watch.readings] == first


def ahead(slope=0.0, hole=0.0, excess=0.0, slip=0.2, swapped=False):
    """Return the ratio of the rover's speed to its rim speed at the end of the forecast, and the depth of the deepest
    hole divided by r.
    """
    model = scenario("flat", soil="table-1", **{"soil.k": 0.02}).model
    law = AheadLaw(tuple(model.rover.radii.tolist()), model.slip, 9.81)
    n, factors, step = len(law.radii), pull_factors(model, SLIPS), law.step()
    slopes = np.gradient(factors, SLIPS)
    load = np.array([8.0, 9.0, 10.0, 11.0, 12.0, 13.0])
    load = load.reshape(3, 2)[:, ::-1].ravel() if swapped else load
    ground = np.concatenate([np.full(n, 0.04), np.full(n, slope), np.full(n, 1.0 / np.hypot(1.0, slope)), load, [0.04]])
    state = np.concatenate([[0.03, 0.0, 0.0], np.full(n, slip), np.full(n, hole)])
    for _ in range(STEPS):
        pulls = np.concatenate([np.interp(state[3 : 3 + n], SLIPS, table) for table in (factors, slopes)])
        state = np.asarray(step(state, [0.1, excess, 0.0, 0.0], ground, pulls)).ravel()
    return state[0] / 0.04, np.max(state[3 + n :] / np.array(law.radii))


def test_a_steeper_slope_a_hole_and_an_obstacle_slow_a_rover():
    shares = [ahead(slope)[0] for slope in (0.0, 0.1, 0.2, 0.3, 0.5)]
    assert np.all(np.diff(shares) <= 0.0)
    assert shares[0] > 0.8
    assert shares[-1] == 0.0
    assert ahead(hole=0.012, slope=0.1)[0] < ahead(slope=0.1)[0]
    deep, fresh = ahead(slope=0.5, hole=0.006)[1], ahead(slope=0.5)[1]
    assert 0.5 > deep > fresh > 0.006 / 0.045, "what spins where it stands digs, less and less"
    assert ahead(excess=0.6)[0] == 0.0, "what stands against all grip is not passed"


def test_left_and_right_are_alike():
    assert np.allclose(ahead(0.1, 0.004), ahead(0.1, 0.004, swapped=True))


def test_a_wheel_s_pull_grows_with_slip_and_lacks_resistance():
    factors = pull_factors(scenario("flat", soil="table-1").model, SLIPS)
    assert np.all(np.diff(factors[100:]) >= -1e-9)
    assert factors[100] < 0.0


def motor_readings(broken="", seed=0):
    motor, random = Motor(), np.random.default_rng(seed)
    for k in range(2 * WINDOW):
        duty, rate = np.full(6, 0.55), 0.8 + 0.01 * random.standard_normal(6)
        current = float(motor.supply / motor.resistance) * (duty - rate / float(motor.no_load_rate))
        current += 0.002 * random.standard_normal(6)
        if broken == "dead":
            current[2] = 0.002 * random.standard_normal()
        if broken == "frozen":
            rate[2] = 0.8
        if broken == "lost" and k == 2 * WINDOW - 1:
            rate[2] = np.nan
        yield Reading(0.05 * k, duty, rate, current, np.zeros(4), (0.0, 0.0, 0.0), None)


@pytest.mark.parametrize(
    ("broken", "motor", "sensor"), [("", 0.0, 0.0), ("dead", 1.0, 0.0), ("frozen", 0.0, 1.0), ("lost", 0.0, 1.0)]
)
def test_motors_and_sensors_at_fault(broken, motor, sensor):
    monitor = Monitor.of(scenario("flat", soil="table-1").model)
    for reading in motor_readings(broken):
        forecast = monitor.step(reading)
    assert forecast.causes[3:] == pytest.approx((motor, sensor), abs=0.05)
    assert forecast.cause == ("motor" if motor else "sensor" if sensor else forecast.cause)


def test_a_reading_that_is_lost_is_a_sensor_s_and_passes():
    watch, _ = beside("flat", 3.0, **{"soil.k": 0.01})
    broken = watch.readings[-1].replace(wheel_rate=np.full(6, np.nan))
    assert watch.monitor.step(broken).cause == "sensor"
    after = watch.monitor.step(watch.readings[-1])
    assert np.isfinite(after.p_stuck)
    assert HORIZON == 4.0
    assert len(after.causes) == len(CAUSES)
