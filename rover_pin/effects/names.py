"""Names of effects for a reader: a short name and a one-line explanation."""

import inspect
import re
from collections.abc import Iterable


def title_of(kind: type) -> str:
    """Return the short name of an effect's class for a reader; if the class has no title, the words of the
    class name.
    """
    title = str(getattr(kind, "title", ""))
    return title or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.__name__).lower()


def meaning_of(kind: type) -> str:
    """Return the explanation of an effect's class as a clause; if the class has none, the first line of its
    docstring.
    """
    meaning = str(getattr(kind, "meaning", ""))
    return meaning or (inspect.getdoc(kind) or "").split("\n")[0].removesuffix(".")


def display_name(name: str, kinds: Iterable[type]) -> str:
    """Return the name of a candidate in words for a reader.

    `HardPatch@1.2` becomes 'patch of other soil at x = 1.2 m', and `WeakMotor[2]` becomes 'weak motor (2)'. `kinds` are
    the known classes of effects. A name that belongs to none of them, such as a parameter that was freed from its
    prior, is returned unchanged.
    """
    # A set of causes has the names of its causes joined by " + ".
    titles = {kind.__name__: title_of(kind) for kind in kinds}
    words = []
    for part in name.split(" + "):
        # The class, then the owner (a wheel or channel) in brackets, then the position behind the @.
        matched = re.fullmatch(r"(\w+)(?:\[([^\]]*)\])?(?:@(.+))?", part)
        if matched is None or matched[1] not in titles:
            # An unknown part, such as a parameter that was freed from its prior, keeps its name.
            words.append(part)
            continue
        owner = f" ({matched[2]})" if matched[2] else ""
        position = f" at x = {matched[3]} m" if matched[3] else ""
        words.append(f"{titles[matched[1]]}{owner}{position}")
    return " + ".join(words)
