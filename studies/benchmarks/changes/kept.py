"""What is known of changes that were tried before: good as long as the changed file and the test are the same."""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import json
from pathlib import Path
from typing import Any


def digest(*files: Path) -> str:
    """Return a short digest of the content of files, in their order."""
    content = hashlib.sha256()
    for file in files:
        content.update(hashlib.sha256(file.read_bytes()).digest())
    return content.hexdigest()[:16]


@functools.cache
def test_digest(file: Path, name: str) -> str:
    """Return a short digest of a test: of all that its file says but for the other tests."""
    text = file.read_text()
    others = [each for each in ast.parse(text).body if getattr(each, "name", name).startswith("test_")]
    rest = text.splitlines()
    for each in others:
        if isinstance(each, ast.FunctionDef) and each.name != name:
            first = min([each.lineno, *(one.lineno for one in each.decorator_list)])
            rest[first - 1 : each.end_lineno] = [""] * ((each.end_lineno or first) - first + 1)
    return hashlib.sha256("\n".join(line for line in rest if line.strip()).encode()).hexdigest()[:16]


class Kept:
    """A file of values by key, a line of JSON for each; a line that was cut short is as if it was not there."""

    def __init__(self, file: Path):
        self.file = file
        self.values: dict[str, Any] = {}
        text = file.read_text() if file.exists() else ""
        for line in text.splitlines():
            with contextlib.suppress(json.JSONDecodeError):
                self.values |= json.loads(line)
        if text and not text.endswith("\n"):
            self._append("\n")

    def get(self, key: str) -> Any:
        """Return what is known, or None."""
        return self.values.get(key)

    def put(self, key: str, value: Any) -> None:
        """Keep a value."""
        self.values[key] = value
        self._append(json.dumps({key: value}, separators=(",", ":")) + "\n")

    def _append(self, text: str) -> None:
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a") as file:
            file.write(text)
