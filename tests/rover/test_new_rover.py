"""What `new-rover` proposes of a URDF: right on rovers whose roles are known, marked where it is guessed."""

from __future__ import annotations

import json
import math
import re
import sys
import tomllib
from pathlib import Path

import pytest

from rover_pin import load_rover, scenario
from rover_pin.base.errors import MissingExtraError, UrdfError
from rover_pin.base.trust import Trust
from rover_pin.cli.app import app
from rover_pin.rover.description.layout import shipped_toml
from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.rover.urdf_check import check_urdf
from tests.rover import farm as made

Farm = made.Farm


def proposed(folder: Path, urdf: str) -> dict:
    """The proposal for a URDF's text, read again; it is sound by itself."""
    (folder / "own.urdf").write_text(urdf)
    proposal = new_rover(folder / "own.urdf")
    assert proposal.report.ok, proposal.report.faults
    assert [file.suffix for file in proposal.files] == [".toml", ".png"]
    assert all(file.stat().st_size > 500 for file in proposal.files)
    return tomllib.loads((folder / "own.toml").read_text())


def test_nexus_6_and_the_cart_are_found_as_they_are(tmp_path):
    for name, tables_apart in (("nexus6", ("motor", "soil")), ("cart", ())):
        (folder := tmp_path / name).mkdir()
        proposal = proposed(folder, shipped_toml(name).with_suffix(".urdf").read_text())
        shipped = tomllib.loads(shipped_toml(name).read_text())
        rover, proposed_rover = load_rover(name), load_rover(folder / "own.toml")
        assert proposed_rover.wheel == rover.wheel
        for key in set(shipped) - {"name", "urdf", "wheel", "wheels", *tables_apart}:
            assert proposal[key] == shipped[key]
        assert list(proposal["wheels"].values()) == list(shipped["wheels"].values())


def eight(bogies: bool = False) -> Farm:
    """Eight wheels; on a rigid body, or in bogies of two."""
    farm = Farm(mass=60.0)
    for side, y in (("l", 0.4), ("r", -0.4)):
        for i, x in enumerate((0.75, 0.25, -0.25, -0.75)):
            parent, at = "body", f"{x} {y} 0"
            if bogies:
                pivot = f"b{i // 2}{side}"
                if i % 2 == 0:
                    farm.link(pivot, "body", "revolute", f"{x - 0.25} {y} 0.1", mass=1.0)
                parent, at = f"{pivot}_link", f"{0.25 * (-1) ** i} 0 -0.1"
            farm.wheel(f"w{i}{side}", parent, at)
    return farm


def steered(farm_wheel: str = "front") -> Farm:
    farm = Farm()
    for side, y in (("l", 0.35), ("r", -0.35)):
        farm.link(f"turn_{side}", "body", "revolute", f"0.4 {y} 0.2", "0 0 1")
        farm.wheel(f"f{side}", f"turn_{side}_link", "0 0 -0.2").wheel(f"r{side}", "body", f"-0.4 {y} 0")
    return farm


def test_axles_steering_and_suspension_are_found_by_topology(tmp_path):
    role_of = {}
    farms = {"eight": eight(), "bogies": eight(True), "steered": steered(), "six": made.rocker_bogie()}
    for name, farm in farms.items():
        (folder := tmp_path / name).mkdir()
        role_of[name] = proposed(folder, farm.urdf)
    assert list(role_of["eight"]["wheels"]) == ["front", "second", "third", "rear"]
    assert "suspension" not in role_of["eight"]
    assert role_of["bogies"]["suspension"] == {"bogie": ["b0l", "b0r"], "bogie2": ["b1l", "b1r"]}
    assert role_of["steered"]["steering"] == {"front": ["turn_l", "turn_r"]}
    assert role_of["six"]["suspension"] == made.ROCKERS["suspension"]
    assert role_of["six"]["differential"] == {"pair": "rocker"}
    assert role_of["six"]["wheel"] == {"r": 0.15, "b": 0.1}


def test_triple_bogies_are_found(tmp_path):
    text = (Path(__file__).parent / "rovers" / "triple.urdf").read_text()
    proposal = proposed(tmp_path, text)
    assert proposal["suspension"] == {"bogie": ["port_bogie", "starboard_bogie"], "cross": "cross_bogie"}
    assert "differential" not in proposal


def test_arms_legs_and_telescopes_are_held_within_their_stops(tmp_path):
    farm = made.cart()
    limit = '<limit lower="0.3" upper="1.2" effort="1" velocity="1"/>'
    farm.link("mast", "body", "revolute", "0 0 0.4", "0 0 1", limit=limit).link(
        "boom", "mast_link", "prismatic", "0 0 0.2", "1 0 0"
    )
    assert proposed(tmp_path, farm.urdf)["held"] == {"mast": 0.3, "boom": 0.0}
    text = (tmp_path / "own.toml").read_text()
    assert "mast = 0.3  # it carries" in text


def test_two_halves_of_a_rocker_are_coupled(tmp_path):
    """As in models where front arm and rear arm turn about one pin, one joint each; here the left ones face back."""
    farm = Farm(mass=40.0, centre="0.05 0 0.3")
    for side, y, axis in (("l", 0.4, "0 -1 0"), ("r", -0.4, "0 1 0")):
        farm.link(f"back_{side}", "body", "revolute", f"0 {y} 0.3", "0 1 0", mass=2.0)
        farm.link(f"fore_{side}", "body", "revolute", f"0 {y} 0.3", axis, mass=2.0)
        farm.link(f"bogie_{side}", f"back_{side}_link", "revolute", "-0.3 0 -0.15", mass=1.0)
        farm.wheel(f"f{side}", f"fore_{side}_link", "0.5 0 -0.3")
        farm.wheel(f"m{side}", f"bogie_{side}_link", "0.25 0 -0.15")
        farm.wheel(f"r{side}", f"bogie_{side}_link", "-0.25 0 -0.15")
    proposal = proposed(tmp_path, farm.urdf)
    assert proposal["coupled"] == {
        "fore_l": {"joint": "back_l", "ratio": -1.0},
        "fore_r": {"joint": "back_r", "ratio": 1.0},
    }
    assert proposal["suspension"]["rocker"] == ["back_l", "back_r"]
    assert proposal["differential"] == {"pair": "rocker"}


@pytest.mark.parametrize(
    ("rpy", "turned"),
    [
        ("3.141592653589793 0 0", [math.pi, 0.0, 0.0]),
        ("0 0 1.5707963267948966", [0.0, 0.0, -math.pi / 2]),
        ("-1.5707963267948966 0 0", [math.pi / 2, 0.0, 0.0]),
    ],
)
def test_a_base_that_is_turned_gets_its_base_rpy(tmp_path, rpy, turned):
    """The rover hangs turned by rpy in its base link: z down, y forward, y up."""
    text = steered().urdf.replace('name="body"', 'name="hull"').replace('link="body"', 'link="hull"')
    joint = '<joint name="s" type="fixed"><parent link="body"/><child link="hull"/>'
    text = text.replace("</robot>", f'<link name="body"/>{joint}<origin rpy="{rpy}"/></joint></robot>')
    proposal = proposed(tmp_path, text)
    assert proposal["base_rpy"] == pytest.approx(turned, abs=1e-9)
    assert proposal["wheels"] == {"front": ["fl", "fr"], "rear": ["rl", "rr"]}


def test_a_mesh_gives_the_size_where_it_can_be_read(tmp_path):
    """Eight-sided, 2 mm fine, in millimetres, in a package beside the URDF's folder."""
    import trimesh

    (tmp_path / "pkg" / "meshes").mkdir(parents=True)
    (tmp_path / "pkg" / "urdf").mkdir()
    (tmp_path / "pkg" / "package.xml").touch()
    trimesh.creation.cylinder(radius=150.0, height=80.0, sections=64).export(tmp_path / "pkg" / "meshes" / "tyre.stl")
    mesh = '<geometry><mesh filename="package://pkg/meshes/tyre.stl" scale="1e-3 1e-3 1e-3"/></geometry>'
    text = re.sub("<geometry>.*?</geometry>", mesh, made.cart().urdf)
    proposal = proposed(tmp_path / "pkg" / "urdf", text)
    assert proposal["wheel"] == {"r": 0.15, "b": 0.08}
    for r, size in ((0.001, proposal["wheel"]), (0.04, proposal["wheel"]), (0.14, {"r": 0.14, "b": 0.05})):
        shape = f'<geometry><cylinder radius="{r}" length="0.05"/></geometry></collision>'
        drawn = re.sub(r"(<collision><origin[^>]*>).*?</collision>", rf"\g<0>\1{shape}", text)
        (tmp_path / "pkg" / f"r{r}").mkdir()
        assert drawn.count(shape) > 3
        assert proposed(tmp_path / "pkg" / f"r{r}", drawn)["wheel"] == size
    (tmp_path / "pkg" / "meshes" / "tyre.stl").unlink()
    named = re.sub('name="([fr][lr])"', r'name="wheel_\1"', text)
    poor = proposed(tmp_path / "pkg", named)
    assert poor["wheel"]["r"] == pytest.approx(0.15 * math.sqrt(0.2), rel=1e-3)
    assert "solid cylinder" in (tmp_path / "pkg" / "own.toml").read_text()


def test_every_guess_is_marked_and_the_rover_drives(tmp_path):
    path = tmp_path / "own.urdf"
    path.write_text(made.rocker_bogie().urdf)
    new_rover(path)
    text = (tmp_path / "own.toml").read_text()
    for table in ("wheels", "suspension", "differential"):
        assert re.search(rf"\[{table}\]  # GUESSED", text)
    assert re.search("r = 0.15  # GUESSED.*'fl_link'", text)
    assert check_urdf(tmp_path / "own.toml").ok
    trace = scenario("flat", rover=str(tmp_path / "own.toml"), duration=3.0).drive()
    assert trace["body_x"][-1] > 0.1


def test_nothing_is_written_over_and_nonsense_is_refused(tmp_path):
    path = tmp_path / "own.urdf"
    path.write_text(made.cart().urdf)
    new_rover(path)
    with pytest.raises(UrdfError, match=r"own.toml:.*--out"):
        new_rover(path)
    with pytest.raises(UrdfError, match=r"is no .toml"):
        new_rover(path, tmp_path / "own.txt")
    second = tmp_path / "elsewhere" / "mine.toml"
    assert [file.name for file in new_rover(path, second).files] == ["own.urdf", "mine.toml", "mine.png"]
    with pytest.raises(UrdfError, match=r"elsewhere/own.urdf:.*already"):
        new_rover(path, tmp_path / "elsewhere" / "second.toml")
    with pytest.raises(UrdfError, match=r".urdf.*.xacro"):
        new_rover(tmp_path / "none.urdf")
    sledge = Farm().link("mast", "body", "continuous", "0 0 1", "0 0 1")
    (tmp_path / "sledge.urdf").write_text(sledge.urdf)
    with pytest.raises(UrdfError, match=r"wheels.*0"):
        new_rover(tmp_path / "sledge.urdf")


def test_a_xacro_needs_trust_and_its_extra(tmp_path, monkeypatch):
    path = tmp_path / "own.urdf.xacro"
    path.write_text(made.cart().urdf)
    with pytest.raises(UrdfError, match=r".xacro.*--trust"):
        new_rover(path)
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(MissingExtraError, match=r"xacrodoc>="):
        new_rover(path, trust=Trust(everything=True))


def test_a_xacro_is_expanded(tmp_path):
    pytest.importorskip("xacrodoc")
    text = made.cart().urdf.replace("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')
    text = text.replace('radius="0.15"', 'radius="${0.3 / 2}"')
    (tmp_path / "own.urdf.xacro").write_text(text)
    new_rover(tmp_path / "own.urdf.xacro", trust=Trust(everything=True))
    assert tomllib.loads((tmp_path / "own.toml").read_text())["wheel"]["r"] == 0.15
    (tmp_path / "bad.xacro").write_text(text.replace("${0.3 / 2}", "${nothing}"))
    with pytest.raises(UrdfError, match=r"bad.xacro:.*'nothing'.*defined\)"):
        new_rover(tmp_path / "bad.xacro", trust=Trust(everything=True))
    lacks = text.replace("<link", '<xacro:include filename="$(find arm_description)/arm.xacro"/><link', 1)
    (tmp_path / "lacks.xacro").write_text(lacks)
    with pytest.raises(UrdfError, match=r"arm_description\)"):
        new_rover(tmp_path / "lacks.xacro", trust=Trust(everything=True))


def test_the_command_prints_what_it_proposes(tmp_path, capsys):
    path = tmp_path / "own.urdf"
    path.write_text(made.rocker_bogie().urdf)
    with pytest.raises(SystemExit) as exit_info:
        app(["new-rover", str(path), "--json"])
    assert exit_info.value.code == 0
    report = json.loads(capsys.readouterr().out)
    assert report["wheels"]["front"] == "fl fr"
    assert report["differential"] == "rocker"
    assert f"rover-pin check-urdf {tmp_path / 'own.toml'}" in report["next"]
