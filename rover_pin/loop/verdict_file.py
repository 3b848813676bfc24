"""The request for a loop, and the files of its verdict: models, drafted effect, report, and verdict.json.

`LoopRequest` holds the user's arguments. `provenance` returns the versions, the seed, the duration and the command by
which a reader can repeat the loop; they are written into verdict.json.
"""

import dataclasses
import json
import platform
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rover_pin.base.encode import shell_line
from rover_pin.base.files.whole_file import replace_file
from rover_pin.discrepancy.question import LoopData
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.inference.beliefs import drawn_models
from rover_pin.report.labels import write_report
from rover_pin.version import __version__

DRAFT = Path("draft_effect") / "measured_remainder.py"
"""Path of a drafted effect in the folder of results."""
POSTERIOR, POSTERIOR_MODELS = "posterior", 8
"""Name of the folder for models that are drawn from the posterior distribution (POSTERIOR), and the number of these
models (POSTERIOR_MODELS). With eight models, the largest of eight results is exceeded by the next draw with a
probability of one ninth; each further model makes a drive on all models longer."""


@dataclass(frozen=True)
class LoopRequest:
    """The user's arguments of a loop: data, model to start from, own effects, folder for the results, and options.

    `data` and `model` are paths if the user gave files, else objects in memory. If `out` is None, nothing is written.
    """

    data: Any
    model: Any = None
    effects: str | Path | None = None
    out: str | Path | None = None
    experiment: str | Path | None = None
    trust: bool = False
    seed: int = 0

    @property
    def command(self) -> str:
        """The command line that repeats the search for missing effects, or a call in Python if no command line can
        repeat the search.
        """
        # Objects in memory have no path that a command line could name.
        for name, source in (*(("data", folder) for folder in self.folders), ("a model", self.model)):
            if not isinstance(source, (str, Path, type(None))):
                return f"close_the_loop(...) on {name} in memory"
        # The command line has no option for the seed.
        if self.seed:
            words = [str(folder) for folder in self.folders]
            return f"close_the_loop({(words[0] if len(words) == 1 else words)!r}, ..., seed={self.seed})"
        return self._line(self.effects, self.out)

    @property
    def folders(self) -> tuple[Any, ...]:
        """The data as a tuple, even if there is only one data set."""
        return self.data if isinstance(self.data, tuple) else (self.data,)

    def again_with(self, effects: Path) -> str:
        """Return the command line that repeats the search for missing effects and also tries the effects in the file
        `effects`.

        The text is empty if no command line can repeat the search, or if the search already used an effect file,
        because a command takes only one such file.
        """
        repeats = self.command.startswith("rover-pin") and self.effects is None
        return self._line(effects, None) if repeats else ""

    def _line(self, effects: str | Path | None, out: str | Path | None) -> str:
        """Return the command line of the search, with the effect file `effects` and the results folder `out`."""
        options = {"--model": self.model, "--effects": effects, "--out": out, "--experiment": self.experiment}
        # Paths stay paths here, because `shell_line` writes ./ in front of a path that begins with a hyphen.
        words = [
            word
            for option, value in options.items()
            if value
            for word in (option, value if isinstance(value, Path) else str(value))
        ]
        trusted = ["--trust"] if self.trust else []
        return shell_line(["rover-pin", "close-loop", *map(Path, self.folders), *words, *trusted])


def provenance(request: LoopRequest, seconds: float) -> dict[str, Any]:
    """Return the provenance of a verdict for verdict.json: versions of packages, seed, duration [s], and command
    line.
    """
    packages = {name: version(name) for name in ("casadi", "numpy", "scipy", "pin")}
    versions = {"rover-pin": __version__, "python": platform.python_version(), **packages}
    return {"versions": versions, "seed": request.seed, "seconds": round(seconds, 1), "command": request.command}


def write_results(verdict: Verdict, data: LoopData, request: LoopRequest) -> Verdict:
    """Write all files of a verdict into the folder that the request names, and return the verdict with their paths."""
    out = Path(str(request.out))
    files = data.write_models(verdict.model, out, "model", verdict.sentence)
    # A joint fit has one model for each set, so that one draw from its posterior would be several files. No command can
    # read such a draw, so draws are written only for a fit with a single model.
    if len(files) == 1 and (beliefs := verdict.deciding_beliefs) is not None:
        folder = out / POSTERIOR
        folder.mkdir(parents=True, exist_ok=True)
        note = f"One of {POSTERIOR_MODELS} models of equal weight, drawn from the posterior distribution."
        for number, model in enumerate(drawn_models(beliefs, POSTERIOR_MODELS, request.seed), 1):
            data.write_models(model, folder, f"{number:02d}", note)
        files.append(folder)
    verdict, draft = write_draft(verdict, request, out)
    files += [*draft, *write_report(verdict, data, out), out / "verdict.json"]
    # verdict.json is written last. If it exists, all files that it lists are complete.
    verdict = dataclasses.replace(verdict, files=tuple(files))
    replace_file(files[-1], json.dumps(verdict.as_dict(), indent=1, default=str) + "\n")
    return verdict


def write_draft(verdict: Verdict, request: LoopRequest, out: Path) -> tuple[Verdict, list[Path]]:
    """Write the drafted effect of a verdict into a file, and return the verdict and the list of written files.

    A drafted effect is a new effect that the search for missing effects proposes if no known effect explains the
    residual. The returned verdict also has the command line that tries this effect. If the verdict has no drafted
    effect, it is returned unchanged, and the list is empty.
    """
    if verdict.draft is None:
        return verdict, []
    file = out / DRAFT
    draft = dataclasses.replace(verdict.draft, command=request.again_with(file))
    return dataclasses.replace(verdict, draft=draft), [replace_file(file, draft.text)]
