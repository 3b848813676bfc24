"""The examples in the docstrings of public names: each runs and prints what it says."""

import doctest

import pytest

import rover_pin

SHOWN = {"Model", "SlipControl", "close_the_loop", "convergence", "plain_simulate", "simulate"}
WITHOUT = {"SOILS", "__version__", *SHOWN}
"""Data, and what the README's own examples show, which a test runs too."""
NAMES = sorted(set(rover_pin.__all__) - WITHOUT)


@pytest.mark.parametrize("name", NAMES)
def test_its_examples_come_out(name):
    thing = getattr(rover_pin, name)
    module = __import__(thing.__module__, fromlist=["x"])
    examples = [each for each in doctest.DocTestFinder().find(thing, name, globs=vars(module).copy()) if each.examples]
    assert examples, f"{name} shows no example"
    for each in examples:
        assert doctest.DocTestRunner().run(each).failed == 0
