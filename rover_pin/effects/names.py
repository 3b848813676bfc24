"""Effects as a reader calls them: a human name and what it means, in one line."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable


def title_of(kind: type) -> str:
    """Return an effect's human name; where it has none, the words of its class's."""
    own = str(getattr(kind, "title", ""))
    return own or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.__name__).lower()


def meaning_of(kind: type) -> str:
    """Return what an effect means, as a clause; where it has none, the first line of its docstring."""
    own = str(getattr(kind, "meaning", ""))
    return own or (inspect.getdoc(kind) or "").split("\n")[0].removesuffix(".")


def spoken(name: str, kinds: Iterable[type]) -> str:
    """Return a candidate's name for a reader: HardPatch@1.2 is 'patch of other soil at x = 1.2 m'.

    `WeakMotor[2]` is 'weak motor (2)'; what is no effect of these kinds, as a number that was freed, stays as it is.
    """
    known = {kind.__name__: title_of(kind) for kind in kinds}
    return " + ".join(_one(part, known) for part in name.split(" + "))


def _one(name: str, known: dict[str, str]) -> str:
    found = re.fullmatch(r"(\w+)(?:\[([^\]]*)\])?(?:@(.+))?", name)
    if found is None or found[1] not in known:
        return name
    said = known[found[1]]
    said += f" ({found[2]})" if found[2] else ""
    return said + (f" at x = {found[3]} m" if found[3] else "")
