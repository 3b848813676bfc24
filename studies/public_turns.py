"""How public skid-steered rovers turn: the wheel speeds that a turn needs, and the turn that results.

Question
    Do rovers without steering turn in the commanded direction and at about the commanded rate, on sand and on hard
    ground?
Method
    Three rovers have the numbers of their makers' descriptions (sizes, masses, centre of the body, wheels), without
    suspension and meshes. They drive `turn` at the scene's radius to both sides, and `point-turn`, on a sand that is as
    firm for each rover as slope-sand is for Nexus 6, and on hard ground. Yaw rate and radius are measured over the
    second half of 20 s. The effective track over B is compared with the multiplier of the maker's own controller.
Result
    studies/results/public_turns.csv. All rovers turn in the commanded direction. A Jackal and a Leo turn at a radius of
    2 m at 0.96 to 1.02 of the commanded yaw rate, and on the spot at 0.80 to 0.83, because shear builds up along the
    path, while the balance behind the effective track assumes full shear. A Husky's description has its centre of mass
    85 mm to the right of the middle. The Husky turns left at 1.04 to 1.08, right at 0.59 on sand and 0.41 on hard
    ground, about which the drive warns, and on the spot at 0.70. The effective track is 0.96 to 0.99 of the value in
    the makers' controllers.
What the paper says
    The paper's rover steers, so it has no skid-steered turn.
What differs
    Motors are sized by the weight, and tyres are rigid. No turn of a real rover was measured here.

Run: python studies/public_turns.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.plot import COLOURS, new_figure, save, write_csv
from rover_pin.rover.rover import load_rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.scenarios.scenario import scenario


class Maker(NamedTuple):
    """Numbers of a public rover from its maker's description [m, kg], and the factor by which the maker's controller
    multiplies the track to compute wheel speeds.
    """

    length: float
    track: float
    r: float
    b: float
    body: float
    wheel: float
    centre: tuple[float, float, float]
    multiplier: float


ROVERS = {
    "Husky A200": Maker(0.512, 0.5708, 0.1651, 0.1143, 46.034, 2.637, (-0.00065, -0.085, 0.062), 1.875),
    "Jackal J100": Maker(0.262, 0.37559, 0.098, 0.040, 16.523, 0.477, (0.012, 0.002, 0.067), 1.5),
    "Leo": Maker(0.3052, 0.358, 0.0625, 0.07, 4.36, 0.2836, (0.0, 0.0, 0.05), 1.76),
}
"""Name of a rover -> its dimensions, mass and track factor. Sources: the makers' public packages husky_description,
husky_control, jackal_description, jackal_control, leo_description and leo_firmware."""
WHEELS = {"fl": (0.5, 0.5), "fr": (0.5, -0.5), "rl": (-0.5, 0.5), "rr": (-0.5, -0.5)}
GROUNDS: dict[str, dict[str, Any]] = {"sand": {}, "hard": {"patch.x_from": -100.0, "patch.x_to": 100.0}}
TURNS: dict[str, tuple[str, dict[str, Any]]] = {
    "turn left": ("turn", {"control.radius": 2.0}),
    "turn right": ("turn", {"control.radius": -2.0}),
    "on the spot": ("point-turn", {}),
}


def main() -> None:
    """Drive every turn, print and write the table, and draw driven over commanded yaw rates."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one rover, 2 s: shows that it runs")
    parser.add_argument("--out", type=Path, default=Path("out/public_turns"))
    options = parser.parse_args()
    names, seconds = (["Jackal J100"], 2.0) if options.quick else (list(ROVERS), 20.0)
    # The rovers are written to files, because scenarios read rovers from files.
    with tempfile.TemporaryDirectory() as folder:
        table = pd.DataFrame(
            [
                row
                for name in names
                for ground in GROUNDS
                for turn in TURNS
                for row in [driven(name, written(Path(folder) / name.split()[0], ROVERS[name]), turn, ground, seconds)]
            ]
        )
    options.out.mkdir(parents=True, exist_ok=True)
    write_csv(table, options.out / "public_turns.csv")
    print(table.round(3).to_string(index=False))
    figure(table, options.out)


def written(folder: Path, maker: Maker) -> Path:
    """Write the rover as boxes and wheels; return the path of its TOML file."""
    folder.mkdir(exist_ok=True)
    links, joints = [link("body", maker.body, maker.length, maker.centre)], []
    # Every wheel turns about its own continuous joint; the rovers have no suspension here.
    for name, (x, y) in WHEELS.items():
        links.append(link(f"{name}_link", maker.wheel, maker.r))
        joints.append(
            f'<joint name="{name}" type="continuous"><parent link="body"/><child link="{name}_link"/>'
            f'<origin xyz="{x * maker.length} {y * maker.track} 0"/><axis xyz="0 1 0"/></joint>'
        )
    (folder / "rover.urdf").write_text(f'<robot name="rover">{"".join(links + joints)}</robot>', encoding="utf-8")
    toml = folder / "rover.toml"
    toml.write_text(
        'name = "rover"\nurdf = "rover.urdf"\nbase = "body"\n[wheels]\nfront = ["fl", "fr"]\nrear = ["rl", "rr"]\n'
        f"[wheel]\nr = {maker.r}\nb = {maker.b}\n",
        encoding="utf-8",
    )
    return toml


def link(name: str, mass: float, size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    """Return the URDF text of a link with the inertia of a cube of this size."""
    inertia = mass * size**2 / 6.0
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre[0]} {centre[1]} {centre[2]}"/><mass value="{mass}"/>'
        f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def driven(name: str, toml: Path, turn: str, ground: str, seconds: float) -> dict[str, Any]:
    """Return the commanded turn, and the turn that the rover drove, measured over the second half of the drive."""
    (scene, settings), maker = TURNS[turn], ROVERS[name]
    turning_scene = scenario(scene, rover=toml, duration=seconds, **settings, **GROUNDS[ground])
    trace, commanded = turning_scene.drive(), turning_scene.controller.motion
    late = trace.t >= 0.5 * trace.t[-1]
    # A straight line through the yaw angle gives its rate without noise from single samples.
    rate = float(np.polyfit(trace.t[late], np.unwrap(trace["body_yaw"][late]), 1)[0])
    speed = float(np.mean(np.hypot(trace["body_vx"], trace["body_vy"])[late]))
    return {
        "rover": name,
        "track_over_B": effective_track(load_rover(toml)) / maker.track,
        "makers": maker.multiplier,
        "turn": turn,
        "ground": ground,
        "commanded_deg_s": math.degrees(commanded.yaw_rate),
        "driven_deg_s": math.degrees(rate),
        "commanded_radius_m": commanded.speed / commanded.yaw_rate,
        "driven_radius_m": math.copysign(speed / max(abs(rate), 1e-9), rate) if commanded.speed else 0.0,
        "sunk_mm": 1e3 * float(np.max(trace.stack("sinkage")[late])),
        "warnings": len(trace.attrs["warnings"]),
    }


def figure(table: pd.DataFrame, out: Path) -> None:
    """Draw the yaw rate that each rover reached against the commanded yaw rate."""
    sheet, axes = new_figure(1, size=(7.0, 3.2))
    labels = [f"{row.rover}, {row.turn}" for row in table[table["ground"] == "sand"].itertuples()]
    for shift, (ground, rows) in zip((-0.18, 0.18), table.groupby("ground", sort=False), strict=False):
        at = np.arange(len(rows)) + shift
        axes.barh(at, rows["driven_deg_s"] / rows["commanded_deg_s"], 0.34, label=ground, color=COLOURS[int(shift > 0)])
    # A ratio of 1 is a turn at the commanded rate.
    axes.axvline(1.0, color="0.4", lw=0.8)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.invert_yaxis()
    axes.set(xlabel="yaw rate driven over commanded, later half of 20 s, n = 1 drive each")
    axes.legend(fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    save(sheet, out / "public_turns.png")


if __name__ == "__main__":
    main()
