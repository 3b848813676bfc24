"""What an imported drive log says: its drive.toml, every guess marked."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.logs.importing.recording import Guess


class Run(NamedTuple):
    """One run to write: its name, where it comes from, its rows of the recording's columns."""

    name: str
    purpose: str
    columns: Mapping[str, np.ndarray]


class Sheet(NamedTuple):
    """What drive.toml of an imported log says."""

    name: str
    source: str
    rover: str
    wheels: Sequence[str]
    guesses: Sequence[Guess]
    runs: Sequence[Run]
    notes: Sequence[str]
    estimated: bool
    "whether pitch or height tell the ground"
    base_sd: tuple[float, float]
    "of a point that lies anywhere on the base [m]: along and across"


def toml_of(sheet: Sheet) -> str:
    """Return the text of drive.toml."""
    parts = (_head(sheet), _terrain(sheet), _tracker(sheet), _further(), _columns(sheet.guesses), _runs(sheet.runs))
    return "\n".join(line for part in parts for line in part) + "\n"


def _head(sheet: Sheet) -> Iterator[str]:
    yield "# Written by `rover-pin import-log`. What is marked GUESSED was not stated by the recording: look at it."
    yield from (f"# {note}" for note in sheet.notes)
    yield ""
    yield 'kind = "drive-log"'
    yield f"name = {_text(sheet.name)}"
    yield f"source = {_text(sheet.source)}"
    yield f"rover = {_text(sheet.rover)}"
    yield "gravity = 9.81  # ASSUMED: Earth"
    yield f"wheels = [{', '.join(map(_text, sheet.wheels))}]"


def _terrain(sheet: Sheet) -> Iterator[str]:
    yield "\n[terrain]"
    if sheet.estimated:
        yield "estimated = true  # GUESSED: no ground is declared, so pitch, roll and height tell that under each run"
    else:
        yield 'slope = { value = 0.0, unit = "deg" }  # ASSUMED flat: neither pitch nor height is recorded'
    yield '# or: slope = { value = 12, unit = "deg" }, uphill along the heading at the start of a run,'
    yield '# in its [[run]]: terrain = { slope = { value = 5, unit = "deg" } }; or polyline = "ground.csv"'


def _tracker(sheet: Sheet) -> Iterator[str]:
    yield "\n[tracker]  # ASSUMED anywhere over the wheels' base: the point of which body_x and body_y are the place"
    for name, sd in zip("xy", sheet.base_sd, strict=True):
        yield f'{name} = {{ value = 0.0, unit = "m", sd = {sd:.3g} }}'


def _further() -> Iterator[str]:
    yield "\n# What is known of the soil, each with its sd; without it, sand made firm enough for the rover is assumed:"
    yield "# [soil]"
    yield '# phi = { value = 32.0, unit = "deg", sd = 2.0 }'


def _columns(guesses: Sequence[Guess]) -> Iterator[str]:
    yield "\n[columns]  # which column, or what formula of columns, each channel is; units other than SI are converted"
    for guess in guesses:
        if guess.entry == {"column": guess.target}:
            continue
        yield f"{_key(guess.target)} = {_inline(guess.entry)}" + (
            "" if guess.sure else f"  # GUESSED (P = {guess.share:.2f}): {guess.why}"
        )


def _runs(runs: Sequence[Run]) -> Iterator[str]:
    for run in runs:
        yield "\n[[run]]"
        yield f"file = {_text(run.name + '.csv')}"
        yield f"purpose = {_text(run.purpose)}"


def _inline(entry: Mapping[str, Any]) -> str:
    return "{ " + ", ".join(f"{key} = {_text(value)}" for key, value in entry.items()) + " }"


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else _text(name)


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def lines(guesses: Sequence[Guess]) -> Iterator[str]:
    """Yield one line a guess, for a reader."""
    for guess in guesses:
        source = guess.entry.get("column") or guess.entry.get("formula")
        unit = f" [{guess.entry['unit']}]" if "unit" in guess.entry else ""
        offset = f" {guess.entry['offset']:+.6g}" if "offset" in guess.entry else ""
        scale = {1.0: "", -1.0: "-"}.get(factor := guess.entry.get("scale", 1.0), f"{factor:.6g} * ")
        yield f"{guess.target} = {scale}{source}{offset}{unit}" + (
            "" if guess.sure else f"  GUESSED (P = {guess.share:.2f}): {guess.why}"
        )
