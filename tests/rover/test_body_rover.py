"""Loading rovers: Nexus 6 as the paper has it, a user's own, and what a TOML may not say."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError, UrdfError
from rover_pin.rover.description.layout import read_layout
from rover_pin.rover.rover import load_named, load_rover

URDF = Path(__file__).parents[2] / "urdf"


def test_nexus6_is_the_papers_rover(nexus6):
    """Section 2: 5.8 kg, within a cube of 0.4 m, six wheels of 0.09 m, front and rear steered, a differential."""
    assert nexus6.mass == pytest.approx(5.8, abs=1e-12)
    assert nexus6.model.nv == 20
    assert [wheel.name for wheel in nexus6.wheels] == ["fl", "fr", "ml", "mr", "rl", "rr"]
    assert [wheel.axle for wheel in nexus6.wheels] == [0, 0, 1, 1, 2, 2]
    assert [wheel.steer_dof is not None for wheel in nexus6.wheels] == [True, True, False, False, True, True]
    assert nexus6.wheel.r == 0.045
    assert nexus6.differential is not None
    assert nexus6.symmetric


def test_a_rover_of_ones_own_is_a_toml_beside_its_urdf(tmp_path):
    for name in ("cart.toml", "cart.urdf"):
        shutil.copy(URDF / name, tmp_path / name)
    cart = load_rover(tmp_path / "cart.toml")
    assert [wheel.name for wheel in cart.wheels] == ["fl", "fr", "bl", "br"]
    assert cart.wheel.r == pytest.approx(0.11)
    assert cart.differential is None
    assert cart.angles == {}
    assert cart.model.nv == 10


def test_the_mirror_flips_what_it_must(nexus6):
    perm, sign = nexus6.mirror
    assert sign[:6].tolist() == [1, -1, 1, -1, 1, -1]
    assert np.array_equal(perm[perm], np.arange(20))
    wheels = {wheel.name: wheel for wheel in nexus6.wheels}
    assert perm[wheels["fl"].dof] == wheels["fr"].dof
    assert sign[wheels["fl"].dof] == 1.0
    assert sign[wheels["fl"].steer_dof] == -1.0
    assert sign[nexus6.differential.left] == 1.0
    assert perm[nexus6.differential.left] == nexus6.differential.right


def test_wheels_go_by_name(nexus6):
    assert nexus6.mount("ml").axle == 1
    with pytest.raises(ParameterError, match=r"'nexus6'.*'left'"):
        nexus6.mount("left")


def test_an_unknown_rover_lists_the_close_ones():
    with pytest.raises(UrdfError, match=r"'nexus':.*'nexus6'.*give.*.toml"):
        load_rover("nexus")
    with pytest.raises(UrdfError, match="rover file"):
        load_rover("nowhere/rover.toml")


def test_model_names_a_rover_beside_elsewhere_or_in_the_package(tmp_path):
    """What makes no rover is told in full only where it is the model's own: it may name any file of the machine."""
    beside, away = tmp_path / "beside", tmp_path / "away"
    for folder in (beside, away):
        folder.mkdir()
        for name in ("cart.toml", "cart.urdf"):
            shutil.copy(URDF / name, folder / name)
    (beside / "cart.toml").write_text((URDF / "cart.toml").read_text().replace('name = "cart"', 'name = "own cart"'))
    assert load_named("cart.toml", beside / "drive.toml").name == "own cart"
    assert load_named(str(away / "cart.toml"), beside / "drive.toml").name == "cart"
    assert load_named("nexus6", beside / "drive.toml").name == "nexus6"
    for folder in (beside, away):
        (folder / "secret.toml").write_text("password = 1")
    for rover_name in ("secret.toml", str(beside / "secret.toml"), "nexus7"):
        with pytest.raises(UrdfError) as raised:
            load_named(rover_name, beside / "drive.toml")
        assert "lies elsewhere" not in str(raised.value)
    with pytest.raises(UrdfError, match="`rover-pin check-urdf`") as raised:
        load_named(str(away / "secret.toml"), beside / "drive.toml")
    assert "password" not in str(raised.value)


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
        ('value = 0.045, unit = "m"', 'value = 0.045, unit = "s"', "'s' does not fit"),
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
