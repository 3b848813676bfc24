"""TOML files: read with the line of a mistake, and written from plain values."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import text


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the table of a TOML file.

    Raises DataError: the file is missing, or not TOML: with the line.
    """
    try:
        return tomllib.loads(text(path))
    except RecursionError as error:
        raise DataError(f"{path}: the file is not TOML that can be read: it is nested too deep.") from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise DataError(f"{path}: the file cannot be read: {reason}.") from error
    except ValueError as error:  # of the TOML itself, or of a whole number of thousands of digits
        raise DataError(f"{path}: the file is not TOML: {error}.") from error


def table_in(table: Mapping[str, Any], key: str, where: object) -> dict[str, Any]:
    """Return the table under a key, an empty one where there is none; anything else is a `DataError`."""
    inner = table.get(key, {})
    if not isinstance(inner, dict):
        raise DataError(f"{where}: {key} = {inner!r} must be a table, as [{key}].")
    return inner


def tables_in(table: Mapping[str, Any], key: str, where: object) -> list[dict[str, Any]]:
    """Return the list of tables under a key, an empty one where there is none; anything else is a `DataError`."""
    inner = table.get(key, [])
    if not isinstance(inner, list) or not all(isinstance(entry, dict) for entry in inner):
        raise DataError(f"{where}: {key} = {inner!r} must be a list of tables, as [[{key}]].")
    return inner


def text_in(table: Mapping[str, Any], key: str, where: object, default: str = "") -> str:
    """Return the text under a key, or the default; anything else is a `DataError`."""
    text = table.get(key, default)
    if not isinstance(text, str):
        raise DataError(f"{where}: {key} = {text!r} must be text, as {key} = '...'.")
    return text


def toml_text(table: Mapping[str, Any]) -> str:
    """Return the table as TOML: plain values first, then `[tables]` and `[[lists of tables]]`; None is left out.

    Raises DataError: a value that TOML cannot hold.
    """
    plain, sections = [], []
    for name, value in table.items():
        if isinstance(value, Mapping):
            sections.append(f"\n[{_key(name)}]\n{_pairs(value)}")
        elif isinstance(value, Sequence) and value and all(isinstance(entry, Mapping) for entry in value):
            sections += [f"\n[[{_key(name)}]]\n{_pairs(entry)}" for entry in value]
        elif value is not None:
            plain.append(f"{_key(name)} = {_value(name, value)}\n")
    return "".join(plain + sections)


def _pairs(table: Mapping[str, Any]) -> str:
    return "".join(f"{_key(name)} = {_value(name, value)}\n" for name, value in table.items() if value is not None)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name, str(name))


def _value(name: str, value: Any) -> str:
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        inner = (f"{_key(key)} = {_value(key, entry)}" for key, entry in value.items() if entry is not None)
        return "{" + ", ".join(inner) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(name, entry) for entry in value) + "]"
    raise DataError(
        f"'{name}' = {value!r} cannot be written to TOML: use text, numbers, true or false, lists or tables."
    )
