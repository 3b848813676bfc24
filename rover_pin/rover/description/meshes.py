"""The meshes that a URDF names: read from its own package or folder alone, of known kinds, of bounded size.

Archives (.zip, .3mf, .zae, .gz) unpack to any size, scenes (.gltf, .glb) name other files, and neither is read.
"""

import io
import re
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MIB, content
from rover_pin.base.files.paths import is_file

MOST_MESH = 64 * MIB
"""Bytes of a mesh that is read: measured, 0.7 GB of memory for STL and 1.4 GB for OBJ."""
MOST_CORNERS = MOST_MESH // 16
"""Corners of the triangles that a mesh places: STL has 16.7 bytes for each."""
STL_HEAD, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL's head and of each triangle."""
MOST_PARTS = 1000
"""Parts, groups and materials of a mesh: each takes some 5 ms, in OBJ more as they are more."""
PARTS = {
    ".stl": re.compile(rb"endsolid", re.IGNORECASE),
    ".obj": re.compile(rb"^(?:o|g|usemtl)\s", re.MULTILINE),
    ".dae": re.compile(rb"<(?:\w+:)?(?:node|geometry|instance_geometry|triangles|polylist|polygons)\b"),
}
"""Where a part of a mesh begins or ends."""
PACKAGE = "package.xml"
PACKED = (b"PK", b"\x1f\x8b", b"BZh", b"\0")
"""How archives and other binary files begin, which no text does."""


def _is_stl(read: bytes) -> bool:
    return read.startswith(b"solid") or len(read) == STL_HEAD + STL_TRIANGLE * int.from_bytes(read[80:84], "little")


def _is_collada(read: bytes) -> bool:
    """An entity, or a node that is placed again inside others, grows without bound out of a few lines."""
    return b"<COLLADA" in read[:4096] and not any(
        marker in read for marker in (b"<!DOCTYPE", b"<!ENTITY", b"<instance_node")
    )


KINDS: dict[str, Callable[[bytes], bool]] = {
    ".stl": _is_stl,
    ".obj": lambda read: not any(read.startswith(begin) for begin in PACKED) and b"\0" not in read[:4096],
    ".ply": lambda read: read.startswith(b"ply"),
    ".dae": _is_collada,
}
"""Whether the content of a file is what its suffix says."""


def package_of(folder: Path) -> Path:
    """Return the folder outside which no mesh of a URDF in `folder` is read: its ROS package, or `urdf`'s parent."""
    real = folder.resolve()
    beside = real.parent if real.name == "urdf" else real
    return next((directory for directory in (real, *real.parents) if is_file(directory / PACKAGE)), beside)


def mesh_file(name: str, folder: Path) -> Path | None:
    """Return the file of a mesh that a URDF in `folder` names, by its path or, of a package, by the end of it, or None.

    It lies in `package_of(folder)`; links are followed.
    """
    package = package_of(folder)
    parts = Path(name.split("://", 1)[-1]).parts
    for start in range(len(parts)):
        for base in (folder, package):
            file = base.joinpath(*parts[start:])
            if is_file(file) and file.resolve().is_relative_to(package):
                return file
    return None


def read_mesh(file: Path, scale: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return corners [m], one a row, and triangles of a mesh file.

    Raises DataError: it is of no kind that is read, damaged, or too large.
    """
    import trimesh

    kind = file.suffix.lower()
    if kind not in KINDS:
        raise DataError(f"{file}: a mesh is read from {', '.join(KINDS)}: convert it to one of them.")
    try:
        read = content(file, MOST_MESH)
        if not KINDS[kind](read):
            raise DataError(f"{file}: it does not begin as {kind} does, or names other parts: export the mesh again.")
        if kind in PARTS and any(islice(PARTS[kind].finditer(read), MOST_PARTS, None)):
            raise DataError(f"{file}: it has more than {MOST_PARTS} parts, groups or materials: export it as one.")
        loaded = trimesh.load(io.BytesIO(read), file_type=kind[1:], process=False)
        mesh = _merge_shapes(loaded, file) if isinstance(loaded, trimesh.Scene) else loaded
        return np.asarray(mesh.vertices, dtype=float) * np.asarray(scale), np.asarray(mesh.faces)
    except DataError:
        raise
    except OSError as error:
        raise DataError(f"{file}: the mesh cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # any format's reader may fail on a file
        raise DataError(f"{file}: the mesh is damaged: export it again.") from error


def _merge_shapes(scene: Any, file: Path) -> Any:
    """Return a scene's shapes as one, each as often as it is placed."""
    placed = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    if sum(3 * len(getattr(shape, "faces", ())) for shape in placed) > MOST_CORNERS:
        raise DataError(f"{file}: its parts are placed so often that they have more than {MOST_CORNERS} corners.")
    return scene.to_mesh()
