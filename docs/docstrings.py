"""How the site reads docstrings: `Source:` after a section of numpydoc is a note, not one more parameter."""

from __future__ import annotations

import re
from typing import Any

import griffe


class SourceIsANote(griffe.Extension):
    """Put what begins with `Source:` behind a section under a heading of its own."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring as it is shown."""
        if obj.docstring is not None and re.search(r"\n-{3,}\n", obj.docstring.value):
            obj.docstring.value = re.sub(r"\n\nSource:", "\n\nNotes\n-----\nSource:", obj.docstring.value, count=1)
