"""Cross-check of a URDF: Pinocchio and yourdfpy both read it and must agree on the placements of all links."""

import io
import logging
import os
from collections.abc import Iterator
from importlib.util import find_spec

import numpy as np
import pinocchio as pin

from rover_pin.base.files import bounded
from rover_pin.base.files.private_folders import digest_of, is_cached, remember
from rover_pin.rover.description.tree import UrdfTree

CONFIGURATIONS = 5
"""Number of random configurations at which the placements by the two libraries are compared. A wrong axis or origin
already shows at one random configuration; the others exclude a chance agreement."""
PLACEMENT_TOLERANCE = 1e-6
"""Largest difference between two placements of a link that count as equal (positions in m, entries of rotation
matrices). A larger difference is reported as a fault of the URDF. Round-off is smaller by many powers of ten."""


def free_tree(text: str) -> pin.Model:
    """Return Pinocchio's model of a URDF, whose base can move freely (a free flyer at the root). `text` is the content
    of the URDF.

    Joints that follow other joints by <mimic> are independent in this model, because the equation of motion (Eq (8) of
    the paper) couples them by constraint rows.
    """
    return pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), False)


def axes_at_zero(model: pin.Model) -> np.ndarray:
    """Return the rotation axis of each degree of freedom in the base's axes, with all joint angles at zero [nv, 3].

    Each row is a unit vector, the angular part of a column of the joint Jacobian. The rows for the translation of the
    base are zero.
    """
    data = model.createData()
    return np.array(pin.computeJointJacobians(model, data, pin.neutral(model))[3:].T)


def reader_faults(tree: UrdfTree, text: str, model: pin.Model) -> Iterator[str]:
    """Yield a fault if Pinocchio and yourdfpy, which both read the URDF, place a link differently at random joint
    angles.

    Only the first such link is reported. If both libraries agree, this result is stored on the disk, because importing
    and running yourdfpy takes half a second.

    Parameters
    ----------
    tree, text : UrdfTree, str
        The links and joints of the URDF, and its text.
    model : pin.Model
        Pinocchio's model of the text, as `free_tree` returns it.
    """
    # The digest changes with the text, with this check, and with either library. Pinocchio is identified by its
    # version. yourdfpy is identified by its file, because the import that would give its version takes most of the
    # time.
    spec = find_spec("yourdfpy")
    origin = "" if spec is None else str(spec.origin)
    readers = [pin.__version__, origin, str(os.stat(origin).st_mtime_ns) if origin else ""]
    digest = digest_of([text, bounded.text(__file__), *readers])
    if is_cached("urdf", digest):
        return
    import yourdfpy  # imported here, because the import takes half a second and only a new URDF needs it

    # yourdfpy warns of each mimic that follows a fixed joint.
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    try:
        reference = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)
    except Exception as error:
        yield f"yourdfpy cannot read it ({error}); check its XML against the URDF format."
        return
    rng = np.random.default_rng(6)
    moving = [joint for joint in tree.joints if joint.moves]
    for _ in range(CONFIGURATIONS):
        # Random angles are within 1 rad. A joint with a <mimic> gets the angle that the <mimic> states, because
        # yourdfpy ignores any other angle for this joint.
        angles = {joint.name: float(rng.uniform(-1.0, 1.0)) for joint in moving}
        for joint in moving:
            if joint.mimic is not None:
                angles[joint.name] = joint.mimic.multiplier * angles[joint.mimic.joint] + joint.mimic.offset
        # Both libraries get the same joint angles.
        data, v = model.createData(), np.zeros(model.nv)
        for name, angle in angles.items():
            v[model.joints[model.getJointId(name)].idx_v] = angle
        pin.forwardKinematics(model, data, pin.integrate(model, pin.neutral(model), v))
        reference.update_cfg({name: angle for name, angle in angles.items() if name in reference.actuated_joint_names})
        # Placements are multiplied joint by joint from the root, because yourdfpy walks the whole chain for each
        # transform from the root.
        placements = {tree.roots[0]: np.eye(4)}
        for joint in tree.outwards():
            placements[joint.child] = placements[joint.parent] @ reference.get_transform(joint.child, joint.parent)
        # A joint that does not move keeps its place, so only moving joints can differ.
        for joint in moving:
            ours = data.oMi[model.getJointId(joint.name)].homogeneous
            distance = float(np.max(np.abs(placements[joint.child] - ours)))
            if not distance <= PLACEMENT_TOLERANCE:
                yield (
                    f"Pinocchio and yourdfpy place link '{joint.child}' {distance:.2g} apart; "
                    f"look at the origin and axis of joint '{joint.name}'."
                )
                return
    remember("urdf", digest)
