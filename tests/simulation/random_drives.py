"""Random drives within the declared bounds of all their numbers. `drive(seed)` always returns the same drive."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from rover_pin import ConstantDuty, Model, Motor, SlipControl, Soil, Wheel, load_rover, simulate
from rover_pin.base.quantity import quantities
from rover_pin.control.open_loop import Turn
from rover_pin.control.slip_control import Gains
from rover_pin.control.slip_estimate import TrueSlip
from rover_pin.control.torque_check import TorqueLimit
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.viscous_friction import ViscousFriction
from rover_pin.simulation.start import Start
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction
from rover_pin.terrain import shapes

DURATION = 1.5
STRUCTURES = (
    (RelaxedSlip, TorqueTraction, FixedAngles, ()),
    (RelaxedSlip, NetTraction, SinkageAngles, (GearFriction,)),
    (AlgebraicSlip, TorqueTraction, FixedAngles, (GearFriction,)),
    (AlgebraicSlip, GrossTraction, SinkageAngles, ()),
    (RelaxedSlip, GrossTraction, FixedAngles, (SlipSinkage, MultiPass, DeadBand)),
    (RelaxedSlip, TorqueTraction, SinkageAngles, (DiggingMemory, PostPeak, ViscousFriction)),
    (AlgebraicSlip, NetTraction, FixedAngles, (LoadExponent, RateDependence)),
    (RelaxedSlip, TorqueTraction, FixedAngles, (Bulldozing, PivotFriction, GearFriction)),
)
"""Slip law, form, angles and further effects: few, because each is compiled."""
WIDE = 0.25
"""Share of numbers drawn from all of their declared range; the others lie within a factor of 4 of their default."""

SMALLEST = 1e-6
"""Of what may be 0: share of its greatest value from which on it is drawn."""


@dataclass(frozen=True)
class RandomDrive:
    model: Model
    controller: object
    start: Start

    def drive(self, timing, *, measure_error=True):
        return simulate(self.model, self.controller, DURATION, self.start, timing, measure_error=measure_error)


def log_uniform(rng, low, high):
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def number(rng, default, changes):
    """Return a random number of a quantity: near its default, or anywhere in its range."""
    low, high = max(changes.low, -1e9), min(changes.high, 1e9)
    if rng.random() < WIDE:
        if low == 0.0:
            return high * log_uniform(rng, SMALLEST, 1.0)
        return log_uniform(rng, low, high) if low > 0.0 else float(rng.uniform(low, high))
    close = default * log_uniform(rng, 0.25, 4.0) if default else rng.uniform(-0.1, 0.1) * min(1.0, high)
    return float(min(high, max(low, close)))


def drawn(rng, record):
    """Return a record with random numbers. Fields that name a wheel or a place, and the exponent with which u fades,
    are kept.
    """
    named = {
        name: number(rng, float(getattr(record, name)), quantity)
        for name, quantity in quantities(record).items()
        if name != "q"
    }
    return record.replace(**named)


def soil(rng):
    """Return a soil with random numbers within its declared bounds, including zeros and negative moduli."""
    bounds = quantities(Soil)
    drawn = {}
    for name in ("c", "k", "n", "theta_1", "exit_ratio"):
        low, high = bounds[name].low, bounds[name].high
        drawn[name] = log_uniform(rng, max(low, 1e-3), high) if high > 5.0 else float(rng.uniform(low, high))
    drawn["k"] = min(log_uniform(rng, bounds["k"].low, 10.0), bounds["k"].high)  # often at its end, where hardly any
    drawn["phi"], drawn["theta_2"] = (
        float(rng.uniform(bounds[name].low, bounds[name].high)) for name in ("phi", "theta_2")
    )
    return Soil(**drawn, **moduli(rng, bounds))


def moduli(rng, bounds):
    """Return random k_1 and k_2: one of them alone, both, or (in every second case of both) one of them negative. Some
    are anywhere in their range.
    """
    k_1, k_2 = log_uniform(rng, 1e3, bounds["k_1"].high), log_uniform(rng, 1e4, bounds["k_2"].high)
    kind = rng.integers(6)
    if kind == 0:
        return {"k_1": float(rng.uniform(bounds["k_1"].low, bounds["k_1"].high)), "k_2": k_2}
    if kind < 3:
        return {"k_1": k_1, "k_2": 0.0}
    if kind == 3:
        return {"k_1": 0.0, "k_2": k_2}
    share = float(rng.uniform(-0.9, 2.0))
    return {"k_1": share * 0.05 * k_2, "k_2": k_2} if 0.05 * k_2 * abs(share) < 1e9 else {"k_1": k_1, "k_2": k_2}


def terrain(rng):
    angle = math.radians(rng.uniform(-25.0, 25.0))
    makers = (
        lambda: shapes.flat(),
        lambda: shapes.incline(angle, rng.uniform(-2.0, 0.5)),
        lambda: shapes.cross_slope(angle),
        lambda: shapes.bump(rng.uniform(-0.05, 0.05), rng.uniform(0.1, 0.5), rng.uniform(-0.2, 0.3)),
        lambda: shapes.one_sided_bump(
            rng.uniform(0.0, 0.05), 0.3, rng.uniform(0.0, 0.3), left=bool(rng.random() < 0.5)
        ),
        lambda: shapes.ditch(
            0.05, rng.uniform(0.15, 0.4), math.radians(rng.uniform(40.0, 80.0)), rng.uniform(0.1, 0.4)
        ),
        lambda: shapes.step(rng.uniform(-0.04, 0.04), at=rng.uniform(0.15, 0.4), ground=int(rng.integers(2))),
        lambda: shapes.rocks(int(rng.integers(100)), ground=int(rng.integers(2))),
        lambda: shapes.washboard(rng.uniform(0.0, 0.02), rng.uniform(0.1, 0.5), at=rng.uniform(-0.5, 0.3)),
        lambda: shapes.hills(int(rng.integers(100)), rng.uniform(0.0, 0.08)),
    )
    return makers[rng.integers(len(makers))]()


def wheels_of(rng, rover):
    """Return the rover with wheel sizes that are changed by up to a tenth. The suspension is not changed."""
    size = float(rng.uniform(0.9, 1.1))
    mounts = (
        dataclasses.replace(wheel, wheel=Wheel(r=wheel.wheel.r * size, b=wheel.wheel.b * size))
        for wheel in rover.wheels
    )
    return dataclasses.replace(rover, wheels=tuple(mounts))


def controller(rng, model):
    kind = rng.integers(4)
    delta = float(rng.uniform(-1.0, 1.0))
    if kind == 0:
        return ConstantDuty(delta)
    if kind == 1:
        rate = float(rng.uniform(0.5, 6.0))
        return lambda reading: delta * math.sin(rate * reading.t)
    if kind == 2 and any(wheel.steer_dof is not None for wheel in model.rover.wheels):
        return Turn.of(model.rover, radius=float(rng.choice([0.0, rng.uniform(0.6, 3.0)])), delta=delta)
    gains = Gains(k_p=float(rng.uniform(0.0, 1.0)), k_i=float(rng.uniform(0.0, 2.0)))
    return SlipControl(gains, TrueSlip(), TorqueLimit.saturation(model))


def drive(seed):
    """Return a random drive: rover, wheels, load, terrain, soils, motor, effects, gravity, controller and start."""
    rng = np.random.default_rng(seed)
    slip, form, angles, more = STRUCTURES[rng.integers(len(STRUCTURES))]
    rover = wheels_of(rng, load_rover("nexus6" if PivotFriction in more else ("nexus6", "cart")[rng.integers(2)]))
    rover = rover.carrying(float(rover.mass * rng.uniform(0.0, 3.0))) if rng.random() < 0.3 else rover
    ground, hard = soil(rng), soil(rng)
    resistance = () if form is NetTraction else (drawn(rng, MotionResistance()),)
    effects = (SoilTraction(form(), angles()), drawn(rng, NormalDamping()), *resistance, drawn(rng, SideShear()))
    model = Model(
        rover, terrain(rng), (ground, hard), drawn(rng, Motor()), drawn(rng, slip()), effects,
        gravity=log_uniform(rng, 0.05, 50.0),
    )  # fmt: skip
    for kind in more:
        model = model.having(drawn(rng, kind()))
    start = Start(
        *(float(coordinate) for coordinate in (rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-3.1, 3.1)))
    )
    return RandomDrive(model, controller(rng, model), start)
