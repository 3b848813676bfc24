"""Static loads with measured angles and driving torques: against plane statics, and drives over uneven ground."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.base.errors import ParameterError
from rover_pin.rover.driven_loads import configuration, determinate_groups, driven_loads, footing
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenario import scenario

NEXUS6 = load_rover("nexus6")
R = float(NEXUS6.wheel.r)


@pytest.mark.parametrize("slope", [-0.2, 0.0, 0.25])
def test_wheels_pulling_in_load_proportion_match_plane_statics(slope):
    """Torques r f_t with f_t = f_n tan(slope) are the plane statics' vertical forces."""
    plane = wheel_loads(NEXUS6, slope)
    q = configuration(NEXUS6, (0.0, -slope, 0.4), {})
    assert driven_loads(NEXUS6, q, R * plane * math.tan(slope)) == pytest.approx(plane, rel=1e-6)


def test_common_resistance_changes_loads_only_through_the_pivots():
    """Twice the torque on the flat is a resistance of the same share: only its moments on the pivots count."""
    q = configuration(NEXUS6, (0.0, 0.0, 0.0), {})
    flat = driven_loads(NEXUS6, q, np.zeros(6))
    assert flat == pytest.approx(wheel_loads(NEXUS6, 0.0), rel=1e-9)
    pulled = driven_loads(NEXUS6, q, 0.1 * R * flat)
    assert pulled.sum() == pytest.approx(flat.sum(), rel=1e-9)
    assert np.all(pulled[:2] < flat[:2])
    assert np.all(pulled[4:] > flat[4:])


def test_loads_carry_the_weight_on_a_side_slope():
    q = configuration(NEXUS6, (0.15, 0.1, 0.0), {})
    loads = driven_loads(NEXUS6, q, np.full(6, 0.03))
    foot, _ = footing(NEXUS6, q)
    along = (0.03 / R * foot.forward).sum(axis=0)
    assert loads.sum() == pytest.approx(NEXUS6.mass * 9.81 * foot.normal[0, 2], rel=1e-5)
    assert foot.normal[0] @ along == pytest.approx(0.0, abs=1e-12)
    assert foot.slope == pytest.approx(np.arcsin(foot.forward[:, 2]))


@pytest.mark.parametrize(
    ("name", "most", "plainly"), [("hills", 0.02, 0.15), ("cross-slope", 0.01, 0.12), ("slope", 0.02, 0.05)]
)
def test_they_are_the_normal_forces_of_a_drive(name, most, plainly):
    """RMS relative error over a drive on sand that resists; zero angles and pitch alone miss by `plainly` and more."""
    mine, plain = errors(scenario(name, soil="table-1", **{"soil.k": 0.005, "duration": 20.0}))
    assert np.sqrt(np.mean(np.square(mine))) < most
    assert np.sqrt(np.mean(np.square(plain))) > plainly


@pytest.mark.parametrize(("k", "off", "by_pitch"), [(0.05, 0.08, 0.07), (0.01, 0.115, 0.12), (0.005, 0.15, 0.15)])
def test_loads_on_rocks_err_as_stated_and_no_less_than_by_pitch(k, off, by_pitch):
    """Mean relative error: no sensor tells the slopes under the wheels, which bend within a wheelbase."""
    mine, plain = errors(scenario("rocks", soil="table-1", **{"soil.k": k, "duration": 24.0}))
    assert np.nanmean(np.abs(mine)) == pytest.approx(off, abs=0.01)
    assert np.nanmean(np.abs(plain)) == pytest.approx(by_pitch, abs=0.01)


def errors(scene):
    """Relative errors of the loads from angles and torques, and of those at the pitch alone; NaN for a wheel aloft."""
    trace = scene.drive()
    K, names = float(scene.model.motor.constant), [wheel.name for wheel in NEXUS6.wheels]
    mine, plain = [], []
    for at in range(60, len(trace.t), 20):
        attitude = tuple(trace[f"body_{each}"][at] for each in ("roll", "pitch", "yaw"))
        q = configuration(NEXUS6, attitude, {each: trace[each][at] for each in NEXUS6.angles if each in trace})
        normal = np.where((on := trace.stack("normal")[at]) > 0.2, on, np.nan)
        torque = K * np.array([trace[f"current_{each}_A"][at] for each in names])
        mine.append(driven_loads(NEXUS6, q, torque) / normal - 1.0)
        plain.append(wheel_loads(NEXUS6, -attitude[1]) / normal - 1.0)
    return np.array(mine), np.array(plain)


def test_an_angle_that_the_rover_has_not_is_refused():
    with pytest.raises(ParameterError, match=r"'nexus6'.*'boogie_l'"):
        configuration(NEXUS6, (0.0, 0.0, 0.0), {"boogie_l": 0.1})


def test_parallel_links_follow_the_angles_that_are_given():
    links = load_rover("nexus6_links")
    q = configuration(links, (0.0, 0.0, 0.0), {"bogie_l": 0.2, "rocker_l": 0.1, "rocker_r": -0.1})
    joint = next(each for each in links.couplings if each.q_leader == links.angles["bogie_l"])
    assert q[joint.q_follower] == pytest.approx(joint.ratio * 0.2)
    foot, _ = footing(links, q)
    assert driven_loads(links, q, np.zeros(6)) @ foot.normal[:, 2] == pytest.approx(links.mass * 9.81, rel=3e-3)


def rigid(wheels, skew=0.0, lift=0.0, inward=0.0):
    """Return a chassis with pairs of wheels at these places along it, no suspension.

    The front left wheel stands farther ahead and the right one less by `skew` [m], and farther in by `inward`; the
    middle axle is higher by `lift`.
    """
    sides = []
    for name, x in wheels:
        for side, sign in (("l", 1.0), ("r", -1.0)):
            off = skew * sign if name == "front" else 0.0
            y = 0.3 * sign + (inward if name + side == "frontr" else 0.0)
            sides.append((name, x + off, side, y, lift - 0.1 if name == "middle" else -0.1))
    return "".join(
        f'<link name="w{name}{side}"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" '
        f'izz="0.01"/></inertial></link><joint name="{name}{side}" type="continuous"><parent link="hull"/>'
        f'<child link="w{name}{side}"/><origin xyz="{x} {y} {z}"/><axis xyz="0 1 0"/></joint>'
        for name, x, side, y, z in sides
    )


HULL = (
    '<robot name="rigid"><link name="hull"><inertial><mass value="20"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
    'iyz="0" izz="1"/></inertial></link>'
)


def rigid_rover(folder, wheels, **places):
    (folder / "rigid.urdf").write_text(HULL + rigid(wheels, **places) + "</robot>")
    axles = "".join(f'{name} = ["{name}l", "{name}r"]\n' for name, _ in wheels)
    size = "[wheel]\nr = { value = 0.1, unit = 'm' }\nb = { value = 0.1, unit = 'm' }\n"
    (folder / "rigid.toml").write_text(f'name = "rigid"\nurdf = "rigid.urdf"\nbase = "hull"\n[wheels]\n{axles}{size}')
    return load_rover(folder / "rigid.toml")


@pytest.mark.parametrize(
    ("wheels", "groups"),
    [
        ((("front", 0.3), ("back", -0.3)), [(0, 1), (2, 3)]),
        ((("front", 0.3), ("middle", 0.0), ("back", -0.3)), [(0, 1, 2, 3, 4, 5)]),
    ],
)
def test_a_rigid_chassis_leaves_loads_open(tmp_path, wheels, groups):
    """Over four wheels the diagonals' share; over six also that of the middle axle: only the weight is told."""
    rover = rigid_rover(tmp_path, wheels)
    for attitude in ((0.0, 0.0, 0.0), (0.1, -0.2, 0.4)):
        assert determinate_groups(rover, *footing(rover, configuration(rover, attitude, {}))) == groups


@pytest.mark.parametrize(("share", "told"), [(0.095, True), (0.105, False)])
def test_axle_sum_is_determinate_if_open_modes_barely_move_it(tmp_path, share, told):
    """Front wheels at x + s and x - s: loads (1, -1 - e, e / 2 + g, e / 2 - g) balance where e = 2 s / (2 x - s)."""

    def moved(skew):
        e = 2 * skew / (0.6 - skew)
        g = (2 + e) / 2
        return e / math.sqrt(1 + (1 + e) ** 2 + (e / 2 + g) ** 2 + (e / 2 - g) ** 2)

    rover = rigid_rover(tmp_path, (("front", 0.3), ("back", -0.3)), skew=brentq(lambda s: moved(s) - share, 0.0, 0.2))
    found = determinate_groups(rover, *footing(rover, configuration(rover, (0.0, 0.0, 0.0), {})))
    assert found == ([(0, 1), (2, 3)] if told else [(0, 1, 2, 3)])


def test_determinate_load_beside_an_indeterminate_gives_no_axle(tmp_path):
    """The front right wheel stands amid the line from front left to back right: (1, -2, 0, 1) balances."""
    rover = rigid_rover(tmp_path, (("front", 0.3), ("back", -0.3)), skew=0.2, inward=0.299)
    found = determinate_groups(rover, *footing(rover, configuration(rover, (0.0, 0.0, 0.0), {})))
    assert found == [(0, 1, 2, 3)]


@pytest.mark.parametrize("lift", [0.0, 0.02, 0.05])
def test_the_balance_along_the_ground_tells_no_load(tmp_path, lift):
    """Three rigid axles on a crest: normals that lean along x tell their loads only if nothing else resists there."""
    rover = rigid_rover(tmp_path, (("front", 0.3), ("middle", 0.1), ("back", -0.3)), lift=lift)
    found = determinate_groups(rover, *footing(rover, configuration(rover, (0.0, 0.0, 0.0), {})))
    assert found == [(0, 1, 2, 3, 4, 5)]


@pytest.mark.parametrize("name", ["nexus6", "nexus6_links"])
def test_a_suspension_tells_every_wheel_s_load(name):
    rover = load_rover(name)
    posture = configuration(rover, (0.05, -0.1, 0.3), dict.fromkeys(rover.angles, 0.0))
    assert determinate_groups(rover, *footing(rover, posture)) == [(i,) for i in range(6)]


@pytest.mark.parametrize("gravity", [1e-4, 90.0])
def test_loads_grow_as_the_weight_does(gravity):
    """Torques in proportion: no load [N] is a measure of its own. On bent ground a wheel is lifted, and none counts."""
    rover = load_rover("nexus6")
    q = configuration(rover, (0.1, 0.35, 0.2), {"bogie_l": 0.6, "bogie_r": -0.3, "rocker_l": 0.3, "rocker_r": -0.3})
    torque = np.array([0.3, -0.2, 0.2, 0.1, 0.4, 0.3])
    loads = driven_loads(rover, q, torque)
    assert loads.min() < 0.0
    scaled = driven_loads(rover.under(gravity), q, torque * gravity / 9.81)
    assert scaled == pytest.approx(loads * gravity / 9.81, rel=1e-9)
