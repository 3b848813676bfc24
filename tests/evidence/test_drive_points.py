"""Soil parameters from a drive log, as section 4 of the paper takes them, against the soil that made the log.

The logs are made by `tests/oracle/blind`, which shares no code with the package: sensor noise and steps, tachometers
1 % and motors 1.2 % apart, a torque constant declared 1.5 % off (1 SD).
"""

import dataclasses
import importlib
import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.errors import DataError
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.result import Verdict
from rover_pin.measurements import drive_points as module
from rover_pin.measurements.drive_points import Sampling, classed, drive_points, instrumented, read_drive_points
from rover_pin.measurements.reading import read_evidence
from rover_pin.measurements.steady_windows import Window, line
from rover_pin.motion.drive_log import read_drive_log, write_drive_log
from rover_pin.motion.motor import Motor
from rover_pin.motion.sensors import Sensors, measured
from rover_pin.quantity import record_from
from rover_pin.scenarios import scenario
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.traction import TorqueTraction, load_traction_factor

BLIND = Path(__file__).parents[1] / "oracle" / "blind" / "__init__.py"
_spec = importlib.util.spec_from_file_location("blind", BLIND)
sys.modules.setdefault("blind", importlib.util.module_from_spec(_spec))
_spec.loader.exec_module(sys.modules["blind"])
climb = importlib.import_module("blind.climb")

TWO = Search(starts=2)


@pytest.fixture(scope="module")
def drive():
    return scenario("slope", **{"soil.k": 0.01, "effect.MotionResistance.R": 0.12})


@pytest.fixture(scope="module")
def trace(drive):
    return drive.drive()


@pytest.fixture(scope="module")
def log(drive, trace, tmp_path_factory):
    folder = tmp_path_factory.mktemp("climb") / "log"
    drive.write_log(measured(trace, Sensors(), seed=0), folder)
    return folder


def true_factor(S):
    return float(load_traction_factor(S, Soil(k=0.01), Wheel(), TorqueTraction()))


def test_a_log_with_sensors_tells_the_soil_that_made_it(log):
    """Samples classed one by one said k = 5.0 mm [3.6, 7.3], phi = 17 deg [15, 21]."""
    found = identify(read_drive_points(log), Soil())
    for name, truth in (("k", 0.01), ("phi", math.radians(30.0))):
        assert found[name].verdict is Verdict.FOUND
        assert found[name].low < truth < found[name].high
    assert found["k"].high / found["k"].low < 1.6


def test_another_rover_has_the_angles_and_the_lag_of_its_own_wheel(tmp_path, monkeypatch):
    cart, lags = scenario("slope", rover="cart"), []
    cart.write_log(measured(cart.drive(), Sensors(), seed=0), tmp_path / "log")

    def noted(windows, length, lag):
        lags.append(lag)
        return instrumented(windows, length, lag)

    monkeypatch.setattr(module, "instrumented", noted)
    points, read = read_drive_points(tmp_path / "log"), read_drive_log(tmp_path / "log")
    assert points.angles == SinkageAngles()
    assert set(lags) == {cart.model.slip}
    assert cart.model.slip != RelaxedSlip()
    fixed = dataclasses.replace(read, about=dataclasses.replace(read.about, angles="fixed"))
    assert drive_points(fixed, cart.model.motor).angles == FixedAngles()
    own = (cart.model.soils[0], points.wheel, TorqueTraction(), SinkageAngles())
    assert points.factor == pytest.approx([float(load_traction_factor(S, *own)) for S in points.slip], rel=0.08)


def test_points_follow_the_torque_factor(log):
    points = read_evidence(log)
    assert points.form == TorqueTraction()
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], rel=0.05)
    for each in (points.sd, points.slip_sd, points.shared, points.slip_shared):
        assert np.all(each > 0.0)


def test_exact_sensors_give_the_slip_that_the_soil_feels(drive, trace, tmp_path):
    """What is left are the classes' widths and the ground that bends within a wheelbase."""
    drive.write_log(trace, tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], abs=0.003)


def test_duty_and_rate_tell_the_torque_where_no_current_is_logged(drive, trace, tmp_path):
    drive.write_log(measured(trace, Sensors(), seed=1, with_current=False), tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], rel=0.15)
    assert identify(points, Soil(), search=TWO)["k"].low < 0.01 < identify(points, Soil(), search=TWO)["k"].high


def test_without_heights_the_speed_comes_from_the_map_and_the_slope(drive, trace, tmp_path):
    kept = {name: values for name, values in trace.channels.items() if name != "body_z"}
    drive.write_log(dataclasses.replace(trace, channels=kept), tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], abs=0.006)


def test_slips_that_scatter_by_more_than_a_class_are_refused(drive, trace, tmp_path):
    coarse = Sensors(position_sd=0.03, attitude_sd=0.05)
    drive.write_log(measured(trace, coarse, seed=1), tmp_path)
    sampling = Sampling(lengths=(2.0,))
    with pytest.raises(DataError, match=r"the slip of a window of 2 s scatters by 0\.\d+, more than a class of 0\.05"):
        read_drive_points(tmp_path, sampling)


def test_longer_windows_are_taken_where_the_slip_scatters(drive, trace, tmp_path):
    drive.write_log(measured(trace, Sensors(position_sd=0.006), seed=1), tmp_path)
    two, four = (read_drive_points(tmp_path, Sampling(lengths=each)) for each in ((2.0,), (2.0, 4.0)))
    assert len(four.slip) != len(two.slip) or np.max(four.slip_sd) < np.max(two.slip_sd)


def test_a_log_without_its_motor_is_refused(log, tmp_path):
    (tmp_path / "drive.toml").write_text(
        (log / "drive.toml").read_text().split("[motor]")[0] + '[[run]]\nfile = "run.csv"\n'
    )
    for name in ("run.csv", "terrain.csv"):
        (tmp_path / name).write_bytes((log / name).read_bytes())
    with pytest.raises(DataError, match=r"declares no \[motor\]"):
        read_drive_points(tmp_path)


def test_a_log_too_short_is_refused(log):
    with pytest.raises(DataError, match="no class of slip has 1000 steady windows of 2 s"):
        read_drive_points(log, dataclasses.replace(Sampling(), least=1000))


def test_a_missing_channel_is_named(log, tmp_path):
    drive = read_drive_log(log)
    trace = drive.runs[0]
    kept = {name: values for name, values in trace.channels.items() if name != "bogie_l"}
    write_drive_log(tmp_path, {"run": dataclasses.replace(trace, channels=kept)}, drive.about)
    with pytest.raises(DataError, match="bogie_l"):
        read_drive_points(tmp_path)


def test_a_declared_doubt_of_the_motor_widens_what_is_shared(log):
    read = read_drive_log(log)
    motor = record_from(Motor, read.about.motor, "motor")
    gear = {**read.about.motor, "gear": {"value": 268.0, "unit": "", "sd": 26.8}}
    unsure = dataclasses.replace(read, about=dataclasses.replace(read.about, motor=gear))
    sure, wide = drive_points(read, motor), drive_points(unsure, motor)
    assert wide.shared == pytest.approx(np.hypot(sure.shared, 0.1 * sure.factor), rel=1e-6)


def test_a_path_that_is_no_data_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"give a folder with rig.toml \(wheel rig\) or drive.toml"):
        read_evidence(tmp_path / "nothing")


def test_windows_are_classed_by_what_stands_beside_them():
    """Grouped by its own noisy slip, a window comes out of its class as the noise left it."""
    window = Window(0, 0.0, 0.31, 0.01, 0.2, 0.01, 0.0, 0.05)
    assert classed([(0.12, window)] * 3, Sampling()) == [[window] * 3]
    assert classed([(0.12, window)] * 2, Sampling()) == []


def test_the_line_through_noise_knows_its_doubt():
    """White noise of SD 1 about t: slopes scatter as said; noise that stays for a while counts less."""
    random, t = np.random.default_rng(3), 0.05 * np.arange(40)
    fits = [line(t, t + random.standard_normal(40)) for _ in range(300)]
    assert np.std([fit.slope for fit in fits]) == pytest.approx(np.mean([fit.slope_sd for fit in fits]), rel=0.15)
    assert np.std([fit.middle for fit in fits]) == pytest.approx(np.mean([fit.sd for fit in fits]), rel=0.15)
    held = [line(t, np.repeat(random.standard_normal(10), 4)) for _ in range(300)]
    assert np.mean([fit.sd for fit in held]) > 1.5 * np.mean([fit.sd for fit in fits])


@pytest.mark.slow
def test_intervals_of_logs_with_sensors_hold_the_truth_in_90_to_99_percent(tmp_path):
    """Six soils climbed by the independent simulator, sixteen draws of sensors, gains and declared constants each."""
    truths = [
        {"k": k, "phi": math.radians(phi)}
        for k, phi in ((0.0025, 31), (0.004, 29), (0.006, 33), (0.010, 30), (0.016, 28), (0.030, 32))
    ]
    held = []
    for soil, (truth, made) in enumerate(zip(truths, climb.climbs(truths, 5), strict=True)):
        for draw in range(16):
            folder = tmp_path / f"{soil}-{draw}"
            climb.write_climb(folder, made, [2, soil, draw])
            found = identify(read_drive_points(folder), Soil(), search=TWO)
            held += [found[name].low <= truth[name] <= found[name].high for name in ("k", "phi")]
    assert 0.90 <= np.mean(held) <= 0.99
