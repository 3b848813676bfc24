"""An estimate of the remaining time of a long calculation, shown as a progress bar or as lines of the log."""

import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any, TypeVar

from rover_pin.base.console import plain_column, plain_console

SECONDS_BETWEEN_LINES = 10.0
"""Minimum time between two progress lines in the log [s]. More frequent lines would hide the other lines of the log."""
SECONDS_BEFORE_BAR = 2.0
"""Duration of a calculation after which a progress bar appears [s]. A bar that is visible for a moment only would
disturb."""
LOG = logging.getLogger("rover_pin.base.jobs.time_left")
T = TypeVar("T")


class TimeLeft:
    """Logs the progress of a long calculation: the number of finished parts, and an estimate of the remaining time.

    The estimate assumes that a remaining part takes the average time of the finished parts. `what` names the
    calculation in the log. `clock` returns the time in seconds; a test passes its own clock.
    """

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic):
        self.what, self.clock = what, clock
        self.start = self.last = clock()

    def note_done(self, count: int, total: int) -> None:
        """Record that `count` of `total` parts are finished. A line is logged if the last line is more than ten seconds
        old.
        """
        now = self.clock()
        if count < 1 or count >= total or now - self.last < SECONDS_BETWEEN_LINES:
            return
        self.last = now
        remaining = format_duration((now - self.start) / count * (total - count))
        LOG.info("%s: %d of %d, about %s left", self.what, count, total, remaining)


def format_duration(seconds: float) -> str:
    """Return a duration in words: in seconds up to two minutes, in minutes up to two hours, then in hours."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def showing_progress(rows: Iterable[T], total: int, what: str) -> Iterator[T]:
    """Yield `rows` unchanged, and show the progress: the number of finished rows out of `total`, and the remaining
    time.

    On a terminal a progress bar appears after SECONDS_BEFORE_BAR; elsewhere a line is logged every ten seconds. `what`
    names the work in the progress bar and in the log.

    >>> [row for row in showing_progress([3, 4], 2, "runs read")]
    [3, 4]
    """
    estimate, start = TimeLeft(what), time.monotonic()
    with ExitStack() as stack:
        bar: Any = None
        for count, row in enumerate(rows, 1):
            # The caller works on this row while the generator waits here, so the caller's time is measured too.
            yield row
            # The bar appears only on a terminal, and only if messages of this level are wanted.
            is_long = count < total and time.monotonic() - start >= SECONDS_BEFORE_BAR
            if bar is None and is_long and sys.stderr.isatty() and LOG.isEnabledFor(logging.INFO):
                bar = stack.enter_context(_bar())
                task = bar.add_task(what, total=total)
            if bar is None:
                estimate.note_done(count, total)
            else:
                bar.update(task, completed=count)


def _bar() -> Any:
    """Return a progress bar with the number of finished parts and the remaining time; it disappears at the end."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (plain_column("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, plain_column("left"), console=plain_console(stderr=True), transient=True)
