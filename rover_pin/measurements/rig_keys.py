"""The keys of a rig set's `rig.toml`: a name that nothing reads is refused, lest a default stand for it unsaid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rover_pin.contact import Soil, Wheel
from rover_pin.errors import DataError, closest
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.quantity import quantities
from rover_pin.toml_file import table_in

TEXTS = ("kind", "name", "source", "licence", "method", "missing", "note")
BEKKER_UNITS = {"k_c": "N/m^(n+1)", "k_phi": "N/m^(n+2)"}
CHANNELS = ("drawbar_pull", "torque", "sinkage", "lateral")
TABLES = {
    "files": ("points", "penetration", "transient"),
    "wheel": (*quantities(Wheel), "surface", "lug_height", "lug_count"),
    "soil": (*quantities(Soil), *BEKKER_UNITS, "bulk_density", "angle_of_repose"),
    "rig": tuple(quantities(RigErrors)),
    "noise": tuple(f"{name}{end}" for name in CHANNELS for end in ("", "_over_load")),
}
"""What each table may hold. Some keys tell a reader of the set only: surface, lugs, density, angle of repose."""
MEANT = {
    "friction_angle": "phi", "internal_friction": "phi", "cohesion": "c", "exponent": "n", "sinkage_exponent": "n",
    "shear_modulus": "k", "shear_displacement": "k", "kc": "k_c", "kphi": "k_phi", "radius": "r", "diameter": "r",
    "width": "b",
}  # fmt: skip
"""Names that others give to these constants."""


def refuse_unknown_keys(about: Mapping[str, Any], where: str) -> None:
    """Refuse a key of `rig.toml`, or of one of its tables, that nothing reads.

    Raises
    ------
    DataError
        An unknown key, with the one that may be meant, or what must be a table and is none.
    """
    _refuse(about, (*TEXTS, *TABLES), where, "a rig set")
    for name, known in TABLES.items():
        _refuse(table_in(about, name, where), (*known, "note"), where, f"[{name}]")


def _refuse(table: Mapping[str, Any], known: Iterable[str], where: str, owner: str) -> None:
    known = tuple(known)
    for key in table:
        if key not in known:
            meant = MEANT.get(key.lower(), "")
            hint = f"did you mean '{meant}'? " if meant in known else ""
            raise DataError(f"{where}: there is no key '{key}' in {owner}: {hint}{closest(key, known)}")
