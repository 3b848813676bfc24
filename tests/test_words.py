"""Names and docstrings of the package speak the field's language: the words of `glossary.toml` stay out."""

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
GLOSSARY = tomllib.loads((ROOT / "tests" / "glossary.toml").read_text(encoding="utf-8"))
FILES = sorted((ROOT / "rover_pin").rglob("*.py"))
EMPTY_SHARE = 0.002
"""Of all bound names; what is left is `other` of `__eq__`, and fields that are keys of files."""
LONGEST_TEST_NAME = 60


def bound_names(tree):
    """Yield every argument and every name that is assigned."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def defined_names(tree):
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    yield from bound_names(tree)
    yield from (node.name for node in ast.walk(tree) if isinstance(node, kinds))


def test_no_name_has_a_private_word():
    banned = set(GLOSSARY["identifiers"])
    private = {
        (path.name, name)
        for path in FILES
        for name in set(defined_names(ast.parse(path.read_text(encoding="utf-8"))))
        if set(name.lower().split("_")) & banned
    }
    assert not private, "see tests/glossary.toml"


def test_local_names_say_what_they_hold():
    names = [name for path in FILES for name in bound_names(ast.parse(path.read_text(encoding="utf-8")))]
    empty = [name for name in names if name in GLOSSARY["locals"]["empty"]]
    assert len(empty) <= EMPTY_SHARE * len(names), sorted(set(empty))


def test_no_function_is_named_by_a_participle_alone():
    """A function is a verb with its object or the noun that it returns; a property may be an adjective."""
    words = GLOSSARY["functions"]
    bare = [
        (path.name, node.name)
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        and not any("property" in ast.unparse(each) for each in node.decorator_list)
        if (name := node.name.strip("_")) in words["participles"] or re.fullmatch("[a-z]+ed", name)
        if name not in words["words"]
    ]
    assert not bare


def test_docstrings_and_messages_have_no_private_phrase():
    text = {path: re.sub(r"\s+", " ", path.read_text(encoding="utf-8")) for path in FILES}
    found = {(path.name, phrase) for path in FILES for phrase in GLOSSARY["phrases"] if phrase in text[path]}
    assert not found


def test_names_of_tests_are_short():
    text = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("test_*.py")))
    long = [name for name in re.findall(r"^\s*def (test_\w+)", text, re.MULTILINE) if len(name) > LONGEST_TEST_NAME]
    assert not long
