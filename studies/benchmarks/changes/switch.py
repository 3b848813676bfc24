"""All changes of C functions in one library: each function once for every change, and a number that says which runs.

So the compiler is asked once, not once a change. The number stands at a place in memory that a fork has a copy of.
"""

from __future__ import annotations

import ctypes
import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from changes.python import Mutant

HEAD = re.compile(r"^(?:static |int |void |integer )[^;{}=#]*?(\w+)\(([^;{}=]*)\) {", re.MULTILINE)
"""A function's first line, its name and its arguments."""
NAME = re.compile(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$")
SIZE = re.compile(r"\bdouble \w+\[[^\]\n]*\Z")
"""Ends where an array's size is declared: changed, it may be none, and nothing compiles."""
CHOSEN = ctypes.c_int64(0)
"""Which change runs; 0: none."""


class Function(NamedTuple):
    """Where a function stands in a text: its begin, its name's span, its body's begin, its end."""

    begin: int
    name: tuple[int, int]
    body: int
    end: int
    arguments: str


def functions(text: str) -> list[Function]:
    """Return the functions of a text whose bodies end with the line or with a brace at a line's begin."""
    found = []
    for head in HEAD.finditer(text):
        line = text.index("\n", head.end())
        end = line if text[line - 1] == "}" else text.index("\n}", head.end()) + 2
        found.append(Function(head.start(), head.span(1), head.end(), end, head.group(2)))
    return found


def switched(text: str, changes: Sequence[tuple[int, Mutant]]) -> tuple[str, set[int]]:
    """Return a text in which each numbered change runs where `CHOSEN` is its number, and the numbers that are in it."""
    parts, numbers, at = [], set(), 0
    for one in functions(text):
        inside = [
            each for each in changes if one.body <= each[1].start < one.end and not SIZE.search(text, 0, each[1].start)
        ]
        if not inside:
            continue
        parts += [text[at : one.begin], _named(text, one, 0, None)]
        parts += [_named(text, one, number, change) for number, change in inside]
        parts.append(_choice(text, one, [number for number, _ in inside]))
        numbers |= {number for number, _ in inside}
        at = one.end
    return "".join([*parts, text[at:]]), numbers


def _named(text: str, one: Function, number: int, change: Mutant | None) -> str:
    """Return a function under a name of its own, changed."""
    end = one.name[1]
    rest = text[end : one.end]
    if change:
        rest = text[end : change.start] + change.new + text[change.end : one.end]
    return f"{text[one.begin : end]}__{number}{rest}\n"


def _choice(text: str, one: Function, numbers: Sequence[int]) -> str:
    """Return the function that calls the one that was chosen."""
    names = [NAME.search(each.strip()) for each in one.arguments.split(",")]
    given = ", ".join(each.group(1) for each in names if each and each.group(1) != "void")
    name = text[slice(*one.name)]
    place = f"*(volatile long long *){ctypes.addressof(CHOSEN)}"
    cases = "".join(f" case {number}: return {name}__{number}({given});" for number in numbers)
    return f"{text[one.begin : one.body]} switch ({place}) {{{cases} default: return {name}__0({given}); }} }}"


@functools.cache
def builds(test: Path) -> bool:
    """Return whether a file's tests compile a step of their own: that would hold all changes."""
    return "native.source()" in test.read_text()


def built(changes: Sequence[tuple[Path, Mutant]]) -> dict[tuple[str, Mutant], int]:
    """Let the loaded package step by a library that holds these changes; return their numbers, by name of file."""
    from rover_pin.motion import native, toolchain
    from rover_pin.motion.native.library import library

    texts, known = dict[str, str](), dict[tuple[str, Mutant], int]()
    numbered = [(number, path, one) for number, (path, one) in enumerate(changes, 1)]
    for path in sorted({path for path, _ in changes}):
        here = [(number, one) for number, other, one in numbered if other == path]
        texts[path.name], inside = switched(path.read_text(encoding="latin-1"), here)
        known |= {(path.name, one): number for number, one in here if number in inside}
    plain, usual = native._text, toolchain.FLAGS
    native._text = lambda name: texts.get(name) or plain(name)
    native._text.plain = plain
    toolchain.FLAGS = ("-O1", *usual[1:])
    library.cache_clear()
    library()
    toolchain.FLAGS = usual
    return known
