"""What it costs to press a rut: the compaction resistance, and how it grows where a wheel is made to sink deeper."""

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import entry_graded
from rover_pin.soil.stress import stress_scale

PRESSURE_NODES = 8
"""Nodes for the pressure's share of Eq (6), of which only a ratio is taken: 2.1e-4 of it for n = 0.4 to 2."""
STEPS = 2
"""Steps towards the sinkage in firm soil: the resistance to 0.2 % of the load down to h = 0.45 r."""


def compaction(theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return r b int sigma sin theta dtheta [N] over an arc of this length [rad], the second part of Eq (7).

    Exact: scale (cos theta_2 - cos theta_1)^(n+1) / (n + 1), which is Bekker's b int p dz from the exit's depth to h.
    """
    exit_depth = ca.fmax(2 * ca.sin(theta_1 - length / 2) * ca.sin(length / 2), 1e-300)
    return wheel.r * wheel.b * stress_scale(wheel, soil) * exit_depth ** (soil.n + 1) / (soil.n + 1)


def sinking_resistance(h: Scalar, wheel: Wheel, soil: Soil, firm: Soil) -> Scalar:
    """Return by how much compaction at h [m] in `soil` exceeds that in `firm` soil under the same load [N], 0 at least.

    The wheel would stand less deep in firm soil: theta_0 = theta_1 (p_soil / p_firm)^(1 / (2 n + 1)), twice over, with
    p the pressure's share of Eq (6) and n of the firm soil, as p grows with theta by about that power; to its axle at
    most. Exactly 0 where the soils are equal.

    Source: Bekker's work of compaction per length of rut, with the pressure of Eq (4); the load is balanced without
    the shear's share of Eq (6), which is much the same in both.
    """
    theta_1, theta_2 = SinkageAngles().angles(h, wheel, soil)
    length = theta_1 - theta_2
    carried, shrunk = _pressure_load(theta_1, length, wheel, soil), 1.0
    for _ in range(STEPS):
        ratio = carried / _pressure_load(theta_1 * shrunk, length * shrunk, wheel, firm)
        shrunk = ca.fmin(shrunk * ratio ** (1 / (2 * firm.n + 1)), ca.pi / 2 / theta_1)
    before = compaction(theta_1 * shrunk, length * shrunk, wheel, firm)
    return ca.fmax(compaction(theta_1, length, wheel, soil) - before, 0.0)


def _pressure_load(theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    arc = integrate(theta_1, 0.0, length, _no_shear, (0.0, 0.0, soil.n), entry_graded(PRESSURE_NODES))
    return stress_scale(wheel, soil) * arc.sigma_cos


def _no_shear(s: Scalar, rise: Scalar) -> Scalar:
    return 0.0
