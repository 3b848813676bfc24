"""Write a drive to files for other programs: CSV and Parquet for tables, MCAP for Foxglove, a recording for Rerun."""

import io
import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.files.table import columns_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.logs.drive_log import save_trace
from rover_pin.view.film import Film, Subject
from rover_pin.view.triangles import patches, shapes_of

NANO = 1e9
"""Nanoseconds in a second."""
TRANSFORMS = {"type": "object", "properties": {"transforms": {"type": "array", "items": {"type": "object"}}}}
"""JSON schema of Foxglove's message FrameTransforms, reduced to the part that programs need to read it."""


def write_csv(file: Path, subject: Subject) -> Path:
    """Write the channels of a drive to a CSV file, and return the path of the file. Each channel is a column, named as
    in a drive log.
    """
    return replace_file(file, columns_text(subject.trace.channels))


def write_parquet(file: Path, subject: Subject) -> Path:
    """Write the trace of a drive to a Parquet file, with its units and attributes and without rounding; return the path
    of the file.

    `load_trace` reads the complete trace back; pandas reads the channels as columns.
    """
    return save_trace(subject.trace, file)


def write_mcap(file: Path, subject: Subject) -> Path:
    """Write a drive as an MCAP file for Foxglove, with the channels as JSON under `/trace` and the poses of the links
    under `/tf`; return the path of the file.
    """
    from mcap.writer import Writer

    film, content, trace = Film.of(subject.trace, subject.rover, subject.terrain), io.BytesIO(), subject.trace
    # A row is a JSON object with one number for each channel; the description of a channel states its unit. JSON has no
    # NaN, so a missing number is null.
    properties = {name: {"type": ["number", "null"], "description": f"[{trace.units[name]}]"} for name in trace}
    row_schema = {"type": "object", "properties": properties}
    # Each topic has a channel with a schema that describes its messages.
    writer = Writer(content)
    writer.start(profile="", library="rover_pin")
    topics = {"/trace": ("rover_pin.Trace", row_schema), "/tf": ("foxglove.FrameTransforms", TRANSFORMS)}
    ids = {
        topic: writer.register_channel(
            topic, "json", writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        )
        for topic, (name, schema) in topics.items()
    }
    messages: list[tuple[float, str, Any]] = []
    for row, t in enumerate(trace.t):
        values = {name: float(channel[row]) for name, channel in trace.items()}
        finite = {name: value if math.isfinite(value) else None for name, value in values.items()}
        messages.append((float(t), "/trace", finite))
    # The poses of all links in the world, in the form of Foxglove's frame transforms, stamped with the time since the
    # start.
    for frame, t in enumerate(film.t):
        elapsed = float(t - film.t[0])
        seconds = math.floor(elapsed)
        stamp = {"sec": seconds, "nsec": round(NANO * (elapsed - seconds))}
        transforms: list[dict[str, Any]] = []
        for name, (positions, quaternions) in film.links.items():
            w, x, y, z = map(float, quaternions[frame])
            translation = dict(zip("xyz", map(float, positions[frame]), strict=True))
            names = {"timestamp": stamp, "parent_frame_id": "world", "child_frame_id": name}
            transforms.append({**names, "translation": translation, "rotation": {"x": x, "y": y, "z": z, "w": w}})
        messages.append((float(t), "/tf", {"transforms": transforms}))
    # Players expect messages in the order of their times.
    for t, topic, message in sorted(messages, key=lambda entry: entry[0]):
        at = round(NANO * (t - float(trace.t[0])))
        writer.add_message(ids[topic], log_time=at, publish_time=at, data=json.dumps(message).encode())
    writer.finish()
    return replace_file(file, content.getvalue())


def write_rerun(file: Path, subject: Subject) -> Path:
    """Write the terrain, the links with their shapes, and the channels of a drive to a recording for Rerun; return the
    path of the file.
    """
    import rerun

    film = Film.of(subject.trace, subject.rover, subject.terrain)
    with tempfile.TemporaryDirectory() as folder:
        rrd_file = Path(folder) / "made.rrd"
        recording = rerun.RecordingStream("rover_pin")
        recording.save(rrd_file)
        # Terrain and shapes never change: a shape is logged below its link and moves with the pose of the link.
        for patch in patches(film.terrain, film.box):
            mesh = rerun.Mesh3D(vertex_positions=patch.vertices, triangle_indices=patch.faces)
            recording.log(f"ground/{patch.soil}", mesh, static=True)
        for number, shape in enumerate(shapes_of(subject.rover, subject.meshes)):
            mesh = rerun.Mesh3D(
                vertex_positions=shape.vertices, triangle_indices=shape.faces, albedo_factor=[*shape.colour, 1.0]
            )
            recording.log(f"rover/{shape.link}/{number}", mesh, static=True)
        # At each frame the poses move the shapes, and the channels are drawn as curves.
        for frame, t in enumerate(film.t):
            recording.set_time("t_s", duration=float(t))
            for name, (positions, quaternions) in film.links.items():
                # Rerun takes quaternions as x, y, z, w; the film has w first.
                rotation = rerun.Quaternion(xyzw=np.roll(quaternions[frame], -1))
                recording.log(f"rover/{name}", rerun.Transform3D(translation=positions[frame], quaternion=rotation))
            for name, values in subject.trace.channels.items():
                recording.log(f"channels/{name}", rerun.Scalars(float(values[film.rows[frame]])))
        recording.flush()
        recording.disconnect()
        return replace_file(file, rrd_file.read_bytes())
