"""Simulated drives of a rover in both directions over waves and a slope, with varying duty and sensor noise.

`write` writes six runs as a drive log. `write_recording` writes four runs as a logger would record them: with names and
units of its own, and without a declared ground, soil or motor. The command `import-log` makes a drive log of such a
recording.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np

from rover_pin.base.files.paths import named_from
from rover_pin.base.files.table import columns_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import as_table
from rover_pin.demo import SETS
from rover_pin.demo.hidden import DRIVEN, DemoSet, choose_hidden, keep_truth
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.logs.drive_log import LogMetadata, write_drive_log
from rover_pin.parameters import TABLE_1
from rover_pin.parameters.soils import HARD_GROUND
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.command import Controller
from rover_pin.simulation.model.defaults import (
    has_papers_wheel,
    own_motor,
    own_soil,
    pace,
    scale,
    usual_angles,
    usual_slip,
)
from rover_pin.simulation.model.effect_files import AnyEffect
from rover_pin.simulation.model.effect_words import effect_of
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.sensors import Sensors, measure
from rover_pin.simulation.simulate import Progress, simulate
from rover_pin.simulation.start import Start
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.wheel_forces import TorqueTraction
from rover_pin.terrain.files import write_terrain
from rover_pin.terrain.terrain import Lanes, Profile

RUNS, SECONDS = 6, 16.0
"""Number of runs of the simulated log, and duration of a run [s] for the rover Nexus 6. The last two runs repeat the
first two runs. A slower rover gets longer runs."""
K, K_SD, PHI_SD = 0.005, 0.2, math.radians(1.5)
"""Shear displacement k that the log states for the sand under the wheels of Nexus 6 [m], and the standard deviations of
the soil tests. K_SD holds for k and k_1 as a fraction of their values [-], and PHI_SD for the friction angle phi
[rad]."""
DRIFT = 5e-4
"""Standard deviation of the drift of the tracked position, in x and in y, after one second [m] (assumed). The drift is
a random walk, so that its standard deviation grows with the root of the time: 2 mm after 16 s."""
MOTOR_SD, TACHO_SD = 0.01, 0.005
"""Standard deviations of the differences between wheels, as fractions [-] (assumed). MOTOR_SD holds for the motor
torque, and TACHO_SD for the gain of the tachogenerator, which is the sensor of the wheel rate. The differences are part
of the true model, because real motors and sensors differ too, but they do not count as the hidden effect."""
RECORDED_RUNS = 4
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
    """Simulate a drive log, and write drive.toml, the terrain and one CSV file for each run.

    Parameters
    ----------
    folder : Path
        Folder of the log; its name becomes the log's name.
    hidden : str
        The effect to hide, in words such as "SlipSinkage.n_1=0.7"; "any" for a random choice, "nothing" for none.
    seed : int
        Seed of the duties, the noise and the random choice.
    rover : str
        Name of a rover or path of its URDF file.
    progress : callable, optional
        Called with the number of finished runs.

    Returns
    -------
    DemoSet
        The files of the log, and the truth that they do not contain.

    Raises
    ------
    ParameterError
        If the effect is unknown, or if this rover cannot have it.
    DataError, UrdfError, SimulationError
        If the folder cannot be written to, the rover cannot be read, or the rover does not drive.
    """
    random, model = np.random.default_rng(seed), declared_model(rover)
    true, effect = hidden_model(model, hidden, random)
    traces = measured_runs(true, random, RUNS, progress)
    truth = keep_truth(folder, effect, true.soils[0], {"seed": seed})
    soil = model.soils[0]
    # The log states the soil tests: the stated soil, not the true one, with its standard deviations.
    sds = {"phi": PHI_SD, "k": K_SD * float(soil.k), "k_1": K_SD * float(soil.k_1)}
    metadata = LogMetadata(
        folder.name,
        "made up by rover-pin demo; not measured",
        named_from(folder, rover),
        wheels=tuple(wheel.name for wheel in model.rover.wheels),
        terrain=write_terrain(folder, model.terrain),
        soil={name: {**as_table(soil)[name], "sd": sd} for name, sd in sds.items()},
        motor=as_table(model.motor),
    )
    write_drive_log(folder, traces, metadata)
    return DemoSet((folder / "drive.toml", *(folder / f"{name}.csv" for name in traces)), truth)


def write_recording(
    folder: Path, hidden: str, seed: int, rover: str = "nexus6", progress: Progress | None = None
) -> DemoSet:
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
    for trace in measured_runs(true, random, RECORDED_RUNS, progress).values():
        # Names, units and the number of digits are those of a logger, whose clock counts the time of the recording.
        columns = {"time_ms": np.round(1e3 * (begin + trace.t))}
        for name, (channel, factor) in BODY_COLUMNS.items():
            columns[name] = np.round(factor * trace[channel], 3)
        for name, (channel, factor) in WHEEL_COLUMNS.items():
            columns |= {name.format(wheel): np.round(factor * trace[channel.format(wheel)], 4) for wheel in wheels}
        tables.append(columns)
        begin += float(trace.t[-1]) + PAUSE
    rows = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    truth = keep_truth(folder, effect, true.soils[0], {"seed": seed})
    return DemoSet((replace_file(folder / SETS["recording"], columns_text(rows)),), truth)


def measured_runs(
    true: Model, random: np.random.Generator, count: int, progress: Progress | None = None
) -> dict[str, Trace]:
    """Drive the true model with random duties, and return what noisy sensors measure, as a dict from the name of a run
    to its trace.

    The last two of the `count` runs repeat the first two, so that the scatter of repeats can be measured. Every second
    run drives back down the slope. `progress` is called with the number of finished runs.
    """
    size, seconds = scale(true.rover), SECONDS * pace(true.rover, true.motor)
    traces, plans = {}, [_random_duties(random, seconds, len(true.rover.wheels)) for _ in range(count - 2)]
    for run, plan in enumerate([*plans, *plans[:2]]):
        # Driving back down the slope separates rolling resistance from gravity.
        start = Start(-0.6 * size, 0.0, 0.0) if run % 2 == 0 else Start(0.7 * size, 0.0, math.pi)
        # The true model moves the rover, and its sensors add noise to what is logged.
        driven = simulate(true, plan, seconds, start, measure_error=False)
        log = measure(driven, Sensors(), int(random.integers(2**31)), true.sensor_effects)
        # The variance of a random walk grows with time, so each step has an SD of DRIFT sqrt(dt).
        steps = np.sqrt(np.diff(log.t, prepend=log.t[0]))
        drifted = {
            axis: log[axis] + np.cumsum(DRIFT * steps * random.normal(size=len(steps))) for axis in ("body_x", "body_y")
        }
        traces[f"run-{run + 1}"] = dataclasses.replace(
            log, channels={**log.channels, **drifted}, attrs={"start": dataclasses.asdict(start)}
        )
        if progress is not None:
            progress(run + 1.0)
    return traces


def hidden_model(model: Model, hidden: str, random: np.random.Generator) -> tuple[Model, AnyEffect | None]:
    """Return the true model, which simulates the log, and the hidden effect, which the stated `model` lacks.

    The true model has a friction angle phi and a shear displacement k that are drawn around the stated values with half
    the stated standard deviation. Its motors and tachogenerators differ slightly from wheel to wheel, as in a real
    rover. If `hidden` is "nothing" (or "any" draws no effect), the hidden effect is None.
    """
    word, soil = choose_hidden(hidden, DRIVEN, random), model.soils[0]
    effect = effect_of(word, model) if word else None
    soil = soil.replace(
        phi=soil.phi + random.normal(0.0, PHI_SD / 2), k=soil.k * math.exp(random.normal(0.0, K_SD / 2))
    )
    true = model.replace(soils=(soil, *model.soils[1:]))
    # Small differences between wheels are part of the true model, but no hidden effect.
    for number, wheel in enumerate(model.rover.wheels):
        true = true.having(WeakMotor(g=random.normal(0.0, MOTOR_SD), wheel=number))
        true = true.having(TachoScale(e=random.normal(0.0, TACHO_SD), wheel=wheel.name))
    return (true if effect is None else true.having(effect)), effect


def declared_model(rover: str) -> Model:
    """Return the model that the log states, on a terrain with waves and then a slope of 5 deg, scaled to the wheel
    size.
    """
    built = load_rover(rover)
    size = scale(built)
    # The soil of the paper suits its own wheel; another rover gets the soil of its TOML.
    soil = TABLE_1.replace(k=K) if has_papers_wheel(built) else own_soil(built).value
    x = size * np.arange(-1.8, 1.81, 0.06)
    # Waves change the wheel loads, and the slope needs traction; both make the numbers of the soil visible.
    z = 0.012 * size * np.sin(2 * np.pi * x / (0.8 * size))
    z += np.where(x > 0.2 * size, (x - 0.2 * size) * math.tan(math.radians(5)), 0.0)
    return Model(
        built,
        Lanes((Profile(x, z),), ()),
        (soil, HARD_GROUND),
        own_motor(built).value,
        usual_slip(built),
        base_effects(soil, built, SoilTraction(TorqueTraction(), usual_angles(built))),
        body_effects=built.springs,
    )


def _random_duties(random: np.random.Generator, seconds: float, wheels: int) -> Controller:
    """Return a controller with random motor duties that stay constant for a while and then jump to new values.

    The duties differ slightly between wheels. A duty lasts for 0.1 to 0.2 of the run, `seconds`.
    """
    holds, t = [], 0.0
    while t < seconds:
        holds.append((t, random.uniform(0.4, 0.85) + random.uniform(-0.09, 0.09, wheels)))
        t += seconds * random.uniform(0.1, 0.2)
    return lambda reading: next(duty for start, duty in reversed(holds) if start <= reading.t + 1e-9)
