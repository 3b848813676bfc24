"""The model that a drive log starts from, and which of its numbers are uncertain, by how much."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import Record, declared_sds, quantities, record_from
from rover_pin.contact import Soil
from rover_pin.effects.effect import SensorEffect
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.estimation.parameter import Parameter, declared_in
from rover_pin.experiments.drive_log.parameters import owner_name, owners, parameter
from rover_pin.experiments.soil_priors import SD
from rover_pin.logs.drive_log import DriveLog
from rover_pin.parameters.hard import HARD_GROUND
from rover_pin.rover.description.motor_sheet import MotorSheet
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.defaults import has_papers_wheel, own_motor, own_soil, usual_angles, usual_slip
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.channels import ODOMETRY
from rover_pin.simulation.trace.inertial import ACCELEROMETER, GYRO
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import TorqueTraction

DRIVEN_SAND = Soil().replace(k=0.005)
"""What stands for constants that a log does not declare: Table 1, with the k at which its rover can drive at all."""
MOTOR_TO_MOTOR, TACHO_TO_TACHO = 0.02, 0.015
"""SD of one motor's torque and of one tachogenerator's gain against the others' (assumed: small series motors)."""
ROLLING = 0.03
"""SD of the share by which all wheels of a rate-driven log roll on another radius than r (assumed: a tyre's is a third
of its deflection less, a lugged wheel's lies between rim and tips). Straight on it acts as slip does."""
MOTOR_SD = {"gear": 0.04, "resistance": 0.04}
"""Relative SD of a motor constant that is declared without one (assumed: data sheets)."""
ORDER = 1.0
"""SD of the logarithm of a motor constant that nobody declares: only its order is known."""
LEVEL_SD = math.tan(math.radians(1.0))
"""SD of the slope of a ground that a log's own level gives: its zero is off by a degree (assumed), as if R differed."""
SIDE_SD = 0.5
"""Relative SD of the side force (assumed: the law gives half of that of a measured wheel). It is free where nothing
steers: such a rover turns, and holds its heading, by scrub alone."""
TRACKER_SD = {"e": 0.02, "d": 0.05, "x": 0.0, "y": 0.0}
"""SDs of a tracker's scale error and its delay [s] that are declared without one (assumed); its place is exact then."""
SLIPS = 0.2
"""SD of the scale error of wheels' odometry that declares none (assumed: wheels on loose sand slip so)."""
ZERO_SD = {"gyro": 0.01, "accelerometer": 0.2}
"""SDs of an inertial unit's zero [rad/s], [m/s^2] (assumed: small ones, warm, 0.6 deg/s and 20 mg)."""
RESISTANCE_SD, RESISTANCES, FADES = 0.25, 0.15, 1.0
"""Relative SD of a motion resistance that is declared without one; SDs of an R and a q that nobody declares (assumed:
wheels on loose sand roll at 0 to 0.3 of their load; q may be all that is allowed of it)."""


def base_model(log: DriveLog) -> Model:
    """Return the model as the log declares it: rover, terrain, soil, motor, resistance, gravity, the paper's traction.

    Where no resistance is declared, R is that with which the declared soil's flat is cruised at S = 0.05.

    Raises DataError: a terrain, soil, motor or tracker that cannot be read.
    """
    rover = log.load_rover()
    soil = record_from(Soil, {**usual_soil(rover).values(), **log.metadata.soil}, f"{log.file}: [soil]")
    motor = record_from(Motor, {**own_motor(rover).value.values(), **log.metadata.motor}, f"{log.file}: [motor]")
    traction = SoilTraction(TorqueTraction(), usual_angles(rover, log.metadata.angles))
    effects, terrain = base_effects(soil, rover, traction, log.metadata.gravity), log.terrain()
    if log.metadata.resistance:
        resistance = record_from(MotionResistance, log.metadata.resistance, f"{log.file}: [resistance]")
        declared_values = {name: getattr(resistance, name) for name in log.metadata.resistance}
        effects = tuple(
            effect.replace(**declared_values) if isinstance(effect, MotionResistance) else effect for effect in effects
        )
    most = max(terrain.ground_indices)
    if most > 1:
        raise DataError(f"{log.file}: [terrain] has ground {most}: a log knows 0, the [soil], and 1, hard ground.")
    grounds, springs = (soil, HARD_GROUND), rover.springs
    slip, gravity = usual_slip(rover), log.metadata.gravity
    model = Model(rover, terrain, grounds, motor, slip, effects, gravity=gravity, body_effects=springs)
    return model.replace(sensor_effects=(*declared_tracker(log), *_inertial_zeros(log)))


def declared_tracker(log: DriveLog) -> tuple[SensorEffect, ...]:
    """Return what `[tracker]` declares: errors of its scale, e, and its delay, d, and the point on the rover, x and y.

    Wheels' odometry has a scale error in any case: the slip.
    """
    where = f"{log.file}: [tracker]"
    for key in log.metadata.tracker:
        if key not in TRACKER_SD:
            allowed = "give e, the error of its scale, d, its delay in s, or x and y, the point that it tracks"
            raise DataError(f"{where} has no key '{key}': {allowed}.")
    parts = {kind: _own(kind, log.metadata.tracker) for kind in (TrackedPoint, TrackerScale, TrackingDelay)}
    if log.metadata.place == ODOMETRY and not parts[TrackerScale]:
        parts[TrackerScale] = dict(TrackerScale.neutral)
    return tuple(record_from(kind, table, where) for kind, table in parts.items() if table)


def _inertial_zeros(log: DriveLog) -> tuple[SensorBias, ...]:
    """Return a zero error, none yet, of each axis of an inertial unit."""
    names = [name for name in (*GYRO, *ACCELEROMETER) if log.runs and all(name in run for run in log.runs)]
    return tuple(SensorBias(bias=0.0, channel=name) for name in names)


def _own(kind: type[Record], table: Mapping[str, Any]) -> dict[str, Any]:
    return {name: entry for name, entry in table.items() if name in quantities(kind)}


def usual_soil(rover: Rover) -> Soil:
    """Return what stands for soil constants that a log does not declare, in which the rover can drive at all."""
    return DRIVEN_SAND if has_papers_wheel(rover) else own_soil(rover).value


def is_rate_driven(log: DriveLog) -> bool:
    """Return whether replays of the log hold the wheels to their measured rates."""
    return any(run.rate_driven for run in log.runs)


def has_current_scale(log: DriveLog) -> bool:
    """Return whether logged amperes tell torques: a torque constant is declared, or duties show the motor's."""
    return {"k_t", "gear"} <= log.metadata.motor.keys() or not is_rate_driven(log)


def with_spread(model: Model, motors: bool = True) -> Model:
    """Return the model with a gain for each motor or for all wheels' radius, and each tachogenerator, unless it has."""
    wheels = model.rover.wheels
    gains = [WeakMotor(g=0.0, wheel=number) for number, _ in enumerate(wheels)] if motors else [TachoScale(e=0.0)]
    present = {
        (type(effect), effect.wheel) for effect in model.all_effects if isinstance(effect, WeakMotor | TachoScale)
    }
    for gain in (*gains, *(TachoScale(e=0.0, wheel=wheel.name) for wheel in wheels)):
        model = model if (type(gain), gain.wheel) in present else model.having(gain)
    return model


def nuisances(log: DriveLog, model: Model) -> tuple[Parameter, ...]:
    """Return the numbers that are uncertain without anything being missing, with what is known of them beforehand.

    The soil's phi, k, k_1 and, where the contact angles are fixed, theta_1; the motor's gear and resistance, and its
    supply where nobody declares it; the motion resistance, and how it fades; a gain for each motor and tachogenerator;
    where wheels are held to their rates and none steers, the side force. What the log declares has its SD, or one that
    is assumed of declared values; what it does not declare is assumed, as widely as such numbers lie.
    """
    parameter_of = partial(_prior_of, log, model)
    fixed = any(isinstance(effect, SoilTraction) and isinstance(effect.angles, FixedAngles) for effect in model.effects)
    numbers = []
    for name in ("phi", *(("theta_1",) if fixed else ()), "k", "k_1"):
        declared, undeclared, is_log = SD[name]
        size = abs(float(getattr(model.soils[0], name))) if is_log else 1.0
        numbers.append(parameter_of("soil", name, declared * size, undeclared * size, is_log))
    numbers += _of_motors(log, model) if not is_rate_driven(log) else _of_rolling(model)
    trackers = [
        _prior_of(log, model, owner_name(error), name, TRACKER_SD[name], SLIPS)
        for error in declared_tracker(log)
        for name in quantities(error)
        if error.neutral or name in log.metadata.tracker
    ]
    numbers += [number for number in trackers if number.scale > 0.0]
    zeros = ((zero, ZERO_SD[zero.channel.rpartition("_")[0]]) for zero in _inertial_zeros(log))
    units_source = "small inertial units, warm"
    numbers += [parameter(model, f"{owner_name(zero)}.bias", sd, source=units_source) for zero, sd in zeros]
    gains = (f"TachoScale[{wheel.name}].e" for wheel in model.rover.wheels)
    tacho_source = "tachogenerators of a kind differ so"
    return (
        *numbers,
        *_of_resistance(log, model),
        *(parameter(model, e, TACHO_TO_TACHO, source=tacho_source) for e in gains),
    )


def _of_resistance(log: DriveLog, model: Model) -> list[Parameter]:
    """Return the motion resistance and how it fades, where the model has one: of what is declared without doubt none.

    On ground that the log's own level tells a wrong zero acts as another R.
    """
    present = [effect for effect in model.effects if isinstance(effect, MotionResistance)]
    if not present:
        return []
    R = _prior_of(log, model, "MotionResistance", "R", RESISTANCE_SD * float(present[0].R), RESISTANCES)
    if any(log.is_estimated(run) for run in log.runs):
        R = replace(R, scale=math.hypot(R.scale, LEVEL_SD))
    return [number for number in (R, _prior_of(log, model, "MotionResistance", "q", 0.0, FADES)) if number.scale > 0.0]


def _of_rolling(model: Model) -> list[Parameter]:
    """Return what rates of wheels leave open: the radius they roll on, and the side force where nothing steers."""
    scrubs = all(wheel.steer_dof is None for wheel in model.rover.wheels)
    has = any(isinstance(effect, SideShear) and effect.scale for effect in model.effects)
    rolling = parameter(model, "TachoScale.e", ROLLING, source="a tyre rolls on less than its radius, a lug on more")
    return [rolling, *([parameter(model, "SideShear.scale", SIDE_SD, log=True)] if scrubs and has else [])]


def _of_motors(log: DriveLog, model: Model) -> list[Parameter]:
    """Return gear and resistance, known to 1 % at best, the supply where it is assumed, and each motor's gain."""
    constants, of_a_kind = [], "motors of a kind differ so"
    for name in ("gear", "resistance", "supply"):
        value = float(getattr(model.motor, name))
        constant = _prior_of(log, model, "motor", name, MOTOR_SD.get(name, 0.0) * value, ORDER * value, log_scale=True)
        constants += (
            [replace(constant, scale=max(constant.scale, 0.01))] if name in MOTOR_SD or not constant.declared else []
        )
    gains = (f"WeakMotor[{number}].g" for number in range(len(model.rover.wheels)))
    return [*constants, *(parameter(model, g, MOTOR_TO_MOTOR, source=of_a_kind) for g in gains)]


TABLES = {
    "soil": "soil", "motor": "motor", "MotionResistance": "resistance", "TrackerScale": "tracker",
    "TrackingDelay": "tracker", "TrackedPoint": "tracker",
}  # fmt: skip
"""Table of drive.toml that declares the numbers of a record."""


def _prior_of(
    log: DriveLog, model: Model, owner: str, name: str, sd: float, undeclared: float, log_scale: bool = False
) -> Parameter:
    """Return a number with what is known of it: the SD that is declared, `sd` of a declared value, else `undeclared`.

    SDs are those of the number in SI.
    """
    title, record = TABLES[owner], owners(model)[owner]
    table: Mapping[str, Any] = getattr(log.metadata, title)
    sd_by_name = declared_sds(table, type(record), f"{log.file}: [{title}]")
    declaration = declared_in(title, name, table, sd_by_name) or _by_the_rover(log, owner)
    size = sd_by_name.get(name, sd if declaration else undeclared)
    relative = abs(float(getattr(record, name))) if log_scale else 1.0
    return parameter(
        model, f"{owner}.{name}", size / relative, log_scale, declared=declaration, source=_assumption(log, owner)
    )


def _by_the_rover(log: DriveLog, owner: str) -> str:
    """Return where the rover's own description declares what the log does not; empty where it does not either."""
    motor_declared = owner == "motor" and isinstance(log.load_rover().motor, MotorSheet)
    return "declared in the rover's TOML, its SD assumed" if motor_declared else ""


def _assumption(log: DriveLog, owner: str) -> str:
    """Return who says what a log leaves open: of soil and motor the sentence of how they were chosen, where one is."""
    rover = log.load_rover()
    if owner == "motor":
        return "; ".join(own_motor(rover).assumed)
    return "; ".join(own_soil(rover).assumed) if owner == "soil" and not has_papers_wheel(rover) else ""
