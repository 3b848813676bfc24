"""Print the lines for a shell that stand under a heading of a page, as they are printed there: PAGE HEADING."""

import re
import sys
from pathlib import Path

page, heading = sys.argv[1:]
text = Path(page).read_text(encoding="utf-8")
(section,) = re.findall(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
lines = "".join(re.findall(r"```sh\n(.*?)```", section, re.DOTALL))
if not lines:
    raise SystemExit(f"{page}: no line for a shell under '{heading}'")
print(lines, end="")
