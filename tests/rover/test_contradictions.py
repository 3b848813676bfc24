"""Sources that contradict each other, in a URDF or beside it: a fault or a question, and no source is dropped."""

import math
import os
import re
import tomllib

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError, UrdfError
from rover_pin.base.trust import Trust
from rover_pin.rover.description.drawn_axis import disc_axis
from rover_pin.rover.description.tree import Body
from rover_pin.rover.proposal.frames import FRAMES, contradictions, named_places, rotation
from rover_pin.rover.proposal.new_rover import new_rover
from rover_pin.rover.rover import load_rover
from rover_pin.rover.urdf_check import check_urdf
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.defaults import own_soil
from tests.rover.farm import ROCKERS, SIZE, THREE_AXLES, TWO_AXLES, Farm, cart, inertial, rocker_bogie, write

PLACES = {
    "front_left": (0.4, 0.35),
    "front_right": (0.4, -0.35),
    "rear_left": (-0.4, 0.35),
    "rear_right": (-0.4, -0.35),
}


def named_cart(names, turn=0.0):
    """Four wheels named after their places; the rover's front points along +x, turned about z by an angle [rad]."""
    farm, c, s = Farm(), math.cos(turn), math.sin(turn)
    for name, (x, y) in zip(names, PLACES.values(), strict=True):
        axle = f"{round(-s)} {round(c)} 0"
        drawn = "1.5707963267948966 0 0" if abs(c) > 0.5 else "0 1.5707963267948966 0"
        farm.wheel(f"wheel_{name}", "body", f"{c * x - s * y} {s * x + c * y} 0", axle, drawn=drawn)
    return farm.urdf


def proposal(folder, urdf, **options):
    (folder / "own.urdf").write_text(urdf)
    new_rover(folder / "own.urdf", **options)
    return tomllib.loads((folder / "own.toml").read_text())


# The axis of a joint against the wheel that its link draws.


def test_a_missing_axis_across_the_drawn_wheel_is_a_fault(tmp_path):
    text = cart().urdf.replace('<axis xyz="0 1 0"/>', "")
    path = write(tmp_path, text, TWO_AXLES)
    for faults in (check_urdf(path).faults, check_urdf(tmp_path / "rover.urdf").faults):
        assert len(faults) == 4
        assert all(word in faults[0] for word in ("'fl'", "<axis>", " x ", "cylinder", "0.15 m", " y"))
    with pytest.raises(UrdfError, match=r"'fl'.*<axis xyz='0 1 0'/>"):
        new_rover(tmp_path / "rover.urdf", tmp_path / "new.toml")


@pytest.mark.parametrize(("axis", "drawn", "words"), [("1 0 0", None, "about x"), ("0 1 0", "0 0 0", "along z"),
                                                      ("0 0.7 0.7", None, r"about \(0 0.7 0.7\)")])  # fmt: skip
def test_a_written_axis_across_the_drawn_wheel_is_a_fault(tmp_path, axis, drawn, words):
    urdf = cart(axis=axis, **({"drawn": drawn} if drawn else {})).urdf
    assert re.search(words, check_urdf(write(tmp_path, urdf, TWO_AXLES)).faults[0])


def test_two_drawings_of_a_wheel_that_disagree_are_noted_and_the_rover_loads(tmp_path):
    """The collision's cylinder lies as the joint turns; the visual's lies along z, as without its rpy."""
    visual = '<visual><geometry><cylinder radius="0.15" length="0.1"/></geometry></visual><collision>'
    report = check_urdf(write(tmp_path, cart().urdf.replace("<collision>", visual), TWO_AXLES))
    assert report.ok
    assert any("<visual>" in note and "fl_link" in note for note in report.notes)


def test_spokes_hubs_and_masts_contradict_no_axis(tmp_path):
    """A long spoke across, a smaller hub across and a mast that pans below a camera's cylinder are no wheels."""
    spoke = '<collision><geometry><cylinder radius="0.01" length="0.28"/></geometry></collision><collision>'
    hub = '<collision><geometry><cylinder radius="0.04" length="0.04"/></geometry></collision><collision>'
    farm = cart().link("mast", "body", "continuous", "0 0 0.4", "0 0 1",
                       shape='<visual><origin xyz="0 0 .3" rpy="0 1.57 0"/><geometry><cylinder radius="0.03" '
                       'length="0.05"/></geometry></visual>')  # fmt: skip
    for extra in (spoke, hub):
        path = write(tmp_path, farm.urdf.replace("<collision>", extra), {**TWO_AXLES, "held": {"mast": 0.0}})
        assert check_urdf(path).ok
        assert check_urdf(tmp_path / "rover.urdf").ok


def test_a_mesh_that_is_round_about_another_axis_than_the_default_is_a_fault(tmp_path):
    import trimesh

    trimesh.creation.cylinder(radius=0.15, height=0.08, sections=48).export(tmp_path / "tyre.stl")
    text = re.sub("<cylinder[^>]*>", '<mesh filename="tyre.stl"/>', cart().urdf)
    (tmp_path / "own.urdf").write_text(text.replace('<axis xyz="0 1 0"/>', ""))
    with pytest.raises(UrdfError, match=r"'fl'.*<axis>.*mesh.*about y"):
        new_rover(tmp_path / "own.urdf")


def test_the_inertia_of_a_disc_tells_its_axis():
    """A solid cylinder by hand: m r^2 / 2 about its axis, m (3 r^2 + b^2) / 12 across it."""
    for r, b, is_disc in ((0.1, 0.04, True), (0.1, 0.2, False)):
        axial, across = r**2 / 2, (3 * r**2 + b**2) / 12
        axis = disc_axis(Body(1.0, np.zeros(3), np.diag([across, axial, across]), rotation((0.0, 0.0, math.pi / 2))))
        assert (axis is not None) is is_disc
        if axis is not None:
            assert np.abs(axis) == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_a_disc_without_a_drawing_contradicts_a_missing_axis(tmp_path):
    disc = '<inertia ixx="0.0036" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.0036"/>'
    text = re.sub("<collision>.*?</collision>", "", cart().urdf)
    text = re.sub(r'(mass value="1.0"/>)<inertia[^>]*>', rf"\1{disc}", text)
    assert check_urdf(write(tmp_path, text, TWO_AXLES)).ok
    faults = check_urdf(write(tmp_path, text.replace('<axis xyz="0 1 0"/>', ""), TWO_AXLES)).faults
    assert all(word in faults[0] for word in ("'fl'", "disc", "<axis>"))


@pytest.mark.parametrize("tag", ["axis", "limit", "origin", "parent", "mimic", "inertial"])
def test_an_element_that_is_there_twice_is_a_fault(tmp_path, tag):
    twice = {"axis": '<axis xyz="1 0 0"/>', "origin": '<origin xyz="0 0 1"/>', "parent": '<parent link="fl_link"/>'}
    element_text = twice.get(tag, f"<{tag}/>")
    text = rocker_bogie(inner='<mimic joint="rocker_l"/>').urdf
    match = re.search(f"<{tag}[ >]", text)
    path = write(tmp_path, text[: match.start()] + element_text + text[match.start() :], {**THREE_AXLES, **ROCKERS})
    (fault,) = check_urdf(path).faults
    assert f"2 elements <{tag}>" in fault


# Stops.


@pytest.mark.parametrize(("low", "high", "wheel"), [(-3.14, 3.14, True), (0.0, 6.28, True), (-10.0, 10.0, True),
                                                    (-3.0, 3.0, False)])  # fmt: skip
def test_a_revolute_joint_with_a_full_turn_between_its_stops_is_a_wheel(tmp_path, low, high, wheel):
    limit = f'<limit lower="{low}" upper="{high}" effort="9" velocity="9"/>'
    (tmp_path / "own.urdf").write_text(cart(kind="revolute", limit=limit).urdf)
    assert check_urdf(tmp_path / "own.urdf").ok is wheel
    if wheel:
        assert len(new_rover(tmp_path / "own.urdf").proposal.wheels) == 4
        trace = scenario("flat", rover=str(tmp_path / "own.toml"), duration=12.0).drive(measure_error=False)
        assert trace["body_x"][-1] > 0.1
    else:
        with pytest.raises(UrdfError, match=" 0 joints"):
            new_rover(tmp_path / "own.urdf")


@pytest.mark.parametrize(
    ("kind", "words"), [("fixed", "'wheel_fl' is fixed"), ("revolute", "'wheel_fl' is revolute, 1.6 rad")]
)
def test_wheels_by_name_that_cannot_turn_are_named_with_the_reason(tmp_path, kind, words):
    text = re.sub('name="([fr][lr])"', r'name="wheel_\1"', cart(kind=kind).urdf)
    with pytest.raises(UrdfError, match=words):
        proposal(tmp_path, text)


def test_two_joints_of_one_name_are_a_fault(tmp_path):
    text = cart().urdf.replace('joint name="rr"', 'joint name="rl"')
    (tmp_path / "own.urdf").write_text(text)
    for path in (tmp_path / "own.urdf", write(tmp_path, text, TWO_AXLES)):
        assert any(re.search("2 joints.*'rl'", fault) for fault in check_urdf(path).faults)
    with pytest.raises(UrdfError, match=r"2 joints.*'rl'"):
        new_rover(tmp_path / "own.urdf")


def test_a_drive_states_how_far_its_stops_yield(tmp_path):
    stops = '<limit lower="-0.05" upper="0.05" effort="9" velocity="9"/>'
    text = re.sub(r'<limit lower="-0.8"[^>]*>', stops, rocker_bogie().urdf)
    rover = str(write(tmp_path, text, {**THREE_AXLES, **ROCKERS}))
    step = {"terrain.height": 0.12, "terrain.at": 0.8, "terrain.wall_angle": "40deg"}
    settings = {"rover": rover, "duration": 12.0, **step}
    trace = scenario("step", **settings).drive(measure_error=False)
    past = {name: np.abs(trace[name]).max() - 0.05 for name in ("rocker_l", "rocker_r", "bogie_l", "bogie_r")}
    assert max(past.values()) > math.radians(0.1)
    for name, angle in past.items():
        yielded = re.search(rf"{name} ([\d.e-]+) deg", trace.attrs.get("stops", ""))
        assert (yielded is not None) == (angle > math.radians(0.1))
        if yielded:
            assert float(yielded[1]) == pytest.approx(math.degrees(angle), rel=0.06)
    assert trace.summary()["stops"] == trace.attrs["stops"]
    assert "stops" not in scenario("flat", rover=rover, duration=2.0).drive(measure_error=False).attrs


# Names of wheels against their places.


@pytest.mark.parametrize(("turn", "rpy"), [(0.0, 0.0), (math.pi, math.pi), (math.pi / 2, -math.pi / 2),
                                           (-math.pi / 2, math.pi / 2)])  # fmt: skip
@pytest.mark.parametrize("names", [tuple(PLACES), ("FL", "FR", "RL", "RR"), ("lf", "rf", "lb", "rb"),
                                   ("port_bow", "starboard_bow", "port_stern", "starboard_stern"),
                                   ("front_1", "front_2", "back_1", "back_2")])  # fmt: skip
def test_the_front_is_the_end_that_the_names_say(tmp_path, turn, rpy, names):
    table = proposal(tmp_path, named_cart(names, turn))
    assert table.get("base_rpy", [0.0, 0.0, 0.0])[2] == pytest.approx(rpy, abs=1e-9)
    places = wheel_places(load_rover(tmp_path / "own.toml"))
    assert [np.sign(places[wheel][:2]).tolist() for wheel in ("fl", "rr")] == [[1.0, 1.0], [-1.0, -1.0]]
    assert table["wheels"]["front"] == [f"wheel_{name}" for name in names[:2]]
    assert not [note for note in check_urdf(tmp_path / "own.toml").notes if "contradicts" in note]


@pytest.mark.parametrize("names", [("front_right", "front_left", "rear_left", "rear_right"),
                                   ("front_left", "rear_right", "front_right", "rear_left"),
                                   ("front_right", "front_left", "rear_right", "rear_left")])  # fmt: skip
def test_names_that_hold_in_no_frame_are_a_question_that_front_answers(tmp_path, names):
    urdf = named_cart(names)
    with pytest.raises(UrdfError, match=r"--front=.x"):
        proposal(tmp_path, urdf)
    assert not (tmp_path / "own.toml").exists()
    table = proposal(tmp_path, urdf, front="-x")
    assert table["base_rpy"] == pytest.approx([0.0, 0.0, math.pi])
    assert table["wheels"]["front"] == [f"wheel_{names[3]}", f"wheel_{names[2]}"]
    assert any("contradicts" in note for note in check_urdf(tmp_path / "own.toml").notes)


def test_a_joint_and_its_link_that_name_different_ends_are_a_question(tmp_path):
    text = named_cart(PLACES)
    for name, second in (("front", "rear"), ("rear", "front")):
        text = re.sub(f"wheel_{name}_(left|right)_link", rf"the_{second}_\1_tyre", text)
    with pytest.raises(UrdfError, match="--front"):
        proposal(tmp_path, text)


def test_front_takes_the_six_axes_alone(tmp_path):
    with pytest.raises(ParameterError, match=r"'x'.*\+x"):
        proposal(tmp_path, cart().urdf, front="x")
    with pytest.raises(UrdfError, match=r"\+y forward"):
        proposal(tmp_path, cart().urdf, front="+y")


def test_a_rover_is_not_turned_upside_down_by_names_alone(tmp_path):
    """Left and right exchanged: with z down the names would hold, but the weight lies above the wheels' centres."""
    names = ("front_right", "front_left", "rear_right", "rear_left")
    with pytest.raises(UrdfError, match="--front"):
        proposal(tmp_path, named_cart(names))
    low = named_cart(names).replace('xyz="0 0 0.2"', 'xyz="0 0 -0.1"')
    assert proposal(tmp_path, low)["base_rpy"][0] == pytest.approx(math.pi)


def test_names_are_read_as_words_and_as_pairs_of_letters():
    names = ["drive_upright_frontLeft", "wheel_r_r", "RightMiddleWheel", "bl_tyre", "track7", "lr"]
    assert [str(place) for place in named_places(names)] == [
        "front left", "rear right", "middle right", "rear left", "", "rear left",
    ]  # fmt: skip
    assert [str(place) for place in named_places(["w1l", "w1r", "w2l", "w2r"])] == ["left", "right", "left", "right"]
    assert [str(place) for place in named_places(["f1", "f2", "r1", "r2"])] == ["front", "front", "rear", "rear"]
    assert [str(place) for place in named_places(["wheel_r", "wheel_b"])] == ["", ""]


def test_a_middle_wheel_at_an_end_contradicts_its_name():
    centres = np.array([[x, y, 0.0] for x in (1.0, 0.0, -1.0) for y in (0.5, -0.5)])
    assert contradictions(named_places(["fl", "fr", "ml", "mr", "rl", "rr"]), centres) == []
    assert contradictions(named_places(["ml", "mr", "fl", "fr", "rl", "rr"]), centres) == [0, 1, 2, 3]


def test_every_frame_is_a_rotation_that_turns_forward_to_x_and_up_to_z():
    axes = {f"{sign}{'xyz'[i]}": value * np.eye(3)[i] for i in range(3) for sign, value in (("+", 1.0), ("-", -1.0))}
    assert len(set(FRAMES)) == 24
    for frame in FRAMES:
        turned = rotation(frame.rpy)
        assert turned @ axes[frame.forward] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
        assert turned @ axes[frame.up] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


# The world, xacro, sizes.


def in_a_world(kind, world="world", joint="world_joint", extra=""):
    text = cart().urdf.replace('name="body"', 'name="hull"').replace('link="body"', 'link="hull"')
    placed = '<origin xyz="2 -0.9 0.3" rpy="0 0 1.5707963267948966"/>'
    axis = '<axis xyz="0 0 1"/>' if kind == "planar" else ""
    fixed = (f'<link name="{world}"/><joint name="{joint}" type="{kind}"><parent link="{world}"/><child link="hull"/>'
             f"{placed}{axis}</joint>{extra}")  # fmt: skip
    return text.replace("</robot>", f"{fixed}</robot>")


@pytest.mark.parametrize("kind", ["fixed", "planar", "floating"])
def test_a_world_is_no_base(tmp_path, kind):
    table = proposal(tmp_path, in_a_world(kind))
    assert table["base"] == "hull"
    assert "base_rpy" not in table
    report = check_urdf(tmp_path / "own.toml")
    assert report.ok, report.faults
    places = wheel_places(load_rover(tmp_path / "own.toml"))
    assert places["fl"] == pytest.approx([0.4, 0.35, 0.0], abs=1e-9)
    trace = scenario("flat", rover=str(tmp_path / "own.toml"), duration=1.0).drive(measure_error=False)
    assert abs(trace["body_x"][0]) < 1e-2
    assert abs(trace["body_yaw"][0]) < 1e-6


def test_a_toml_whose_base_is_the_world_gets_a_fault(tmp_path):
    report = check_urdf(write(tmp_path, in_a_world("fixed"), {**TWO_AXLES, "base": "world"}))
    assert any(re.search(r"'world'.*2.21 m.*base = \"hull\"", fault) for fault in report.faults)


def test_a_footprint_stays_the_base(tmp_path):
    """base_footprint is a frame of the rover that other tools count from, on the ground below the body."""
    table = proposal(tmp_path, in_a_world("fixed", "base_footprint", "base_joint").replace(
        'xyz="2 -0.9 0.3" rpy="0 0 1.5707963267948966"', 'xyz="0 0 0.15"'))  # fmt: skip
    assert table["base"] == "base_footprint"


def test_a_xacro_includes_files_beside_it_from_any_folder(tmp_path, monkeypatch):
    pytest.importorskip("xacrodoc")
    folder, elsewhere = tmp_path / "rover", tmp_path / "elsewhere"
    (folder / "parts").mkdir(parents=True)
    elsewhere.mkdir()
    space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    body = cart().urdf.replace('<robot name="farm">', "").replace("</robot>", "")
    (folder / "parts" / "size.xacro").write_text(f'<robot {space}><xacro:property name="r" value="0.15"/></robot>')
    (folder / "parts" / "body.xacro").write_text(
        f'<robot {space}><xacro:include filename="size.xacro"/>{body.replace("0.15", "${r}")}</robot>'
    )
    (folder / "own.urdf.xacro").write_text(
        f'<robot name="own" {space}><xacro:include filename="parts/body.xacro"/></robot>'
    )
    monkeypatch.chdir(elsewhere)
    for number, path in enumerate((folder / "own.urdf.xacro", os.path.relpath(folder / "own.urdf.xacro"))):
        new = new_rover(path, folder / str(number) / "own.toml", Trust(everything=True))
        assert new.proposal.wheels[0].size.r == pytest.approx(0.15)


def without_size(mesh='<mesh filename="package://other/meshes/tyre.stl"/>'):
    """Wheels of zero inertia whose mesh is not there."""
    text = re.sub("<cylinder[^>]*>", mesh, cart().urdf)
    return re.sub(
        r'(mass value="1.0"/>)<inertia[^>]*>', r'\1<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>', text
    )


def test_wheels_without_any_size_are_named_with_their_missing_mesh(tmp_path):
    with pytest.raises(UrdfError, match=r"fl, fr, rl, rr .*package://other/meshes/tyre.stl.*--r.*--b"):
        proposal(tmp_path, without_size())
    (tmp_path / "own.urdf").write_text(without_size())
    new = new_rover(tmp_path / "own.urdf", r=0.12, b=0.06)
    assert {(wheel.size.r, wheel.size.b) for wheel in new.proposal.wheels} == {(0.12, 0.06)}
    assert any("inertia" in fault for fault in new.report.faults)
    with pytest.raises(ParameterError, match="r and b"):
        new_rover(tmp_path / "own.urdf", tmp_path / "b.toml", r=0.12)


def test_a_wheel_without_size_is_as_large_as_the_others(tmp_path):
    farm = cart()
    farm.parts[3] = re.sub("<cylinder[^>]*>", '<mesh filename="lost.stl"/>', farm.parts[3])
    farm.parts[3] = re.sub(
        "<inertia .*?/>", '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>', farm.parts[3]
    )
    (tmp_path / "own.urdf").write_text(farm.urdf)
    new = new_rover(tmp_path / "own.urdf")
    assert [(wheel.joint, wheel.size.r) for wheel in new.proposal.wheels][3] == ("rr", pytest.approx(0.15))
    assert "rr_link" in new.report.faults[0]


def test_the_name_of_the_new_toml_needs_no_suffix(tmp_path):
    (tmp_path / "own.urdf").write_text(cart().urdf)
    (tmp_path / "folder").mkdir()
    assert (tmp_path / "mine.toml") in new_rover(tmp_path / "own.urdf", tmp_path / "mine").files
    assert (tmp_path / "folder" / "own.toml") in new_rover(tmp_path / "own.urdf", tmp_path / "folder").files


# Bekker's constants in a rover's TOML.

SAND = {"k_c": {"value": 0.99, "unit": "kN/m^(n+1)"}, "k_phi": {"value": 1528.43, "unit": "kN/m^(n+2)"}, "n": 1.1}


def test_bekker_constants_of_a_rover_are_converted_for_its_wheels(tmp_path):
    """By hand: k_1 = k_c b^(n-1), k_2 = k_phi b^(n-1), with b = 0.1 m; in inches and pounds the same sand."""
    imperial = {
        "k_c": {"value": 990.0 / 4.4482216152605 * 0.0254**2.1, "unit": "lbf/in^(n+1)"},
        "k_phi": {"value": 1528430.0 / 4.4482216152605 * 0.0254**3.1, "unit": "lbf/in^(n+2)"},
        "n": 1.1,
    }
    for number, soil in enumerate((SAND, imperial)):
        (folder := tmp_path / str(number)).mkdir()
        driven = own_soil(load_rover(write(folder, cart(), {**TWO_AXLES, "soil": soil}))).value
        assert float(driven.k_1) == pytest.approx(990.0 * 0.1**0.1, rel=1e-4)
        assert float(driven.k_2) == pytest.approx(1528430.0 * 0.1**0.1, rel=1e-4)
        assert float(driven.n) == 1.1


@pytest.mark.parametrize(("change", "words"), [({"n": None}, "k_c needs n"), ({"k_phi": None}, "k_c needs k_phi"),
                                               ({"k_1": 1000.0}, "k_c and k_1"),
                                               ({"k_c": {"value": 1.0, "unit": "kPa"}}, "unit 'kPa'")])  # fmt: skip
def test_bekker_constants_that_are_incomplete_or_stated_twice_are_refused(tmp_path, change, words):
    soil = {name: value for name, value in {**SAND, **change}.items() if value is not None}
    rover = load_rover(write(tmp_path, cart(), {**TWO_AXLES, "soil": soil}))
    with pytest.raises(ParameterError, match=words):
        own_soil(rover)


def test_a_rocker_that_the_urdf_has_not_is_a_fault_also_where_joints_follow(tmp_path):
    farm = rocker_bogie().link("bar", "body", "revolute", "0 0 0.5", inner='<mimic joint="rocker_l" multiplier="0.5"/>')
    pairs = {"suspension": {"rocker": ["rocker_l", "gone"], "bogie": ["bogie_l", "bogie_r"], "bar": "bar"}}
    path = write(tmp_path, farm, {**THREE_AXLES, **pairs, "differential": {"pair": "rocker"}})
    assert any("'gone'" in fault for fault in check_urdf(path).faults)


def test_the_size_of_the_farm_is_the_one_that_is_drawn():
    """The hand calculations above take b = 0.1 m and a mass of 1 kg a wheel from the farm."""
    assert SIZE == {"r": 0.15, "b": 0.1}
    assert 'mass value="1.0"' in inertial(1.0, 0.15)
