"""Which law pushes back on wheels that are turned, crabbed or driven across a slope.

A wheel-rig set with slip angles starts from the same law (`experiments.wheel_rig.model.ASKEW`), its flank found there.
"""

from rover_pin.base.settings import Settings
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.side_shear import SideShear
from rover_pin.simulation.model.effect_files import reading_traction
from rover_pin.simulation.model.model import Model

SIDES = ("combined", "shear")
SOURCE = (
    "combined: studies/wheel_laws.py, the usual one where wheels go sideways; shear: SideShear; neither is the paper's"
)
TURNS = ("turn", "point-turn", "crab", "cmd-vel", "rates", "route")
"""Controllers that steer, or drive the sides at speeds of their own."""
SIDE_FORCE_NOTE = (
    "side force: thrust and side force share the soil's strength (CombinedShear), and the soil beside a sunk wheel "
    "resists as beside measured wheels (FlankPressure); side = shear has SideShear instead"
)


def combine_shear(model: Model) -> Model:
    """Return the model with one shear for thrust and side force, and pressure on the flank, in place of `SideShear`."""
    shear = reading_traction(CombinedShear(), model.effects)
    return model.without(SideShear).having(shear).having(FlankPressure())


def on_its_side(model: Model, request: Settings, askew: bool, of_file: bool) -> tuple[Model, tuple[str, ...]]:
    """Return the model with the side force that is asked for, or usual, and what is to be said of it.

    `askew`: the scene sends wheels sideways. A model that is read keeps its own where nothing is asked.
    """
    default = "combined" if askew or request.values.get("control") in TURNS else "shear"
    word = request.word("side", default, SIDES, SOURCE)
    if (word or ("shear" if of_file else default)) == "shear":
        return model, ()
    return combine_shear(model), () if word else (SIDE_FORCE_NOTE,)
