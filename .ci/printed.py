"""Print lines for a shell as the pages print them: PAGE HEADING, or `installs` for every `pip install` of all pages."""

import re
import sys
from pathlib import Path

LOCKED = ("--require-hashes", "--no-build-isolation")
"""Options of the two commands that repeat a locked environment; `.ci/versions locked` runs these commands."""


def below(page: str, heading: str) -> str:
    """Return the lines for a shell that stand below a heading of a page."""
    text = Path(page).read_text(encoding="utf-8")
    (section,) = re.findall(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    return "".join(re.findall(r"```sh\n(.*?)```", section, re.DOTALL))


def installs() -> str:
    """Return every `pip install` of the pages once, without the two of a locked environment."""
    pages = [Path("README.md"), Path("CONTRIBUTING.md"), *sorted(Path("docs").glob("*.md"))]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    lines = dict.fromkeys(re.findall(r"pip install [^`&\n]*[^`&\s]", text))
    return "".join(f"{line}\n" for line in lines if not any(option in line for option in LOCKED))


lines = installs() if sys.argv[1:] == ["installs"] else below(*sys.argv[1:])
if not lines:
    raise SystemExit(f"no line for a shell: {' '.join(sys.argv[1:])}")
print(lines, end="")
