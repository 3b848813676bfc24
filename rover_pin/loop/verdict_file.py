"""A verdict on disk for machines: verdict.json, which lists every file that was written with it."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rover_pin.base.files.whole_file import replace_file
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.inference.weighed_anew import drawn_models
from rover_pin.loop.provenance import LoopRequest

DRAFT = Path("draft_effect") / "measured_remainder.py"
POSTERIOR, DRAWN = "posterior", 8
"""Folder of the models that are drawn from what is believed, and how many."""


def draft_written(verdict: Verdict, request: LoopRequest, out: Path) -> tuple[Verdict, list[Path]]:
    """Write the draft of what is on no list, if any; return the verdict with the command that tries it again."""
    if verdict.draft is None:
        return verdict, []
    file = out / DRAFT
    draft = dataclasses.replace(verdict.draft, command=request.again_with(file))
    return dataclasses.replace(verdict, draft=draft), [replace_file(file, draft.text)]


def posterior_written(verdict: Verdict, write: Callable[[Any, Path, str], Path], out: Path, seed: int) -> list[Path]:
    """Write models drawn from what is believed, by `write(model, file, note)`; return their folder, if any."""
    if verdict.beliefs is None:
        return []
    folder = out / POSTERIOR
    folder.mkdir(parents=True, exist_ok=True)
    note = f"One of {DRAWN} models of equal weight, drawn from what the data leave open."
    for number, model in enumerate(drawn_models(verdict.beliefs, DRAWN, seed), 1):
        write(model, folder / f"{number:02d}.toml", note)
    return [folder]


def written_last(verdict: Verdict, files: Sequence[Path], out: Path) -> Verdict:
    """Write verdict.json beside the other files and return the verdict with the paths of all."""
    verdict = dataclasses.replace(verdict, files=(*files, out / "verdict.json"))
    replace_file(verdict.files[-1], json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict
