"""Every effect, found by looking, has a name and a meaning for readers; what has none is still called something."""

import pytest

from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.names import display_name, meaning_of, title_of
from rover_pin.effects.weak_motor import WeakMotor
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


def test_no_two_effects_share_name_or_meaning():
    assert len({kind.title for kind in KINDS}) == len({kind.meaning for kind in KINDS}) == len(KINDS)


def test_unnamed_effect_is_titled_by_its_class_and_docstring():
    class StickyRim(WeakMotor):
        """Soil sticks to the rim.

        More of it.
        """

        title, meaning = "", ""

    assert title_of(StickyRim) == "sticky rim"
    assert meaning_of(StickyRim) == "Soil sticks to the rim"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("HardPatch@1.2", "patch of other soil at x = 1.2 m"),
        ("WeakMotor[2]", "weak motor (2)"),
        ("WeakMotor[2] + HardPatch@-0.1", "weak motor (2) + patch of other soil at x = -0.1 m"),
        ("soil.k", "soil.k"),
        ("Unknown[1]", "Unknown[1]"),
    ],
)
def test_candidates_are_spoken_of_by_name_and_place(name, said):
    assert display_name(name, (HardPatch, WeakMotor)) == said


@pytest.mark.parametrize("acts", ["contact", "motor", "body"])
def test_a_new_effect_begins_with_both(run, acts):
    run("new-effect", "StickySoil", "--acts", acts)
    (kind,) = user_effects("sticky_soil.py")
    assert len(kind.title) > 3
    assert len(kind.meaning) > 10
