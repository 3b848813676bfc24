"""Write a layout to a file: text in many formats, Parquet, .mat in three forms, ROS 2 bags with good or bad stamps."""

from __future__ import annotations

import unicodedata
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from foreign.drive import Drive, R
from foreign.layouts import EPOCH, Layout, _quaternion

JOINTS = ("hub_lf", "hub_rf", "hub_lb", "hub_rb")


def written(layout: Layout, folder: Path, random: np.random.Generator) -> Path:
    """Write a layout in a random kind of file, record the kind in its habits, and return the path."""
    kind = str(random.choice(["commas", "semicolons", "tabs", "blanks", "parquet", "struct", "structs", "flat"],
                             p=[0.4, 0.16, 0.1, 0.07, 0.1, 0.06, 0.06, 0.05]))  # fmt: skip
    # Text columns exist only as CSV or Parquet here.
    if any(isinstance(values, list) for values in layout.columns.values()) and kind not in ("commas", "parquet"):
        kind = "semicolons"
    layout.habits["file"] = kind
    if kind in ("struct", "structs", "flat"):
        return _mat(layout, folder, kind)
    frame = pd.DataFrame(layout.columns)
    if kind == "parquet":
        frame.to_parquet(folder / "drive.parquet")
        return folder / "drive.parquet"
    return _text(layout, frame, folder, kind, random)


def _text(layout: Layout, frame: pd.DataFrame, folder: Path, kind: str, random: np.random.Generator) -> Path:
    """Write a text file with random separator, decimal sign, row numbers, unit row and preamble; return its path."""
    path = folder / ("drive.txt" if kind == "blanks" else "drive.csv")
    if kind == "blanks":
        frame.columns = ["_".join(str(name).split()) for name in frame.columns]
        path.write_text("# " + " ".join(frame.columns) + "\n")
        frame.to_csv(path, sep=" ", index=False, header=False, mode="a", float_format="%.9g")
        return path
    numbered = bool(random.random() < 0.2)
    layout.habits["row numbers"] = str(numbered)
    decimal = "," if kind == "semicolons" and random.random() < 0.6 else "."
    separator = {"commas": ",", "semicolons": ";", "tabs": "\t"}[kind]
    # Whole numbers stay whole, as a logger writes them.
    integers = {name: values for name, values in frame.items() if values.dtype.kind in "iu"}
    text = frame.round(9).assign(**integers).to_csv(sep=separator, decimal=decimal, index=numbered)
    head, body = text.split("\n", 1)
    if layout.habits["units"] == "none" and not numbered and random.random() < 0.3:
        row = separator.join(f"[{layout.units.get(name, '')}]" for name in frame.columns)
        head, layout.habits["units"] = f"{head}\n{row}", "row"
    before = "Rover test drive\nOperator: B\n" if random.random() < 0.15 else ""
    path.write_text(before + head + "\n" + body, encoding="utf-8")
    return path


def _ascii(name: str) -> str:
    """Return a name without accents."""
    return unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()


def _mat(layout: Layout, folder: Path, kind: str) -> Path:
    """Write a .mat file: flat variables, one struct of columns, or an array of structs; return its path."""
    from scipy.io import savemat

    # MATLAB names have at most 31 letters, digits and underscores, and begin with a letter.
    columns = {"".join(c if c.isalnum() else "_" for c in _ascii(name)).strip("_")[:31]: values
               for name, values in layout.columns.items() if not isinstance(values, list)}  # fmt: skip
    columns = {name if name[0].isalpha() else f"v{name}": np.asarray(values, float) for name, values in columns.items()}
    path = folder / "drive.mat"
    if kind == "flat":
        savemat(path, columns, do_compression=True)
    elif kind == "struct":
        savemat(path, {"log": columns})
    else:
        rows = np.empty((len(next(iter(columns.values()))), 1), dtype=[(name, object) for name in columns])
        for name, values in columns.items():
            rows[name][:, 0] = list(values)
        savemat(path, {"samples": rows})
    return path


def bag(cart: Drive, folder: Path, random: np.random.Generator) -> tuple[Path, Layout]:
    """Write a ROS 2 bag: joint states with a tracked pose, an odometry pose, or a receiver and an IMU."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    ros = get_typestore(Stores.ROS2_HUMBLE)
    # Only the pose has bad stamps: frozen, zero, or counted from the start of the computer.
    stamps = str(random.choice(["sound", "frozen", "zero", "since boot"], p=[0.4, 0.25, 0.15, 0.2]))
    pose = str(random.choice(["tracker", "odometry message", "receiver and IMU"]))
    decoys = bool(random.random() < 0.5)
    habits = {"file": "bag", "stamps of the pose": stamps, "frame": pose, "beside": "cmd_vel odom" if decoys else ""}
    truth = {f"wheel_rate_{corner}": cart.rates[at] for at, corner in enumerate(("fl", "fr", "bl", "br"))}
    truth |= {name: getattr(cart, name.removeprefix("body_")) for name in ("body_x", "body_y", "body_z", "body_yaw",
                                                                          "body_pitch", "body_roll")}  # fmt: skip
    if pose == "receiver and IMU":
        still = 0.0 * cart.t
        truth |= {"gyro_x": still, "gyro_y": still, "gyro_z": cart.turn, "accelerometer_x": -9.81 * cart.pitch,
                  "accelerometer_y": 9.81 * cart.roll, "accelerometer_z": still + 9.81}  # fmt: skip
    with Writer(folder / "drive", version=8) as writer:
        connections: dict[str, Any] = {}
        for row, t in enumerate(cart.t):
            at = EPOCH * 10**9 + round(1e9 * t)
            late = {"sound": at, "frozen": EPOCH * 10**9, "zero": 0, "since boot": at - EPOCH * 10**9 + 10**9}[stamps]
            sound, stamp = _header(ros, at), _header(ros, late)
            for topic, message in _messages(ros, cart, row, pose, decoys, sound, stamp):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=ros)
                writer.write(connections[topic], at, ros.serialize_cdr(message, message.__msgtype__))
    return folder / "drive", Layout({}, {}, truth, habits)


def _header(ros: Any, at: int) -> Any:
    """Return a ROS header with a stamp given in nanoseconds."""
    time = ros.types["builtin_interfaces/msg/Time"](sec=at // 10**9, nanosec=at % 10**9)
    return ros.types["std_msgs/msg/Header"](stamp=time, frame_id="map")


def _messages(ros: Any, truth: Drive, row: int, pose: str, decoys: bool, sound: Any, stamp: Any) -> Any:
    """Yield topic and message of every sensor at one row of the drive."""
    kind = lambda name: ros.types[name]  # noqa: E731
    rates = truth.rates[:, row].copy()
    joints = kind("sensor_msgs/msg/JointState")
    yield (
        "/joint_states",
        joints(header=sound, name=list(JOINTS), position=0.0 * rates, velocity=rates, effort=0.0 * rates),
    )
    vector, point = kind("geometry_msgs/msg/Vector3"), kind("geometry_msgs/msg/Point")
    about = kind("geometry_msgs/msg/Quaternion")(
        **{axis: float(component[row]) for axis, component in zip("xyzw", _quaternion(truth), strict=True)}
    )
    nothing = np.zeros(36)

    def odometry(scale: float, v: float, omega: float, header: Any) -> Any:
        # The wheel odometry reports a longer path than the true one; `scale` gives the factor.
        place = point(x=scale * float(truth.x[row]), y=scale * float(truth.y[row]), z=float(truth.z[row]))
        twist = kind("geometry_msgs/msg/Twist")(linear=vector(x=v, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=omega))
        return kind("nav_msgs/msg/Odometry")(
            header=header, child_frame_id="base",
            pose=kind("geometry_msgs/msg/PoseWithCovariance")(
                pose=kind("geometry_msgs/msg/Pose")(position=place, orientation=about), covariance=nothing),
            twist=kind("geometry_msgs/msg/TwistWithCovariance")(twist=twist, covariance=nothing))  # fmt: skip

    # The pose by one of three sources; its header has the possibly bad stamp.
    if pose == "tracker":
        place = point(x=float(truth.x[row]), y=float(truth.y[row]), z=float(truth.z[row]))
        yield (
            "/vrpn/rover/pose",
            kind("geometry_msgs/msg/PoseStamped")(
                header=stamp, pose=kind("geometry_msgs/msg/Pose")(position=place, orientation=about)
            ),
        )
    elif pose == "odometry message":
        yield "/mocap/odom", odometry(1.0, 0.0, 0.0, stamp)
    else:
        status = kind("sensor_msgs/msg/NavSatStatus")(status=0, service=1)
        yield "/gps/fix", kind("sensor_msgs/msg/NavSatFix")(
            header=stamp, status=status, latitude=48.1 + float(truth.y[row]) / 111_200.4,
            longitude=11.5 + float(truth.x[row]) / 74_514.4, altitude=520.0 + float(truth.z[row]),
            position_covariance=np.zeros(9), position_covariance_type=0)  # fmt: skip
        turn = vector(x=0.0, y=0.0, z=float(truth.turn[row]))
        pull = vector(x=-9.81 * float(truth.pitch[row]), y=9.81 * float(truth.roll[row]), z=9.81)
        yield "/imu/data", kind("sensor_msgs/msg/Imu")(
            header=sound, orientation=about, orientation_covariance=np.zeros(9), angular_velocity=turn,
            angular_velocity_covariance=np.zeros(9), linear_acceleration=pull,
            linear_acceleration_covariance=np.zeros(9))  # fmt: skip
    # Topics that an importer must not take for the truth: commands, and wheel odometry that is 12 % too long.
    if decoys:
        v, omega = R * float(rates.mean()), 0.5 * float(truth.turn[row])
        yield (
            "/cmd_vel",
            kind("geometry_msgs/msg/Twist")(
                linear=vector(x=round(v, 1), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=round(omega, 1))
            ),
        )
        yield "/odom", odometry(1.12, v, omega, sound)
