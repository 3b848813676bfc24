"""One drive of the cart as other people record it: the same truth in many habits of files, names, units and frames."""

import math

import numpy as np
import pandas as pd

R, HALF = 0.11, 0.26
"""Wheel radius and half the track of the cart [m]."""
EPOCH = 1_700_000_000_000_000_000
"""Begin of the recordings [ns since 1970]."""
DEG = math.pi / 180.0


def truth(seconds=70.0, rate=10.0, seed=3):
    """A drive in SI by a drive log's names: curves, slopes, slip that grows with them, a stop of 6 s, noise."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    drives = ~((t > 30.0) & (t < 36.0))
    pitch = -0.12 * np.sin(0.15 * t) * drives
    slip = np.where(drives, 0.12 - 0.8 * pitch, 0.0)
    rim = 0.16 * drives * (1.0 + 0.3 * np.sin(0.4 * t))
    turn = 0.08 * np.cos(0.1 * t) * drives
    yaw = 0.4 + np.cumsum(turn) / rate
    speed = rim * (1.0 - slip)
    x, y = (np.cumsum(speed * np.cos(pitch) * component) / rate for component in (np.cos(yaw), np.sin(yaw)))
    z = np.cumsum(-speed * np.sin(pitch)) / rate
    noise = [random.normal(0.0, sd, len(t)) for sd in (0.002, 0.002, 0.003, 0.002, 0.002, 0.002)]
    pose = {"x": x, "y": y, "z": z, "yaw": yaw, "pitch": pitch, "roll": 0.0 * t}
    channels = {"t_s": t} | {
        f"body_{name}": values + noise_row for (name, values), noise_row in zip(pose.items(), noise, strict=True)
    }
    for wheel, side in (("fl", -1), ("fr", 1), ("bl", -1), ("br", 1)):
        channels[f"wheel_rate_{wheel}"] = (rim + side * HALF * turn * drives) / R + random.normal(0.0, 0.003, len(t))
    return channels


def quaternion(true_drive):
    """x, y, z, w of the attitude."""
    from scipy.spatial.transform import Rotation

    angles = np.column_stack([true_drive["body_yaw"], true_drive["body_pitch"], true_drive["body_roll"]])
    return Rotation.from_euler("ZYX", angles).as_quat().T


def plain(true_drive, folder):
    """Commas and points, names that say everything, SI."""
    names = {"t_s": "time [s]", "body_x": "x [m]", "body_y": "y [m]", "body_z": "z [m]", "body_yaw": "yaw [rad]"}
    names |= {"body_pitch": "pitch [rad]", "body_roll": "roll [rad]"}
    names |= {f"wheel_rate_{wheel}": f"wheel_{wheel}_speed [rad/s]" for wheel in ("fl", "fr", "bl", "br")}
    path = folder / "plain.csv"
    pd.DataFrame({new: true_drive[old] for old, new in names.items()}).to_csv(path, index=False)
    return path


def german(true_drive, folder):
    """Semicolons, decimal comma, byte-order mark, preamble, a row of units: degrees, rpm, mm, ms of the epoch."""
    columns = {
        ("Zeitstempel", "ms"): np.round(EPOCH // 1_000_000 + 1e3 * true_drive["t_s"]),
        ("Position X", "mm"): 1e3 * true_drive["body_x"],
        ("Position Y", "mm"): 1e3 * true_drive["body_y"],
        ("Höhe", "mm"): 1e3 * true_drive["body_z"],
        ("Gierwinkel", "°"): true_drive["body_yaw"] / DEG,
        ("Nickwinkel", "°"): true_drive["body_pitch"] / DEG,
        ("Rollwinkel", "°"): true_drive["body_roll"] / DEG,
    }
    places = {"fl": "vorne links", "fr": "vorne rechts", "bl": "hinten links", "br": "hinten rechts"}
    columns |= {
        (f"Drehzahl {word}", "U/min"): true_drive[f"wheel_rate_{wheel}"] * 30 / math.pi
        for wheel, word in places.items()
    }
    lines = ["Messfahrt im Sandkasten;;;", "Bediener;Müller;;"]
    lines += [";".join(name for name, _ in columns), ";".join(f"[{unit}]" for _, unit in columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(
            ";".join(f"{value:.9g}".replace(".", ",") if abs(value) < 1e9 else f"{value:.0f}" for value in row)
        )
    path = folder / "Messung.csv"
    path.write_text("\ufeff" + "\r\n".join(lines) + "\r\n", encoding="utf-8")
    return path


def nanoseconds(true_drive, folder):
    """Tabs, ns of the epoch, a quaternion, wheel speeds without a unit in rpm, the right side mounted the other way."""
    columns = {"stamp": [str(EPOCH + round(1e9 * t)) for t in true_drive["t_s"]]}
    columns |= {f"pose.position.{axis}": true_drive[f"body_{axis}"] for axis in "xyz"}
    columns |= {
        f"pose.orientation.{axis}": component for axis, component in zip("xyzw", quaternion(true_drive), strict=True)
    }
    for wheel, name in (
        ("fl", "motorFrontLeft"),
        ("fr", "motorFrontRight"),
        ("bl", "motorRearLeft"),
        ("br", "motorRearRight"),
    ):
        columns[f"{name}.velocity"] = (
            (-1 if wheel.endswith("r") else 1) * true_drive[f"wheel_rate_{wheel}"] * 30 / math.pi
        )
    path = folder / "robot_log.tsv"
    pd.DataFrame(columns).to_csv(path, sep="\t", index=False)
    return path


def geographic(true_drive, folder):
    """Latitude and longitude, a compass in degrees clockwise from north, speeds of the two sides in m/s, ISO dates."""
    lat = 48.1 + true_drive["body_y"] / 111_200.4
    lon = 11.5 + true_drive["body_x"] / (111_412.84 * math.cos(48.1 * DEG) - 93.5 * math.cos(3 * 48.1 * DEG))
    columns = {
        "timestamp": [f"2026-05-01T10:{int(t // 60):02d}:{t % 60:06.3f}Z" for t in true_drive["t_s"]],
        "gps_latitude": lat,
        "gps_longitude": lon,
        "heading_deg": 90.0 - true_drive["body_yaw"] / DEG,
        "imu_pitch_deg": true_drive["body_pitch"] / DEG,
        "speed_left_mps": R * true_drive["wheel_rate_fl"],
        "speed_right_mps": R * true_drive["wheel_rate_fr"],
        "mode": "auto",
    }
    path = folder / "gps.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def parquet(true_drive, folder):
    """A Parquet file with a date column, odometry beside the tracker's pose, commands beside measured rates."""
    columns = {"time": pd.to_datetime(EPOCH + np.round(1e9 * true_drive["t_s"]).astype("int64"), utc=True)}
    columns |= {f"odom_{axis}": 1.2 * true_drive[f"body_{axis}"] for axis in "xy"}
    columns |= {f"mocap_{axis}": true_drive[f"body_{axis}"] for axis in "xyz"}
    columns |= {f"mocap_{angle}": true_drive[f"body_{angle}"] for angle in ("roll", "pitch", "yaw")}
    for wheel in ("fl", "fr", "bl", "br"):
        columns[f"cmd_wheel_vel_{wheel}"] = np.round(true_drive[f"wheel_rate_{wheel}"])
        columns[f"wheelVel{wheel.upper()}"] = true_drive[f"wheel_rate_{wheel}"]
    path = folder / "log.parquet"
    pd.DataFrame(columns).to_parquet(path)
    return path


def matlab(true_drive, folder):
    """A struct in a .mat, time in its own vector, wheels as the columns of a matrix."""
    from scipy.io import savemat

    path = folder / "log.mat"
    wheels = np.column_stack([true_drive[f"wheel_rate_{wheel}"] for wheel in ("fl", "fr", "bl", "br")])
    pose = {name: true_drive[f"body_{name}"] for name in ("x", "y", "z", "roll", "pitch", "yaw")}
    savemat(path, {"log": {"t": true_drive["t_s"], "pose": pose, "wheel_omega": wheels}})
    return path


def twist(true_drive, folder):
    """Blanks, a comment for a header, no wheels: forward speed and turn as the odometry has them, no yaw."""
    left, right = R * true_drive["wheel_rate_fl"], R * true_drive["wheel_rate_fr"]
    columns = {"t": true_drive["t_s"], "x": true_drive["body_x"], "y": true_drive["body_y"], "z": true_drive["body_z"]}
    columns |= {
        "odom_v": (left + right) / 2,
        "odom_omega": (right - left) / (2 * HALF),
        "pitch": true_drive["body_pitch"],
    }
    path = folder / "run1.txt"
    rows = "\n".join(" ".join(f"{value:.7g}" for value in row) for row in zip(*columns.values(), strict=True))
    path.write_text(f"# {' '.join(columns)}\n{rows}\n")
    return path


def records(true_drive, folder):
    """Lines of two kinds, each under its own name and with its own cells; the angles jump at half a turn."""
    stamps = pd.to_datetime(EPOCH + np.round(1e9 * true_drive["t_s"]).astype("int64")).strftime("%Y:%m:%d %H:%M:%S.%f")
    wrapped = (true_drive["body_yaw"] / DEG + 180.0) % 360.0 - 180.0
    pose = {"x": true_drive["body_x"], "y": true_drive["body_y"], "z": true_drive["body_z"], "yaw [deg]": wrapped}
    pose |= {f"{angle} [rad]": true_drive[f"body_{angle}"] for angle in ("roll", "pitch")}
    wheels = {f"speed_{wheel}": true_drive[f"wheel_rate_{wheel}"] for wheel in ("fl", "fr", "bl", "br")}
    lines = []
    for at, stamp in enumerate(stamps):
        for kind, cells in (("$POSE", pose), ("$DRIVE", wheels)):
            lines.append(";".join([kind, stamp, *(f"{name};{values[at]!r}" for name, values in cells.items())]))
    path = folder / "records.txt"
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n$POSE;2023")
    return path


JOINTS = {"fl": "hub_lf", "fr": "hub_rf", "bl": "hub_lb", "br": "hub_rb"}
"""The cart's wheels by the names of their joints."""


def messages(true_drive, types):
    """Yield (time [ns], topic, message): joint states and a tracker's poses, stamped, row by row."""
    from dataclasses import fields

    kinds, turned = types.types, quaternion(true_drive).T
    stamped = kinds["std_msgs/msg/Header"]
    for row, t in enumerate(true_drive["t_s"]):
        at = EPOCH + round(1e9 * t)
        clock = kinds["builtin_interfaces/msg/Time"](sec=at // 10**9, nanosec=at % 10**9)
        more = {"seq": row} if "seq" in {field.name for field in fields(stamped)} else {}
        header = stamped(stamp=clock, frame_id="odom", **more)
        rates = np.array([true_drive[f"wheel_rate_{wheel}"][row] for wheel in JOINTS])
        yield (
            at,
            "/joint_states",
            kinds["sensor_msgs/msg/JointState"](
                header=header, name=list(JOINTS.values()), position=0 * rates, velocity=rates, effort=np.zeros(0)
            ),
        )
        place = kinds["geometry_msgs/msg/Point"](**{axis: float(true_drive[f"body_{axis}"][row]) for axis in "xyz"})
        metadata = kinds["geometry_msgs/msg/Quaternion"](**dict(zip("xyzw", map(float, turned[row]), strict=True)))
        pose = kinds["geometry_msgs/msg/Pose"](position=place, orientation=metadata)
        yield at, "/mocap/rover", kinds["geometry_msgs/msg/PoseStamped"](header=header, pose=pose)


def _bag(true_drive, example, types, serialize):
    connections = {}
    for at, topic, message in messages(true_drive, types):
        if topic not in connections:
            connections[topic] = example.add_connection(topic, message.__msgtype__, typestore=types)
        example.write(connections[topic], at, serialize(message, message.__msgtype__))


def ros1(true_drive, folder):
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer(folder / "drive.bag") as writer:
        _bag(true_drive, writer, types, types.serialize_ros1)
    return folder / "drive.bag"


def ros2(true_drive, folder):
    """The folder of a ROS 2 bag."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder / "drive", version=8) as writer:
        _bag(true_drive, writer, types, types.serialize_cdr)
    return folder / "drive"


def mcap(true_drive, folder):
    """An MCAP file by Foxglove's own writer: ROS 2 messages with their definitions, compressed chunks."""
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    types, path, channels = get_typestore(Stores.ROS2_HUMBLE), folder / "drive.mcap", {}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="recorder")
        for at, topic, message in messages(true_drive, types):
            if topic not in channels:
                text = types.generate_msgdef(message.__msgtype__, ros_version=2)[0].encode()
                schema = writer.register_schema(name=message.__msgtype__, encoding="ros2msg", data=text)
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            data = bytes(types.serialize_cdr(message, message.__msgtype__))
            writer.add_message(channel_id=channels[topic], log_time=at, publish_time=at, data=data)
        writer.finish()
    return path


HABITS = {habit.__name__: habit for habit in (plain, german, nanoseconds, geographic, parquet, matlab, twist, records)}
BAGS = {habit.__name__: habit for habit in (ros1, ros2, mcap)}
