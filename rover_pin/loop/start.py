"""The model that a loop starts from, out of any model file: a wheel's goes to a drive log, a rover's back to a rig."""

import dataclasses
import functools
import logging
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.trust import Trust
from rover_pin.effects.effect import Effect
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model_file import read_model as read_rig_model
from rover_pin.logs.drive_log import DriveLog
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.toml_file import KIND, RIG_KIND, read_model
from rover_pin.terrain.shapes import flat

STEADY = (NormalDamping, SideShear)
"""What of a drive does nothing at a steady wheel that runs straight."""

log = logging.getLogger(__name__)


def start_on(data: RigSet | DriveLog, file: str | Path, trust: Trust = Trust()) -> RigModel | Model:
    """Return the model of a file as a loop on these data can start from it.

    On a drive log a wheel's model gives the soil, the traction law and the effects of the contact; rover, motors and
    ground are the log's. On a rig a rover's model gives the same three; the wheel is the rig's, and what acts elsewhere
    is left out, with a word.

    Raises
    ------
    DataError, ParameterError
        What is no model file, or cannot be read; a wheel's model without one SoilTraction.
    """
    kind = read_toml(Path(file)).get("kind")
    if isinstance(data, DriveLog):
        of_rig = kind == RIG_KIND
        return _driven(data, read_rig_model(file, trust), file) if of_rig else read_model(file, data.terrain(), trust)
    if kind == KIND:
        return _on_rig(data, read_model(file, flat(), trust), file)
    return read_rig_model(file, trust)


def _driven(drive: DriveLog, wheel: RigModel, file: str | Path) -> Model:
    tractions = [effect for effect in wheel.effects if isinstance(effect, SoilTraction)]
    if len(tractions) != 1:
        raise DataError(f"{file}: a wheel's model that a rover is to drive on must have one [[effect]] SoilTraction.")
    log_model = base_model(drive)
    effects = base_effects(wheel.soil, log_model.rover, tractions[0], log_model.gravity)
    model = dataclasses.replace(log_model, soils=(wheel.soil, *log_model.soils[1:]), effects=effects)
    return functools.reduce(Model.having, wheel.effects, model)


def _on_rig(data: RigSet, model: Model, file: str | Path) -> RigModel:
    acting = [effect for effect in model.all_effects if effect != model.slip and not isinstance(effect, STEADY)]
    contact = [effect for effect in acting if isinstance(effect, Effect)]
    wheel_effects = tuple(effect for effect in contact if not effect.before_slip and not effect.places)
    omitted = dict.fromkeys(type(effect).__name__ for effect in acting if effect not in wheel_effects)
    if omitted:
        log.warning("%s: %s cannot act at a wheel on a rig: left out.", file, ", ".join(omitted))
    return RigModel(data.rig.wheel, model.soils[0], wheel_effects)
