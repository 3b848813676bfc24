"""Models and states that together reach every branch of the compiled step."""

import dataclasses
import math

import numpy as np
import pinocchio as pin

from rover_pin import Model, Motor, Soil, load_rover
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.parameters.soils import HARD_GROUND
from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import base_effects
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.start import Start
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.wheel_forces import NetTraction
from rover_pin.terrain import shapes

ROVER = load_rover()
GRIPPY = Soil(k=0.004)


def model(terrain, slip, traction=SoilTraction(), soil=GRIPPY, rover=ROVER):
    model_built = Model(rover, terrain, (soil, HARD_GROUND), Motor(), slip, base_effects(soil, rover, traction))
    return model_built.having(GearFriction(tau_c=0.02))


def narrow_in_front(rover):
    """Return the rover with front wheels of half the width."""
    front = max(mount.axle for mount in rover.wheels)
    narrow = rover.wheel.replace(b=rover.wheel.b / 2)
    mounts = (dataclasses.replace(wheel, wheel=narrow) if wheel.axle == front else wheel for wheel in rover.wheels)
    return dataclasses.replace(rover, wheels=tuple(mounts))


CASES = {
    "ditch": (model(shapes.ditch(wall_angle=math.radians(45.0), at=0.25), RelaxedSlip()), Start()),
    "rocks": (model(shapes.rocks(seed=3), RelaxedSlip()), Start()),
    "yawed": (model(shapes.ditch(wall_angle=math.radians(40.0), at=0.3), RelaxedSlip()), Start(yaw=0.6)),
    "backwards": (model(shapes.step(0.02, at=0.3), RelaxedSlip()), Start(x=0.6, yaw=math.pi)),
    "hills": (model(shapes.hills(1), RelaxedSlip()), Start(y=0.3, yaw=1.0)),
    "eq-1": (model(shapes.bump(at=0.2, ground=1), AlgebraicSlip()), Start()),
    "net": (model(shapes.flat(), RelaxedSlip(), SoilTraction(NetTraction(), SinkageAngles())), Start()),
    "over-an-edge": (model(shapes.rocks(seed=3), RelaxedSlip()), Start(y=0.135)),
    "across-an-edge": (model(shapes.one_sided_bump(at=-0.5, length=3.0), RelaxedSlip()), Start(y=-0.4, yaw=1.3)),
    "stiff-motor": (
        dataclasses.replace(model(shapes.bump(at=0.2), RelaxedSlip()), motor=Motor(resistance=0.5, rotor_inertia=3e-9)),
        Start(),
    ),
    "astride-an-edge": (model(shapes.one_sided_bump(0.01, 6.0, -3.0), RelaxedSlip()), Start(y=0.155, yaw=0.02)),
    "light": (dataclasses.replace(model(shapes.bump(0.01, at=0.05), AlgebraicSlip()), gravity=0.02), Start()),
    "held": (model(shapes.incline(math.radians(6.0), -2.0), RelaxedSlip()), Start()),
    "held, eq-1": (model(shapes.cross_slope(math.radians(9.0)), AlgebraicSlip(v_0=0.02)), Start(yaw=0.7)),
    "sprung, in its ruts": (
        model(shapes.step(0.02, at=0.3), RelaxedSlip())
        .having(MultiPass())
        .having(DiggingMemory(c_d=0.05))
        .having(SupplySag())
        .having(SpringDamper(k_s=0.6, d=0.02, q_0=0.1))
        .having(TetherDrag()),
        Start(x=0.6, yaw=math.pi),
    ),
    "stalled in its holes": (
        model(shapes.incline(math.radians(9.0), -2.0), RelaxedSlip(), soil=Soil())
        .having(DiggingMemory(c_d=0.3))
        .having(Bulldozing()),
        Start(),
    ),
    "compliant": (model(shapes.one_sided_bump(0.02, at=0.1), RelaxedSlip()).having(DifferentialCompliance()), Start()),
    "past its stops": (model(shapes.flat(), RelaxedSlip()), Start()),
    "two-widths": (model(shapes.bump(at=0.2, ground=1), RelaxedSlip(), rover=narrow_in_front(ROVER)), Start()),
}


DUTY = {"held": 0.0, "held, eq-1": 0.0}
"""Share of the duties where it is not 1: near rest the law is a blend of both directions."""


def bent(state):
    """Bend the bogies beyond their end stops in both directions; one of them moves back."""
    bends = (("bogie_l", 0.7, 0.3), ("bogie_r", -0.7, 4.0), ("rocker_l", 0.4, 0.1), ("rocker_r", -0.4, -0.1))
    for joint, angle, rate in bends:
        place = ROVER.angles[joint]
        dof = next(joint.idx_v for joint in list(ROVER.model.joints)[2:] if joint.idx_q == place)
        state.q[place], state.v[dof] = angle, rate
    state.q[2] = 0.3


def stirred(example, state):
    """Return a state in which every joint is bent and moves, all shears differ, and most wheels are pressed into the
    ground.
    """
    rng, rows = np.random.default_rng(11), constraint_rows(ROVER)
    free = np.eye(len(state.v)) - np.linalg.pinv(rows) @ rows
    state.q[:] = pin.integrate(ROVER.model, state.q, free @ (0.005 * rng.normal(size=len(state.v))))
    state.v[:] = free @ (0.1 * rng.normal(size=len(state.v)))
    state.contact *= rng.uniform(0.8, 1.2, size=state.contact.shape)
    state.contact += 0.02 * rng.uniform(size=state.contact.shape)
    loads = np.zeros(6)
    while np.count_nonzero(loads > 0.0) < 4:
        state.q[2] -= 5e-4
        probe = Kernel(example, state.copy(), 1e-6, symmetric=False)
        assert probe.step() == 0
        loads = probe.record[:, RECORD.index("normal")]
    return state
