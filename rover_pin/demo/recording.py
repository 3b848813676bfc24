"""A simulated recording as a logger writes it: names and units of its own, no ground, soil or motor declared.

The command `import-log` makes a drive log of such a recording.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.files.table import columns_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.demo import SETS
from rover_pin.demo.drive_log import declared_model, hidden_model, measured_runs
from rover_pin.demo.hidden import DemoSet, keep_truth
from rover_pin.simulation.simulate import Progress
from rover_pin.simulation.trace.trace import Trace

RUNS = 4
"""Number of runs in the recording. The last two runs repeat the first two. Between two runs the rover is carried back
to a start."""
PAUSE = 60.0
"""Time between two runs in which nothing is recorded [s] (assumed). The import finds the runs by this gap in the
time."""
RPM = 30.0 / math.pi
"""Factor from rad/s to revolutions per minute."""
BODY_COLUMNS = {
    "x_mm": ("body_x", 1e3),
    "y_mm": ("body_y", 1e3),
    "z_mm": ("body_z", 1e3),
    "roll_deg": ("body_roll", math.degrees(1.0)),
    "pitch_deg": ("body_pitch", math.degrees(1.0)),
    "heading_deg": ("body_yaw", math.degrees(1.0)),
    "battery_V": ("battery_V", 1.0),
}
"""Column of the recording -> channel of the simulated sensors, and factor from its SI unit to the unit of the
column."""
WHEEL_COLUMNS = {"pwm_{}_percent": ("duty_{}", 1e2), "rpm_{}": ("wheel_rate_{}", RPM), "i_{}_mA": ("current_{}_A", 1e3)}
"""Columns that exist once for each wheel -> channel of the simulated sensors, and factor from its SI unit to the unit
of the column. The name of the wheel replaces the braces."""


def write(folder: Path, hidden: str, seed: int, rover: str = "nexus6", progress: Progress | None = None) -> DemoSet:
    """Simulate drives of a rover, and write them as one CSV file, whose clock jumps between two drives.

    Parameters
    ----------
    folder : Path
        Folder of the recording.
    hidden : str
        The effect to hide, in words such as "SupplySag.R_b=3"; "any" for a random choice, "nothing" for none.
    seed : int
        Seed of the duties, the noise and the random choice.
    rover : str
        Name of a rover or path of its URDF file.
    progress : callable, optional
        Called with the number of finished runs.

    Returns
    -------
    DemoSet
        The file of the recording, and the truth that it does not contain.

    Raises
    ------
    ParameterError
        If the effect is unknown, or if this rover cannot have it.
    DataError, UrdfError, SimulationError
        If the folder cannot be written to, the rover cannot be read, or the rover does not drive.
    """
    random, model = np.random.default_rng(seed), declared_model(rover)
    true, effect = hidden_model(model, hidden, random)
    wheels = [wheel.name for wheel in model.rover.wheels]
    tables, begin = [], 0.0
    for trace in measured_runs(true, random, RUNS, progress).values():
        tables.append(recorded_columns(trace, wheels, begin))
        begin += float(trace.t[-1]) + PAUSE
    rows = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    truth = keep_truth(folder, effect, true.soils[0], {"seed": seed})
    return DemoSet((replace_file(folder / SETS["recording"], columns_text(rows)),), truth)


def recorded_columns(trace: Trace, wheels: Sequence[str], begin: float) -> dict[str, np.ndarray]:
    """Return a run as columns of the recording (rows,): names, units and digits are those of a logger.

    `wheels` are the names of the wheels, and `begin` is the time of the recording at which the run begins [s].
    """
    columns = {"time_ms": np.round(1e3 * (begin + trace.t))}
    for name, (channel, factor) in BODY_COLUMNS.items():
        columns[name] = np.round(factor * trace[channel], 3)
    for name, (channel, factor) in WHEEL_COLUMNS.items():
        columns |= {name.format(wheel): np.round(factor * trace[channel.format(wheel)], 4) for wheel in wheels}
    return columns
