"""Published soil parameters with their sources, which are found by name in `SOILS`, and the gravity of three bodies."""

from collections.abc import Iterator, Mapping

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.installed_packages import SOILS as OFFERED_SOILS
from rover_pin.base.installed_packages import Offer, offers
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
"""Default sand of simulated drives. On this sand, small rovers have a slip of about 0.2 on a slope of 10 deg. Wheels
that were measured on dry sand have about this slip too."""


class SoilTable(Mapping[str, Soil]):
    """A mapping from names to soils: the soils of the package, then the soils that other installed packages offer.

    An error about an unknown name lists the most similar names. Other packages are searched only if the package itself
    does not have a requested name, or if all names are listed, because the search takes time.
    """

    def __init__(self, own: Mapping[str, Soil]):
        self.own = dict(own)

    def offered(self) -> dict[str, Offer]:
        """Return the offers of other installed packages (soil name -> offer), without importing the soils."""
        return offers(OFFERED_SOILS, tuple(self.own))

    def __getitem__(self, name: str) -> Soil:
        """Return the soil with this name.

        Raises ParameterError for an unknown name; the message lists the most similar names. Raises DataError if the
        code of the package that offers the soil cannot be imported or defines no soil.
        """
        if name in self.own:
            return self.own[name]
        if name not in (offered := self.offered()):
            raise ParameterError(f"no soil is named {name!r}: {closest(name, self)}")
        soil: Soil = offered[name].load((Soil,))()
        return soil

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self.offered()

    def __iter__(self) -> Iterator[str]:
        yield from self.own
        yield from self.offered()

    def __len__(self) -> int:
        return len(self.own) + len(self.offered())


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
"""Name of a soil -> its parameters, also of soils that other installed packages offer. Parameters that
depend on the width of the wheel hold for the wheel of the rover Nexus 6 (`NEXUS6_WHEEL`); `bekker.at_width` converts
them to another width."""


def name_of(soil: Soil) -> str:
    """Return the name of the published soil from which a soil was derived; "table-1" if `SOILS` has no such soil.

    The soils are compared by their class, because a soil with changed parameters keeps the class of the published soil.
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
