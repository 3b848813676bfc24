"""The base model of a drive log, the names of its numbers, and the priors of its uncertain numbers.

`base_model` builds the model that the log declares. `nuisances` returns the numbers that are uncertain even if no
effect is missing. The name of a number, such as "soil.phi", "motor.gear" or "WeakMotor[2].g", consists of the part of
the model that has the number, and of the quantity.
"""

import math
import re
from collections.abc import Mapping, Sequence
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
from rover_pin.estimation.experiment import find
from rover_pin.estimation.parameter import Parameter, declared_in, parameter_of
from rover_pin.experiments.soil_priors import MOTOR_SD, RESISTANCE_SD, SD, UNDECLARED_DECAY_SD, UNDECLARED_RESISTANCE_SD
from rover_pin.logs.drive_log import DriveLog
from rover_pin.parameters.soils import HARD_GROUND
from rover_pin.rover.description.layout import MotorSheet
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.defaults import has_papers_wheel, own_motor, own_soil, usual_angles, usual_slip
from rover_pin.simulation.model.model import OWNERS, Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.sensors import ACCELEROMETER, GYRO
from rover_pin.simulation.trace.channels import ODOMETRY
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import TorqueTraction

DRIVEN_SAND = Soil().replace(k=0.005)
"""Soil that is assumed if a log of the paper's rover declares no soil: Table 1 of the paper, but with a smaller shear
modulus k, because the rover cannot drive at all on the original soil."""
MOTOR_TO_MOTOR, TACHO_TO_TACHO = 0.02, 0.015
"""Prior relative SD of one motor's torque, and prior relative SD of the ratio of measured to true rate of one
tachogenerator, within a rover (assumed: small series motors)."""
ROLLING_SD = 0.03
"""Prior relative SD of the rolling radius of all wheels of a log without duties (assumed: a tyre's radius is smaller by
a third of its deflection, a lugged wheel's radius lies between rim and tips). On a straight path, a wrong rolling
radius looks like slip."""
ORDER_SD = 1.0
"""Prior SD of the logarithm of a motor constant that is not declared: only its order of magnitude is known."""
LEVEL_SD = math.tan(math.radians(1.0))
"""Prior SD of the slope of a terrain that is estimated from the rover's own tilt sensor, whose zero is wrong by a
degree (assumed). A wrong slope acts like a wrong motion resistance R."""
SIDE_SD = 0.5
"""Prior relative SD of the side force (assumed: the law gives half of the side force of a measured wheel). The side
force is uncertain in logs without duties whose rover has no steering: such a rover turns and holds its heading by
scrubbing alone."""
TRACKER_SD = {"e": 0.02, "d": 0.05, "x": 0.0, "y": 0.0}
"""Number of the table [tracker] -> prior SD if the number is declared without an SD (assumed): scale error e, delay d
[s], and the place x, y of the tracked point, which is then exact."""
ODOMETRY_SCALE_SD = 0.2
"""Prior SD of the scale error of wheel odometry, if the log declares no scale error (assumed: wheels on loose sand slip
by this much)."""
ZERO_SD = {"gyro": 0.01, "accelerometer": 0.2}
"""Inertial sensor -> prior SD of its zero [rad/s], [m/s^2] (assumed: small warm units, 0.6 deg/s and 20 mg)."""

DECIDING_CONSTANTS = {
    "soil": ("phi", "k", "k_1"), "motor": ("supply", "resistance", "k_t", "gear"), "resistance": ("R",),
}  # fmt: skip
"""Table of drive.toml -> the constants in it that decide most how a rover drives. If a log does not declare one of
them, commands that use the log print the assumed value."""
TABLES = {
    "soil": "soil", "motor": "motor", "MotionResistance": "resistance", "TrackerScale": "tracker",
    "TrackingDelay": "tracker", "TrackedPoint": "tracker",
}  # fmt: skip
"""Part of a model -> table of drive.toml that declares the numbers of this part."""


def base_model(log: DriveLog) -> Model:
    """Return the model that a log declares: rover, terrain, soil, motor, motion resistance, gravity, and the paper's
    traction.

    If the log declares no resistance, R gets the value that lets the rover drive on level ground with the declared soil
    at the slip S = 0.05.

    Raises
    ------
    DataError
        If a terrain, soil, motor, resistance or tracker cannot be read.
    """
    rover = log.load_rover()
    # Declared constants replace the usual constants of this rover; the others stay assumed.
    soil = record_from(Soil, {**usual_soil(rover).values(), **log.metadata.soil}, f"{log.file}: [soil]")
    motor = record_from(Motor, {**own_motor(rover).value.values(), **log.metadata.motor}, f"{log.file}: [motor]")
    traction = SoilTraction(TorqueTraction(), usual_angles(rover, log.metadata.angles))
    effects, terrain = base_effects(soil, rover, traction, log.metadata.gravity), log.terrain()
    if log.metadata.resistance:
        resistance = record_from(MotionResistance, log.metadata.resistance, f"{log.file}: [resistance]")
        # Only declared numbers are replaced, so that an undeclared R keeps the value of the level drive.
        declared_values = {name: getattr(resistance, name) for name in log.metadata.resistance}
        effects = tuple(
            effect.replace(**declared_values) if isinstance(effect, MotionResistance) else effect for effect in effects
        )
    highest = max(terrain.ground_indices)
    if highest > 1:
        raise DataError(
            f"{log.file}: [terrain] has ground {highest}, but a log allows only ground 0, which is the [soil], and "
            "ground 1, which is hard; correct the column ground of the terrain's file."
        )
    # Index 0 of the terrain is the declared soil, and index 1 is hard ground.
    grounds, springs = (soil, HARD_GROUND), rover.springs
    slip, gravity = usual_slip(rover), log.metadata.gravity
    model = Model(rover, terrain, grounds, motor, slip, effects, gravity=gravity, body_effects=springs)
    return model.replace(sensor_effects=(*declared_tracker(log), *_inertial_zeros(log)))


def declared_tracker(log: DriveLog) -> tuple[SensorEffect, ...]:
    """Return the errors of the tracker that a log's table [tracker] declares, as sensor effects.

    These are the scale error e, the delay d [s], and the tracked point x, y [m]. If the place of a log is wheel
    odometry, the result always has a scale error, which represents the slip.

    Raises
    ------
    DataError
        If [tracker] has a key other than e, d, x and y.
    """
    where = f"{log.file}: [tracker]"
    for key in log.metadata.tracker:
        if key not in TRACKER_SD:
            allowed = "give e, the error of its scale, d, its delay in s, or x and y, the point that it tracks"
            raise DataError(f"{where} has no key '{key}': {allowed}.")
    # Each key of [tracker] belongs to one of three sensor effects.
    tables: dict[type[SensorEffect], dict[str, Any]] = {
        kind: {name: entry for name, entry in log.metadata.tracker.items() if name in quantities(kind)}
        for kind in (TrackedPoint, TrackerScale, TrackingDelay)
    }
    if log.metadata.place == ODOMETRY and not tables[TrackerScale]:
        tables[TrackerScale] = dict(TrackerScale.neutral)
    return tuple(record_from(kind, table, where) for kind, table in tables.items() if table)


def _inertial_zeros(log: DriveLog) -> tuple[SensorBias, ...]:
    """Return a `SensorBias` of 0 for each axis of an inertial unit that all runs of the log have.

    The zeros of an inertial unit are uncertain, so the biases are fitted.
    """
    # A bias can only be fitted if every run has the channel.
    names = [name for name in (*GYRO, *ACCELEROMETER) if log.runs and all(name in run for run in log.runs)]
    return tuple(SensorBias(bias=0.0, channel=name) for name in names)


def usual_soil(rover: Rover) -> Soil:
    """Return the soil whose constants are used where a log declares none: a soil on which the rover can drive."""
    return DRIVEN_SAND if has_papers_wheel(rover) else own_soil(rover).value


def undeclared_constants(log: DriveLog, records: Mapping[str, Record]) -> dict[str, dict[str, str]]:
    """Return the constants that decide how a rover drives and that a log does not declare, with their assumed values.

    Parameters
    ----------
    log : DriveLog
        Its file drive.toml has tables with the declared constants.
    records : mapping
        Table of drive.toml (`soil`, `motor`, `resistance`) -> record with the values that are used.

    Returns
    -------
    dict
        Table -> name of the constant -> assumed value with its unit. A table whose constants are all declared is left
        out. Example: `{"soil": {"phi": "0.5236 rad", "k": "0.005 m", "k_1": "5.421e+04 Pa"}}`.
    """
    declared = {"soil": log.metadata.soil, "motor": log.metadata.motor, "resistance": log.metadata.resistance}
    missing = {
        title: {
            name: f"{float(getattr(record, name)):.4g} {quantities(record)[name].unit}".strip()
            for name in DECIDING_CONSTANTS[title]
            if name not in declared[title]
        }
        for title, record in records.items()
    }
    return {title: values for title, values in missing.items() if values}


def is_rate_driven(log: DriveLog) -> bool:
    """Return whether a run of the log has no duties, so that its replay holds the wheels to their measured rates."""
    return any(run.rate_driven for run in log.runs)


def has_current_scale(log: DriveLog) -> bool:
    """Return whether the torque of a motor can be computed from its logged current in amperes.

    This is so if the log declares k_t and gear of the motor, or if the log has duties, so that both can be fitted.
    """
    return {"k_t", "gear"} <= log.metadata.motor.keys() or not is_rate_driven(log)


def with_spread(model: Model, motors: bool = True) -> Model:
    """Return the model with effects for the differences between its motors and between its tachogenerators, all with
    value 0.

    Each tachogenerator gets a factor on its measured rate, and each motor gets a factor on its torque. If `motors` is
    False, one error of the rolling radius of all wheels replaces the factors of the motors. Effects that the model
    already has are kept.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> flat = scenario("flat").model  # six wheels
    >>> len(with_spread(flat).all_effects) - len(flat.all_effects)
    12
    """
    wheels = model.rover.wheels
    # With given wheel rates, the motors do not show, and a common error of the rolling radius takes their place.
    gains = [WeakMotor(g=0.0, wheel=number) for number, _ in enumerate(wheels)] if motors else [TachoScale(e=0.0)]
    present = {
        (type(effect), effect.wheel) for effect in model.all_effects if isinstance(effect, WeakMotor | TachoScale)
    }
    for gain in (*gains, *(TachoScale(e=0.0, wheel=wheel.name) for wheel in wheels)):
        model = model if (type(gain), gain.wheel) in present else model.having(gain)
    return model


def nuisances(log: DriveLog, model: Model) -> tuple[Parameter, ...]:
    """Return the numbers of a model that are uncertain even if no effect is missing, with their priors.

    These are phi, k and k_1 of the soil, and theta_1 if the contact angles are fixed; gear ratio and resistance of the
    motor, and its supply voltage if it is not declared; the motion resistance R and its decay q; the numbers of the
    tracker and of an inertial unit; and the gain of each motor and tachogenerator. In a log without duties, the rolling
    radius replaces the numbers of the motor, and the side force is uncertain too if the rover has no steering.

    The prior SD of a declared number is its declared SD, or an SD that is assumed for declared values. A number that is
    not declared has an assumed value, and its prior SD has the order of magnitude of this value.
    """
    prior_of = partial(_prior_of, log, model)
    is_fixed = any(
        isinstance(effect, SoilTraction) and isinstance(effect.angles, FixedAngles) for effect in model.effects
    )
    numbers = []
    for name in ("phi", *(("theta_1",) if is_fixed else ()), "k", "k_1"):
        declared, undeclared, is_log = SD[name]
        size = abs(float(getattr(model.soils[0], name))) if is_log else 1.0
        numbers.append(prior_of("soil", name, declared * size, undeclared * size, is_log))
    if is_rate_driven(log):
        source = "a tyre rolls on less than its radius, a lug on more"
        numbers.append(parameter(model, "TachoScale.e", ROLLING_SD, source=source))
        has_side_force = any(isinstance(effect, SideShear) and effect.scale for effect in model.effects)
        if has_side_force and all(wheel.steer_dof is None for wheel in model.rover.wheels):
            numbers.append(parameter(model, "SideShear.scale", SIDE_SD, log=True))
    else:
        for name in ("gear", "resistance", "supply"):
            value = float(getattr(model.motor, name))
            constant = prior_of("motor", name, MOTOR_SD.get(name, 0.0) * value, ORDER_SD * value, log_scale=True)
            # A declared supply is exact. The SD of the other constants is at least 1 %.
            if name in MOTOR_SD or not constant.declared:
                numbers.append(replace(constant, scale=max(constant.scale, 0.01)))
        numbers += [
            parameter(model, f"WeakMotor[{number}].g", MOTOR_TO_MOTOR, source="motors of a kind differ so")
            for number in range(len(model.rover.wheels))
        ]
    # A number with an SD of 0 is exact and left out, here and below.
    trackers = [
        prior_of(owner_name(error), name, TRACKER_SD[name], ODOMETRY_SCALE_SD)
        for error in declared_tracker(log)
        for name in quantities(error)
        if error.neutral or name in log.metadata.tracker
    ]
    numbers += [number for number in trackers if number.scale > 0.0]
    for zero in _inertial_zeros(log):
        sd = ZERO_SD[zero.channel.rpartition("_")[0]]
        numbers.append(parameter(model, f"{owner_name(zero)}.bias", sd, source="small inertial units, warm"))
    resistances = [effect for effect in model.effects if isinstance(effect, MotionResistance)]
    if resistances:
        sd = RESISTANCE_SD * float(resistances[0].R)
        R = prior_of("MotionResistance", "R", sd, UNDECLARED_RESISTANCE_SD)
        # If the terrain is estimated from the rover's attitude, a wrong zero of the tilt sensor acts as another R does.
        if any(log.is_estimated(run) for run in log.runs):
            R = replace(R, scale=math.hypot(R.scale, LEVEL_SD))
        q = prior_of("MotionResistance", "q", 0.0, UNDECLARED_DECAY_SD)
        numbers += [number for number in (R, q) if number.scale > 0.0]
    source = "tachogenerators of a kind differ so"
    names = (f"TachoScale[{wheel.name}].e" for wheel in model.rover.wheels)
    return (*numbers, *(parameter(model, name, TACHO_TO_TACHO, source=source) for name in names))


def _prior_of(
    log: DriveLog, model: Model, owner: str, name: str, sd: float, undeclared: float, log_scale: bool = False
) -> Parameter:
    """Return one number of the model as a parameter, with its declared or an assumed prior SD.

    Parameters
    ----------
    owner, name : str
        Name of the part of the model, and name of the quantity, such as "soil" and "phi".
    sd : float
        Prior SD [SI] of a value that is declared without an SD. If the log declares an SD, that SD is used instead.
    undeclared : float
        Prior SD [SI] of a value that is not declared.
    log_scale : bool
        Whether the prior is a normal distribution of the logarithm of the number.
    """
    title, record = TABLES[owner], owners(model)[owner]
    table: Mapping[str, Any] = getattr(log.metadata, title)
    # A declared SD is absolute; a prior of the logarithm needs it relative to the value.
    sd_by_name = declared_sds(table, type(record), f"{log.file}: [{title}]")
    declaration = declared_in(title, name, table, sd_by_name)
    rover, source = log.load_rover(), ""
    if owner == "motor":
        if isinstance(rover.motor, MotorSheet):
            declaration = declaration or "declared in the rover's TOML, its SD assumed"
        source = "; ".join(own_motor(rover).assumed)
    elif owner == "soil" and not has_papers_wheel(rover):
        source = "; ".join(own_soil(rover).assumed)
    size = sd_by_name.get(name, sd if declaration else undeclared)
    relative = abs(float(getattr(record, name))) if log_scale else 1.0
    return parameter(model, f"{owner}.{name}", size / relative, log_scale, declared=declaration, source=source)


def parameter(
    model: Model, name: str, sd: float, log: bool = False, *, declared: str = "", source: str = ""
) -> Parameter:
    """Return one number of a model as a parameter for a fit, whose prior mean is the present value of the number.

    Parameters
    ----------
    name : str
        Name of the number, such as "soil.phi" or "WeakMotor[2].g".
    sd : float
        Prior SD in SI. If `log` is True, it is the SD of the logarithm, which is the relative SD.
    declared : str
        Text on where the user declares the number. If the text is empty, the number is assumed.
    source : str
        Source of an assumed value; by default the source of the quantity.
    """
    return parameter_of(name, find(owners(model), name)[0], sd, log, declared, source)


def owner_name(effect: Any) -> str:
    """Return the part of an effect in the names of its numbers: its class, with its wheel or channel in brackets.

    Examples: "MotionResistance", "WeakMotor[2]", "SensorBias[body_pitch]".
    """
    # An empty name means all wheels or channels, which needs no brackets.
    place = next((getattr(effect, owner) for owner in OWNERS if hasattr(effect, owner)), None)
    return type(effect).__name__ + ("" if place in (None, "") else f"[{place}]")


def owners(model: Model) -> dict[str, Any]:
    """Return a mapping from names to the parts of a model that have numbers: "soil", "motor", and each effect under its
    `owner_name`.
    """
    return {
        "soil": model.soils[0],
        "motor": model.motor,
        **{owner_name(effect): effect for effect in model.all_effects},
    }


def with_record(model: Model, owner: str, record: Any) -> Model:
    """Return the model with another soil, motor or effect: `record` replaces the part named `owner`."""
    if owner == "soil":
        return model.replace(soils=(record, *model.soils[1:]))
    return model.replace(motor=record) if owner == "motor" else model.having(record)


def with_wheels(text: str, wheels: Sequence[str], form: str) -> str:
    """Return a text with the name of the wheel added to each numbered effect, such as WeakMotor[2].

    Names of numbers, such as WeakMotor[2].g, are not changed.

    Parameters
    ----------
    wheels : sequence of str
        Names of the rover's wheels.
    form : str
        Format of the replacement, with the fields {name}, {number} and {wheel}.
    """

    def name_wheel(match: re.Match[str]) -> str:
        return form.format(name=match[1], number=match[2], wheel=wheels[int(match[2])])

    return re.sub(r"(\w+)\[(\d+)\](?!\.)", name_wheel, text)
