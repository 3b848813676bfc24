"""A packed ROS bag and a .mat file unpack to no more than is read of any file, whatever they declare."""

import contextlib
import itertools
import resource
import struct
import zlib

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded, matlab
from rover_pin.cli.app import app
from rover_pin.importing.files.raw import mat_table

pytest.importorskip("rosbags")


FLOAT, STRING, MESSAGE_MIB = "std_msgs/msg/Float64", "std_msgs/msg/String", 16
PLUGINS, MODES = rosbag2.StoragePlugin, rosbag2.CompressionMode
WAYS = {
    "files of mcap": (PLUGINS.MCAP, MODES.FILE),
    "files of sqlite": (PLUGINS.SQLITE3, MODES.FILE),
    "messages of mcap": (PLUGINS.MCAP, MODES.MESSAGE),
    "messages of sqlite": (PLUGINS.SQLITE3, MODES.MESSAGE),
    "chunks of mcap": (PLUGINS.MCAP, MODES.STORAGE),
    "chunks by bz2": rosbag1.Writer.CompressionFormat.BZ2,
    "chunks by lz4": rosbag1.Writer.CompressionFormat.LZ4,
}


def write(folder, way, mib):
    """Write a bag of thirty numbers and so many MiB of the letter a, which pack to next to nothing; return it."""
    if isinstance(WAYS[way], tuple):
        types, path, (plugin, mode) = get_typestore(Stores.ROS2_HUMBLE), folder / "bag", WAYS[way]
        writer, packed = rosbag2.Writer(path, version=9, storage_plugin=plugin), types.serialize_cdr
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    else:
        types, path = get_typestore(Stores.ROS1_NOETIC), folder / "bag.bag"
        writer, packed = rosbag1.Writer(path), types.serialize_ros1
        writer.set_compression(WAYS[way])
    number, text = types.types[FLOAT], types.types[STRING]
    with writer:
        first, second = (writer.add_connection(f"/{name}", name, typestore=types) for name in (FLOAT, STRING))
        for at in range(30):
            writer.write(first, at * 10**8, packed(number(0.1 * at), FLOAT))
        for at in range(mib // MESSAGE_MIB):
            writer.write(second, 3 * 10**9 + at, packed(text("a" * MESSAGE_MIB * bounded.MIB), STRING))
    return path


def imported(path, folder):
    return CliRunner().invoke(app, ["import-log", str(path), "--out", str(folder / "log")])


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_packed_bag_is_read_up_to_the_bound_and_no_further(way, tmp_path, monkeypatch):
    path = write(tmp_path, way, 64)
    monkeypatch.setattr(bounded, "MAX_UNPACKED_BYTES", 32 * bounded.MIB)
    exception = imported(path, tmp_path).exception
    assert isinstance(exception, DataError)
    assert "32 MiB" in str(exception)
    monkeypatch.setattr(bounded, "MAX_UNPACKED_BYTES", 256 * bounded.MIB)
    assert "unpacks" not in str(imported(path, tmp_path).exception)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["files of mcap", "messages of mcap", "chunks by bz2"])
def test_a_gigabyte_in_a_few_kilobytes_is_refused(way, tmp_path):
    path = write(tmp_path, way, 1024 + MESSAGE_MIB)
    size = sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir()))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    exception = imported(path, tmp_path).exception
    assert "1024 MiB" in str(exception)
    assert size < bounded.MIB
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 256 * 1024


def test_metadata_that_names_itself_is_refused(tmp_path):
    """Of ten lines of YAML anchors a text of 10^10 letters grows in the sentence that refuses it."""
    folder = tmp_path / "bag"
    folder.mkdir()
    lines = ["a0: &a0 x", *(f"a{at}: &a{at} [{', '.join(10 * [f'*a{at - 1}'])}]" for at in range(1, 11))]
    metadata = "rosbag2_bagfile_information: {version: 5, relative_file_paths: [], storage_identifier: *a10}"
    (folder / "metadata.yaml").write_text("\n".join([*lines, metadata]))
    exception = imported(folder, tmp_path).exception
    assert isinstance(exception, DataError)
    assert "YAML" in str(exception)


CELL, RECORD, INT8, DOUBLE = 1, 2, 9, 6


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind, dimensions, *parts):
    flags, shape = element(6, struct.pack("<II", kind, 0)), element(5, struct.pack("<2i", *dimensions))
    return element(14, flags + shape + element(1, b"a") + b"".join(parts))


def packed(raw):
    small = zlib.compress(raw, 9)
    return struct.pack("<II", 15, len(small)) + small


NO_FIELDS = struct.pack("<HHI", 5, 4, 32) + element(1, b"")
RECORDS = matrix(RECORD, (100_000_000, 1), NO_FIELDS)
MIB_64 = bytes(64 * bounded.MIB)
NOTHING = {
    "records without fields": RECORDS,
    "records in a packed cell": packed(matrix(CELL, (1, 1), RECORDS)),
    "cells that are not there": matrix(CELL, (2_000_000_000, 1)),
    "numbers that are not there": matrix(DOUBLE, (2_000_000_000, 1), element(9, bytes(80))),
}
BOMBS = {
    "a packed array": packed(matrix(INT8, (len(MIB_64), 1), element(1, MIB_64))),
    "a packed array of one number": packed(matrix(INT8, (1, 1), element(1, MIB_64))),
}


def mat(path, elements, order="<"):
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}HH", 0x0100, 0x4D49) + elements)
    return path


@pytest.mark.parametrize("name", NOTHING)
def test_what_a_file_only_declares_takes_no_room(name, tmp_path):
    """A hundred million records in 200 bytes took more than two minutes, and 10 GB."""
    path = mat(tmp_path / "run.mat", NOTHING[name])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    exception = CliRunner().invoke(app, ["import-log", str(path), "--out", str(tmp_path / "log")]).exception
    assert isinstance(exception, DataError)
    assert "no vector of numbers" in str(exception) or "its parts do not fit together" in str(exception)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 128 * 1024


def test_no_damage_ends_the_program(tmp_path):
    """scipy's reader ended it by a segmentation fault."""
    random, path, wholes = np.random.default_rng(15), tmp_path / "run.mat", []
    table = {"t": np.arange(40.0), "parts": np.arange(80.0).reshape(40, 2), "imu": {"pitch": np.arange(40)}}
    for options in ({"do_compression": True}, {"do_compression": False}, {"format": "4"}):
        savemat(path, dict(itertools.islice(table.items(), 2)) if "format" in options else table, **options)
        wholes.append(path.read_bytes())
    for at in range(1500):
        damaged = bytearray(wholes[at % 3])
        for _ in range(random.integers(1, 5)):
            place, size = random.integers(len(damaged)), random.integers(1, 9)
            damaged[place : place + size] = random.integers(0, 256, random.integers(1, 9), dtype=np.uint8).tobytes()
        path.write_bytes(damaged)
        with contextlib.suppress(DataError):
            mat_table(path)


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_small_file_of_a_large_table_is_refused(bomb, tmp_path, monkeypatch):
    monkeypatch.setattr(matlab, "MAX_NUMBERS_BYTES", 16 * bounded.MIB)
    path = mat(tmp_path / "run.mat", BOMBS[bomb])
    assert path.stat().st_size < bounded.MIB
    exception = CliRunner().invoke(app, ["import-log", str(path), "--out", str(tmp_path / "log")]).exception
    assert isinstance(exception, DataError)
    assert "32 MiB" in str(exception)


@pytest.mark.parametrize("options", [{"do_compression": True}, {"do_compression": False}, {"format": "4"}])
def test_what_is_bounded_is_read_as_it_was_written(options, tmp_path):
    t, parts = np.arange(40.0), np.arange(80.0).reshape(40, 2)
    path = tmp_path / "run.mat"
    savemat(path, {"t": t, "parts": parts, "count": np.arange(40, dtype=np.int8)}, **options)
    table, notes = mat_table(path)
    assert not notes
    assert sorted(table) == ["count", "parts 1", "parts 2", "t"]
    np.testing.assert_array_equal(table[["t", "parts 1", "parts 2"]], np.column_stack([t, parts]))
