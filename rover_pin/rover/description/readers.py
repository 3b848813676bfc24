"""Two libraries read the URDF and must place its links alike."""

import io
import logging
import os
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.files import bounded
from rover_pin.base.files.private_folders import digest_of, is_cached, remember
from rover_pin.rover.description.tree import UrdfTree

CONFIGURATIONS = 5
"""Random configurations at which the two readers are compared."""
AGREE = 1e-6
"""Largest difference between the links' placements (m, and entries of the rotations)."""


def free_tree(text: str) -> pin.Model:
    """Return Pinocchio's tree with a free-flyer at the root and every mimicking joint set free."""
    return pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), False)


def axes_at_zero(model: pin.Model) -> np.ndarray:
    """Return the axis of each degree of freedom at zero angles, in the base's axes [nv, 3]."""
    data = model.createData()
    return np.array(pin.computeJointJacobians(model, data, pin.neutral(model))[3:].T)


def reader_faults(tree: UrdfTree, text: str, model: pin.Model) -> Iterator[str]:
    """Yield the first link that Pinocchio and yourdfpy place differently, at random joint angles.

    A text that both read alike is remembered, so that it is read by the slower one once a machine and user.
    """
    digest = digest_of([text, bounded.text(__file__), *_readers()])
    if is_cached("urdf", digest):
        return
    faults = list(_compare_readers(tree, text, model))
    yield from faults
    if not faults:
        remember("urdf", digest)


def _readers() -> list[str]:
    """Return which readers these are: Pinocchio by its version, the other by its file, as importing takes long."""
    spec = find_spec("yourdfpy")
    place = "" if spec is None else str(spec.origin)
    return [pin.__version__, place, str(os.stat(place).st_mtime_ns) if place else ""]


def _compare_readers(tree: UrdfTree, text: str, model: pin.Model) -> Iterator[str]:
    import yourdfpy  # half a second, and only a URDF not seen before wants it

    logging.getLogger("yourdfpy").setLevel(logging.ERROR)  # it warns of each mimic that follows a fixed joint
    try:
        reference = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)
    except Exception as error:
        yield f"yourdfpy cannot read it ({error}); check its XML against the URDF format."
        return
    rng = np.random.default_rng(6)
    for _ in range(CONFIGURATIONS):
        angles = _random_angles(tree, rng)
        for fault in _differences(tree, model, reference, angles):
            yield fault
            return


def _random_angles(tree: UrdfTree, rng: np.random.Generator) -> dict[str, float]:
    moving = [joint for joint in tree.joints if joint.moves]
    angles = {joint.name: float(rng.uniform(-1.0, 1.0)) for joint in moving}
    for joint in moving:
        if joint.mimic is not None:
            angles[joint.name] = joint.mimic.multiplier * angles[joint.mimic.joint] + joint.mimic.offset
    return angles


def _differences(tree: UrdfTree, model: pin.Model, reference: Any, angles: Mapping[str, float]) -> Iterator[str]:
    data, v = model.createData(), np.zeros(model.nv)
    for name, angle in angles.items():
        v[model.joints[model.getJointId(name)].idx_v] = angle
    pin.forwardKinematics(model, data, pin.integrate(model, pin.neutral(model), v))
    reference.update_cfg({name: angle for name, angle in angles.items() if name in reference.actuated_joint_names})
    for joint in (moving_joint for moving_joint in tree.joints if moving_joint.moves):
        ours = data.oMi[model.getJointId(joint.name)].homogeneous
        distance = float(np.max(np.abs(reference.get_transform(joint.child, tree.roots[0]) - ours)))
        if not distance <= AGREE:
            yield (
                f"Pinocchio and yourdfpy place link '{joint.child}' {distance:.2g} apart; "
                f"look at the origin and axis of joint '{joint.name}'."
            )
