"""Which joint of a URDF plays which part: what `new-rover` proposes."""

from pathlib import Path

from rover_pin.base.errors import UrdfError
from rover_pin.rover.description.tree import UrdfTree
from rover_pin.rover.proposal.guessed_axles import axles_of, candidates_of, upright
from rover_pin.rover.proposal.parts import FRAMES, GuessedAxle, Proposal
from rover_pin.rover.proposal.passive import passive_wheels
from rover_pin.rover.proposal.suspension import add_suspension
from rover_pin.rover.proposal.topology import Topology


def propose(tree: UrdfTree, folder: Path) -> Proposal:
    """Return the roles of a URDF's joints; `folder` is where its meshes are looked for.

    Raises
    ------
    UrdfError
        Fewer than two pairs of wheels are found, or some that no motor turns.
    """
    view = Topology(tree)
    best: list[tuple[int, tuple[float, float, float], list[GuessedAxle]]] = []
    candidates = candidates_of(view, folder)
    for refusal in passive_wheels(view, {joint.name: size.r for joint, size in candidates}):
        raise UrdfError(f"{tree.file}: {refusal}; take them off, or a rover whose wheels are all driven.")
    for rpy in FRAMES:
        axles = axles_of(view, candidates, rpy)
        if len(axles) >= 2 and upright(view, axles, rpy):
            best.append((len(axles), rpy, axles))
    if not best:
        raise UrdfError(
            f"{tree.file}: no two axles of wheels are found: joints that turn without end or by a full turn, with "
            "nothing moving below them, in pairs left and right of each other, axes across the base (+-y), round "
            f"about them. {len(candidates)} joints might be wheels"
            + (f" ({', '.join(joint.name for joint, _ in candidates)})" if candidates else "")
            + ": write the TOML by hand, as urdf/cart.toml."
        )
    _, rpy, axles = max(best, key=lambda option: option[0])
    return add_suspension(view, Proposal(view.base, rpy, tuple(axles)))
