"""A folder of results: one process at a time writes there, and it is said what a further run replaces."""

import fcntl
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import exists

LOCK = ".rover_pin.lock"
OF_A_LOOP = ("report.html", "verdict.json", "model.toml", "posterior", "draft_effect")
"""What a run of the loop may leave in its folder, besides pictures."""

log = logging.getLogger(__name__)


@contextmanager
def alone_in(folder: str | Path | None) -> Iterator[None]:
    """Hold a folder, made where it is missing, until the block ends; the system lets go of it for who is killed.

    None is no folder: nothing is written, nothing held.

    Raises DataError: another process, or another thread of this one, holds it; or it cannot be made or locked.
    """
    if folder is None:
        yield
        return
    folder = Path(folder)
    if exists(folder) and not folder.is_dir():
        raise DataError(f"{folder}: a file stands where the results go; give a folder.")
    missing = not exists(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock_fd = _lock_file(folder / LOCK)
    except BlockingIOError:
        raise DataError(
            f"{folder}: {_holder(folder / LOCK)} is at work in this folder: wait until it has ended, or name another "
            "folder for the results."
        ) from None
    except OSError as error:
        raise DataError(f"{folder}: the folder cannot be used for results: {error.strerror}.") from error
    try:
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK).unlink()
        os.close(lock_fd)
        with suppress(OSError):
            if missing:
                folder.rmdir()  # where nothing came to lie in it


def replacing(folder: str | Path, names: Sequence[str], untouched: Sequence[str] = ()) -> str:
    """Return what of an earlier run a new one may replace in a folder, and what it leaves; nothing if it is empty."""
    there, stay = ([name for name in group if exists(Path(folder) / name)] for group in (names, untouched))
    message = f"{folder}: an earlier run's results are there, which this one replaces as it writes its own: "
    note = f" Not written anew, and still of an earlier run: {', '.join(stay)}." if stay else ""
    return f"{message}{', '.join(there)}.{note}" if there else ""


def say_what_is_replaced(folder: str | Path | None, names: Sequence[str], untouched: Sequence[str] = ()) -> None:
    """Log what of an earlier run a new one may replace; to be called when nothing is left that could refuse the run."""
    message = "" if folder is None else replacing(folder, names, untouched)
    if message:
        log.info("rover-pin: %s", message)


def _lock_file(file: Path) -> int:
    """Return the open file, locked; one that its holder has removed meanwhile is no lock, and is made again."""
    while True:
        opened = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if file.exists() and os.path.samestat(os.fstat(opened), file.stat()):
                os.ftruncate(opened, 0)
                os.write(opened, str(os.getpid()).encode())
                return opened
        except BaseException:
            os.close(opened)
            raise
        os.close(opened)


def _holder(file: Path) -> str:
    with suppress(OSError):
        number = file.read_bytes()[:20]
        return f"process {number.decode()}" if number.isdigit() else "another process"
    return "another process"
