"""The compiled monitor is compared with a monitor in plain NumPy, sample by sample in drives and for random beliefs."""

import ctypes
import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.control.torque_factor import torque_factors
from rover_pin.onboard.monitor.monitor import CANNOT_TELL, CAUSES, Monitor
from rover_pin.onboard.monitor.recording import current_scale
from rover_pin.simulation.sensors import NoisyController, Sensors
from tests.oracle import onboard

WALL = {
    "soil.k": 0.003, "terrain.wall_angle_deg": 47.0, "effect.MotionResistance.R": 0.07,
    "add": ("PostPeak.fraction=0.3", "DiggingMemory.c_d=0.1"),
}  # fmt: skip
STEEP = {"soil.k": 0.02, "terrain.angle_deg": 22.0, "terrain.start": 0.5}
DRIVES = {"wall": ("ditch", 11.0, WALL), "grip": ("incline", 12.0, STEEP)}
NAMES = (*CAUSES, CANNOT_TELL, "")


@pytest.fixture
def monitor():
    return Monitor.of(scenario("flat", soil="table-1", **{"soil.k": 0.02}).model)


def plain_of(monitor):
    """Return the plain monitor of a compiled monitor's rover. It uses the compiled monitor's table of pulls, which
    other tests check.
    """
    numbers = {name: getattr(monitor.struct, name) for name in ("sinkage", "buried", "no_load_rate", "stall_current")}
    return onboard.PlainMonitor(monitor.law.radii, monitor.keep["pulls"], **numbers)


def belief_of(monitor):
    """Return the fields of the belief that the monitor reads."""
    belief, n = monitor.estimate.belief, len(monitor.law.radii)
    tables = {name: belief.keep[name].copy() for name in ("rim", "weight", "travel", "stalled")}
    tables["under"] = dict(zip(onboard.ROWS, belief.keep["under"].reshape(-1, n).copy(), strict=True))
    tables |= {"slip": belief.keep["slip"].reshape(n, -1).copy(), "told": belief.estimates.copy()}
    numbers = ("speed", "pace", "bend", "wall", "stuck", "no_progress")
    return SimpleNamespace(**tables, **{name: getattr(belief.struct, name) for name in numbers})


def compare(monitor, plain, where):
    struct = monitor.struct
    for name in ("p_stuck", "p_buried", "smoothed", "motor", "sensor"):
        assert getattr(struct, name) == pytest.approx(getattr(plain, name), rel=1e-6, abs=1e-9), (where, name)
    assert bool(struct.alarm) == plain.alarm, where
    assert monitor.keep["causes"] == pytest.approx(plain.causes, abs=1e-9), where
    assert monitor.keep["holes"].reshape(plain.holes.shape) == pytest.approx(plain.holes, rel=1e-6, abs=1e-10), where
    assert monitor.keep["evidence"] == pytest.approx(plain.evidence, rel=1e-6, abs=1e-9), where
    assert monitor.digging == pytest.approx(plain.rates(plain.by_way), rel=1e-6, abs=1e-9), where


@pytest.mark.parametrize("name", DRIVES)
def test_both_monitors_agree_in_a_drive(name):
    scene, duration, settings = DRIVES[name]
    scene = scenario(scene, soil="table-1", duration=duration, **settings)
    monitor, inner = Monitor.of(scene.model), ConstantDuty()
    plain, causes = plain_of(monitor), set()

    def watch(reading):
        forecast = monitor.step(reading)
        posture = [*reading.attitude[:2], *reading.suspension]
        duty = np.broadcast_to(reading.duty, reading.wheel_rate.shape)
        if plain.check(duty, reading.wheel_rate, reading.current, posture):
            plain.foresee(belief_of(monitor))
        compare(monitor, plain, reading.t)
        assert forecast.cause == NAMES[plain.cause]
        causes.add(forecast.cause)
        return inner(reading)

    monitor.reset()
    simulate(scene.model, NoisyController(watch, Sensors(), 1), duration, scene.start)
    assert causes - {""}, "else only silence is compared"


def drawn(monitor, random, hard):
    """Fill the monitor's belief with random values. `hard`, from 0 to 1, scales the slopes, bends and walls of the
    ground.
    """
    belief, n = monitor.estimate.belief, len(monitor.law.radii)
    pace = float(random.choice([-0.03, 0.001, 0.05], p=[0.05, 0.05, 0.9]))
    under = {
        "slope": hard * random.uniform(-0.2, 0.6, n), "level": random.uniform(0.2, 1.0, n),
        "load": random.uniform(-2.0, 15.0, n), "ahead": 0.01 * random.normal(size=n),
    }  # fmt: skip
    table = belief.keep["under"].reshape(-1, n)
    for row, name in enumerate(onboard.ROWS):
        table[row] = under.get(name, 0.0)
    belief.keep["rim"][:] = pace * random.uniform(0.7, 1.3, n)
    many = len(belief.keep["weight"])
    belief.keep["weight"][:] = random.dirichlet(np.full(many, 0.5))
    belief.keep["travel"][:] = pace * random.uniform(-0.2, 1.2, many)
    belief.keep["stalled"][:] = random.random(many) < 0.2 * hard
    belief.keep["slip"].reshape(n, -1)[:] = random.uniform(-0.3, 0.9, (n, many))
    belief.estimates[:] = random.uniform(0.0, 0.6, (n, 4))
    numbers = {
        "pace": pace, "speed": pace * random.uniform(-0.1, 0.9), "bend": 0.1 * hard * random.random(),
        "wall": hard * random.choice([0.0, 0.3]), "stuck": random.random(), "no_progress": int(random.random() < 0.1),
    }  # fmt: skip
    for name, value in numbers.items():
        setattr(belief.struct, name, value)


@pytest.mark.parametrize("seed", range(3))
def test_both_monitors_agree_for_any_belief(monitor, seed):
    random, plain = np.random.default_rng(seed), plain_of(monitor)
    monitor.reset()
    p_stuck = []
    for sample in range(60):
        drawn(monitor, random, hard=min(0.04 * sample, 1.2) * (seed + 1) / 3)
        monitor._foresee()
        plain.foresee(belief_of(monitor))
        compare(monitor, plain, sample)
        p_stuck.append(plain.p_stuck)
    assert len(set(p_stuck)) > 8, "else the draws decide nothing"


def smoothed(monitor, p_stuck, times):
    """Return whether the alarm is raised after a number of samples in which the rover rolls back and P(stuck) =
    p_stuck.
    """
    belief = monitor.estimate.belief
    belief.struct.pace, belief.struct.stuck = -0.05, p_stuck
    for _ in range(times):
        monitor._foresee()
    return bool(monitor.struct.alarm)


def test_the_alarm_rises_above_075_and_ends_below_half_of_it(monitor):
    """P(stuck) is smoothed over 0.3 s: after n samples with the value P, the smoothed value is P (1 - (1 - 1/6)^n)."""
    monitor.reset()
    assert not smoothed(monitor, 0.0, 10), "before half a second nothing is said"
    assert not smoothed(monitor, 0.745, 60)
    assert smoothed(monitor, 0.755, 60)
    assert smoothed(monitor, 0.38, 60)
    assert not smoothed(monitor, 0.37, 60)
    rise = next(n for n in range(1, 60) if smoothed(monitor, 1.0, 1))
    from_level = 0.37
    assert rise == math.ceil(math.log((1 - 0.75) / (1 - from_level)) / math.log(5 / 6))


@pytest.mark.parametrize("off", [0.0, 0.1, 0.15, 0.2, 0.25, 0.4])
@pytest.mark.parametrize("duty", [0.2, 0.8])
def test_the_probability_of_a_motor_s_fault_is_bayes(monitor, off, duty):
    """A sound motor deviates from i R = delta V - K omega by 5 % of the largest term and 0.02. One motor in 1,000 is
    faulty.
    """
    monitor.reset()
    random, plain, n = np.random.default_rng(1), plain_of(monitor), 6
    for _ in range(25):
        rate = 0.5 * duty + 1e-3 * random.normal(size=n)
        current = duty - rate + off + 1e-3 * random.normal(size=n)
        readings = np.full(n, duty), rate * monitor.struct.no_load_rate, current * monitor.struct.stall_current
        addresses = [row.ctypes.data for row in (*readings, np.zeros(4))]
        monitor._library.rover_pin_monitor_check(ctypes.addressof(monitor.struct), *addresses, 4)
        plain.check(*readings, np.zeros(4))
    assert monitor.struct.motor == pytest.approx(plain.motor, rel=1e-9)
    sd = math.hypot(0.05 * max(duty, 0.5 * duty + off), 0.02)
    well = 0.999 / (sd * math.sqrt(2.0 * math.pi)) * math.exp(-0.5 * (off / sd) ** 2)
    assert monitor.struct.motor == pytest.approx(0.0005 / (well + 0.0005), rel=0.25)


@pytest.mark.parametrize(
    ("p_stuck", "causes", "cause"),
    [
        (0.19, (0.19, 0.0, 0.0), ""),
        (0.21, (0.21, 0.0, 0.0), "grip lost"),
        (0.60, (0.29, 0.16, 0.15), CANNOT_TELL),
        (0.60, (0.14, 0.31, 0.15), "digging"),
        (0.60, (0.14, 0.15, 0.31), "wall"),
    ],
)
def test_a_cause_is_named_from_half_of_p_stuck_on(monitor, p_stuck, causes, cause):
    monitor.reset()
    monitor.struct.p_stuck = p_stuck
    monitor.keep["causes"][:] = causes
    assert monitor._forecast(0.0).cause == cause


@pytest.mark.parametrize(("motor", "sensor", "cause"), [(0.49, 0.0, ""), (0.51, 0.0, "motor"), (0.0, 0.51, "sensor")])
def test_a_fault_is_named_from_one_half_on(monitor, motor, sensor, cause):
    monitor.reset()
    monitor.struct.motor, monitor.struct.sensor = motor, sensor
    assert monitor._forecast(0.0).cause == cause


def test_the_scale_of_currents_is_that_at_which_the_pull_carries_the_rover():
    """The expected scale is computed by hand: most of the used rows climb 6 deg slowly, and rows with rim speeds below
    a tenth of the largest are not used.
    """
    model, rise = scenario("flat", soil="table-1").model, math.tan(math.radians(6.0))
    r, weight = float(model.built.radii[0]), model.built.mass * model.built.gravity
    pitch = np.repeat([-math.radians(6.0), 0.0, math.radians(20.0)], [30, 20, 45])
    rates = np.repeat([[0.15], [1.0], [0.09]], [30, 20, 45], axis=0) * np.ones(6)
    currents = np.repeat([[0.3], [0.2], [5.0]], [30, 20, 45], axis=0) * np.ones(6)
    (resistance,) = torque_factors(model, [0.05])
    needed = weight * (resistance + rise) * r / 6.0 / float(model.motor.constant)
    assert current_scale(model, rates, currents, pitch) == pytest.approx(needed / 0.3)
