"""Published numbers with their sources, and `SOILS`: the parameter sets by name."""

from rover_pin.base.errors import ParameterError, closest
from rover_pin.contact import Soil
from rover_pin.parameters.simulants import FJS_1, HIT_LSS1, LUNAR_NOMINAL, MARSSIM_SAND
from rover_pin.parameters.slope_sand import SlopeSand
from rover_pin.parameters.wong import DRY_SAND
from rover_pin.parameters.yoshida import LITERATURE_SAND, NEXUS6_WHEEL, TABLE_1

__all__ = ["NEXUS6_WHEEL", "SLOPE_SAND", "SOILS", "TABLE_1", "name_of", "soil_named"]

SLOPE_SAND = SlopeSand()
"""Sand on which small rovers slip about 0.2 on 10 deg, as measured wheels do."""


class Named(dict[str, Soil]):
    """Parameter sets by name."""

    def __missing__(self, name: object) -> Soil:
        """Refuse a name that is none, with the close ones."""
        raise ParameterError(f"no soil is named {name!r}: {closest(name, self)}")


SOILS = Named(
    {
        "table-1": TABLE_1,
        "slope-sand": SLOPE_SAND,
        "literature-sand": LITERATURE_SAND,
        "dry-sand": DRY_SAND,
        "fjs-1": FJS_1,
        "hit-lss1": HIT_LSS1,
        "lunar-nominal": LUNAR_NOMINAL,
        "mars-sand": MARSSIM_SAND,
    }
)
"""Parameter sets by name; what depends on the wheel's width holds for `NEXUS6_WHEEL` (see `bekker.at_width`)."""


def name_of(soil: Soil) -> str:
    """Return the name of the set that a soil changes numbers of."""
    return next((name for name, preset in SOILS.items() if type(preset) is type(soil)), "table-1")


def soil_named(name: str) -> Soil:
    """Return the parameter set of this name.

    Raises ParameterError: an unknown name; the message lists the close ones.
    """
    return SOILS[name]
