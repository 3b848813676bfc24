"""Gains of the slip control, and with a hole law its numbers, as a file."""

from pathlib import Path
from typing import Any

from rover_pin.base.files.columns import replace_file
from rover_pin.base.files.toml_file import read_toml, table_in, toml_text
from rover_pin.base.quantity import record_from
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains

HOLE = "hole"
"""The table of a hole law's numbers; its r is that of the rover that is driven."""


def save_gains(gains: Gains, path: str | Path, comment: str = "", hole: HoleLaw | None = None) -> Path:
    """Write gains as a TOML file, one `name = value` a line; `comment` comes first, as comment lines."""
    table: dict[str, Any] = {name: float(value) for name, value in gains.values().items()}
    if hole:
        table |= {HOLE: {name: float(value) for name, value in hole.values().items() if name != "r"}}
    return replace_file(path, "".join(f"# {line}\n" for line in comment.splitlines()) + toml_text(table))


def load_gains(path: str | Path) -> Gains:
    """Return the gains of a TOML file; those that it does not name keep their defaults.

    Raises DataError: a file that is missing or not TOML.
    Raises ParameterError: an unknown gain, with the close ones, or a value out of its bounds.
    """
    table = read_toml(path)
    return record_from(Gains, {name: value for name, value in table.items() if name != HOLE}, str(path))


def load_hole(path: str | Path, r: float) -> HoleLaw | None:
    """Return the hole law of a file of gains for wheels of radius r [m]; None where S_d is constant.

    Raises DataError, ParameterError: as `load_gains`.
    """
    table = read_toml(path)
    if HOLE not in table:
        return None
    return record_from(HoleLaw, table_in(table, HOLE, str(path)), f"{path}: [{HOLE}]").replace(r=r)
