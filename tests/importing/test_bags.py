"""Every number of a ROS bag in one table: on one clock, gaps left empty, clocks that disagree refused."""

import numpy as np
import pytest

from rover_pin.importing.files.raw import read_raw

pytest.importorskip("rosbags")
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

ROS = get_typestore(Stores.ROS2_HUMBLE)
BEGIN = 1_700_000_000_000_000_000
STEP = 50_000_000
MISSING = range(40, 60)


def joints(at, stamp):
    seconds = (at - BEGIN) * 1e-9
    time = ROS.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    header = ROS.types["std_msgs/msg/Header"](stamp=time, frame_id="")
    rates = np.array([1.0 + seconds, 2.0 - seconds])
    kind = ROS.types["sensor_msgs/msg/JointState"]
    return kind(header=header, name=["fl", "fr"], position=np.zeros(0), velocity=rates, effort=np.zeros(0))


def bag(folder, shift=0):
    """Wheel rates at 20 Hz with a gap of a second, their stamps shifted, and a number without a stamp."""
    with Writer(folder / "bag", version=8) as writer:
        connections = [writer.add_connection(*topic, typestore=ROS) for topic in
                (("/joints", "sensor_msgs/msg/JointState"), ("/level", "std_msgs/msg/Float64"))]  # fmt: skip
        for at in range(BEGIN, BEGIN + 100 * STEP, STEP):
            messages = [
                joints(at, at + (shift(at) if callable(shift) else shift)),
                ROS.types["std_msgs/msg/Float64"](data=(at - BEGIN) * 1e-9),
            ]
            for connection, message in zip(connections, messages, strict=True):
                if connection.topic == "/level" or (at - BEGIN) // STEP not in MISSING:
                    writer.write(connection, at, ROS.serialize_cdr(message, connection.msgtype))
    return folder / "bag"


def test_every_number_is_on_one_clock_and_a_gap_stays_empty(tmp_path):
    read = read_raw(bag(tmp_path))
    t = read.table["t_s"].to_numpy()
    assert np.diff(t) == pytest.approx(0.05)
    assert read.table["/level.data"].to_numpy() == pytest.approx(t, abs=1e-6)
    rate = read.table["/joints.velocity[fr]"].to_numpy()
    gap = (t > 0.05 * (MISSING[0] - 1) + 1e-3) & (t < 0.05 * (MISSING[-1] + 1) - 1e-3)
    assert np.array_equal(np.isnan(rate), gap)
    assert rate[~gap] == pytest.approx(2.0 - t[~gap], abs=1e-6)


@pytest.mark.parametrize("shift", [-BEGIN, 1_000_000_000 - BEGIN, lambda at: BEGIN - at])
def test_stamps_that_are_no_times_give_way_to_those_of_receipt(shift, tmp_path):
    """A clock since boot, one that was never set, and one that stands still."""
    read = read_raw(bag(tmp_path, shift))
    assert any("receipt" in note and "/joints" in note for note in read.notes)
    t, rate = (read.table[name].to_numpy() for name in ("t_s", "/joints.velocity[fr]"))
    is_finite = np.isfinite(rate)
    assert rate[is_finite] == pytest.approx(2.0 - t[is_finite], abs=1e-6)
    assert t[-1] == pytest.approx(99 * 0.05)
