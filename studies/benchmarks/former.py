"""An earlier version of the package from the repository's history, for comparison with the present version."""

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
    """Yield a folder with the package and the rovers as they were at an earlier commit. A process that has this folder
    first in PYTHONPATH uses the earlier version.
    """
    # Only the package and its rovers are extracted, not the tests and studies.
    packed = subprocess.run(["git", "archive", commit, "rover_pin", "urdf"], cwd=ROOT, check=False, capture_output=True)
    if packed.returncode:
        raise SystemExit(f"{ROOT} has no commit {commit}: run this in a clone with its history")
    with TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        if hasattr(tarfile, "data_filter"):  # Python 3.11.4 on; 3.11.2 is what Debian 12 has
            archive.extraction_filter = tarfile.data_filter
        archive.extractall(folder)
        yield Path(folder)


def as_installed(package: Path, folder: Path | str = "") -> dict[str, str]:
    """Return the environment of a process that uses a version of the package and keeps its byte code.

    The byte code is kept in `folder` if given. An installed package has its byte code; without it, every start would
    compile all modules again.
    """
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    prefix = {"PYTHONPYCACHEPREFIX": f"{folder}/byte-code"} if folder else {}
    return {**variables, **prefix, "PYTHONPATH": str(package)}
