"""What is known of changes that were tried before: good as long as the changed file and the tests are the same."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any


def digest(*files: Path) -> str:
    """Return a short digest of the content of files, in their order."""
    content = hashlib.sha256()
    for file in files:
        content.update(hashlib.sha256(file.read_bytes()).digest())
    return content.hexdigest()[:16]


class Kept:
    """A JSON file of values by key, written as a whole after each change."""

    def __init__(self, file: Path):
        self.file = file
        self.values: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}

    def get(self, key: str) -> Any:
        """Return what is known, or None."""
        return self.values.get(key)

    def put(self, key: str, value: Any) -> None:
        """Keep a value."""
        self.values[key] = value
        self.file.parent.mkdir(parents=True, exist_ok=True)
        written = self.file.with_suffix(".part")
        written.write_text(json.dumps(self.values, separators=(",", ":")))
        os.replace(written, self.file)
