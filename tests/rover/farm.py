"""Rovers of one's own, made of a few numbers: URDF and TOML with each trait that real descriptions have."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_pin.base.files.toml_file import toml_text


def inertial(mass: float, size: float, at: str = "0 0 0") -> str:
    i = 0.1 * mass * size**2
    return (
        f'<inertial><origin xyz="{at}"/><mass value="{mass}"/>'
        f'<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>'
    )


@dataclass
class Farm:
    """A URDF that grows joint by joint; `link` adds a link with the joint that it hangs on."""

    base: str = "body"
    mass: float = 20.0
    centre: str = "0 0 0.2"
    parts: list[str] = field(default_factory=list)

    def link(self, name: str, parent: str, kind: str, xyz: str, axis: str = "0 1 0", **more: Any) -> Farm:
        mass, size, shape = more.get("mass", 0.5), more.get("size", 0.2), more.get("shape", "")
        body = inertial(mass, size) if mass else ""
        limit = '<limit lower="-0.8" upper="0.8" effort="9" velocity="9"/>' if kind in ("revolute", "prismatic") else ""
        turns = "" if kind == "fixed" else f'<axis xyz="{axis}"/>'
        self.parts.append(
            f'<link name="{name}_link">{body}{shape}</link><joint name="{name}" type="{kind}">'
            f'<parent link="{parent}"/><child link="{name}_link"/>'
            f'<origin xyz="{xyz}" rpy="{more.get("rpy", "0 0 0")}"/>'
            f"{turns}{more.get('limit', limit)}{more.get('inner', '')}</joint>"
        )
        return self

    def wheel(
        self, name: str, parent: str, xyz: str, axis: str = "0 1 0", r: float = 0.15, b: float = 0.1, **more: Any
    ) -> Farm:
        turn = more.pop("drawn", "1.5707963267948966 0 0")
        shape = (
            f'<collision><origin rpy="{turn}"/><geometry><cylinder radius="{r}" length="{b}"/></geometry></collision>'
        )
        return self.link(name, parent, more.pop("kind", "continuous"), xyz, axis, mass=1.0, size=r, shape=shape, **more)

    @property
    def urdf(self) -> str:
        return (
            f'<robot name="farm"><link name="{self.base}">{inertial(self.mass, 0.5, self.centre)}</link>'
            + "".join(self.parts)
            + "</robot>"
        )


def write(folder: Path, farm: Farm | str, table: dict[str, Any]) -> Path:
    """Write rover.urdf and rover.toml; return the TOML's path."""
    (folder / "rover.urdf").write_text(farm if isinstance(farm, str) else farm.urdf)
    path = folder / "rover.toml"
    path.write_text(toml_text({"name": "farm", "urdf": "rover.urdf", "base": "body", **table}))
    return path


SIZE = {"r": 0.15, "b": 0.1}
TWO_AXLES = {"wheels": {"front": ["fl", "fr"], "rear": ["rl", "rr"]}, "wheel": SIZE}
THREE_AXLES = {"wheels": {"front": ["fl", "fr"], "mid": ["ml", "mr"], "rear": ["rl", "rr"]}, "wheel": SIZE}
ROCKERS = {
    "suspension": {"rocker": ["rocker_l", "rocker_r"], "bogie": ["bogie_l", "bogie_r"]},
    "differential": {"pair": "rocker"},
}


def cart(**wheel: Any) -> Farm:
    """Four wheels on a rigid body."""
    farm = Farm()
    for name, x, y in (("fl", 0.4, 0.35), ("fr", 0.4, -0.35), ("rl", -0.4, 0.35), ("rr", -0.4, -0.35)):
        farm.wheel(name, "body", f"{x} {y} 0", **wheel)
    return farm


def rocker_bogie(**rocker_r: Any) -> Farm:
    """Six wheels on rockers and bogies; `rocker_r` changes the right rocker's joint."""
    farm = Farm(mass=40.0, centre="0.05 0 0.3")
    for side, y in (("l", 0.4), ("r", -0.4)):
        more = {"axis": "0 1 0"} | (rocker_r if side == "r" else {})
        axis = more.pop("axis")
        farm.link(f"rocker_{side}", "body", "revolute", f"0 {y} 0.3", axis, mass=2.0, size=0.5, **more)
        farm.link(f"bogie_{side}", f"rocker_{side}_link", "revolute", "-0.3 0 -0.15", mass=1.0)
        farm.wheel(f"f{side}", f"rocker_{side}_link", "0.5 0 -0.3")
        farm.wheel(f"m{side}", f"bogie_{side}_link", "0.25 0 -0.15").wheel(
            f"r{side}", f"bogie_{side}_link", "-0.25 0 -0.15"
        )
    return farm
