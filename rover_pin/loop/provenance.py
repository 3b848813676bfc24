"""The arguments of a loop, and the provenance of its verdict: versions, seed, duration, and the command that repeats
it.
"""

import platform
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rover_pin.base.encode import shell_line
from rover_pin.version import __version__


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
        """The command line that repeats the search for missing effects. If no command line can repeat it, this is a
        call in Python.
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
        options = {"--model": self.model, "--effects": effects, "--out": out, "--experiment": self.experiment}
        # `shell_line` needs to know which words are paths.
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
