"""The drive that a view shows: a trace together with its rover and its terrain."""

from dataclasses import dataclass
from pathlib import Path

from rover_pin.logs.drive_log import DriveLog
from rover_pin.rover.description.layout import rover_folder, urdf_folder
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain


@dataclass(frozen=True)
class Subject:
    """The drive that a view shows: a trace, its rover, its terrain, and the folder of the rover's meshes (None: no
    meshes are drawn).
    """

    name: str
    trace: Trace
    rover: Rover
    terrain: Terrain
    meshes: Path | None


def subject_of_log(log: DriveLog, run: str = "") -> Subject:
    """Return one run of a drive log, with its rover and terrain, as the subject of a view. `run` is the name of the
    run; if it is empty, the first run is taken.
    """
    trace = log.run(run) if run else log.runs[0]
    name = Path(str(trace.attrs.get("file", log.metadata.name))).stem
    return Subject(
        log.metadata.name if len(log.runs) == 1 else f"{log.metadata.name}, {name}",
        trace,
        log.load_rover(),
        log.terrain(),
        mesh_folder(log.rover),
    )


def mesh_folder(rover: str) -> Path | None:
    """Return the base folder of the relative paths of meshes in a rover's URDF. `rover` is the name of a rover of the
    package, or the path of a rover's TOML.
    """
    path = Path(rover)
    return urdf_folder(path) if path.suffix else rover_folder()
