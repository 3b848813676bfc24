"""Effects, soils and experiments that other installed packages offer through entry points.

A package offers a class by a line of its `pyproject.toml`, for example under `[project.entry-points."rover_pin.soils"]`
the line `jsc-1a = "my_soils:Jsc1a"`. A user who installs a package consents to its code, so that no further consent is
asked. A package in the working directory is not found (`search_path.py`).

The names are read from the metadata of the installed packages, which takes some 30 ms. Therefore this module is called
only if rover_pin itself does not have a requested name, or if a complete list of names is needed.
"""

import sys
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from rover_pin.base.errors import DataError, RoverPinError
from rover_pin.base.users_code import guard, is_stop

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

EFFECTS, SOILS, EXPERIMENTS = "rover_pin.effects", "rover_pin.soils", "rover_pin.experiments"
"""Names of the entry-point groups in which a Python package announces its effects (EFFECTS), soils (SOILS) and
experiments (EXPERIMENTS)."""


class Offer(NamedTuple):
    """One class that an installed package offers: its name, the package with its version, and the entry point."""

    name: str
    package: str
    version: str
    entry: "EntryPoint"

    @property
    def source(self) -> str:
        """Return the package and its version, such as "moon-soils 1.2"."""
        return f"{self.package} {self.version}"

    def load(self, base: tuple[type, ...]) -> type[Any]:
        """Import the class and return it. Later exceptions in its methods are reported with their file and line.

        `base` are classes; the class must derive from one of them.

        Raises DataError: the code of the package cannot be imported, or the entry point names something else than a
        class that derives from `base`. The message names the package.
        """
        where = f"The installed package {self.source} offers '{self.name}' ({self.entry.value})"
        remedy = f"Correct the package, or remove it: pip uninstall {self.package}"
        try:
            kind = self.entry.load()
            if isinstance(kind, type):
                guard_once(sys.modules[kind.__module__])
        except BaseException as error:
            # Ctrl-C stops the program; an error of rover_pin while the package is imported is the package's mistake.
            if is_stop(error) and not isinstance(error, RoverPinError):
                raise
            reason = f"{type(error).__name__}: {error}".rstrip(": .")
            raise DataError(f"{where}, but its code cannot be imported ({reason}). {remedy}.") from error
        if not (isinstance(kind, type) and issubclass(kind, base) and kind not in base):
            names = " or ".join(one.__name__ for one in base)
            raise DataError(f"{where}, but this is not a class that derives from {names}. {remedy}.")
        return kind


@cache
def guard_once(module: ModuleType) -> None:
    """Wrap the methods of the classes in a module (`guard`), unless this was done before."""
    guard(module)


def offers(group: str, own: tuple[str, ...]) -> dict[str, Offer]:
    """Return name -> offer for everything that installed packages offer in a group of entry points, sorted by name.

    `own` are the names that rover_pin itself has in this group.

    Raises DataError: a name is one of `own`, or two packages offer one name. The message names the packages.
    """
    found: dict[str, Offer] = {}
    for offer in _offers_on(group, tuple(sys.path)):
        other = "rover_pin itself" if offer.name in own else found[offer.name].source if offer.name in found else ""
        if other:
            raise DataError(
                f"The installed package {offer.source} offers '{offer.name}' in {group}, but {other} has this name "
                f"already. Rename it in the package, or remove one of them: pip uninstall {offer.package}."
            )
        found[offer.name] = offer
    return found


@cache
def _offers_on(group: str, search_path: tuple[str, ...]) -> tuple[Offer, ...]:
    """Return the offers in a group of all packages on Python's search path for modules, sorted by name."""
    # This import takes some 20 ms, and most commands do not need it.
    from importlib.metadata import entry_points

    found = entry_points(group=group)
    offered = [Offer(entry.name, entry.dist.name, entry.dist.version, entry) for entry in found if entry.dist]
    return tuple(sorted(offered, key=lambda offer: offer[:3]))
