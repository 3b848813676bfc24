"""Runs from ROS bags: the numbers that were written come back on one clock, and every mistake is named."""

import math
import re
import sys

import numpy as np
import pytest

from rover_pin.base.errors import DataError, MissingExtraError
from rover_pin.logs.drive_log import read_drive_log

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as BagOne
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagTwo
from rosbags.typesys import Stores, get_typestore

ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
BEGIN = 1_700_000_000_000_000_000
YAW_RATE, LATE = 0.4, 50_000_000
"""The tracker's yaw turns through pi; joint states are received 50 ms after their stamp."""


def header(types, t):
    stamp = types.types["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
    fields = {"stamp": stamp, "frame_id": "world"}
    return types.types["std_msgs/msg/Header"](**({"seq": 0} if types is ROS1 else {}), **fields)


def joints(types, t, names=("wheel_fl", "wheel_fr"), reverse=False):
    s = (t - BEGIN) * 1e-9
    order = list(names)[::-1] if reverse else list(names)
    rates = {"wheel_fl": 1.0 + 0.1 * s, "wheel_fr": 2.0 - 0.1 * s, "arm": 9.0}
    values = np.array([rates[name] for name in order])
    kind = types.types["sensor_msgs/msg/JointState"]
    return kind(header=header(types, t), name=order, position=0 * values, velocity=values, effort=np.zeros(0))


def pose(types, t):
    s, kinds = (t - BEGIN) * 1e-9, types.types
    yaw, pitch = 2.5 + YAW_RATE * s, 0.2
    half = np.array([math.cos(pitch / 2) * math.cos(yaw / 2), -math.sin(pitch / 2) * math.sin(yaw / 2)])
    w, x = half
    y, z = math.sin(pitch / 2) * math.cos(yaw / 2), math.cos(pitch / 2) * math.sin(yaw / 2)
    place = kinds["geometry_msgs/msg/Point"](x=50.0 * s, y=-1.0, z=0.25)
    turned = kinds["geometry_msgs/msg/Quaternion"](x=float(x), y=float(y), z=float(z), w=float(w))
    where = kinds["geometry_msgs/msg/Pose"](position=place, orientation=turned)
    return kinds["geometry_msgs/msg/PoseStamped"](header=header(types, t), pose=where)


def duty(types, t):
    kinds, percent = types.types, 40.0 if t - BEGIN < 1_000_000_000 else -60.0
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    return kinds["std_msgs/msg/Float64MultiArray"](layout=layout, data=np.array([percent, 0.0]))


def messages(types):
    """(received, topic, message) in order: joints at 50 Hz, half with the names turned round; poses at 20 Hz."""
    stamped = []
    for i in range(150):
        t = BEGIN + 20_000_000 * i
        stamped.append((t + LATE, "/joint_states", joints(types, t, reverse=i % 2 == 1)))
        stamped += [(t + LATE + 1, "/joint_states", joints(types, t, ("arm",)))] if i % 10 == 5 else []
    for i in range(60):
        t = BEGIN + 50_000_000 * i
        stamped += [(t, "/tracker", pose(types, t))] if not 20 < i < 30 else []
    stamped += [(BEGIN + t, "/command", duty(types, BEGIN + t)) for t in (0, 1_000_000_000)]
    return sorted(stamped, key=lambda stamped_message: stamped_message[0])


def write(writer, types):
    with writer as bag:
        connections = {}
        for received, topic, message in messages(types):
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=types)
            pack = types.serialize_ros1 if types is ROS1 else types.serialize_cdr
            bag.write(connections[topic], received, pack(message, message.__msgtype__))


def two(folder, plugin):
    write(BagTwo(folder / "run", version=9, storage_plugin=plugin), ROS2)
    return folder / "run"


TRACKER = '{{ topic = "/tracker", field = "{}" }}'
COMMAND = '{{ topic = "/command", field = "{}" }}'
COLUMNS = {
    "duty_fl": '{ topic = "/command", field = "data[0]", scale = 0.01 }',
    "wheel_rate_fl": '{ topic = "/joint_states", field = "velocity[name=wheel_fl]", stamp = "header.stamp" }',
    "wheel_rate_fr": '{ topic = "/joint_states", field = "velocity[name=wheel_fr]", unit = "rpm" }',
    "body_x": '{ topic = "/tracker", field = "pose.position.x", unit = "mm" }',
    "body_yaw": TRACKER.format("pose.orientation.yaw"),
    "body_pitch": TRACKER.format("pose.orientation.pitch"),
    "body_roll": TRACKER.format("pose.orientation.roll"),
}
PERIOD = '[bag]\nperiod = { value = 40, unit = "ms" }\n'


def describe(folder, file, bag=PERIOD, **changes):
    columns = {name: entry for name, entry in {**COLUMNS, **changes}.items() if entry}
    lines = [f"{name} = {entry}" for name, entry in columns.items()]
    table = "[columns]\n" + "\n".join(lines) + "\n" if lines else ""
    text = f'kind = "drive-log"\nname = "bags"\nwheels = ["fl", "fr"]\n{bag}{table}[[run]]\nfile = "{file}"\n'
    (folder / "drive.toml").write_text(text)
    return folder


def bag_folder(folder):
    return two(folder, StoragePlugin.SQLITE3).name


def bag_file(folder, plugin, suffix):
    (file,) = two(folder, plugin).glob(f"*{suffix}")
    return f"run/{file.name}"


MADE = {
    "folder": bag_folder,
    "db3": lambda folder: bag_file(folder, StoragePlugin.SQLITE3, ".db3"),
    "mcap": lambda folder: bag_file(folder, StoragePlugin.MCAP, ".mcap"),
    "bag": lambda folder: write(BagOne(folder / "run.bag"), ROS1) or "run.bag",
}


@pytest.mark.parametrize("kind", MADE)
def test_what_was_written_comes_back_on_one_clock(tmp_path, kind):
    (run,) = read_drive_log(describe(tmp_path, MADE[kind](tmp_path))).runs
    t = run["t_s"]
    assert t == pytest.approx(0.04 * np.arange(len(t)))
    assert (t[0], t[-1] > 2.8) == (0.0, True)
    late = 1e-9 * LATE  # the clock begins with the first joint states received, the last channel to come
    assert run["duty_fl"] == pytest.approx(np.where(t + late < 1.0 - 1e-6, 0.4, -0.6))
    assert run["wheel_rate_fl"] == pytest.approx(1.0 + 0.1 * (t + late), abs=1e-9)
    assert run["wheel_rate_fr"] == pytest.approx((2.0 - 0.1 * t) * math.pi / 30.0, abs=1e-9)
    missing = (t + late > 1.0) & (t + late < 1.5)
    assert np.array_equal(np.isnan(run["body_x"]), missing)
    assert run["body_x"][~missing] == pytest.approx(0.05 * (t + late)[~missing])
    assert run["body_yaw"][~missing] == pytest.approx(2.5 + YAW_RATE * (t + late)[~missing])
    assert run["body_pitch"][~missing] == pytest.approx(0.2)
    assert run["body_roll"][~missing] == pytest.approx(0.0, abs=1e-12)
    assert (run.unit("body_x"), run.attrs["file"]) == ("m", MADE_FILE[kind])


MADE_FILE = {"folder": "run", "db3": "run/run.db3", "mcap": "run/run.mcap", "bag": "run.bag"}


FL = COLUMNS["wheel_rate_fl"]


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shared")
    return folder, bag_file(folder, StoragePlugin.MCAP, ".mcap")


@pytest.mark.parametrize(
    ("bag", "changes", "says"),
    [
        (PERIOD, {"duty_fl": '{ topic = "/comand", field = "a" }'}, "topic '/comand' for duty_fl"),
        (PERIOD, {"body_x": TRACKER.format("pose.positon.x")}, "field 'positon' for body_x"),
        (PERIOD, {"body_x": TRACKER.format("pose.position")}, "number, but"),
        (PERIOD, {"body_yaw": TRACKER.format("pose.orientation.jaw")}, "body_yaw: did you"),
        (PERIOD, {"body_x": TRACKER.format("header.frame_id")}, "'header.frame_id' of topic '/tracker' is no"),
        (PERIOD, {"duty_fl": COMMAND.format("data[2]")}, "'data' of topic '/command' has 2 entries"),
        (PERIOD, {"duty_fl": COMMAND.format("layout[2]")}, "'layout' of topic '/command'"),
        (PERIOD, {"wheel_rate_fl": FL.replace("wheel_fl", "wheel_lf")}, "topic '/joint_states' names 'wheel_lf'"),
        (PERIOD, {"wheel_rate_fl": FL.replace("header.stamp", "header.frame_id")}, "time"),
        (PERIOD, {"wheel_rate_fl": FL.replace("name=", "nam=")}, "field 'nam'"),
        (PERIOD, {"body_x": "3"}, "[columns] body_x = 3 "),
        (PERIOD, {"body_x": '{ topic = "/tracker" }'}, "[columns] body_x = {'topic': '/tracker'} "),
        (PERIOD, {"body_x": '{ topic = "/t", field = "x", scal = 2 }'}, "you mean 'scale'?"),
        (PERIOD, {"body_x": '{ topic = "/t", field = "x", scale = true }'}, "body_x: scale = True"),
        (PERIOD, {"body_x": '{ topic = "/t", field = "x", hold = 1 }'}, "body_x: hold = 1"),
        (PERIOD, {"body_x": '{ topic = "/t", field = "x[" }'}, "[columns] body_x"),
        (PERIOD, {"body_x": COLUMNS["body_x"].replace("mm", "mN m")}, "body_x: unit 'mN m'"),
        (PERIOD, dict.fromkeys(COLUMNS), "table [columns]"),
        ("", {}, "[bag] period = { value = 40, unit ="),
        ("[bag]\nperiod = 0\n", {}, "is 0"),
        ('[bag]\nperiod = { value = 1, unit = "m" }\n', {}, "period: unit 'm'"),
        ("[bag]\nperiods = 1\n", {}, "'periods'"),
        ("[bag]\nperiod = 9.0\n", {}, "in common"),
        ("[bag]\nperiod = 1e-9\n", {}, "[bag] period = 1e-09 s gives 29"),
    ],
)  # fmt: skip
def test_mistakes_in_the_map(shared, bag, changes, says):
    folder, file = shared
    with pytest.raises(DataError, match=re.escape(says)) as refused:
        read_drive_log(describe(folder, file, bag, **changes))
    assert "\n" not in str(refused.value)


def test_times_that_run_back(tmp_path):
    with BagTwo(tmp_path / "run", version=9) as bag:
        connection = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=ROS2)
        for i, t in enumerate((0, 20, 10)):
            message = joints(ROS2, BEGIN + 10**6 * t)
            bag.write(connection, BEGIN + 10**6 * i, ROS2.serialize_cdr(message, message.__msgtype__))
    only = {name: COLUMNS[name] if name == "wheel_rate_fl" else "" for name in COLUMNS}
    with pytest.raises(DataError, match=r"'/joint_states'.*3:.*`stamp`"):
        read_drive_log(describe(tmp_path, "run", **only))


def test_what_is_no_bag_or_cannot_be_read(tmp_path, monkeypatch):
    (tmp_path / "run.mcap").write_text("no bag")
    (tmp_path / "run").mkdir()
    for name in ("run.mcap", "run"):
        with pytest.raises(DataError, match=r"cannot.*") as refused:
            read_drive_log(describe(tmp_path, name))
        assert "\n" not in str(refused.value)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(MissingExtraError, match="rosbags>="):
        read_drive_log(describe(tmp_path, "run.mcap"))
