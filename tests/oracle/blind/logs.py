"""Write a data set as a folder: drive.toml, its ground, and one CSV file for each run."""

import json
import os
import shutil
from pathlib import Path

import numpy as np

from .campaign import BORDERS, X
from .sensors import KINDS
from .vehicle import NEXUS6

NOISE = {
    "wheel_rate": ("rad/s", "wheel_rate_"), "angle": ("rad", "rocker_"), "current": ("A", "current_"),
    "body_position": ("m", "body_"), "body_attitude": ("rad", "body_roll"), "body_velocity": ("m/s", "body_v"),
    "battery": ("V", "battery_V"),
}  # fmt: skip


def write_set(folder, plan, logged, digits=8, sample_period=0.05):
    """Write a set into a temporary folder and move the folder to its place, so that a set is either complete or
    missing.
    """
    folder = Path(folder)
    beside = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    names = [f"ground-{i}.csv" for i in range(len(plan["heights"]))]
    for name, z in zip(names, plan["heights"], strict=True):
        write_csv(beside / name, {"x_m": plan.get("X", X), "z_m": z})
    for (name, _, _), channels in zip(plan["runs"], logged, strict=True):
        write_csv(beside / f"{name}.csv", channels, digits)
    vehicle = plan.get("vehicle", NEXUS6)
    if vehicle is not NEXUS6:
        (beside / f"{vehicle.name}.toml").write_text(vehicle.toml())
        (beside / f"{vehicle.name}.urdf").write_text(vehicle.urdf())
    (beside / "drive.toml").write_text(about(folder.name, plan, names, sample_period))
    os.replace(beside, folder)


def about(name, plan, grounds, sample_period):
    """Return the text of drive.toml. A plan may have its own points X and borders, and may state its origin."""
    sd = {start: size for start, size, _ in KINDS}
    source, borders = json.dumps(plan.get("source", "simulated")), json.dumps(list(plan.get("borders", BORDERS)))
    licence = [f"licence = {json.dumps(plan['licence'])}"] if "licence" in plan else []
    lines, vehicle = [f"# {line}" for line in plan.get("header", ())], plan.get("vehicle", NEXUS6)
    rover = ['rover = "nexus6"'] if vehicle is NEXUS6 else [f'rover = "{vehicle.name}.toml"', 'angles = "fixed"']
    lines += [
        'kind = "drive-log"', f"name = {json.dumps(name)}", f"source = {source}", *licence, *rover,
        f"gravity = {plan.get('gravity', 9.81)}", f"wheels = {json.dumps(list(vehicle.wheels))}", "", "[terrain]",
        f"polylines = {json.dumps(grounds)}", f"borders = {borders}",
    ]  # fmt: skip
    for section in plan["declared"]:
        lines += ["", f"[{section}]"]
        lines += [f"{key} = {inline(table)}" for key, table in plan["declared"][section].items()]
    lines += ["", "[noise]"]
    noise = {key: sd[start] for key, (_, start) in NOISE.items()} | plan.get("noise", {})
    lines += [f"{key} = {inline({'value': noise[key], 'unit': unit})}" for key, (unit, _) in NOISE.items()]
    lines += [f"sample_period = {inline({'value': sample_period, 'unit': 's'})}"]
    for name, purpose, run in plan["runs"]:
        x, y, yaw = (float(coordinate) for coordinate in run.start)
        lines += ["", "[[run]]", f'file = "{name}.csv"', f"start = {inline({'x': x, 'y': y, 'yaw': yaw})}"]
        lines += [f"purpose = {json.dumps(purpose)}"]
    return "\n".join(lines) + "\n"


def inline(table):
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + " }"


def write_csv(path, channels, digits=8):
    rows = np.column_stack(list(channels.values()))
    np.savetxt(path, rows, fmt=f"%.{digits}g", delimiter=",", header=",".join(channels), comments="")
