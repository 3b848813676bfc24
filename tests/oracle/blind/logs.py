"""A data set as a folder: drive.toml, its ground, one CSV a run."""

import json
import os
import shutil
from pathlib import Path

import numpy as np

from .campaign import BORDERS, X
from .sensors import KINDS, WHEELS

NOISE = {
    "wheel_rate": ("rad/s", "wheel_rate_"), "angle": ("rad", "rocker_"), "current": ("A", "current_"),
    "body_position": ("m", "body_"), "body_attitude": ("rad", "body_roll"), "body_velocity": ("m/s", "body_v"),
    "battery": ("V", "battery_V"),
}  # fmt: skip


def write_set(folder, plan, logged):
    """Write a set into a folder beside and move it into place, so that a set is there as a whole or not at all."""
    folder = Path(folder)
    beside = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    names = [f"ground-{i}.csv" for i in range(len(plan["heights"]))]
    for name, z in zip(names, plan["heights"], strict=True):
        write_csv(beside / name, {"x_m": plan.get("X", X), "z_m": z})
    for (name, _, _), channels in zip(plan["runs"], logged, strict=True):
        write_csv(beside / f"{name}.csv", channels)
    (beside / "drive.toml").write_text(about(folder.name, plan, names))
    os.replace(beside, folder)


def about(name, plan, grounds):
    """Return drive.toml; a plan may have points X and borders of its own, and say where it comes from."""
    sd = {start: size for start, size, _ in KINDS}
    source, borders = json.dumps(plan.get("source", "simulated")), json.dumps(list(plan.get("borders", BORDERS)))
    lines = [
        'kind = "drive-log"', f"name = {json.dumps(name)}", f"source = {source}", 'rover = "nexus6"',
        "gravity = 9.81", f"wheels = {json.dumps(list(WHEELS))}", "", "[terrain]",
        f"polylines = {json.dumps(grounds)}", f"borders = {borders}",
    ]  # fmt: skip
    for section in ("soil", "motor"):
        lines += ["", f"[{section}]"]
        lines += [f"{key} = {inline(table)}" for key, table in plan["declared"][section].items()]
    lines += ["", "[noise]"]
    lines += [f"{key} = {inline({'value': sd[start], 'unit': unit})}" for key, (unit, start) in NOISE.items()]
    lines += ['sample_period = { value = 0.05, unit = "s" }']
    for name, purpose, run in plan["runs"]:
        x, y, yaw = (float(each) for each in run.start)
        lines += ["", "[[run]]", f'file = "{name}.csv"', f"start = {inline({'x': x, 'y': y, 'yaw': yaw})}"]
        lines += [f"purpose = {json.dumps(purpose)}"]
    return "\n".join(lines) + "\n"


def inline(table):
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + " }"


def write_csv(path, channels):
    rows = np.column_stack(list(channels.values()))
    np.savetxt(path, rows, fmt="%.8g", delimiter=",", header=",".join(channels), comments="")
