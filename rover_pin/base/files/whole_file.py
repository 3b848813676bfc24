"""Functions that replace a file in one step, so that a stop of the process never leaves the file half written."""

import contextlib
import os
from pathlib import Path

from rover_pin.base.errors import DataError


def write_whole(path: Path, new_content: bytes | str) -> None:
    """Write a file so that a reader sees either its old content or all of the new content.

    The content goes into a temporary file in the folder of `path`, which must exist. The temporary file is then renamed
    to `path`. If the process is killed or the power fails, `path` holds the old content or the new one, never a part.

    Raises OSError: the file cannot be written. The old file is then unchanged. Use `replace_file` to get an error that
    names the file.
    """
    # The temporary file lies in the folder of the target, because a rename is one step only within one file system.
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(new_content.encode() if isinstance(new_content, str) else new_content)
            # Without fsync, a power failure after the rename could leave an empty file: the disk may store the new name
            # before the content.
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def replace_file(path: str | Path, new_content: bytes | str) -> Path:
    """Write a file in one step, as `write_whole` does, and return its path. A missing folder is created first.

    Text is written in UTF-8.

    Raises DataError: the file cannot be written; the message names the file.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, new_content)
    except OSError as error:
        raise DataError(f"{path}: the file cannot be written: {error.strerror}.") from error
    return path
