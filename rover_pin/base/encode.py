"""Functions that make a text safe to write into another language: one function for each language.

A rover's name, a column's name, a folder's name or an option is data, and may hold quotes, `*/`, `</script>` or an
escape character. Every such text passes through the function of its language before it is written into Python, C, XML,
TOML, HTML, a shell line or onto the terminal. This program never executes source code that it has written.
"""

import html
import json
import re
import shlex
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import PurePath
from unicodedata import category

XML_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not allow, not even as a reference such as `&#27;`."""


def printable(text: str) -> str:
    r"""Escape the control characters of a text, so that a terminal shows them instead of obeying them.

    Control characters here are ESC, BEL, newline and similar characters, marks that change the direction of writing,
    and halves of a surrogate pair. Letters of all scripts stay unchanged.

    Examples
    --------
    >>> print(printable("run\x1b[31m 1\n"))
    run\x1b[31m 1\n
    """
    shown = (letter if letter.isprintable() or category(letter) == "Zs" else ascii(letter)[1:-1] for letter in text)
    return "".join(shown)


def printable_lines(text: str) -> str:
    """Escape all control characters of a text except its newlines."""
    return "\n".join(map(printable, text.split("\n")))


def python_string(text: str) -> str:
    """Return a string literal of Python for a text, quotes included; control characters are escaped."""
    return repr(text)


def python_docstring(text: str) -> str:
    """Return a text for use inside a Python docstring in triple double quotes. Quotes and backslashes are escaped."""
    return printable_lines(text).replace("\\", "\\\\").replace('"', '\\"')


def comment(text: str) -> str:
    """Return a text for a one-line comment of Python, TOML, CMake or a shell; newlines in the text are escaped."""
    return printable(text)


def c_comment(text: str) -> str:
    """Return a text for use inside a C or C++ comment `/* */`. The marks `/*` and `*/` in the text are broken up by a
    blank.
    """
    return printable(text).replace("*/", "* /").replace("/*", "/ *").rstrip("*")


def c_string(text: str) -> str:
    """Return a string literal of C and C++, quotes included, whose bytes are the text in UTF-8.

    An octal escape has at most three digits, so a digit of the text after an escape is not read as part of the escape.
    A question mark is escaped, because two question marks begin a trigraph.
    """
    plain = {byte: chr(byte) for byte in range(32, 127)} | {ord(c): f"\\{c}" for c in '"\\?'}
    return '"' + "".join(plain.get(byte, f"\\{byte:03o}") for byte in text.encode("utf-8", "backslashreplace")) + '"'


def xml_text(text: str) -> str:
    """Return a text without the characters that XML forbids. An XML library must then escape `<` and `&` itself."""
    return XML_ILLEGAL.sub(lambda match: ascii(match[0])[1:-1], text)


def xml(text: str) -> str:
    """Return a text escaped for XML source, between tags or inside an attribute in either kind of quotes."""
    return html.escape(printable(text), quote=True)


def csv_cell(text: str) -> str:
    """Return a text as one cell of a comma-separated table. A text with a comma or a quotation mark is put into
    quotes.
    """
    shown = printable(text)
    return '"' + shown.replace('"', '""') + '"' if any(mark in shown for mark in ',"') else shown


def html_text(text: str) -> str:
    """Return a text escaped for HTML, between tags or inside an attribute in either kind of quotes."""
    return html.escape(printable_lines(text), quote=True)


def figure_text(text: str) -> str:
    """Return a text for a matplotlib figure. Dollar signs are escaped, so that matplotlib reads no part as a
    formula.
    """
    return printable_lines(text).replace("$", r"\$")


@contextmanager
def missing_glyphs_allowed() -> Iterator[None]:
    """Suppress, inside a `with` block, matplotlib's warning about letters that the font lacks.

    matplotlib draws a box for each such letter.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        yield


def script_json(value: object) -> str:
    """Return a value as JSON for use inside an HTML `<script>` element. No text in the value can end the element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def toml_string(text: str) -> str:
    """Return a text as a string of TOML, quotes included; control characters are escaped.

    Half of a surrogate pair, which TOML cannot hold, becomes the replacement character.
    """
    # A string of JSON is also a string of TOML, except for unprintable characters, which follow below.
    letters = json.dumps(text.encode("utf-16", "surrogatepass").decode("utf-16", "replace"), ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in letters)


def shell_word(word: str | PurePath) -> str:
    """Return a text as one quoted word of a shell command, so that a user can copy the command.

    A path that begins with a hyphen gets `./` in front, because a program would read it as an option. Control
    characters are written as in `$'\\033'`, which bash, zsh and ksh convert back.
    """
    text = str(word)
    # `ls` and `cp` of a file named `-r` would take the name for an option.
    if isinstance(word, PurePath) and text.startswith("-"):
        text = f"./{text}"
    if text.isprintable():
        return shlex.quote(text)
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    # File names may hold bytes that are not UTF-8; Python keeps them as surrogates, and they become bytes again here.
    coded = escaped.encode("utf-8", "surrogateescape")
    return "$'" + "".join(chr(byte) if 32 <= byte < 127 else f"\\{byte:03o}" for byte in coded) + "'"


def shell_line(words: Iterable[str | PurePath]) -> str:
    """Return a shell command that consists of these words; words with special characters are put into quotes."""
    return " ".join(map(shell_word, words))
