"""All changes of a C file, one at a time: operators, constants, comparisons, names."""

from __future__ import annotations

import re

from changes.python import FLOOR, Mutant

SIGNS = {" + ": " - ", " * ": " / ", " < ": " >= ", " > ": " <= ", " && ": " || ", " += ": " -= ", " == ": " != ",
         "fmin(": "fmax(", "sin(": "cos("}  # fmt: skip
SIGNS |= {other: sign for sign, other in SIGNS.items()} | {"= -": "= "}
TOKEN = re.compile(
    "|".join(re.escape(sign) for sign in sorted(SIGNS, key=len, reverse=True)) + r"|\b\d+\.\d*(?:e-?\d+)?"
)
HIDDEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|^\s*#[^\n]*|\"[^\"\n]*\"|for \([^{\n]*|\[[^\[\]]*MAX_[^\[\]]*\]|_Alignas[^=;]*;",
    re.DOTALL | re.MULTILINE,
)
"""Comments, directives, strings, the heads of loops, and the room of arrays."""


def changes(text: str) -> list[Mutant]:
    """Return all changes of a C text."""
    code = HIDDEN.sub(lambda found: re.sub(r"[^\n]", "~", found.group()), text)
    made = []
    for token in TOKEN.finditer(code):
        line = text.count("\n", 0, token.start()) + 1
        new = SIGNS.get(token.group()) or repr(1.1 * float(token.group()) or 0.1)
        if token.group() not in SIGNS and 0.0 < float(token.group()) <= FLOOR:
            continue
        told = f"{' '.join(text.splitlines()[line - 1].split())}: {token.group().strip()} -> {new.strip()}"
        made.append(Mutant(line, *token.span(), new, told))
    return made
