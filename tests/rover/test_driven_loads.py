"""Static loads with measured angles and driving torques: against plane statics, and drives over uneven ground."""

import math

import numpy as np
import pytest

from rover_pin import load_rover, scenario
from rover_pin.base.errors import ParameterError
from rover_pin.rover.driven_loads import configuration, determinate_groups, driven_loads, footing
from rover_pin.rover.statics import wheel_loads

NEXUS6 = load_rover("nexus6")
R = float(NEXUS6.wheel.r)


@pytest.mark.parametrize("slope", [-0.2, 0.0, 0.25])
def test_wheels_pulling_in_load_proportion_match_plane_statics(slope):
    """Torques r f_t with f_t = f_n tan(slope) are the plane statics' vertical forces."""
    plane = wheel_loads(NEXUS6, slope)
    q = configuration(NEXUS6, (0.0, -slope, 0.4), {})
    assert driven_loads(NEXUS6, q, R * plane * math.tan(slope), *footing(NEXUS6, q)) == pytest.approx(plane, rel=1e-6)


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
        attitude = tuple(trace[f"body_{angle_name}"][at] for angle_name in ("roll", "pitch", "yaw"))
        q = configuration(
            NEXUS6, attitude, {angle_name: trace[angle_name][at] for angle_name in NEXUS6.angles if angle_name in trace}
        )
        normal = np.where((on := trace.stack("normal")[at]) > 0.2, on, np.nan)
        torque = K * np.array([trace[f"current_{angle_name}_A"][at] for angle_name in names])
        mine.append(driven_loads(NEXUS6, q, torque, *footing(NEXUS6, q)) / normal - 1.0)
        plain.append(wheel_loads(NEXUS6, -attitude[1]) / normal - 1.0)
    return np.array(mine), np.array(plain)


def test_an_angle_that_the_rover_has_not_is_refused():
    with pytest.raises(ParameterError, match=r"'nexus6'.*'boogie_l'"):
        configuration(NEXUS6, (0.0, 0.0, 0.0), {"boogie_l": 0.1})


def test_parallel_links_follow_the_angles_that_are_given():
    links = load_rover("nexus6_links")
    q = configuration(links, (0.0, 0.0, 0.0), {"bogie_l": 0.2, "rocker_l": 0.1, "rocker_r": -0.1})
    joint = next(coupling for coupling in links.couplings if coupling.q_leader == links.angles["bogie_l"])
    assert q[joint.q_follower] == pytest.approx(joint.ratio * 0.2)
    foot, jacobians = footing(links, q)
    loads = driven_loads(links, q, np.zeros(6), foot, jacobians)
    assert loads @ foot.normal[:, 2] == pytest.approx(links.mass * 9.81, rel=3e-3)


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
