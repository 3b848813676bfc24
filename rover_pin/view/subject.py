"""What is to be seen: a trace with the rover that drove it and the ground."""

from dataclasses import dataclass
from pathlib import Path

from rover_pin.logs.drive_log import DriveLog
from rover_pin.rover.description.layout import rover_folder, urdf_folder
from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain


@dataclass(frozen=True)
class Subject:
    """A trace, its rover, its ground, and the folder in which the rover's meshes lie."""

    name: str
    trace: Trace
    rover: Rover
    terrain: Terrain
    meshes: Path | None


def subject_of_log(log: DriveLog, run: str = "") -> Subject:
    """Return what a run of a drive log shows; its first unless another is named."""
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
    """Return the folder from which a rover's meshes are named: that of its URDF."""
    path = Path(rover)
    return urdf_folder(path) if path.suffix else rover_folder()
