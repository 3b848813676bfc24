"""How far a sweep is: a bar with the time left on a terminal, now and then a line elsewhere."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rover_pin.base.console import plain_column, plain_console

Advance = Callable[[bool], None]
"""To be called after each case with whether it failed."""
LOG = logging.getLogger("rover_pin")
SECONDS_BETWEEN_LINES = 10.0


@contextmanager
def progress(name: str, total: int, done: int) -> Iterator[Advance]:
    """Show on stderr how many of `total` cases are finished, `done` of them before."""
    display = _silent if LOG.level > logging.INFO else _bar if sys.stderr.isatty() else _lines
    with display(name, total, done) as advance:
        yield advance


@contextmanager
def _silent(name: str, total: int, done: int) -> Iterator[Advance]:
    yield lambda has_failed: None


@contextmanager
def _bar(name: str, total: int, done: int) -> Iterator[Advance]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    counts = (MofNCompleteColumn(), plain_column("{task.fields[failures]} failed"))
    columns = (plain_column("{task.description}"), BarColumn(), *counts, TimeRemainingColumn(), plain_column("left"))
    failed = 0
    with Progress(*columns, console=plain_console(stderr=True)) as bar:
        task = bar.add_task(name, total=total, completed=done, failures=0)

        def advance(has_failed: bool) -> None:
            nonlocal failed
            failed += has_failed
            bar.update(task, advance=1, failures=failed)

        yield advance


@contextmanager
def _lines(name: str, total: int, done: int) -> Iterator[Advance]:
    start = last = time.monotonic()
    finished = failed = 0

    def say() -> None:
        seconds = (time.monotonic() - start) / max(finished, 1) * (total - done - finished)
        remaining = f", about {seconds:.0f} s left" if finished and finished + done < total else ""
        print(f"{name}: {done + finished} of {total} cases, {failed} failed{remaining}", file=sys.stderr, flush=True)

    def advance(has_failed: bool) -> None:
        nonlocal finished, failed, last
        finished += 1
        failed += has_failed
        if time.monotonic() - last > SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            say()

    say()
    yield advance
    say()
