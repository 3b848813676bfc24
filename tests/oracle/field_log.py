"""Recordings of drives of two other rovers, made by `independent`; imports nothing of rover_pin.

Both rovers have no differential: one has six wheels on three bogies, the other has four wheels and neither suspension
nor steering. They drive over waves and a slope in both directions. The pose from a camera drifts, rates and tilts have
noise, and the ground is not declared.
"""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent / "independent"
if "independent" not in sys.modules:
    _spec = importlib.util.spec_from_file_location("independent", HERE / "__init__.py")
    sys.modules["independent"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["independent"])
physics, rest, drive, soil = (
    importlib.import_module(f"independent.{name}") for name in ("physics", "rest", "drive", "soil")
)

STEP = 0.005
R, B = 0.15, 0.12
SOIL = soil.Soil(phi=math.radians(31.5), k=0.04, k_1=65_000.0)
MOTOR = physics.Motor(supply=12.0, resistance=4.5, constant=8.0, armature=0.4)
NOISE = {"x": 0.003, "y": 0.003, "z": 0.005, "roll": 0.003, "pitch": 0.003, "yaw": 0.003, "rate": 0.01}
DRIFT = 0.0008
"""SD of the step of the pose's random walk from row to row [m]."""


def link(name, mass, size, shape=""):
    i = mass * size**2 / 10.0
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" '
        f'izz="{i}"/></inertial>{shape}</link>'
    )


def joint(name, kind, parent, child, xyz, axis="0 1 0"):
    limit = '<limit lower="-0.6" upper="0.6" effort="1" velocity="1"/>' if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def wheel(name, parent, xyz):
    shape = (
        f'<collision><origin rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="{R}" length="{B}"/></geometry>'
        "</collision>"
    )
    child = f"wheel_{name}_link"
    return link(child, 1.5, R, shape) + joint(f"wheel_{name}", "continuous", parent, child, xyz)


def bogies():
    """Return a rover with two bogies at the sides in front and one across the rear. None of its six wheels steers."""
    parts = [link("hull", 42.0, 0.6)]
    for side, y in (("l", 0.36), ("r", -0.36)):
        parts += [
            link(f"bogie_{side}_link", 2.0, 0.3),
            joint(f"bogie_{side}", "revolute", "hull", f"bogie_{side}_link", f"0.3 {y} -0.02"),
        ]
        parts += [
            wheel(f"f{side}", f"bogie_{side}_link", "0.28 0 -0.1"),
            wheel(f"m{side}", f"bogie_{side}_link", "-0.28 0 -0.1"),
        ]
    parts += [
        link("bogie_c_link", 2.0, 0.3),
        joint("bogie_c", "revolute", "hull", "bogie_c_link", "-0.5 0 -0.02", "1 0 0"),
    ]
    parts += [wheel(f"r{side}", "bogie_c_link", f"0 {y} -0.1") for side, y in (("l", 0.36), ("r", -0.36))]
    return f'<robot name="bogies">{"".join(parts)}</robot>', ("fl", "fr", "ml", "mr", "rl", "rr")


def skid():
    """Return a rover with four wheels on a hull."""
    parts = [link("hull", 30.0, 0.5)]
    for side, y in (("l", 0.3), ("r", -0.3)):
        parts += [wheel(f"f{side}", "hull", f"0.3 {y} -0.1"), wheel(f"r{side}", "hull", f"-0.3 {y} -0.1")]
    return f'<robot name="skid">{"".join(parts)}</robot>', ("fl", "fr", "rl", "rr")


class Dragged(physics.Physics):
    """A rover that pulls a cable: a force against its motion that grows with the distance from its start."""

    drag = (0.0, 0.0)
    "at the begin [N], and what each metre adds [N/m]"
    begin = np.zeros(2)

    def further(self, t, state, motion):
        force, v = np.zeros(len(state.speeds)), state.speeds[:2]
        pull = self.drag[0] + self.drag[1] * np.hypot(*(state.place[:2] - self.begin))
        force[:2] = -pull * v / np.sqrt(v @ v + 0.002**2)
        return force


def ground(start=2.0):
    """Return a ground with waves of 6 m and 2.7 m length, and additionally a slope of 7 deg from `start` on."""
    x = np.arange(-12.0, 12.01, 0.2)
    z = 0.10 * np.sin(2 * math.pi * x / 6) + 0.03 * np.sin(2 * math.pi * x / 2.7)
    return x, z + np.where(x > start, (x - start) * math.tan(math.radians(7.0)), 0.0)


def run(urdf, wheels, start, seconds, seed, drag=(0.0, 0.0), sides=0.0):
    """Return the true channels of one drive with duties that are held for 3 s. `sides` lets left and right duties
    differ.
    """
    dragged = Dragged(
        physics.World(
            str(urdf), MOTOR, physics.Ground([ground()]), SOIL, r=R, b=B, wheels=wheels, steered=(), own_arc=True,
            resistance=0.05, relaxation=0.1, stop=(500.0, 10.0),
        )
    )  # fmt: skip
    y = rest.rest(dragged, *start)
    dragged.drag, dragged.begin = drag, np.array(start[:2])
    random = np.random.default_rng(seed)
    duties = random.uniform(0.4, 0.9, 40)[:, None] + sides * random.uniform(-0.5, 0.5, 40)[:, None] * np.array(
        [1.0 if name.endswith("l") else -1.0 for name in wheels]
    )
    return drive.drive(dragged, y, lambda t: (duties[int(t / 3.0)], np.zeros(0)), seconds, STEP)


def recorded(true, begin, random, odometry=False):
    """Return the recording at 10 Hz from `begin` [s] on: the pose with noise and drift, tilts and wheel rates."""
    rows = slice(1, None, 2)
    count = len(true["t_s"][rows])
    walk = np.cumsum(random.normal(0.0, DRIFT, (3, count)), axis=1)
    noise = {name: random.normal(0.0, sd, count) for name, sd in NOISE.items() if name != "rate"}
    channels = {"time": true["t_s"][rows] + begin}
    place = true["place"][rows].T
    for at, name in enumerate("xyz"):
        channels[name] = place[at] + noise[name] + walk[at]
    for name in ("roll", "pitch"):
        channels[name] = true[name][rows] + noise[name]
    channels["yaw"] = np.unwrap(true["yaw"])[rows] + noise["yaw"]
    rates = true["wheel_rate"][rows] + random.normal(0.0, NOISE["rate"], (count, true["wheel_rate"].shape[1]))
    if odometry:
        way = np.cumsum(0.1 * R * rates.mean(axis=1))
        channels["x"], channels["y"] = way * math.cos(channels["yaw"][0]), way * math.sin(channels["yaw"][0])
    return channels, rates


def write(folder, rover=bogies, runs=4, seconds=40.0, seed=1, odometry=False, **hidden):
    """Write rover.urdf and recording.csv, and return both paths."""
    urdf, wheels = rover()
    (folder / "rover.urdf").write_text(urdf)
    random, tables, begin = np.random.default_rng(seed), [], 0.0
    for at in range(runs):
        start = (-3.0, 0.0, 0.0) if at % 2 == 0 else (5.0, 0.4 * at, math.pi)
        true = run(folder / "rover.urdf", wheels, start, seconds, 100 * seed + at, **hidden)
        columns, rates = recorded(true, begin, random, odometry)
        tables.append(np.column_stack([*columns.values(), rates]))
        begin += seconds + 20.0
    names = [*columns, *(f"wheel_speed_{name}" for name in wheels)]
    path = folder / "recording.csv"
    np.savetxt(path, np.vstack(tables), fmt="%.7g", delimiter=",", header=",".join(names), comments="")
    return folder / "rover.urdf", path
