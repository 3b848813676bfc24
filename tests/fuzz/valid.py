"""Valid inputs of every reader, small, and what is done with each before any fit or drive."""

import importlib.util
import io
import math
import shutil
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import trimesh
from PIL import Image
from scipy.io import savemat

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import text
from rover_pin.base.files.toml_file import toml_text
from rover_pin.cli import app
from rover_pin.comparison.compare import read_verdict
from rover_pin.control.slip_control import load_gains
from rover_pin.experiments.drive_log.checks import log as drive_checks
from rover_pin.experiments.drive_log.model import base_model, nuisances, with_spread
from rover_pin.experiments.wheel_rig import checks as rig_checks
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.measurements.drive_points import points_of_log
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.traction_points import read_traction_points
from rover_pin.rover.description.layout import rover_folder
from rover_pin.rover.description.meshes import read_mesh
from rover_pin.rover.description.tree import read_tree
from rover_pin.rover.proposal.propose import propose
from rover_pin.rover.rover import load_rover
from rover_pin.rover.urdf_check import check_urdf
from rover_pin.scenarios.road_check import road_check
from rover_pin.scenarios.scenario import Scenario, scenario
from rover_pin.simulation.model.toml_file import read_model
from rover_pin.simulation.trace.files import write_parquet
from rover_pin.simulation.trace.trace import Trace
from rover_pin.sweep import read_study
from rover_pin.sweep.case import check_names
from rover_pin.terrain.files import from_grid, from_polyline
from rover_pin.tuning.study_file import read_tuning

from . import doors

RIG = """
kind = "wheel-rig"
name = "small"
files = { points = "points.csv", penetration = "penetration.csv" }
[wheel]
r = { value = 62.5, unit = "mm", low = 60.0, high = 63.0 }
b = { value = 0.06, unit = "m" }
surface = "smooth"
[soil]
n = 1.1
k_c = { value = 15.6e3, unit = "N/m^(n+1)" }
k_phi = { value = 2407.4e3, unit = "N/m^(n+2)" }
phi = { value = 31.9, unit = "deg" }
[noise]
drawbar_pull_over_load = 0.0126
torque = { value = 0.02, unit = "N m" }
sinkage = { value = 0.6, unit = "mm" }
"""
POINTS = """run,level,slip,rim_speed_mps,travel_speed_mps,load_N,drawbar_pull_N,torque_Nm,sinkage_m
a,10,0.1,0.01,0.009,25.0,1.5,0.3,0.015
b,10,0.1,0.01,0.009,24.0,1.4,0.29,0.016
c,30,0.3,0.0143,0.01001,25.5,3.1,0.41,0.019
d,60,0.6,0.025,0.01,25.1,4.4,0.52,0.026
"""
PENETRATION = "indenter,trial,sinkage_m,force_N\n" + "".join(
    f"wheel_smooth,{trial},{depth},{2000.0 * depth**1.1 * trial:.3f}\n"
    for trial in (1, 2)
    for depth in (0.005, 0.01, 0.02, 0.03)
)
DRIVE = """
kind = "drive-log"
name = "small"
source = "made"
rover = "cart"
gravity = { value = 9.81, unit = "m/s^2" }
wheels = ["fl", "fr", "bl", "br"]
[terrain]
polylines = ["ground.csv", "ground.csv"]
borders = [0.0]
patch = [{ x_from = 1.0, x_to = 2.0, ground = 1 }]
[soil]
phi = { value = 30.0, unit = "deg", sd = 2.0 }
k = { value = 5.0, unit = "mm", sd = 1.0 }
[wheel]
r = { value = 110.0, unit = "mm" }
[motor]
supply = { value = 7.2, unit = "V" }
resistance = { value = 3.0, unit = "ohm", sd = 0.1 }
[noise]
wheel_rate = { value = 0.02, unit = "rad/s" }
[[run]]
file = "run.FORMAT"
start = { x = 0.0, y = 0.0, yaw = 0.0 }
purpose = "see"
units = { wheel_rate_fl = "rpm" }
attrs = { note = "x" }
"""
GROUND = "x_m,z_m,ground\n-1.0,0.0,0\n0.0,0.0,0\n1.0,0.05,1\n3.0,0.05,0\n"
BAG = """
kind = "drive-log"
name = "bags"
wheels = ["fl"]
[bag]
period = { value = 40, unit = "ms" }
[columns]
wheel_rate_fl = { topic = "/joints", field = "velocity[name=fl]", stamp = "header.stamp", unit = "rpm", scale = 2.0 }
duty_fl = { topic = "/joints", field = "position[0]", hold = true }
[[run]]
file = "run.mcap"
"""
MODEL = """
kind = "drive-model"
note = "x"
rover = "cart"
gravity = { value = 9.81, unit = "m/s^2" }
motor = { supply = { value = 7.2, unit = "V" } }
slip = { name = "RelaxedSlip" }
terrain = { polyline = "ground.csv" }
soil = [{ phi = { value = 30.0, unit = "deg" }, k = 0.01 }, {}]
effect = [
  { name = "SoilTraction", form = "torque", angles = "FixedAngles" },
  { name = "WeakMotor", wheel = 2, g = 0.1 },
  { name = "TachoScale", wheel = "fl", e = 0.01 },
  { name = "PointMass", m = 1.0 },
]
"""
RIG_MODEL = """
kind = "rig-model"
note = "x"
wheel = { r = { value = 62.5, unit = "mm" }, b = 0.06 }
soil = { phi = { value = 30.0, unit = "deg" }, k = 0.01 }
effect = [{ name = "SoilTraction", form = "net", angles = "SinkageAngles" }, { name = "SlipSinkage", n_1 = 0.3 }]
"""
GAINS = "S_d = 0.3\nk_p = { value = 0.5 }\nk_i = 0.2\n"
SWEEP = """
name = "small"
scenario = "ditch"
duration = 1.0
dt = 0.005
repeats = 2
seed = 3
paired = [["soil.c", "soil.phi"]]
plan = { kind = "sobol", cases = 4 }
[settings]
gravity = { value = 1.62, unit = "m/s^2" }
terrain.depth = 0.04
[parameters]
terrain.wall_angle = { low = 40, high = 60, unit = "deg" }
soil.k = { low = 1e-3, high = 1e-1, scale = "log" }
soil.c = [0.0, 100.0]
soil.phi = { values = [30, 37], unit = "deg" }
"""
TUNING = """
name = "small"
estimate = "true"
seed = 1
[free]
k_p = [0.01, 10.0]
S_d = [0.05, 0.9]
[before]
k_i = 0.2
[cost]
slip = 0.3
[effort]
population = 12
generations = 2
[[training]]
name = "a"
scenario = "ditch"
post_peak = 0.1
soil.k = 0.01
terrain.wall_angle_deg = 35
[[held_out]]
scenario = "incline"
duration = 5
"""
ESRI = (
    "ncols 4\nnrows 3\nxllcorner 5.0\nyllcorner 7.0\ncellsize 0.1\nNODATA_value -9999\n"
    "0 0.01 0.02 0.03\n0.01 0.02 0.03 0.04\n0.02 0.03 0.04 0.05\n"
)
VERDICT = """{"name": "small", "answer": "named", "effects": ["SlipSinkage"],
"held_out": [{"name": "sinkage", "before": 3.0, "after": 1.0, "unit": "mm"}],
"after": {"parameters": {"n_1": {"value": 0.1, "low": 0.0, "high": null, "unit": ""}}}}"""
MATRIX = "0,0.01,0.02\n0.01,0.02,0.03\n0.02,0.02,0.02\n"
FACTORS = "slip,traction_factor,sd,count\n0.1,0.1,0.02,3\n0.3,0.2,0.02,3\n0.6,0.25,0.03,3\n"
WORDS = (
    "drive ditch --set soil.k=0.01 --set terrain.wall_angle_deg=40 --set motor.supply=7.2 --gravity 1.62 --soil fjs-1",
    "drive flat --set form=net --set slip=relaxed --set start.yaw_deg=0 --set duration=1 --set control.delta=0.5",
    "drive hills --set effect.NormalDamping.d=100 --set rover=cart --set dt=0.005 --set patch.x_from=1 --control none",
    "drive rocks --set terrain.count=3 --set terrain.seed=2 --set soil.phi_deg=31 --set terrain.start=1",
    "drive washboard --set terrain.count=3 --set terrain.wavelength=0.2 --control true --set control.k_p=0.5",
    "drive slope --set terrain.rate_deg=10 --set terrain.steepest_deg=10 --add Grousers --control true",
    "drive turn --set control.radius=1 --set gear_friction=0.1 --set start.x=0 --set angles=sinkage",
    "bounds --slope-deg 5 --slip 0.2 --soil table-1 --form net --rover cart --gravity moon --json",
    "identify POINTS --set soil.c=0 --prior phi=0.6:0.05 --json",
    "check-urdf ROVER --json",
)
"""Command lines; of `drive` only the scenario is made, nothing is driven."""


@dataclass(frozen=True)
class Case:
    """One reader: its valid files, those that are mutated, and what reads them; `share` is its part of all inputs."""

    name: str
    files: dict[str, bytes]
    read: Callable[[Path], object]
    victims: tuple[str, ...] = ()
    share: float = 1.0

    def lay(self, folder: Path, changed: dict[str, bytes]) -> None:
        """Write the files into an empty folder."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name, content in {**self.files, **changed}.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)


def cases(scratch: Path) -> list[Case]:
    """Return every reader with its valid input."""
    scratch.mkdir(exist_ok=True)
    ground = {"ground.csv": GROUND.encode()}
    rig = {"rig.toml": RIG.encode(), "points.csv": POINTS.encode(), "penetration.csv": PENETRATION.encode()}
    packed = {**rig, "rig.toml": RIG.replace("points.csv", "points.parquet").encode(), "points.parquet": _points()}
    log = {**ground, "drive.toml": DRIVE.replace("FORMAT", "csv").encode(), "run.csv": _run_csv()}
    other_files = {
        **ground,
        "drive.toml": DRIVE.replace("FORMAT", "parquet").encode(),
        "run.parquet": _run_parquet(scratch),
    }
    rovers = rover_folder()
    cart, nexus6 = (
        {name: (rovers / name).read_bytes() for name in (f"{rover_name}.toml", f"{rover_name}.urdf")}
        for rover_name in ("cart", "nexus6")
    )
    return [
        Case("rig", rig, _rig, share=2.0),
        Case("rig in parquet", packed, _rig, ("points.parquet",), 0.5),
        Case("drive log", log, _drive, share=1.5),
        Case("drive log in parquet", other_files, _drive, ("run.parquet",), 0.5),
        *([Case("drive log of a bag", bag, lambda at: read_drive_log(at))] if (bag := _bag(scratch)) else []),
        Case("cart", cart, lambda at: _rover(at / "cart.toml"), share=2.0),
        Case("own rover", _own_rover(), _own, share=1.5),
        Case("nexus6", nexus6, lambda at: _rover(at / "nexus6.toml"), share=0.5),
        Case("polyline", ground, lambda at: from_polyline(at / "ground.csv")),
        Case("grid in npz", {"grid.npz": _grid()}, lambda at: from_grid(at / "grid.npz")),
        Case("grid in csv", {"grid.csv": _grid_csv()}, lambda at: from_grid(at / "grid.csv"), share=0.5),
        Case("grid in npy", {"dem.npy": _raster("npy")}, lambda at: from_grid(at / "dem.npy", cell=0.1), share=0.5),
        Case("grid in png", {"dem.png": _raster("png")}, lambda at: from_grid(at / "dem.png", 0.1, 1.0), share=0.5),
        Case("grid in esri", {"dem.asc": ESRI.encode()}, lambda at: from_grid(at / "dem.asc"), share=0.5),
        Case(
            "grid filled",
            {"dem.npy": _raster("npy")},
            lambda at: from_grid(at / "dem.npy", 0.1, missing="fill"),
            share=0.3,
        ),
        Case(
            "grid cut", {"dem.npy": _raster("npy")}, lambda at: from_grid(at / "dem.npy", 0.1, missing="cut"), share=0.3
        ),
        Case("grid in mat", {"dem.mat": _raster("mat")}, lambda at: from_grid(at / "dem.mat", 0.1), share=0.5),
        Case("matrix in csv", {"dem.csv": MATRIX.encode()}, lambda at: from_grid(at / "dem.csv", 0.1), share=0.5),
        *(
            [Case("grid in geotiff", {"dem.tif": bag}, lambda at: from_grid(at / "dem.tif"))]
            if (bag := _geotiff())
            else []
        ),
        *[Case(f"mesh in {kind}", {f"a.{kind}": mesh}, _mesh, share=0.4) for kind, mesh in _meshes().items()],
        Case("verdict", {"verdict.json": VERDICT.encode()}, lambda at: read_verdict(at / "verdict.json"), share=0.5),
        Case("model", {**ground, "model.toml": MODEL.encode()}, lambda at: read_model(at / "model.toml"), share=1.5),
        Case("rig model", {"model.toml": RIG_MODEL.encode()}, lambda at: read_rig_model(at / "model.toml")),
        Case("gains", {"gains.toml": GAINS.encode()}, lambda at: load_gains(at / "gains.toml"), share=0.5),
        Case("sweep", {"study.toml": SWEEP.encode()}, _sweep, share=1.5),
        Case("tuning", {"study.toml": TUNING.encode()}, _tuning, share=1.5),
        Case("command line", {"words.txt": "\t".join(WORDS[0].split()).encode()}, read_words, share=1.5),
        *_doors(scratch, rig),
        Case("factors", {"points.csv": FACTORS.encode()}, lambda at: read_traction_points(at / "points.csv")),
    ]


def _doors(scratch: Path, rig: dict[str, bytes]) -> list[Case]:
    texts = {"model.toml": RIG_MODEL.encode(), "tuning.toml": TUNING.encode()}
    return [
        Case(name, file, doors.READ[name], doors.VICTIMS.get(name, ()), doors.SHARES.get(name, 0.5))
        for name, file in doors.files(scratch, rig, _own_rover(), texts).items()
    ]


def _rig(folder: Path) -> None:
    data = read_rig_set(folder)
    experiment = RigExperiment((data,))
    rig_checks.refuse_unfit(experiment)
    rig_checks.too_poor(experiment, 4)
    rig_checks.findings(experiment)
    data.independent(float(data.soil().n))


def _drive(folder: Path) -> None:
    log = read_drive_log(folder)
    drive_checks.refuse_unfit(log)
    drive_checks.findings(log)
    drive_checks.too_poor(log)
    nuisances(log, with_spread(base_model(log)))
    points_of_log(log)


def _rover(path: Path) -> None:
    check_urdf(path)
    check_urdf(path.with_suffix(".urdf"))
    load_rover(path)


def _own_rover() -> dict[str, bytes]:
    """A rocker-bogie with an arm and a bar, and every table that a rover's TOML may have."""
    spec = importlib.util.spec_from_file_location("rover_farm", Path(__file__).parents[1] / "rover" / "farm.py")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    farm = module.rocker_bogie().link("bar", "body", "revolute", "0 0 0.5", "0 0 1", mass=3.0)
    farm.link("mast", "body", "revolute", "0.2 0 0.4", "0 0 1").link(
        "rod", "mast_link", "prismatic", "0 0 0.1", "1 0 0"
    )
    table = {
        **{
            "name": "own",
            "urdf": "own.urdf",
            "base": "body",
            "base_rpy": [0.0, 0.0, 0.0],
            "tied_sides": True,
            "cut": [],
        },
        **{**module.THREE_AXLES, **module.ROCKERS, "wheel": {"r": 0.15, "b": 0.1}},
        "coupled": {"bar": {"joint": "rocker_l", "ratio": -0.5}},
        "held": {"mast": {"value": 20, "unit": "deg"}, "rod": 0.1},
        "springs": {"bogie": {"k_s": 30.0, "d": 2.0}},
        "motor": {"stall_torque": 12.0, "no_load_speed": {"value": 20, "unit": "rpm"}, "gear": 1.0},
        "soil": {"name": "hit-lss1", "k": 0.02},
    }
    return {"own.toml": toml_text(table).encode(), "own.urdf": farm.urdf.encode()}


def _own(folder: Path) -> None:
    _rover(folder / "own.toml")
    road_check(load_rover(folder / "own.toml"))
    propose(read_tree(text(folder / "own.urdf"), "own.urdf"), folder)


def _sweep(folder: Path) -> None:
    study = read_study(folder / "study.toml")
    study.describe()
    check_names(study, study.cases()[:1])


def _tuning(folder: Path) -> None:
    study = read_tuning(folder / "study.toml")
    study.law([0.5] * len(study.free))
    for case in (*study.training, *study.held_out):
        scenario(case.scenario, **dict(case.settings))


def read_words(folder: Path) -> None:
    """Run one command line of a file as the program does, `drive` without driving."""
    (folder / "points.csv").write_text(FACTORS)
    line = (folder / "words.txt").read_text(encoding="utf-8")
    words = [
        {"POINTS": str(folder / "points.csv"), "ROVER": str(rover_folder() / "cart.toml")}.get(word, word)
        for word in line.split("\t")
    ]
    output = io.StringIO()
    with redirect_stdout(output), redirect_stderr(output), patch.object(Scenario, "drive", _stopped):
        try:
            app.app(words)
        except SystemExit as left:
            if left.code not in (0, 1, 2):
                raise
            if left.code:
                raise DataError("refused by the parser of options, or faults were found") from left


def _stopped(scenario: Scenario, progress: object = None, engine: object = None) -> None:
    raise SystemExit(0)


def _points() -> bytes:
    buffer = io.BytesIO()
    pd.read_csv(io.StringIO(POINTS)).to_parquet(buffer)
    return buffer.getvalue()


def _run(count: int = 60) -> dict[str, np.ndarray]:
    t = 0.2 * np.arange(count)
    duty = np.where(t < 6.0, 0.5, 0.7)
    rng = np.random.default_rng(0)
    sees = lambda sd: sd * rng.standard_normal(count)  # noqa: E731
    run = {"t_s": t}
    for wheel in ("fl", "fr", "bl", "br"):
        run |= {
            f"duty_{wheel}": duty,
            f"wheel_rate_{wheel}": duty + sees(0.01),
            f"current_{wheel}_A": duty + sees(0.01),
        }
    x = 0.095 * np.cumsum(duty) * 0.2
    run |= {"body_x": x + sees(1e-3), "body_y": sees(1e-3), "body_z": 0.1 + sees(1e-3), "battery_V": 7.2 + sees(0.01)}
    run |= {"body_vx": 0.095 * duty + sees(1e-3), "body_vy": sees(1e-3)}
    return run | {f"body_{angle}": sees(2e-3) for angle in ("roll", "pitch", "yaw")}


def _run_csv() -> bytes:
    run = _run()
    run["wheel_rate_fl"] = run["wheel_rate_fl"] * 30.0 / math.pi
    return pd.DataFrame(run).to_csv(index=False).encode()


def _run_parquet(scratch: Path) -> bytes:
    run = _run()
    run["wheel_rate_fl"] = run["wheel_rate_fl"] * 30.0 / math.pi
    return write_parquet(scratch / "run.parquet", Trace(run, {}, {"note": "x"})).read_bytes()


def _grid() -> bytes:
    buffer, z = io.BytesIO(), 0.02 * np.random.default_rng(0).standard_normal((5, 4))
    np.savez(buffer, x0=0.0, y0=-1.0, dx=0.5, dy=0.5, z=z, ground=np.zeros((4, 3), dtype=int))
    return buffer.getvalue()


def _raster(kind: str) -> bytes:
    buffer, z = io.BytesIO(), np.arange(20, dtype=np.uint16).reshape(5, 4)
    if kind == "npy":
        np.save(buffer, 0.01 * z)
    elif kind == "mat":
        savemat(buffer, {"z": 0.01 * z})
    else:
        Image.fromarray(1000 * z).save(buffer, format="png")
    return buffer.getvalue()


def _geotiff() -> bytes:
    """Return a small GeoTIFF, or nothing where rasterio is not installed."""
    try:
        import rasterio
    except ImportError:
        return b""
    step = rasterio.Affine(0.1, 0.0, 5e5, 0.0, -0.1, 4e6)
    profile = {"width": 4, "height": 5, "count": 1, "dtype": "float32", "crs": "EPSG:32633", "transform": step}
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", nodata=-9999.0, **profile) as file:
            file.write(0.01 * np.arange(20, dtype=np.float32).reshape(1, 5, 4))
        return memory.read()


def _meshes() -> dict[str, bytes]:
    """Return a small mesh in each format that is read."""
    box = trimesh.creation.box()
    mesh_files = {kind: box.export(file_type=kind) for kind in ("stl", "obj", "ply")}
    return {kind: mesh.encode() if isinstance(mesh, str) else mesh for kind, mesh in mesh_files.items()}


def _mesh(folder: Path) -> None:
    (file,) = folder.iterdir()
    read_mesh(file, 1.0)


def _grid_csv() -> bytes:
    rows = [f"{0.5 * i},{0.5 * j},{0.01 * i * j},0" for i in range(4) for j in range(3)]
    return "\n".join(["x_m,y_m,z_m,ground", *rows]).encode()


def _bag(scratch: Path) -> dict[str, bytes]:
    """Return a small bag of joint states with its log's description, or nothing where rosbags is not installed."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        return {}
    types = get_typestore(Stores.ROS2_HUMBLE)
    time, header = types.types["builtin_interfaces/msg/Time"], types.types["std_msgs/msg/Header"]
    state = types.types["sensor_msgs/msg/JointState"]
    with Writer(scratch / "run", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/joints", "sensor_msgs/msg/JointState", typestore=types)
        for i in range(30):
            stamp, rates = time(sec=1, nanosec=20_000_000 * i), np.ones(1)
            message = state(
                header=header(stamp=stamp, frame_id=""), name=["fl"], position=rates / 2, velocity=rates, effort=rates
            )
            bag.write(connection, 1_000_000_000 + 20_000_000 * i, types.serialize_cdr(message, message.__msgtype__))
    (file,) = (scratch / "run").glob("*.mcap")
    return {"drive.toml": BAG.encode(), "run.mcap": file.read_bytes()}
