"""Work in a fork of its own group, bounded in time and memory."""

from __future__ import annotations

import contextlib
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator

MEMORY = 6 << 30


def forked(work: Callable[[Callable[[str], None]], None], limit: float) -> tuple[int, str]:
    """Return exit code and words of `work(tell)` in a fork of its own group, ended after `limit` [s]."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        _alone()
        code = 99
        try:
            work(lambda words: _write(write, words))
            code = 0
        finally:
            os._exit(code)
    os.close(write)
    said, status, end = b"", None, time.monotonic() + limit
    while status is None and time.monotonic() < end:
        if select.select([read], [], [], 0.5)[0]:
            part = os.read(read, 1 << 16)
            said += part
            status = None if part else os.waitpid(child, 0)[1]
        else:  # one of its own children may hold the pipe
            done, ended = os.waitpid(child, os.WNOHANG)
            status = ended if done else None
    os.close(read)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1] if status is None else status), said.decode()


def _alone() -> None:
    """Make this fork a group of its own, silent and bounded in memory."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    _silenced(1)
    _silenced(2)


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Keep quiet for a while what is written to the standard output."""
    sys.stdout.flush()
    before = os.dup(1)
    _silenced(1)
    yield
    sys.stdout.flush()
    os.dup2(before, 1)


def _silenced(file: int) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), file)


def _write(file: int, words: str) -> None:
    content = words.encode()
    while content:
        content = content[os.write(file, content) :]
