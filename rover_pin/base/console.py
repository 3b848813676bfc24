"""The terminal as rich draws it, taking every text as it is: names may hold brackets, colons or slashes."""

from typing import Any


def plain_console(stderr: bool = False) -> Any:
    """Return a console that reads no markup and no emoji codes in what it prints."""
    from rich.console import Console

    return Console(stderr=stderr, markup=False, emoji=False)


def plain_column(text: str) -> Any:
    """Return a column of a progress bar whose text, filled in, is shown as it is."""
    from rich.progress import TextColumn

    return TextColumn(text, markup=False)
