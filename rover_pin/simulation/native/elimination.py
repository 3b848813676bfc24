"""In which order the step's equations are solved, so that a tree's zeros stay zeros."""

from collections.abc import Iterable, Sequence

import pinocchio as pin


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
