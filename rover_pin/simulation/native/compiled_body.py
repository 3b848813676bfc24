"""The compiled rigid-body dynamics of a rover, shared by all rovers with equal kinematic trees, and the order of the
elimination of speeds from its equations of motion.

CasADi generates the C code from the recursion in `rigid_body`. Pinocchio only supplies the model, from which the
recursion reads the tree, the placements and the inertias.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.simulation.compiled.laws import generated_source, split_law
from rover_pin.simulation.compiled.toolchain import shared_library
from rover_pin.simulation.native.rigid_body import Joint, inertia_places, rigid_body, tree_of


@dataclass(frozen=True)
class CompiledBody:
    """The compiled function of a rover's rigid-body dynamics, the constants that it takes for this rover, and the
    layout of its output (`rigid_body.Motion`).
    """

    handle: ctypes.CDLL
    """the loaded library; it is stored here because the address is valid only while it is loaded"""
    address: int
    """address of the compiled C function"""
    precomputed: np.ndarray
    """constants of the rover: the values of all expressions that depend on masses and lengths only"""
    rows: np.ndarray
    columns: np.ndarray
    """rows and columns: row and column, in the upper triangle of the joint-space inertia, of each inertia entry in the
    output"""
    ends: dict[str, int]
    """name of each part of `Motion` -> index behind its last entry in the output column"""
    work: tuple[int, int]
    """sizes of the integer and of the real work space that the function needs"""


@dataclass(frozen=True)
class KeyedModel:
    """A Pinocchio model in a form that can be a key of a cache: two models with equal content compare as equal, so that
    a result that was computed for one of them is used for the other.
    """

    content: bytes
    model: pin.Model = field(compare=False)

    @classmethod
    def of(cls, model: pin.Model) -> KeyedModel:
        """Return the model as a key of a cache, together with bytes for the comparison of models."""
        return cls(_content(model), model)


def _content(model: pin.Model) -> bytes:
    """Return everything that `tree_of` reads from a model, as bytes. Two models with equal bytes have equal kinematic
    trees, masses and lengths.
    """
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
    """Return the order in which the speeds of a model are eliminated from its equations of motion (see `elimination`).
    The order is computed once for all models with equal content.
    """
    return elimination(keyed_model.model, coupled, together)


@lru_cache(maxsize=64)
def compiled_body(keyed_model: KeyedModel) -> CompiledBody:
    """Return the compiled rigid-body dynamics of a model.

    The numbers of the model (masses, lengths) are parameters of the compiled function, so that a sweep over them
    compiles once.
    """
    model = keyed_model.model
    tree = tree_of(model)
    handle, before, during = _compile_body(tree.joints, model.nq, model.nv)
    precomputed = np.array(before(np.zeros(0), tree.parameters)).ravel()
    rows, columns = np.array(inertia_places(tree.joints), dtype=np.int64).T
    # Layout of the output column, in the order of `Motion`.
    joints = len(tree.joints) - 1
    lengths = {"inertia": len(rows), "bias": model.nv, "axes": 3 * joints, "points": 3 * joints}
    lengths |= {"rotation": 9, "potential": 1}
    ends = dict(zip(lengths, np.cumsum(list(lengths.values())).tolist(), strict=True))
    address = ctypes.cast(getattr(handle, during.name()), ctypes.c_void_p).value or 0
    return CompiledBody(handle, address, precomputed, rows, columns, ends, (during.sz_iw(), during.sz_w()))


def body_source(model: pin.Model) -> tuple[str, str]:
    """Return the C source of a model's rigid-body dynamics, and the name of the C function in it."""
    during = rigid_body_laws(tree_of(model).joints, model.nq, model.nv)[1]
    return generated_source(during, name="body"), during.name()


@lru_cache(maxsize=64)
def rigid_body_laws(joints: tuple[Joint, ...], nq: int, nv: int) -> tuple[ca.Function, ca.Function]:
    """Return the rigid-body dynamics of a kinematic tree as two CasADi functions: the constants that depend on masses
    and lengths only, and the rest (`split_law`).
    """
    return split_law(rigid_body(joints, nq, nv), nq + nv + 3)


@lru_cache(maxsize=64)
def _compile_body(joints: tuple[Joint, ...], nq: int, nv: int) -> tuple[ctypes.CDLL, ca.Function, ca.Function]:
    before, during = rigid_body_laws(joints, nq, nv)
    return shared_library(generated_source(during), "rigid_body"), before, during


def elimination(
    model: pin.Model, coupled: Sequence[tuple[int, int]], together: Sequence[int]
) -> tuple[list[int], list[list[int]]]:
    """Return the order in which the speeds are eliminated from the equations of motion. For each eliminated speed, also
    return those speeds, eliminated later, whose equations the elimination changes.

    Two speeds are called neighbours if their entry in the system matrix is not zero. The speeds of a joint and of a
    joint that carries it are neighbours. Elimination from the leaves of the tree to the base creates no further
    entries.

    Parameters
    ----------
    model : pin.Model
        The kinematic tree.
    coupled : sequence of (follower, leader)
        Joints whose speeds have a fixed ratio. The coupling itself eliminates the follower; its leader becomes a
        neighbour of all neighbours of the follower.
    together : sequence of int
        Speeds that a body effect couples with each other: all of them are neighbours.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.5; fill-in as in any sparse factorisation.
    """
    meets: list[set[int]] = [set() for _ in range(model.nv)]
    for joint in range(1, model.njoints):
        # The speeds that move this joint: those of the joints that carry it. The first of its supports is the world.
        carriers = (model.joints[support] for support in list(model.supports[joint])[1:])
        _all_meet(meets, [place for carrier in carriers for place in range(carrier.idx_v, carrier.idx_v + carrier.nv)])
    _all_meet(meets, together)
    for follower, leader in coupled:
        for neighbour in list(meets[follower]):
            _all_meet(meets, {leader, neighbour})
    bound = {follower for follower, _ in coupled}
    order = [i for i in range(model.nv - 1, -1, -1) if i not in bound]
    above = []
    # Eliminating a speed makes all its neighbours neighbours of each other: the fill-in.
    for i in order:
        remaining = {j for j in meets[i] if j < i and j not in bound}
        _all_meet(meets, remaining)
        above.append(sorted(remaining))
    return order, above


def _all_meet(meets: list[set[int]], group: Iterable[int]) -> None:
    """Make all speeds of a group neighbours of each other and of themselves. `meets` holds the neighbours of each speed
    and is changed.
    """
    members = set(group)
    for i in members:
        meets[i] |= members
