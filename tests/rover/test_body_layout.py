"""What a rover's TOML may not say, each with its sentence."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.layout import read_layout

URDF = Path(__file__).parents[2] / "urdf"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "nexus6"', 'name = "nexus6', "is not TOML"),
        ('base = "base_link"', "", "'base'.*TOML"),
        ('base = "base_link"', 'bass = "base_link"', "'bass':.*'base'"),
        ("[suspension]", "[suspensions]", "'suspensions':.*'suspension'"),
        ('urdf = "nexus6.urdf"', 'urdf = "nexus7.urdf"', "'nexus7.urdf'.*'urdf'"),
        ('name = "nexus6"', 'name = "nexus6"\nsteering = 1', "is not TOML"),
        ("[differential]", "[differentials]", "unknown key 'differentials'"),
        ('pair = "rocker"', 'pair = "rockers"', "'rockers'.*'rocker'"),
        ('bogie = ["bogie_l", "bogie_r"]', "bogie = 3", "bogie = 3"),
        ('middle = ["wheel_ml", "wheel_mr"]', 'middle = "wheel_ml"', "wheels.middle ="),
        ('middle = ["wheel_ml", "wheel_mr"]', 'fore = ["wheel_ml", "wheel_mr"]', "begin.*letter"),
        ("middle = [", '"" = [', r"\[wheels\]"),
        ('rear = ["steer_rl"', 'back = ["steer_rl"', r"\[steering\].*'back'"),
        ('value = 0.045, unit = "m"', 'value = 0.045, unit = "s"', "'s'.*measure"),
        ('value = 0.045, unit = "m"', 'value = 45, unit = "m"', "Wheel.r = 45"),
        ("r = {", "radius = {", "'radius'"),
    ],
)
def test_a_toml_that_does_not_fit_says_what_to_mend(tmp_path, old, new, words):
    text = (URDF / "nexus6.toml").read_text()
    assert old in text
    shutil.copy(URDF / "nexus6.urdf", tmp_path)
    (tmp_path / "own.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(UrdfError, match=words):
        read_layout(tmp_path / "own.toml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "a"\nurdf = "b"\nbase = "c"\nwheels = 4\n[wheel]', "'wheels'"),
        ('name = "a"\nurdf = "b"\nbase = "c"\n[wheels]\nonly = ["x", "y"]\n[wheel]', r"\[wheels\] names 1 axles"),
    ],
)
def test_wheels_are_a_table_of_two_axles_or_more(tmp_path, text, words):
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(UrdfError, match=words):
        read_layout(tmp_path / "own.toml")


def test_the_urdf_itself_is_no_layout():
    with pytest.raises(UrdfError, match=r".toml.*joints"):
        read_layout(URDF / "nexus6.urdf")


def test_a_urdf_that_is_no_text_is_refused(tmp_path):
    shutil.copy(URDF / "cart.toml", tmp_path)
    (tmp_path / "cart.urdf").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UrdfError, match=r"cart.urdf:.*UTF-8"):
        read_layout(tmp_path / "cart.toml")
