"""Rovers of the data sets: Nexus 6, a rover that is six times as heavy on larger wheels, and a cart with four wheels on
a rigid body.

The two others are scaled from Nexus 6: soil, motors and hidden effects are in proportion to the weight on a wheel, the
wheel radius and the mass. Sinkage, slip and current are therefore in proportion too, at the speed of Nexus 6.
"""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

URDF = Path(__file__).parents[3] / "urdf" / "nexus6.urdf"
WHEELS, STEERED = ("fl", "fr", "ml", "mr", "rl", "rr"), ("fl", "fr", "rl", "rr")
MASS, RADIUS, WIDTH = 5.8, 0.045, 0.05
LEAN = 1.5
"""Share of the duty that a rad of gentle steering becomes between the sides of a rover that does not steer."""
PARTS = {"PivotFriction", "DifferentialCompliance"}
"""Effects in a suspension."""
SIZED = {
    "GearFriction.tau_c": "torque", "ViscousFriction.b_v": "viscous", "StribeckFriction.tau_s": "torque",
    "EccentricWheel.A": "torque", "LooseWheel.hold": "torque", "TorqueSaturation.i_max": "current",
    "SupplySag.R_b": "ohm", "SquareSag.R_2": "ohm/A", "WindingHeating.R_th": "K/W",
    "PivotFriction.tau_c": "joint", "PivotFriction.b": "joint", "DifferentialCompliance.compliance": "soft",
    "TetherDrag.f_0": "mass", "TetherDrag.f_1": "mass", "SpringTether.k": "mass", "Snag.force": "mass",
    "PointMass.m": "mass", "PointMass.shift_x": "length", "PointMass.shift_z": "length",
    "Grousers.h_s": "length", "DiggingMemory.length": "length",
}  # fmt: skip
"""Hidden numbers with a size, and what they are in proportion to; slips, angles, shares and times stay."""


@dataclass(frozen=True)
class Vehicle:
    """A rover, with its numbers divided by those of Nexus 6."""

    name: str
    wheels: tuple
    axles: tuple
    "of each wheel, from the front"
    steered: tuple
    angles: tuple
    "joints of the suspension"
    taken: tuple
    "which of six wheels' numbers are its wheels'"
    length: float = 1.0
    "wheel radius"
    width: float = 1.0
    load: float = 1.0
    "weight on a wheel"
    mass: float = 1.0

    @property
    def beside(self):
        """Number of pieces of ground on each side of a wheel that are examined, see `ground.BESIDE`."""
        return int(np.ceil(2.0 * self.length))

    def ratio(self, kind):
        """Return a quantity divided by that of Nexus 6. Motors have equal voltage and torque constant, and the current
        scales with the `load`.
        """
        return {
            "mass": self.mass, "length": self.length, "torque": self.load * self.length,
            "viscous": self.load * self.length**2, "joint": self.mass * self.length,
            "soft": 1.0 / (self.mass * self.length), "current": self.load, "ohm": 1.0 / self.load,
            "ohm/A": 1.0 / self.load**2, "K/W": 1.0 / self.load, "Pa": self.load / self.length**2,
            "inertia": self.load * self.length**2,
        }[kind]  # fmt: skip

    def has(self, effect, numbers):
        """Return whether the rover has the part in which an effect acts: a suspension, this wheel, this channel."""
        wheel, channel = numbers.get("wheel"), numbers.get("channel", "")
        is_known = wheel in (None, "", *self.wheels, *self.taken)
        return is_known and (bool(self.angles) or not (effect in PARTS or channel.startswith(("rocker_", "bogie_"))))

    def sized(self, effect, numbers):
        """Return the numbers of an effect in proportion to the rover, and its wheels by the rover's own numbering."""
        sized_numbers = {}
        for key, value in numbers.items():
            kind = SIZED.get(f"{effect}.{key}")
            value = value if kind is None else value * self.ratio(kind)
            sized_numbers[key] = self.taken.index(value) if key == "wheel" and not isinstance(value, str) else value
        return sized_numbers

    def base(self, plain):
        """Return the numbers of a run that differ from Nexus 6: wheels, inertia of motors, servos, stops, contact."""
        if self is NEXUS6:
            return {}
        kinds = {
            "r": "length", "relaxation": "length", "armature": "inertia",
            "c": "Pa", "servo_stiffness": "joint", "servo_damping": "joint", "stop_stiffness": "joint",
            "stop_damping": "joint",
        }  # fmt: skip
        return {"b": plain["b"] * self.width} | {name: plain[name] * self.ratio(kind) for name, kind in kinds.items()}

    def commands(self, duty, steer):
        """Return duties and steering [rows, wheels]. Without steering, the two sides have different duties."""
        if self.steered:
            return duty, steer
        side = np.array([1.0 if name.endswith("r") else -1.0 for name in self.wheels])
        turning = duty[:, list(self.taken)] * (1.0 + LEAN * steer[:, :1] * side)
        return np.clip(turning, -1.0, 1.0), np.zeros((len(duty), 0))

    def urdf(self):
        """Return the rover's URDF."""
        return {"nexus6": URDF.read_text, "heavy": heavy, "cart": cart}[self.name]()

    def toml(self):
        """Return the file that states the role of each joint."""
        lines = [f'name = "{self.name}"', f'urdf = "{self.name}.urdf"', 'base = "base_link"', "", "[wheels]"]
        names = ("front", "middle", "rear") if self.angles else ("front", "rear")
        lines += [f'{axle} = ["wheel_{axle[0]}l", "wheel_{axle[0]}r"]' for axle in names]
        lines += ["", "[wheel]"]
        size = {"r": RADIUS * self.length, "b": WIDTH * self.width}
        lines += [f'{key} = {{ value = {value:.6g}, unit = "m" }}' for key, value in size.items()]
        if self.angles:
            lines += ["", "[steering]", 'front = ["steer_fl", "steer_fr"]', 'rear = ["steer_rl", "steer_rr"]']
            lines += ["", "[suspension]", 'rocker = ["rocker_l", "rocker_r"]', 'bogie = ["bogie_l", "bogie_r"]']
            lines += ["", "[differential]", 'pair = "rocker"']
        return "\n".join(lines) + "\n"


JOINTS = ("rocker_l", "rocker_r", "bogie_l", "bogie_r")
NEXUS6 = Vehicle("nexus6", WHEELS, (0, 0, 1, 1, 2, 2), STEERED, JOINTS, (0, 1, 2, 3, 4, 5))
HEAVY = Vehicle(
    "heavy", WHEELS, (0, 0, 1, 1, 2, 2), STEERED, JOINTS, (0, 1, 2, 3, 4, 5), length=1.5, width=1.5, load=6.0, mass=6.0
)
"""2.9 kg x 7 + 2.9 kg x 5 = 34.8 kg."""
CART_MASS, CART_WHEEL = 8.0, 0.5
CART = Vehicle(
    "cart", ("fl", "fr", "rl", "rr"), (0, 0, 1, 1), (), (), (0, 1, 4, 5), length=4.0 / 3.0, width=1.2,
    load=(CART_MASS + 4 * CART_WHEEL) / 4 / (MASS / 6), mass=(CART_MASS + 4 * CART_WHEEL) / MASS,
)  # fmt: skip
"""Wheels of 60 mm radius and width, 0.32 m apart along and 0.30 m across."""
KNOWN = {entry.name: entry for entry in (NEXUS6, HEAVY, CART)}


def heavy():
    """Return Nexus 6's URDF with all lengths times 1.5, the mass of the hull times 7, and all other masses times 5."""
    root, L = ElementTree.parse(URDF).getroot(), HEAVY.length
    root.set("name", "heavy")
    for link in root.findall("link"):
        M = 7.0 if link.get("name") == "base_link" else 5.0
        for shape_element in link.findall("visual") + link.findall("collision"):
            link.remove(shape_element)
        scale(link.find("inertial/mass"), ("value",), M)
        scale(link.find("inertial/inertia"), ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), M * L**2)
    for at in root.iter("origin"):
        at.set("xyz", " ".join(f"{L * float(word):.9g}" for word in at.get("xyz").split()))
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def scale(element, names, factor):
    for name in names:
        element.set(name, f"{factor * float(element.get(name)):.9g}")


def cart():
    """Return the URDF of the cart: a box, whose centre is slightly behind and above the axles, and four wheels."""
    r, b = RADIUS * CART.length, WIDTH * CART.width
    links = [link("base_link", CART_MASS, box(CART_MASS, 0.36, 0.2, 0.1), "-0.02 0 0.06")]
    disc = (CART_WHEEL * (3 * r**2 + b**2) / 12, CART_WHEEL * r**2 / 2, CART_WHEEL * (3 * r**2 + b**2) / 12)
    for name in CART.wheels:
        x, y = 0.16 if name[0] == "f" else -0.16, 0.15 if name[1] == "l" else -0.15
        links += [
            f'<joint name="wheel_{name}" type="continuous"><parent link="base_link"/><child link="wheel_{name}_link"/>'
            f'<origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>',
            link(f"wheel_{name}_link", CART_WHEEL, disc, "0 0 0"),
        ]
    return "\n".join(('<robot name="cart">', *links, "</robot>")) + "\n"


def box(mass, x, y, z):
    return mass * (y**2 + z**2) / 12, mass * (x**2 + z**2) / 12, mass * (x**2 + y**2) / 12


def link(name, mass, inertia, place):
    ixx, iyy, izz = (f"{moment:.9g}" for moment in inertia)
    return (
        f'<link name="{name}"><inertial><origin xyz="{place}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
    )
