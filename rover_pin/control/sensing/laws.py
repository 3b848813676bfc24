"""The laws of the particle filter in `belief.c`: how the slip and the hole depth of a particle change, and the
probability densities of the readings.

Each law is a CasADi function of one particle, which C evaluates for several particles at once.
"""

from dataclasses import dataclass

import casadi as ca

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.control.slip_control import HoleLaw
from rover_pin.effects.digging_memory import TOUCH
from rover_pin.effects.slip import RelaxedSlip

MIN_LEVEL = 0.3
"""Minimum cosine of the ground's slope as the divisor of a forward speed [-]. Slopes above 73 deg count as 73 deg."""
FACTOR_RANGE = 2.0
"""Width of the range over which the torque factor of an outlier (a wheel at a wall or a stone) is uniformly distributed
[-]. The torque factor is T / (r W), with the torque T of a wheel, its radius r and its load W."""
MIN_LIKELIHOOD = 1e-12
"""Minimum probability density of a reading, so that no particle gets the weight 0. It is also the minimum speed [m/s]
as a divisor in a law."""


@dataclass(frozen=True)
class ReadingTrust(Record):
    """The errors of the readings and the rates of events that the particle filter assumes. All of them were tuned on
    drives that no study uses.
    """

    strength: Scalar = quantity(0.05, "", "assumed: relative error of the soil's law and of loads", 1e-3, 1.0)
    factor: Scalar = quantity(0.015, "", "assumed: error of T / (r W) from the current", 1e-4, 1.0)
    wall: Scalar = quantity(0.5, "", "assumed: relative error of all factors where a wheel is at a wall", 0.0, 10.0)
    outliers: Scalar = quantity(0.1, "", "assumed: probability that a wheel meets a wall or a stone", 1e-9, 1.0)
    correlated: Scalar = quantity(0.3, "s", "assumed: torques within this time have one error", 1e-3, 10.0)
    memory: Scalar = quantity(25.0, "s", "assumed: the soil may change within this time", 0.1, 1e6)
    balance: Scalar = quantity(
        0.02, "", "assumed: error of the balance of forces, as a fraction of the weight", 1e-3, 1.0
    )
    balance_correlated: Scalar = quantity(
        1.0, "s", "assumed: balances of forces within this time have one error", 1e-3, 100.0
    )
    folds: Scalar = quantity(0.5, "s", "assumed: rises of wheels within this time have one error", 1e-3, 10.0)
    wander: Scalar = quantity(0.25, "1/sqrt(s)", "assumed: change of u / (r omega) within a second", 1e-4, 10.0)
    surprise: Scalar = quantity(0.02, "1/s", "assumed: rate of jumps to any speed", 0.0, 1.0)
    stalls: Scalar = quantity(0.1, "1/s", "assumed: rate at which a moving rover stalls", 0.0, 10.0)
    wall_stalls: Scalar = quantity(1.0, "1/s", "assumed: additional rate of stalling at a wall", 0.0, 10.0)
    frees: Scalar = quantity(0.2, "1/s", "assumed: rate at which a stalled rover comes free", 0.0, 10.0)
    quiet: Scalar = quantity(
        0.2, "", "assumed: probability that the wheels of a rover that moves on bent ground do not rise", 0.0, 1.0
    )
    climbing: Scalar = quantity(0.1, "", "assumed: probability that a wheel climbs new ground", 0.0, 1.0)
    lift: Scalar = quantity(0.33, "", "rise over distance of two of six wheels on a slope of 45 deg", 0.0, 10.0)
    settling: Scalar = quantity(0.0012, "m/s", "assumed: rise of a wheel of a rover that stands", 1e-5, 0.1)
    still: Scalar = quantity(0.0007, "m", "assumed: change of posture in 2 s of a rover that stands", 1e-5, 0.1)


def wheel_law(hole: HoleLaw, relaxed: RelaxedSlip, period: float) -> ca.Function:
    """Return the CasADi function that advances the slip s and the hole depth D of one wheel of a particle by a period.

    Its inputs are (u, s, D) and (ahead, level, rim, r). u is the forward speed of the base [m/s], `ahead` the forward
    speed of the wheel's centre relative to the base [m/s], `level` the cosine of the ground's slope, `rim` the rim
    speed [m/s] and r the radius of the wheel [m]. Its output is (s, D) one `period` [s] later. The wheel travels at the
    speed v = (u + ahead) / level. s follows from v and the rim speed by `RelaxedSlip`, and D by `HoleLaw.deepening`.
    """
    x, wheel = ca.SX.sym("x", 3), ca.SX.sym("wheel", 4)
    (u, s, D), (ahead, level, rim, r) = ca.vertsplit(x), ca.vertsplit(wheel)
    # The forward speed of the wheel's centre, measured along the slope of the ground.
    v = (u + ahead) / ca.fmax(level, MIN_LEVEL)
    contact = Contact(s, 0.0, TOUCH, v, 0.0, 0.0, rim, 0.0, 0, Wheel(r=r), Soil())
    rolling = ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v)), MIN_LIKELIHOOD)
    s_rate, _ = relaxed.rate(contact, Load(), (s, 0.0))
    D_rate = hole.replace(r=r).deepening(v, rim, D)
    # Euler's method. The step of the slip is at most its time constant, so that fast wheels do not overshoot.
    s_next, D_next = s + ca.fmin(period, relaxed.length / rolling) * s_rate, ca.fmax(D + period * D_rate, 0.0)
    return ca.Function("wheel_law", [x, wheel], [ca.vertcat(s_next, D_next)])


def torque_law(trust: ReadingTrust) -> ca.Function:
    """Return the CasADi function for the probability density of the torque that is measured at one wheel.

    Its inputs are F, the torque factor of the soil at the slip of the particle, and a vector of two numbers: the
    measured torque factor T / (r W) (torque T, wheel radius r, load W), and the variance of the relative error of F. F
    also has the absolute error `trust.factor`. With the probability `trust.outliers`, the wheel is at a wall or a
    stone, and all readings are equally likely.
    """
    # A normal density for a wheel on plain ground, and a constant density for an outlier.
    expected, read = ca.SX.sym("F"), ca.SX.sym("read", 2)
    variance = trust.factor**2 + read[1] * expected**2
    known = ca.exp(-0.5 * (read[0] - expected) ** 2 / variance) / ca.sqrt(2.0 * ca.pi * variance)
    return ca.Function("torque_law", [expected, read], [(1.0 - trust.outliers) * known + trust.outliers / FACTOR_RANGE])


def fold_law(trust: ReadingTrust) -> ca.Function:
    """Return the CasADi function for the log density of the speed at which the wheels rise relative to each other.

    On bent ground, the suspension of a moving rover folds, so that this speed indicates the speed of the rover. The
    inputs are the forward speed u of the particle [m/s], and the vector (rise, bend, wall): `rise` is the mean
    deviation of the wheels' rising speeds from their median [m/s], `bend` the mean deviation of the slopes under the
    wheels from their median [-], and `wall` states from 0 (no) to 1 (yes) whether the wheels are at a wall.
    """
    u, read = ca.SX.sym("u"), ca.SX.sym("read", 3)
    rise, bend, wall = ca.vertsplit(read)

    # An exponential density, whose mean grows with the speed u times the slope.
    def density(slope: Scalar) -> Scalar:
        size = ca.sqrt(trust.settling**2 + (u * slope) ** 2)
        return ca.exp(-rise / size) / size

    # Without climbing, the wheels rise with the bend of the ground, or not at all; at a wall, climbing is more likely.
    climbing = trust.climbing + (1.0 - trust.climbing) * wall
    even = trust.quiet * density(0.0) + (1.0 - trust.quiet) * density(bend)
    return ca.Function("fold_law", [u, read], [ca.log((1.0 - climbing) * even + climbing * density(bend + trust.lift))])


def still_law(trust: ReadingTrust) -> ca.Function:
    """Return the CasADi function for the log density of the change of the rover's posture within a few seconds.

    On bent ground, the heights of the wheels change by about half the travelled distance times the bend of the ground,
    which is the mean deviation of the slopes under the wheels from their median. If this expected change is smaller
    than the change that a rover at rest shows, the posture carries no information about the distance. The inputs are
    the distance that the particle has travelled in this time [m], and the vector (change of the wheels' heights [m],
    bend of the ground [-]).
    """
    distance, read = ca.SX.sym("way"), ca.SX.sym("read", 2)
    change, bent = read[0], ca.fabs(distance) * read[1]
    size = 0.5 * ca.sqrt(bent**2 + trust.still**2)
    moving, standing = (change / size**2 * ca.exp(-change / size), ca.exp(-change / trust.still) / trust.still)
    # The density of a moving rover comes in gradually, as the expected change exceeds that of a rover at rest.
    share = ca.fmin(bent / (4.0 * trust.still), 1.0)
    likely = (1.0 - share) * standing + share * (0.95 * moving + 0.05 * standing)
    return ca.Function("still_law", [distance, read], [ca.log(likely + MIN_LIKELIHOOD)])


def balance_law(trust: ReadingTrust) -> ca.Function:
    """Return the CasADi function for the log density of the excess in the balance of forces along the ground.

    The excess is the thrust of the wheels minus the slope, the motion resistance and the resistance of the holes that
    the wheels climb out of, divided by the weight. The inputs are the excess of the particle, and the variance that
    uncertain resistances and torques, bends of the ground and walls add to `trust.balance` squared. With the
    probability `trust.outliers`, an obstacle holds the rover, and all excesses are equally likely.
    """
    excess, added = ca.SX.sym("excess"), ca.SX.sym("variance")
    variance = trust.balance**2 + added
    balanced = ca.exp(-0.5 * excess**2 / variance) / ca.sqrt(2.0 * ca.pi * variance)
    density = (1.0 - trust.outliers) * balanced + trust.outliers / FACTOR_RANGE
    return ca.Function("balance_law", [excess, added], [ca.log(density)])


def belief_laws(holes: HoleLaw, relaxed: RelaxedSlip, trust: ReadingTrust, period: float) -> list[ca.Function]:
    """Return the five laws of the particle filter: how a wheel moves on, and the densities of the readings."""
    return [wheel_law(holes, relaxed, period), torque_law(trust), fold_law(trust), still_law(trust), balance_law(trust)]
