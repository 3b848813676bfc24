"""The ROS 2 node with a replacement of rclpy in one process: messages follow their definitions, and pass
through CDR."""

from __future__ import annotations

import importlib
import re
import sys
import types
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin.cli.app import app
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.scenarios.scenario import scenario

pytest.importorskip("rosbags")
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

ROS = get_typestore(Stores.ROS2_JAZZY)
PACKAGE = Path(__file__).parents[2] / "studies" / "ros2" / "rover_pin_node"
PERIOD = 50_000_000
ZEROS = {"string": "", "bool": False, "float64": 0.0, "float32": 0.0}
MESSAGES = {
    "geometry_msgs": ("Twist",),
    "nav_msgs": ("Odometry",),
    "sensor_msgs": ("JointState",),
    "std_msgs": ("Float64MultiArray", "MultiArrayDimension"),
}


class Message:
    """A message as in rclpy: its fields have defaults and the types of its definition, and there are no other
    fields.
    """

    kind = ""

    def __init__(self, **values):
        for name, form in ROS.get_msgdef(self.kind).fields:
            object.__setattr__(self, name, blank(form))
        for name, value in values.items():
            setattr(self, name, value)

    def __setattr__(self, name, value):
        forms = dict(ROS.get_msgdef(self.kind).fields)
        fits(value, forms[name], f"{self.kind}.{name}")
        object.__setattr__(self, name, value)


def message_class(kind):
    return type(kind.rpartition("/")[2], (Message,), {"kind": kind})


def blank(form):
    node, messages = form
    if node == Nodetype.NAME:
        return message_class(messages)()
    if node == Nodetype.ARRAY:
        return [blank(messages[0]) for _ in range(messages[1])]
    return [] if node == Nodetype.SEQUENCE else ZEROS.get(messages[0], 0)


def fits(value, form, where):
    node, messages = form
    if node == Nodetype.NAME:
        assert value.kind == messages, where
    elif node == Nodetype.BASE:
        assert type(value) is type(blank(form)), f"{where} = {value!r}"
    else:
        assert isinstance(value, list), where
        for element in value:
            fits(element, messages[0], where)


def stored(value):
    """Return a message in the form of rosbags."""
    if isinstance(value, Message):
        for name, form in ROS.get_msgdef(value.kind).fields:
            fits(getattr(value, name), form, name)
        names = [name for name, _ in ROS.get_msgdef(value.kind).fields]
        return ROS.types[value.kind](**{name: stored(getattr(value, name)) for name in names})
    if isinstance(value, list):
        return (
            np.array(value)
            if value and type(value[0]) is float
            else [stored(element) for element in value] or np.zeros(0)
        )
    return value


class Loopback:
    """A ROS graph within one process, whose clock the test advances. Published messages are encoded to bytes and
    decoded again.
    """

    def __init__(self, parameters):
        self.parameters, self.now, self.sent, self.readers, self.said = parameters, 10**18, [], {}, []
        self.timers = []

    def publish(self, topic, message):
        raw = ROS.serialize_cdr(stored(message), message.kind)
        self.sent.append((topic, self.now, message.kind, raw))
        for read in self.readers.get(topic, ()):
            read(message)

    def run(self, seconds):
        for _ in range(round(seconds / 0.05)):
            self.now += PERIOD
            for timer in self.timers:
                if not timer.cancelled:
                    timer.call()

    def last(self, topic):
        kind, raw = next((kind, raw) for name, _, kind, raw in reversed(self.sent) if name == topic)
        return ROS.deserialize_cdr(raw, kind)


class Time(SimpleNamespace):
    """A time in nanoseconds; the difference of two times is a duration."""

    def __sub__(self, second):
        return SimpleNamespace(nanoseconds=self.nanoseconds - second.nanoseconds)

    def to_msg(self):
        return message_class("builtin_interfaces/msg/Time")(
            sec=self.nanoseconds // 10**9, nanosec=self.nanoseconds % 10**9
        )


class Timer(SimpleNamespace):
    """A timer that can be cancelled."""

    def cancel(self):
        self.cancelled = True


def node_class(graph):
    """Return the parts of rclpy's Node that the node uses, on the replacement graph."""

    class Node:
        def __init__(self, name):
            self.name = name

        def declare_parameter(self, name, default):
            return SimpleNamespace(value=graph.parameters.get(name, default))

        def create_publisher(self, kind, topic, depth):
            return SimpleNamespace(publish=lambda message: graph.publish(topic, message))

        def create_subscription(self, kind, topic, callback, depth):
            graph.readers.setdefault(topic, []).append(callback)

        def create_timer(self, period, callback):
            assert period == pytest.approx(1e-9 * PERIOD)
            graph.timers.append(Timer(call=callback, cancelled=False))
            return graph.timers[-1]

        def get_clock(self):
            return SimpleNamespace(now=lambda: Time(nanoseconds=graph.now))

        def get_logger(self):
            return SimpleNamespace(warning=graph.said.append, error=graph.said.append)

    return Node


@pytest.fixture
def start(monkeypatch):
    """Start the node with parameters, and return its graph."""

    def started(**parameters):
        graph = Loopback(parameters)
        modules = {"rclpy": {}, "rclpy.node": {"Node": node_class(graph)}}
        for package, names in MESSAGES.items():
            modules[package] = {}
            modules[f"{package}.msg"] = {name: message_class(f"{package}/msg/{name}") for name in names}
        for name, members in modules.items():
            module = types.ModuleType(name)
            module.__dict__.update(members)
            monkeypatch.setitem(sys.modules, name, module)
        monkeypatch.syspath_prepend(str(PACKAGE))
        for name in ("rover_pin_node", "rover_pin_node.node"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        graph.node = importlib.import_module("rover_pin_node.node").RoverNode()
        return graph

    return started


def command(graph, x=0.0, yaw_rate=0.0, y=0.0):
    twist = message_class("geometry_msgs/msg/Twist")()
    twist.linear.x, twist.linear.y, twist.angular.z = x, y, yaw_rate
    graph.publish("cmd_vel", twist)


def drive(graph, seconds, **commanded):
    """Send a command every 0.2 s, as a joystick does."""
    for _ in range(round(seconds / 0.2)):
        command(graph, **commanded)
        graph.run(0.2)


def test_the_node_drives_as_the_same_control_in_one_drive(start):
    graph = start(scenario="hills")
    drive(graph, 2.0, x=0.02, yaw_rate=0.05)
    chosen = scenario("hills", control="cmd-vel", duration=2.0, **{"control.speed": 0.02, "control.yaw_rate": 0.05})
    trace = chosen.drive(measure_error=False)
    odom, joints = graph.last("odom"), graph.last("joint_states")
    position = odom.pose.pose.position
    assert [position.x, position.y, position.z] == [trace[f"body_{axis}"][-1] for axis in "xyz"]
    assert graph.last("wheel_slip").data == pytest.approx(trace.stack("slip")[-1], abs=0.0)
    assert graph.last("wheel_slip").layout.dim[0].label.split() == list(trace.wheels)
    rates = dict(zip(joints.name, joints.velocity, strict=True))
    assert [rates[f"wheel_{name}"] for name in trace.wheels] == pytest.approx(trace.stack("wheel_rate")[-1].tolist())
    assert dict(zip(joints.name, joints.position, strict=True))["rocker_l"] == pytest.approx(trace["rocker_l"][-1])


def test_sent_messages_describe_one_motion(start):
    """Pose, twist and joint angles describe one motion, and the joints are those of the URDF."""
    graph = start(rover="cart")
    drive(graph, 6.0, x=0.03, yaw_rate=0.05)
    poses = [ROS.deserialize_cdr(raw, kind) for topic, _, kind, raw in graph.sent if topic == "odom"]
    yaw = np.unwrap(
        [2.0 * np.arctan2(message.pose.pose.orientation.z, message.pose.pose.orientation.w) for message in poses]
    )
    x, y = ([getattr(message.pose.pose.position, axis) for message in poses] for axis in "xy")
    middle = len(poses) // 2
    late = slice(middle, middle + 20)
    assert np.gradient(yaw, 0.05)[late] == pytest.approx(
        [message.twist.twist.angular.z for message in poses[late]], rel=0.02
    )
    along = np.cos(yaw) * np.gradient(x, 0.05) + np.sin(yaw) * np.gradient(y, 0.05)
    assert along[late] == pytest.approx([message.twist.twist.linear.x for message in poses[late]], rel=0.05)
    assert yaw[-1] > 0.05
    states = [ROS.deserialize_cdr(raw, kind) for topic, _, kind, raw in graph.sent if topic == "joint_states"]
    angles, rates = (np.array([getattr(message, name) for message in states]) for name in ("position", "velocity"))
    assert np.gradient(angles, 0.05, axis=0)[late] == pytest.approx(rates[late], abs=0.01)
    text = scenario("flat", rover="cart").model.rover.urdf
    urdf = re.findall(r'<joint name="(\w+)" type="(?:continuous|revolute)"', text)
    assert set(states[0].name) <= set(urdf)
    assert states[0].header.stamp.sec == 10**9


def test_without_commands_the_rover_stands(start):
    graph = start()
    drive(graph, 1.0, x=0.03)
    moving = graph.last("odom").twist.twist.linear.x
    graph.run(2.0)
    assert abs(graph.last("odom").twist.twist.linear.x) < 0.02 * moving


def test_a_command_beyond_the_motors_is_reported_and_limited(start):
    graph = start()
    drive(graph, 0.4, x=0.02)
    command(graph, x=5.0)
    graph.run(0.2)
    (warning,) = graph.said
    assert "cmd_vel" in warning
    assert "wheel" in warning
    assert graph.last("odom").twist.twist.linear.x > 0.01


def bag(graph, folder):
    with Writer(folder, version=9) as writer:
        connections = {}
        for topic, at, kind, raw in graph.sent:
            if topic not in connections:
                connections[topic] = writer.add_connection(f"/{topic}", kind, typestore=ROS)
            writer.write(connections[topic], at, raw)
    return folder


def test_a_recorded_bag_is_imported(start, tmp_path):
    """The importer recognises the columns by their names and by each other, and their values are those of the drive."""
    graph = start(rover="cart")
    drive(graph, 8.0, x=0.03)
    drive(graph, 4.0, x=0.05)
    log = tmp_path / "log"
    words = ["import-log", str(bag(graph, tmp_path / "bag")), "--rover", "cart", "--out", str(log)]
    assert CliRunner().invoke(app, words).exit_code == 0
    (run,) = read_drive_log(log).runs
    straight = {"rover": "cart", "control": "cmd-vel", "control.speed": 0.03}
    trace = scenario("flat", duration=8.0, **straight).drive(measure_error=False)
    late = slice(20, 140)
    for name in ("body_x", "body_z", "body_yaw", *(f"wheel_rate_{wheel}" for wheel in trace.wheels)):
        values = np.interp(trace.t[late], run.t, run[name])
        assert values == pytest.approx(trace[name][late], abs=1e-2 * np.ptp(trace[name]) + 1e-9), name


def test_the_packages_files_name_the_needs_of_the_node():
    manifest, setup = ((PACKAGE / name).read_text(encoding="utf-8") for name in ("package.xml", "setup.py"))
    code = (PACKAGE / "rover_pin_node" / "node.py").read_text(encoding="utf-8")
    needed = {"rclpy", *re.findall(r"^from (\w+_msgs)\.msg", code, re.MULTILINE)}
    assert set(re.findall("<exec_depend>(.*)</exec_depend>", manifest)) == needed == {"rclpy", *MESSAGES}
    assert re.findall("<name>(.*)</name>", manifest) == re.findall('NAME = "(.*)"', setup)
    assert (PACKAGE / "resource" / "rover_pin_node").exists()
