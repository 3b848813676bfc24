"""A drive for other tools: CSV and Parquet for tables, MCAP for Foxglove, a recording for Rerun."""

import io
import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.files.columns import columns_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.logs.saved import save_trace
from rover_pin.simulation.trace.trace import Trace
from rover_pin.view.film import Film
from rover_pin.view.ground import patches
from rover_pin.view.shapes import shapes_of
from rover_pin.view.subject import Subject

NANO = 1e9


def write_csv(file: Path, subject: Subject) -> Path:
    """Write the channels as a table, a column each, named as in a drive log; return its path."""
    return replace_file(file, columns_text(subject.trace.channels))


def write_parquet(file: Path, subject: Subject) -> Path:
    """Write the trace, its units and attributes, exactly; return its path. `load_trace` and pandas read it."""
    return save_trace(subject.trace, file)


def write_mcap(file: Path, subject: Subject) -> Path:
    """Write the channels as JSON under `/trace`, and the links as frames under `/tf`; return its path."""
    from mcap.writer import Writer

    film, content = _film(subject), io.BytesIO()
    writer = Writer(content)
    writer.start(profile="", library="rover_pin")
    topics = {"/trace": ("rover_pin.Trace", _schema(subject.trace)), "/tf": ("foxglove.FrameTransforms", TRANSFORMS)}
    ids = {
        topic: writer.register_channel(
            topic, "json", writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        )
        for topic, (name, schema) in topics.items()
    }
    messages: list[tuple[Any, str, Any]] = [
        (t, "/trace", _row(subject.trace, row)) for row, t in enumerate(subject.trace.t)
    ]
    messages += [
        (t, "/tf", {"transforms": _frames(film, frame, float(t - film.t[0]))}) for frame, t in enumerate(film.t)
    ]
    for t, topic, message in sorted(messages, key=lambda entry: float(entry[0])):
        at = round(NANO * (float(t) - float(subject.trace.t[0])))
        writer.add_message(ids[topic], log_time=at, publish_time=at, data=json.dumps(message).encode())
    writer.finish()
    return replace_file(file, content.getvalue())


def write_rerun(file: Path, subject: Subject) -> Path:
    """Write ground, links with their shapes, and channels as a recording of Rerun; return its path."""
    import rerun

    film = _film(subject)
    with tempfile.TemporaryDirectory() as place:
        rrd_file = Path(place) / "made.rrd"
        recording = rerun.RecordingStream("rover_pin")
        recording.save(rrd_file)
        for patch in patches(film.terrain, film.box):
            mesh = rerun.Mesh3D(vertex_positions=patch.vertices, triangle_indices=patch.faces)
            recording.log(f"ground/{patch.soil}", mesh, static=True)
        for number, shape in enumerate(shapes_of(subject.rover, subject.meshes)):
            mesh = rerun.Mesh3D(
                vertex_positions=shape.vertices, triangle_indices=shape.faces, albedo_factor=[*shape.colour, 1.0]
            )
            recording.log(f"rover/{shape.link}/{number}", mesh, static=True)
        for frame, t in enumerate(film.t):
            recording.set_time("t_s", duration=float(t))
            for name, (where, turned) in film.links.items():
                turn = rerun.Quaternion(xyzw=np.roll(turned[frame], -1))
                recording.log(f"rover/{name}", rerun.Transform3D(translation=where[frame], quaternion=turn))
            for name, values in subject.trace.channels.items():
                recording.log(f"channels/{name}", rerun.Scalars(float(values[film.rows[frame]])))
        recording.flush()
        recording.disconnect()
        return replace_file(file, rrd_file.read_bytes())


def _film(subject: Subject) -> Film:
    return Film.of(subject.trace, subject.rover, subject.terrain)


def _schema(trace: Trace) -> dict[str, Any]:
    """Return the JSON schema of a row: a number a channel, with its unit."""
    properties = {name: {"type": ["number", "null"], "description": f"[{trace.units[name]}]"} for name in trace}
    return {"type": "object", "properties": properties}


def _row(trace: Trace, row: int) -> dict[str, float | None]:
    values = {name: float(channel[row]) for name, channel in trace.items()}
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


TRANSFORMS = {"type": "object", "properties": {"transforms": {"type": "array", "items": {"type": "object"}}}}


def _frames(film: Film, frame: int, t: float) -> list[dict[str, Any]]:
    """Return every link in the world, as Foxglove has frames."""
    seconds = math.floor(t)
    stamp = {"sec": seconds, "nsec": round(NANO * (t - seconds))}
    transforms = []
    for name, (where, turned) in film.links.items():
        w, x, y, z = map(float, turned[frame])
        place = dict(zip("xyz", map(float, where[frame]), strict=True))
        turn = {"x": x, "y": y, "z": z, "w": w}
        names = {"timestamp": stamp, "parent_frame_id": "world", "child_frame_id": name}
        transforms.append({**names, "translation": place, "rotation": turn})
    return transforms
