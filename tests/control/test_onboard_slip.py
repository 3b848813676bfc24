"""The slip estimated on board: against the true slip on noisy sensors, its limits, and Eq (9)'s table per model."""

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.onboard_slip import REST, SLIPS, OnboardSlip, SureSlip, Trust, slip_ratios
from rover_pin.control.slip_control import SlipControl
from rover_pin.control.slip_estimate import TableEstimate, flat_table
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.sensors import Sensed, Sensors
from rover_pin.simulation.simulate import simulate
from rover_pin.soil.slip import slip_ratio

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
    simulate(scene.model, Sensed(watch, sensors, 1), duration, scene.start)
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


def test_sand_that_is_weaker_than_believed_reads_as_less_slip():
    """The law is what torques are read by: believed too strong, the same torque needs less slip."""
    strong = OnboardSlip.of(scenario("flat", soil="table-1", **{"soil.k": 0.015}).model)
    error = watched("slope", Sensors(), 20.0, strong, **{"soil.k": 0.025, "terrain.start": 0.0}).error(8.0)
    assert np.mean(error) < -0.03


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


def test_ground_that_does_not_bend_tells_no_speed_by_its_folds():
    estimate = OnboardSlip.of(scenario("flat", soil="table-1").model)
    assert np.ptp(estimate._folding(0.0, 0.0)) == pytest.approx(0.0, abs=1e-9)


def test_steady_posture_means_standing_and_folding_means_moving():
    estimate = OnboardSlip.of(scenario("flat", soil="table-1").model)
    stays, folds = (estimate.speeds[np.argmax(estimate._folding(rise, 0.2))] for rise in (0.0, 0.01))
    assert stays == pytest.approx(0.0, abs=1e-3)
    assert abs(folds) == pytest.approx(0.05, rel=0.2)


def test_a_bend_makes_torques_less_sure():
    estimate, seen = OnboardSlip.of(scenario("flat", soil="table-1", **{"soil.k": 0.005}).model), []
    for bend in (0.0, 0.3):
        estimate.reset()
        for _ in range(40):
            slips = slip_ratios(np.full(6, 0.05), estimate.speeds[:, None] * np.ones(6))
            estimate._learn(slips, np.full(6, 0.2), bend)
        seen.append(float(np.sqrt(estimate.belief @ estimate.speeds**2 - (estimate.belief @ estimate.speeds) ** 2)))
    assert seen[1] > 1.5 * seen[0]


def test_posture_improves_the_slip_of_a_stuck_rover_past_peak():
    """At the far wall the torque of S = 1 is that of a smaller slip too; that nothing folds speaks for the first."""
    sand = {"soil.k": 0.003, "terrain.wall_angle_deg": 47.0, "add": "PostPeak.fraction=0.3"}
    scene = scenario("ditch", soil="table-1", **sand, **{"effect.MotionResistance.R": 0.07})
    errors = []
    for trust in (Trust(), Trust(quiet=1.0)):
        watch = Watched(OnboardSlip.of(scene.model, trust))
        trace = simulate(scene.model, Sensed(watch, Sensors(), 1), 32.0, scene.start)
        assert trace["slip_ml"][-1] > 0.95
        errors.append(np.sqrt(np.mean(watch.error(24.0) ** 2)))
    assert errors[0] < 0.9 * errors[1]


def test_wheels_that_stand_say_that_the_rover_stands():
    """Parked, no torque tells anything, and no slip is made up."""
    scene = scenario("flat", soil="table-1", duration=8.0)
    watch = Watched(OnboardSlip.of(scene.model), delta=0.0)
    trace = simulate(scene.model, Sensed(watch, Sensors(), 1), 8.0, scene.start)
    assert abs(trace["body_x"][-1]) < 0.002
    assert np.sqrt(np.mean(np.array(watch.told)[40:] ** 2)) < 0.2


def test_flat_factor_gives_a_wide_slip_estimate():
    """k = 2 mm: F hardly rises beyond S = 0.3."""
    sure, unsure = (
        OnboardSlip.of(scenario("flat", soil="table-1").model),
        OnboardSlip.of(scenario("flat", soil="table-1", **{"soil.k": 0.002}).model),
    )
    sds = []
    for estimate in (sure, unsure):
        steep = float(np.interp(0.6, SLIPS, estimate.factors))
        for _ in range(100):
            estimate._learn(slip_ratios(np.full(6, 0.05), estimate.speeds[:, None] * np.ones(6)), np.full(6, steep))
        slips = slip_ratios(np.full(1, 0.05), estimate.speeds[:, None])[:, 0]
        sds.append(float(np.sqrt(estimate.belief @ slips**2 - (estimate.belief @ slips) ** 2)))
    assert sds[0] < 0.12 < sds[1]


def test_the_control_acts_on_slip_that_is_sure():
    """By hand: less one SD, never below 0; what brakes is fed back as told."""

    class Told:
        sd = np.array([0.1, 0.5, 0.3])

        def slip(self, reading):
            return np.array([0.6, 0.2, -0.4])

    assert SureSlip(Told()).slip(None) == pytest.approx([0.5, 0.0, -0.4])


def test_a_wall_is_no_slip():
    """A ditch whose sand loses half of its strength: at the far wall torques fit no slip, and the rover gets out."""
    sand = {"soil.k": 0.0025, "effect.MotionResistance.R": 0.03, "terrain.wall_angle_deg": 38.0}
    drive = scenario(
        "ditch",
        soil="table-1",
        control="onboard",
        duration=26.0,
        add="PostPeak.fraction=0.5",
        **{"control.S_d": 0.2},
        **sand,
    ).drive()
    assert drive["body_x"][-1] > 0.95


def test_the_belief_is_one_and_starts_again():
    watch = watched("flat", Sensors(), 3.0)
    estimate = watch.estimate
    assert estimate.belief.sum() == pytest.approx(1.0)
    assert np.all(estimate.belief > 0.0)
    estimate.reset()
    assert np.ptp(estimate.belief) == 0.0
    assert len(estimate.past) == 0


def test_its_slips_are_eq_1():
    rim, v = np.array([0.05, -0.05, 0.05, 0.0, 0.001]), np.array([0.03, -0.08, -0.01, 0.02, 0.0])
    expected = [
        np.clip(float(slip_ratio(np.sign(r or 1) * r, np.sign(r or 1) * u, REST)), -1, 1)
        for r, u in zip(rim, v, strict=True)
    ]
    assert slip_ratios(rim, v[None])[0] == pytest.approx(expected)


def test_it_drives_by_a_word_and_forgets_the_drive_before():
    scene = scenario(
        "incline", soil="table-1", control="onboard", duration=4.0, **{"soil.k": 0.025, "terrain.start": 0.0}
    )
    assert isinstance(scene.controller, SlipControl)
    first, second = scene.drive(), scene.drive()
    assert first["body_x"][-1] == second["body_x"][-1]


def test_sensed_readings_repeat_and_leave_the_truth():
    seen = []
    scene = scenario("flat", soil="table-1")
    for _ in range(2):
        seen.append([])
        watch = Sensed(lambda reading: seen[-1].append(reading) or 0.5, Sensors(), 7)
        simulate(scene.model, watch, 0.5, scene.start)
    assert all(np.array_equal(a.current, b.current) for a, b in zip(*seen, strict=True))
    assert np.std([reading.wheel_rate[0] - reading.wheel_rate[1] for reading in seen[0]]) > 0.005
    assert np.ptp([reading.truth.slip[0] - reading.truth.slip[1] for reading in seen[0]]) < 1e-6


def test_eq_9s_table_is_that_of_the_driven_model():
    plain, moon, firm = (
        scenario("flat", soil="table-1", **each).model for each in ({}, {"gravity": "moon"}, {"soil.k": 0.005})
    )
    speeds = [float(flat_table(model).speed_at(np.array(0.55))) for model in (plain, moon, firm)]
    assert speeds[0] == pytest.approx(0.05, abs=1e-3)
    assert speeds[1] > speeds[0] + 5e-4
    assert speeds[2] < speeds[0] - 3e-3  # firmer sand resists more
    assert flat_table(scenario("slope", soil="table-1").model) is flat_table(plain)
    for name, model in (("moon", moon), ("table-1", plain)):
        drive = scenario("slope", soil="table-1", control="eq9", **({"gravity": "moon"} if name == "moon" else {}))
        assert isinstance(drive.controller.estimate, TableEstimate)
        assert drive.controller.estimate.table == flat_table(model)


def test_a_model_without_a_table_is_refused():
    """In the net form the rover does not move on its own flat ground."""
    with pytest.raises(ParameterError, match=r"\(9\).*ground"):
        scenario("slope", soil="table-1", control="eq9", form="net")
