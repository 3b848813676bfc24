"""A verdict on disk for machines: verdict.json, which lists every file that was written with it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

from rover_pin.columns import replace_file
from rover_pin.discrepancy.verdict import Verdict


def written_last(verdict: Verdict, files: Sequence[Path], out: Path) -> Verdict:
    """Write verdict.json beside the other files and return the verdict with the paths of all."""
    verdict = dataclasses.replace(verdict, files=(*files, out / "verdict.json"))
    replace_file(verdict.files[-1], json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict
