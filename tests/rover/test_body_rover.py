"""Loading rovers: Nexus 6 as the paper has it, a user's own, gravity, copies, mirror."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError, UrdfError
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
    for own in ("secret.toml", str(beside / "secret.toml"), "nexus7"):
        with pytest.raises(UrdfError) as told:
            load_named(own, beside / "drive.toml")
        assert "lies elsewhere" not in str(told.value)
    with pytest.raises(UrdfError, match="`rover-pin check-urdf`") as told:
        load_named(str(away / "secret.toml"), beside / "drive.toml")
    assert "password" not in str(told.value)
