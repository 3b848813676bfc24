"""Published soil parameters with their sources, which are found by name in `SOILS`, and the gravity of three bodies."""

from rover_pin.base.errors import ParameterError, closest
from rover_pin.contact import Soil
from rover_pin.parameters.soils import (
    DRY_SAND,
    FJS_1,
    HIT_LSS1,
    LITERATURE_SAND,
    LUNAR_NOMINAL,
    MARSSIM_SAND,
    NEXUS6_WHEEL,
    TABLE_1,
    SlopeSand,
)

__all__ = ["NEXUS6_WHEEL", "SLOPE_SAND", "SOILS", "TABLE_1", "name_of", "soil_named"]

SLOPE_SAND = SlopeSand()
"""Default sand of simulated drives. On this sand, small rovers slip by about 0.2 on a slope of 10 deg, like measured
wheels on dry sand."""


class SoilTable(dict[str, Soil]):
    """A dict of soil parameters by name, whose error about an unknown name lists the most similar names."""

    def __missing__(self, name: object) -> Soil:
        """Raise a ParameterError for an unknown name. The message lists the most similar names."""
        raise ParameterError(f"no soil is named {name!r}: {closest(name, self)}")


SOILS = SoilTable(
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
"""Name of a soil -> its parameters. Parameters that depend on the width of the wheel hold for the wheel of the rover
Nexus 6 (`NEXUS6_WHEEL`); `bekker.at_width` converts them to another width."""


def name_of(soil: Soil) -> str:
    """Return the name in `SOILS` of the published soil that a soil was derived from; "table-1" if `SOILS` has no such
    soil.

    The class of the soil decides, because a soil with changed parameters keeps the class of the published soil.
    """
    return next((name for name, preset in SOILS.items() if type(preset) is type(soil)), "table-1")


def soil_named(name: str) -> Soil:
    """Return the parameters of the soil with this name in `SOILS`.

    Raises ParameterError if the name is unknown; the message lists the most similar names.

    Examples
    --------
    >>> soil_named("literature-sand").k
    0.025
    """
    return SOILS[name]
