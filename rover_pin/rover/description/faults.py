"""What keeps a URDF from being loaded as a rover: faults stage by stage, each one sentence that says what to mend."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.inertia_check import inertia_faults, unit_faults
from rover_pin.rover.description.layout import Layout
from rover_pin.rover.description.readers import axes_at_zero, free_tree, reader_faults
from rover_pin.rover.description.roles import axis_faults, role_faults
from rover_pin.rover.description.structure import structure_faults
from rover_pin.rover.description.tree import UrdfTree, read_tree


def refuse_faults(layout: Layout) -> None:
    """Raise the first fault of a layout's URDF.

    Raises UrdfError: the first fault; further ones are counted.
    """
    tree = read_tree(layout.text, layout.file)
    faults = faults_of(tree, layout.text, layout)
    if faults:
        more = f" ({len(faults) - 1} more: see `rover-pin check-urdf`.)" if len(faults) > 1 else ""
        raise UrdfError(f"{layout.file}: {faults[0]}{more}")


def faults_of(tree: UrdfTree, text: str, layout: Layout | None) -> list[str]:
    """Return the faults of the first stage that has any: later stages need the earlier ones sound."""
    for stage in (_tree_faults, _model_faults):
        faults = list(stage(tree, text, layout))
        if faults:
            return faults
    return []


def _tree_faults(tree: UrdfTree, text: str, layout: Layout | None) -> Iterator[str]:
    faults = list(structure_faults(tree))
    yield from faults or inertia_faults(tree)
    if faults:
        return
    if layout is not None:
        yield from role_faults(layout, tree)
    elif not any(joint.kind == "continuous" for joint in tree.joints):
        yield "it has no wheel: none of its joints is continuous."


def _model_faults(tree: UrdfTree, text: str, layout: Layout | None) -> Iterator[str]:
    try:
        model = free_tree(text)
    except Exception as error:
        yield f"Pinocchio cannot read it ({error}); check its joints."
        return
    yield from unit_faults(tree, across(model))
    if layout is not None:
        yield from axis_faults(layout, model, axes_at_zero(model))
    yield from reader_faults(tree, text, model)


def across(model: pin.Model) -> float:
    """Return the diagonal of the box around all joints at zero angles [m]."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    places = np.array([data.oMi[joint].translation for joint in range(1, model.njoints)])
    return float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
