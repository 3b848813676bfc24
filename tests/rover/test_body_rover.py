"""Loading rovers: Nexus 6 as the paper has it, a user's own, gravity, copies, mirror."""

from __future__ import annotations

import pickle
import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import joblib
import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import ParameterError, UrdfError
from rover_pin.rover.description import layout
from rover_pin.rover.forward_dynamics import forward_dynamics
from rover_pin.rover.rover import load_named, load_rover

URDF = Path(__file__).parents[2] / "urdf"
TRIPLE = Path(__file__).parent / "rovers" / "triple.toml"


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


def test_nexus6_fits_into_its_cube(nexus6):
    q = pin.neutral(nexus6.model)
    geometry = pin.buildGeomFromUrdfString(nexus6.model, nexus6.urdf, pin.GeometryType.COLLISION)
    data, placed = nexus6.model.createData(), geometry.createData()
    pin.updateGeometryPlacements(nexus6.model, data, geometry, placed, q)
    corners = []
    for shape, placement in zip(geometry.geometryObjects, placed.oMg, strict=True):
        shape.geometry.computeLocalAABB()
        box = shape.geometry.aabb_local
        ends = np.array([box.min_, box.max_])
        corners += [
            placement.act(np.array([ends[i, 0], ends[j, 1], ends[k, 2]]))
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ]
    size = np.ptp(corners, axis=0)
    assert np.all(size < 0.4)
    assert np.min(corners, axis=0)[2] == pytest.approx(-0.13)


def test_every_number_of_nexus6_has_its_source():
    """A line with a number in it says "paper" or "assumed", or what it follows from."""
    said = ("paper", "assumed", "positive rate drives forward", "version")
    for line in re.sub(
        r"(?s)<!--.*?-->", lambda c: c.group() if "\n" not in c.group() else "", (URDF / "nexus6.urdf").read_text()
    ).splitlines():
        if re.search(r'"[^"]*\d[^"]*"', re.sub(r'name="[^"]*"', "", line)):
            assert any(word in line for word in said), line


def test_any_viewer_sees_a_rover():
    robot = ET.parse(URDF / "nexus6.urdf").getroot()
    assert all(link.find("visual") is not None and link.find("collision") is not None for link in robot.findall("link"))
    cylinders = {link.get("name") for link in robot.findall("link") if link.find(".//cylinder") is not None}
    assert cylinders == {f"wheel_{name}_link" for name in ("fl", "fr", "ml", "mr", "rl", "rr")}
    mimics = {joint.get("name"): joint.find("mimic") for joint in robot.findall("joint")}
    assert mimics["rocker_r"].get("joint") == "rocker_l"
    assert float(mimics["rocker_r"].get("multiplier")) == -1.0
    names = [joint.get("name") for joint in robot.findall("joint")]
    assert names.index("rocker_l") < names.index("rocker_r")


def test_pinocchios_own_mimic_reads_the_file(nexus6):
    assert pin.buildModelFromXML(nexus6.urdf, pin.JointModelFreeFlyer(), True).nv == 19


def test_a_rover_of_ones_own_is_a_toml_beside_its_urdf(tmp_path):
    for name in ("cart.toml", "cart.urdf"):
        shutil.copy(URDF / name, tmp_path / name)
    cart = load_rover(tmp_path / "cart.toml")
    assert [wheel.name for wheel in cart.wheels] == ["fl", "fr", "bl", "br"]
    assert cart.wheel.r == pytest.approx(0.11)
    assert cart.differential is None
    assert cart.angles == {}
    assert cart.model.nv == 10


def test_another_layout_of_bogies_with_one_across():
    triple = load_rover(str(TRIPLE))
    assert set(triple.angles) == {"bogie_l", "bogie_r", "cross"}
    cross = triple.model.joints[triple.model.getJointId("cross_bogie")].idx_v
    assert triple.mirror.perm[cross] == cross
    assert triple.mirror.sign[cross] == -1.0
    assert triple.symmetric


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


def test_another_gravity_is_another_rover(nexus6):
    moon = nexus6.under(1.62)
    assert (moon.gravity, nexus6.gravity) == (1.62, 9.81)
    q, v = pin.neutral(moon.model), np.zeros(20)
    falling = forward_dynamics(moon, q, v, np.zeros(20), np.zeros((6, 6))).a
    assert falling[2] == pytest.approx(-1.62)
    with pytest.raises(ParameterError, match=r"gravity = nan m/s.2"):
        nexus6.under(float("nan"))


def test_rovers_travel_to_other_processes(nexus6):
    moon = nexus6.under(1.62)
    copy = pickle.loads(pickle.dumps(moon))
    assert copy.gravity == 1.62
    assert copy.wheels == moon.wheels
    assert copy.model == moon.model
    assert joblib.hash(copy.angles) == joblib.hash(moon.angles)


def test_wheels_go_by_name(nexus6):
    assert nexus6.mount("ml").axle == 1
    with pytest.raises(ParameterError, match=r"'nexus6'.*'left'"):
        nexus6.mount("left")


def test_an_unknown_rover_lists_the_close_ones():
    with pytest.raises(UrdfError, match=r"'nexus':.*'nexus6'.*give.*.toml"):
        load_rover("nexus")
    with pytest.raises(UrdfError, match="rover file"):
        load_rover("nowhere/rover.toml")


def test_the_rovers_are_found_inside_an_installed_package(tmp_path, monkeypatch):
    """An installed wheel carries them in rover_pin/urdf; a checkout has them beside the package."""
    (tmp_path / "rover_pin" / "urdf").mkdir(parents=True)
    monkeypatch.setattr(layout, "files", lambda _: tmp_path / "rover_pin")
    assert layout.rover_folder() == tmp_path / "rover_pin" / "urdf"
    (tmp_path / "rover_pin" / "urdf").rmdir()
    assert layout.rover_folder() == tmp_path / "urdf"


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
