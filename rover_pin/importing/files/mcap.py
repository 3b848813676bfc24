"""Read MCAP files whose profile is not ROS 2: their messages may be encoded in JSON, ROS 1 or ROS 2 (CDR).

The library rosbags reads MCAP files of the profile ros2 only. The container format is simple: a file consists of
records, each with an opcode, a length and a body. A chunk is a record whose body holds packed records. Files with other
encodings only are refused. Source: MCAP file format, version 0 (https://mcap.dev/spec).
"""

import bz2
import json
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rover_pin.base.errors import DataError, MissingExtraError
from rover_pin.base.files.bounded import Allowance, content
from rover_pin.logs.unpacking import unpack_bytes

MAGIC = b"\x89MCAP0\r\n"
"""Bytes at the beginning and at the end of each MCAP file."""
HEADER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x01, 0x03, 0x04, 0x05, 0x06
"""Opcodes of the records of an MCAP file that are read. Records with other opcodes, such as indices and checksums, are
skipped."""
READ_ENCODINGS = ("json", "ros1", "cdr")
"""Encodings of messages that can be read. Messages with another encoding are skipped."""
MAX_NAMED_CHANNELS = 6
"""Maximum number of channels that an error message lists by name."""


class Channel(NamedTuple):
    """A channel of an MCAP file: its topic, the encoding of its messages, and the definition of its message type."""

    topic: str
    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes


class Message(NamedTuple):
    """One message of an MCAP file: its channel, its times of publication and of logging [ns], and its encoded bytes."""

    channel: Channel
    published: int
    logged: int
    data: bytes


def is_other_mcap(path: Path) -> bool:
    """Return whether a file is an MCAP file whose profile is not ROS 2, so that rosbags cannot read it."""
    try:
        head = content(path, head=4096)
    except OSError:
        return False
    if not head.startswith(MAGIC):
        return False
    opcode, body = next(_records(head[len(MAGIC) :], cut=True), (0, b""))
    return opcode == HEADER and _text(body, 0)[0] != "ros2"


def mcap_messages(path: Path) -> Iterator[tuple[str, int | None, int, Any]]:
    """Yield every message of an MCAP file: topic, time of publication [ns] or None, time of logging [ns], and content.

    The content is a mapping for JSON and an object of rosbags for ROS messages. It is None if the message is damaged.

    Raises
    ------
    DataError
        The file is damaged, or no channel has an encoding that can be read. The error message lists the channels.
    MissingExtraError
        ROS messages or packed chunks are present, and the extra `ros` is not installed.
    """
    try:
        decoders: dict[Channel, Callable[[bytes], Any] | None] = {}
        kinds: Counter[Channel] = Counter()
        for message in _messages(content(path)):
            kinds[message.channel] += 1
            if message.channel not in decoders:
                decoders[message.channel] = _decoder(path, message.channel)
            decode = decoders[message.channel]
            if decode is None:
                continue
            try:
                value = decode(message.data)
            except Exception:
                value = None
            yield message.channel.topic, message.published or None, message.logged, value
    except (OSError, ValueError, struct.error, KeyError) as error:
        why = getattr(error, "strerror", "") or "its records are damaged or incomplete"
        raise DataError(f"{path}: the MCAP file cannot be read: {why}.") from error
    if not kinds:
        raise DataError(f"{path}: the MCAP file holds no messages, so there is nothing to import.")
    if not any(decoders.values()):
        # The error lists the channels, so that the user sees the content of the file.
        names = [
            f"{channel.topic} ({count} messages of {channel.schema_name or 'no schema'}, "
            f"{channel.encoding or 'unknown'})"
            for channel, count in kinds.most_common(MAX_NAMED_CHANNELS)
        ]
        more = f" and {len(kinds) - len(names)} more" if len(kinds) > len(names) else ""
        raise DataError(
            f"{path}: the MCAP file holds {', '.join(names)}{more}, but only messages with the encodings "
            f"{', '.join(READ_ENCODINGS)} can be read. Convert the file by `mcap cat --json FILE > FILE.jsonl` and "
            "give FILE.jsonl, or export a CSV from a plotter."
        )


def _decoder(path: Path, channel: Channel) -> Callable[[bytes], Any] | None:
    """Return the function that decodes the messages of a channel, or None if its encoding or its message type cannot be
    read.
    """
    if channel.encoding == "json":
        return json.loads
    if channel.encoding not in ("ros1", "cdr"):
        return None
    try:
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: reading ROS messages needs the package rosbags: run pip install 'rosbags>=0.11.6', or convert "
            "the file to CSV."
        ) from error
    store = get_typestore(Stores.EMPTY)
    text = channel.schema.decode()
    try:
        is_idl = channel.schema_encoding == "ros2idl"
        store.register(get_types_from_idl(text) if is_idl else get_types_from_msg(text, channel.schema_name))
    except Exception:
        return None
    # ROS 1 calls a type pkg/Name, rosbags pkg/msg/Name.
    parts = channel.schema_name.split("/")
    kind = f"{parts[0]}/msg/{parts[-1]}"
    if kind not in store.types:
        return None
    read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
    return lambda data: read(data, kind)


def _messages(file: bytes) -> Iterator[Message]:
    """Yield the messages of an MCAP file. If its records are damaged, ValueError or struct.error is raised."""
    if not file.startswith(MAGIC):
        raise ValueError
    schemas: dict[int, tuple[str, str, bytes]] = {0: ("", "", b"")}
    channels: dict[int, Channel] = {}
    for opcode, body in _unpacked(file[len(MAGIC) :], Allowance()):
        # The fields of each record are little-endian, as the format describes them.
        if opcode == SCHEMA:
            (number,) = struct.unpack_from("<H", body)
            name, at = _text(body, 2)
            encoding, at = _text(body, at)
            (size,) = struct.unpack_from("<I", body, at)
            schemas[number] = (name, encoding, bytes(body[at + 4 : at + 4 + size]))
        elif opcode == CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            topic, at = _text(body, 4)
            encoding, _ = _text(body, at)
            channels[number] = Channel(topic, encoding, *schemas[schema])
        elif opcode == MESSAGE:
            number, _, logged, published = struct.unpack_from("<HIQQ", body)
            yield Message(channels[number], published, logged, bytes(body[22:]))


def _unpacked(records: bytes, allowance: Allowance) -> Iterator[tuple[int, bytes]]:
    """Yield the opcode and the body of each record of a file. A chunk is replaced by the records that it holds."""
    for opcode, body in _records(records):
        if opcode != CHUNK:
            yield opcode, body
            continue
        packing, at = _text(body, 28)  # after two times, the unpacked size and a sum
        (size,) = struct.unpack_from("<Q", body, at)
        content_bytes = bytes(body[at + 8 : at + 8 + size])
        if packing:
            try:
                from lz4.frame import LZ4FrameFile
                from rosbags.rosbag2.reader import zstd
            except ImportError as error:
                raise MissingExtraError(
                    "the MCAP file is packed, and unpacking needs the package rosbags: run pip install "
                    "'rosbags>=0.11.6'."
                ) from error
            openers: Mapping[str, Any] = {"zstd": zstd.ZstdFile, "lz4": LZ4FrameFile, "bz2": bz2.BZ2File}
            # Unpacked bytes count towards a limit, because a small file may unpack to any size.
            content_bytes = unpack_bytes(openers[packing], content_bytes, allowance)
        yield from _records(content_bytes)


def _records(data: bytes, cut: bool = False) -> Iterator[tuple[int, bytes]]:
    """Yield the opcode and the body of each record in some bytes of an MCAP file.

    If `cut` is True, the bytes are only the beginning of a file, and an incomplete last record is yielded too.
    """
    at = 0
    while at + 9 <= len(data) and data[at : at + len(MAGIC)] != MAGIC:
        opcode, size = data[at], struct.unpack_from("<Q", data, at + 1)[0]
        if at + 9 + size > len(data) and not cut:
            raise ValueError
        yield opcode, data[at + 9 : at + 9 + size]
        at += 9 + size


def _text(body: bytes, at: int) -> tuple[str, int]:
    """Return a text that is stored after its length, and the position of the first byte behind the text."""
    (size,) = struct.unpack_from("<I", body, at)
    return bytes(body[at + 4 : at + 4 + size]).decode(), at + 4 + size
