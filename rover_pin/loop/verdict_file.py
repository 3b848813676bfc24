"""A verdict on disk for machines: verdict.json, which lists every file that was written with it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

from rover_pin.base.files.columns import replace_file
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.loop.provenance import LoopRequest

DRAFT = Path("draft_effect") / "measured_remainder.py"


def draft_written(verdict: Verdict, request: LoopRequest, out: Path) -> tuple[Verdict, list[Path]]:
    """Write the draft of what is on no list, if any; return the verdict with the command that tries it again."""
    if verdict.draft is None:
        return verdict, []
    file = out / DRAFT
    draft = dataclasses.replace(verdict.draft, command=request.again_with(file))
    return dataclasses.replace(verdict, draft=draft), [replace_file(file, draft.text)]


def written_last(verdict: Verdict, files: Sequence[Path], out: Path) -> Verdict:
    """Write verdict.json beside the other files and return the verdict with the paths of all."""
    verdict = dataclasses.replace(verdict, files=(*files, out / "verdict.json"))
    replace_file(verdict.files[-1], json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict
