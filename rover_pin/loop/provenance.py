"""What a verdict rests on: versions, seed, time, and the command that repeats it."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rover_pin.version import __version__


def command(data: Any, effects: str | Path | None, out: str | Path | None) -> str:
    """Return the command line that repeats a loop."""
    if not isinstance(data, (str, Path)):
        return "close_the_loop(...) on data in memory"
    extra = (f" --effects {effects}" if effects else "") + (f" --out {out}" if out else "")
    return f"rover-pin close-loop {data}{extra}"


def provenance(seed: int, seconds: float, repeat: str) -> dict[str, Any]:
    """Return versions, seed, seconds and command as plain values."""
    packages = {name: version(name) for name in ("casadi", "numpy", "scipy", "pin")}
    versions = {"rover-pin": __version__, "python": platform.python_version(), **packages}
    return {"versions": versions, "seed": seed, "seconds": round(seconds, 1), "command": repeat}
