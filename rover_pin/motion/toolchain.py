"""Compile generated C once and keep the result."""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rover_pin.errors import MissingExtraError

FLAGS = ("-O2", "-fPIC", "-shared", "-fno-math-errno", "-ffp-contract=off")


def compiler() -> list[str] | None:
    """Return the command of a C compiler: $CC, cc, gcc, clang, or the `ziglang` package; None where there is none."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def cache_folder() -> Path:
    """Return the folder of compiled libraries: $ROVER_PIN_CACHE, or rover_pin in the user's cache."""
    own = os.environ.get("ROVER_PIN_CACHE")
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(own) if own else base / "rover_pin"


def shared_library(source: str, name: str) -> ctypes.CDLL:
    """Return the library compiled from C `source`, from the cache where the same source was compiled before.

    Raises
    ------
    MissingExtraError
        There is no C compiler, or it fails; the message says how to get one.
    """
    command = compiler()
    if command is None:
        raise MissingExtraError(
            "No C compiler found, and the fast simulator is compiled on first use: install gcc or clang, or "
            "the package `ziglang` (`pip install rover-pin[compiler]`)."
        )
    key = hashlib.sha256("\0".join([source, *command, *FLAGS, sys.platform, os.uname().machine]).encode()).hexdigest()
    folder = writable_folder()
    target = folder / f"{name}-{key[:20]}.so"
    if not target.exists():
        _compile(command, source, target)
    return ctypes.CDLL(str(target))


def writable_folder() -> Path:
    """Return the cache folder, or a fresh temporary one where that cannot be written."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="rover_pin-"))


def _compile(command: list[str], source: str, target: Path) -> None:
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        file, made = Path(folder) / "source.c", Path(folder) / "made.so"
        file.write_text(source)
        run = subprocess.run(
            [*command, *FLAGS, "-o", str(made), str(file), "-lm"], capture_output=True, text=True, check=False
        )
        if run.returncode:
            raise MissingExtraError(
                f"The C compiler {' '.join(command)} failed: {run.stderr.strip().splitlines()[-1:]}; "
                "set CC to one that works."
            )
        os.replace(made, target)
