"""What a data check says: one line with what is wrong, where, and what to do."""

from collections.abc import Iterable
from typing import NamedTuple

MAX_LISTED = 4
"""Places, or channels, that one line lists; of more, the first and how many more."""


class Finding(NamedTuple):
    """One line of the data check."""

    what: str
    where: str
    todo: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.todo}."


def gathered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings with those that differ only in their place made one."""
    places: dict[tuple[str, str], list[str]] = {}
    for finding in findings:
        places.setdefault((finding.what, finding.todo), []).append(finding.where)
    return tuple(Finding(what, listed(where), todo) for (what, todo), where in places.items())


def listed(names: list[str]) -> str:
    """Return the first of some names, and how many more there are."""
    more = len(names) - MAX_LISTED
    return ", ".join(names[:MAX_LISTED]) + (f" and {more} more" if more > 0 else "")
