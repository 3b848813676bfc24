"""Compaction resistance of a wheel: the force that presses its rut, and the increase of this force in softer soil."""

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import entry_graded
from rover_pin.soil.stress import stress_scale

PRESSURE_NODES = 8
"""Number of quadrature nodes for the part of the normal force, Eq (6), that the normal stress carries. Only the ratio
of this part in two soils is used. The error of the ratio is 2.1e-4 for sinkage exponents n = 0.4 to 2."""
ITERATIONS = 2
"""Number of iterations for the entry angle in firm soil. After two iterations, the error of the resistance is 0.2 % of
the load for sinkages h up to 0.45 r, where r is the wheel radius."""


def compaction(theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the compaction resistance of a wheel [N], r b int sigma sin theta dtheta: the second term of Eq (7), the
    drawbar pull.

    The integral over the contact arc is exact: r b stress_scale (cos theta_2 - cos theta_1)^(n+1) / (n + 1), with the
    wheel radius r, the width b, the exit angle theta_2 and the sinkage exponent n. This is Bekker's work of compaction
    for each metre, b int p dz, from the depth at the exit to the sinkage.

    Parameters
    ----------
    theta_1 : Scalar
        Entry angle [rad].
    length : Scalar
        Length of the contact arc, theta_1 - theta_2 [rad].
    """
    # cos theta_2 - cos theta_1 as a product, which loses no digits at small angles. Its minimum keeps the derivative of
    # the power finite.
    exit_depth = ca.fmax(2 * ca.sin(theta_1 - length / 2) * ca.sin(length / 2), 1e-300)
    return wheel.r * wheel.b * stress_scale(wheel, soil) * exit_depth ** (soil.n + 1) / (soil.n + 1)


def sinking_resistance(h: Scalar, wheel: Wheel, soil: Soil, firm: Soil) -> Scalar:
    """Return the additional compaction resistance [N] of a wheel in soft soil: its resistance in `soil`, into which it
    has sunk by h [m], minus its resistance in `firm` soil under an equal load. The result is 0 or more.

    In firm soil the wheel would sink less. Its entry angle theta_0 in firm soil is found by two iterations of theta_0 =
    theta_1 (p_soil / p_firm)^(1 / (2 n + 1)). Here theta_1 is the entry angle in the soft soil, n the sinkage exponent
    of the firm soil, and p the part of the normal force of Eq (6) that the normal stress carries in either soil: p
    grows with the entry angle by about the power 2 n + 1. theta_0 is limited to the angle of a wheel that has sunk to
    its axle. The result is exactly 0 if the soils are equal.

    Source: Bekker's work of compaction for each metre of rut, with the pressure of Eq (4). The part of the load that
    the shear stress carries in Eq (6) is neglected, because it is nearly equal in both soils.
    """
    # Both soils carry an equal load, and their contact arcs have one ratio of exit angle to entry angle.
    theta_1, theta_2 = SinkageAngles().angles(h, wheel, soil)
    length = theta_1 - theta_2
    # The arc shrinks by the factor `shrunk` until the pressure of the firm soil carries the load of the soft one.
    carried, shrunk = _pressure_load(theta_1, length, wheel, soil), 1.0
    for _ in range(ITERATIONS):
        ratio = carried / _pressure_load(theta_1 * shrunk, length * shrunk, wheel, firm)
        shrunk = ca.fmin(shrunk * ratio ** (1 / (2 * firm.n + 1)), ca.pi / 2 / theta_1)
    in_firm_soil = compaction(theta_1 * shrunk, length * shrunk, wheel, firm)
    return ca.fmax(compaction(theta_1, length, wheel, soil) - in_firm_soil, 0.0)


def _pressure_load(theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the part of the normal force of Eq (6) that the normal stress carries, divided by the wheel's radius and
    width [Pa rad].
    """
    # A shear law of 0 leaves the normal stress alone.
    arc = integrate(theta_1, 0.0, length, lambda s, rise: 0.0, (0.0, 0.0, soil.n), entry_graded(PRESSURE_NODES))
    return stress_scale(wheel, soil) * arc.sigma_cos
