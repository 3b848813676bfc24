"""The belief's laws, a lane a particle: how slip and hole move on, and how likely what is read is."""

from dataclasses import dataclass

import casadi as ca

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.control.hole_law import HoleLaw
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip

LEAST_LEVEL = 0.3
"""Least cosine of a slope by which a way forwards is divided."""
FACTORS = 2.0
"""Range of T / (r W) over which a wheel that meets something else may read anything."""
POSSIBLE = 1e-12
"""Likelihood that anything keeps."""


@dataclass(frozen=True)
class ReadingTrust(Record):
    """How far the estimator trusts what it knows (all assumed, set on drives that no study counts)."""

    strength: Scalar = quantity(0.05, "", "assumed: relative error of the soil's law and of loads", 1e-3, 1.0)
    factor: Scalar = quantity(0.015, "", "assumed: error of T / (r W) from the current", 1e-4, 1.0)
    wall: Scalar = quantity(0.5, "", "assumed: relative error of all factors where a wheel stands at a wall", 0.0, 10.0)
    outliers: Scalar = quantity(0.1, "", "assumed: chance that a wheel meets a wall or a stone", 1e-9, 1.0)
    correlated: Scalar = quantity(0.3, "s", "assumed: torques nearer than this err alike", 1e-3, 10.0)
    folds: Scalar = quantity(0.5, "s", "assumed: rises of wheels nearer than this err alike", 1e-3, 10.0)
    wander: Scalar = quantity(0.25, "1/sqrt(s)", "assumed: change of u / (r omega) within a second", 1e-4, 10.0)
    surprise: Scalar = quantity(0.02, "1/s", "assumed: chance of any speed at all", 0.0, 1.0)
    stalls: Scalar = quantity(0.1, "1/s", "assumed: chance that a rover that moves stalls", 0.0, 10.0)
    wall_stalls: Scalar = quantity(1.0, "1/s", "assumed: the same at a wall, besides", 0.0, 10.0)
    frees: Scalar = quantity(0.2, "1/s", "assumed: chance that one that is stalled comes free", 0.0, 10.0)
    quiet: Scalar = quantity(0.2, "", "assumed: chance that a rover moves on bent ground and does not fold", 0.0, 1.0)
    climbing: Scalar = quantity(0.1, "", "assumed: chance that wheels climb what no wheel stood on yet", 0.0, 1.0)
    lift: Scalar = quantity(0.33, "", "two of six wheels up a slope of 45 deg: their rise over the way", 0.0, 10.0)
    settling: Scalar = quantity(0.0012, "m/s", "assumed: rise of a wheel of a rover that stands", 1e-5, 0.1)
    still: Scalar = quantity(0.0007, "m", "assumed: change of posture in 2 s of a rover that stands", 1e-5, 0.1)


def wheel_law(hole: HoleLaw, relaxed: RelaxedSlip, period: float) -> ca.Function:
    """Return the function (u, s, D), (ahead, level, rim, r) -> s and D a period later.

    v = (u + ahead) / level; s follows `RelaxedSlip`, D `HoleLaw.deepening`.
    """
    x, wheel = ca.SX.sym("x", 3), ca.SX.sym("wheel", 4)
    (u, s, D), (ahead, level, rim, r) = ca.vertsplit(x), ca.vertsplit(wheel)
    v = (u + ahead) / ca.fmax(level, LEAST_LEVEL)
    at = Contact(s, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(r=r), Soil())
    rolling = ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v)), POSSIBLE)
    s_rate, _ = relaxed.rate(at, Load(), (s, 0.0))
    D_rate = hole.replace(r=r).deepening(v, rim, D)
    s_next, D_next = s + ca.fmin(period, relaxed.length / rolling) * s_rate, ca.fmax(D + period * D_rate, 0.0)
    return ca.Function("wheel_law", [x, wheel], [ca.vertcat(s_next, D_next)])


def torque_law(trust: ReadingTrust) -> ca.Function:
    """Return the function F, (T / (r W), share) -> density of what is read; F errs by `factor` and a share of itself.

    A wheel at a wall or a stone may read anything (`outliers`).
    """
    expected, read = ca.SX.sym("F"), ca.SX.sym("read", 2)
    variance = trust.factor**2 + read[1] * expected**2
    known = ca.exp(-0.5 * (read[0] - expected) ** 2 / variance) / ca.sqrt(2.0 * ca.pi * variance)
    return ca.Function("torque_law", [expected, read], [(1.0 - trust.outliers) * known + trust.outliers / FACTORS])


def fold_law(trust: ReadingTrust) -> ca.Function:
    """Return the function u, (rise, bend) -> log density of wheels that rise so fast against each other."""
    u, read = ca.SX.sym("u"), ca.SX.sym("read", 3)
    rise, bend, wall = ca.vertsplit(read)

    def density(slope: Scalar) -> Scalar:
        size = ca.sqrt(trust.settling**2 + (u * slope) ** 2)
        return ca.exp(-rise / size) / size

    climbing = trust.climbing + (1.0 - trust.climbing) * wall
    even = trust.quiet * density(0.0) + (1.0 - trust.quiet) * density(bend)
    return ca.Function("fold_law", [u, read], [ca.log((1.0 - climbing) * even + climbing * density(bend + trust.lift))])


def still_law(trust: ReadingTrust) -> ca.Function:
    """Return the function way, (change of posture, bend) -> log density of that change over that way.

    Over bent ground wheels change their heights by about half the way times the bend; where that is less than what a
    rover at rest changes by, it tells nothing of the way.
    """
    way, read = ca.SX.sym("way"), ca.SX.sym("read", 2)
    change, bent = read[0], ca.fabs(way) * read[1]
    size = 0.5 * ca.sqrt(bent**2 + trust.still**2)
    moving, standing = (change / size**2 * ca.exp(-change / size), ca.exp(-change / trust.still) / trust.still)
    share = ca.fmin(bent / (4.0 * trust.still), 1.0)
    likely = (1.0 - share) * standing + share * (0.95 * moving + 0.05 * standing)
    return ca.Function("still_law", [way, read], [ca.log(likely + POSSIBLE)])
