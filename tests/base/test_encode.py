"""Each encoder gives a text that its language reads back as the very text, or shows, and that it never obeys."""

import ast
import csv
import json
import os
import shutil
import subprocess
import tomllib
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from rover_pin.base.encode import (
    c_comment,
    c_string,
    comment,
    csv_cell,
    figure_text,
    html_text,
    printable,
    printable_lines,
    python_docstring,
    python_string,
    script_json,
    shell_line,
    shell_word,
    toml_string,
    xml,
    xml_text,
)
from tests.hostile import ALL, CANARY, PIECES, Page, assert_harmless_text

TEXTS = [*PIECES.values(), ALL, "".join(map(chr, range(256))), "", "\\", "\\\\", '"', "*", "**/", "/*/", "*//*"]
NO_HALF = [text for text in TEXTS if "\ud83e" not in text]


@pytest.mark.parametrize("text", TEXTS)
def test_terminal_shows_and_does_not_obey(text):
    assert_harmless_text(printable(text))
    assert "\n" not in printable(text)
    assert_harmless_text(printable_lines(text))
    assert printable_lines(text).count("\n") == text.count("\n")


def test_what_can_be_printed_stays_as_it_is():
    for text in ("Роверь 月面車", "soil.k = 5 mm, 30°", "a b", "[bold] $x$ <b>"):
        assert printable(text) == text


@pytest.mark.parametrize("text", TEXTS)
def test_python_reads_the_text_back(text):
    assert ast.literal_eval(python_string(text)) == text
    tree = ast.parse(f'"""A name: {python_docstring(text)}"""\nx = 1  # {comment(text)}\n')
    assert len(tree.body) == 2
    assert ast.get_docstring(tree, clean=False) == f"A name: {printable_lines(text)}"


@pytest.mark.parametrize("text", NO_HALF)
def test_toml_reads_the_text_back(text):
    lines = f"value = {toml_string(text)}  # {comment(text)}\n[table]\n{toml_string(text)} = 1\n"
    assert tomllib.loads(lines) == {"value": text, "table": {text: 1}}


def test_toml_of_half_a_pair_is_toml():
    assert tomllib.loads(f"a = {toml_string(PIECES['half of a pair'])}")["a"] == "\ufffd"


@pytest.mark.parametrize("text", TEXTS)
def test_html_and_xml_hold_the_text_and_nothing_else(text):
    page = Page(f"<p title=\"{html_text(text)}\" lang='{html_text(text)}'>{html_text(text)}</p>")
    assert page.elements == {"p"}
    assert page.attributes == {"title", "lang"}
    assert unescape(html_text(text)) == printable_lines(text)
    element = ElementTree.fromstring(f"<p title=\"{xml(text)}\" lang='{xml(text)}'>{xml(text)}</p>")
    assert {*element.attrib.values(), element.text or ""} == {printable(text)}
    paragraph = ElementTree.Element("p", title=xml_text(text))
    read = ElementTree.fromstring(ElementTree.tostring(paragraph))
    assert read.get("title") is not None


@pytest.mark.parametrize("text", TEXTS)
def test_a_script_holds_the_text_as_data(text):
    page = Page(f'<script type="application/json">{script_json({"name": text})}</script>')
    assert page.elements == {"script"}
    assert json.loads("".join(page.scripts)) == {"name": text}


def test_a_shell_reads_each_text_as_one_word(tmp_path):
    words = [text for text in NO_HALF if "\0" not in text]
    line = f"printf %s\\\\0 {shell_line(words)}"
    assert line.isprintable()
    done = subprocess.run(["bash", "-c", line], capture_output=True, check=True, cwd=tmp_path)
    assert done.stdout.decode().split("\0")[:-1] == words
    assert not os.listdir(tmp_path)


def test_a_path_is_no_option():
    assert shell_word(Path("-rf")) == "./-rf"
    assert shell_word("--out") == "--out"


def test_a_table_reads_one_cell_for_each_name():
    assert next(csv.reader([",".join(map(csv_cell, NO_HALF))])) == [printable(text) for text in NO_HALF]


def test_a_figure_shows_every_letter():
    figure = Figure()
    text = figure.text(0, 0, figure_text(PIECES["mathtext"]))
    figure.canvas.draw()
    assert text.get_window_extent().width > 0


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_c_and_cpp_hold_the_text(tmp_path):
    rows = [f"  {{{c_string(text)}, {len(text.encode())}}}, /* {c_comment(text)} */" for text in NO_HALF]
    source = "\n".join(
        ["#include <stdio.h>", "static const struct { const char *text; int size; } ROWS[] = {", *rows, "};",
         "int main(void) {", "  unsigned i;",
         "  for (i = 0; i < sizeof ROWS / sizeof ROWS[0]; ++i) fwrite(ROWS[i].text, 1, ROWS[i].size, stdout);",
         "  return 0;", "}", ""]
    )  # fmt: skip
    for name, flags in (("x.c", ["-std=c11"]), ("x.cpp", ["-std=c++17", "-x", "c++"])):
        (tmp_path / name).write_text(source)
        program = str(tmp_path / "x")
        command = ["cc", *flags, "-Wall", "-Werror", "-Wtrigraphs", "-trigraphs", str(tmp_path / name), "-o", program]
        subprocess.run(command, check=True, cwd=tmp_path)
        done = subprocess.run([tmp_path / "x"], capture_output=True, check=True, cwd=tmp_path)
        assert done.stdout.decode() == "".join(NO_HALF)
    assert not (tmp_path / CANARY).exists()
