"""One sample of each built-in controller in the compiled loop against its class, from states that no drive comes to."""

import copy

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import SpeedTable, TableEstimate, TrueSlip
from rover_pin.control.torque_check import PITCHES, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.instant import Instant, Places
from rover_pin.simulation.native.loop import Loop
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.start.place import Start, hovering
from studies.shared.tacking import Tacking, TackingControl

MODEL, AT_ONCE = scenario("flat").model, 1e-12
TABLE = SpeedTable((0.0, 0.2, 0.5, 0.7, 1.0), (0.0, 0.02, 0.05, 0.08, 0.11))
WIDE = Gains(S_d=0.15, k_p=0.3, k_i=2.0, delta_0=0.2, delta_min=-1.0, delta_max=1.0)
SAMPLES = 150


def limit():
    """Torques that differ with the wheel and rise and fall with the pitch."""
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
    """A loop of one sample and one step in which nothing moves, far above the ground."""
    state = hovering(MODEL, Start())
    kernel = Kernel(MODEL, state, AT_ONCE, symmetric=False)
    return Loop(kernel, AT_ONCE, 1, 1, per_control=1, **commands.fields(kernel, 1))


def scramble(loop, rng):
    """Any attitude a rover may have and more, wheels that turn either way or not, any duty and slip."""
    state, kernel, places = loop.state, loop.kernel, Places.of(MODEL)
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
    loop, own, told = loop_of(controller.native(6)), getattr(controller, "controller", controller), []
    for _ in range(SAMPLES):
        if hasattr(own, "integral"):
            own.integral[:], own.depth[:] = 0.5 * rng.normal(size=6), rng.uniform(0.0, 0.015, 6)
        if hasattr(own, "memory"):
            own.memory[:] = rng.choice([-1.0, 1.0]), rng.choice([-1.0, 5.0])
        reading = scramble(loop, rng)
        other = copy.deepcopy(controller)
        wanted = other(reading)
        loop.run(1)
        assert loop.kernel.duty == pytest.approx(np.broadcast_to(wanted.duty, 6), rel=0.0, abs=1e-12)
        assert loop.kernel.servo_target == pytest.approx(np.broadcast_to(wanted.steer, 4), rel=0.0, abs=1e-12)
        rest = getattr(other, "controller", other)
        for kept in ("integral", "depth", "memory"):
            if hasattr(own, kept):
                assert getattr(own, kept) == pytest.approx(getattr(rest, kept), rel=1e-13, abs=1e-13)
        told.append(loop.kernel.duty.copy())
    assert len(np.unique(np.round(told, 9))) > 2
