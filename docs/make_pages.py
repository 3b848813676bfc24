"""Pages of the site that are made, not written: the catalogue, numbers, rooms, commands, public names, and notebooks.

A line `<!-- file: PATH -->` in a page becomes that file, `<!-- rooms -->` what the rooms of the package say,
`<!-- contradictions -->` the strict expected failures of `tests/paper`, `<!-- commands -->` each command's example,
`<!-- gallery -->` the pictures of scenarios.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import deciding
from mkdocs.structure.files import File, Files

from rover_pin.base.settings import Setting
from rover_pin.cli.app import app
from rover_pin.cli.terminal import fact, format_value, limits_of
from rover_pin.scenarios import catalogue
from rover_pin.version import __version__

ROOT = Path(__file__).parents[1]
PROSE = ("meaning", "acts")


def on_config(config: Any) -> Any:
    """List the pages of the Python reference, one for each room of the package, in the navigation. Print the version of
    the package in the footer of every page.
    """
    config.copyright = f"rover_pin {__version__}"
    reference = next(section["Reference"] for section in config.nav if "Reference" in section)
    (entry,) = (entry for entry in reference if list(entry.values()) == ["api.md"])
    entry.update(
        {title: [{"All names": "api.md"}, *({room: f"api/{room}.md"} for room in _public_names())] for title in entry}
    )
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made."""
    pages: dict[str, str | bytes] = {
        "catalogue/scenarios.md": _entries("Scenarios", catalogue.scenarios(), "rover-pin drive {}"),
        "catalogue/soils.md": _entries("Soils", catalogue.soils(), "rover-pin drive ditch --soil {}"),
        "catalogue/rovers.md": _entries("Rovers", catalogue.rovers(), "rover-pin drive flat --set rover={}"),
        "catalogue/effects.md": _entries("Effects", catalogue.effects(), "rover-pin drive ditch --add {}"),
        "catalogue/settings.md": _settings(),
        "catalogue/numbers.md": deciding.page(),
        **_api(),
        "commands.md": _commands(),
    }
    for notebook in sorted((ROOT / "notebooks").glob("*.ipynb")):
        pages |= _notebook(notebook)
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put files, and what is made, where a page asks for them."""
    markdown = re.sub(r"<!-- file: (.+?) -->", lambda found: (ROOT / found[1]).read_text(encoding="utf-8"), markdown)
    for name, made in MADE.items():
        markdown = markdown.replace(f"<!-- {name} -->", made()) if f"<!-- {name} -->" in markdown else markdown
    return markdown


def on_page_content(html: str, **_: Any) -> str:
    """Keep an option in one piece where a line of code is wrapped: browsers break a line after a hyphen. Let browsers
    break a path or the name of a module after a slash or a dot, so that a narrow table does not cut its words.
    """
    option = r"(?<![\w&;-])(--?[a-z][\w-]*)"
    code = re.compile(r"(<code[^>]*>)(.*?)(</code>)", re.DOTALL)
    html = code.sub(
        lambda found: found[1] + _marked(option, r'<span class="option">\1</span>', found[2]) + found[3], html
    )
    separator = r"(?<=[a-z_])([/.])(?=[a-z_]{2})"
    outside_blocks = re.compile(r"<pre.*?</pre>|<code[^>]*>.*?</code>", re.DOTALL)
    return outside_blocks.sub(
        lambda found: found[0] if found[0].startswith("<pre") else _marked(separator, r"\1<wbr>", found[0]), html
    )


def _marked(pattern: str, mark: str, html: str) -> str:
    """Replace what is found in the text between tags."""
    parts = re.split(r"(<[^>]+>)", html)
    return "".join(part if part.startswith("<") else re.sub(pattern, mark, part) for part in parts)


def _entries(title: str, entries: list[Any], command: str) -> str:
    parts = [f"# {title}\n\nMade from the package, as `rover-pin list {title.lower()}` prints it.\n"]
    for each in entries:
        example = "" if each.facts.get("acts") == "sensor" else f"\n\n`{command.format(each.name)}`"
        title = f"{each.name}: {each.facts['title']}" if each.facts.get("title") else each.name
        parts.append(f"\n## {_plain(title)}\n\n{_plain(each.summary)}.{example}\n")
        for name, value in each.facts.items():
            if name not in ("file", "title", "package") and (value or value == 0):
                words, said = fact(name, value).split(": ", 1)
                parts.append(f"\n- {words}: {_plain(said) if name in PROSE else _code(said)}")
        parts.append(f"\n\n{_table(each.numbers)}\n" if each.numbers else "\n")
    return "".join(parts)


def _notebook(path: Path) -> dict[str, str | bytes]:
    """Return the page of a notebook as it is stored, outputs included, and its pictures, by their names in the site."""
    from nbconvert import MarkdownExporter

    text, resources = MarkdownExporter().from_filename(str(path), resources={"unique_key": path.stem})
    return {f"notebooks/{name}": page for name, page in {f"{path.stem}.md": text, **resources["outputs"]}.items()}


def _settings() -> str:
    kinds = {"none": "a constant duty", "eq9": "the slip control", "turn": "a turn"}
    parts = [
        "# Settings\n\n`--set NAME=VALUE`, or `scenario(name, **{NAME: VALUE})`; a value may have its unit, as `5mm`, "
        "`30deg`. Of the scenario `ditch`; `rover-pin list settings SCENARIO` prints those of any other.\n"
    ]
    for control, words in kinds.items():
        settings = catalogue.settings("ditch", control=control)
        chosen = settings if control == "none" else [each for each in settings if each.name.startswith("control.")]
        parts.append(f"\n## With {words} (`control={control}`)\n\n{_table(chosen)}\n")
    return "".join(parts)


def _table(numbers: Any) -> str:
    rows = ["| name | default | allowed | from |", "| --- | --- | --- | --- |"]
    rows += [f"| `{each.name}` | {_default(each)} | {limits_of(each)} | {_plain(each.source)} |" for each in numbers]
    return "\n".join(rows)


def _default(setting: Setting) -> str:
    return _plain(format_value(setting.value, setting.unit))


def _code(text: str) -> str:
    return f"`{text.replace('`', '')}`"


def _plain(text: str) -> str:
    """Return text whose signs mean nothing to Markdown."""
    return re.sub(r"([\\`*_{}\[\]<>|])", r"\\\1", text) if "`" not in text else text.replace("|", "\\|")


def _rooms() -> str:
    """Return the rooms in the order of the test that holds it, with what each says of itself."""
    tree = ast.parse((ROOT / "tests" / "test_architecture.py").read_text(encoding="utf-8"))
    rooms = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "ROOMS"
    )
    parts = []
    for room in rooms:
        home = ROOT / "rover_pin" / room
        file = home / "__init__.py" if home.is_dir() else home.with_suffix(".py")
        if file.is_file():
            said = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            name = file.relative_to(ROOT).as_posix().removesuffix("/__init__.py")
            parts.append(f"- **`{name}`**: {' '.join(_plain(said).split())}\n")
    return "".join(parts)


def _public_names() -> dict[str, dict[str, str]]:
    """Return room -> path of an object -> the name by which a page imports it, for all documented names.

    These are the names that `rover_pin` itself has, and the names that pages and notebooks import from its modules.
    """
    import rover_pin

    found = {(f"rover_pin.{home}", name): "rover_pin" for home, names in rover_pin._HOMES.items() for name in names}
    pages = [*ROOT.glob("docs/*.md"), *ROOT.glob("notebooks/*.ipynb"), ROOT / "README.md"]
    for path in sorted(pages):
        for module, names in re.findall(r"from (rover_pin\.[\w.]+) import ([\w, ]+)", path.read_text(encoding="utf-8")):
            for name in names.split(", "):
                found.setdefault((module, name), module)
    rooms: dict[str, dict[str, str]] = {}
    for (module, name), source in found.items():
        thing = getattr(importlib.import_module(module), name)
        # A name may be imported from the room, but is defined in a file of it.
        is_object = inspect.isclass(thing) or inspect.isfunction(thing)
        home = thing.__module__ if is_object else module
        rooms.setdefault(home.split(".")[1], {}).setdefault(f"{home}.{name}", source)
    return {room: dict(sorted(rooms[room].items())) for room in sorted(rooms)}


def _first_sentence(thing: Any) -> str:
    """Return the first sentence of the docstring of a class or function; constants and types have no docstring."""
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        return ""
    paragraph = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    return re.split(r"\.(?:\s|$)", paragraph)[0]


def _said_below(module: str, name: str) -> str:
    """Return the first sentence of the text that stands below the assignment of a constant in its module."""
    body = ast.parse(inspect.getsource(importlib.import_module(module))).body
    for assignment, below in itertools.pairwise(body):
        targets = assignment.targets if isinstance(assignment, ast.Assign) else [getattr(assignment, "target", None)]
        is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        if is_text and name in {getattr(target, "id", "") for target in targets}:
            return re.split(r"\.(?:\s|$)", " ".join(str(below.value.value).split()))[0]
    return ""


def _api() -> dict[str, str]:
    """Return the pages of the Python reference: a table of all names, and one page for each room of the package."""
    rows = ["| Name, imported from | What it is |", "| --- | --- |"]
    pages = {}
    for room, names in _public_names().items():
        said = inspect.getdoc(importlib.import_module(f"rover_pin.{room}")) or ""
        listed = "\n\n".join(f"::: {path}" for path in names)
        pages[f"api/{room}.md"] = f"# {room}\n\n{_plain(' '.join(said.split()))}\n\n{listed}\n"
        for path, source in names.items():
            module, _, name = path.rpartition(".")
            thing = getattr(importlib.import_module(module), name)
            said = _plain(_first_sentence(thing) or _said_below(module, name) or "a constant")
            rows.append(f"| [`{name}`](api/{room}.md#{path})<br>from `{source}` | {said} |")
    introduction = (
        "# Python\n\nThe names that `rover_pin` itself has are loaded on first use. All other names are imported from "
        "their own modules, as [the examples](python.md) show. Each room of the package has its page. The search field "
        "finds names and words of the docstrings.\n\n"
    )
    return {"api.md": introduction + "\n".join(rows) + "\n", **pages}


def _commands() -> str:
    import typer.main

    group = typer.main.get_group(app)
    parts = ["# Commands\n\nAs `rover-pin COMMAND --help` prints them.\n"]
    for name, command in sorted(group.commands.items()):
        context = typer.main.get_command(app).make_context("rover-pin", [name, "--help"], resilient_parsing=True)
        said = command.get_help(type(context)(command, info_name=f"rover-pin {name}", parent=None))
        parts.append(f"\n## {name}\n\n```{{ .text .columns }}\n{said}\n```\n")
    return "".join(parts)


def contradictions() -> Iterator[tuple[str, str, str, str]]:
    """Yield strict expected failures of `tests/paper`: the file's subject, the test's name, its case, the result."""
    for file in sorted((ROOT / "tests" / "paper").glob("test_*.py")):
        subject = file.stem.removeprefix("test_").replace("_", " ")
        for test in ast.parse(file.read_text(encoding="utf-8")).body:
            if not isinstance(test, ast.FunctionDef):
                continue
            said = test.name.removeprefix("test_").replace("_", " ")
            for call in (node for mark in test.decorator_list for node in ast.walk(mark) if isinstance(node, ast.Call)):
                name = getattr(call.func, "attr", getattr(call.func, "id", ""))
                if name == "xfail":
                    (reason,) = (each.value for each in call.keywords if each.arg == "reason")
                    yield subject, said, "", ast.literal_eval(reason)
                elif name in ("differs", "contradicts"):
                    yield subject, said, *(ast.literal_eval(each) for each in call.args)


def _contradictions() -> str:
    rows = ["| Part | The paper says | Form | Measured |", "| --- | --- | --- | --- |"]
    return "\n".join([*rows, *(f"| {' | '.join(map(_plain, row))} |" for row in contradictions())])


def _examples() -> str:
    """Return the first sentence of each command's help, an example below it, and the CPU seconds that this took."""
    import typer.main
    from page_numbers import kept, significant

    group, rows = typer.main.get_group(app), ["| What it does | CPU s |", "| --- | --- |"]
    for line, seconds in kept("times").set_index("command").cpu_s.items():
        paragraph = " ".join((group.commands[line.split()[1]].help or "").split())  # a row of a table is one line
        said = _plain(re.split(r"\.(?:\s|$)", paragraph)[0])
        rows.append(f"| {said}<br>`{line}` | {significant(seconds, 2 if seconds >= 1 else 1)} |")
    return "\n".join(rows)


def _gallery() -> str:
    """Return the pictures of the gallery, each with its command, what is in it and what becomes of the rover."""
    import sys

    sys.path.insert(0, str(ROOT / "studies"))
    from gallery import PICTURES
    from page_numbers import kept

    outcomes = kept("gallery").set_index("command").outcome
    summaries = {each.name: _plain(each.summary) for each in catalogue.scenarios()}
    parts = []
    for picture, words in PICTURES.items():
        name, command = words.split()[0], f"rover-pin drive {words}"
        said = f"{summaries[name]}: {outcomes[command]}"
        parts.append(f"## {name.replace('-', ' ')}\n\n`{command}`\n\n![{said}]({picture})\n\n{said}.\n")
    return "\n".join(parts)


MADE: dict[str, Callable[[], str]] = {
    "rooms": _rooms,
    "contradictions": _contradictions,
    "commands": _examples,
    "gallery": _gallery,
}
