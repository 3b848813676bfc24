"""The forms that joints of real descriptions have, each against the same rover written the plain way."""

from __future__ import annotations

import math
import re

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import Trace, load_rover, scenario
from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.layout import shipped_toml
from rover_pin.rover.forward_dynamics import constraint_rows, forward_dynamics, forward_dynamics_aba, mass_matrix
from rover_pin.rover.statics import wheel_loads
from rover_pin.rover.urdf_check import check_urdf
from rover_pin.simulation.replay import commands, replay
from tests.rover import farm as made

Farm, cart, rocker_bogie, write = made.Farm, made.cart, made.rocker_bogie, made.write
ROCKERS, THREE_AXLES, TWO_AXLES = made.ROCKERS, made.THREE_AXLES, made.TWO_AXLES


def arm(farm: Farm) -> Farm:
    """A swivel, a telescope and a hand on the body."""
    farm.link("swivel", "body", "revolute", "0.2 0.1 0.3", "0 0 1", mass=1.5, rpy="0.1 0.2 0.3")
    farm.link("slide", "swivel_link", "prismatic", "0 0 0.2", "1 2 0", mass=0.7)
    return farm.link("hand", "slide_link", "continuous", "0.1 0 0", "0 1 1", mass=0.3)


HELD = {"swivel": 0.4, "slide": {"value": 150, "unit": "mm"}, "hand": {"value": -60, "unit": "deg"}}


def test_held_joints_are_those_of_pinocchios_reduced_model(tmp_path):
    farm = arm(cart())
    rover = load_rover(write(tmp_path, farm, {**TWO_AXLES, "held": HELD}))
    xml = pin.buildModelFromXML(farm.urdf, pin.JointModelFreeFlyer())
    q, angle = pin.neutral(xml), -math.pi / 3
    for name, value in (("swivel", 0.4), ("slide", 0.15)):
        q[xml.joints[xml.getJointId(name)].idx_q] = value
    at = xml.joints[xml.getJointId("hand")].idx_q
    q[at : at + 2] = math.cos(angle), math.sin(angle)
    reduced = pin.buildReducedModel(xml, [xml.getJointId(name) for name in HELD], q)
    assert rover.model.nv == reduced.nv == 10
    assert pin.computeTotalMass(rover.model) == pytest.approx(26.5)
    M = np.triu(pin.crba(reduced, reduced.createData(), pin.neutral(reduced)))
    assert mass_matrix(rover, pin.neutral(rover.model)) == pytest.approx(M + np.triu(M, 1).T, abs=1e-12)


def test_what_follows_a_held_joint_is_held_where_that_puts_it(tmp_path):
    arm_of = [
        cart()
        .link("elbow", "body", "revolute", "0 0 0.3", "0 0 1")
        .link("wrist", "elbow_link", "revolute", "0.3 0 0", "0 0 1", inner=inner)
        for inner in ('<mimic joint="elbow" multiplier="-2" offset="0.1"/>', "")
    ]
    follows = load_rover(write(tmp_path, arm_of[0], {**TWO_AXLES, "held": {"elbow": 0.2}}))
    rover = load_rover(write(tmp_path, arm_of[1], {**TWO_AXLES, "held": {"elbow": 0.2, "wrist": -0.3}}))
    assert follows.model.inertias[1] == rover.model.inertias[1]


def test_axes_of_either_sign_drive_as_the_plain_rover_does(tmp_path):
    """Nexus 6 with two wheels, a steering joint and the right rocker turned round; the differential then goes 1 : 1."""
    text = shipped_toml("nexus6").with_suffix(".urdf").read_text()
    for joint, old, new in (
        ("wheel_ml", "0 1 0", "0 -1 0"),
        ("wheel_fr", "0 1 0", "0 -1 0"),
        ("steer_rl", "0 0 1", "0 0 -1"),
        ("rocker_r", "0 1 0", "0 -1 0"),
    ):
        joint_text = re.search(rf'<joint name="{joint}".*?</joint>', text, re.S).group()
        assert old in joint_text
        turned = joint_text.replace(old, new).replace('multiplier="-1"', 'multiplier="1"')
        text = text.replace(joint_text, turned)
    (tmp_path / "nexus6.urdf").write_text(text)
    (tmp_path / "mine.toml").write_text(shipped_toml("nexus6").read_text())
    report = check_urdf(tmp_path / "mine.toml")
    assert report.ok
    assert any(
        re.search("wheel joints 'wheel_fr', 'wheel_ml' point to -y: .* roll forward", note) for note in report.notes
    )
    mirrored, plain = (
        scenario("one-sided-bump", rover=str(rover), soil="table-1", motor="speed-like", duration=6.0).drive()
        for rover in (tmp_path / "mine.toml", "nexus6")
    )
    for channel in ("body_x", "rocker_r", "wheel_rate_ml", "body_yaw"):
        assert mirrored[channel] == pytest.approx(plain[channel], abs=1e-9)


def test_an_endless_pivot_gets_stops_and_a_stopped_wheel_none(tmp_path):
    farm = rocker_bogie()
    text = farm.urdf.replace('name="bogie_l" type="revolute"', 'name="bogie_l" type="continuous"')
    text = text.replace('name="fl" type="continuous"', 'name="fl" type="revolute"')
    path = write(tmp_path, text, {**THREE_AXLES, **ROCKERS})
    notes = " ".join(check_urdf(path).notes)
    assert "joint 'bogie_l' is continuous" in notes
    assert re.search("'fl'.*revolute", notes)
    rover = load_rover(path)
    assert rover.model.upperPositionLimit[rover.angles["bogie_l"]] == pytest.approx(math.pi)
    assert rover.model.joints[rover.mount("fl").joint].nq == 2


def test_a_floating_world_and_a_base_that_is_not_the_root(tmp_path):
    """The base's own frame is the one that counts, wherever the root lies."""
    farm = cart()
    text = farm.urdf.replace(
        "</robot>",
        '<link name="world"/><link name="foot"/>'
        '<joint name="free" type="floating"><parent link="world"/><child link="foot"/></joint>'
        '<joint name="stand" type="fixed"><parent link="foot"/><child link="body"/><origin xyz="0 0 0.5" rpy="0 0 1"/>'
        "</joint></robot>",
    )
    rover, plain = (load_rover(write(tmp_path, urdf, TWO_AXLES)) for urdf in (text, farm))
    assert rover.model.jointPlacements[2].isApprox(plain.model.jointPlacements[2], 1e-12)
    assert rover.mass == pytest.approx(plain.mass)


def test_a_mimic_of_a_fixed_joint_is_left_out(tmp_path):
    text = rocker_bogie().urdf.replace("</robot>", "")
    text += (
        '<link name="lamp"/><joint name="mount" type="fixed"><parent link="body"/><child link="lamp"/>'
        '<mimic joint="bogie_l"/></joint></robot>'
    )
    report = check_urdf(write(tmp_path, text, {**THREE_AXLES, **ROCKERS}))
    assert report.ok
    assert any("joint 'mount' is fixed: its <mimic>" in note for note in report.notes)


def test_a_drawing_without_masses_is_told_once(tmp_path):
    text = re.sub("<inertial>.*?</inertial>", "", cart().urdf)
    (fault,) = check_urdf(write(tmp_path, text, TWO_AXLES)).faults
    assert "5 links" in fault


def turned_base(rpy: str) -> str:
    """The cart as seen from a base link whose axes are turned by rpy (one angle of pi)."""
    text = cart().urdf.replace('name="body"', 'name="hull"').replace('link="body"', 'link="hull"')
    ends = '<parent link="body"/><child link="hull"/>'
    stand = f'<link name="body"/><joint name="s" type="fixed">{ends}<origin rpy="{rpy}"/></joint></robot>'
    return text.replace("</robot>", stand)


@pytest.mark.parametrize(
    ("rpy", "words"),
    [("3.141592653589793 0 0", r"base_rpy = .3.14159265, 0, 0."), ("0 0 3.141592653589793", ".0, 0, 3.14159265.")],
)
def test_a_base_that_is_turned_is_refused_and_mended(tmp_path, rpy, words):
    path = write(tmp_path, turned_base(rpy), TWO_AXLES)
    assert any(re.search(words, fault) for fault in check_urdf(path).faults), check_urdf(path).faults
    mended = write(tmp_path, turned_base(rpy), {**TWO_AXLES, "base_rpy": [float(word) for word in rpy.split()]})
    rover = load_rover(mended)
    plain = load_rover(write(tmp_path, cart(), TWO_AXLES))
    assert rover.model.jointPlacements[2].translation == pytest.approx(plain.model.jointPlacements[2].translation)
    assert wheel_loads(rover, 0.05) == pytest.approx(wheel_loads(plain, 0.05))


GEAR = {
    "a bar that follows a rocker": {"bar": {"joint": "rocker_l", "ratio": -0.5}},
    "a bar that is the lead": {"rocker_l": {"joint": "bar", "ratio": -2.0}, "rocker_r": {"joint": "bar", "ratio": 2.0}},
    "a chain": {"bar": {"joint": "rocker_r", "ratio": 0.5}, "rocker_r": {"joint": "rocker_l", "ratio": -1.0}},
}


@pytest.mark.parametrize("gear", GEAR)
def test_a_bar_of_a_differential_moves_with_its_rockers(tmp_path, gear):
    farm = rocker_bogie().link("bar", "body", "revolute", "0 0 0.5", "0 0 1", mass=3.0)
    rover = load_rover(write(tmp_path, farm, {**THREE_AXLES, **ROCKERS, "coupled": GEAR[gear]}))
    (bar,) = rover.couplings
    assert (bar.leader, bar.ratio) == (rover.differential.left, -0.5)
    rng = np.random.default_rng(1)
    q, v = pin.neutral(rover.model), rng.normal(size=rover.model.nv)
    v[rover.differential.right], v[bar.follower] = -v[rover.differential.left], -0.5 * v[rover.differential.left]
    torques = rng.normal(size=rover.model.nv)
    fast, slow = (f(rover, q, v, torques, np.zeros((6, 6))) for f in (forward_dynamics, forward_dynamics_aba))
    assert fast.a == pytest.approx(slow.a, abs=1e-9 * np.abs(fast.a).max())
    assert constraint_rows(rover) @ fast.a == pytest.approx(0.0, abs=1e-9)


def test_a_gear_adds_its_inertia_to_the_rockers(tmp_path):
    """A wheel on the differential that turns n times as fast counts as n^2 I: energy at a rate of the rockers."""
    bars = [
        rocker_bogie().link("bar", "body", "revolute", "0 0 0.5", "0 0 1", mass=mass, size=1.0) for mass in (1e-6, 3.0)
    ]
    energies = []
    for farm in bars:
        coupled = {"bar": {"joint": "rocker_l", "ratio": 4.0}}
        rover = load_rover(write(tmp_path, farm, {**THREE_AXLES, **ROCKERS, "coupled": coupled}))
        v = np.zeros(rover.model.nv)
        left, right, _, _ = rover.differential
        v[left], v[right], v[rover.couplings[0].follower] = 1.0, -1.0, 4.0
        energies.append(0.5 * v @ mass_matrix(rover, pin.neutral(rover.model)) @ v)
    assert energies[1] - energies[0] == pytest.approx(0.5 * 0.3 * 4.0**2, rel=1e-6)


def test_tied_wheels_turn_together(tmp_path):
    """Skid-steer by one motor a side: under a load that lies in front each wheel alone would turn at its own rate."""
    farm, distance = cart(), {}
    farm.centre = "0.3 0 0.2"
    for tied in (False, True):
        path = write(tmp_path, farm, {**TWO_AXLES, "tied_sides": tied, "soil": {"name": "hit-lss1"}})
        trace = scenario("flat", rover=str(path), duration=3.0).drive()
        distance[tied] = [np.max(np.abs(trace[f"wheel_rate_r{side}"] - trace[f"wheel_rate_f{side}"])) for side in "lr"]
    assert min(distance[False]) > 1e-3
    assert max(distance[True]) < 1e-9


def sizes_apart() -> tuple[Farm, dict]:
    farm = Farm(centre="0 0 0.1")
    for name, x, z, r in (("f", 0.4, 0.0, 0.2), ("r", -0.4, -0.1, 0.1)):
        farm.wheel(f"{name}l", "body", f"{x} 0.35 {z}", r=r).wheel(f"{name}r", "body", f"{x} -0.35 {z}", r=r)
    return farm, {**TWO_AXLES, "wheel": {"b": 0.1, "front": {"r": 0.2}, "rear": {"r": 0.1}}}


TRAITS = {
    "axles turned round": lambda: (cart(axis="0 -1 0"), TWO_AXLES),
    "axles tilted by 5 deg": lambda: (cart(axis="0 0.9962 0.0872"), TWO_AXLES),
    "wheels of two sizes": sizes_apart,
    "joints held, one of them prismatic": lambda: (arm(cart()), {**TWO_AXLES, "held": HELD}),
    "springs on the bogies": lambda: (
        rocker_bogie(),
        {**THREE_AXLES, **ROCKERS, "springs": {"bogie": {"k_s": 400.0, "d": 5.0}}},
    ),
    "a bar geared to the rockers": lambda: (
        rocker_bogie().link("bar", "body", "revolute", "0 0 0.5", "0 0 1", mass=3.0),
        {**THREE_AXLES, **ROCKERS, "coupled": {"bar": {"joint": "rocker_l", "ratio": -0.5}}},
    ),
}


@pytest.mark.parametrize("trait", TRAITS)
def test_a_rover_with_any_trait_is_sound_and_drives(tmp_path, trait):
    path = write(tmp_path, *TRAITS[trait]())
    assert check_urdf(path).ok, check_urdf(path).faults
    trace = scenario("flat", rover=str(path), duration=4.0).drive()
    assert 0.1 < trace["body_x"][-1] < 0.6
    assert abs(trace["body_y"][-1]) < 0.01
    assert abs(trace.energy_error()) < 1e-3


@pytest.mark.parametrize("is_held", [False, True])
def test_a_log_of_tied_wheels_is_replayed_by_duties_and_by_rates(tmp_path, is_held):
    """Two tachogenerators on one belt never agree; held each to its own, their wheels would be torn apart."""
    path = write(tmp_path, cart(), {**TWO_AXLES, "tied_sides": True, "soil": {"name": "hit-lss1"}})
    drive = scenario("one-sided-bump", rover=str(path), duration=4.0, motor="speed-like")
    true = drive.drive()
    channels = {name: values for name, values in true.channels.items() if not (is_held and name.startswith("duty_"))}
    if is_held:
        random = np.random.default_rng(0)
        channels |= {
            name: channels[name] + random.normal(0.0, 0.01, len(true.t)) for name in channels if "wheel_rate" in name
        }
    log = Trace(channels, true.units, {**true.attrs, "start": {"x": 0.0, "y": 0.0, "yaw": 0.0}})
    run = commands(log, true.wheels, ())
    assert run.rate_driven == is_held
    driven = replay(drive.model, run).channels
    for front, rear in (("fl", "rl"), ("fr", "rr")):
        assert driven[f"wheel_rate_{front}"] == pytest.approx(driven[f"wheel_rate_{rear}"], abs=1e-9)
        late = run.t > 1.0
        drawn = np.interp(run.t, true.t, true[f"current_{rear}_A"])[late]
        assert np.mean(driven[f"current_{rear}_A"][late]) == pytest.approx(np.mean(drawn), rel=0.1)
        assert np.max(np.abs(driven[f"current_{rear}_A"][late] - drawn)) < np.mean(drawn)


DUMMY = '<link name="imu"><inertial><mass value="1e-3"/>{}</inertial></link>'.format(
    '<inertia ixx="1e-9" ixy="0" ixz="0" iyy="1e-9" iyz="0" izz="1e-7"/>'
)


def test_a_small_fixed_links_inertia_is_a_note(tmp_path):
    fixed = DUMMY + '<joint name="i" type="fixed"><parent link="body"/><child link="imu"/></joint></robot>'
    report = check_urdf(write(tmp_path, cart().urdf.replace("</robot>", fixed), TWO_AXLES))
    assert report.ok, report.faults
    assert any("'imu'" in note and "principal" in note for note in report.notes)
    heavy = fixed.replace('mass value="1e-3"', 'mass value="30"')
    assert not check_urdf(write(tmp_path, cart().urdf.replace("</robot>", heavy), TWO_AXLES)).ok


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"held": {"swivle": 0.0}}, "'swivle',.*TOML's .held..*'swivel'"),
        ({"held": {"swivel": 1.0}}, r"'swivel' = 1.*\[-0.8, 0.8\]"),
        ({"held": {"slide": {"value": 3, "unit": "deg"}}}, "'slide':.*'deg'"),
        ({"held": {"swivel": {"value": 3, "unti": "deg"}}}, "key 'unti'"),
        ({"cut": ["x"]}, "no joint 'x', which the TOML's cut names"),
        ({"cut": "x"}, "cut = 'x'.*joint"),
        ({"coupled": {"hand": 3}}, r"coupled.hand = 3.*\{"),
        ({"coupled": {"hand": {"joint": "swivel", "rate": 2}}}, "coupled.hand.*'rate'"),
        ({"coupled": {"hand": "nobody"}}, r"no joint 'nobody', which the TOML's \[coupled\] names"),
        ({"coupled": {"fl": {"joint": "rl", "ratio": -1.0}}}, "'fl'.*against 'rl'"),
        ({"tied_sides": 1}, "tied_sides = 1"),
        ({"suspension": {"arm": ["a", "b"], "arm_l": "c"}}, "'arm_l'"),
        ({"suspension": {"slide": "hand"}, "coupled": {"slide": "hand"}, "held": {}}, "called 'slide'"),
        ({"base_rpy": [0, 0, 1e300]}, "angles within"),
        ({"base_rpy": [1, 2]}, r"base_rpy = \[1, 2\]"),
        ({"wheels": {"front": ["fl", "fr"], "rear": "rl"}}, "wheels.rear = 'rl'"),
        ({"wheel": {"r": 0.1}}, r"\[wheel\].*'b'.*'front'"),
        ({"springs": {"rocker": {"k_s": 1}}}, r"\[springs\] names 'rocker', which \[suspension\] does not have"),
        ({"motor": {"stall_torque": 1}}, r"\[motor\].*'no_load_speed'"),
        ({"motor": {"stall_torque": -1, "no_load_speed": 2}}, "MotorSheet.stall_torque = -1 N"),
    ],
)
def test_forms_that_cannot_be_taken_get_a_sentence(tmp_path, table, words):
    path = write(tmp_path, arm(cart()), {**TWO_AXLES, "held": HELD, **table})
    with pytest.raises(UrdfError, match=words):
        load_rover(path)


def test_joints_mimicking_in_a_ring_or_by_two_ratios_are_refused(tmp_path):
    farm = rocker_bogie()
    ring = {"bogie_l": "bogie_r", "bogie_r": "bogie_l"}
    with pytest.raises(UrdfError, match="'bogie_l'"):
        load_rover(write(tmp_path, farm, {**THREE_AXLES, **ROCKERS, "coupled": ring}))
    farm.link("bar", "body", "revolute", "0 0 0.5", "0 0 1")
    both = {"rocker_l": {"joint": "bar", "ratio": 2.0}, "rocker_r": {"joint": "bar", "ratio": 2.0}}
    with pytest.raises(UrdfError, match=r"'rocker_r'"):
        load_rover(write(tmp_path, farm, {**THREE_AXLES, **ROCKERS, "coupled": both}))
