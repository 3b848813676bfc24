"""Read the meshes that a URDF names. A mesh is read only if it lies in the URDF's package or folder, has a known
format, and is not too large.

Archives (.zip, .3mf, .zae, .gz) and scenes (.gltf, .glb) are not read, because an archive may unpack to any size, and a
scene may name other files.
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

MAX_MESH_BYTES = 64 * MIB
"""Largest size of a mesh file [bytes]. A larger file is refused, because trimesh needs about ten times the file's size
in memory for STL, and twenty times for OBJ."""
MAX_CORNERS = MAX_MESH_BYTES // 16
"""Largest number of triangle corners in a mesh file; a shape that is placed several times counts several times. A mesh
with more corners is refused. An STL file of the largest size has about this number of corners, because it has 16.7
bytes for each corner."""
STL_HEAD, STL_TRIANGLE = 84, 50
"""Size of the head of a binary STL file (STL_HEAD), and size of each triangle in the file (STL_TRIANGLE) [bytes]."""
MAX_PARTS = 1000
"""Largest number of parts, groups and materials of a mesh. A mesh with a larger number is refused, because each part
takes milliseconds to read, and in OBJ files the time for each part grows with the number of parts."""
PARTS = {
    ".stl": re.compile(rb"endsolid", re.IGNORECASE),
    ".obj": re.compile(rb"^(?:o|g|usemtl)\s", re.MULTILINE),
    ".dae": re.compile(rb"<(?:\w+:)?(?:node|geometry|instance_geometry|triangles|polylist|polygons)\b"),
}
"""Suffix of a mesh file -> pattern that marks the beginning or the end of a part in its text, for counting the
parts."""
PACKAGE = "package.xml"
"""Name of the file that marks the root folder of a ROS package."""
PACKED = (b"PK", b"\x1f\x8b", b"BZh", b"\0")
"""First bytes of archives and other binary files. A file that begins with them is not read as text."""
COLLADA_REFUSED = (b"<!DOCTYPE", b"<!ENTITY", b"<instance_node")
"""Elements of COLLADA that are refused, because entities and nested nodes can grow without limit."""
KINDS: dict[str, Callable[[bytes], bool]] = {
    # A text STL, or a binary STL whose size agrees with its number of triangles.
    ".stl": lambda read: (
        read.startswith(b"solid") or len(read) == STL_HEAD + STL_TRIANGLE * int.from_bytes(read[80:84], "little")
    ),
    ".obj": lambda read: not any(read.startswith(begin) for begin in PACKED) and b"\0" not in read[:4096],
    ".ply": lambda read: read.startswith(b"ply"),
    ".dae": lambda read: b"<COLLADA" in read[:4096] and not any(marker in read for marker in COLLADA_REFUSED),
}
"""Suffix of a mesh file -> test whether the content of the file really has this format. Without this test, a file with
a wrong suffix could reach the reader of another format."""


def package_of(folder: Path) -> Path:
    """Return the folder that may contain the meshes of a URDF. `folder` is the folder of the URDF.

    The result is the ROS package that contains the URDF. If there is no package, it is the parent of a folder with the
    name urdf, otherwise the folder of the URDF itself.
    """
    real = folder.resolve()
    beside = real.parent if real.name == "urdf" else real
    return next((directory for directory in (real, *real.parents) if is_file(directory / PACKAGE)), beside)


def mesh_file(name: str, folder: Path) -> Path | None:
    """Return the path of a mesh that a URDF in `folder` names, or None if the allowed folder of meshes (`package_of`)
    does not contain it.

    A name such as package://rover/meshes/tyre.stl is searched next to the URDF and in its package, first with its whole
    path, then without its first folders (meshes/tyre.stl, tyre.stl). A symbolic link that leads out of the package is
    ignored.
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
    """Return the corners [n, 3] (m) and the triangles [m, 3] of a mesh file.

    Parameters
    ----------
    file : path
        An .stl, .obj, .ply or .dae file.
    scale : array
        Factors along x, y and z, as the URDF states them.

    Raises
    ------
    DataError
        The file has another format, is damaged or too large, or names other parts.
    """
    import trimesh

    kind = file.suffix.lower()
    if kind not in KINDS:
        raise DataError(
            f"{file}: a mesh must be a file of the type {', '.join(KINDS)}: convert the mesh to one of these types."
        )
    try:
        read = content(file, MAX_MESH_BYTES)
        if not KINDS[kind](read):
            raise DataError(f"{file}: the content is no {kind}, or it names other files: export the mesh again.")
        # The limits are checked on the bytes, before a reader could spend time or memory on them.
        if kind in PARTS and any(islice(PARTS[kind].finditer(read), MAX_PARTS, None)):
            raise DataError(
                f"{file}: it has more than {MAX_PARTS} parts, groups or materials: export the mesh as one part."
            )
        loaded = trimesh.load(io.BytesIO(read), file_type=kind[1:], process=False)
        # A scene has several shapes, which become one mesh. A shape that is placed several times counts several times,
        # so that a small file could otherwise become a mesh of any size.
        if isinstance(loaded, trimesh.Scene):
            placed = [loaded.geometry[loaded.graph[node][1]] for node in loaded.graph.nodes_geometry]
            if sum(3 * len(getattr(shape, "faces", ())) for shape in placed) > MAX_CORNERS:
                raise DataError(
                    f"{file}: its parts are placed so often that the mesh has more than {MAX_CORNERS} corners of "
                    "triangles: export a simpler mesh."
                )
            loaded = loaded.to_mesh()
        # The scale of the URDF converts the numbers of the file to metres.
        return np.asarray(loaded.vertices, dtype=float) * np.asarray(scale), np.asarray(loaded.faces)
    except DataError:
        raise
    except OSError as error:
        raise DataError(f"{file}: the mesh cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # any format's reader may fail on a file
        raise DataError(f"{file}: the mesh is damaged: export it again.") from error
