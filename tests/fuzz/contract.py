"""What every reader owes: an input is accepted, or refused by one RoverPinError of one line, soon, in little memory."""

import resource
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rover_pin.base.errors import RoverPinError

LONGEST = 30.0
"""CPU seconds that a reader may take; it may wait ten times as long, since a busy machine is no fault of the reader."""
MEMORY = 2 << 30
"""Bytes of address space that a reader may take beyond what is taken already."""
LINE = 2000
"""Characters of a refusal."""


class Hang(KeyboardInterrupt):
    """A reader that took too long; a stop as Ctrl-C, so that no reader swallows it."""


@contextmanager
def bounded() -> Iterator[None]:
    """Bound time and memory of what runs inside; warnings are errors."""

    def stop(*_: object) -> None:
        raise Hang(f"over {LONGEST:g} s")

    timers = ((signal.SIGPROF, signal.ITIMER_PROF, LONGEST), (signal.SIGALRM, signal.ITIMER_REAL, 10 * LONGEST))
    before = [signal.signal(number, stop) for number, _, _ in timers]
    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_address_space() + MEMORY, limits[1]))
    for _, timer, seconds in timers:
        signal.setitimer(timer, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    finally:
        for (number, timer, _), handler in zip(timers, before, strict=True):
            signal.setitimer(timer, 0.0)
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, limits)


def _address_space() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


def outcome(read: Callable[[], object]) -> str:
    """Return 'accepted', 'refused', or what broke the contract: the exception's name and where it was raised."""
    try:
        with bounded():
            read()
    except RoverPinError as error:
        return _refusal(str(error))
    except SystemExit:  # a program that ends itself is no traceback, and not what a reader may do either
        return "SystemExit of a reader"
    except BaseException as error:  # GeneratorExit and KeyboardInterrupt are no Exceptions
        return f"{type(error).__name__} {_place(error)}: {str(error)[:150]!r}"
    return "accepted"


def _refusal(text: str) -> str:
    if len(text.splitlines()) != 1 or not text.isprintable():
        return f"refusal of {len(text.splitlines())} lines, or not printable: {text[:300]!r}"
    return "refused" if len(text) <= LINE else f"refusal of {len(text)} characters: {text[:150]!r}"


def _place(error: BaseException) -> str:
    """Return the innermost line of the package that the exception went through."""
    place, trace = "", error.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if "/rover_pin/" in file and "/tests/" not in file:
            place = f"{file.rpartition('/rover_pin/')[2]}:{trace.tb_frame.f_code.co_name}"
        trace = trace.tb_next
    return place
