"""Every effect, found by looking, has a name and a meaning for readers; what has none is still called something."""

import pytest

from rover_pin.simulation.model.effect_files import package_effects, user_effects

KINDS = package_effects()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_effect_has_a_human_name_and_a_meaning_in_one_line(kind):
    assert "title" in vars(kind)
    assert 3 < len(kind.title) <= 40
    assert kind.title == kind.title.lower()  # words, no class name
    assert "meaning" in vars(kind)
    assert 20 < len(kind.meaning) <= 100  # fits a line
    assert kind.meaning[0].islower()  # it follows "because"
    assert kind.meaning[-1] not in ".;:"
    assert "\n" not in kind.title + kind.meaning


@pytest.mark.parametrize("acts", ["contact", "motor", "body"])
def test_a_new_effect_begins_with_both(run, acts):
    run("new-effect", "StickySoil", "--acts", acts)
    (kind,) = user_effects("sticky_soil.py")
    assert len(kind.title) > 3
    assert len(kind.meaning) > 10
