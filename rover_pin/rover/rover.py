"""The rigid rover: Pinocchio's tree, the wheels by name, the differential, and the mirror symmetry."""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, UrdfError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.public import brief, public
from rover_pin.base.trust import Trust
from rover_pin.contact import Wheel
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.description.faults import refuse_faults
from rover_pin.rover.description.layout import Layout, layout_texts, read_layout, shipped_toml
from rover_pin.rover.description.motor_sheet import MotorSheet
from rover_pin.rover.description.readers import free_tree
from rover_pin.rover.description.tree import read_tree
from rover_pin.rover.parts import Coupling, Differential, WheelMount
from rover_pin.rover.symmetry import Mirror, is_symmetric, mirror


@brief
@dataclass(frozen=True, eq=False)
class Rover:
    """The rigid body half of Eq (8); q = (position, quaternion x y z w, joints), v = (base in body axes, joints).

    Frozen, but Pinocchio's `model` is not: change a copy (`under`, or `replace(model=rover.model.copy())`).
    """

    name: str
    model: pin.Model
    wheels: tuple[WheelMount, ...]
    "from front to rear, left before right"
    differential: Differential | None
    angles: Mapping[str, int]
    "place in q of each suspension and steering angle: rocker_l, ..., steer_fl, ..."
    mirror: Mirror
    urdf: str
    "the text of the URDF, for viewers"
    couplings: tuple[Coupling, ...] = ()
    "joints of the suspension, or wheels, that follow others rigidly, the differential apart"
    springs: tuple[SpringDamper, ...] = ()
    "of its suspension, as its TOML states them"
    motor: MotorSheet | str | None = None
    "of its wheels, as its TOML states it, or the name of one of `model.motors`"
    soil: Mapping[str, Any] = field(default_factory=dict)
    "[soil] of its TOML: the ground to drive on where nothing else is said"

    @property
    def wheel(self) -> Wheel:
        """The size of the wheels.

        Raises ParameterError: its axles have wheels of different sizes.
        """
        dimensions = dict.fromkeys((float(mount.wheel.r), float(mount.wheel.b)) for mount in self.wheels)
        if len(dimensions) > 1:
            listing = ", ".join(f"{1e3 * r:g} x {1e3 * b:g} mm" for r, b in dimensions)
            raise ParameterError(
                f"Rover '{self.name}' has wheels of several sizes (r x b: {listing}), and this is done for one: take a "
                "rover of equal wheels; drive, bounds and check-urdf take any."
            )
        return self.wheels[0].wheel

    @property
    def radii(self) -> np.ndarray:
        """The radius of each wheel [n] (m)."""
        return np.array([float(mount.wheel.r) for mount in self.wheels])

    @property
    def free_dofs(self) -> list[int]:
        """The places in v of the base and of the suspension, which no motor holds."""
        driven = {mount.dof for mount in self.wheels} | {mount.steer_dof for mount in self.wheels}
        return [dof for dof in range(self.model.nv) if dof not in driven]

    @property
    def gravity(self) -> float:
        """Gravity [m/s^2], downwards."""
        return float(self.up @ -self.model.gravity.linear)

    @property
    def up(self) -> np.ndarray:
        """Unit vector against gravity in the world [3], z unless the rover is `rising`."""
        linear = np.array(self.model.gravity.linear)
        if not np.any(linear[:2]):
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(math.copysign(1.0, -linear[2]) * -linear / np.linalg.norm(linear))

    @cached_property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(sum(body.mass for body in self.model.inertias))

    @property
    def symmetric(self) -> bool:
        """Whether the left side weighs the same in the same places as the right."""
        return is_symmetric(self.model, self.mirror)

    def under(self, gravity: float) -> Self:
        """Return this rover under another gravity [m/s^2]; its own model stays as it is."""
        if not np.isfinite(gravity):
            raise ParameterError(f"gravity = {gravity} m/s^2 is not a number; Earth has 9.81, the Moon 1.62.")
        model = self.model.copy()
        model.gravity.linear = 0.0 - float(gravity) * self.up
        return dataclasses.replace(self, model=model)

    def rising(self, rise_x: float, rise_y: float) -> Self:
        """Return this rover in a world whose horizontal rises by `rise_x` [rad] towards +x, `rise_y` towards +y.

        Gravity is -g (sin rise_x, sin rise_y, sqrt(1 - sin^2 rise_x - sin^2 rise_y)).
        """
        x, y = math.sin(rise_x), math.sin(rise_y)
        if not (abs(rise_x) < math.pi / 2 and abs(rise_y) < math.pi / 2 and x * x + y * y < 1.0):
            raise ParameterError(
                f"A rise of {math.degrees(rise_x):g} and {math.degrees(rise_y):g} deg leaves no upper side: "
                "give angles well below 90 deg."
            )
        model = self.model.copy()
        model.gravity.linear = -self.gravity * np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
        return dataclasses.replace(self, model=model)

    def carrying(self, mass: float, shift_x: float = 0.0, shift_z: float = 0.0) -> Self:
        """Return this rover with its base heavier by `mass` and its centre of mass shifted, at zero joint angles.

        The mass is a point at the rover's centre of mass, so that alone it does not move that. Then the base's own
        centre of mass is moved so that the rover's moves by the shift; the base's inertia about its own centre stays.

        Parameters
        ----------
        mass : float
            kg, negative where the base is lighter than its URDF says.
        shift_x, shift_z : float
            Shift of the whole rover's centre of mass in the base's axes [m].

        Raises
        ------
        ParameterError
            The base would be left without mass or with an inertia that no body has.
        """
        model, data = self.model.copy(), self.model.createData()
        centre = pin.centerOfMass(self.model, data, pin.neutral(self.model))
        base = model.inertias[1]
        heavy = base.mass + float(mass)
        if not heavy > 0.0:
            raise ParameterError(
                f"mass = {mass:g} kg is not allowed: the base of rover '{self.name}' has {base.mass:g} kg."
            )
        from_base, from_old = centre - base.lever, float(mass) / heavy * (centre - base.lever)
        spread = base.mass * float(mass) / heavy
        inertia = base.inertia + spread * (from_base @ from_base * np.eye(3) - np.outer(from_base, from_base))
        axes = np.linalg.eigvalsh(inertia)
        if not (axes[0] > 0.0 and axes[0] + axes[1] > axes[2]):
            raise ParameterError(f"mass = {mass:g} kg is not allowed: it leaves the base an inertia that no body has.")
        shift = (self.mass + float(mass)) / heavy * np.array([shift_x, 0.0, shift_z])
        model.inertias[1] = pin.Inertia(heavy, base.lever + from_old + shift, inertia)
        return dataclasses.replace(self, model=model)

    def mount(self, name: str) -> WheelMount:
        """Return the wheel of this name."""
        mounts = {mount.name: mount for mount in self.wheels}
        if name not in mounts:
            raise ParameterError(f"Rover '{self.name}' has no wheel '{name}': {closest(name, mounts)}")
        return mounts[name]


@public
def load_rover(rover: str | Path = "nexus6", trust: Trust = Trust()) -> Rover:
    """Return a rover that comes with the package, by name, or your own, by the path of its TOML.

    Its URDF lies in the TOML's folder, unless `trust` allows more; meshes are never read.

    Parameters
    ----------
    rover : str or path
        A name of `rover-pin list rovers`, or the path of a TOML.
    trust : Trust
        Which files that the TOML names may lie elsewhere, or run.

    Returns
    -------
    Rover
        Wheels, joints and Pinocchio's model, a separate copy.

    Raises
    ------
    UrdfError
        The TOML or its URDF does not make a rover; the sentence says what to mend.

    Examples
    --------
    >>> rover = load_rover("nexus6")
    >>> [wheel.name for wheel in rover.wheels], round(rover.mass, 2)
    (['fl', 'fr', 'ml', 'mr', 'rl', 'rr'], 5.8)
    """
    path = Path(rover)
    if path.suffix == "":
        path, trust = shipped_toml(str(rover)), Trust(everything=True)
    cached = _cached_rover(path, layout_texts(path, trust), trust)
    return dataclasses.replace(cached, model=cached.model.copy())


@lru_cache(maxsize=16)
def _cached_rover(path: Path, texts: tuple[str, ...], trust: Trust) -> Rover:
    """Return the rover of a TOML; the `texts` of its files say whether it is the one loaded before."""
    layout = read_layout(path, trust)
    refuse_faults(layout)
    return assemble(layout)


def load_named(rover: str, file: Path, trust: Trust = Trust()) -> Rover:
    """Return the rover that a model's or a drive log's `file` names: one of the package's, or a TOML seen from there.

    Sets share rovers, so the TOML may lie elsewhere; a refusal of such a one says nothing of its content.

    Raises UrdfError: it does not make a rover.
    """
    beside = file.parent / rover
    path = beside if is_file(beside) else Path(rover)
    elsewhere = path.suffix != "" and not path.resolve().is_relative_to(file.parent.resolve())
    try:
        if not elsewhere or path.suffix == ".toml":
            return load_rover(path, trust)
    except UrdfError as error:
        if not elsewhere:
            raise UrdfError(f"{file}: {error}") from error
    raise UrdfError(f"{file}: rover = {rover!r} lies elsewhere and makes no rover: try `rover-pin check-urdf` on it.")


def assemble(layout: Layout) -> Rover:
    """Return the rover of a layout whose URDF has been checked."""
    model = free_tree(layout.text)
    angles = {name: _angle(model, joint) for name, joint in layout.angles.items()}
    return Rover(
        name=layout.name,
        model=model,
        wheels=tuple(_mounts(model, layout)),
        differential=_differential(model, layout),
        angles=angles,
        mirror=mirror(model, layout.pairs),
        urdf=layout.text,
        couplings=tuple(_couplings(model, layout)),
        springs=layout.springs,
        motor=layout.motor,
        soil=layout.soil,
    )


def _mounts(model: pin.Model, layout: Layout) -> list[WheelMount]:
    mounts = []
    for number, axle in enumerate(layout.axles):
        for side, joint, steer in zip("lr", axle.wheels, axle.steering, strict=True):
            at = model.getJointId(joint)
            mounts.append(
                WheelMount(
                    name=axle.name[0] + side,
                    joint=at,
                    dof=model.joints[at].idx_v,
                    steer_dof=None if steer is None else _dof(model, steer),
                    side=side,
                    axle=number,
                    wheel=axle.wheel,
                )
            )
    return mounts


def _differential(model: pin.Model, layout: Layout) -> Differential | None:
    if layout.differential is None:
        return None
    left, right = layout.differential
    return Differential(_dof(model, left), _dof(model, right), _angle(model, left), _angle(model, right))


def _couplings(model: pin.Model, layout: Layout) -> Iterator[Coupling]:
    """Yield what the URDF's <mimic> joins and the differential does not."""
    for name, mimic in read_tree(layout.text, layout.file).followers(layout.differential):
        wheel = name in layout.wheel_joints
        angles = [None if wheel else _angle(model, joint) for joint in (name, mimic.joint)]
        yield Coupling(_dof(model, name), _dof(model, mimic.joint), mimic.multiplier, *angles)


def _dof(model: pin.Model, joint: str) -> int:
    return int(model.joints[model.getJointId(joint)].idx_v)


def _angle(model: pin.Model, joint: str) -> int:
    return int(model.joints[model.getJointId(joint)].idx_q)
