"""Files that are written whole or not at all."""

import contextlib
import os
from pathlib import Path

from rover_pin.base.errors import DataError


def replace_file(path: str | Path, content: bytes | str) -> Path:
    """Write a whole file or none of it, making its folder; a reader never sees half.

    Raises DataError: it cannot be written there.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise DataError(f"{path}: the file cannot be written: {error.strerror}.") from error
    return path
