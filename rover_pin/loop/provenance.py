"""What a verdict rests on: versions, seed, time, and the command that repeats it."""

import platform
import shlex
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rover_pin.version import __version__


@dataclass(frozen=True)
class LoopRequest:
    """A loop as it was asked for: on what, from where, with whose effects, and where it writes.

    `data` and `model` are paths where files were given, else what lies in memory; `out` None writes nothing.
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
        """The command line that repeats the loop, or why there is none."""
        for name, source in (*(("data", folder) for folder in self.folders), ("a model", self.model)):
            if not isinstance(source, (str, Path, type(None))):
                return f"close_the_loop(...) on {name} in memory"
        if self.seed:
            words = [str(folder) for folder in self.folders]
            return f"close_the_loop({(words[0] if len(words) == 1 else words)!r}, ..., seed={self.seed})"
        return self._line(self.effects, self.out)

    @property
    def folders(self) -> tuple[Any, ...]:
        """The data, one or several."""
        return self.data if isinstance(self.data, tuple) else (self.data,)

    def again_with(self, effects: Path) -> str:
        """Return the command line that tries this effect too; nothing where no line repeats the loop, or it has one."""
        repeats = self.command.startswith("rover-pin") and self.effects is None
        return self._line(effects, None) if repeats else ""

    def _line(self, effects: str | Path | None, out: str | Path | None) -> str:
        options = {"--model": self.model, "--effects": effects, "--out": out, "--experiment": self.experiment}
        words = [str(word) for option, value in options.items() if value for word in (option, value)]
        trusted = ["--trust"] if self.trust else []
        return shlex.join(["rover-pin", "close-loop", *map(str, self.folders), *words, *trusted])


def provenance(request: LoopRequest, seconds: float) -> dict[str, Any]:
    """Return versions, seed, seconds and command as plain values."""
    packages = {name: version(name) for name in ("casadi", "numpy", "scipy", "pin")}
    versions = {"rover-pin": __version__, "python": platform.python_version(), **packages}
    return {"versions": versions, "seed": request.seed, "seconds": round(seconds, 1), "command": request.command}
