"""Joints that follow others, by <mimic>: each follows the one joint that leads, however the chain ran.

A differential is one such relation among others: gear, bar or brace, what moves with it follows its left rocker.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from rover_pin.base.errors import UrdfError


class Relation(NamedTuple):
    """angle of `joint` = ratio * angle of `leader`."""

    joint: str
    leader: str
    ratio: float


def follow_one_leader(
    joints: Mapping[str, ET.Element], differential: tuple[str, str] | None, file: str
) -> Iterator[str]:
    """Rewrite each <mimic> to point to the joint that leads; yield a sentence for each that changes.

    The differential's left rocker leads what hangs together with it, any other group its joint that follows none.

    Raises UrdfError: joints that follow each other in a ring, or that must turn by two ratios at once.
    """
    mimics = list(_mimics(joints))
    relations = [Relation(*mimic[:3]) for mimic in mimics if set(mimic[:2]) != set(differential or ())]
    if not relations or any(offset for *_, offset in mimics):
        return
    if differential is not None:
        relations.append(Relation(differential[1], differential[0], -1.0))
    for leader in _leaders(relations, differential, file):
        for name, ratio in _ratios(leader, relations, file).items():
            if name != leader and {name, leader} != set(differential or ()):
                yield from _set_mimic(joints[name], Relation(name, leader, ratio))
        if differential is not None and leader == differential[0]:
            yield from _free_rockers(joints, differential)


def _mimics(joints: Mapping[str, ET.Element]) -> Iterator[tuple[str, str, float, float]]:
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and mimic.get("joint") in joints and joint.get("type") != "fixed":
            ratio, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", "1"), ("offset", "0")))
            if ratio:
                yield name, str(mimic.get("joint")), ratio, offset


def _leaders(relations: list[Relation], differential: tuple[str, str] | None, file: str) -> list[str]:
    """Return one joint for each group of joints that hang together."""
    followers = {relation.joint for relation in relations}
    first = [] if differential is None else [differential[0]]
    leaders: list[str] = []
    reached: set[str] = set()
    for leader in [
        *first,
        *dict.fromkeys(relation.leader for relation in relations if relation.leader not in followers),
    ]:
        if leader not in reached:
            leaders.append(leader)
            reached |= set(_ratios(leader, relations, file))
    if lost := sorted({name for relation in relations for name in relation[:2]} - reached):
        raise UrdfError(f"{file}: joint '{lost[0]}' follows itself in a ring of <mimic>: let one of them lead.")
    return leaders


def _ratios(leader: str, relations: list[Relation], file: str) -> dict[str, float]:
    """Return by how much each joint of the leader's group turns when it turns by one."""
    ratios = {leader: 1.0}
    for name in (names := [leader]):
        for joint, lead, ratio in relations:
            for start, there, times in ((joint, lead, 1.0 / ratio), (lead, joint, ratio)):
                if start == name and there not in ratios:
                    ratios[there] = times * ratios[name]
                    names.append(there)
    for joint, lead, ratio in relations:
        if joint in ratios and not math.isclose(ratios[joint], ratio * ratios[lead], rel_tol=1e-6):
            raise UrdfError(
                f"{file}: joint '{joint}' would follow '{leader}' by {ratio * ratios[lead]:g} and {ratios[joint]:g} at "
                "once; mend its <mimic> or the TOML's [differential] and [coupled]."
            )
    return ratios


def _set_mimic(joint: ET.Element, relation: Relation) -> Iterator[str]:
    mimic = joint.find("mimic")
    if mimic is not None and mimic.get("joint") == relation.leader:
        return
    mimic = ET.SubElement(joint, "mimic") if mimic is None else mimic
    mimic.set("joint", relation.leader)
    mimic.set("multiplier", repr(relation.ratio))
    mimic.set("offset", "0")
    yield f"joint '{relation.joint}' follows '{relation.leader}' {relation.ratio:+g} : 1, which it did through others."


def _free_rockers(joints: Mapping[str, ET.Element], differential: tuple[str, str]) -> Iterator[str]:
    """Let the rockers follow nothing but each other."""
    for name, partner in (differential, differential[::-1]):
        mimic = joints[name].find("mimic") if name in joints else None
        if mimic is not None and mimic.get("joint") != partner:
            joints[name].remove(mimic)
            yield f"rocker '{name}' leads '{mimic.get('joint')}', which the URDF has the other way round."
