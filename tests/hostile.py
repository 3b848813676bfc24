"""Names that mean something to a language into which they may be written, and a check that none of them was obeyed."""

import ast
import json
import tomllib
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

CANARY = "pwned"
"""A file of this name in the working directory, or an element of this name in a page: a text was executed."""
PIECES = {
    "quotes": "\"\"\" ''' \" ' ` “ « ",
    "python": f'"""\nopen(\'{CANARY}\', \'w\').close()\n"""',
    "python in quotes": f"'; open('{CANARY}', 'w').close(); '",
    "import": f"'; import os; os.system('touch {CANARY}'); '",
    "c comment": f'*/ #include "{CANARY}" /*',
    "c code": f'*/ static int x = system("touch {CANARY}"); /*',
    "c string": f'"; system("touch {CANARY}"); "',
    "backslashes": "C:\\users\\new\\",
    "backslash at the end": "rig\\",
    "control": "\x1b[2J\x1b]0;title\x07\x08\x7f\x9b31m",
    "newlines": "one\ntwo\r\nthree\x0bfour\x85five\u2028six",
    "right to left": "\u202egpj.exe \u200f \u2066\u2069",
    "html": f"<{CANARY} onload=x></script><script>{CANARY}()</script><!-- ]]> & &amp; '\" onmouseover=x",
    "format": "%s %n {x} {0} {} %(x)s {{",
    "shell": f"$(touch {CANARY}) `touch {CANARY}`; touch {CANARY} | & > {CANARY}\n",
    "options": "--help",
    "mathtext": "$x$ $\\frac$ $",
    "markup": "[bold red]x[/] :smile: [link=file:///]",
    "toml": f'x"\n[table]\n{CANARY} = """',
    "long": 300 * "a",
    "scripts": "Роверь 月面車 الروبوت 🤖",
    "half of a pair": "\ud83e",
    "nothing but a hash": "#",
    "trigraph": "??/ ??' ??!",
    "nul": "a\0b",
}
"""Texts by what reads them."""
ALL = " ".join(text for name, text in PIECES.items() if name not in ("nul", "half of a pair", "long"))
"""One name with all of them that a TOML can hold, without the longest, behind which a cut would hide others."""
IN_XML = "".join(letter for letter in ALL if letter in "\t\n" or (letter >= " " and letter not in "\x7f\x85\x9b\u2028"))
AS_FILE = ALL.replace("/", "_").replace("\n", "_")[:200]
"""The same as the name of a file or folder."""


class Page(HTMLParser):
    """Collects the elements and scripts of a page."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.attributes, self.scripts = set(), set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.add(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_data(self, data):
        if self.cdata_elem == "script":
            self.scripts.append(data)


def assert_harmless_text(text):
    """No character of a printed text is obeyed by a terminal."""
    odd = {letter for letter in text if letter != "\n" and not (letter.isprintable() or letter in "\xa0\u202f\u2009")}
    assert not odd, (odd, text[:500])
    assert "Traceback" not in text


def assert_harmless_files(folder: Path):
    """Every file below a folder is what its suffix says, and holds the hostile name as text."""
    for file in (path for path in folder.rglob("*") if path.is_file()):
        if file.suffix in (".py", ".toml", ".json", ".html", ".xml", ".urdf", ".h", ".c", ".cpp", ".txt"):
            check_text(file.name, file.suffix, file.read_text(encoding="utf-8"))
        if file.suffix == ".fmu":
            with zipfile.ZipFile(file) as unit:
                for name in unit.namelist():
                    if name.endswith((".xml", ".c", ".h")):
                        check_text(name, Path(name).suffix, unit.read(name).decode())


def check_text(name, suffix, text):
    if suffix == ".py":
        tree = ast.parse(text, name)
        calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
        called = {function.id for function in calls if isinstance(function, ast.Name)}
        imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        assert not called & {"open", "eval", "exec"}
        assert "os" not in imported
    elif suffix == ".toml":
        assert CANARY not in _keys(tomllib.loads(text))
    elif suffix == ".json":
        json.loads(text)
    elif suffix in (".xml", ".urdf"):
        tags = {element.tag for element in ElementTree.fromstring(text.encode()).iter()}
        assert CANARY not in tags
    elif suffix == ".html":
        page = Page(text)
        assert CANARY not in page.elements
        assert not page.attributes & {"onmouseover"}
        assert not any(f"{CANARY}()" == script.strip() for script in page.scripts)


def _keys(table):
    inner = (value for value in table.values() if isinstance(value, dict))
    return {*table, *(key for child in inner for key in _keys(child))}
