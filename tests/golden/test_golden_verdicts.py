"""The loop's answers stay what they were when they were frozen: a change of one is to be explained by a rule."""

import json
import re

import pytest

from tests.golden import verdicts as golden

FROZEN = json.loads(golden.FROZEN.read_text(encoding="utf-8"))
SHIFT = 0.15
"""Share of a 95 % interval's width by which a value, or one of its ends, may move: round-off, another time step."""
GROWTH = {"rig": 0.1, "cmu": 0.1, "drive": 0.5}
"""Relative change that a held-out error may show; a drive log is simulated anew, so another step is other data."""
SETS = [*golden.FAST, *(pytest.param(name, marks=pytest.mark.nightly) for name in golden.SLOW)]


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_the_answer_is_the_frozen_one(name, tmp_path):
    frozen, now = FROZEN[name], golden.answer(name, tmp_path / "set")
    for key in ("answer", "effects", "alike"):
        assert now[key] == frozen[key]
    assert now["sizes"].keys() == frozen["sizes"].keys()
    for key, (value, low, high) in frozen["sizes"].items():
        assert now["sizes"][key] == pytest.approx([value, low, high], abs=SHIFT * (high - low)), key
    for key, errors in frozen["held_out"].items():
        assert now["held_out"][key] == pytest.approx(errors, rel=GROWTH[re.split("[- ]", name)[0]]), key


def test_every_set_is_frozen():
    assert set(FROZEN) == set(golden.MAKERS)
