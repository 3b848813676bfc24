"""Functions that print on the terminal. The package prints every text through them.

A name that comes with data may hold an escape sequence, a bell, a mark that turns the direction of writing, or markup
of the library rich. These functions print such characters in a visible form, so that the terminal does not obey them.
"""

import sys
from typing import Any

from rover_pin.base.encode import printable, printable_lines


def say(text: str = "") -> None:
    """Print a text of one or more lines on standard output, with control characters escaped."""
    print(printable_lines(text))


def warn(text: str) -> None:
    """Print one line on standard error; control characters, newlines included, are escaped."""
    print(printable(text), file=sys.stderr, flush=True)


def plain_console(stderr: bool = False) -> Any:
    """Return a console of the library rich that prints texts unchanged: markup and emoji codes have no effect.

    The console writes to standard output, or to standard error if `stderr` is True.
    """
    from rich.console import Console

    return Console(stderr=stderr, markup=False, emoji=False)


def plain_column(text: str) -> Any:
    """Return a text column for a progress bar of the library rich. Markup in the displayed text has no effect."""
    from rich.progress import TextColumn

    return TextColumn(text, markup=False)
