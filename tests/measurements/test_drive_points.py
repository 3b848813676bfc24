"""Soil parameters from drive logs by the method of section 4 of the paper, compared with the soil that made the logs.

The logs come from `tests/oracle/blind`, which shares no code with the package. The sensors have noise and quantisation
steps, the tachometers differ by 1 % and the motors by 1.2 %, and the declared torque constant is wrong by 1.5 % (1 SD).
"""

import dataclasses
import importlib
import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Motor, Soil, Wheel, load_rover, load_traction_factor, scenario
from rover_pin.base.errors import DataError
from rover_pin.base.quantity import record_from
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.identify import identify
from rover_pin.measurements import drive_points as module
from rover_pin.measurements.drive_points import Sampling, drive_points, points_of_log, soil_windows
from rover_pin.measurements.steady_windows import Window, line, pool
from rover_pin.simulation.model.defaults import own_soil
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.wheel_forces import TorqueTraction

BLIND = Path(__file__).parents[1] / "oracle" / "blind" / "__init__.py"
_spec = importlib.util.spec_from_file_location("blind", BLIND)
sys.modules.setdefault("blind", importlib.util.module_from_spec(_spec))
_spec.loader.exec_module(sys.modules["blind"])
climb = importlib.import_module("blind.climb")

FIRM = own_soil(load_rover("cart")).value
"""Table 1's sand made firm enough for the cart, which what is fitted starts at."""


@pytest.fixture(scope="module")
def drive():
    return scenario("slope", soil="table-1", **{"soil.k": 0.01, "effect.MotionResistance.R": 0.12})


@pytest.fixture(scope="module")
def trace(drive):
    return drive.drive()


@pytest.fixture(scope="module")
def log(drive, trace, tmp_path_factory):
    folder = tmp_path_factory.mktemp("climb") / "log"
    drive.write_log(measure(trace, Sensors(), seed=0), folder)
    return folder


def read_drive_points(folder, *sampling):
    return points_of_log(read_drive_log(folder), *sampling)


def holds(number, truth):
    return number.low < truth < number.high


def true_factor(S):
    return float(load_traction_factor(S, Soil(k=0.01), Wheel(), TorqueTraction()))


def test_a_log_with_sensors_determines_the_soil_that_made_it(log):
    """If every sample were assigned to a class by its own slip, the result would be k = 5.0 mm [3.6, 7.3] and phi = 17
    deg [15, 21].
    """
    identification = identify(log)
    for name, truth in (("k", 0.01), ("phi", math.radians(30.0))):
        assert holds(identification[name].number, truth)
    assert identification["k"].number.high / identification["k"].number.low < 2.0


def test_other_rover_has_the_angles_and_the_lag_of_its_own_wheel(tmp_path, monkeypatch):
    cart, lags = scenario("slope", rover="cart", soil=FIRM), []
    cart.write_log(measure(cart.drive(), Sensors(), seed=0), tmp_path / "log")

    def noted(windows, length, lag):
        lags.append(lag)
        return soil_windows(windows, length, lag)

    monkeypatch.setattr(module, "soil_windows", noted)
    points, read = read_drive_points(tmp_path / "log"), read_drive_log(tmp_path / "log")
    assert points.angles == SinkageAngles()
    assert set(lags) == {cart.model.slip}
    assert cart.model.slip != RelaxedSlip()
    fixed = dataclasses.replace(read, metadata=dataclasses.replace(read.metadata, angles="fixed"))
    assert drive_points(fixed, cart.model.motor).angles == FixedAngles()
    soil, rows = cart.model.soils[0], zip(points.slip, points.load, strict=True)
    carrying = [(S, soil.replace(theta_1=entry_angle(W, S, points.wheel, soil))) for S, W in rows]
    law = (points.wheel, TorqueTraction(), SinkageAngles())
    assert points.factor == pytest.approx(
        [float(load_traction_factor(S, load_contact, *law)) for S, load_contact in carrying], rel=0.05
    )


def cart_log(folder, ground="slope", seed=0, **settings):
    cart = scenario(ground, rover="cart", soil=FIRM, **settings)
    cart.write_log(measure(cart.drive(), Sensors(), seed=seed), folder)
    return cart.model.soils[0]


def test_a_wheel_whose_arc_carries_its_load_determines_the_soil(tmp_path):
    """With theta_1 fixed at the soil's value, whatever the load, the intervals would be too narrow and wrong: k = 34 mm
    [27, 45], phi = 23 deg [20, 27].
    """
    soil = cart_log(tmp_path)
    assert np.ptp(np.log(read_drive_points(tmp_path).load)) > 0.3
    identification = identify(tmp_path)
    for name in ("k", "phi"):
        assert holds(identification[name].number, float(getattr(soil, name)))


def test_loads_that_statics_leave_open_mislead_nobody(tmp_path):
    """If each wheel were evaluated alone, hills under a rigid chassis would give the wrong phi = 9.1 deg [6.5, 17.3];
    the truth is 30 deg.
    """
    soil = cart_log(tmp_path, "hills")
    identification = identify(tmp_path)
    for name in ("k", "phi"):
        assert holds(identification[name].number, float(getattr(soil, name)))


def test_unmeasured_modulus_is_uncertain_together_with_the_rest(tmp_path):
    """If k_1 is fixed at twice its true value, the fit is good, but k is half its true value and phi is 7 deg too
    small. If k_1 is free, the intervals show the uncertainty.
    """
    truth = cart_log(tmp_path, **{"motor.resistance": 26.9})
    with_fixed_modulus = identify(tmp_path, fixed={"k_1": 2.0 * float(truth.k_1)})
    assert with_fixed_modulus["phi"].number.value < truth.phi - math.radians(4.0)
    with_free_modulus = identify(tmp_path)
    for name in ("k", "phi"):
        assert holds(with_free_modulus[name].number, float(getattr(truth, name)))
    width = [
        identification["k"].number.high / identification["k"].number.low
        for identification in (with_fixed_modulus, with_free_modulus)
    ]
    assert width[1] > width[0]


def test_a_derived_modulus_is_not_reported_as_declared(tmp_path):
    cart_log(tmp_path)
    path = tmp_path / "drive.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text(
        "\n".join(toml_line for toml_line in lines if not toml_line.startswith(("k_1 ", "k_2 "))), encoding="utf-8"
    )
    identification = identify(tmp_path)
    k_1 = identification["k_1"].number
    assert not k_1.declared
    assert identification["n"].number.declared
    assert f"{own_soil(scenario('flat', rover='cart').model.rover).value.k_1:.3g}" in k_1.prior


def test_exact_sensors_give_the_slip_that_the_soil_feels(drive, trace, tmp_path):
    """The remaining error comes from the width of the classes and from ground that bends within a wheelbase."""
    drive.write_log(trace, tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], abs=0.003)


def test_duty_and_rate_give_the_torque_without_a_logged_current(drive, trace, tmp_path):
    drive.write_log(measure(trace, Sensors(), seed=1, with_current=False), tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], rel=0.15)
    assert holds(identify(tmp_path)["k"].number, 0.01)


def test_speed_comes_from_the_map_and_the_slope_without_heights(drive, trace, tmp_path):
    channels = {name: values for name, values in trace.channels.items() if name != "body_z"}
    drive.write_log(dataclasses.replace(trace, channels=channels), tmp_path)
    points = read_drive_points(tmp_path)
    assert points.factor == pytest.approx([true_factor(S) for S in points.slip], abs=0.006)


def test_slips_that_scatter_by_more_than_a_class_are_refused(drive, trace, tmp_path):
    coarse = Sensors(position_sd=0.03, attitude_sd=0.05)
    drive.write_log(measure(trace, coarse, seed=1), tmp_path)
    sampling = Sampling(lengths=(2.0,))
    with pytest.raises(DataError, match=r"2.*0\.\d+,.*0\.05"):
        read_drive_points(tmp_path, sampling)


def test_longer_windows_are_taken_where_the_slip_scatters(drive, trace, tmp_path):
    drive.write_log(measure(trace, Sensors(position_sd=0.006), seed=1), tmp_path)
    two, four = (read_drive_points(tmp_path, Sampling(lengths=length)) for length in ((2.0,), (2.0, 4.0)))
    assert len(four.slip) != len(two.slip) or np.max(four.slip_sd) < np.max(two.slip_sd)


def test_a_log_without_its_motor_is_refused(log, tmp_path):
    (tmp_path / "drive.toml").write_text(
        (log / "drive.toml").read_text().split("[motor]")[0] + '[[run]]\nfile = "run.csv"\n'
    )
    for name in ("run.csv", "terrain.csv"):
        (tmp_path / name).write_bytes((log / name).read_bytes())
    with pytest.raises(DataError, match=r"declares no \[motor\]"):
        read_drive_points(tmp_path)


def test_the_line_through_noise_knows_its_doubt():
    """For white noise of SD 1, the slopes scatter as the stated SD. Correlated noise gives a larger SD."""
    random, t = np.random.default_rng(3), 0.05 * np.arange(40)
    fits = [line(t, t + random.standard_normal(40)) for _ in range(300)]
    assert np.std([fit.slope for fit in fits]) == pytest.approx(np.mean([fit.slope_sd for fit in fits]), rel=0.15)
    assert np.std([fit.middle for fit in fits]) == pytest.approx(np.mean([fit.sd for fit in fits]), rel=0.15)
    lines = [line(t, np.repeat(random.standard_normal(10), 4)) for _ in range(300)]
    assert np.mean([fit.sd for fit in lines]) > 1.5 * np.mean([fit.sd for fit in fits])


@pytest.mark.nightly
def test_intervals_of_sensor_logs_hold_nine_of_ten_truths(tmp_path):
    """The independent simulator climbs slopes of six soils, each with sixteen random draws of sensors, gains and
    declared constants.
    """
    truths = [
        {"k": k, "phi": math.radians(phi)}
        for k, phi in ((0.0025, 31), (0.004, 29), (0.006, 33), (0.010, 30), (0.016, 28), (0.030, 32))
    ]
    covered = []
    for soil, (truth, channels) in enumerate(zip(truths, climb.climbs(truths, 5), strict=True)):
        for draw in range(16):
            folder = tmp_path / f"{soil}-{draw}"
            climb.write_climb(folder, channels, [2, soil, draw])
            identification = identify(folder)
            covered += [holds(identification[name].number, truth[name]) for name in ("k", "phi")]
    assert np.mean(covered) >= 0.90


def test_wheels_of_one_group_are_weighed_by_their_loads():
    """Two wheels have the law F(S) = S and carry 10 and 30 N, but the loads are assumed as 20 and 20 N. Only their
    torques decide F.
    """
    guessed = [Window(0, 1.0, 0.10, 0.01, 0.10 * 10 / 20, 0.02, 0.0, 0.05, 20.0)]
    guessed += [Window(1, 1.0, 0.12, 0.01, 0.12 * 30 / 20, 0.02, 0.0, 0.06, 20.0)]
    window = pool(guessed)
    assert (window.wheel, window.start, window.load) == (0, 1.0, 20.0)
    assert window.factor == pytest.approx((0.10 * 10 + 0.12 * 30) / 40)
    assert window.slip == pytest.approx(0.11)
    assert (window.slip_sd, window.factor_sd) == pytest.approx((0.01 / math.sqrt(2), 0.02 / math.sqrt(2)))
    assert pool(guessed[:1]) == guessed[0]


def test_a_declared_sd_of_the_motor_widens_the_shared_error(log):
    read = read_drive_log(log)
    motor = record_from(Motor, read.metadata.motor, "motor")
    gear = {**read.metadata.motor, "gear": {"value": 268.0, "unit": "", "sd": 26.8}}
    unsure = dataclasses.replace(read, metadata=dataclasses.replace(read.metadata, motor=gear))
    sure, wide = drive_points(read, motor), drive_points(unsure, motor)
    assert wide.shared == pytest.approx(np.hypot(sure.shared, 0.1 * sure.factor), rel=1e-6)
