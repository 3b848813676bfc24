"""A blind test's cases in files of plain JSON, so that a run that was stopped goes on: nothing is unpickled."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from blind_score import Case, Kind, Size

from rover_pin.base.files.whole_file import replace_file
from rover_pin.discrepancy.answer import Answer


def kept(file: Path, make: Callable[[], Case]) -> Case:
    """Return the case that a file holds; where there is none, make it and write it."""
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, text_of(make()).encode())
    return case_of(file.read_text(encoding="utf-8"))


def text_of(case: Case) -> str:
    """Return a case as JSON; numbers that are not finite as Python writes them."""
    return json.dumps(asdict(case) | {"kind": case.kind.value, "answer": case.answer.value})


def case_of(text: str) -> Case:
    """Return the case that `text_of` wrote."""
    told = json.loads(text)
    told |= {"kind": Kind(told["kind"]), "answer": Answer(told["answer"]), "truth": tuple(told["truth"])}
    return Case(**told | {"alike": tuple(map(tuple, told["alike"])), "sizes": tuple(Size(**s) for s in told["sizes"])})
