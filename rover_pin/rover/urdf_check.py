"""Whether a URDF makes a rover: every fault is one sentence that says what to mend."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, UrdfError
from rover_pin.base.trust import Trust
from rover_pin.rover.description.faults import across, faults_of
from rover_pin.rover.description.inertia_check import inertia_notes
from rover_pin.rover.description.layout import Layout, read_layout, urdf_folder
from rover_pin.rover.description.meshes import mesh_file, package_of
from rover_pin.rover.description.readers import free_tree
from rover_pin.rover.description.tree import UrdfTree, read_tree, urdf_text
from rover_pin.rover.proposal.parts import Topology
from rover_pin.rover.proposal.passive import passive_wheels
from rover_pin.rover.rover import assemble
from rover_pin.rover.statics import wheel_loads
from rover_pin.rover.symmetry import is_symmetric, mirror

ON_ONE_PLANE = 1e-3
"""Spread of the wheel centres off their plane, over that along it, that counts as standing."""
TILT = 0.02
"""Slope [rad] on which a rover that stands must stand too: one poised on a free pivot does not."""


@dataclass(frozen=True)
class UrdfReport:
    """What a check found: faults keep a rover from loading, or from standing on level ground; notes do not."""

    file: str
    faults: tuple[str, ...]
    notes: tuple[str, ...]
    facts: tuple[str, ...]
    loads: bool = False
    "whether it can be loaded, standing or not; never of a .urdf alone"

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
        text = urdf_text(path) if layout is None else layout.text
        tree = read_tree(text, path.name if layout is None else layout.file)
    except UrdfError as error:
        return UrdfReport(path.name, (str(error),), (), ())
    problems = faults_of(tree, text, layout)
    loads = layout is not None and not problems
    if layout is not None and loads:
        problems = list(_standing_faults(layout))
    faults = tuple(f"{tree.file}: {fault}" for fault in _fold_sentences(problems))
    if faults:
        return UrdfReport(path.name, faults, (), (), loads)
    model = free_tree(text)
    notes = [*_notes(tree, layout), *_mesh_notes(tree, path.parent if layout is None else urdf_folder(path))]
    notes += [] if layout is None else _stance_notes(layout, model)
    prefixed = tuple(f"{tree.file}: {note}" for note in _fold_sentences(notes))
    return UrdfReport(path.name, (), prefixed, tuple(_facts(tree, model, layout)), loads)


def _fold_sentences(sentences: Iterable[str]) -> Iterator[str]:
    """Yield sentences; those that differ by the one name in them and numbers alone are one, with the others' names."""
    groups: dict[str, list[str]] = {}
    for sentence in sentences:
        named = re.findall(r"'[^']*'", sentence)
        groups.setdefault(re.sub(r"'[^']*'|\d\S*", "", sentence) if len(named) == 1 else sentence, []).append(sentence)
    for first, *others in groups.values():
        names = [match.group() for sentence in others if (match := re.search(r"'[^']*'", sentence))]
        yield first + (f" Likewise {', '.join(dict.fromkeys(names))}." if names else "")


def _standing_faults(layout: Layout) -> Iterator[str]:
    """Yield why the rover does not stand on level ground at zero angles, if so: an unstable balance is a fault."""
    rover = assemble(layout)
    try:
        loads, *_ = (wheel_loads(rover, slope) for slope in (0.0, TILT, -TILT))
    except ParameterError as error:
        yield str(error)
        return
    lifted = [wheel.name for wheel, load in zip(rover.wheels, loads, strict=True) if load <= 0.0]
    if lifted:
        yield (
            f"at rest on level ground wheel{'s' * (len(lifted) > 1)} {', '.join(lifted)} would have to be held down "
            f"({float(np.min(loads)):.3g} N), so it tips over; move its wheels, or its masses between them."
        )


def _notes(tree: UrdfTree, layout: Layout | None) -> Iterator[str]:
    if layout is not None:
        yield from layout.changes
        radii = {joint: float(axle.wheel.r) for axle in layout.axles for joint in axle.wheels}
        yield from (f"{text}; they are driven as if motors did." for text in passive_wheels(Topology(tree), radii))
    yield from inertia_notes(tree)
    for joint in tree.joints:
        if joint.lossy:
            yield f"joint '{joint.name}' has <dynamics>, which is not used; friction is an effect of the model."
    if layout is None:
        yield "without a TOML only the URDF itself was checked; write one to say which joints are wheels."


def _mesh_notes(tree: UrdfTree, folder: Path) -> Iterator[str]:
    meshes = dict.fromkeys(mesh for link in tree.links for mesh in link.meshes)
    missing = [mesh for mesh in meshes if mesh_file(mesh, folder) is None]
    if missing:
        yield (
            f"{len(missing)} of {len(meshes)} meshes are not in '{package_of(folder).name}', outside of which none is "
            f"read, and so not drawn: {', '.join(missing)}."
        )


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
    for name, mimic in tree.followers(layout.differential):
        yield f"{name} = {mimic.multiplier:g} {mimic.joint}"
