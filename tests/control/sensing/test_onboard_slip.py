"""The slip estimated on board: against the true slip on noisy sensors, and its limits."""

import numpy as np
import pytest

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.control.sensing.odometry import Camera, VisualOdometry
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.stop import StopStuck
from rover_pin.simulation.sensors import NoisyController, Sensors
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD

QUIET = Sensors(rate_sd=0.0, rate_step=0.0, angle_sd=0.0, angle_step=0.0, current_sd=0.0, attitude_sd=0.0)


class Watched:
    """Constant duty with an estimate beside it."""

    def __init__(self, estimate, delta=0.55):
        self.estimate, self.inner = estimate, ConstantDuty(delta)

    def reset(self):
        self.estimate.reset()
        self.t, self.told, self.true = [], [], []

    def __call__(self, reading):
        self.t.append(reading.t)
        self.told.append(self.estimate.slip(reading))
        self.true.append(reading.truth.slip)
        return self.inner(reading)

    def error(self, after=2.0):
        late = np.array(self.t) > after
        return (np.array(self.told) - np.array(self.true))[late]


def watched(name, sensors, duration, estimate=None, **settings):
    scene = scenario(name, soil="table-1", duration=duration, **settings)
    watch = Watched(estimate or OnboardSlip.of(scene.model))
    simulate(scene.model, NoisyController(watch, sensors, 1), duration, scene.start)
    return watch


@pytest.mark.parametrize(
    ("name", "settings", "bias", "rms"),
    [
        ("slope", {"soil.k": 0.025, "terrain.start": 0.2}, 0.02, 0.04),
        ("cross-slope", {"soil.k": 0.01}, 0.02, 0.04),
        ("hills", {"soil.k": 0.01}, 0.03, 0.06),
    ],
)
def test_slip_is_told_from_noisy_sensors(name, settings, bias, rms):
    error = watched(name, Sensors(), 20.0, **settings).error()
    assert abs(np.mean(error)) < bias
    assert np.sqrt(np.mean(error**2)) < rms


def test_slip_estimate_follows_a_steepening_slope_wheel_by_wheel():
    """Without noise the estimate follows a slope that steepens within 0.02, wheel by wheel."""
    watch = watched("slope", QUIET, 30.0, **{"soil.k": 0.01, "terrain.start": 0.2})
    assert np.max(np.abs(watch.error(4.0))) < 0.03


def test_a_loss_of_strength_that_the_model_has_is_read_through():
    """Past the peak the same torque is that of two slips: the sand's law alone reads the smaller one."""
    little = {"soil.k": 0.0065, "effect.MotionResistance.R": 0.02}  # with its own R the rover would not get out
    sand = {**little, "terrain.wall_angle_deg": 47.0, "add": "PostPeak.fraction=0.3"}
    scene = scenario("ditch", soil="table-1", **sand)
    unaware = OnboardSlip.of(scenario("ditch", soil="table-1", **little).model)
    aware, unaware = (
        np.sqrt(np.mean(watched("ditch", Sensors(), 24.0, estimate, **sand).error(16.0) ** 2))
        for estimate in (OnboardSlip.of(scene.model), unaware)
    )
    assert aware < 0.15
    assert unaware > 0.25


def test_a_wall_is_no_slip():
    """A ditch whose known sand loses half its strength: at the far wall torques fit no slip, and the rover gets out."""
    sand = {"soil.k": 0.0025, "effect.MotionResistance.R": 0.03, "terrain.wall_angle_deg": 38.0}
    sand["control.believes"] = "plant"
    drive = scenario(
        "ditch", soil="table-1", control="onboard", duration=26.0, add="PostPeak.fraction=0.5", **sand
    ).drive()
    assert drive["body_x"][-1] > 0.95


def test_sensed_readings_repeat_and_leave_the_truth():
    readings = []
    scene = scenario("flat", soil="table-1")
    for _ in range(2):
        readings.append([])
        watch = NoisyController(lambda reading: readings[-1].append(reading) or 0.5, Sensors(), 7)
        simulate(scene.model, watch, 0.5, scene.start)
    assert all(np.array_equal(a.current, b.current) for a, b in zip(*readings, strict=True))
    assert np.std([reading.wheel_rate[0] - reading.wheel_rate[1] for reading in readings[0]]) > 0.005
    assert np.ptp([reading.truth.slip[0] - reading.truth.slip[1] for reading in readings[0]]) < 1e-6


def stuck_ditch():
    sand = {"soil.k": 0.003, "terrain.wall_angle_deg": 47.0, "effect.MotionResistance.R": 0.07}
    return {**sand, "add": ("PostPeak.fraction=0.3", "DiggingMemory.c_d=0.1")}


class Minding(Watched):
    """The same, with what it says of standing and of holes."""

    def reset(self):
        super().reset()
        self.stands, self.holes, self.sinkage = [], [], []

    def __call__(self, reading):
        command = super().__call__(reading)
        self.stands.append(self.estimate.p_stands)
        self.holes.append(self.estimate.hole)
        self.sinkage.append(reading.truth.sinkage.copy())
        return command


def minding(name, duration, **settings):
    scene = scenario(name, soil="table-1", duration=duration, **settings)
    watch = Minding(OnboardSlip.of(scene.model))
    return watch, simulate(scene.model, NoisyController(watch, Sensors(), 1), duration, scene.start)


def test_it_knows_that_it_stands_in_a_ditch_and_how_deep():
    """Two seconds behind the wall the wheels spin, the rover stands, and its holes grow with its sinkage."""
    watch, trace = minding("ditch", 30.0, **stuck_ditch())
    late = len(watch.t) - 40
    assert trace["slip_ml"][-1] > 0.9
    assert np.mean(watch.stands[late:]) > 0.7
    assert np.max(watch.holes[-1]) > 0.004


def test_odometry_tells_a_slip_that_torques_do_not():
    """In a ditch, where the slope under each wheel is not known; a soil taken for another it does not put right."""
    scene, errors = scenario("ditch", soil="table-1", **stuck_ditch()), []
    for odometry in (None, *(VisualOdometry(Camera(), CONTROL_PERIOD, seed) for seed in (1, 2, 3))):
        watch = watched("ditch", Sensors(), 20.0, OnboardSlip.of(scene.model, odometry=odometry), **stuck_ditch())
        errors.append(np.sqrt(np.mean(watch.error(6.0) ** 2)))
    assert np.mean(errors[1:]) < 0.9 * errors[0]


class Standing:
    """Stands in for an estimate: says that the rover stands, in holes so deep."""

    period = 0.05

    def __init__(self, model, depth, p_stands=1.0):
        self.rover, self.hole, self.p_stands = model.rover, np.full(6, depth), p_stands


@pytest.mark.parametrize(("depth", "p_stands", "stops"), [(0.008, 0.9, True), (0.004, 0.9, False), (0.008, 0.3, False)])
def test_a_rover_that_stands_in_deep_holes_stops_after_a_second(depth, p_stands, stops):
    model = scenario("flat").model
    control = StopStuck(ConstantDuty(0.5), Standing(model, depth, p_stands))
    duties = [getattr(control(None), "duty", None) for _ in range(100)]
    assert (duties[-1] == 0.0) is stops
    assert duties[10] == 0.5
    if stops:
        assert 0.7 < 0.05 * duties.index(0.0) < 1.3
        control.reset()
        assert control(None).duty == 0.5
