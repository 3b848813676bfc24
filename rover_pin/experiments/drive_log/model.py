"""The model that a drive log starts from, and which of its numbers are uncertain, by how much."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rover_pin.body.rover import Rover
from rover_pin.contact import Soil
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.errors import DataError
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.motion.defaults import has_papers_wheel, own_motor, own_soil, usual_angles, usual_slip
from rover_pin.motion.drive_log import DriveLog
from rover_pin.motion.model import Model, base_effects
from rover_pin.motion.motor import Motor
from rover_pin.parameters.hard import HARD_GROUND
from rover_pin.quantity import declared_sd, record_from
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.traction import TorqueTraction

DRIVEN_SAND = Soil().replace(k=0.005)
"""What stands for constants that a log does not declare: Table 1, with the k at which its rover can drive at all."""
MOTOR_TO_MOTOR, TACHO_TO_TACHO = 0.02, 0.015
"""SD of one motor's torque and of one tachogenerator's gain against the others' (assumed: small series motors)."""
SOIL_SD = {"phi": math.radians(2.0), "k": 0.35, "k_1": 0.35, "theta_1": math.radians(2.0)}
"""SD of a soil constant that is declared without one; relative for k and k_1 (assumed: bench tests)."""
UNDECLARED = 2.0
"""How much wider the prior of a constant is that the log does not declare at all."""
MOTOR_SD = {"gear": 0.04, "resistance": 0.04}
"""Relative SD of a motor constant that is declared without one (assumed: data sheets)."""
LEVEL_SD = math.tan(math.radians(1.0))
"""SD of the slope of a ground that a log's own level told: its zero is off by a degree (assumed), as if R differed."""
SIDE_SD = 0.5
"""Relative SD of the side force (assumed: the law gives half of that of a measured wheel). It is free where nothing
steers: such a rover turns, and holds its heading, by scrub alone."""
RESISTANCE_SD = 0.25
"""Relative SD of a motion resistance that is declared without one, or not at all (assumed)."""


def base_model(log: DriveLog) -> Model:
    """Return the model as the log declares it: rover, terrain, soil, motor, resistance, gravity, the paper's traction.

    Where no resistance is declared, R is that with which the declared soil's flat is cruised at S = 0.05.

    Raises
    ------
    DataError
        A terrain, soil or motor that cannot be read.
    """
    rover = log.load_rover()
    soil = record_from(Soil, {**usual_soil(rover).values(), **log.about.soil}, f"{log.folder}: [soil]")
    motor = record_from(Motor, log.about.motor, f"{log.folder}: [motor]") if log.about.motor else usual_motor(rover)
    traction = SoilTraction(TorqueTraction(), usual_angles(rover, log.about.angles))
    effects, terrain = base_effects(soil, rover, traction), log.terrain()
    if log.about.resistance:
        told = record_from(MotionResistance, log.about.resistance, f"{log.folder}: [resistance]")
        stated = {name: getattr(told, name) for name in log.about.resistance}
        effects = tuple(each.replace(**stated) if isinstance(each, MotionResistance) else each for each in effects)
    most = max(terrain.ground_indices)
    if most > 1:
        raise DataError(f"{log.folder}: [terrain] has ground {most}: a log knows 0, the [soil], and 1, hard ground.")
    grounds, springs = (soil, HARD_GROUND), rover.springs
    slip, gravity = usual_slip(rover), log.about.gravity
    return Model(rover, terrain, grounds, motor, slip, effects, gravity=gravity, body_effects=springs)


def usual_soil(rover: Rover) -> Soil:
    """Return what stands for soil constants that a log does not declare, in which the rover can drive at all."""
    return DRIVEN_SAND if has_papers_wheel(rover) else own_soil(rover).value


def usual_motor(rover: Rover) -> Motor:
    """Return the motor of a log that declares none: the paper's, another rover's own, or one sized by its weight."""
    return Motor() if has_papers_wheel(rover) else own_motor(rover).value


def held(log: DriveLog) -> bool:
    """Return whether replays of the log hold the wheels to their measured rates."""
    return any(run.held for run in log.runs)


def with_spread(model: Model, motors: bool = True) -> Model:
    """Return the model with a gain for each motor and each tachogenerator, all exact, unless it has them."""
    for number, wheel in enumerate(model.rover.wheels):
        gains: list[WeakMotor | TachoScale] = [WeakMotor(g=0.0, wheel=number)] if motors else []
        for gain in (*gains, TachoScale(e=0.0, wheel=wheel.name)):
            present = [one for one in model.all_effects if isinstance(one, (WeakMotor, TachoScale))]
            alike = any(type(one) is type(gain) and one.wheel == gain.wheel for one in present)
            model = model if alike else model.having(gain)
    return model


def nuisances(log: DriveLog, model: Model) -> tuple[Parameter, ...]:
    """Return the numbers that are uncertain without anything being missing, with their priors.

    The soil's phi, k, k_1 and, where the contact angles are fixed, theta_1; the motor's gear and resistance; the motion
    resistance; a gain for each motor and tachogenerator; where wheels are held to their rates and none steers, the side
    force. SDs are the log's where it states them.
    """
    declared = log.about.soil
    found = [parameter(model, "soil.phi", _sd(log.folder, declared, "phi", "rad", SOIL_SD["phi"]))]
    fixed = any(isinstance(one, SoilTraction) and isinstance(one.angles, FixedAngles) for one in model.effects)
    found += [parameter(model, "soil.theta_1", SOIL_SD["theta_1"])] if fixed else []
    for name in ("k", "k_1"):
        value = abs(float(getattr(model.soils[0], name)))
        unit = {"k": "m", "k_1": "Pa"}[name]
        sd = _sd(log.folder, declared, name, unit, SOIL_SD[name] * value) / value
        found.append(parameter(model, f"soil.{name}", sd, log=True))
    found += _of_motors(log, model) if not held(log) else _of_scrub(model)
    for R in (float(one.R) for one in model.effects if isinstance(one, MotionResistance) and one.R):
        sd = _sd(log.folder, log.about.resistance, "R", "", RESISTANCE_SD * R, widen=False)
        sd = math.hypot(sd, LEVEL_SD) if any(log.is_estimated(run) for run in log.runs) else sd
        found.append(parameter(model, "MotionResistance.R", sd / R, log=True))
    return (*found, *(parameter(model, f"TachoScale[{one.name}].e", TACHO_TO_TACHO) for one in model.rover.wheels))


def _of_scrub(model: Model) -> list[Parameter]:
    """Return the scale of the side force of a rover that does not steer."""
    scrubs = all(wheel.steer_dof is None for wheel in model.rover.wheels)
    has = any(isinstance(one, SideShear) and one.scale for one in model.effects)
    return [parameter(model, "SideShear.scale", SIDE_SD, log=True)] if scrubs and has else []


def _of_motors(log: DriveLog, model: Model) -> list[Parameter]:
    found = []
    for name, sd in MOTOR_SD.items():
        value, unit = float(getattr(model.motor, name)), {"gear": "", "resistance": "ohm"}[name]
        relative = _sd(log.folder, log.about.motor, name, unit, sd * value, widen=False) / value
        found.append(parameter(model, f"motor.{name}", max(relative, 0.01), log=True))
    numbers = range(len(model.rover.wheels))
    return [*found, *(parameter(model, f"WeakMotor[{number}].g", MOTOR_TO_MOTOR) for number in numbers)]


def _sd(folder: Any, table: Mapping[str, Any], name: str, unit: str, default: float, widen: bool = True) -> float:
    """Return the SD that a table of the log declares of a constant, or the default; wider where it is not declared."""
    entry = table.get(name)
    declared = declared_sd(entry, unit, f"{folder}: the sd of '{name}'")
    return default * (UNDECLARED if widen and entry is None else 1.0) if declared is None else declared
