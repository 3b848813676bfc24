"""The built-in controllers in the compiled loop are compared with their Python classes, in drives and for random
states.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, SlipControl, scenario, simulate
from rover_pin.control.slip_control import Gains, HoleLaw
from rover_pin.control.slip_estimate import SpeedTable, TableEstimate, TrueSlip
from rover_pin.control.torque_check import PITCHES, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.simulation.command import Instant, Reading, ReadingPlaces
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.control import commands_of
from rover_pin.simulation.native.loop import QUESTIONS, Loop
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.start import Start, hovering
from studies.shared.tacking import Tacking, TackingControl

CASES = {
    "none": ("ditch", {}),
    "limit": ("ditch", {"control": "limit"}),
    "limit backwards": ("flat", {"control": "limit", "control.delta": -0.7, "control.slip_limit": 0.1}),
    "eq9": ("ditch", {"control": "eq9"}),
    "eq9 backwards": ("flat", {"control": "eq9", "control.delta_0": -0.5, "control.delta_min": -0.6}),
    "true, no limit": ("ditch", {"control": "true", "control.limit": "none", "control.S_d": 0.3}),
    "true, at a slip": ("slope", {"control": "true", "control.limit": "at-slip"}),
    "turn": ("turn", {}),
    "point-turn": ("flat", {"control": "point-turn"}),
    "crab": ("flat", {"control": "crab"}),
}


def asked(controller):
    """Return a controller with equal commands that the compiled loop does not know and must call from Python."""
    return lambda reading: controller(reading)


@pytest.mark.parametrize("name", CASES)
def test_a_built_in_controller_drives_as_its_class_does(name):
    shape, settings = CASES[name]
    case = scenario(shape, soil="table-1", **settings, duration=8.0)
    drives, stored = [], []
    assert commands_of(case.controller, 6) is not None
    for controller in (case.controller, asked(case.controller)):
        if hasattr(case.controller, "reset"):
            case.controller.reset()
        options = {
            "symmetric": case.symmetric,
            "measure_error": False,
        }  # one of a user is not driven again at finer steps
        drives.append(simulate(case.model, controller, 8.0, case.start, case.timing, **options))
        stored.append(np.array(getattr(case.controller, "integral", 0.0)))
    for channel in drives[0].channels:
        assert np.array_equal(drives[0][channel], drives[1][channel], equal_nan=True), channel
    assert np.array_equal(*stored)


class Careful(ConstantDuty):
    """A user's controller that is derived from a class of the package."""

    def __call__(self, reading):
        return 0.2


@dataclass(frozen=True)
class Half(NoLimit):
    """A user's torque limit."""

    def duty(self, reading):
        return 0.1

    def clip_duty(self, duty, reading):
        return min(duty, 0.1)


@pytest.mark.parametrize(
    "controller",
    [
        lambda reading: 0.3,
        Careful(),
        TorqueLimited(ConstantDuty(), Half()),
        TorqueLimited(Careful(), NoLimit()),
        SlipControl(Gains(), TrueSlip(), Half()),
    ],
    ids=["function", "subclass", "limit of a user", "limited subclass", "slip control under a user's limit"],
)
def test_a_users_parts_are_called_from_python(controller):
    case = scenario("flat", soil="table-1", duration=1.0)
    assert commands_of(controller, 6) is None
    trace = simulate(case.model, controller, 1.0, case.start)
    assert np.max(np.abs(trace["duty_fl"])) <= 0.3


@pytest.mark.parametrize("limited", [False, True], ids=["free", "under a torque limit"])
@pytest.mark.parametrize("rover", ["nexus6", "cart"])
def test_tacking_in_the_loop_is_that_of_its_class(rover, limited):
    """The rover drives through the ditch with turns to both sides."""
    case = scenario("ditch", rover=rover, **{"soil.k": 0.01})
    control = TackingControl(
        case.model.rover, Tacking(0.2, radius=0.8, alert=0.05, calm=1.5, delta=0.5, delta_climb=0.7)
    )
    full = TorqueLimited(control, TorqueLimit.at_slip(case.model)) if limited else control
    assert commands_of(full, len(case.model.rover.wheels)) is not None
    drives, stored = [], []
    for controller in (full, asked(full)):
        control.reset()
        drives.append(simulate(case.model, controller, 12.0, Start(0.0, 0.0, 0.15), measure_error=False))
        stored.append(control.memory.copy())
    for channel in drives[0].channels:
        assert drives[0][channel] == pytest.approx(drives[1][channel], rel=1e-8, abs=1e-8, nan_ok=True), channel
    assert np.array_equal(*stored)
    assert drives[0].attrs["stop"] == drives[1].attrs["stop"] == "duration"
    assert len(np.unique(drives[0].stack("duty"))) > 10


def test_drive_readings_are_looked_up_when_they_are_accessed():
    """A reading keeps its values after the drive has continued, and equals the reading of the plain step."""
    case, stored = scenario("ditch", soil="table-1"), []

    def watching(reading):
        stored.append(reading)
        return 0.5 + 0.1 * math.sin(9.0 * reading.t)

    trace = simulate(case.model, watching, 20.0, case.start)
    assert len(stored) == 400 > QUESTIONS
    assert set(vars(stored[7])) == {"_rows", "_index", "_places", "_row", "t"}
    for at in (1, 150, 399):
        row = round(at * case.timing.control / case.timing.sample) - 1
        now = stored[at]
        assert now.t == pytest.approx(0.05 * at)
        assert now.attitude == tuple(trace[f"body_{angle}"][row] for angle in ("roll", "pitch", "yaw"))
        assert now.truth.slip.tolist() == [trace[f"slip_{wheel.name}"][row] for wheel in case.model.rover.wheels]
        assert now.truth.position.tolist() == [trace[f"body_{axis}"][row] for axis in "xyz"]
        assert now.wheel_rate.tolist() == [trace[f"wheel_rate_{wheel.name}"][row] for wheel in case.model.rover.wheels]


def test_the_plain_step_shows_a_controller_the_same():
    case, observed = scenario("ditch", soil="table-1"), ([], [])
    for engine, readings in zip(("compiled", "pinocchio-crba"), observed, strict=True):
        controller = lambda reading, stored=readings: stored.append(reading) or 0.5  # noqa: E731
        simulate(case.model, controller, 0.15, case.start, engine=engine)
    for mine, theirs in zip(*observed, strict=True):
        for field in dataclasses.fields(Reading)[:-1]:
            name = field.name
            assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-9, abs=1e-11), name
        for name, truth_number in mine.truth._asdict().items():
            assert truth_number == pytest.approx(getattr(theirs.truth, name), rel=1e-9, abs=1e-11), name
    changed = observed[0][1].replace(current=np.ones(6))
    assert (changed.t, changed.current.tolist()) == (observed[0][1].t, [1.0] * 6)


MODEL, AT_ONCE = scenario("flat").model, 1e-12
TABLE = SpeedTable((0.0, 0.2, 0.5, 0.7, 1.0), (0.0, 0.02, 0.05, 0.08, 0.11))
WIDE = Gains(S_d=0.15, k_p=0.3, k_i=2.0, delta_0=0.2, delta_min=-1.0, delta_max=1.0)
SAMPLES = 150


def limit():
    """Return torque limits that differ between wheels and that rise and fall with the pitch."""
    torques = np.random.default_rng(5).uniform(-0.1, 1.0, (len(PITCHES), 6)) * float(MODEL.motor.stall_torque)
    return TorqueLimit(MODEL.motor, tuple(map(tuple, torques)))


def controllers():
    tacking = Tacking(0.4, radius=0.7, gain=3.0, alert=0.1, calm=2.0, delta=0.5, delta_climb=0.7)
    return {
        "a duty under a limit": TorqueLimited(ConstantDuty(0.8), limit()),
        "a duty backwards under a limit": TorqueLimited(ConstantDuty(-0.8), limit()),
        "slip control by Eq (9)": SlipControl(WIDE, TableEstimate(TABLE, 0.045)),
        "slip control by Eq (9) under a limit": SlipControl(WIDE, TableEstimate(TABLE, 0.045), limit(), period=0.1),
        "slip control by Eq (9) and the hole": SlipControl(WIDE, TableEstimate(TABLE, 0.045), hole=HoleLaw()),
        "slip control by the true slip": SlipControl(WIDE, TrueSlip(), NoLimit(), period=0.02),
        "slip control by the hole": SlipControl(WIDE, TrueSlip(), NoLimit(), 0.02, HoleLaw(S_deep=-0.1)),
        "tacking": TackingControl(MODEL.rover, tacking),
        "tacking under a limit": TorqueLimited(TackingControl(MODEL.rover, tacking), limit()),
    }


def loop_of(commands):
    """Return a loop of one sample and one step far above the ground, in which nothing moves."""
    state = hovering(MODEL, Start())
    kernel = Kernel(MODEL, state, AT_ONCE, symmetric=False)
    return Loop(kernel, AT_ONCE, 1, 1, per_control=1, **commands.fields(kernel, 1))


def scramble(loop, rng):
    """Set a random attitude (also beyond usual ones), random wheel rates of both signs or zero, and random duties and
    slips.
    """
    state, kernel, places = loop.state, loop.kernel, ReadingPlaces.of(MODEL)
    roll, pitch, yaw = rng.uniform(-0.3, 0.3), rng.uniform(-0.9, 0.9), rng.choice([1e-3, 0.3, 1.5]) * rng.normal()
    state.q[2], state.q[3:7] = 50.0, pin.Quaternion(pin.rpy.rpyToMatrix(roll, pitch, yaw)).coeffs()
    state.q[places.suspension] = rng.choice([0.02, 0.15]) * rng.normal(size=len(places.suspension))
    state.v[places.wheels] = rng.normal(size=6) * rng.choice([0.0, 1e-3, 0.02, 3.0], 6)
    kernel.duty[:] = rng.uniform(-1.0, 1.0, 6) * rng.choice([0.0, 1.0, 1.0], 6)
    kernel.record[:, RECORD.index("slip")] = rng.uniform(-1.0, 1.0, 6)
    kernel.record[:, RECORD.index("travel")] = 0.05 * rng.normal(size=6)
    loop.set(k=0, row=0, begin=rng.uniform(0.0, 10.0))
    return Instant(np.atleast_1d(loop.now()).copy(), 0, places)


@pytest.mark.parametrize("name", controllers())
def test_one_compiled_controller_sample_is_that_of_its_class(name):
    controller, rng = controllers()[name], np.random.default_rng(8)
    loop, stateful, readings = loop_of(controller.native(6)), getattr(controller, "controller", controller), []
    for _ in range(SAMPLES):
        if hasattr(stateful, "integral"):
            stateful.integral[:], stateful.depth[:] = 0.5 * rng.normal(size=6), rng.uniform(0.0, 0.015, 6)
        if hasattr(stateful, "memory"):
            stateful.memory[:] = rng.choice([-1.0, 1.0]), rng.choice([-1.0, 5.0])
        reading = scramble(loop, rng)
        twin = copy.deepcopy(controller)
        wanted = twin(reading)
        loop.run(1)
        assert loop.kernel.duty == pytest.approx(np.broadcast_to(wanted.duty, 6), rel=0.0, abs=1e-12)
        assert loop.kernel.servo_target == pytest.approx(np.broadcast_to(wanted.steer, 4), rel=0.0, abs=1e-12)
        inner = getattr(twin, "controller", twin)
        for stored in ("integral", "depth", "memory"):
            if hasattr(stateful, stored):
                assert getattr(stateful, stored) == pytest.approx(getattr(inner, stored), rel=1e-13, abs=1e-13)
        readings.append(loop.kernel.duty.copy())
    assert len(np.unique(np.round(readings, 9))) > 2
