"""A user's effect files, looked at before any work: a mistake in one is reported at once, not after the fits."""

import inspect
from pathlib import Path

from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.quantity import quantities
from rover_pin.base.users_code import is_stop, mistake
from rover_pin.contact import Soil
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.compiled.laws import contact_law, motor_law
from rover_pin.simulation.model.effect_files import AnyEffect, reading_traction, user_effects
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat


def refuse_unfit_effects(path: str | Path) -> None:
    """Refuse an effect that cannot be added and taken away: without neutral values, or with formulas that do not run.

    Raises DataError: a file that cannot be run, or an effect in it that cannot be used; the sentence names both.
    """
    kinds, rover = user_effects(path), load_rover("nexus6")
    effects = base_effects(Soil(), rover, SoilTraction())
    model = Model(rover, flat(), (Soil(),), Motor(), effects=effects)
    for kind in kinds:
        where = f"{path}: {kind.__name__}"
        _refuse_no_neutral(kind, where)
        try:
            _try_effect(kind, model)
        except Exception as error:
            file, line = inspect.getfile(kind), inspect.getsourcelines(kind)[1]
            if isinstance(error, RoverPinError) and file not in str(error):
                raise DataError(f"{file}, line {line}: {error}") from error
            if is_stop(error):
                raise
            raise mistake(error, file, line) from error


def _refuse_no_neutral(kind: type[AnyEffect], where: str) -> None:
    if not kind.neutral:
        raise DataError(
            f"{where} does not say at which values it vanishes, so the loop cannot add it: give it "
            'neutral: ClassVar[dict[str, float]] = {"a": 0.0}, a being the name of its size.'
        )
    strange = [name for name in kind.neutral if name not in quantities(kind)]
    if strange:
        quantity_names = ", ".join(quantities(kind))
        has = (
            f"it has {quantity_names}."
            if quantity_names
            else "it has none. Is @dataclass(frozen=True) above the class?"
        )
        raise DataError(f"{where} has a neutral value for '{strange[0]}', which is no quantity of it: {has}")


def _try_effect(kind: type[AnyEffect], model: Model) -> None:
    """Make the effect, move it to its neutral values and write its formulas out."""
    effect = reading_traction(kind(), model.effects)
    effect.replace(**effect.neutral)
    with_it = model.having(effect)
    if isinstance(effect, Effect):
        contact_law(with_it.contact_effects)
    elif isinstance(effect, MotorEffect):
        motor_law(with_it.motor, with_it.motor_effects)
