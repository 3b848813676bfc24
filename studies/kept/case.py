"""Stored cases of a blind test in plain JSON files, so that an interrupted run continues without pickle."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from blind_score import Case, Kind, Size

from rover_pin.base.files.whole_file import replace_file
from rover_pin.discrepancy.answer import Answer


def kept(file: Path, make: Callable[[], Case]) -> Case:
    """Return the case in a file. If the file does not exist, make the case and write it."""
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, text_of(make()).encode())
    return case_of(file.read_text(encoding="utf-8"))


def text_of(case: Case) -> str:
    """Return a case as JSON. Numbers that are not finite are written as Python writes them."""
    return json.dumps(asdict(case) | {"kind": case.kind.value, "answer": case.answer.value})


def case_of(text: str) -> Case:
    """Return the case that `text_of` wrote."""
    fields = json.loads(text)
    fields |= {"kind": Kind(fields["kind"]), "answer": Answer(fields["answer"]), "truth": tuple(fields["truth"])}
    return Case(
        **fields | {"alike": tuple(map(tuple, fields["alike"])), "sizes": tuple(Size(**s) for s in fields["sizes"])}
    )
