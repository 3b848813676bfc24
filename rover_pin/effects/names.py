"""Effects as a reader calls them: a human name and what it means, in one line."""

import inspect
import re
from collections.abc import Iterable


def title_of(kind: type) -> str:
    """Return an effect's human name; where it has none, the words of its class's."""
    title = str(getattr(kind, "title", ""))
    return title or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.__name__).lower()


def meaning_of(kind: type) -> str:
    """Return what an effect means, as a clause; where it has none, the first line of its docstring."""
    meaning = str(getattr(kind, "meaning", ""))
    return meaning or (inspect.getdoc(kind) or "").split("\n")[0].removesuffix(".")


def display_name(name: str, kinds: Iterable[type]) -> str:
    """Return a candidate's name for a reader: HardPatch@1.2 is 'patch of other soil at x = 1.2 m'.

    `WeakMotor[2]` is 'weak motor (2)'; what is no effect of these kinds, as a number that was freed, stays as it is.
    """
    titles = {kind.__name__: title_of(kind) for kind in kinds}
    return " + ".join(_one(part, titles) for part in name.split(" + "))


def _one(name: str, titles: dict[str, str]) -> str:
    matched = re.fullmatch(r"(\w+)(?:\[([^\]]*)\])?(?:@(.+))?", name)
    if matched is None or matched[1] not in titles:
        return name
    text = titles[matched[1]]
    text += f" ({matched[2]})" if matched[2] else ""
    return text + (f" at x = {matched[3]} m" if matched[3] else "")
