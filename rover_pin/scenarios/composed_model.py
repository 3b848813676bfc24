"""The model of a ready-made drive from its settings: a rover on a soil, or what a model file says."""

import functools
from pathlib import Path
from typing import NamedTuple

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.public import SHORT
from rover_pin.base.quantity import parse_quantity
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.parameters import SOILS
from rover_pin.parameters.hard import HARD_GROUND
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.simulation.model.cruise import CRUISE_SLIP
from rover_pin.simulation.model.defaults import Chosen, driven_soil, own_motor, usual_angles, usual_slip
from rover_pin.simulation.model.model import Model, base_effects, cruising
from rover_pin.simulation.model.motors import MOTORS, motor_named
from rover_pin.simulation.model.toml_file import is_rig_model, read_model
from rover_pin.soil.angles import ANGLES
from rover_pin.soil.wheel_forces import FORMS
from rover_pin.terrain import shapes

ROVERS = "rover-pin list rovers, or the path of your own TOML"
CONTACT = "fixed: Table 1; sinkage: those of the depth"
MOTOR = "assumed: the paper names no motor"


class Made(NamedTuple):
    """A model, what was assumed for its rover, and whether a file declares its resistance."""

    model: Model
    assumed: tuple[str, ...]
    resists: bool = False


def compose_model(request: Settings, trust: Trust) -> Made:
    """Return the model, on flat ground, of the settings `rover`, `soil`, `form`, `angles`, `slip`, `motor` or `model`.

    Raises RoverPinError: a setting or a file that is not understood.
    """
    file = request.take("model", None, source="a model file, as close-loop writes it")
    if file is None:
        return _of_settings(request, trust)
    if not isinstance(file, (str, Path)):
        raise ParameterError(
            f"model = {SHORT.repr(file)} is not allowed: give the path of a model file; what is in memory is driven by "
            "simulate(model, controller, duration)."
        )
    return (_of_rig if is_rig_model(str(file)) else _of_file)(str(file), request, trust)


def _of_file(file: str, request: Settings, trust: Trust) -> Made:
    model = read_model(file, shapes.flat(), trust)
    _refuse(("rover", "soil", "form", "angles", "slip", "motor"), request, file)
    return Made(model, (), resists=True)


def _of_rig(file: str, request: Settings, trust: Trust) -> Made:
    """Return a rover on the soil, with the traction law and the effects, of a wheel's model; its wheels are its own."""
    _refuse(("soil", "form", "angles"), request, file)
    rig, rover = read_rig_model(file, trust), load_rover(request.take("rover", "nexus6", source=ROVERS), trust)
    tractions = [effect for effect in rig.effects if isinstance(effect, SoilTraction)]
    if len(tractions) != 1:
        raise DataError(f"{file}: a wheel's model that a rover is to drive on must have one [[effect]] SoilTraction.")
    composition = _on_soil(request, rover, rig.soil, tractions[0])
    resists = any(isinstance(effect, MotionResistance) for effect in rig.effects)
    return composition._replace(model=functools.reduce(Model.having, rig.effects, composition.model), resists=resists)


def _refuse(names: tuple[str, ...], request: Settings, file: str) -> None:
    for name in names:
        if request.take(name, None) is not None:
            raise ParameterError(f"the model file {file} sets {name}: change it there, or leave out one of both.")


def _of_settings(request: Settings, trust: Trust) -> Made:
    rover = load_rover(request.take("rover", "nexus6", source=ROVERS), trust)
    named = request.word("soil", str(rover.soil.get("name", "of its weight")), SOILS, "rover-pin list soils")
    soil = driven_soil(rover, named)
    form = request.choice("form", "torque", FORMS, "which reading of the paper's traction is driven")
    default_angles = usual_angles(rover)
    word = request.word(
        "angles", next(name for name, form_angles in ANGLES.items() if form_angles == default_angles), ANGLES, CONTACT
    )
    angles = ANGLES.get(word, default_angles)
    composition = _on_soil(request, rover, soil.value, SoilTraction(form, angles))
    return composition._replace(assumed=(*soil.assumed, *composition.assumed))


def _on_soil(request: Settings, rover: Rover, soil: Soil, traction: SoilTraction) -> Made:
    """Return the rover with its motors and springs on a soil, with what every ready-made drive has besides."""
    word = request.word(
        "motor", rover.motor if isinstance(rover.motor, str) else "of its TOML or weight", MOTORS, MOTOR
    )
    motor = Chosen(motor_named(word)) if word else own_motor(rover)
    effects = base_effects(soil, rover, traction)
    grounds = (soil, HARD_GROUND)
    slip = _slip(request, rover)
    model = Model(rover, shapes.flat(), grounds, motor.value, slip, effects, body_effects=rover.springs)
    return Made(model, motor.assumed)


def _slip(request: Settings, rover: Rover) -> AlgebraicSlip | RelaxedSlip:
    chosen: AlgebraicSlip | RelaxedSlip = request.choice(
        "slip", "relaxed", {"relaxed": usual_slip(rover), "algebraic": AlgebraicSlip()}, "algebraic: Eq 1 at once"
    )
    return chosen


def as_it_cruises(model: Model, request: Settings, resists: bool) -> tuple[Model, tuple[str, ...]]:
    """Return the model with the resistance of its soil, wheels and load as driven, unless R is declared; what it is."""
    slip = request.take(
        "cruise_slip", None, source="slip on the flat [-], which gives R where it is not declared: 0.05"
    )
    declared_R = "effect.MotionResistance.R" in request.values
    if slip is not None and declared_R:
        raise ParameterError("cruise_slip and effect.MotionResistance.R both set R: give one of them.")
    if slip is None and (
        resists or declared_R or not any(isinstance(effect, MotionResistance) for effect in model.effects)
    ):
        return model, ()
    if slip is not None:
        return cruising(model, parse_quantity(slip, "", "cruise_slip")), ()
    model = cruising(model)
    R = float(model.effect(MotionResistance).R)
    return model, (
        f"motion resistance: R = {R:.2g} of the load, with which level ground is driven at S = {CRUISE_SLIP}",
    )
