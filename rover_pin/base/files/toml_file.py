"""A reader of TOML files that reports the line of a mistake, and a writer of tables of plain values."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.encode import toml_string
from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MIB, text

MAX_TOML = 2 * MIB
"""Maximum size of a TOML file [bytes]. A larger file is refused, because the parser takes about 2 s and 70 MiB of
memory for each MiB of text."""
MAX_KEY_PARTS = 16
"""Maximum number of names in a dotted key such as `soil.k.value`. A longer key is refused, because the parser's memory
and time grow with the square of this number: a key of 20,000 names takes 2 GiB. The longest keys of this package have
four names."""
TEXTS_AND_COMMENTS = re.compile(
    r'''"""(?:[^"\\]|\\.|"(?!""))*+"""|'{3}(?:[^']|'(?!''))*+'{3}|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|#[^\n]*+''', re.DOTALL
)
"""Pattern of texts in quotes and of comments in a TOML file. A dot in these parts does not join the names of a key."""
DEEP_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{MAX_KEY_PARTS}}}")
"""Pattern of a dotted key with more than MAX_KEY_PARTS names."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file as a dict. Every TOML file of a user is read by this function.

    Raises DataError: the file is missing, larger than `MAX_TOML`, nested too deeply, or not TOML; the message states
    the line of the mistake.
    """
    try:
        content = text(path, MAX_TOML)
        # The parser builds every prefix of a dotted key, so the depth of keys is checked before it sees them. Texts
        # keep their newlines, so that the line of a key is right.
        bare = TEXTS_AND_COMMENTS.sub(lambda quoted: "x" + "\n" * quoted[0].count("\n"), content)
        if deep_key := DEEP_KEY.search(bare):
            line = 1 + bare.count("\n", 0, deep_key.start())
            raise DataError(
                f"{path}, line {line}: the key '{deep_key[0][:40]}...' has more than {MAX_KEY_PARTS} names joined by "
                "dots, but no key of this program has more than four names. Shorten the key."
            )
        return tomllib.loads(content)
    except RecursionError as error:
        raise DataError(
            f"{path}: lists or tables in this file are nested too deeply to be read; use fewer levels."
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise DataError(f"{path}: the file cannot be read: {reason}.") from error
    except ValueError as error:  # the text is not TOML, or has a whole number of thousands of digits
        raise DataError(f"{path}: the file is not TOML: {error}.") from error


def table_in(table: Mapping[str, Any], key: str, where: object) -> dict[str, Any]:
    """Return the inner table of a TOML table that has this key; an empty dict if the key is missing.

    Raises DataError: the value of the key is not a table. `where` is the beginning of the message.
    """
    inner = table.get(key, {})
    if not isinstance(inner, dict):
        raise DataError(f"{where}: {key} = {inner!r} must be a table, written as [{key}].")
    return inner


def tables_in(table: Mapping[str, Any], key: str, where: object) -> list[dict[str, Any]]:
    """Return the list of tables that a TOML table has under this key; an empty list if the key is missing.

    Raises DataError: the value of the key is not a list of tables. `where` is the beginning of the message.
    """
    inner = table.get(key, [])
    if not isinstance(inner, list) or not all(isinstance(entry, dict) for entry in inner):
        raise DataError(f"{where}: {key} = {inner!r} must be a list of tables, written as [[{key}]].")
    return inner


def text_in(table: Mapping[str, Any], key: str, where: object, default: str = "") -> str:
    """Return the text that a TOML table has under this key; `default` if the key is missing.

    Raises DataError: the value of the key is not a text. `where` is the beginning of the message.
    """
    text = table.get(key, default)
    if not isinstance(text, str):
        raise DataError(f"{where}: {key} = {text!r} must be a text in quotes, written as {key} = '...'.")
    return text


def toml_text(table: Mapping[str, Any]) -> str:
    """Return a dict as the text of a TOML file: plain values first, then `[tables]` and `[[lists of tables]]`.

    Entries whose value is None are omitted.

    Raises DataError: TOML has no form for a value in the dict.
    """
    plain, sections = [], []
    # In TOML, every line after a [table] belongs to this table, so the plain values are written before all tables.
    for name, value in table.items():
        if isinstance(value, Mapping):
            sections.append(f"\n[{toml_key(name)}]\n{_pairs(value)}")
        elif isinstance(value, Sequence) and value and all(isinstance(entry, Mapping) for entry in value):
            sections += [f"\n[[{toml_key(name)}]]\n{_pairs(entry)}" for entry in value]
        elif value is not None:
            plain.append(f"{toml_key(name)} = {toml_value(name, value)}\n")
    return "".join(plain + sections)


def toml_key(name: str) -> str:
    """Return a name as a key of TOML. A name with a character other than letters, digits, "_" and "-" is put into
    quotes.
    """
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_string(name)


def _pairs(table: Mapping[str, Any]) -> str:
    """Return the entries of a dict as lines `key = value` of TOML; entries whose value is None are omitted."""
    return "".join(
        f"{toml_key(name)} = {toml_value(name, value)}\n" for name, value in table.items() if value is not None
    )


def toml_value(name: str, value: Any) -> str:
    """Return a value as TOML text on one line. NumPy numbers and arrays are written as plain numbers and lists.

    Raises DataError: TOML has no form for the value; the message calls the value `name`.
    """
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    # True and False are also of type int in Python, so they are tested before the numbers.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return toml_string(value)
    # A table inside a table is written in braces, because a heading in brackets would end the outer table.
    if isinstance(value, Mapping):
        inner = (f"{toml_key(key)} = {toml_value(key, entry)}" for key, entry in value.items() if entry is not None)
        return "{" + ", ".join(inner) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(name, entry) for entry in value) + "]"
    raise DataError(
        f"'{name}' = {value!r} cannot be written to TOML: use text, numbers, true or false, lists or tables."
    )
