"""The folder of a run's results. Only one process at a time may write there, and the log names the files to be
replaced.
"""

import fcntl
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import exists

LOCK = ".rover_pin.lock"
"""Name of the lock file in a folder of results."""
LOOP_RESULTS = ("report.html", "verdict.json", "model.toml", "posterior", "draft_effect")
"""Files and folders, apart from pictures, that `close_the_loop` may write into its folder of results."""

log = logging.getLogger(__name__)


@contextmanager
def alone_in(folder: str | Path | None) -> Iterator[None]:
    """Lock a folder of results until the end of the `with` block, so that no other run writes there.

    A missing folder is created, and removed again if it is empty at the end of the block. If the process is killed, the
    system releases the lock. With `folder` None, nothing is locked.

    Raises DataError: another process or another thread has locked the folder, or the folder cannot be created or
    locked.
    """
    # A run without a folder of results writes nothing, so it needs no lock.
    if folder is None:
        yield
        return
    folder = Path(folder)
    if exists(folder) and not folder.is_dir():
        raise DataError(f"{folder}: this is a file, but the results need a folder; give another name.")
    missing = not exists(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock_fd = _lock_file(folder / LOCK)
    except BlockingIOError:
        # The lock file holds the number of the process that locked it. The file may be gone by now, or be half written.
        holder = "another process"
        with suppress(OSError):
            number = (folder / LOCK).read_bytes()[:20]
            holder = f"process {number.decode()}" if number.isdigit() else holder
        raise DataError(
            f"{folder}: {holder} is writing results into this folder: wait until it has ended, or name another "
            "folder for the results."
        ) from None
    except OSError as error:
        raise DataError(f"{folder}: the folder cannot be used for results: {error.strerror}.") from error
    try:
        # The lock file is removed before the lock is released, so that no second run locks a file that is about to
        # vanish.
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK).unlink()
        os.close(lock_fd)
        with suppress(OSError):
            if missing:
                folder.rmdir()  # fails, as it should, where the block has written files


def replacing(folder: str | Path, names: Sequence[str], untouched: Sequence[str] = ()) -> str:
    """Return a message that names the files of an earlier run that a new run will replace; an empty text if there are
    none.

    `names` are the files that the new run writes. `untouched` are files that the new run does not write; the message
    names the existing ones, because a user could mistake them for results of the new run.
    """
    replaced, kept = ([name for name in group if exists(Path(folder) / name)] for group in (names, untouched))
    message = f"{folder}: this run replaces these results of an earlier run: "
    note = f" These files of an earlier run are kept: {', '.join(kept)}." if kept else ""
    return f"{message}{', '.join(replaced)}.{note}" if replaced else ""


def say_what_is_replaced(folder: str | Path | None, names: Sequence[str], untouched: Sequence[str] = ()) -> None:
    """Log which files of an earlier run a new run will replace. For `names` and `untouched`, see `replacing`.

    Call this only after every check that could still refuse the new run; otherwise the user reads that results are
    replaced although they are not.
    """
    message = "" if folder is None else replacing(folder, names, untouched)
    if message:
        log.info("rover-pin: %s", message)


def _lock_file(file: Path) -> int:
    """Lock a lock file, write the number of this process into it, and return its file descriptor. A missing file is
    created.

    Raises BlockingIOError: another process has locked the file.
    """
    # Between opening and locking, the previous holder may have removed the file. A lock on a removed file excludes
    # nobody, so the file is then created again.
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
