"""The rigid rover: Pinocchio's model, the wheels by name, the differential, coupled joints, and the mirror symmetry.

Start at `load_rover`, which reads a rover from its files.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, UrdfError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.public import brief, public
from rover_pin.base.trust import Trust
from rover_pin.contact import Wheel
from rover_pin.effects.spring_damper import SpringDamper
from rover_pin.rover.description.cross_check import axes_at_zero, free_tree
from rover_pin.rover.description.faults import refuse_faults
from rover_pin.rover.description.layout import Layout, MotorSheet, layout_texts, read_layout, shipped_toml
from rover_pin.rover.description.tree import read_tree

SYMMETRY_TOLERANCE = 1e-6
"""Largest difference between the mass matrix of a mirror-symmetric rover and its mirror image, as a fraction of the
largest entry. With a larger difference, the rover counts as asymmetric. Numbers in a URDF are often rounded to six
digits, so smaller differences are round-off."""


@dataclass(frozen=True)
class WheelMount:
    """A wheel of the rover: its name, its size, and its indices in Pinocchio's model."""

    name: str
    """first letter of the axle and of the side, for example fl for front left"""
    joint: int
    "index of the joint in Pinocchio's model"
    dof: int
    "index of the wheel's rate in v"
    steer_dof: int | None
    "index of the steering rate in v; None if the wheel is not steered"
    side: str
    """side of the rover: 'l' (left) or 'r' (right)"""
    axle: int
    "number of the axle; 0 is the front axle"
    wheel: Wheel
    """radius and width of the wheel"""


class Differential(NamedTuple):
    """The two rockers that a differential joins. They turn by opposite angles: theta_s1 = -theta_s2."""

    left: int
    "index of the left rocker's rate in v; v[left] + v[right] = 0"
    right: int
    "index of the right rocker's rate in v"
    q_left: int
    "index of the left rocker's angle in q"
    q_right: int
    "index of the right rocker's angle in q"


class Coupling(NamedTuple):
    """A joint that follows another joint, as in a parallel link: v[follower] = ratio v[leader].

    The angles in q have the same ratio. Wheels that are tied together have one common rate but different angles, so
    that their `q_follower` and `q_leader` are None.
    """

    follower: int
    "index of the following joint's rate in v"
    leader: int
    "index of the leading joint's rate in v"
    ratio: float
    q_follower: int | None
    "index of the following joint's angle in q; None for wheels"
    q_leader: int | None
    "index of the leading joint's angle in q; None for wheels"


class Mirror(NamedTuple):
    """The mirror image of a velocity v in the x-z plane of the base: v_mirrored = sign * v[perm], both arrays [nv]."""

    perm: np.ndarray
    sign: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class Rover:
    """A rover as a rigid multibody system in Pinocchio, with its wheels, its suspension and its symmetry.

    Its state in Eq (8) of the paper (equation of motion) is the configuration q [nq] = (position of the base,
    quaternion x y z w, joint angles) and the velocity v [nv] = (velocity of the base in body axes, joint rates).

    The object is frozen, but Pinocchio's `model` in it is not. To change the model, change a copy: use `under`,
    `rising` or `carrying`, or `dataclasses.replace(rover, model=rover.model.copy())`.

    Examples
    --------
    >>> rover = load_rover("cart")
    >>> [wheel.name for wheel in rover.wheels], rover.symmetric
    (['fl', 'fr', 'bl', 'br'], True)
    >>> round(rover.under(1.62).gravity, 2), round(rover.carrying(2.0).mass, 1)
    (1.62, 22.0)
    """

    name: str
    model: pin.Model
    wheels: tuple[WheelMount, ...]
    """wheels in the order from front to rear, left before right"""
    differential: Differential | None
    angles: Mapping[str, int]
    """name of a suspension or steering angle (rocker_l, ..., steer_fl, ...) -> index of this angle in q"""
    mirror: Mirror
    """permutation and signs that mirror a velocity at the x-z plane of the base"""
    urdf: str
    "text of the URDF, for viewers"
    couplings: tuple[Coupling, ...] = ()
    """joints that follow other joints rigidly; the rockers of the differential are not among them"""
    springs: tuple[SpringDamper, ...] = ()
    "springs of the suspension that the TOML states"
    motor: MotorSheet | str | None = None
    "data sheet of the wheels' motors, or the name of a motor of the package; None if the TOML states no motor"
    soil: Mapping[str, Any] = field(default_factory=dict)
    """table [soil] of the TOML, for drives without another soil from the user"""

    @property
    def wheel(self) -> Wheel:
        """Return the size of the wheels, for calculations that need one size for all wheels.

        Raises ParameterError: the wheels of the rover have different sizes.
        """
        dimensions = dict.fromkeys((float(mount.wheel.r), float(mount.wheel.b)) for mount in self.wheels)
        if len(dimensions) > 1:
            listing = ", ".join(f"{1e3 * r:g} x {1e3 * b:g} mm" for r, b in dimensions)
            raise ParameterError(
                f"Rover '{self.name}' has wheels of several sizes (r x b: {listing}), but this calculation needs one "
                "size. Use a rover with equal wheels; drive, bounds and check-urdf take any rover."
            )
        return self.wheels[0].wheel

    @property
    def radii(self) -> np.ndarray:
        """Return the radius of each wheel [n] (m)."""
        return np.array([float(mount.wheel.r) for mount in self.wheels])

    @property
    def free_dofs(self) -> list[int]:
        """Return the indices in v of the degrees of freedom without a motor: the base and the suspension."""
        driven = {mount.dof for mount in self.wheels} | {mount.steer_dof for mount in self.wheels}
        return [dof for dof in range(self.model.nv) if dof not in driven]

    @property
    def gravity(self) -> float:
        """Return the gravity [m/s^2], positive downwards."""
        return float(self.up @ -self.model.gravity.linear)

    @property
    def up(self) -> np.ndarray:
        """Return the upward unit vector in the world [3], which is opposite to gravity.

        The vector is the z axis, unless gravity was tilted by `rising`.
        """
        linear = np.array(self.model.gravity.linear)
        if not np.any(linear[:2]):
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(math.copysign(1.0, -linear[2]) * -linear / np.linalg.norm(linear))

    @cached_property
    def mass(self) -> float:
        """Return the total mass [kg]."""
        return float(sum(body.mass for body in self.model.inertias))

    @property
    def symmetric(self) -> bool:
        """Return whether the masses and positions of the left side are the mirror image of the right side."""
        return is_symmetric(self.model, self.mirror)

    def joints_of_side(self, side: str) -> list[int]:
        """Return the indices of the joints that carry the wheels of a side ("l" or "r"), in the order of Pinocchio's
        model.

        The wheels' own joints are included. The world and the free flyer of the base are not included.
        """
        wheels = [wheel.joint for wheel in self.wheels if wheel.side == side]
        return sorted({joint for wheel in wheels for joint in self.model.supports[wheel]} - {0, 1})

    def under(self, gravity: float) -> Self:
        """Return a copy of this rover under another gravity [m/s^2].

        Raises ParameterError: the gravity is not finite.
        """
        if not np.isfinite(gravity):
            raise ParameterError(
                f"gravity = {gravity} m/s^2 is not allowed: give a finite number, such as 9.81 (Earth)."
            )
        model = self.model.copy()
        model.gravity.linear = 0.0 - float(gravity) * self.up
        return dataclasses.replace(self, model=model)

    def rising(self, rise_x: float, rise_y: float) -> Self:
        """Return a copy of this rover in a world whose ground is inclined and rises towards +x and +y.

        The x-y plane of the world is the plane of the ground, so that gravity is tilted instead of the ground. The
        gravity of the copy is -g (sin rise_x, sin rise_y, sqrt(1 - sin^2 rise_x - sin^2 rise_y)), where g is the
        magnitude of gravity.

        Parameters
        ----------
        rise_x, rise_y : float
            Slope of the ground towards +x and +y [rad].

        Raises
        ------
        ParameterError
            The two slopes together leave no upward direction.
        """
        # The sines of the two slopes are the horizontal components of the upward unit vector.
        x, y = math.sin(rise_x), math.sin(rise_y)
        if not (abs(rise_x) < math.pi / 2 and abs(rise_y) < math.pi / 2 and x * x + y * y < 1.0):
            raise ParameterError(
                f"The ground cannot rise by {math.degrees(rise_x):g} deg towards +x and {math.degrees(rise_y):g} deg "
                "towards +y, because no plane is so steep in both directions: give angles well below 90 deg."
            )
        model = self.model.copy()
        model.gravity.linear = -self.gravity * np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
        return dataclasses.replace(self, model=model)

    def carrying(self, mass: float, shift_x: float = 0.0, shift_z: float = 0.0) -> Self:
        """Return a copy of this rover with a payload on its base and with a shifted centre of mass.

        Positions hold for zero joint angles. The payload is a point mass at the rover's centre of mass, so that the
        payload alone does not move this centre. Then the base's own centre of mass is moved such that the rover's
        centre of mass moves by the shift. The shift does not change the inertia of the base about its own centre of
        mass.

        Parameters
        ----------
        mass : float
            Mass of the payload [kg]; negative if the base is lighter than its URDF states.
        shift_x, shift_z : float
            Shift of the whole rover's centre of mass in the base's axes [m].

        Raises
        ------
        ParameterError
            The base would have no mass, or an inertia that no body can have.
        """
        model, data = self.model.copy(), self.model.createData()
        centre = pin.centerOfMass(self.model, data, pin.neutral(self.model))
        base = model.inertias[1]
        heavy = base.mass + float(mass)
        if not heavy > 0.0:
            raise ParameterError(
                f"mass = {mass:g} kg is not allowed: the base of rover '{self.name}' has only {base.mass:g} kg, "
                "and a part of it must remain."
            )
        # The payload moves the base's own centre of mass, and adds to its inertia by the parallel-axis theorem.
        from_base, from_old = centre - base.lever, float(mass) / heavy * (centre - base.lever)
        spread = base.mass * float(mass) / heavy
        inertia = base.inertia + spread * (from_base @ from_base * np.eye(3) - np.outer(from_base, from_base))
        axes = np.linalg.eigvalsh(inertia)
        if not (axes[0] > 0.0 and axes[0] + axes[1] > axes[2]):
            raise ParameterError(
                f"mass = {mass:g} kg is not allowed: the base would have an inertia that no body can have; give a mass "
                "nearer to 0."
            )
        # The base has only a part of the rover's mass, so its own centre of mass must move further than the rover's.
        shift = (self.mass + float(mass)) / heavy * np.array([shift_x, 0.0, shift_z])
        model.inertias[1] = pin.Inertia(heavy, base.lever + from_old + shift, inertia)
        return dataclasses.replace(self, model=model)

    def mount(self, name: str) -> WheelMount:
        """Return the wheel with this name, for instance "fl".

        Raises ParameterError: there is no such wheel.
        """
        mounts = {mount.name: mount for mount in self.wheels}
        if name not in mounts:
            raise ParameterError(f"Rover '{self.name}' has no wheel '{name}': {closest(name, mounts)}")
        return mounts[name]


@public
def load_rover(rover: str | Path = "nexus6", trust: Trust = Trust()) -> Rover:
    """Return a rover of the package by its name, or your own rover by the path of its TOML.

    The URDF must lie in the TOML's folder, unless `trust` allows other places. Meshes are not read.

    Parameters
    ----------
    rover : str or path
        A name of `rover-pin list rovers`, or the path of a TOML.
    trust : Trust
        Whether files that the TOML names may lie outside its folder.

    Returns
    -------
    Rover
        Wheels, joints and a copy of Pinocchio's model that you may change.

    Raises
    ------
    UrdfError
        The TOML and its URDF do not describe a rover; the message states what to correct.

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
    """Return the rover of a TOML file, from the cache if the file was read before.

    `texts` are the contents of the TOML and of the URDF. They are part of the key of the cache, so that a changed file
    is read again.
    """
    layout = read_layout(path, trust)
    refuse_faults(layout)
    return assemble(layout)


def load_named(rover: str, file: Path, trust: Trust = Trust()) -> Rover:
    """Return the rover that a model file or a drive log names.

    Parameters
    ----------
    rover : str
        The name of a rover of the package, or the path of a rover's TOML relative to `file`. Several data sets may
        share one rover, so that the TOML may lie outside the folder of `file`.
    file : Path
        The model file or drive log.
    trust : Trust
        Whether files that the rover's TOML names may lie outside the TOML's folder.

    Raises UrdfError: the name does not lead to a rover. If the TOML lies outside the folder of `file`, the error does
    not quote the content of the TOML, because the path came from data and may lead to a private file.
    """
    # A file next to `file` has priority over a rover of the package with this name.
    beside = file.parent / rover
    path = beside if is_file(beside) else Path(rover)
    elsewhere = path.suffix != "" and not path.resolve().is_relative_to(file.parent.resolve())
    try:
        if not elsewhere or path.suffix == ".toml":
            return load_rover(path, trust)
    except UrdfError as error:
        if not elsewhere:
            raise UrdfError(f"{file}: {error}") from error
    raise UrdfError(
        f"{file}: rover = {rover!r} lies outside the file's folder and is not a rover: check it by "
        "`rover-pin check-urdf`."
    )


def assemble(layout: Layout) -> Rover:
    """Return the rover that a layout describes. The layout consists of the URDF and the roles of its joints.

    The layout is not checked for faults. Call `refuse_faults` first, because a URDF with faults leads to an error of
    Pinocchio, or to a wrong rover.
    """
    # The model has a free base; the joints of the URDF get their roles from the layout.
    model = free_tree(layout.text)
    wheels = []
    for number, axle in enumerate(layout.axles):
        for side, joint, steer in zip("lr", axle.wheels, axle.steering, strict=True):
            wheels.append(
                WheelMount(
                    name=axle.name[0] + side,
                    joint=model.getJointId(joint),
                    dof=_dof(model, joint),
                    steer_dof=None if steer is None else _dof(model, steer),
                    side=side,
                    axle=number,
                    wheel=axle.wheel,
                )
            )
    differential = None
    if layout.differential is not None:
        left, right = layout.differential
        differential = Differential(_dof(model, left), _dof(model, right), _angle(model, left), _angle(model, right))
    # The URDF's <mimic> elements state which joints follow other joints; the differential is not among them.
    couplings = []
    for name, mimic in read_tree(layout.text, layout.file).followers(layout.differential):
        is_wheel = name in layout.wheel_joints
        angles = [None if is_wheel else _angle(model, joint) for joint in (name, mimic.joint)]
        couplings.append(Coupling(_dof(model, name), _dof(model, mimic.joint), mimic.multiplier, *angles))
    return Rover(
        name=layout.name,
        model=model,
        wheels=tuple(wheels),
        differential=differential,
        angles={name: _angle(model, joint) for name, joint in layout.angles.items()},
        mirror=mirror(model, layout.pairs),
        urdf=layout.text,
        couplings=tuple(couplings),
        springs=layout.springs,
        motor=layout.motor,
        soil=layout.soil,
    )


def mirror(model: pin.Model, pairs: Sequence[tuple[str, str]]) -> Mirror:
    """Return the permutation and the signs of the mirror image of a velocity in the x-z plane of the base.

    The mirror image of an angular velocity (x, y, z) is (-x, y, -z). Therefore the sign of a joint's rate follows from
    the directions of its axis and of its partner's axis at zero angles. The components v_y, omega_x and omega_z of the
    base's velocity change sign.

    Parameters
    ----------
    model : pin.Model
        Pinocchio's model of the rover.
    pairs : sequence of (left, right)
        Names of joints that mirror each other; a joint in the middle is paired with itself.
    """
    # The mirror image of a motion of the base is the same motion, with or without a change of sign.
    perm, sign = np.arange(model.nv), np.ones(model.nv)
    sign[[1, 3, 5]] = -1.0
    axes = axes_at_zero(model)
    # The sign of a rate is +1 if the mirror image of the joint's axis points along the axis of its partner.
    for left, right in pairs:
        a, b = _dof(model, left), _dof(model, right)
        image = axes[a] * [-1.0, 1.0, -1.0]
        perm[a], perm[b] = b, a
        sign[a] = sign[b] = 1.0 if image @ axes[b] > 0.0 else -1.0
    return Mirror(perm, sign)


def is_symmetric(model: pin.Model, image: Mirror) -> bool:
    """Return whether a rover's mass matrix equals its mirror image.

    The left side and the right side then have equal masses at equal distances from the middle. Only for such a rover, a
    drive on symmetric terrain may be computed with enforced symmetry (`symmetric` in `simulate`).
    """
    # Pinocchio fills the upper triangle of the mass matrix only.
    upper = np.triu(pin.crba(model, model.createData(), pin.neutral(model), pin.Convention.WORLD))
    mass = upper + np.triu(upper, 1).T
    mirrored = np.outer(image.sign, image.sign) * mass[np.ix_(image.perm, image.perm)]
    return bool(np.max(np.abs(mirrored - mass)) <= SYMMETRY_TOLERANCE * np.max(np.abs(mass)))


def _dof(model: pin.Model, joint: str) -> int:
    """Return the index of a joint's rate in Pinocchio's velocity vector v."""
    return int(model.joints[model.getJointId(joint)].idx_v)


def _angle(model: pin.Model, joint: str) -> int:
    """Return the index of a joint's angle in Pinocchio's configuration vector q."""
    return int(model.joints[model.getJointId(joint)].idx_q)
