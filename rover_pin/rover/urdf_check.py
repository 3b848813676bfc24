"""Check whether a URDF and its TOML describe a rover. Every fault is one sentence that states what to correct."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, UrdfError
from rover_pin.base.trust import Trust
from rover_pin.rover.description.cross_check import free_tree
from rover_pin.rover.description.drawn_axis import visual_against_collision
from rover_pin.rover.description.faults import across, faults_of
from rover_pin.rover.description.inertia_check import inertia_notes
from rover_pin.rover.description.layout import Layout, read_layout, urdf_folder
from rover_pin.rover.description.meshes import mesh_file, package_of
from rover_pin.rover.description.tree import UrdfTree, read_tree, urdf_text
from rover_pin.rover.proposal.frames import contradictions, named_places, place_words
from rover_pin.rover.proposal.parts import Topology
from rover_pin.rover.proposal.propose import passive_wheels
from rover_pin.rover.rover import assemble, is_symmetric, mirror
from rover_pin.rover.statics import wheel_loads

PLANE_TOLERANCE = 1e-3
"""Largest spread of the wheel centres across their common plane, divided by their spread along the plane. Beyond this
value, a note states that the wheels are not on one plane."""
STABILITY_SLOPE = 0.02
"""Small slope [rad] on which a rover must be in static balance, as on level ground. The slope reveals an unstable
balance: a body that is balanced on a free pivot on level ground is not in balance on this slope."""


@dataclass(frozen=True)
class UrdfReport:
    """Result of `check_urdf`: faults, notes and facts about a rover.

    A fault prevents the loading of a rover, or its equilibrium on level ground. A note is only a hint.
    """

    file: str
    faults: tuple[str, ...]
    notes: tuple[str, ...]
    facts: tuple[str, ...]
    """sentences on mass, size and roles of joints, for comparison with the real rover"""
    loads: bool = False
    """whether the rover can be loaded, even without an equilibrium; false for a .urdf without a TOML"""

    @property
    def ok(self) -> bool:
        """Return whether the check has found no fault."""
        return not self.faults


def check_urdf(path: str | Path, trust: Trust = Trust()) -> UrdfReport:
    """Return the faults, notes and facts of a rover.

    Parameters
    ----------
    path : path
        The .toml of a rover. The check of a .urdf alone omits all tests that need the roles of its joints.
    trust : Trust
        Whether files that the TOML names may lie outside its folder.

    Returns
    -------
    UrdfReport
        If a file cannot be read, the report has this one fault; broken files raise no error.

    Examples
    --------
    >>> from rover_pin.rover.description.layout import shipped_toml
    >>> check_urdf(shipped_toml("cart")).ok
    True
    """
    path = Path(path)
    try:
        # If a file cannot be read, this is the only fault, because no further checks are possible.
        layout = None if path.suffix == ".urdf" else read_layout(path, trust)
        text = urdf_text(path) if layout is None else layout.text
        tree = read_tree(text, path.name if layout is None else layout.file)
    except UrdfError as error:
        return UrdfReport(path.name, (str(error),), (), ())
    problems = faults_of(tree, text, layout)
    loads = layout is not None and not problems
    # Only a rover without faults can be assembled, and only then can its balance on level ground at zero joint angles
    # be computed. If a small slope already destroys the balance, the balance is unstable, and the rover does not stand.
    if layout is not None and loads:
        rover = assemble(layout)
        try:
            level, *_ = (wheel_loads(rover, slope) for slope in (0.0, STABILITY_SLOPE, -STABILITY_SLOPE))
        except ParameterError as error:
            problems = [str(error)]
        else:
            lifted = [wheel.name for wheel, load in zip(rover.wheels, level, strict=True) if load <= 0.0]
            if lifted:
                problems = [
                    f"at rest on level ground wheel{'s' * (len(lifted) > 1)} {', '.join(lifted)} would have to be held "
                    f"down ({float(np.min(level)):.3g} N), so the rover tips over; move its wheels, or move its "
                    "centre of mass between the wheels."
                ]
    if problems:
        return UrdfReport(path.name, _fold_sentences(tree.file, problems), (), (), loads)
    model = free_tree(text)
    folder = path.parent if layout is None else urdf_folder(path)
    notes = _fold_sentences(tree.file, list(_notes(tree, layout, model, folder)))
    # The facts state mass, size and the roles of the joints, so that a user can compare them with the real rover.
    mass = sum(body.mass for body in model.inertias)
    facts = [f"{mass:.4g} kg, joints {across(model):.3g} m across, {model.nv} degrees of freedom"]
    if layout is None:
        facts.append("joints that turn fully: " + ", ".join(joint.name for joint in tree.joints if joint.turns_fully))
    else:
        facts.append(f"{len(layout.wheel_joints)} wheels: " + ", ".join(layout.wheel_joints))
        facts.append("differential: " + (" and ".join(layout.differential) if layout.differential else "none"))
        followers = tree.followers(layout.differential)
        facts += [f"{name} = {mimic.multiplier:g} {mimic.joint}" for name, mimic in followers]
    return UrdfReport(path.name, (), notes, tuple(facts), loads)


def _fold_sentences(file: str, sentences: list[str]) -> tuple[str, ...]:
    """Return the sentences with the name of the file at their beginning, after merging similar sentences.

    Sentences that differ only in one quoted name and in numbers are merged: the first of them is kept, and the names in
    the others follow, as in "Likewise 'fr', 'rl'.".
    """
    # The pattern of a sentence is its text without the quoted name and the numbers.
    groups: dict[str, list[str]] = {}
    for sentence in sentences:
        quoted_names = re.findall(r"'[^']*'", sentence)
        pattern = re.sub(r"'[^']*'|\d\S*", "", sentence) if len(quoted_names) == 1 else sentence
        groups.setdefault(pattern, []).append(sentence)
    merged = []
    for first, *others in groups.values():
        names = [match.group() for sentence in others if (match := re.search(r"'[^']*'", sentence))]
        merged.append(f"{file}: {first}" + (f" Likewise {', '.join(dict.fromkeys(names))}." if names else ""))
    return tuple(merged)


def _notes(tree: UrdfTree, layout: Layout | None, model: pin.Model, folder: Path) -> Iterator[str]:
    """Yield the notes on a rover without faults, on changes of the URDF, wheels, names, inertias, meshes and symmetry.

    `folder` is the folder of the URDF, which is searched for its meshes.
    """
    if layout is not None:
        yield from layout.changes
        radii = {joint: float(axle.wheel.r) for axle in layout.axles for joint in axle.wheels}
        yield from (
            f"{text}; the simulation drives them as if they had motors."
            for text in passive_wheels(Topology(tree), radii)
        )
        yield from visual_against_collision(tree, layout.wheel_joints)
        # The names of the wheels' joints or links can contradict the TOML about the end (front, rear) or the side
        # (left, right). In the TOML, the axles are ordered from front to rear along x, with left at +y.
        centres = np.array([[-float(axle), y, 0.0] for axle in range(len(layout.axles)) for y in (1.0, -1.0)])
        joints = {joint.name: joint for joint in tree.joints}
        for names in (layout.wheel_joints, [joints[name].child for name in layout.wheel_joints]):
            wrong = contradictions(named_places(names), centres)
            if wrong:
                words = ", ".join(f"'{names[i]}' at the {place_words(centres[i], centres.mean(axis=0))}" for i in wrong)
                yield f"the TOML puts {words}, which contradicts the names: check [wheels] and base_rpy."
                break
    yield from inertia_notes(tree)
    for joint in tree.joints:
        if joint.lossy:
            yield f"joint '{joint.name}' has <dynamics>, which is not used; friction is an effect of the model."
    if layout is None:
        yield "without a TOML only the URDF itself was checked; write a TOML that states which joints are wheels."
    # A mesh outside the folder of the URDF's package is not read, so the views do not show it.
    meshes = dict.fromkeys(mesh for link in tree.links for mesh in link.meshes)
    missing = [mesh for mesh in meshes if mesh_file(mesh, folder) is None]
    if missing:
        yield (
            f"{len(missing)} of {len(meshes)} meshes are not drawn, because they are not in "
            f"'{package_of(folder).name}', and no other folder is read: {', '.join(missing)}."
        )
    if layout is None:
        return
    if not is_symmetric(model, mirror(model, layout.pairs)):
        yield (
            "its left and right sides differ in positions or masses; drives with the option `symmetric` are not "
            "possible with this rover."
        )
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    centres = np.array([data.oMi[model.getJointId(joint)].translation for joint in layout.wheel_joints])
    # The smallest singular value measures the spread across the plane that fits the wheel centres best.
    singular = np.linalg.svd(centres - centres.mean(axis=0), compute_uv=False)
    if singular[2] > PLANE_TOLERANCE * singular[0]:
        yield (
            "its wheels are not on one plane at zero angles, and static loads are computed at zero angles; correct the "
            "origins."
        )
