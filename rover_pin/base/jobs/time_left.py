"""Time left of long work, now and then a line: what is done, of how much, about how long it still takes."""

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

SECONDS_BETWEEN_LINES = 10.0
LOG = logging.getLogger("rover_pin.base.jobs.time_left")
T = TypeVar("T")


class TimeLeft:
    """Says how far one piece of work is, at most every ten seconds, judged by the pace so far."""

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic):
        self.what, self.clock = what, clock
        self.start = self.last = clock()

    def note_done(self, count: int, total: int) -> None:
        """Note that `count` of `total` are done; the line has the time that the rest takes at this pace."""
        now = self.clock()
        if count < 1 or count >= total or now - self.last < SECONDS_BETWEEN_LINES:
            return
        self.last = now
        remaining = format_duration((now - self.start) / count * (total - count))
        LOG.info("%s: %d of %d, about %s left", self.what, count, total, remaining)


def format_duration(seconds: float) -> str:
    """Return a time as one says it: seconds up to two minutes, then minutes, then hours."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def telling(rows: Iterable[T], total: int, what: str) -> Iterator[T]:
    """Yield the rows, and say on the way how long the rest takes."""
    estimate = TimeLeft(what)
    for count, row in enumerate(rows, 1):
        yield row
        estimate.note_done(count, total)
