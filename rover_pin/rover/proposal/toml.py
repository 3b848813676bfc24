"""The proposed TOML as text: every guess has a comment that says so, and why."""

import json
import math
from collections.abc import Iterator

from rover_pin.rover.proposal.parts import FRAMES, Proposal
from rover_pin.rover.proposal.wheel_shape import WheelSize

KEY = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


def proposed_text(proposal: Proposal, name: str, urdf: str) -> str:
    """Return the TOML of a proposal, for a rover of this name and URDF."""
    parts = (_head(proposal, name, urdf), _wheels(proposal), _suspension(proposal), _mimics(proposal), _ends(proposal))
    return "\n".join(line for part in parts for line in part) + "\n"


def _head(proposal: Proposal, name: str, urdf: str) -> Iterator[str]:
    yield f"# Proposed by `rover-pin new-rover {urdf}`. What is marked GUESSED was not stated: look at it."
    yield ""
    yield f"name = {_text(name)}"
    yield f"urdf = {_text(urdf)}"
    yield f"base = {_text(proposal.base)}"
    if any(proposal.base_rpy):
        angles = ", ".join(f"{angle:.10g}" for angle in proposal.base_rpy)
        yield f"base_rpy = [{angles}]  # GUESSED: the base's axes are {FRAMES[proposal.base_rpy]}"
    if proposal.cut:
        yield f"cut = [{', '.join(map(_text, proposal.cut))}]  # {proposal.reasons[proposal.cut[0]]}"
    if proposal.skid:
        yield "# It has no steering: it turns by its sides' speeds. Where belts or gears join a side's wheels:"
        yield "# tied_sides = true"


def _wheels(proposal: Proposal) -> Iterator[str]:
    yield "\n[wheels]  # GUESSED by axis, place and shape; axles from front to rear, joints left and right"
    for axle in proposal.axles:
        yield f"{axle.name} = [{_text(axle.wheels[0].joint)}, {_text(axle.wheels[1].joint)}]"
    size_by_axle = {axle.name: axle.wheels[0].size for axle in proposal.axles}
    default_size = next(iter(size_by_axle.values()))
    yield "\n[wheel]  # radius and width in metres"
    yield from _size(default_size)
    for name, size in size_by_axle.items():
        if not (
            math.isclose(size.r, default_size.r, rel_tol=0.02) and math.isclose(size.b, default_size.b, rel_tol=0.02)
        ):
            yield f"\n[wheel.{name}]"
            yield from _size(size)
    steered = [axle for axle in proposal.axles if axle.steering]
    if steered:
        yield "\n[steering]  # GUESSED: each turns one wheel about an upright axis"
        for axle in steered:
            left, right = axle.steering or ("", "")
            yield f"{axle.name} = [{_text(left)}, {_text(right)}]"


def _size(size: WheelSize) -> Iterator[str]:
    yield f"r = {size.r:.4g}  # GUESSED from {size.source}"
    yield f"b = {size.b:.4g}"


def _suspension(proposal: Proposal) -> Iterator[str]:
    if not proposal.suspension:
        return
    yield "\n[suspension]  # GUESSED by what hangs below: pairs left and right, or one in the middle"
    for name, joints in proposal.suspension.items():
        why = proposal.reasons.get(joints[0], "")
        value = _text(joints[0]) if len(joints) == 1 else f"[{_text(joints[0])}, {_text(joints[1])}]"
        yield f"{_key(name)} = {value}" + (f"  # {why}" if why else "")
    if proposal.differential:
        yield f"\n[differential]  # GUESSED: {proposal.reasons['differential']}"
        yield f"pair = {_text(proposal.differential)}"


def _mimics(proposal: Proposal) -> Iterator[str]:
    if proposal.coupled:
        yield "\n[coupled]  # GUESSED: joints that follow another"
        for joint, (leader, ratio) in proposal.coupled.items():
            yield f"{_key(joint)} = {{ joint = {_text(leader)}, ratio = {ratio:g} }}  # {proposal.reasons[joint]}"


def _ends(proposal: Proposal) -> Iterator[str]:
    if proposal.held_joints:
        yield "\n[held]  # GUESSED: joints that stay where they are, at an angle [rad] or a travel [m]"
        for joint, value in proposal.held_joints.items():
            yield f"{_key(joint)} = {value:.6g}  # {proposal.reasons[joint]}"
    yield "\n# The motor of a wheel, from its data sheet; without this table one is sized by the rover's weight:"
    yield "# [motor]"
    yield '# stall_torque = { value = 1.0, unit = "N m" }'
    yield '# no_load_speed = { value = 30, unit = "rpm" }'
    yield "# gear = 1.0\n# efficiency = 1.0"
    yield "\n# The ground where nothing else is said; without this, slope-sand made firm enough:"
    yield '# soil = "fjs-1"'


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)


def _key(name: str) -> str:
    return name if name and set(name) <= KEY else _text(name)
