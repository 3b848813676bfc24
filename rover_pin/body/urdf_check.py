"""Whether a URDF makes a rover: every fault is one sentence that says what to mend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from rover_pin.body.layout import Layout, read_layout
from rover_pin.body.symmetry import axes_at_zero, is_symmetric, mirror
from rover_pin.body.urdf_inertia import inertia_faults, unit_faults
from rover_pin.body.urdf_readers import free_tree, reader_faults
from rover_pin.body.urdf_roles import axis_faults, role_faults
from rover_pin.body.urdf_structure import structure_faults
from rover_pin.body.urdf_tree import UrdfTree, read_tree
from rover_pin.bounded import text as read_text
from rover_pin.errors import UrdfError
from rover_pin.trust import Trust

ON_ONE_PLANE = 1e-3
"""Spread of the wheel centres off their plane, over that along it, that counts as standing."""


@dataclass(frozen=True)
class UrdfReport:
    """What a check found: faults keep a rover from loading, notes do not."""

    file: str
    faults: tuple[str, ...]
    notes: tuple[str, ...]
    facts: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether there is no fault."""
        return not self.faults


def check_urdf(path: str | Path, trust: Trust = Trust()) -> UrdfReport:
    """Return what is wrong with a rover's .toml and its URDF, or with a .urdf alone as far as it goes without roles.

    Raises nothing for a broken file: what cannot even be read is the report's one fault.
    """
    path = Path(path)
    try:
        layout = None if path.suffix == ".urdf" else read_layout(path, trust)
        text = _text(path) if layout is None else layout.text
        tree = read_tree(text, path.name if layout is None else layout.file)
    except UrdfError as error:
        return UrdfReport(path.name, (str(error),), (), ())
    faults = tuple(f"{tree.file}: {fault}" for fault in _faults(tree, text, layout))
    if faults:
        return UrdfReport(path.name, faults, (), ())
    model = free_tree(text)
    notes = [*_notes(tree, layout), *(() if layout is None else _stance_notes(layout, model))]
    return UrdfReport(
        path.name, (), tuple(f"{tree.file}: {note}" for note in notes), tuple(_facts(tree, model, layout))
    )


def refuse_faults(layout: Layout) -> None:
    """Raise the first fault of a layout's URDF.

    Raises
    ------
    UrdfError
        The first fault; further ones are counted.
    """
    tree = read_tree(layout.text, layout.file)
    faults = _faults(tree, layout.text, layout)
    if faults:
        more = f" ({len(faults) - 1} more: see `rover-pin check-urdf`.)" if len(faults) > 1 else ""
        raise UrdfError(f"{layout.file}: {faults[0]}{more}")


def _faults(tree: UrdfTree, text: str, layout: Layout | None) -> list[str]:
    """Return the faults of the first stage that has any: later stages need the earlier ones sound."""
    for stage in (_written, _placed):
        faults = list(stage(tree, text, layout))
        if faults:
            return faults
    return []


def _written(tree: UrdfTree, text: str, layout: Layout | None) -> Iterator[str]:
    faults = list(structure_faults(tree))
    yield from faults or inertia_faults(tree)
    if faults:
        return
    if layout is not None:
        yield from role_faults(layout, tree)
    elif not any(joint.kind == "continuous" for joint in tree.joints):
        yield "it has no wheel: none of its joints is continuous."


def _placed(tree: UrdfTree, text: str, layout: Layout | None) -> Iterator[str]:
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


def _notes(tree: UrdfTree, layout: Layout | None) -> Iterator[str]:
    for joint in tree.joints:
        if joint.lossy:
            yield f"joint '{joint.name}' has <dynamics>, which is not used; friction is an effect of the model."
    meshes = [mesh for link in tree.links for mesh in link.meshes]
    if meshes:
        yield f"{len(meshes)} meshes ('{meshes[0]}', ...) are only drawn; they may be missing."
    order = [joint.name for joint in tree.joints]
    for joint in tree.joints:
        if joint.mimic is not None and joint.mimic.joint in order[order.index(joint.name) :]:
            yield f"joint '{joint.name}' mimics one that comes later in the file; some tools want that one first."
    if layout is None:
        yield "without a TOML only the URDF itself was checked; write one to say which joints are wheels."


def _stance_notes(layout: Layout, model: pin.Model) -> Iterator[str]:
    if not is_symmetric(model, mirror(model, layout.pairs)):
        yield "its left and right side differ in place or mass; `symmetric` drives are not for it."
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    centres = np.array([data.oMi[model.getJointId(joint)].translation for joint in layout.wheel_joints])
    singular = np.linalg.svd(centres - centres.mean(axis=0), compute_uv=False)
    if singular[2] > ON_ONE_PLANE * singular[0]:
        yield "its wheels do not stand on one plane at zero angles, where static loads are taken; mend the origins."


def _facts(tree: UrdfTree, model: pin.Model, layout: Layout | None) -> Iterator[str]:
    mass = sum(body.mass for body in model.inertias)
    yield f"{mass:.4g} kg, joints {across(model):.3g} m across, {model.nv} degrees of freedom"
    if layout is None:
        yield "continuous joints: " + ", ".join(joint.name for joint in tree.joints if joint.kind == "continuous")
        return
    yield f"{len(layout.wheel_joints)} wheels: " + ", ".join(layout.wheel_joints)
    yield "differential: " + (" and ".join(layout.differential) if layout.differential else "none")


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise UrdfError(f"{path.name}: cannot be read ({error}).") from error
