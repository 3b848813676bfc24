"""The compiled rigid body, one for all rovers of a tree."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.simulation.compiled.constant_part import split_law
from rover_pin.simulation.compiled.laws import generated_source
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.rigid_body import Joint, inertia_places, rigid_body, tree_of


@dataclass(frozen=True)
class CompiledBody:
    """The address of the generated function, its constants of one rover, and where its column's parts lie."""

    handle: ctypes.CDLL
    address: int
    precomputed: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    "of the inertia's entries, in its upper triangle"
    ends: dict[str, int]
    "where the parts of the column end: those of `Motion`"
    work: tuple[int, int]


@dataclass(frozen=True)
class KeyedModel:
    """A model, the same as any other of equal content: what is worked out for one holds for all."""

    content: bytes
    model: pin.Model = field(compare=False)

    @classmethod
    def of(cls, model: pin.Model) -> KeyedModel:
        """Return the model with its content."""
        return cls(_content(model), model)


def _content(model: pin.Model) -> bytes:
    """Return all that `tree_of` reads of a model, as bytes."""
    parts = [
        f"{joint.shortname()} {joint.idx_q} {parent}" for joint, parent in zip(model.joints, model.parents, strict=True)
    ]
    axes = pin.computeJointJacobians(model, model.createData(), pin.neutral(model))
    numbers = [axes.tobytes(), *(placement.homogeneous.tobytes() for placement in model.jointPlacements)]
    numbers += [inertia.toDynamicParameters().tobytes() for inertia in model.inertias]
    return " ".join(parts).encode() + b"".join(numbers)


@lru_cache(maxsize=64)
def order_of_elimination(
    keyed_model: KeyedModel, coupled: tuple[tuple[int, int], ...], together: tuple[int, ...]
) -> tuple[list[int], list[list[int]]]:
    """Return `elimination` of a model."""
    return elimination(keyed_model.model, coupled, together)


@lru_cache(maxsize=64)
def compiled_body(keyed_model: KeyedModel) -> CompiledBody:
    """Return the rigid body of a model, compiled; its numbers stay parameters, so a load or a sweep compiles once."""
    model = keyed_model.model
    tree = tree_of(model)
    handle, before, during = _compile_body(tree.joints, model.nq, model.nv)
    precomputed = np.array(before(np.zeros(0), tree.parameters)).ravel()
    rows, columns = np.array(inertia_places(tree.joints), dtype=np.int64).T
    joints = len(tree.joints) - 1
    lengths = {"inertia": len(rows), "bias": model.nv, "axes": 3 * joints, "points": 3 * joints}
    lengths |= {"rotation": 9, "potential": 1}
    ends = dict(zip(lengths, np.cumsum(list(lengths.values())).tolist(), strict=True))
    address = ctypes.cast(getattr(handle, during.name()), ctypes.c_void_p).value or 0
    return CompiledBody(handle, address, precomputed, rows, columns, ends, (during.sz_iw(), during.sz_w()))


def body_source(model: pin.Model) -> tuple[str, str]:
    """Return the C of a model's rigid body, and its function's name."""
    during = _rigid_body_laws(tree_of(model).joints, model.nq, model.nv)[1]
    return generated_source(during, name="body"), during.name()


@lru_cache(maxsize=64)
def _rigid_body_laws(joints: tuple[Joint, ...], nq: int, nv: int) -> tuple[ca.Function, ca.Function]:
    return split_law(rigid_body(joints, nq, nv), nq + nv + 3)


@lru_cache(maxsize=64)
def _compile_body(joints: tuple[Joint, ...], nq: int, nv: int) -> tuple[ctypes.CDLL, ca.Function, ca.Function]:
    before, during = _rigid_body_laws(joints, nq, nv)
    return shared_library(generated_source(during), "rigid_body"), before, during


def elimination(
    model: pin.Model, coupled: Sequence[tuple[int, int]], together: Sequence[int]
) -> tuple[list[int], list[list[int]]]:
    """Return the free velocities from the leaves to the base, and what each still meets when it is eliminated.

    A velocity meets those of the joints that bear its own or that it bears. What `together` lists (what a body effect
    acts on) all meet; a leader meets what its follower (follower, leader) met, which is free no more.
    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.5; fill-in as of any sparse factorisation.
    """
    meets: list[set[int]] = [set() for _ in range(model.nv)]
    for joint in range(1, model.njoints):
        _all_meet(meets, _bears(model, joint))
    _all_meet(meets, together)
    for follower, leader in coupled:
        for neighbour in list(meets[follower]):
            _all_meet(meets, {leader, neighbour})
    bound = {follower for follower, _ in coupled}
    order = [i for i in range(model.nv - 1, -1, -1) if i not in bound]
    above = []
    for i in order:
        remaining = {j for j in meets[i] if j < i and j not in bound}
        _all_meet(meets, remaining)
        above.append(sorted(remaining))
    return order, above


def _bears(model: pin.Model, joint: int) -> list[int]:
    """Return the velocities that move a joint."""
    bearers = (model.joints[support] for support in list(model.supports[joint])[1:])
    return [index for bearer in bearers for index in range(bearer.idx_v, bearer.idx_v + bearer.nv)]


def _all_meet(meets: list[set[int]], group: Iterable[int]) -> None:
    """Let all of a group meet; that each then meets itself as well says nothing."""
    members = set(group)
    for i in members:
        meets[i] |= members
