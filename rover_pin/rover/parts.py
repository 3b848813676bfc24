"""The parts of a rover that are known by their places in Pinocchio's vectors: wheels, the differential, couplings."""

from dataclasses import dataclass
from typing import NamedTuple

from rover_pin.contact import Wheel


@dataclass(frozen=True)
class WheelMount:
    """A wheel on the rover; `joint` is Pinocchio's, `dof` and `steer_dof` count in v."""

    name: str
    joint: int
    dof: int
    steer_dof: int | None
    side: str
    "'l' or 'r'"
    axle: int
    "0 is the front"
    wheel: Wheel


class Differential(NamedTuple):
    """theta_s1 = -theta_s2: the two rockers' places in v (and in q), so that v[left] + v[right] = 0."""

    left: int
    right: int
    q_left: int
    q_right: int


class Coupling(NamedTuple):
    """v[follower] = ratio v[leader], and the angles likewise: a parallel link's joints, declared by <mimic>.

    Wheels that are tied together turn at one rate and have no angle: `q_follower` and `q_leader` are None.
    """

    follower: int
    leader: int
    ratio: float
    q_follower: int | None
    q_leader: int | None
