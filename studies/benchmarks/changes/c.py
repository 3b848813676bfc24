"""All changes of a C file, one at a time: operators, constants, thresholds, comparisons, names."""

from __future__ import annotations

import math
import re

from changes.python import FLOOR, Mutant

SIGNS = {" + ": " - ", " * ": " / ", " < ": " >= ", " > ": " <= ", " && ": " || ", " += ": " -= ", " == ": " != ",
         "fmin(": "fmax(", "sin(": "cos(", "larger(": "smaller("}  # fmt: skip
SIGNS |= {other: sign for sign, other in SIGNS.items()} | {"= -": "= ", "return -": "return "}
NUMBER = r"\b\d+\.\d*(?:e-?\d+)?|\b\d+e-?\d+|(?<= / )\d+\b|(?<=#define MOST_STEPS )\d+"
"""Whole numbers only where one divides or bounds: elsewhere they are places and counts."""
TOKEN = re.compile("|".join([re.escape(sign) for sign in sorted(SIGNS, key=len, reverse=True)] + [NUMBER]))
HIDDEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|^\s*#(?!define \w+ [\d.])[^\n]*|_Static_assert[^\n]*|\"[^\"\n]*\"|for \([^{\n]*"
    r"|^static [^\n(]*\(|\[[^\[\]]*MAX_[^\[\]]*\]|_Alignas[^=;]*;",
    re.DOTALL | re.MULTILINE,
)
"""Comments, directives but for named numbers, strings, the heads of functions and loops, and the room of arrays."""


def changes(text: str) -> list[Mutant]:
    """Return all changes of a C text."""
    code = HIDDEN.sub(lambda found: re.sub(r"[^\n]", "~", found.group()), text)
    made = []
    for token in TOKEN.finditer(code):
        line = text.count("\n", 0, token.start()) + 1
        new = SIGNS.get(token.group()) or _other(token.group())
        if token.group() not in SIGNS and 0.0 < float(token.group()) <= FLOOR:
            continue
        told = f"{' '.join(text.splitlines()[line - 1].split())}: {token.group().strip()} -> {new.strip()}"
        made.append(Mutant(line, *token.span(), new, told))
    return made


def _other(number: str) -> str:
    """Return a number that is a tenth more, whole where it was."""
    return str(math.ceil(1.1 * int(number))) if number.isdigit() else repr(1.1 * float(number) or 0.1)
