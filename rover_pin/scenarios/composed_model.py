"""Composes the model of a ready-made drive, from settings such as rover and soil, or from a model file."""

import functools
from pathlib import Path
from typing import NamedTuple

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.public import SHORT
from rover_pin.base.quantity import parse_quantity
from rover_pin.base.settings import Settings
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.parameters import SOILS
from rover_pin.parameters.soils import HARD_GROUND
from rover_pin.rover.rover import Rover, load_rover
from rover_pin.scenarios.controllers import TURNS
from rover_pin.simulation.model.cruise import CRUISE_SLIP
from rover_pin.simulation.model.defaults import DefaultChoice, driven_soil, own_motor, usual_angles, usual_slip
from rover_pin.simulation.model.effect_files import reading_traction
from rover_pin.simulation.model.model import Model, base_effects, cruising
from rover_pin.simulation.model.motor import MOTORS, motor_named
from rover_pin.simulation.model.toml_file import is_rig_model, read_model
from rover_pin.soil.angles import ANGLES
from rover_pin.soil.wheel_forces import FORMS
from rover_pin.terrain import shapes

# Sources of the settings, as `rover-pin list settings` shows them.
ROVERS = "rover-pin list rovers, or the path of your own TOML"
CONTACT = "fixed: the angles of Table 1; sinkage: angles that follow from the depth"
MOTOR = "assumed: the paper names no motor"
SIDE = "combined: studies/wheel_laws.py, usual where wheels go sideways; shear: SideShear; neither is in the paper"
CRUISE = "slip on level ground [-] from which R is derived if R is not given: 0.05"

SIDES = ("combined", "shear")
"""Words of the setting `side`, which chooses the law of the side force on a wheel."""
SIDE_FORCE_NOTE = (
    "side force: thrust and side force share the soil's strength (CombinedShear), and the soil presses on the flank of "
    "a sunk wheel as on measured wheels (FlankPressure); side = shear has SideShear instead"
)


class ComposedModel(NamedTuple):
    """A model that was composed for a drive, and the assumptions that were made for it."""

    model: Model
    assumed: tuple[str, ...]
    "one sentence for each assumption about the rover, its soil and its motor"
    resists: bool = False
    """whether the model file states the motion resistance R, so that R is not derived from soil and load"""


def compose_model(request: Settings, trust: Trust) -> ComposedModel:
    """Return the model of a drive on flat ground, composed from the settings or read from the model file that they
    name.

    Parameters
    ----------
    request : Settings
        The user's settings. The model is composed from `rover`, `soil`, `form`, `angles`, `slip` and `motor`, or read
        from the file `model`.
    trust : Trust
        The user's consent to run the code, and to read the files, that a model file names.

    Raises
    ------
    RoverPinError
        A setting is not allowed, or a file cannot be read.
    """
    file = request.take("model", None, source="a model file, as close-loop writes it")
    if file is None:
        rover = _rover(request, trust)
        # Without a soil in the settings, the soil of the rover's TOML is used, or one that suits its weight.
        soil_name = request.word("soil", str(rover.soil.get("name", "of its weight")), SOILS, "rover-pin list soils")
        soil = driven_soil(rover, soil_name)
        form = request.choice("form", "torque", FORMS, "form of the paper's traction that is simulated")
        # The default contact angles depend on the wheel; their word is only needed for the list of settings.
        default_angles = usual_angles(rover)
        default_word = next(word for word, angles in ANGLES.items() if angles == default_angles)
        angles_word = request.word("angles", default_word, ANGLES, CONTACT)
        traction = SoilTraction(form, ANGLES.get(angles_word, default_angles))
        composition = _on_soil(request, rover, soil.value, traction)
        return composition._replace(assumed=(*soil.assumed, *composition.assumed))
    if not isinstance(file, (str, Path)):
        raise ParameterError(
            f"model = {SHORT.repr(file)} is not allowed: give the path of a model file. To drive a model in memory, "
            "call simulate(model, controller, duration)."
        )
    if not is_rig_model(str(file)):
        model = read_model(file, shapes.flat(), trust)
        _refuse(("rover", "soil", "form", "angles", "slip", "motor"), request, str(file))
        return ComposedModel(model, (), resists=True)
    # The model of a wheel rig gives soil, traction law and effects; rover, wheel size and motor come from the settings.
    _refuse(("soil", "form", "angles"), request, str(file))
    rig, rover = read_rig_model(str(file), trust), _rover(request, trust)
    tractions = [effect for effect in rig.effects if isinstance(effect, SoilTraction)]
    if len(tractions) != 1:
        raise DataError(
            f"{file}: the model of a wheel has {len(tractions)} effects SoilTraction, but needs exactly one [[effect]] "
            "SoilTraction to drive a rover."
        )
    composition = _on_soil(request, rover, rig.soil, tractions[0])
    resists = any(isinstance(effect, MotionResistance) for effect in rig.effects)
    return composition._replace(model=functools.reduce(Model.having, rig.effects, composition.model), resists=resists)


def _rover(request: Settings, trust: Trust) -> Rover:
    """Return the rover that the setting `rover` states: a rover in memory, the name of a rover, or the path of a
    TOML.
    """
    rover = request.take("rover", "nexus6", source=ROVERS)
    return rover if isinstance(rover, Rover) else load_rover(rover, trust)


def _refuse(names: tuple[str, ...], request: Settings, file: str) -> None:
    """Check that the user gave none of the settings `names`, because the model file already states them.

    Raises ParameterError: the user gave one of these settings.
    """
    for name in names:
        if request.take(name, None) is not None:
            raise ParameterError(
                f"the model file {file} sets {name}: change {name} in this file, or leave the model file out."
            )


def _on_soil(request: Settings, rover: Rover, soil: Soil, traction: SoilTraction) -> ComposedModel:
    """Return the model of a rover on a soil, with its motors and springs, and with the effects of every ready-made
    drive.

    The settings `motor` and `slip` choose the motor and the law of slip. `traction` is the law of traction on the soil.
    """
    # The motor is a word of the settings, or the motor that the rover's TOML states or its weight implies.
    word = request.word(
        "motor", rover.motor if isinstance(rover.motor, str) else "of its TOML or weight", MOTORS, MOTOR
    )
    motor = DefaultChoice(motor_named(word)) if word else own_motor(rover)
    effects = base_effects(soil, rover, traction)
    grounds = (soil, HARD_GROUND)  # the terrain's soil indices 0 and 1
    slip: AlgebraicSlip | RelaxedSlip = request.choice(
        "slip", "relaxed", {"relaxed": usual_slip(rover), "algebraic": AlgebraicSlip()}, "algebraic: Eq 1 at once"
    )
    model = Model(rover, shapes.flat(), grounds, motor.value, slip, effects, body_effects=rover.springs)
    return ComposedModel(model, motor.assumed)


def on_its_side(model: Model, request: Settings, askew: bool, of_file: bool) -> tuple[Model, tuple[str, ...]]:
    """Return the model with the law of the side force that the setting `side` chooses, and a note if a default is used.

    The combined law is the default for wheels that turn, drive sideways or drive across a slope; then the note states
    this choice. A wheel rig with slip angles also starts from the combined law (`experiments.wheel_rig.model.ASKEW`)
    and estimates the pressure on the flank.

    Parameters
    ----------
    model : Model
        The model with the law of the paper's drives (SideShear), or with the law of its file.
    request : Settings
        The user's settings.
    askew : bool
        Whether the wheels slide sideways in this scene.
    of_file : bool
        Whether the model was read from a file. It then keeps the law of the file unless a setting names a law.
    """
    # Wheels that slide sideways need the law in which thrust and side force share the soil's strength.
    default = "combined" if askew or request.values.get("control") in TURNS else "shear"
    word = request.word("side", default, SIDES, SIDE)
    if (word or ("shear" if of_file else default)) == "shear":
        return model, ()
    # The combined law replaces SideShear: both together would count the side force twice.
    shear = reading_traction(CombinedShear(), model.effects)
    combined = model.without(SideShear).having(shear).having(FlankPressure())
    return combined, () if word else (SIDE_FORCE_NOTE,)


def as_it_cruises(model: Model, request: Settings, resists: bool) -> tuple[Model, tuple[str, ...]]:
    """Return the model with its motion resistance R, and a sentence for the user if R was derived.

    R is a fraction of the wheel load. It is derived from soil, wheels and load so that the rover drives on level ground
    with the usual slip (CRUISE_SLIP), or with the slip of the setting `cruise_slip`. If a setting or the model file
    (`resists`) states R, it stays unchanged.

    Raises ParameterError: both `cruise_slip` and R are given.
    """
    slip = request.take("cruise_slip", None, source=CRUISE)
    declared_R = "effect.MotionResistance.R" in request.values
    if slip is not None and declared_R:
        raise ParameterError(
            "cruise_slip and effect.MotionResistance.R both state the motion resistance R: give only one of them."
        )
    # A stated resistance is kept, and a model without the effect has no resistance to derive.
    if slip is None and (
        resists or declared_R or not any(isinstance(effect, MotionResistance) for effect in model.effects)
    ):
        return model, ()
    if slip is not None:
        return cruising(model, parse_quantity(slip, "", "cruise_slip")), ()
    model = cruising(model)
    R = float(model.effect(MotionResistance).R)
    return model, (
        f"motion resistance: R = {R:.2g} of the load, so that the slip on level ground is S = {CRUISE_SLIP}",
    )
