"""An earlier version of the package, taken from the repository's history, to run beside the present one."""

from __future__ import annotations

import io
import os
import subprocess
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]


@contextmanager
def checkout(commit: str) -> Iterator[Path]:
    """Yield a folder with the package and the rovers of a commit; put it first in PYTHONPATH."""
    packed = subprocess.run(["git", "archive", commit, "rover_pin", "urdf"], cwd=ROOT, check=False, capture_output=True)
    if packed.returncode:
        raise SystemExit(f"{ROOT} has no commit {commit}: run this in a clone with its history")
    with TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        if hasattr(tarfile, "data_filter"):  # Python 3.11.4 on; 3.11.2 is what Debian 12 has
            archive.extraction_filter = tarfile.data_filter
        archive.extractall(folder)
        yield Path(folder)


def as_installed(package: Path, folder: Path | str = "") -> dict[str, str]:
    """Return the environment of a process with a version of the package that keeps its byte code, in a folder if given.

    An installed package has its byte code; where none may be written, every start would compile all modules again.
    """
    own = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    kept = {"PYTHONPYCACHEPREFIX": f"{folder}/byte-code"} if folder else {}
    return {**own, **kept, "PYTHONPATH": str(package)}
