"""The doors that take a user's files: the command line itself on a folder, with a mutated file in it."""

import importlib.util
import io
import json
import os
import struct
import sys
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError, SimulationError
from rover_pin.cli import app
from rover_pin.scenarios.scenario import Scenario

TESTS = Path(__file__).parents[1]
TABLE = (
    "Rig 3;;;;\nSlip;Load;Drawbar pull;Torque;operator\n[-];[N];[N];[N m];\n"
    + "".join(f"0,{k};{80 + k} N;{1.5 * k};0,{k}5;Max\n" for k in range(1, 7))
)  # fmt: skip
SWEEP = """
name = "small"
scenario = "ditch"
duration = 0.1
repeats = 2
seed = 3
plan = { kind = "sobol", cases = 2 }
[settings]
gravity = { value = 1.62, unit = "m/s^2" }
[parameters]
terrain.wall_angle = { low = 40, high = 60, unit = "deg" }
soil.k = { low = 1e-3, high = 1e-1, scale = "log" }
"""
DRIVE = """
kind = "drive"
scenario = "ditch"
rover = "cart"
soil = "table-1"
"soil.k" = "5mm"
terrain.wall_angle_deg = 40
add = ["DiggingMemory.c_d=0.1,length=0.05", "WeakMotor.wheel=fl,g=0.3"]
control = "camera"
"control.seed" = 3
duration = 2.5
[motor]
gear = { value = 100, unit = "" }
"""
EFFECT = """from dataclasses import dataclass
from typing import ClassVar
import casadi as ca
from rover_pin.contact import Load, Scalar
from rover_pin.effects.effect import Effect, MotorEffect, State
from rover_pin.base.quantity import quantity
@dataclass(frozen=True)
class Sticky(Effect):
    a: Scalar = quantity(0.02, "N m", "assumed", 0.0, 1.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}
    states: ClassVar[tuple[State, ...]] = (State("rust"),)
    def amend(self, contact, x):
        return contact._replace(h=contact.h + 0.0 * x[0])
    def load(self, contact, load, x):
        return Load(torque=self.a * ca.tanh(contact.rim / 0.005))
    def rate(self, contact, load, x):
        return (load.f_n - x[0],)
@dataclass(frozen=True)
class Worn(MotorEffect):
    g: Scalar = quantity(0.9, "", "assumed", 0.0, 1.0, "g")
    neutral: ClassVar[dict[str, float]] = {"g": 1.0}
    def torque(self, drive, torque, x):
        return (self.g - 1.0) * torque
"""
CONTROLLER = """class Hold:
    def __init__(self, model):
        self.wheels = len(model.rover.wheels)
        self.last = 0.0
    def reset(self):
        self.last = 0.0
    def __call__(self, reading):
        self.last = 0.5 * self.last + 0.2
        return [self.last] * self.wheels
def controller(model):
    return Hold(model)
"""
XACRO = """<?xml version="1.0"?>
<robot name="own" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="wide" value="0.25"/>
<link name="base"><inertial><mass value="5"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<xacro:macro name="wheel" params="name x y">
<link name="${name}"><inertial><mass value="0.3"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.06"/></geometry></collision></link>
<joint name="${name}_joint" type="continuous"><parent link="base"/><child link="${name}"/>
<origin xyz="${x} ${y} 0"/><axis xyz="0 1 0"/></joint>
</xacro:macro>
<xacro:wheel name="fl" x="0.3" y="${wide}"/>
<xacro:wheel name="fr" x="0.3" y="${-wide}"/>
<xacro:wheel name="rl" x="-0.3" y="${wide}"/>
<xacro:wheel name="rr" x="-0.3" y="${-wide}"/>
</robot>
"""
WORDS = (
    "init runs.csv --r 60mm --b 50mm --noise drawbar_pull=1N --noise torque=0.1Nm --out set --json",
    "import-log drive.csv --rover cart --column battery_V=7 --most 3 --out log",
    "new-rover own.urdf --out new.toml",
    "list settings flat --set soil.k=0.01",
    "list effects SlipSinkage --json",
    "list samples",
    "curve --soil table-1 --k 10mm --n 1.1 --out drawn",
    "compare model.toml model.toml --all",
    "demo rig --hidden nothing --seed 0 --tell --out set",
    "export drive.parquet --to csv --out made",
    "view drive.parquet --out seen",
    "new-effect StickySoil --acts motor --out mine",
    "check-data rig --json",
    "check-urdf own.toml --json",
    "close-loop rig --effects mine.py --fail-on named --out out",
    "sweep study.toml --workers 1 --out out",
    "tune tuning.toml --workers 1 --out out",
    "identify rig --set n=1.1 --prior phi=30deg:2deg",
)
"""Command lines on a folder of files; what takes long is not run."""


def _left(*value: object, **named: object) -> None:
    raise SystemExit(0)


def _undriven(*value: object, **named: object) -> None:
    raise SimulationError("not driven here")


STOPS = ("rover_pin.loop.close.close", "rover_pin.tuning.tune.tune_gains", "webbrowser.open")
"""What comes after every file is read, and is not run."""


STOPPED = 130
"""Exit code of a command that Ctrl-C ends, or code of a user's file that raises what Ctrl-C raises."""


def command(*words: str) -> Callable[[Path], None]:
    """Return the reading of a folder by a command line in it; nothing is driven, fitted or opened."""

    def read(folder: Path) -> None:
        run_in(folder, list(words))

    return read


def run_in(folder: Path, words: list[str]) -> None:
    """Run the program in a folder; what it says last where it refuses is a DataError."""
    output, before = io.StringIO(), Path.cwd()
    os.chdir(folder)
    try:
        with ExitStack() as stack:
            stack.enter_context(redirect_stdout(io.StringIO()))
            stack.enter_context(redirect_stderr(output))
            stack.enter_context(patch.object(sys, "argv", ["rover-pin", *words]))
            stack.enter_context(patch.object(Scenario, "drive", _undriven))
            for name in STOPS:
                stack.enter_context(patch(name, _left))
            app.main()
    except SystemExit as left:
        if left.code not in (0, 1, 2, STOPPED, None):
            raise
        if left.code:
            raise DataError((output.getvalue().splitlines() or ["faults were found"])[-1]) from left
    finally:
        os.chdir(before)


def read_words(folder: Path) -> None:
    """Run the command line that a file of the folder holds."""
    words = (folder / "words.txt").read_text(encoding="utf-8").split("\t")
    run_in(folder, words)


def files(
    scratch: Path, rig: dict[str, bytes], rover: dict[str, bytes], texts: dict[str, bytes]
) -> dict[str, dict[str, bytes]]:
    """Return what each door reads, by its name."""
    recordings, brake = (_module(TESTS / at) for at in ("importing/recordings.py", "oracle/brake_generator.py"))
    truth = recordings.truth(seconds=24.0)
    folder = scratch / "doors"
    folder.mkdir(exist_ok=True)
    german, ros = recordings.german(truth, folder).read_bytes(), _stamped(truth)
    bed = Path(str(importlib.util.find_spec("rover_pin.experiments.motor_brake").origin)).read_bytes()
    data = brake.write(folder / "brake", 0)
    brake_files = {file.name: file.read_bytes() for file in data.iterdir()}
    mesh = _mesh_rover(rover["own.urdf"])
    words = {**{f"rig/{name}": content for name, content in rig.items()}, **rover, "mine.py": EFFECT.encode()}
    words |= {"runs.csv": TABLE.encode(), "drive.csv": german, "study.toml": SWEEP.encode()}
    words |= {"drive.parquet": _trace(), "words.txt": b"list\tsamples", **texts}
    return {
        "init": {"runs.csv": TABLE.encode()},
        "import-log": {"drive.csv": german},
        "import-log of stamps": {"drive.csv": ros},
        "import-log of parquet": {"drive.parquet": _parquet(truth)},
        "import-log of mat": {"drive.mat": _mat(truth)},
        "new-rover": mesh,
        "new-rover of xacro": {"own.xacro": XACRO.encode()},
        "own bed": {"mine.py": bed, **brake_files},
        "own effects": {"mine.py": EFFECT.encode()},
        "own controller": {"mine.py": CONTROLLER.encode()},
        "import-log of objects": {"drive.mat": _mat_objects(truth)},
        "sweep by command": {"study.toml": SWEEP.encode()},
        "drive file": {"mine.toml": DRIVE.encode()},
        "view": {"drive.parquet": _trace()},
        "commands": words,
    }


READ = {
    "init": command(*WORDS[0].split()),
    "import-log": command("import-log", "drive.csv", "--rover", "cart"),
    "import-log of stamps": command("import-log", "drive.csv", "--rover", "cart"),
    "import-log of parquet": command("import-log", "drive.parquet", "--rover", "cart", "--out", "log"),
    "import-log of mat": command("import-log", "drive.mat", "--rover", "cart"),
    "new-rover": command("new-rover", "own.urdf"),
    "new-rover of xacro": command("new-rover", "own.xacro", "--trust"),
    "own bed": command("close-loop", ".", "--experiment", "mine.py"),
    "own controller": lambda folder: _own_controller(folder),
    "import-log of objects": command("import-log", "drive.mat", "--rover", "cart"),
    "own effects": lambda folder: _own_effects(folder),
    "sweep by command": command("sweep", "study.toml", "--workers", "1"),
    "drive file": command("list", "settings", "mine.toml"),
    "view": command("view", "drive.parquet"),
    "commands": read_words,
}
VICTIMS = {"own bed": ("mine.py", "mine.py", "points.csv", "motor.toml")}
SHARES = {
    "init": 2.0,
    "own effects": 1.0,
    "commands": 2.0,
    "own bed": 1.5,
    "view": 0.7,
    "new-rover of xacro": 0.3,
    "new-rover": 0.3,
}
"""Parts of all inputs; the others take long, and have a half."""


def _own_effects(folder: Path) -> None:
    from rover_pin.loop.own_code import refuse_unfit_effects

    refuse_unfit_effects(folder / "mine.py")


def _own_controller(folder: Path) -> None:
    """Drive a few steps by a user's controller."""
    from rover_pin.base.trust import Trust
    from rover_pin.scenarios.scenario import scenario

    file = str(folder / "mine.py")
    scenario("flat", rover="cart", control=file, trust=Trust.of(file), duration=0.05).drive(measure_error=False)


def _module(file: Path) -> object:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _stamped(truth: dict[str, np.ndarray]) -> bytes:
    ns = 1_700_000_000_000_000_000 + (1e9 * truth["t_s"]).round().astype(int)
    table = {"header.stamp.sec": ns // 10**9, "header.stamp.nanosec": ns % 10**9}
    return pd.DataFrame(table | {name: values for name, values in truth.items() if name != "t_s"}).to_csv().encode()


def _parquet(truth: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    times = pd.to_datetime(1_700_000_000_000_000_000 + (1e9 * truth["t_s"]).astype("int64"))
    pd.DataFrame({"stamp": times} | {name: values for name, values in truth.items() if name != "t_s"}).to_parquet(
        buffer
    )
    return buffer.getvalue()


def _mat(truth: dict[str, np.ndarray]) -> bytes:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, {"log": dict(truth)})
    return buffer.getvalue()


def _mat_objects(truth: dict[str, np.ndarray]) -> bytes:
    """Numbers beside a datetime, which MATLAB keeps as an object of a class."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    flags = element(6, struct.pack("<II", 17, 0))
    named = (element(1, word) for word in (b"stamp", b"MCOS", b"datetime"))
    opaque = element(14, flags + b"".join(named))
    return _mat(truth) + opaque


def _mesh_rover(urdf: bytes) -> dict[str, bytes]:
    """A rover of which one shape is a mesh beside it."""
    import trimesh

    text = urdf.decode()
    at = text.index("<cylinder")
    shape = text[at : text.index("/>", at) + 2]
    mesh = trimesh.creation.cylinder(radius=0.15, height=0.1, sections=12)
    changed = text.replace(shape, '<mesh filename="wheel.stl"/>', 1)
    return {"own.urdf": changed.encode(), "wheel.stl": mesh.export(file_type="stl")}


def _trace() -> bytes:
    """A second of a drive, with its attributes."""
    import pyarrow
    import pyarrow.parquet

    from rover_pin.scenarios.scenario import scenario

    trace = scenario("ditch", duration=1.0, rover="cart", **{"soil.k": 0.02}).drive()
    buffer = io.BytesIO()
    metadata = json.dumps({"units": dict(trace.units), "attrs": trace.attrs}, default=lambda value: value.tolist())
    table = pyarrow.table({name: np.asarray(values) for name, values in trace.channels.items()})
    pyarrow.parquet.write_table(table.replace_schema_metadata({b"rover_pin": metadata.encode()}), buffer)
    return buffer.getvalue()
