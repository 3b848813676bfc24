"""Gains of the slip control as a file."""

from __future__ import annotations

from pathlib import Path

from rover_pin.base.files.columns import replace_file
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.base.quantity import record_from
from rover_pin.control.slip_control import Gains


def save_gains(gains: Gains, path: str | Path, comment: str = "") -> Path:
    """Write gains as a TOML file, one `name = value` a line; `comment` comes first, as comment lines."""
    text = toml_text({name: float(value) for name, value in gains.values().items()})
    return replace_file(path, "".join(f"# {line}\n" for line in comment.splitlines()) + text)


def load_gains(path: str | Path) -> Gains:
    """Return the gains of a TOML file; those that it does not name keep their defaults.

    Raises
    ------
    DataError
        A file that is missing or not TOML.
    ParameterError
        An unknown gain, with the close ones, or a value out of its bounds.
    """
    return record_from(Gains, read_toml(path), str(path))
