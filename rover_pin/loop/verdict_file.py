"""Write the files of a verdict: models, the drafted effect, the report, and verdict.json with the list of all files."""

import dataclasses
import json
from pathlib import Path

from rover_pin.base.files.whole_file import replace_file
from rover_pin.discrepancy.question import LoopData
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.inference.beliefs import drawn_models
from rover_pin.loop.provenance import LoopRequest
from rover_pin.report.labels import write_report

DRAFT = Path("draft_effect") / "measured_remainder.py"
POSTERIOR, POSTERIOR_MODELS = "posterior", 8
"""Name of the folder for models that are drawn from the posterior distribution, and the number of these models."""


def write_results(verdict: Verdict, data: LoopData, request: LoopRequest) -> Verdict:
    """Write all files of a verdict into the folder that the request names, and return the verdict with their paths."""
    out = Path(str(request.out))
    files = data.write_models(verdict.model, out, "model", verdict.sentence)
    # A joint fit has one model per set. Models drawn from its posterior would each be several files, which no command
    # reads, so that they are written for a single model only.
    if len(files) == 1 and (beliefs := verdict.deciding_beliefs) is not None:
        folder = out / POSTERIOR
        folder.mkdir(parents=True, exist_ok=True)
        note = f"One of {POSTERIOR_MODELS} models of equal weight, drawn from the posterior distribution."
        for number, model in enumerate(drawn_models(beliefs, POSTERIOR_MODELS, request.seed), 1):
            data.write_models(model, folder, f"{number:02d}", note)
        files.append(folder)
    verdict, draft = write_draft(verdict, request, out)
    files += [*draft, *write_report(verdict, data, out), out / "verdict.json"]
    # verdict.json is the last file: where it exists, all files that it lists are complete.
    verdict = dataclasses.replace(verdict, files=tuple(files))
    replace_file(files[-1], json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict


def write_draft(verdict: Verdict, request: LoopRequest, out: Path) -> tuple[Verdict, list[Path]]:
    """Write the file of the drafted effect if the verdict has one. Return the verdict, and the list of written files.

    A drafted effect is an effect that the search for missing effects proposes for the remaining residual. The returned
    verdict also has the command line that tries this effect.
    """
    if verdict.draft is None:
        return verdict, []
    file = out / DRAFT
    draft = dataclasses.replace(verdict.draft, command=request.again_with(file))
    return dataclasses.replace(verdict, draft=draft), [replace_file(file, draft.text)]
