"""The public names: each shows an example that runs and prints what it says, and says what it takes and returns.

What pages and notebooks import besides is public, too: their code, which tests of both run, is its example.
"""

import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

import rover_pin

DATA = {"SOILS", "__version__"}
SLOW = {"close_the_loop", "identify"}
"""Their examples take seconds; the README's example closes the same loop in every run."""
NAMES = sorted(set(rover_pin.__all__) - DATA)
FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(rover_pin, name))]


ROOT = Path(__file__).parents[1]
IMPORTED = sorted({
    (module, name)
    for path in [*ROOT.glob("docs/*.md"), *ROOT.glob("notebooks/*.ipynb")]
    for module, names in re.findall(r"from (rover_pin\.[\w.]+) import ([\w, ]+)", path.read_text(encoding="utf-8"))
    for name in names.split(", ")
})  # fmt: skip


def section(name, heading):
    """What a docstring has under a heading of numpydoc."""
    text = inspect.getdoc(getattr(rover_pin, name))
    match = re.search(rf"^{heading}\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in NAMES]
)
def test_its_examples_come_out(name, monkeypatch):
    monkeypatch.chdir(ROOT)
    thing = getattr(rover_pin, name)
    module = __import__(thing.__module__, fromlist=["x"])
    examples = [
        example_test
        for example_test in doctest.DocTestFinder().find(thing, name, globs=vars(module).copy())
        if example_test.examples
    ]
    assert examples, f"{name} shows no example"
    for example_test in examples:
        assert doctest.DocTestRunner().run(example_test).failed == 0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_says_what_it_takes_and_returns(name):
    documented = section(name, "Parameters")
    named = {
        word
        for line in re.findall(r"^([\w*][\w, *]*?)(?: : .*)?$", documented, re.MULTILINE)
        for word in line.split(", ")
    }
    parameters = inspect.signature(getattr(rover_pin, name)).parameters.values()
    taken = {f"{'**' if parameter.kind is parameter.VAR_KEYWORD else ''}{parameter.name}" for parameter in parameters}
    assert named == taken
    assert section(name, "Returns").strip()
    assert section(name, "Examples").strip()


@pytest.mark.parametrize(("module", "name"), IMPORTED)
def test_what_pages_import_says_what_it_takes(module, name):
    thing = getattr(importlib.import_module(module), name)
    if inspect.isfunction(thing):
        assert set(inspect.signature(thing).parameters) <= set(re.findall(r"\w+", inspect.getdoc(thing)))
