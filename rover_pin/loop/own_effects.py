"""Check the effects of a user and of other installed packages before any fit, so that a mistake is reported at once and
not after the fits.
"""

import inspect
from collections.abc import Mapping
from pathlib import Path

from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.quantity import quantities
from rover_pin.base.users_code import is_stop, mistake
from rover_pin.contact import Soil
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.compiled.laws import contact_law, motor_law
from rover_pin.simulation.model.effect_files import AnyEffect, offered_effects, reading_traction, user_effects
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.shapes import flat


def refuse_unfit_effects(path: str | Path) -> None:
    """Check that the search for missing effects can add and remove each effect in a user's file or folder.

    An effect must declare its neutral values, at which it vanishes, and its formulas must be computable.

    Raises DataError if a file cannot be run or an effect in it cannot be used; the message names the file, the line and
    the effect.
    """
    _refuse_unfit({kind: str(path) for kind in user_effects(path)})


def refuse_unfit_offered_effects() -> None:
    """Check that the search for missing effects can add and remove each effect that another installed package offers.

    Raises DataError if such an effect cannot be imported or used; the message names the package.
    """
    if offered := offered_effects():
        _refuse_unfit({kind: f"installed package {offer.source}" for kind, offer in offered.items()})


def _refuse_unfit(kinds: Mapping[type[AnyEffect], str]) -> None:
    """Check that the search for missing effects can use each effect in `kinds`: class -> words for the origin of the
    class.
    """
    rover = load_rover("nexus6")
    # The model of a common rover is enough to compute the formulas of an effect once.
    effects = base_effects(Soil(), rover, SoilTraction())
    model = Model(rover, flat(), (Soil(),), Motor(), effects=effects)
    for kind, place in kinds.items():
        if not kind.neutral:
            raise DataError(
                f"{place}: {kind.__name__} does not declare the values at which the effect vanishes, so the loop "
                'cannot add it. Add the line neutral: ClassVar[dict[str, float]] = {"a": 0.0} to the class, with the '
                "quantity that sets the effect's size in place of a."
            )
        # A misspelt name would leave the effect's real size at its default when the loop removes the effect.
        strange = [name for name in kind.neutral if name not in quantities(kind)]
        if strange:
            names = ", ".join(quantities(kind))
            has = f"it has {names}." if names else "it has none. Is @dataclass(frozen=True) above the class?"
            raise DataError(
                f"{place}: {kind.__name__} has a neutral value for '{strange[0]}', but the effect has no quantity of "
                f"this name: {has}"
            )
        try:
            # Build the effect, move it to its neutral values, and write its formulas out as the loop will.
            effect = reading_traction(kind(), model.effects)
            effect.replace(**effect.neutral)
            model_with_effect = model.having(effect)
            if isinstance(effect, Effect):
                contact_law(model_with_effect.contact_effects)
            elif isinstance(effect, MotorEffect):
                motor_law(model_with_effect.motor, model_with_effect.motor_effects)
        except BaseException as error:
            # An error of this package may not name the user's file; then the file and the line of the class are added.
            file, line = inspect.getfile(kind), inspect.getsourcelines(kind)[1]
            if isinstance(error, RoverPinError) and file not in str(error):
                raise DataError(f"{file}, line {line}: {error}") from error
            if is_stop(error):
                raise
            raise mistake(error, file, line) from error
