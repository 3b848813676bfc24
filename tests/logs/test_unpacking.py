"""A packed ROS bag unpacks to no more than is read of any file, however little it holds itself."""

import resource

import pytest
from typer.testing import CliRunner

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.cli.app import app

pytest.importorskip("rosbags")

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

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


@pytest.mark.parametrize("way", WAYS)
def test_a_packed_bag_is_read_up_to_the_bound_and_no_further(way, tmp_path, monkeypatch):
    path = write(tmp_path, way, 64)
    monkeypatch.setattr(bounded, "MOST_UNPACKED", 32 * bounded.MIB)
    told = imported(path, tmp_path).exception
    assert isinstance(told, DataError)
    assert "it unpacks to more than 32 MiB, which is the most that is read" in str(told)
    monkeypatch.setattr(bounded, "MOST_UNPACKED", 256 * bounded.MIB)
    assert "unpacks" not in str(imported(path, tmp_path).exception)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["files of mcap", "messages of mcap", "chunks by bz2"])
def test_a_gigabyte_in_a_few_kilobytes_is_refused(way, tmp_path):
    path = write(tmp_path, way, 1024 + MESSAGE_MIB)
    size = sum(each.stat().st_size for each in ([path] if path.is_file() else path.iterdir()))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    told = imported(path, tmp_path).exception
    assert "it unpacks to more than 1024 MiB" in str(told)
    assert size < bounded.MIB
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 256 * 1024


def test_metadata_that_names_itself_is_refused(tmp_path):
    """Of ten lines of YAML anchors a text of 10^10 letters grows in the sentence that refuses it."""
    folder = tmp_path / "bag"
    folder.mkdir()
    lines = ["a0: &a0 x", *(f"a{at}: &a{at} [{', '.join(10 * [f'*a{at - 1}'])}]" for at in range(1, 11))]
    about = "rosbag2_bagfile_information: {version: 5, relative_file_paths: [], storage_identifier: *a10}"
    (folder / "metadata.yaml").write_text("\n".join([*lines, about]))
    told = imported(folder, tmp_path).exception
    assert isinstance(told, DataError)
    assert "it has YAML anchors or aliases, which ROS does not write" in str(told)
